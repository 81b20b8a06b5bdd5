"""How far the gain can go: the loop's stability over gain and latency, at one pose.

Near its goal the sampled loop is x' = A x + B D_m a (platform, winches; a (6) the commanded motion
of the target frame, in itself), a' = u, with u = lambda s held from k T + latency on, s the error
seen at k T. The directions of internal tension, never commanded by the law, are left out: they are
neutral whatever the gain. Exponentials of A are taken once a latency; each gain after that is a
product of small matrices and its eigenvalues.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, Diagram

from cdpr_drake.analysis.gain_matrix import gain_matrix, target_twist
from cdpr_drake.diagrams.timing import Timing
from cdpr_drake.model.camera import true_from_seen
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.servo import ServoSettings
from cdpr_drake.model.signals import ERROR, POSE, TWIST
from cdpr_drake.model.statics import DEFAULT_RULE
from cdpr_drake.study.modes import Mode, Modes, modes
from cdpr_drake.study.sampled import OnePeriodMap, one_period_map
from cdpr_drake.study.state_space import Array

LOWEST_GAIN = 1e-3
"""Where the search for a gain limit begins [1/s]."""


LOSS_FACTORS = (0.01, 0.1)
"""Range of the loss factor of wire rope in tension [-]: judgement, for no value of this rope is
published, and that of strands hangs on load and amplitude (Hobbs and Raoof, Behaviour of cables
under dynamic or repeated loading, J. Constr. Steel Research 39, 1996). A mode that is all stretch
is damped by half of it, 0.5 to 5 %.
"""


class StabilityWarning(UserWarning):
    """A loop is predicted to be unstable."""


class SampledServo:
    """The sampled vision-based loop about a goal, ready for any gain and latency.

    Args:
        robot: the true robot, with its payload.
        pose: the goal where the controller sees it, X_WP or [roll, pitch, yaw, x, y, z] (rad, m).
        sample_time: T [s].
        believed: the robot as the controller knows it; the true one if None.
        cable_model: the law's "ECM", "CMWE", "SCMWE" or "SLSM".
        tensions: one of `model.statics.RULES`.
        settings: the law's other settings (order, model_drum_run).
        drag: [1/s], a wrench of -drag times the platform's momentum, for what damps it besides the
            stretch of the cables.

    Raises:
        GeometryError, TensionError, EquilibriumError: the robot cannot rest there.
        ValueError: a sample time that is not positive, an unknown cable model or rule.
    """

    def __init__(
        self,
        robot: CableRobot,
        pose: RigidTransform | ArrayLike,
        sample_time: float = 0.05,
        *,
        believed: CableRobot | None = None,
        cable_model: str = "SCMWE",
        tensions: str = DEFAULT_RULE,
        settings: ServoSettings | None = None,
        drag: float = 0.0,
    ) -> None:
        Timing(sample_time=sample_time)  # refuses what is out of range
        ours = believed if believed is not None else robot
        gamma = gain_matrix(robot, ours, pose, cable_model, tensions=tensions, settings=settings)
        self.gamma = gamma
        self.sample_time = sample_time
        A, B = gamma.rest.controlled()
        n, k = B.shape
        self._size = n + 6
        self._A = np.zeros((n + 12, n + 12))  # with the held rates as constant states
        self._A[:n, :n] = A
        self._A[6:12, 6:12] -= drag * np.eye(6)
        self._A[:n, n : n + 6] = B @ gamma.length_rates / robot.winch.transmission
        self._A[n : n + 6, n + 6 :] = np.eye(6)
        true = true_from_seen(robot, ours, gamma.pose)
        self._error = np.zeros((6, n + 6))
        self._error[:, :6] = -np.linalg.solve(target_twist(robot, true), gamma.rest.motion)
        self._flows: dict[float, Array] = {}
        numbers = range(1, k + 1)
        self._states = (
            *(f"platform/{part}" for part in POSE + TWIST),
            *(f"winches/{group}[{i}]" for group in ("angle", "rate", "integral") for i in numbers),
            *(f"servo/{part}" for part in ERROR),
            *(f"held_rates/{part}" for part in TWIST),
        )

    def map(self, gain: float, latency: float) -> OnePeriodMap:
        """Return the one-period map without the neutral directions.

        State: platform [x; velocity], winches [angles; rates; integrals], commanded motion of the
        target frame (6), the twist held (6) and, for latencies of whole frames, errors seen (6
        each), the latest first.

        Args:
            gain: lambda [1/s].
            latency: [s].
        """
        frames, phase = Timing(sample_time=self.sample_time, latency=latency).split()
        n = self._size
        size = n + 6 + 6 * frames
        u, seen = slice(n, n + 6), np.arange(n + 6, size)
        M = np.eye(size)
        held = np.arange(n + 6)
        M[np.ix_(held, held)] = self._flow(phase)
        before = np.zeros((6 * (frames + 1), size))
        before[:6, :n] = self._error
        before[6:, seen] = np.eye(6 * frames)
        M[u] = gain * before[6 * frames :]
        if frames:
            M[seen] = before[: 6 * frames]
        M[:n] = self._flow(self.sample_time - phase)[:n] @ M[: n + 6]
        late = tuple(f"seen[{age + 1}]/{part}" for age in range(frames) for part in ERROR)
        return OnePeriodMap(
            matrix=M,
            period=self.sample_time,
            states=self._states + late,
            drift=np.zeros(size),
        )

    def growth(self, gain: float, latency: float) -> complex:
        """Return ln(z) / T [1/s] of the eigenvalue z that decays least or grows most.

        Args:
            gain: lambda [1/s].
            latency: [s].
        """
        z = np.linalg.eigvals(self.map(gain, latency).matrix).astype(complex)
        worst = z[np.argmax(np.abs(z))]
        s = complex(np.log(worst)) / self.sample_time
        return complex(s.real, abs(s.imag))

    def critical(self, gain: float, latency: float) -> tuple[Modes, Mode]:
        """Return the modes, and the one that decays least or grows most.

        Args:
            gain: lambda [1/s].
            latency: [s].
        """
        found = modes(self.map(gain, latency))
        return found, found[0]

    def _flow(self, duration: float) -> Array:
        from scipy.linalg import expm

        key = round(duration, 12)
        if key not in self._flows:
            self._flows[key] = expm(duration * self._A)
        return self._flows[key]


@dataclass(frozen=True, kw_only=True)
class GainLimit:
    """The smallest gain at which the sampled loop is unstable at a pose.

    Attributes:
        gain: lambda [1/s]; infinite if the loop is stable up to `searched`, 0 if it is unstable
            from the smallest gain on.
        mode: name of the mode that goes unstable there, by the states that take part most.
        frequency: of that mode [Hz].
        unstable: (from, to) [1/s] of all unstable intervals up to `searched`: there may be islands.
        searched: up to which gain [1/s].
    """

    gain: float
    mode: str
    frequency: float
    unstable: tuple[tuple[float, float], ...]
    searched: float

    def __str__(self) -> str:
        if not self.unstable:
            return f"stable up to {self.searched:.4g}/s"
        text = f"unstable from {self.gain:.4g}/s on: {self.mode} at {self.frequency:.3g} Hz"
        if len(self.unstable) > 1:
            spans = ", ".join(f"{low:.4g} to {high:.4g}" for low, high in self.unstable)
            text += f" (unstable: {spans} 1/s)"
        return text


def gain_limit(
    robot: CableRobot,
    pose: RigidTransform | ArrayLike,
    latency: float = 0.04,
    sample_time: float = 0.05,
    *,
    highest: float | None = None,
    points: int = 120,
    **law: Any,
) -> GainLimit:
    """Return the smallest gain at which any mode but the neutral ones leaves the unit circle.

    Gains are scanned from 0.001/s up, peaks between two of them looked into, and each change found
    by bisection. The limit is not monotonic in the latency, and there may be islands. It holds for
    small errors about the pose; structural damping decides it.

    Args:
        robot: the true robot, with its payload.
        pose: the goal where the controller sees it, X_WP or [roll, pitch, yaw, x, y, z] (rad, m).
        latency: from image to change of the motor rates [s].
        sample_time: T [s].
        highest: gain [1/s] to search up to; 0.99 / T if None.
        points: number of gains to scan, equally spaced in their logarithm.
        law: believed, cable_model, tensions, settings, drag, as for `SampledServo`.

    Raises:
        GeometryError, TensionError, EquilibriumError: the robot cannot rest there.
        ValueError: a time out of range, an unknown cable model or rule.
    """
    Timing(sample_time=sample_time, latency=latency)  # refuses what is out of range
    servo = SampledServo(robot, pose, sample_time, **law)
    return find_gain_limit(servo, latency, highest=highest, points=points)


def find_gain_limit(
    servo: SampledServo,
    latency: float,
    *,
    highest: float | None = None,
    points: int = 120,
    lowest: float = LOWEST_GAIN,
) -> GainLimit:
    """Return the gain limit of a loop that is already set up; see `gain_limit`.

    Args:
        servo: the loop about its goal.
        latency: [s].
        highest: gain [1/s] to search up to; 0.99 / T if None.
        points: number of gains to scan.
        lowest: gain [1/s] to search from.
    """
    top = 0.99 / servo.sample_time if highest is None else highest
    gains = np.geomspace(lowest, top, points)

    def growth(gain: float) -> float:
        return servo.growth(gain, latency).real

    values = np.array([growth(gain) for gain in gains])
    gains, values = _with_peaks(growth, gains, values)
    unstable = []
    start = 0.0 if values[0] > 0.0 else None
    for i in range(1, gains.size):
        if (values[i] > 0.0) == (values[i - 1] > 0.0):
            continue
        crossing = _bisect(growth, gains[i - 1], gains[i], values[i - 1])
        if start is None:
            start = crossing
        else:
            unstable.append((start, crossing))
            start = None
    if start is not None:
        unstable.append((start, float(top)))
    if not unstable:
        return GainLimit(
            gain=math.inf, mode="", frequency=math.nan, unstable=(), searched=float(top)
        )
    limit = unstable[0][0]
    found, critical = servo.critical(max(limit, lowest) * (1.0 + 1e-6), latency)
    return GainLimit(
        gain=limit,
        mode=found.name(critical),
        frequency=critical.frequency,
        unstable=tuple(unstable),
        searched=float(top),
    )


@dataclass(frozen=True, kw_only=True)
class GainBand:
    """Gain limits over a range of the cables' damping.

    Attributes:
        loss_factors: (n,) of the cables in tension [-], at the frequency of each limit.
        damping_times: (n,) [s] that give them there, eta / (2 pi f).
        limits: (n,) gain limits.
    """

    loss_factors: tuple[float, ...]
    damping_times: tuple[float, ...]
    limits: tuple[GainLimit, ...]

    @property
    def lowest(self) -> float:
        """The smallest of the limits [1/s]."""
        return min(limit.gain for limit in self.limits)

    @property
    def highest(self) -> float:
        """The largest of the limits [1/s]; infinite where none was found."""
        return max(limit.gain for limit in self.limits)

    def __str__(self) -> str:
        factors = f"{min(self.loss_factors):g} to {max(self.loss_factors):g}"
        times = f"{1e3 * min(self.damping_times):.2g} to {1e3 * max(self.damping_times):.2g} ms"
        searched = min(limit.searched for limit in self.limits)
        low, high = (
            f"{gain:.3g}" if math.isfinite(gain) else f"above {searched:.3g}"
            for gain in (self.lowest, self.highest)
        )
        gains = f"{low}/s" if low == high else f"{low} to {high}/s"
        return f"{gains} for loss factors of the cables of {factors} (damping times of {times})"


def gain_limit_band(
    robot: CableRobot,
    pose: RigidTransform | ArrayLike,
    latency: float = 0.04,
    sample_time: float = 0.05,
    *,
    loss_factors: Iterable[float] = tuple(np.geomspace(*LOSS_FACTORS, 3)),
    points: int = 60,
    **law: Any,
) -> GainBand:
    """Return the gain limits at a pose over what the structural damping of cables may be.

    A loss factor eta is a damping time of eta / (2 pi f) at the frequency f of the mode that goes
    unstable. Only what a mode stretches the cables is damped so, not what it changes of their sag.

    Args:
        robot: the true robot, with its payload; its own damping time is not used.
        pose: the goal where the controller sees it, X_WP or [roll, pitch, yaw, x, y, z] (rad, m).
        latency: from image to change of the motor rates [s].
        sample_time: T [s].
        loss_factors: of the cables in tension [-], positive.
        points: number of gains to scan for each limit.
        law: as for `gain_limit`.

    Raises:
        GeometryError, TensionError, EquilibriumError: the robot cannot rest there.
        ValueError: as `gain_limit`, or a loss factor that is not positive.
    """
    factors = tuple(map(float, loss_factors))
    if not factors or min(factors) <= 0.0:
        raise ValueError(f"loss factors must be positive, got {list(factors)}")
    limits, times = [], []
    frequency = 1.0
    for factor in factors:
        for _ in range(8):
            time = factor / (2.0 * math.pi * frequency)
            damped = robot.replace(cable=robot.cable.replace(damping_time=time))
            limit = gain_limit(damped, pose, latency, sample_time, points=points, **law)
            before, frequency = frequency, limit.frequency
            if not frequency > 0.0:  # nothing oscillates, or all is stable
                frequency = before
            if abs(frequency - before) <= 0.01 * before:
                break
        limits.append(limit)
        times.append(time)
    return GainBand(loss_factors=factors, damping_times=tuple(times), limits=tuple(limits))


@dataclass(frozen=True, kw_only=True, eq=False)
class StabilityMap:
    """Decay of the slowest mode over gain and latency.

    Attributes:
        gains: (n,) [1/s].
        latencies: (m,) [s].
        growth: (m, n) real part of ln(z) / T [1/s] of the mode that decays least; positive where
            the loop is unstable.
        frequency: (m, n) [Hz] of that mode, 0 where it does not oscillate.
        limits: the gain limit at each latency, up to the largest gain.
    """

    gains: Array
    latencies: Array
    growth: Array
    frequency: Array
    limits: tuple[GainLimit, ...]

    @property
    def is_stable(self) -> NDArray[np.bool_]:
        """Where the loop is stable (m, n)."""
        return self.growth < 0.0


def stability_map(
    robot: CableRobot,
    pose: RigidTransform | ArrayLike,
    gains: Iterable[float],
    latencies: Iterable[float],
    sample_time: float = 0.05,
    **law: Any,
) -> StabilityMap:
    """Return the map of stability over gain and latency at a pose, and the limits with their modes.

    Args:
        robot: the true robot, with its payload.
        pose: the goal where the controller sees it, X_WP or [roll, pitch, yaw, x, y, z] (rad, m).
        gains: lambda [1/s], rising.
        latencies: [s].
        sample_time: T [s].
        law: believed, cable_model, tensions, settings, drag, as for `SampledServo`.

    Raises:
        GeometryError, TensionError, EquilibriumError: the robot cannot rest there.
        ValueError: a time out of range, an unknown cable model or rule.
    """
    columns, rows = np.array([*gains], float), np.array([*latencies], float)
    Timing(sample_time=sample_time, latency=float(rows.min(initial=0.0)))
    servo = SampledServo(robot, pose, sample_time, **law)
    worst = np.array([[servo.growth(gain, latency) for gain in columns] for latency in rows])
    top = float(columns.max())
    return StabilityMap(
        gains=columns,
        latencies=rows,
        growth=worst.real,
        frequency=np.where(worst.imag > 0.0, np.abs(worst), 0.0) / (2.0 * math.pi),
        limits=tuple(find_gain_limit(servo, latency, highest=top) for latency in rows),
    )


def warn_if_unstable(diagram: Diagram, context: Context) -> Modes:
    """Return the modes of a sampled loop, after a StabilityWarning if any of them grows.

    Args:
        diagram: the loop.
        context: its rest at the goal, from `equilibrium`.

    Raises:
        LinearizationError: the diagram is not a sampled loop of the kind `one_period_map` takes.
    """
    found = modes(one_period_map(diagram, context))
    if found.unstable:
        worst, *others = found.unstable
        warnings.warn(
            f"the loop is unstable at this goal: {found.name(worst)} grows by a factor e in "
            f"{-worst.time_constant:.3g} s ({worst.frequency:.3g} Hz)"
            + (f", and {len(others)} more modes grow" if others else ""),
            StabilityWarning,
            stacklevel=2,
        )
    return found


def _with_peaks(
    growth: Callable[[float], float], gains: Array, values: Array
) -> tuple[Array, Array]:
    """Return the scan with the tops of its stable peaks added: islands narrower than its steps."""
    peaks = []
    for i in range(1, gains.size - 1):
        low, mid, high = values[i - 1 : i + 2]
        # Where the peak's own height, judged by its sides, could carry it above zero.
        if mid < 0.0 and mid >= max(low, high) and mid + abs(mid - min(low, high)) > 0.0:
            from scipy.optimize import minimize_scalar  # takes 0.4 s to import

            bounds = tuple(np.log(gains[[i - 1, i + 1]]))
            top = minimize_scalar(lambda x: -growth(math.exp(x)), bounds=bounds, method="bounded")
            peaks.append((math.exp(top.x), -float(top.fun)))
    if not peaks:
        return gains, values
    order = np.argsort(np.concatenate([gains, [gain for gain, _ in peaks]]))
    all_gains = np.concatenate([gains, [gain for gain, _ in peaks]])
    all_values = np.concatenate([values, [value for _, value in peaks]])
    return all_gains[order], all_values[order]


def _bisect(growth: Callable[[float], float], low: float, high: float, at_low: float) -> float:
    """Return where the growth changes sign, to 1e-6 of the gain."""
    while high - low > 1e-6 * high:
        middle = 0.5 * (low + high)
        if (growth(middle) > 0.0) == (at_low > 0.0):
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
