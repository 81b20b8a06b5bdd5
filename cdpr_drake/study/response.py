"""Responses of linear models and of simulated runs, and the numbers that describe them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cdpr_drake.diagrams import Record
from cdpr_drake.study.state_space import Array, StateSpace, matching

MILLIMETRES, DEGREES = 1e3, 180.0 / math.pi


@dataclass(frozen=True, kw_only=True)
class ResponseMetrics:
    """How an error of pose went to zero, position and rotation apart.

    Times are in s since the start, and infinite for what did not happen.

    Attributes:
        excursion_mm: largest distance of the position error from the straight line home [mm].
        excursion_deg: the same for the rotation vector [deg].
        rise: from 90 % to 10 % of the initial error's size, of position and of rotation.
        settling: to 2 % of the initial error's size for good, of position and of rotation.
        settling_absolute: to the threshold for good, of position and of rotation.
        threshold: (mm, deg) of `settling_absolute`.
        final: (mm, deg) size of the error at the end.
        tension_range: least and largest tension on the way [N], None without tensions.
    """

    excursion_mm: float
    excursion_deg: float
    rise: tuple[float, float]
    settling: tuple[float, float]
    settling_absolute: tuple[float, float]
    threshold: tuple[float, float]
    final: tuple[float, float]
    tension_range: tuple[float, float] | None = None

    def __str__(self) -> str:
        return side_by_side({"": self})


def response_metrics(
    time: ArrayLike,
    error: ArrayLike,
    tension: ArrayLike | None = None,
    *,
    threshold: tuple[float, float] = (1.0, 0.1),
) -> ResponseMetrics:
    """Return the excursion, rise, settling and tension range of a response.

    The excursion is the largest distance from the segment between the initial error and zero: what
    goes sideways by coupling, and what overshoots.

    Args:
        time: (n,) [s].
        error: (n, 6) pose error [s_w; s_t] (rad, m), from a simulation or a linear model.
        tension: (n, k) [N], or None.
        threshold: what counts as arrived, in mm and in degrees.

    Raises:
        ValueError: the arrays do not fit each other.
    """
    t, s = np.asarray(time, float), np.asarray(error, float)
    if s.shape != (t.size, 6) or t.size < 2:
        raise ValueError(f"a response needs times (n,) and errors (n, 6), got {t.shape}, {s.shape}")
    sizes = np.linalg.norm(s[:, 3:], axis=1), np.linalg.norm(s[:, :3], axis=1)
    units = (MILLIMETRES, DEGREES)
    position, rotation = excursion(s)

    def settle(levels: tuple[float, float]) -> tuple[float, float]:
        return _settles(t, sizes[0], levels[0]), _settles(t, sizes[1], levels[1])

    pull = None if tension is None else np.asarray(tension, float)
    return ResponseMetrics(
        excursion_mm=position * MILLIMETRES,
        excursion_deg=rotation * DEGREES,
        rise=(_rise(t, sizes[0]), _rise(t, sizes[1])),
        settling=settle((0.02 * sizes[0][0], 0.02 * sizes[1][0])),
        settling_absolute=settle((threshold[0] / units[0], threshold[1] / units[1])),
        threshold=threshold,
        final=(float(sizes[0][-1] * units[0]), float(sizes[1][-1] * units[1])),
        tension_range=None if pull is None else (float(pull.min()), float(pull.max())),
    )


def record_metrics(
    record: Record, *, threshold: tuple[float, float] = (1.0, 0.1)
) -> ResponseMetrics:
    """Return the metrics of a simulated run, from its true pose error and tensions at the winches.

    Args:
        record: from `simulate`, with "pose_error" and, if there are to be tensions,
            "tension_at_winch".
        threshold: what counts as arrived, in mm and in degrees.
    """
    tension = record.signals.get("tension_at_winch")
    time = record.time - record.time[0]
    return response_metrics(time, record["pose_error"], tension, threshold=threshold)


def side_by_side(metrics: Mapping[str, ResponseMetrics]) -> str:
    """Return a table of responses, one a column, e.g. a linear model's beside a simulation's.

    Args:
        metrics: the responses by name.
    """
    columns = list(metrics.values())
    first = columns[0].threshold

    def row(label: str, *cells: float | None) -> str:
        texts = ("-" if c is None else f"{c:.4g}" for c in cells)
        return f"{label:<34}" + "".join(f"{text:>14}" for text in texts)

    def pairs(label: str, unit: str, name: str) -> list[str]:
        values = [getattr(m, name) for m in columns]
        return [
            row(f"{label}, {part} [{unit}]", *(v[i] for v in values))
            for i, part in enumerate(("position", "rotation"))
        ]

    lines = [f"{'':<34}" + "".join(f"{name:>14}" for name in metrics)] if any(metrics) else []
    lines.append(row("excursion [mm]", *(m.excursion_mm for m in columns)))
    lines.append(row("excursion [deg]", *(m.excursion_deg for m in columns)))
    lines += pairs("rise 90 to 10 %", "s", "rise") + pairs("settling to 2 %", "s", "settling")
    lines += pairs(f"within {first[0]:g} mm, {first[1]:g} deg", "s", "settling_absolute")
    for i, label in enumerate(("least tension [N]", "largest tension [N]")):
        ranges = [m.tension_range for m in columns]
        lines.append(row(label, *(r if r is None else r[i] for r in ranges)))
    return "\n".join(lines)


def excursion(error: ArrayLike) -> tuple[float, float]:
    """Return the largest distance [m], [rad] of an error from the segment between start and zero.

    Args:
        error: (n, 6) pose errors [s_w; s_t] (rad, m).
    """
    s = np.asarray(error, float)
    return _off_segment(s[:, 3:]), _off_segment(s[:, :3])


def free_response(A: ArrayLike, time: ArrayLike, x0: ArrayLike) -> Array:
    """Return x(t) = expm(A t) x(0) (len(time), n).

    Args:
        A: (n, n) [1/s].
        time: times [s], rising.
        x0: x(0) (n,).
    """
    from scipy.linalg import expm

    matrix = np.asarray(A, float)
    t = np.atleast_1d(np.asarray(time, float))
    x = np.empty((t.size, matrix.shape[0]))
    state, now = np.asarray(x0, float), 0.0
    # Times are mostly equally spaced: few different steps, to be exponentiated once.
    steps: dict[float, Array] = {}
    for i, then in enumerate(t):
        step = round(float(then - now), 12)
        if step not in steps:
            steps[step] = expm(step * matrix)
        state, now = steps[step] @ state, float(then)
        x[i] = state
    return x


def initial_response(model: StateSpace, deviation: ArrayLike, time: ArrayLike) -> Array:
    """Return the outputs y - y0 (len(time), p) of a linear model after a deviation of its state.

    Args:
        model: the linear model.
        deviation: x - x0 (n,) at the start.
        time: times [s], rising.
    """
    return free_response(model.A, time, deviation) @ model.C.T


def step_response(model: StateSpace, step: Mapping[str, ArrayLike], time: ArrayLike) -> Array:
    """Return the outputs y - y0 (len(time), p) of a linear model after a step of its inputs.

    Args:
        model: the linear model.
        step: u - u0 from time 0 on, by name of the port or of a single input.
        time: times [s], rising.

    Raises:
        KeyError: there is no such input.
    """
    u = np.zeros(len(model.inputs))
    for name, value in step.items():
        where = matching(model.inputs, name)
        if not where:
            raise KeyError(f'no input "{name}" among {", ".join(model.inputs)}')
        u[where] = value
    n = len(model.states)
    A = np.zeros((n + 1, n + 1))
    A[:n, :n], A[:n, n] = model.A, model.B @ u
    x = free_response(A, time, np.eye(n + 1)[n])[:, :n]
    return x @ model.C.T + model.D @ u


def pose_error_response(model: StateSpace, error: ArrayLike, time: ArrayLike) -> Array:
    """Return the pose errors (len(time), 6) of a linear loop at rest with a new goal at an error.

    The goal steps to where it is seen at `error`; the loop starts from its rest and closes in.

    Args:
        model: a linear model with input "desired_pose" and output "pose_error", about a rest at
            its goal.
        error: s(0) = [s_w; s_t] (6,) [rad, m].
        time: times [s], rising.

    Raises:
        KeyError: the model lacks that input or output.
    """
    part = model.select(["desired_pose"], ["pose_error"])
    goal = np.linalg.solve(part.D, np.asarray(error, float))
    return part.y0 + step_response(part, {"desired_pose": goal}, time)


def _off_segment(points: Array) -> float:
    """Return the largest distance of points (n, 3) from the segment between the first and zero."""
    start = points[0]
    length2 = float(start @ start)
    along = np.clip(points @ start / length2, 0.0, 1.0) if length2 > 0.0 else np.zeros(len(points))
    return float(np.linalg.norm(points - along[:, None] * start, axis=1).max())


def _crosses(t: Array, size: Array, level: float) -> float:
    """Return when a size first falls to a level, by linear interpolation."""
    below = np.flatnonzero(size <= level)
    if below.size == 0:
        return math.inf
    i = int(below[0])
    if i == 0:
        return float(t[0])
    share = (size[i - 1] - level) / (size[i - 1] - size[i])
    return float(t[i - 1] + share * (t[i] - t[i - 1]))


def _rise(t: Array, size: Array) -> float:
    if size[0] == 0.0:
        return math.inf
    late = _crosses(t, size, 0.1 * size[0])
    return late - _crosses(t, size, 0.9 * size[0]) if math.isfinite(late) else math.inf


def _settles(t: Array, size: Array, level: float) -> float:
    """Return from when on a size stays at or below a level."""
    above = np.flatnonzero(size > level)
    if above.size == 0:
        return float(t[0])
    i = int(above[-1])
    if i == t.size - 1:
        return math.inf
    share = (size[i] - level) / (size[i] - size[i + 1])
    return float(t[i] + share * (t[i + 1] - t[i]))
