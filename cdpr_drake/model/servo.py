"""Position-based visual servoing: pose error, interaction matrix and the law (eqs. 14, 18, 19)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.errors import GeometryError
from cdpr_drake.model.arrays import RobotArrays
from cdpr_drake.model.cable_models import cable_angles, cable_model_index, cable_model_name
from cdpr_drake.model.kinematics import D_t, cable_geometry
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import (
    Array,
    as_pose,
    log_rotation,
    rotation_interaction_matrix,
    skew,
)
from cdpr_drake.model.statics import check_rank, wrench_matrix

CUSTOMARY_GAIN = 0.1
"""lambda [1/s] where nobody says otherwise: the paper's are from 0.03 to 0.1."""


def pose_error(
    pose: RigidTransform | ArrayLike,
    desired_pose: RigidTransform | ArrayLike,
    X_PM: RigidTransform,
) -> Array:
    """Return s = [s_w; s_t] (6,): the desired target frame M* seen from the current one M (eq. 18).

    s_w is the rotation vector of R_MM* [rad], s_t the position of M* in M [m]; the paper writes
    (s_t, s_w).

    Args:
        pose: X_WP now, or [roll, pitch, yaw, x, y, z] (rad, m).
        desired_pose: X_WP at the goal, in either form.
        X_PM: pose of the target frame on the platform.
    """
    X_MM = (as_pose(pose) @ X_PM).InvertAndCompose(as_pose(desired_pose) @ X_PM)
    return np.concatenate([log_rotation(X_MM.rotation().matrix()), X_MM.translation()])


def interaction_matrix(error: ArrayLike) -> Array:
    """Return L_s (6, 6) with ds/dt = L_s tau for s = [s_w; s_t] and tau = [omega; v] of M in M.

    Args:
        error: s (6,), as `pose_error` gives it.
    """
    s = np.asarray(error, float)
    L = np.zeros((6, 6))
    L[:3, :3] = -rotation_interaction_matrix(s[:3])
    L[3:, :3] = skew(s[3:])
    L[3:, 3:] = -np.eye(3)
    return L


def servo_twist(error: ArrayLike, gain: float) -> Array:
    """Return tau = -gain L_s^-1 s = gain [s_w; s_t + s_t x s_w] (eq. 18), in M: [omega; v].

    Args:
        error: s (6,), as `pose_error` gives it.
        gain: lambda [1/s].
    """
    s = np.asarray(error, float)
    return gain * np.concatenate([s[:3], s[3:] + np.cross(s[3:], s[:3])])


def law_input_size(num_cables: int) -> int:
    """Return the length of the law's input vector, 18 + 4 k, for `num_cables` k."""
    return 18 + 4 * num_cables


@dataclass(frozen=True, kw_only=True)
class ServoSettings:
    """What the control law is told besides the robot.

    Attributes:
        cable_model: "ECM", "CMWE", "SCMWE" or "SLSM": whose instantaneous row the law uses.
        order: order of the series of the ECM (eq. 6).
        gain: lambda [1/s]; None leaves it open: the robot's own, else 0.1, or what a run finds.
        ramp_time: time over which the gain rises from zero at the start [s].
        max_speed: limit of the target frame's speed [m/s].
        max_angular_speed: limit of its angular speed [rad/s].
        model_drum_run: whether the row includes the stretch of the run from the drum, and of the
            arc round a pulley.
    """

    cable_model: str = "SCMWE"
    order: int = 4
    gain: float | None = None
    ramp_time: float = 1.0
    max_speed: float = np.inf
    max_angular_speed: float = np.inf
    model_drum_run: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "cable_model", cable_model_name(self.cable_model))
        if self.gain is not None and not (np.isfinite(self.gain) and self.gain > 0.0):
            raise ValueError(f"the gain must be positive and finite, got {self.gain} 1/s")
        if not (np.isfinite(self.ramp_time) and self.ramp_time >= 0.0):
            raise ValueError(f"the ramp time must not be negative, got {self.ramp_time} s")
        if not (self.max_speed > 0.0 and self.max_angular_speed > 0.0):
            raise ValueError("speed limits must be positive")
        if self.order < 1:
            raise ValueError(f"the order of the series must be at least 1, got {self.order}")

    def of(self, robot: CableRobot) -> ServoSettings:
        """Return the settings with a gain: a `robot`'s own, or the customary one, if it is open."""
        if self.gain is not None:
            return self
        return replace(self, gain=CUSTOMARY_GAIN if robot.gain is None else robot.gain)

    def gain_at(self, time: float) -> float:
        """Return the gain [1/s] at a `time` [s] since the start, on its ramp."""
        gain = CUSTOMARY_GAIN if self.gain is None else self.gain
        return gain if time >= self.ramp_time else gain * max(time, 0.0) / self.ramp_time


class MotorRateLaw:
    """The law of eq. (19) for one robot: what the controller knows, ready to be evaluated.

    The input z (18 + 4 k,) is [pose (6); desired pose (6); desired twist [omega; v] in W (6);
    tensions at the drawing points (k) [N]; tangents at the drawing points, A to B (3 k)], poses as
    [roll, pitch, yaw, x, y, z]; the output (k + 6,) is [motor rates (k) [rad/s]; s (6)].

    Args:
        robot: the robot as the controller knows it (calibrated).
        settings: cable model, gain and limits.

    Raises:
        GeometryError: the wrench matrix has rank below 6 wherever the robot stands.
    """

    def __init__(self, robot: CableRobot, settings: ServoSettings) -> None:
        from cdpr_drake.model.kernels import servo as kernel

        check_controllable(robot)
        self.robot, self.settings = robot, settings
        self._kernel = kernel
        self._transmission = robot.winch.transmission
        self._head = (cable_model_index(settings.cable_model), settings.order)
        self._limits = np.array([settings.max_speed, settings.max_angular_speed])
        known = _known(robot, settings.model_drum_run)
        self._robot_arrays = (*known, RobotArrays(robot).target)

    def __call__(self, z: Array, gain: float) -> Array:
        """Return [motor rates; s] (k + 6,) for the input `z` (18 + 4 k,) and `gain` [1/s]."""
        out = np.zeros(self.robot.num_cables + 6)
        ok = self._kernel.motor_rates(*self._head, gain, self._limits, z, *self._robot_arrays, out)
        self._check(ok)
        out[:-6] /= self._transmission
        return out

    def with_jacobian(self, z: Array, gain: float) -> tuple[Array, Array]:
        """Return the output and its Jacobian (k + 6, 18 + 4 k) for `z` and `gain` [1/s]."""
        out = np.zeros(self.robot.num_cables + 6)
        jacobian = np.zeros((out.size, z.size))
        ok = self._kernel.motor_rates_jacobian(
            *self._head, gain, self._limits, z, *self._robot_arrays, out, jacobian
        )
        self._check(ok)
        out[:-6] /= self._transmission
        jacobian[:-6] /= self._transmission
        return out, jacobian

    @staticmethod
    def _check(ok: bool) -> None:
        if not ok:
            raise GeometryError("the wrench matrix has rank below 6 at the measured pose")


class PoseErrorMap:
    """The pose error s (6,) of eq. (18) as a function of [pose (6); desired pose (6)].

    Args:
        robot: the robot, for the target frame on its platform.
    """

    def __init__(self, robot: CableRobot) -> None:
        from cdpr_drake.model.kernels import servo as kernel

        self._kernel = kernel
        self._target = RobotArrays(robot).target

    def __call__(self, z: Array) -> Array:
        """Return s = [s_w; s_t] (6,) for `z` (12,), both poses as [rpy, xyz] (rad, m)."""
        s = np.zeros(6)
        self._kernel.pose_error(z, self._target, s)
        return s

    def with_jacobian(self, z: Array) -> tuple[Array, Array]:
        """Return s (6,) and its Jacobian (6, 12) with respect to `z`."""
        s, jacobian = np.zeros(6), np.zeros((6, 12))
        self._kernel.pose_error_jacobian(z, self._target, s, jacobian)
        return s, jacobian


def _known(robot: CableRobot, model_drum_run: bool) -> tuple[Array, Array, Array, Array]:
    """Return points, body, stiffness and run, as the law's kernels take them."""
    arrays = RobotArrays(robot)
    run = arrays.run if model_drum_run else np.full(robot.num_cables, -1.0)
    return arrays.points, arrays.body, arrays.stiffness, run


def check_controllable(robot: CableRobot) -> None:
    """Raise GeometryError if the wrench matrix has rank below 6 at every pose tried.

    A cable layout that is deficient somewhere generic is deficient everywhere; the poses tried are
    a few generic ones amid the drawing points.

    Args:
        robot: the robot.
    """
    centre = robot.drawing_points.mean(axis=0)
    below = centre - [0.0, 0.0, 0.5 * np.ptp(robot.drawing_points, axis=0).max() + 0.1]
    failure: GeometryError | None = None
    for rpy in ([0.0, 0.0, 0.0], [0.07, -0.05, 0.11]):
        try:
            check_rank(wrench_matrix(cable_geometry(robot, np.concatenate([rpy, below]))))
            return
        except GeometryError as error:
            failure = error
    assert failure is not None
    raise failure


def D_a(
    robot: CableRobot,
    pose: RigidTransform | ArrayLike,
    H: ArrayLike,
    cable_model: str = "SCMWE",
    order: int = 4,
    model_drum_run: bool = False,
    R_FW: ArrayLike | None = None,
) -> Array:
    """Return (k, 6): rates of the unstrained lengths for a twist [omega; v] of E in F (eq. 14).

    Args:
        robot: the robot as the controller knows it.
        pose: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        H: (k,) [N] horizontal tensions.
        cable_model: "ECM", "CMWE", "SCMWE" or "SLSM".
        order: order of the series of the ECM.
        model_drum_run: whether to include the stretch of the run from the drum, and of the arc
            round a pulley.
        R_FW: (3, 3) rotation to the frame F of the twist; W itself if None.

    Raises:
        GeometryError: the wrench matrix has rank below 6 (not for SLSM, which needs no tensions).
    """
    from cdpr_drake.model.kernels import servo as kernel

    settings = ServoSettings(cable_model=cable_model, order=order)
    X_WP = as_pose(pose)
    k = robot.num_cables
    R = np.ascontiguousarray(X_WP.rotation().matrix())
    # The kernel takes what the sensors give, tension and elevation at A: find them from H.
    H = np.broadcast_to(np.asarray(H, float), (k,))
    chords = cable_geometry(robot, X_WP)
    T_A = cable_angles(chords.Bx, chords.Bz, H, robot.weight_per_metre).T_A
    D = np.zeros((k, 6))
    for j in range(6):
        rates = np.zeros(k)
        ok = kernel.length_rates(
            cable_model_index(settings.cable_model), settings.order, R, X_WP.translation(),
            np.eye(6)[j], T_A, H / T_A, *_known(robot, model_drum_run), rates,
        )  # fmt: skip
        if not ok:
            raise GeometryError("the wrench matrix has rank below 6 at this pose")
        D[:, j] = rates
    if R_FW is not None:
        R_WF = np.asarray(R_FW, float).T
        D = np.hstack([D[:, :3] @ R_WF, D[:, 3:] @ R_WF])
    return D


def D_m(
    robot: CableRobot,
    pose: RigidTransform | ArrayLike,
    H: ArrayLike,
    cable_model: str = "SCMWE",
    order: int = 4,
) -> Array:
    """Return (k, 6): motor rates [rad/s] for a twist [omega; v] of M in M (eq. 19).

    Args:
        robot: the robot as the controller knows it.
        pose: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        H: (k,) [N] horizontal tensions.
        cable_model: "ECM", "CMWE", "SCMWE" or "SLSM".
        order: order of the series of the ECM.

    Raises:
        GeometryError: the wrench matrix has rank below 6.
    """
    X_PM = robot.cameras.X_PM
    R_WM = (as_pose(pose) @ X_PM).rotation().matrix()
    p_EM = X_PM.rotation().matrix().T @ X_PM.translation()
    lengths = D_a(robot, pose, H, cable_model, order)
    return lengths @ D_t(R_WM, p_EM) / robot.winch.transmission
