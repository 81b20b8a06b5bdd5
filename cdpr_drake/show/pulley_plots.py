"""The figure of what it costs to believe other things of pulleys than are true."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cdpr_drake.model.digits import significant
from cdpr_drake.runs.pulley_study import CONTROLLERS, BeliefCost, PulleyStudy
from cdpr_drake.show.plots import _figure
from cdpr_drake.show.style import REFERENCE, RUN_COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANELS = (
    ("position_error", "position error at the end [mm]"),
    ("apart", "off the run with the true belief [mm]"),
    ("tension_change", "tensions off, at most [%]"),
)
"""What is drawn of both controllers, on scales of logarithms."""

RATES = "eigenvalues of $\\Gamma$ at the goal [-]"

LEAST = 0.01
"""What is smaller is drawn here [mm, %]."""

STYLES: dict[str, dict[str, Any]] = {
    "JSC": {"color": RUN_COLOURS[1], "marker": "s", "label": "joint space control (JSC)"},
    "VBC": {"color": RUN_COLOURS[0], "marker": "o", "label": "vision-based control (VBC)"},
}


def pulley_figure(studies: Sequence[PulleyStudy]) -> Figure:
    """Return what each belief costs under each controller, a row of panels for each study.

    A square is joint space control, a disc vision-based control, the line between them what cameras
    take away. At the right a bar from the slowest to the fastest eigenvalue of Gamma; the grey band
    is that of the true belief. Where a marker is missing the run did not come to its end.

    Args:
        studies: from `pulley_study`.

    Raises:
        ValueError: there are none.
    """
    from matplotlib.lines import Line2D

    if not studies:
        raise ValueError("no studies to draw")
    heights = [1.0 + 0.3 * len(study.of("JSC")) for study in studies]
    figure = _figure(13.0, 0.6 + sum(heights))
    grid = figure.subplots(len(studies), len(PANELS) + 1, squeeze=False, height_ratios=heights)
    for row, study in zip(grid, studies, strict=True):
        beliefs = list(study.of("JSC"))
        for axes in row:
            axes.grid(True, axis="x", color="0.9", linewidth=0.7)
            axes.set_axisbelow(True)
            axes.set_ylim(-len(beliefs) + 0.4, 0.6)
            axes.set_yticks([])
        row[0].set_yticks(-np.arange(len(beliefs)), beliefs)
        for axes, (metric, _) in zip(row, PANELS, strict=False):
            _draw_costs(axes, study, metric)
        _draw_rates(row[-1], study)
        row[0].set_title(_title(study), fontsize=10, loc="left")
    for column, label in zip(grid.T, [*(title for _, title in PANELS), RATES], strict=True):
        column[-1].set_xlabel(label)
    for column in grid.T[: len(PANELS)]:
        limits = [axes.get_xlim() for axes in column]
        low, high = min(x for x, _ in limits), max(x for _, x in limits)
        for axes in column:
            axes.set_xlim(max(low, LEAST) / 15.0, 8.0 * high)
    handles = [Line2D([], [], linestyle="", markersize=7, **style) for style in STYLES.values()]
    figure.legend(handles=handles, loc="outside upper right", ncols=2, frameon=False)
    return figure


def _title(study: PulleyStudy) -> str:
    return (
        f"{study.robot}, {study.move}: {study.distance:.2f} m, pulleys of "
        f"{1e3 * study.radius:g} mm, $\\lambda$ = {study.gain:g} s$^{{-1}}$"
    )


def _draw_costs(axes: Axes, study: PulleyStudy, metric: str) -> None:
    """Draw one metric of all beliefs; the true one where others are not compared with it."""
    names = list(study.of("JSC"))
    values = {c: _values(study.of(c), metric) for c in CONTROLLERS}
    for i, name in enumerate(names):
        pair = sorted((found[name], c) for c, found in values.items() if name in found)
        if i == 0 and not any(value for value, _ in pair):
            place: dict[str, Any] = {"transform": axes.get_yaxis_transform(), "va": "center"}
            axes.text(0.04, 0.0, "the reference", fontsize=8.5, color="0.35", **place)
            continue
        shown = [max(value, LEAST) for value, _ in pair]
        axes.plot(shown, len(pair) * [-i], color=REFERENCE, linewidth=2.0, alpha=0.6, zorder=1)
        for at, (value, controller), side in zip(shown, pair, (-1, 1), strict=False):
            axes.plot(at, -i, linestyle="", markersize=7, zorder=3, **STYLES[controller])
            axes.annotate(
                significant(value, 2) if value >= LEAST else f"< {LEAST:g}",
                (at, -i),
                xytext=(7 * side, 0),
                textcoords="offset points",
                ha="right" if side < 0 else "left",
                va="center",
                fontsize=8,
                color=STYLES[controller]["color"],
            )
    axes.set_xscale("log")


def _values(rows: dict[str, BeliefCost], metric: str) -> dict[str, float]:
    found = {name: getattr(row, metric) for name, row in rows.items()}
    return {name: value for name, value in found.items() if value is not None}


def _draw_rates(axes: Axes, study: PulleyStudy) -> None:
    """Draw from the slowest to the fastest eigenvalue of each belief."""
    rows = list(study.of("VBC").values())
    axes.axvline(1.0, color=REFERENCE, linewidth=1.2, zorder=0)
    for place, row in zip(-np.arange(len(rows)), rows, strict=True):
        if row.slowest is None or row.fastest is None:
            continue
        if place == 0:
            axes.axvspan(row.slowest, row.fastest, color="0.85", alpha=0.6, zorder=0)
        ends = [row.slowest, row.fastest]
        axes.plot(ends, [place, place], "|-", color=RUN_COLOURS[0], markersize=9, linewidth=2.5)
