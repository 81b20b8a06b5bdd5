"""Figures of runs side by side: errors, tensions, sag, motor rates.

Every function takes the runs by label and returns a matplotlib Figure that belongs to no window. A
run keeps its colour and dashes in all figures, a cable its colour; cables count from 1.
"""

from __future__ import annotations

import functools
import io
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.diagrams import Record
from cdpr_drake.model.cable_models import sag
from cdpr_drake.model.kinematics import cable_ends
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import as_pose, vector_to_pose
from cdpr_drake.model.servo import pose_error
from cdpr_drake.show.style import REFERENCE, cable_style, run_styles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Runs = Mapping[str, Record]

DOTS_PER_INCH = 100


def pose_error_figure(
    runs: Runs, robot: CableRobot | None = None, goal: RigidTransform | ArrayLike | None = None
) -> Figure:
    """Return the pose error s (eq. 18) over time, a panel for each of its six components.

    Its translation is in mm, its rotation vector in degrees, both of the desired target frame in
    the current one. Each panel tells the values at the end.

    Args:
        runs: the runs by label.
        robot: the robot, for its target frame; only with a goal.
        goal: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m), from which to take the error of all
            runs; the recorded "pose_error" if None, in which a moving reference is followed.
    """
    figure = _figure(10.5, 5.6)
    grid = figure.subplots(2, 3, sharex=True, sharey="row")
    _dress(grid)
    errors = _errors(runs, robot, goal)
    for label, style in run_styles(runs).items():
        for axes, values in zip(grid.flat, errors[label].T, strict=True):
            axes.plot(runs[label].time, values, linewidth=1.5, **style)
    for i, (axes, axis) in enumerate(zip(grid.flat, "xyzxyz", strict=True)):
        axes.set_title(f"{'translation' if i < 3 else 'rotation'} {axis}", fontsize=10)
        axes.axhline(0.0, color=REFERENCE, linewidth=0.8, zorder=0)
        last = {label: float(errors[label][-1, i]) for label in runs}
        _write_final_values(axes, last, *((" mm", 1) if i < 3 else ("°", 2)))
    grid[0, 0].set_ylabel("position error $s_t$ [mm]")
    grid[1, 0].set_ylabel("orientation error $s_\\omega$ [deg]")
    _legend_below(figure, grid[0, 0])
    return figure


def error_norm_figure(
    runs: Runs,
    gain: float | None = None,
    robot: CableRobot | None = None,
    goal: RigidTransform | ArrayLike | None = None,
) -> Figure:
    """Return the norms of position and orientation error on a log scale, where the slope is -gain.

    Args:
        runs: the runs by label.
        gain: lambda [1/s] of a reference exp(-gain t) from the first run's start; none if None.
        robot: the robot, for its target frame; only with a goal.
        goal: as for `pose_error_figure`.
    """
    figure = _figure(10.5, 4.2)
    panels = figure.subplots(1, 2, sharex=True)
    _dress(panels[np.newaxis])
    errors = _errors(runs, robot, goal)
    for axes, part in zip(panels, (slice(0, 3), slice(3, 6)), strict=True):
        first = next(iter(runs))
        norms = {label: np.linalg.norm(s[:, part], axis=1) for label, s in errors.items()}
        if gain is not None:
            time = runs[first].time
            axes.plot(
                time,
                norms[first][0] * np.exp(-gain * (time - time[0])),
                color=REFERENCE,
                linewidth=4.0,
                alpha=0.6,
                label=f"slope $-\\lambda = {-gain:g}$ s$^{{-1}}$",
            )
        for label, style in run_styles(runs).items():
            axes.plot(runs[label].time, norms[label], linewidth=1.5, **style)
        positive = np.concatenate([norm[norm > 0.0] for norm in norms.values()])
        if positive.size:
            axes.set_yscale("log", nonpositive="mask")
            axes.set_ylim(0.5 * positive.min(), 2.0 * positive.max())
    panels[0].set_ylabel("norm of the position error [mm]")
    panels[1].set_ylabel("norm of the orientation error [deg]")
    _legend_below(figure, panels[0])
    return figure


def tension_figure(runs: Runs, robot: CableRobot) -> Figure:
    """Return the tensions at the drawing points over time, a panel for each run.

    The limits for tension distributions are lines where they are in view, else noted.

    Args:
        runs: the runs by label.
        robot: the robot, for its limits.
    """
    figure, panels = _panel_per_run(runs, 1)
    _plot_cables(panels[0], runs, lambda run: run["tension_at_drawing_point"])
    panels[0][0].set_ylabel("tension at the drawing point [N]")
    top = max(float(run["tension_at_drawing_point"].max()) for run in runs.values())
    low, high = robot.cable.min_tension, robot.cable.max_tension
    in_view = high < 1.5 * top
    for axes in panels[0]:
        axes.set_ylim(0.0, 1.08 * max(top, low, high if in_view else 0.0) or 1.0)
        if in_view:
            _limit(axes, low, f"lower limit {low:g} N")
            _limit(axes, high, f"upper limit {high:g} N")
        else:
            _limit(axes, low, f"lower limit {low:g} N\n(upper limit {high:g} N, out of view)")
        number_cables(axes)
    return figure


def sag_figure(runs: Runs, robot: CableRobot) -> Figure:
    """Return dbeta [deg] and sag [mm] of the cables over time, a column for each run.

    dbeta = beta - beta0 is the angle between chord and cable at the platform (eqs. 4, 5); the sag
    is the largest vertical distance from chord to cable.

    Args:
        runs: the runs by label.
        robot: the robot.
    """
    figure, panels = _panel_per_run(runs, 2)
    _plot_cables(panels[0], runs, lambda run: np.degrees(run["dbeta"]))
    _plot_cables(panels[1], runs, lambda run: 1e3 * cable_sag(run, robot))
    panels[0][0].set_ylabel("chord to tangent at the platform $d\\beta$ [deg]")
    panels[1][0].set_ylabel("sag below the chord [mm]")
    for axes in panels.flat:
        axes.set_ylim(bottom=0.0)
        number_cables(axes)
    return figure


def motor_rate_figure(runs: Runs) -> Figure:
    """Return the rates of the motors over time [rad/s], a panel for each run.

    Args:
        runs: the runs by label.
    """
    figure, panels = _panel_per_run(runs, 1)
    _plot_cables(panels[0], runs, lambda run: run["motor_rates"])
    panels[0][0].set_ylabel("motor rate, positive pays out [rad/s]")
    for axes in panels.flat:
        axes.axhline(0.0, color=REFERENCE, linewidth=0.8, zorder=0)
    _legend_below(figure, panels[0][0])  # the lines end all together, near zero
    return figure


def cable_sag(record: Record, robot: CableRobot) -> np.ndarray:
    """Return the sag (n, k) [m]: the largest vertical distance from chord to cable; NaN if slack.

    The catenary's, with the horizontal tension H = T_A hypot(u_x, u_y) of eq. (16).

    Args:
        record: a run with pose, tension and tangents at the drawing points.
        robot: the robot.
    """
    k, w = robot.num_cables, robot.weight_per_metre
    u_A = record["tangents_at_drawing_point"].reshape(-1, k, 3)
    ends = [
        cable_ends(robot, vector_to_pose(p), u) for p, u in zip(record["pose"], u_A, strict=True)
    ]
    p_AB = np.array([end.chord for end in ends])
    Bx, Bz = np.hypot(p_AB[..., 0], p_AB[..., 1]), p_AB[..., 2]
    H = record["tension_at_drawing_point"] * np.hypot(u_A[..., 0], u_A[..., 1])
    # A cable that hangs in a deep loop has no sag from a chord worth the name.
    taut = (w * Bx / 20.0 < H) & (Bx > 0.0)
    depth = np.full(H.shape, np.nan)
    depth[taut] = sag(Bx[taut], Bz[taut], H[taut], w)
    return depth


def save_figures(
    runs: Runs,
    robot: CableRobot,
    directory: str | os.PathLike[str],
    *,
    gain: float | None = None,
    goal: RigidTransform | ArrayLike | None = None,
) -> list[Path]:
    """Write all figures as PNG files and return their paths.

    Args:
        runs: the runs by label.
        robot: the robot.
        directory: where to; made if it is not there.
        gain: lambda [1/s] for the reference slope of `error_norm_figure`.
        goal: from which errors are taken; see `pose_error_figure`.

    Raises:
        ValueError: the goal is no pose.
        OSError: a file cannot be written.
    """
    figures = run_figures(runs, robot, gain=gain, goal=goal)
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, make in figures.items():
        paths.append(folder / f"{name}.png")
        make().savefig(paths[-1], dpi=DOTS_PER_INCH)
    return paths


def run_figures(
    runs: Runs,
    robot: CableRobot,
    *,
    gain: float | None = None,
    goal: RigidTransform | ArrayLike | None = None,
) -> dict[str, Callable[[], Figure]]:
    """Return what makes each figure of `save_figures`, by its name.

    Args:
        runs: the runs by label.
        robot: the robot.
        gain: lambda [1/s] for the reference slope of `error_norm_figure`.
        goal: from which errors are taken; see `pose_error_figure`.

    Raises:
        ValueError: the goal is no pose.
    """
    to = None if goal is None else as_pose(goal)
    return {
        "pose_error": lambda: pose_error_figure(runs, robot, to),
        "error_norm": lambda: error_norm_figure(runs, gain, robot, to),
        "tension": lambda: tension_figure(runs, robot),
        "sag": lambda: sag_figure(runs, robot),
        "motor_rate": lambda: motor_rate_figure(runs),
    }


def _figure(width: float, height: float) -> Any:
    """Return an empty Figure of a size in inches, outside pyplot's list of open ones."""
    from matplotlib.figure import Figure

    figure: Any = Figure(figsize=(width, height), layout="constrained")
    # A notebook knows how to show a Figure only once pyplot has made one there.
    figure._repr_png_ = functools.partial(_png, figure)
    return figure


def _png(figure: Figure) -> bytes:
    """Return a figure as the bytes of a PNG file."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=DOTS_PER_INCH)
    return file.getvalue()


def _dress(panels: Any) -> None:
    """Give panels a faint grid, and label the time below the lowest."""
    for axes in panels.flat:
        axes.grid(True, color="0.9", linewidth=0.7)
        axes.set_axisbelow(True)
        axes.margins(x=0.01)
    for axes in panels[-1]:
        axes.set_xlabel("time [s]")


def _panel_per_run(runs: Runs, rows: int) -> tuple[Any, Any]:
    if not runs:
        raise ValueError("no runs to draw")
    figure = _figure(1.2 + 3.4 * max(len(runs), 2), 1.0 + 2.9 * rows)
    panels = figure.subplots(rows, len(runs), sharex=True, sharey="row", squeeze=False)
    for axes, label in zip(panels[0], runs, strict=True):
        axes.set_title(label, fontsize=10)
    _dress(panels)
    return figure, panels


def _plot_cables(panels: Any, runs: Runs, values: Callable[[Record], np.ndarray]) -> None:
    for axes, run in zip(panels, runs.values(), strict=True):
        for i, signal in enumerate(values(run).T):
            label = f"cable {i + 1}"
            axes.plot(run.time, signal, linewidth=1.1, label=label, **cable_style(i))


def number_cables(axes: Axes) -> None:
    """Write the cables' numbers beside the ends of their lines; the limits must be final.

    Args:
        axes: whose lines have labels such as "cable 1".
    """
    from matplotlib.lines import Line2D

    low, high = axes.get_ylim()
    place = axes.get_yaxis_transform()  # x in widths of the panel, y in data
    lines = [line for line in axes.get_lines() if str(line.get_label()).startswith("cable ")]
    ends = np.array([_last_finite(np.asarray(line.get_ydata(), float)) for line in lines])
    heights = low + (high - low) * spread((ends - low) / (high - low), 0.05)
    for line, end, height in zip(lines, ends, heights, strict=True):
        leader = Line2D([1.0, 1.04], [end, height], transform=place, clip_on=False)
        leader.set(color=line.get_color(), linewidth=0.7)
        axes.add_artist(leader)
        number = str(line.get_label()).removeprefix("cable ")
        text = axes.text(1.05, height, number, transform=place, va="center", fontsize=9)
        text.set(color=line.get_color(), fontweight="bold")
    axes.set_title("cable", loc="right", fontsize=8, color="0.35")


def spread(heights: np.ndarray, distance: float) -> np.ndarray:
    """Return heights moved as little as it takes to keep a distance from each other.

    Args:
        heights: (n,), in any order, which is kept.
        distance: the least between two of the result.
    """
    order = np.argsort(heights, kind="stable")
    # Least squares under s_i >= s_(i-1) + distance is isotonic regression of what remains when the
    # distances are taken out: neighbours in the wrong order are pooled to their mean.
    steps = distance * np.arange(len(heights))
    pools: list[list[float]] = []
    for value in heights[order] - steps:
        pools.append([value])
        while len(pools) > 1 and np.mean(pools[-2]) > np.mean(pools[-1]):
            pools[-2:] = [pools[-2] + pools[-1]]
    result = np.empty(len(heights))
    result[order] = np.concatenate([np.full(len(p), np.mean(p)) for p in pools]) + steps
    return result


def _last_finite(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(finite[-1]) if finite.size else 0.0


def _write_final_values(axes: Axes, values: Mapping[str, float], unit: str, digits: int) -> None:
    """Write each run's last value, in the run's colour, on the wider side of the zero line."""
    styles = run_styles(values)
    lines = [("at the end", "0.35")]
    for label, value in values.items():
        text = f"{round(value, digits) + 0.0:+.{digits}f}{unit}".replace("-", "\N{MINUS SIGN}")
        lines.append((text, styles[label]["color"]))
    low, high = axes.get_ylim()
    top = 0.95 if high > -low else 0.05 + 0.09 * len(lines)
    for i, (text, colour) in enumerate(lines):
        axes.text(
            0.97,
            top - 0.09 * i,
            text,
            transform=axes.transAxes,
            color=colour,
            fontsize=9,
            ha="right",
            va="top",
        )


def _limit(axes: Axes, value: float, text: str) -> None:
    """Draw a limit and write what it is below it, or above it where it is near the lower edge."""
    axes.axhline(value, color="black", linewidth=0.9, linestyle=(0, (6, 3)))
    place = axes.get_yaxis_transform()
    bottom, top = axes.get_ylim()
    is_low = value - bottom < 0.15 * (top - bottom)
    axes.annotate(
        text,
        (0.98, value),
        xycoords=place,
        xytext=(0.0, 3.0 if is_low else -3.0),
        textcoords="offset points",
        fontsize=8,
        ha="right",
        va="bottom" if is_low else "top",
    )


def _legend_below(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=len(labels) if len(labels) <= 8 else -(-len(labels) // 2),
        frameon=False,
        handlelength=2.5,
    )


def _errors(
    runs: Runs, robot: CableRobot | None, goal: RigidTransform | ArrayLike | None
) -> dict[str, np.ndarray]:
    """Return [s_t; s_w] (n, 6) in mm and degrees, of each run."""
    if not runs:
        raise ValueError("no runs to draw")
    errors = {}
    for label, run in runs.items():
        s = run["pose_error"]
        if goal is not None:
            if robot is None:
                raise ValueError("an error to a goal needs the robot, for its target frame")
            X_PM, poses = robot.cameras.X_PM, map(vector_to_pose, run["pose"])
            s = np.array([pose_error(X_WP, goal, X_PM) for X_WP in poses])
        errors[label] = np.column_stack([1e3 * s[:, 3:], np.degrees(s[:, :3])])
    return errors
