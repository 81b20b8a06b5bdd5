"""Figures of gain matrices: what the law's cable model costs, in rates, on the way, and where.

Every function returns a matplotlib Figure that belongs to no window. A cable model keeps its colour
and dashes in all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cdpr_drake.analysis.compare import Comparison, ModelComparison
from cdpr_drake.analysis.gain_matrix import GainMap
from cdpr_drake.model.cable_models import CABLE_MODELS
from cdpr_drake.model.digits import significant
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.show.plots import _dress, _figure, _legend_below
from cdpr_drake.show.style import REFERENCE, run_styles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TURN = 10.0
"""Size of the turn that is drawn, about (1, 1, 1) of M [deg]."""

PLAN_LIMIT = 1e-9
"""Coordinates of a map that differ by less are the same [m]."""


def rates_and_responses_figure(
    comparison: Comparison, gain: float = 0.1, until: float = 80.0
) -> Figure:
    """Return rates of convergence and responses of cable models, a column for each robot.

    Above: the rates, the eigenvalues of Gamma times lambda, one dot each; an exact model has all
    six at lambda. Below: responses s(t) = expm(-lambda Gamma t) s(0): the error of a turn by 10
    degrees, and how far a move leaves the straight way home, per metre, along that axis of M where
    it is most. The eigenvalues being real, that is coupling, not oscillation.

    Args:
        comparison: from `compare_cable_models`.
        gain: lambda [1/s].
        until: [s].

    Raises:
        ValueError: there is nothing to compare.
    """
    columns = _by_robot(comparison)
    if not columns:
        raise ValueError("no gain matrices to draw")
    figure = _figure(1.4 + 4.6 * max(len(columns), 2), 8.4)
    grid = figure.subplots(
        3, len(columns), sharex="row", sharey="row", squeeze=False, height_ratios=(0.8, 1.0, 1.0)
    )
    _dress(grid)
    models = list(dict.fromkeys(row.cable_model for row in comparison.rows))
    styles = run_styles([m for m in CABLE_MODELS if m in models])
    time = np.linspace(0.0, until, 401)
    for column, rows in zip(grid.T, columns, strict=True):
        column[0].set_title(f"{rows[0].robot}: {significant(rows[0].size, 2)} m", fontsize=11)
        _draw_rates(column[0], rows, models, styles, gain)
        _draw_turn(column[1], rows, styles, gain, time)
        _draw_excursion(column[2], rows, styles, gain, time)
    grid[0, 0].set_xmargin(0.2)
    grid[1, 0].set_ylim(TURN * np.exp(-1.02 * gain * until), 1.6 * TURN)
    grid[2, 0].set_ylim(bottom=0.0)
    grid[0, 0].set_ylabel("cable model of the law")
    grid[1, 0].set_ylabel("orientation error [deg]")
    grid[2, 0].set_ylabel("off the straight way [mm per m]")
    _legend_below(figure, grid[1, 0])
    return figure


def gain_map_figure(maps: Mapping[str, GainMap], robot: CableRobot | None = None) -> Figure:
    """Return gain matrices over a plane of the workspace, a column for each map.

    Above: the slowest rate of convergence as a share of lambda, below zero where no gain is stable.
    Below: the coupling, how far the platform is pushed aside per metre it is asked to move.

    Args:
        maps: by label, from `map_gain_matrix` at poses on a grid in two of x, y and z.
        robot: the robot, to mark its drawing points; they are left out if None.

    Raises:
        ValueError: no maps, or poses that are on no such grid.
    """
    if not maps:
        raise ValueError("no maps to draw")
    first, second = _plane(next(iter(maps.values())))
    extent = np.ptp(next(iter(maps.values())).poses[:, [3 + first, 3 + second]], axis=0)
    tall = float(np.clip(extent[1] / extent[0], 0.4, 1.5))
    figure = _figure(1.7 + 3.6 * max(len(maps), 2) / max(tall, 1.0), 1.1 + 7.2 * min(tall, 1.0))
    grid = figure.subplots(2, len(maps), sharex=True, sharey=True, squeeze=False)
    quantities: list[tuple[Callable[[GainMap], np.ndarray], str, str]] = [
        (lambda m: m.slowest, "slowest rate / $\\lambda$", "cividis"),
        (sideways, "pushed aside [mm per m]", "magma_r"),
    ]
    for row, (values, label, colours) in zip(grid, quantities, strict=True):
        shown = [values(m) for m in maps.values()]
        finite = np.concatenate([v[np.isfinite(v)] for v in shown])
        low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
        low, high = min(low, 0.0), max(high, 1.0)
        for axes, field, found in zip(row, shown, maps.values(), strict=True):
            mesh = _draw_field(axes, found, field, vmin=low, vmax=high, cmap=colours)
            if robot is not None:
                _mark_drawing_points(axes, found, robot)
        figure.colorbar(mesh, ax=list(row), label=label, pad=0.01)
    for axes, label in zip(grid[0], maps, strict=True):
        axes.set_title(label, fontsize=10)
    for axes in grid[-1]:
        axes.set_xlabel(f"{'xyz'[first]} [m]")
    for axes in grid[:, 0]:
        axes.set_ylabel(f"{'xyz'[second]} [m]")
    if any(m.reasons for m in maps.values()):
        figure.supxlabel("hatched: the robot cannot rest there", fontsize=8.5, color="0.35")
    return figure


def sideways(found: GainMap) -> np.ndarray:
    """Return how far the platform is pushed aside per distance asked for (n,) [mm/m].

    The largest part of Gamma's translation, over the three axes asked for, across that axis.

    Args:
        found: the map.
    """
    across = found.matrices[:, 3:, 3:] * (1.0 - np.eye(3))
    return np.asarray(1e3 * np.linalg.norm(across, axis=1).max(axis=1), float)


def _by_robot(comparison: Comparison) -> list[list[ModelComparison]]:
    robots: dict[str, list[ModelComparison]] = {}
    for row in comparison.rows:
        robots.setdefault(row.robot, []).append(row)
    return list(robots.values())


def _draw_rates(
    axes: Axes, rows: list[ModelComparison], models: list[str], styles: Any, gain: float
) -> None:
    """Draw six dots for each model; the slowest is told in figures."""
    axes.axvline(gain, color=REFERENCE, linewidth=1.2, zorder=0)
    for row in rows:
        height = len(models) - 1 - models.index(row.cable_model)
        rates = gain * row.gamma.eigenvalues.real
        colour = styles[row.cable_model]["color"]
        axes.plot(rates, np.full(6, height), "o", color=colour, markersize=6, alpha=0.65, mew=0)
        axes.annotate(
            f"{rates.min():.4f}",
            (float(rates.min()), height),
            xytext=(-7, 0),
            textcoords="offset points",
            ha="right",
            va="center",
            fontsize=8.5,
            color=colour,
        )
    axes.set_yticks(range(len(models)), reversed(models))
    axes.set_ylim(-0.6, len(models) - 0.4)
    axes.set_xlabel(f"rates of convergence [1/s], $\\lambda$ = {gain:g} s$^{{-1}}$ (grey line)")


def _draw_turn(
    axes: Axes, rows: list[ModelComparison], styles: Any, gain: float, time: np.ndarray
) -> None:
    """Draw the error of a turn on a log scale, and exp(-gain t)."""
    start = np.radians(TURN) / np.sqrt(3.0) * np.repeat([1.0, 0.0], 3)
    axes.plot(time, TURN * np.exp(-gain * time), color=REFERENCE, linewidth=4.0, alpha=0.6)
    for row in rows:
        turn = np.linalg.norm(row.gamma.response(time, start, gain)[:, :3], axis=1)
        axes.plot(time, np.degrees(turn), linewidth=1.5, **styles[row.cable_model])
    axes.set_yscale("log", nonpositive="mask")
    _write(axes, 0, f"a turn by {TURN:g}°")
    _write(axes, 1, "grey: $e^{-\\lambda t}$")
    axes.set_xlabel("time [s]")


def _draw_excursion(
    axes: Axes, rows: list[ModelComparison], styles: Any, gain: float, time: np.ndarray
) -> None:
    """Draw how far a move leaves the straight way, its top told in figures."""
    ways = np.array([[_aside(row, axis, gain, time) for row in rows] for axis in range(3)])
    widest = int(ways.max(axis=(1, 2)).argmax())
    _write(axes, 0, f"a move along {'xyz'[widest]}, at most")
    for i, (row, aside) in enumerate(zip(rows, ways[widest], strict=True)):
        style = styles[row.cable_model]
        axes.plot(time, aside, linewidth=1.5, **style)
        _write(axes, 1 + i, f"{aside.max():.2f} mm per m", style["color"])
    axes.set_xlabel("time [s]")


def _aside(row: ModelComparison, axis: int, gain: float, time: np.ndarray) -> np.ndarray:
    """Return the distance from the straight way on a move along an axis of M (n,) [mm/m]."""
    path = row.gamma.response(time, np.eye(6)[3 + axis], gain)[:, 3:]
    return np.asarray(1e3 * np.linalg.norm(np.delete(path, axis, axis=1), axis=1), float)


def _write(axes: Axes, line: int, text: str, colour: str = "0.35") -> None:
    """Write a line of a short text into the upper right corner of a panel."""
    place: dict[str, Any] = {"transform": axes.transAxes, "ha": "right", "va": "top"}
    axes.text(0.97, 0.95 - 0.09 * line, text, fontsize=9, color=colour, **place)


def _plane(found: GainMap) -> tuple[int, int]:
    """Return which two of x, y, z the poses of a map differ in."""
    varying = [i for i in range(3) if np.ptp(found.poses[:, 3 + i]) > PLAN_LIMIT]
    if len(varying) != 2:
        raise ValueError(f"a map needs poses that differ in two of x, y, z, not {len(varying)}")
    return varying[0], varying[1]


def _draw_field(axes: Axes, found: GainMap, values: np.ndarray, **style: Any) -> Any:
    """Draw values at the poses of a map as a mesh; where there are none, hatching shows."""
    first, second = _plane(found)
    u, v = found.poses[:, 3 + first], found.poses[:, 3 + second]
    across, up = np.unique(u.round(9)), np.unique(v.round(9))
    if across.size * up.size != len(values):
        raise ValueError(f"{len(values)} poses are no grid of {across.size} by {up.size}")
    field = np.full((up.size, across.size), np.nan)
    field[np.searchsorted(up, v.round(9)), np.searchsorted(across, u.round(9))] = values
    axes.set_facecolor("0.93")
    axes.patch.set(hatch="////", edgecolor="0.75")
    axes.set_aspect("equal")
    return axes.pcolormesh(across, up, np.ma.masked_invalid(field), shading="nearest", **style)


def _mark_drawing_points(axes: Axes, found: GainMap, robot: CableRobot) -> None:
    first, second = _plane(found)
    points = robot.drawing_points
    axes.plot(points[:, first], points[:, second], "s", color="black", markersize=4, clip_on=False)
