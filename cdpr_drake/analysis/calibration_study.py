"""What wrong calibrations do to vision-based control (section 6.3): random ones, group by group.

Where the platform comes to rest needs no simulation: the law stops when the cameras see the goal,
so the error is that of the two transforms ^fT_b and ^mT_e alone (eq. 18), whatever A_i and B_i and
the pulleys are.
The way there is followed without dynamics: lengths by the law, the platform where it then hangs.
This is the slow loop to within a fraction of a per cent, at a hundredth of the cost.

Goals are poses in F_b. A goal that the cameras themselves have measured is reached exactly: the
same wrong transforms are in both.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.analysis import gain_matrix
from cdpr_drake.errors import CdprError, EquilibriumError
from cdpr_drake.model.calibration_errors import CalibrationErrors, misjudged
from cdpr_drake.model.camera import true_from_seen
from cdpr_drake.model.equilibrium import forward_kinematics, platform_balance, rest_state
from cdpr_drake.model.pulleys import has_pulleys
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, as_pose, pose_to_vector
from cdpr_drake.model.servo import MotorRateLaw, ServoSettings, pose_error

PULLEYS = "pulley radius"
"""The group that is of robots with pulleys alone."""

GROUPS: Mapping[str, tuple[str, ...]] = {
    "A_i": ("drawing_points",),
    "B_i": ("attachment_points",),
    "^fT_b": ("camera_position", "camera_angle"),
    "^mT_e": ("target_position", "target_angle"),
    PULLEYS: ("pulley_radius",),
    "all": tuple(field.name for field in dataclasses.fields(CalibrationErrors)),
}
"""What is wrong: the fields of `CalibrationErrors` that are kept, the others being zero."""

DECAYS, STEP = 8.0, 0.1
"""How far a way is followed, and in what steps, in time constants of the law."""

LARGEST_FACTOR = 200.0
"""Up to this multiple of the errors a loss of stability is looked for."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Way:
    """A move under a wrong calibration.

    Attributes:
        error: (n, 6) s as the controller sees it, [s_w; s_t] (rad, m).
        tension: (n, k) [N] at the drawing points.
        X_WP: the true pose at the end.
    """

    error: Array
    tension: Array
    X_WP: RigidTransform


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibrationEffect:
    """What random calibrations with errors of one group do, one entry a calibration.

    Attributes:
        group: of `GROUPS`.
        factor: by which the errors are larger than usual.
        position_error: at rest, of the target frame's origin [mm].
        orientation_error: at rest [deg].
        position_excursion: how far aside of the straight way home the error seen is, at most, from
            where it is aside with exact calibration (which the cable model causes) [mm].
        orientation_excursion: the same of the rotation [deg].
        tension_change: largest change of any cable's tension on the way from what it is with exact
            calibration [N].
        lowest_tension: on the way [N].
        failures: why a move did not come to its end, by seed; its entries are NaN.
    """

    group: str
    factor: float
    position_error: Array
    orientation_error: Array
    position_excursion: Array
    orientation_excursion: Array
    tension_change: Array
    lowest_tension: Array
    failures: Mapping[int, str]

    def quantiles(self, name: str, q: Sequence[float] = (0.5, 0.9)) -> list[float]:
        """Return quantiles of one of the arrays over the calibrations that came to an end.

        Args:
            name: of the array.
            q: the quantiles.
        """
        values = getattr(self, name)
        return [float(v) for v in np.nanquantile(values, q)]


def groups_of(robot: CableRobot) -> tuple[str, ...]:
    """Return the groups of `GROUPS` that mean something to a robot.

    Args:
        robot: the robot; only one with pulleys has a radius that can be wrong.
    """
    return tuple(group for group in GROUPS if group != PULLEYS or has_pulleys(robot))


def errors_of(group: str, errors: CalibrationErrors | None = None) -> CalibrationErrors:
    """Return the errors of one group, the others zero.

    Args:
        group: of `GROUPS`.
        errors: how large they are; the usual ones if None.

    Raises:
        KeyError: there is no such group.
    """
    errors = errors if errors is not None else CalibrationErrors()
    kept = GROUPS[group]
    return CalibrationErrors(
        **{name: value if name in kept else 0.0 for name, value in vars(errors).items()}
    )


def steady_state_error(
    robot: CableRobot, believed: CableRobot, goal: RigidTransform | ArrayLike
) -> Array:
    """Return s (6,) [rad, m] of the true pose at which the platform is seen at the goal.

    Args:
        robot: the true robot.
        believed: the robot as the controller knows it.
        goal: X_WP in F_b, or [roll, pitch, yaw, x, y, z] (rad, m).
    """
    return pose_error(true_from_seen(robot, believed, goal), goal, robot.cameras.X_PM)


def follow(
    robot: CableRobot,
    believed: CableRobot,
    start: RigidTransform | ArrayLike,
    goal: RigidTransform | ArrayLike,
    cable_model: str = "SCMWE",
) -> Way:
    """Return the way from rest at a start to a goal by the law of eq. (19), without dynamics.

    Args:
        robot: the true robot.
        believed: the robot as the controller knows it.
        start: X_WP where it is, or [roll, pitch, yaw, x, y, z] (rad, m).
        goal: X_WP where the controller wants to see it, in either form.
        cable_model: the law's.

    Raises:
        GeometryError, TensionError, EquilibriumError: the robot cannot rest at a pose on the way.
    """
    law = MotorRateLaw(believed, ServoSettings(cable_model=cable_model, gain=1.0))
    wanted = pose_to_vector(as_pose(goal))
    rest = rest_state(robot, start)
    X, length = rest.X_WP, rest.unstrained_length
    k = robot.num_cables

    def ask(X: RigidTransform, length: Array) -> tuple[Array, Array, Array]:
        """Return rates of the lengths (k,), error seen (6,), tensions (k,)."""
        cables = platform_balance(robot, X, length)[2]
        seen = pose_to_vector(true_from_seen(believed, robot, X))
        z = np.concatenate([seen, wanted, np.zeros(6), cables[:, 3], cables[:, 5:8].ravel()])
        out = law(z, 1.0)
        return robot.winch.transmission * out[:k], out[k:], cables[:, 3]

    errors, tensions = [], []
    for _ in range(round(DECAYS / STEP)):
        rates, error, tension = ask(X, length)
        errors.append(error)
        tensions.append(tension)
        middle = length + 0.5 * STEP * rates
        between = _hang(robot, middle, X)
        length = length + STEP * ask(between, middle)[0]
        X = _hang(robot, length, between)
    _, error, tension = ask(X, length)
    return Way(error=np.array([*errors, error]), tension=np.array([*tensions, tension]), X_WP=X)


def _hang(robot: CableRobot, length: Array, near: RigidTransform) -> RigidTransform:
    """Return where the platform hangs on cables that the law has given lengths (k,) [m]."""
    worst = int(np.argmin(length))
    if length[worst] <= 0.0:
        raise EquilibriumError(f"the law winds up cable {worst + 1} wholly: it diverges")
    return forward_kinematics(robot, length, near).X_WP


def led_aside(error: ArrayLike, exact: ArrayLike) -> tuple[float, float]:
    """Return how far one way is led aside of another at most, in rotation [rad] and position [m].

    Each is compared with its own straight way home, at the same times: what lags and cable models
    do to both is left out.

    Args:
        error: (n, 6) s on the one way, [s_w; s_t] (rad, m).
        exact: (n, 6) s on the other.
    """
    apart = []
    for s in (np.asarray(error, float), np.asarray(exact, float)):
        halves = s.reshape(-1, 2, 3)
        size = np.linalg.norm(halves[0], axis=1, keepdims=True)
        home = halves[0] / np.where(size > 0.0, size, 1.0)  # all is aside of no way
        apart.append(halves - np.sum(halves * home, axis=2, keepdims=True) * home)
    rotation, position = np.linalg.norm(apart[0] - apart[1], axis=2).max(axis=0)
    return float(rotation), float(position)


def calibration_effect(
    robot: CableRobot,
    start: RigidTransform | ArrayLike,
    goal: RigidTransform | ArrayLike,
    group: str = "all",
    factor: float = 1.0,
    seeds: Iterable[int] = range(20),
    *,
    errors: CalibrationErrors | None = None,
    cable_model: str = "SCMWE",
) -> CalibrationEffect:
    """Return what random calibrations do to one move.

    Args:
        robot: the true robot.
        start: X_WP where it is, or [roll, pitch, yaw, x, y, z] (rad, m).
        goal: X_WP in F_b where it shall be, in either form.
        group: what is wrong, of `GROUPS`.
        factor: by which the errors are larger.
        seeds: of the calibrations.
        errors: how large errors are; the usual ones if None.
        cable_model: the law's.

    Raises:
        KeyError: there is no such group.
        GeometryError, TensionError, EquilibriumError: with exact calibration there is no such move.
    """
    sizes = errors_of(group, errors).scaled(factor)
    exact = follow(robot, robot, start, goal, cable_model)
    rows, failures = [], {}
    for seed in seeds:
        believed = misjudged(robot, sizes, seed)
        rest = steady_state_error(robot, believed, goal).reshape(2, 3)
        orientation, position = np.linalg.norm(rest, axis=1)
        row = [1e3 * position, np.degrees(orientation), *[np.nan] * 4]
        try:
            way = follow(robot, believed, start, goal, cable_model)
        except CdprError as error:
            failures[seed] = str(error)
        else:
            turned, away = led_aside(way.error, exact.error)
            change = np.abs(way.tension - exact.tension).max()
            row[2:] = [1e3 * away, np.degrees(turned), change, way.tension.min()]
        rows.append(row)
    names = [field.name for field in dataclasses.fields(CalibrationEffect)][2:-1]
    columns = dict(zip(names, np.array(rows).reshape(-1, len(names)).T, strict=True))
    return CalibrationEffect(group=group, factor=factor, failures=failures, **columns)


def stability_factor(
    robot: CableRobot,
    goal: RigidTransform | ArrayLike,
    group: str,
    seed: int,
    *,
    errors: CalibrationErrors | None = None,
    cable_model: str = "SCMWE",
) -> float:
    """Return how many times larger errors may be before the loop diverges, however low its gain.

    The factor at which an eigenvalue of the gain matrix at the goal crosses zero, or at which the
    robot cannot rest where the goal is seen; infinite if that is beyond `LARGEST_FACTOR`.

    Args:
        robot: the true robot.
        goal: X_WP in F_b, or [roll, pitch, yaw, x, y, z] (rad, m).
        group: what is wrong, of `GROUPS`.
        seed: of the calibration.
        errors: how large errors are; the usual ones if None.
        cable_model: the law's.
    """
    sizes = errors_of(group, errors)

    def is_stable(factor: float) -> bool:
        believed = misjudged(robot, sizes.scaled(factor), seed)
        try:
            return gain_matrix(robot, believed, goal, cable_model).is_stable
        except CdprError:
            return False

    return _first_failure(is_stable)


def _first_failure(is_stable: Callable[[float], bool]) -> float:
    """Return the first factor, of a fine scale, at which a condition fails, to 1 %."""
    low = 1.0
    while is_stable(low * 1.2):
        low *= 1.2
        if low > LARGEST_FACTOR:
            return np.inf
    high = low * 1.2
    while high / low > 1.01:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if is_stable(middle) else (low, middle)
    return low
