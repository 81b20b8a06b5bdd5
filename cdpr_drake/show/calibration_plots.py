"""The figure of a calibration: every parameter's error beside what was predicted for it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from cdpr_drake.model.calibration.result import Calibration, ParameterGroup
from cdpr_drake.show.plots import _figure, _legend_below
from cdpr_drake.show.style import REFERENCE, RUN_COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANELS = (
    ("drawing and attachment points [mm]", ("A_i", "B_i")),
    (
        "translations [mm]",
        tuple(f"{X} translation" for X in ("X_WF", "X_PM", "X_FC", "X_FL", "X_LR")),
    ),
    ("rotations [deg]", tuple(f"{X} rotation" for X in ("X_WF", "X_PM", "X_FC", "X_FL", "X_LR"))),
    ("focal lengths and principal points [px]", ("focal length", "principal point")),
    ("distortion: $k_1, k_2, p_1, p_2, k_3$ [$10^{-3}$]", ("distortion",)),
)
"""Title of each panel, and the groups in it."""


def calibration_figure(calibration: Calibration) -> Figure:
    """Return a figure of the errors of all parameters, with bars of one predicted sigma.

    The darker bar inside is the fixed part of it, which calibrating again would not average out.
    About two of three dots should be within their bars, and hardly one beyond three times as far;
    those are drawn as crosses. Below each group, the root mean squares of errors and of sigmas.

    Args:
        calibration: the calibration.
    """
    groups = {group.name: group for group in calibration.groups}
    shown = [(title, [groups[n] for n in names if n in groups]) for title, names in PANELS]
    shown = [(title, there) for title, there in shown if there]
    figure = _figure(11.0, 2.6 * len(shown))
    panels = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
    for axes, (title, there) in zip(panels, shown, strict=True):
        _draw(axes, title, there)
    _legend_below(figure, panels[0])
    return figure


def _draw(axes: Axes, title: str, groups: list[ParameterGroup]) -> None:
    """Draw groups side by side in a panel, with a line between them."""
    start, ticks, labels = 0, [], []
    top = max(np.abs(np.concatenate([[1e-12], *[g.errors for g in groups]])).max(), 1e-12)
    top = max(top, max((g.sigmas.max() for g in groups), default=0.0))
    for i, group in enumerate(groups):
        x = start + np.arange(group.errors.size)
        _draw_group(axes, x, group, first=i == 0)
        below = f"{_name(group)}\nerror {group.rms_error:.2g}\nσ {group.rms_sigma:.2g}"
        axes.text(x.mean(), 1.5 * top, below, ha="center", va="center", fontsize=8.5)
        if i:
            axes.axvline(start - 1.0, color="0.7", linewidth=0.8)
        ticks += x.tolist()
        labels += list(group.labels)
        start = int(x[-1]) + 2
    axes.axhline(0.0, color=REFERENCE, linewidth=0.8, zorder=0)
    axes.set_xticks(ticks, labels, rotation=90, fontsize=6.5)
    axes.set_xlim(-1.0, start - 1.0)
    axes.set_ylim(-1.15 * top, 1.95 * top)
    axes.set_title(title, fontsize=10, loc="left")
    axes.grid(True, axis="y", color="0.92", linewidth=0.7)
    axes.set_axisbelow(True)


def _draw_group(axes: Axes, x: Any, group: ParameterGroup, first: bool) -> None:
    far = np.abs(group.errors) > np.maximum(3.0 * group.sigmas, 1e-9)
    for sigmas, width, colour, label in (
        (group.sigmas, 0.7, "0.85", "predicted, ±1σ"),
        (group.fixed_sigmas, 0.4, "0.7", "the fixed part of it, ±1σ"),
    ):
        axes.bar(
            x,
            2.0 * sigmas,
            bottom=-sigmas,
            width=width,
            color=colour,
            label=label if first else None,
        )
    for chosen, marker, colour, label in (
        (~far, "o", RUN_COLOURS[0], "error: calibrated less true"),
        (far, "X", RUN_COLOURS[1], "error beyond 3σ"),
    ):
        axes.plot(
            x[chosen],
            group.errors[chosen],
            marker,
            color=colour,
            markersize=3.5 if marker == "o" else 6.0,
            label=label if first else None,
        )


def _name(group: ParameterGroup) -> str:
    name = group.name.split()[0]
    if "_" not in name:
        return group.name
    letter, index = name.split("_")
    return f"${letter}_{{{index}}}$"
