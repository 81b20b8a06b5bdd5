"""Figures of what sensors are worth, and of what wrong calibrations do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cdpr_drake.experiments.ablation import Ablation, Statistic
from cdpr_drake.show.plots import _figure
from cdpr_drake.show.style import REFERENCE, RUN_COLOURS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PANELS = (
    ("position_error", "final error [mm]"),
    ("orientation_error", "final error [deg]"),
    ("settled_after", "to 2 % [s]"),
    ("lowest_tension", "lowest tension [N]"),
)


def ablation_figure(ablations: Sequence[Ablation]) -> Figure:
    """Return what each set of sensors gives, a row of panels for each robot.

    A dot is the mean over the seeds, its bar the standard deviation of one run; what differs from
    all sensors by more than noise explains is filled with another colour. A set without a dot did
    not get there.

    Args:
        ablations: one for each robot.

    Raises:
        ValueError: there are none.
    """
    if not ablations:
        raise ValueError("no ablations to draw")
    heights = [1.0 + 0.3 * len(a.rows) for a in ablations]
    figure = _figure(11.0, 0.4 + sum(heights))
    grid = figure.subplots(len(ablations), len(PANELS), squeeze=False, height_ratios=heights)
    for axes_row, ablation in zip(grid, ablations, strict=True):
        places = -np.arange(len(ablation.rows))
        for axes, (metric, title) in zip(axes_row, PANELS, strict=True):
            axes.grid(True, axis="x", color="0.9", linewidth=0.7)
            axes.set_axisbelow(True)
            for place, row in zip(places, ablation.rows, strict=True):
                _dot(axes, float(place), row.statistics[metric])
            first = ablation.rows[0].statistics[metric].mean
            if first is not None:
                axes.axvline(first, color=REFERENCE, linewidth=0.8, zorder=0)
            axes.set_ylim(places[-1] - 0.6, 0.6)
            axes.set_yticks([])
            axes.set_xlabel(title)
            if metric.endswith("error"):
                axes.set_xlim(left=0.0)
            elif first is not None:
                low, high = axes.get_xlim()
                axes.set_xlim(min(low, 0.95 * first), max(high, 1.05 * first))
        axes_row[0].set_yticks(places, [row.sensors.label for row in ablation.rows])
        text = f"{ablation.robot}: {ablation.distance:.2f} m, $\\lambda$ = {ablation.gain:g} 1/s"
        axes_row[0].set_title(text, fontsize=10, loc="left")
    return figure


def _dot(axes: Any, place: float, value: Statistic) -> None:
    if value.mean is None:
        axes.text(0.03, place, "not reached", transform=axes.get_yaxis_transform(), va="center")
        return
    axes.errorbar(
        value.mean,
        place,
        xerr=value.deviation,
        fmt="D" if value.is_told_apart else "o",
        color=RUN_COLOURS[1] if value.is_told_apart else RUN_COLOURS[0],
        capsize=3,
        markersize=5,
    )
