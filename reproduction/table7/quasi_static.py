"""The vision-based loop without dynamics: lengths follow the law, the platform where it then hangs.

Winches that keep up and a platform at rest at every moment: for slow motions the same as a full
simulation, some twenty times as fast.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake import CableRobot
from cdpr_drake.model.camera import true_from_seen
from cdpr_drake.model.equilibrium import forward_kinematics, platform_balance, rest_state
from cdpr_drake.model.rotations import Array, as_pose, pose_to_vector
from cdpr_drake.model.servo import MotorRateLaw, ServoSettings, pose_error


@dataclass(frozen=True, kw_only=True, eq=False)
class QuasiStaticRun:
    """What came of a run.

    Attributes:
        time: (n,) [s].
        poses: (n, 6) X_WP as [roll, pitch, yaw, x, y, z] (rad, m).
        rotation_error: (n, 3) s_w of the true target frame to that wanted [rad].
        position_error: (n, 3) of the target frame's origin, wanted minus true, in W [m].
    """

    time: Array
    poses: Array
    rotation_error: Array
    position_error: Array


def run_quasi_static(
    robot: CableRobot,
    believed: CableRobot,
    start: RigidTransform | ArrayLike,
    goal: RigidTransform | ArrayLike,
    settings: ServoSettings,
    until: float,
    *,
    step: float = 1.5,
    tensions: str = "minimum norm",
) -> QuasiStaticRun:
    """Move a robot from rest to a goal by the law of eq. (19), without dynamics and noise.

    Midpoint steps in the lengths; after each the pose is found where the platform hangs.

    Args:
        robot: the true robot.
        believed: the robot as the controller knows it.
        start: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        goal: the same, of F_b: what the controller wants to see the platform at.
        settings: of the law.
        until: [s].
        step: [s], at most.
        tensions: at the start, "minimum norm" or "within limits".

    Raises:
        TensionError, EquilibriumError, GeometryError: the robot cannot be at a pose on the way.
    """
    law = MotorRateLaw(believed, settings)
    wanted = pose_to_vector(as_pose(goal))
    rest = rest_state(robot, start, tensions)
    X, length = rest.X_WP, rest.unstrained_length

    def rates(X: RigidTransform, length: Array, time: float) -> Array:
        out = platform_balance(robot, X, length)[2]
        seen = pose_to_vector(true_from_seen(believed, robot, X))
        z = np.concatenate([seen, wanted, np.zeros(6), out[:, 3], out[:, 5:8].ravel()])
        motors = law(z, settings.gain_at(time))[: robot.num_cables]
        return robot.winch.transmission * motors

    count = int(np.ceil(until / step))
    times = np.linspace(0.0, until, count + 1)
    h = until / count
    poses = [X]
    for t in times[:-1]:
        half = length + 0.5 * h * rates(X, length, float(t))
        between = forward_kinematics(robot, half, X).X_WP
        length = length + h * rates(between, half, float(t) + 0.5 * h)
        X = forward_kinematics(robot, length, between).X_WP
        poses.append(X)
    return _errors(robot, times, poses, as_pose(goal))


def _errors(
    robot: CableRobot, times: Array, poses: list[RigidTransform], goal: RigidTransform
) -> QuasiStaticRun:
    X_PM = robot.cameras.X_PM
    target = (goal @ X_PM).translation()
    return QuasiStaticRun(
        time=times,
        poses=np.array([pose_to_vector(X) for X in poses]),
        rotation_error=np.array([pose_error(X, goal, X_PM)[:3] for X in poses]),
        position_error=np.array([target - (X @ X_PM).translation() for X in poses]),
    )
