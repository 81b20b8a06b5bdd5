"""What the model instead of load cells and tangent cameras does to the loop, without simulation."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.analysis.gain_matrix import target_twist
from cdpr_drake.diagrams import ModelledSensing
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.modelled import modelled_tangents, modelled_tensions
from cdpr_drake.model.rest_model import rest_model
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, as_pose, pose_to_vector
from cdpr_drake.model.servo import MotorRateLaw, ServoSettings


def modelled_gain_matrix(
    robot: CableRobot,
    believed: CableRobot,
    pose: RigidTransform | ArrayLike,
    modelled: tuple[str, ...] = (),
    cable_model: str = "SCMWE",
) -> Array:
    """Return Gamma (6, 6), the motion had per motion asked for, of a law that models what it lacks.

    As `analysis.gain_matrix` does, for exact cameras and load cells. The law stands still at the
    goal whatever it believes of the cables, so their model counts only here, as a factor.

    Args:
        robot: the true robot.
        believed: the robot as the controller knows it, with the true one's cameras: its mass, say.
        pose: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        modelled: "tensions" and "tangents" that the law takes from the model.
        cable_model: the law's.

    Raises:
        GeometryError, TensionError, EquilibriumError: the robot cannot rest there.
        ValueError: what cannot be modelled.
    """
    ModelledSensing(modelled=modelled)  # refuses what cannot be modelled
    X_WP, k = as_pose(pose), robot.num_cables
    model = rest_model(robot, rest_state(robot, X_WP))
    tension, tangents = model.rest.tension_at_drawing_point, model.tangents
    if "tensions" in modelled:
        tension = modelled_tensions(believed, X_WP)
    if "tangents" in modelled:
        tangents = modelled_tangents(believed, X_WP, tension)
    law = MotorRateLaw(believed, ServoSettings(cable_model=cable_model))
    at_goal = np.tile(pose_to_vector(X_WP), 2)
    z = np.concatenate([at_goal, np.zeros(6), tension, tangents.ravel()])
    rates = robot.winch.transmission * law.with_jacobian(z, 1.0)[1][:k, 12:18]
    moved = model.pose_per_length @ rates @ target_twist(believed, X_WP)
    return np.asarray(np.linalg.solve(target_twist(robot, X_WP), moved))
