"""What takes the place of load cells and tangent cameras: the model, at the measured pose.

Both are of the simplified statics (A.2) and the parabola (SCMWE): what a controller can compute
that knows the pose, the mass and the cables. What it cannot know is the internal tension.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.errors import TensionError
from cdpr_drake.model.cable_models import cable_angles, horizontal_tension
from cdpr_drake.model.distribution import minimum_norm_within
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.statics import weight_wrench, wrench_matrix

MODELLED = ("tensions", "tangents")
"""What a control law can take from the model instead of from sensors."""

SLACK = 0.05
"""Horizontal tension of a cable that would have to push, over its weight per metre and span [-]."""


def modelled_tensions(robot: CableRobot, pose: RigidTransform | ArrayLike) -> Array:
    """Return the tensions at the drawing points (k,) [N]: of least norm within the limits.

    They hold the weight that the controller knows. Where none within the limits do, those of least
    norm whatever the limits; a cable that would have to push then hangs slack.

    Args:
        robot: the robot as the controller knows it.
        pose: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
    """
    geometry = cable_geometry(robot, pose)
    wrench = weight_wrench(robot, geometry)
    matrix = wrench_matrix(geometry)
    try:
        chord = minimum_norm_within(matrix, wrench, *robot.cable.limits)
    except TensionError:
        chord = np.asarray(np.linalg.lstsq(matrix, wrench, rcond=None)[0], float)
    w = robot.weight_per_metre
    H = np.maximum(chord * geometry.Bx / geometry.L, SLACK * w * geometry.Bx)
    return cable_angles(geometry.Bx, geometry.Bz, H, w, "SCMWE").T_A


def modelled_tangents(
    robot: CableRobot, pose: RigidTransform | ArrayLike, tension: ArrayLike
) -> Array:
    """Return the cables' directions (k, 3) at their drawing points, unit, from A to B, in W.

    Args:
        robot: the robot as the controller knows it.
        pose: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        tension: (k,) [N] at the drawing points.
    """
    geometry = cable_geometry(robot, pose)
    Bx, Bz, w = geometry.Bx, geometry.Bz, robot.weight_per_metre
    T_A = np.maximum(np.asarray(tension, float), 0.0)
    H, _ = horizontal_tension("SCMWE", Bx, Bz, T_A, w)
    alpha = cable_angles(Bx, Bz, H, w, "SCMWE").alpha
    return np.cos(alpha)[:, None] * geometry.x_A + np.sin(alpha)[:, None] * geometry.z
