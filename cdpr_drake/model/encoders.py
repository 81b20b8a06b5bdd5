"""Where the encoders of a robot that is known wrongly are zeroed."""

from __future__ import annotations

from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.inverse_kinematics import InverseKinematics
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.statics import DEFAULT_RULE


def zeroed_at(
    believed: CableRobot,
    robot: CableRobot,
    X_WP: RigidTransform | ArrayLike,
    cable_model: str = "SCMWE",
    rule: str = DEFAULT_RULE,
) -> CableRobot:
    """Return the believed robot with its encoders zeroed where the true one rests.

    Its `winch.encoder_zero_length` is shifted, cable by cable, so that its inverse kinematics at
    the pose gives the motor angles at which the true robot rests there. Joint space control with
    that belief starts at rest at the pose, however wrong the belief is elsewhere.

    Args:
        believed: the robot as the controller believes it.
        robot: the true robot.
        X_WP: the pose at which both are compared, or [roll, pitch, yaw, x, y, z] (rad, m).
        cable_model: of the inverse kinematics.
        rule: how tensions are chosen, in both; one of `model.statics.RULES`.

    Raises:
        GeometryError, TensionError, EquilibriumError: one of the two cannot rest at the pose.
        ValueError: an unknown cable model or rule.
    """
    lengths = InverseKinematics(believed, cable_model, rule=rule).lengths(X_WP)
    angles = rest_state(robot, X_WP, rule).motor_angles
    winch = believed.winch
    zero = lengths - winch.transmission * angles
    return believed.replace(winch=winch.replace(encoder_zero_length=zero))
