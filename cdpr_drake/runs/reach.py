"""Whether a robot can be where a run starts and ends, asked before its first step."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.diagrams.watch import LimitWatch
from cdpr_drake.errors import GeometryError, SimulationError, TensionError
from cdpr_drake.model.inverse_kinematics import InverseKinematics
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import pose_to_vector
from cdpr_drake.model.statics import bounded_distribution, check_rank, weight_wrench, wrench_matrix


def check_pose(robot: CableRobot, X_WP: RigidTransform, name: str) -> None:
    """Raise an error unless the robot can hold its platform at a pose, whatever the controller.

    There must be cable tensions from 0 to the largest allowed that balance the weight, in the
    simplified statics of the paper's A.2, and the pose must be one a simulation goes on from.

    Args:
        robot: the robot.
        X_WP: the pose.
        name: what the error calls it, e.g. "goal".

    Raises:
        GeometryError: outside the hull of the drawing points, a pitch near 90 degrees, or a wrench
            matrix of rank below 6.
        TensionError: no such tensions.
    """
    try:
        LimitWatch(robot).check_pose(0.0, pose_to_vector(X_WP))
    except SimulationError as error:
        raise GeometryError(
            f"the {name} cannot be reached: {error.quantity} {error.message}"
        ) from None
    geometry = cable_geometry(robot, X_WP)
    matrix = wrench_matrix(geometry)
    check_rank(matrix)
    high = robot.cable.max_tension
    try:  # any tensions will do; those of least norm are found first
        bounded_distribution(matrix, weight_wrench(robot, geometry), 0.0, high, 0.0)
    except TensionError as error:
        x, y, z = X_WP.translation()
        raise TensionError(
            f"the {name} at (x, y, z) = ({x:.2f}, {y:.2f}, {z:.2f}) m is outside the "
            f"wrench-feasible workspace with {robot.mass:g} kg to carry: {error}"
        ) from None


def check_inverse_kinematics(
    robot: CableRobot, poses: np.ndarray, times: np.ndarray, cable_model: str, rule: str
) -> None:
    """Raise an error unless joint space control has motor angles all the way.

    Args:
        robot: the robot as the controller believes it.
        poses: (n, 6) desired poses [roll, pitch, yaw, x, y, z] (rad, m).
        times: (n,) when they are desired [s].
        cable_model: of the inverse kinematics.
        rule: how it chooses tensions.

    Raises:
        GeometryError, TensionError: at one of the poses it has none; names the time.
    """
    inverse = InverseKinematics(robot, cable_model, rule=rule)
    for time, pose in zip(times, poses, strict=True):
        try:
            inverse.lengths(pose)
        except (GeometryError, TensionError) as error:
            raise type(error)(f"joint space control at t = {time:.3g} s: {error}") from None
