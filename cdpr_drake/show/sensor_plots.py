"""Figures of what sensors are worth, and of what wrong calibrations do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cdpr_drake.analysis.calibration_study import CalibrationEffect
from cdpr_drake.batch.ablation import Ablation, Statistic
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

    A dot is the mean over the seeds, its bar the standard deviation of one run, over white noise
    and fixed biases together, which a seed draws both; what differs from all sensors by more than
    these explain is filled with another colour. A set without a dot did
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


CALIBRATION_PANELS = (
    ("position_error", "error at rest [mm]"),
    ("orientation_error", "error at rest [deg]"),
    ("position_excursion", "led aside [mm]"),
    ("orientation_excursion", "led aside [deg]"),
    ("tension_change", "tension changed [N]"),
)


def calibration_study_figure(effects: Sequence[CalibrationEffect]) -> Figure:
    """Return what random calibrations do, a row for each kind and size of error.

    Each calibration is a faint dot; bars mark the median and nine of ten. Errors of nothing are
    left out, so that what has no effect has no dots.

    Args:
        effects: from `calibration_effect`.

    Raises:
        ValueError: there are none.
    """
    if not effects:
        raise ValueError("no effects to draw")
    figure = _figure(12.0, 1.0 + 0.42 * len(effects))
    grid = figure.subplots(1, len(CALIBRATION_PANELS), sharey=True)
    places = -np.arange(len(effects), dtype=float)
    rng = np.random.default_rng(0)  # spreads the dots, no more
    for axes, (name, title) in zip(grid, CALIBRATION_PANELS, strict=True):
        axes.grid(True, axis="x", color="0.9", linewidth=0.7)
        axes.set_axisbelow(True)
        for place, effect in zip(places, effects, strict=True):
            values = getattr(effect, name)
            values = values[np.isfinite(values) & (values > 1e-9)]
            if values.size == 0:
                continue
            heights = place + rng.uniform(-0.22, 0.22, values.size)
            axes.plot(values, heights, ".", color=RUN_COLOURS[0], alpha=0.35, markersize=4)
            for q, colour in ((0.5, "black"), (0.9, RUN_COLOURS[1])):
                at = np.quantile(values, q)
                axes.plot([at, at], [place - 0.34, place + 0.34], color=colour, linewidth=2)
        axes.set_xlabel(title)
        axes.set_xscale("symlog", linthresh=_smallest_decade(effects, name))
        axes.set_xlim(left=0.0)
    labels = [f"${e.group}$" if "_" in e.group else e.group for e in effects]
    sizes = [f" × {e.factor:g}" if e.factor != 1.0 else "" for e in effects]
    grid[0].set_yticks(places, [a + b for a, b in zip(labels, sizes, strict=True)])
    grid[0].set_ylim(places[-1] - 0.6, 0.6)
    figure.supxlabel("black: half of the calibrations do less; orange: nine of ten", fontsize=9)
    return figure


def _smallest_decade(effects: Sequence[CalibrationEffect], name: str) -> float:
    """Return the power of ten below most of what there is, where a log scale may begin."""
    values = np.concatenate([getattr(e, name) for e in effects])
    values = values[np.isfinite(values) & (values > 1e-9)]
    return float(10.0 ** np.floor(np.log10(np.quantile(values, 0.1)))) if values.size else 1.0
