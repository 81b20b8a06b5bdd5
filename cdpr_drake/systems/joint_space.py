"""Joint space control's reference: desired poses to motor angles, a profile of poses."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from cdpr_drake.model.cable_models import cable_model_name
from cdpr_drake.model.inverse_kinematics import InverseKinematics, motor_angles
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import as_pose, exp_rotation, pose_to_vector
from cdpr_drake.model.servo import pose_error, servo_twist
from cdpr_drake.model.statics import DEFAULT_RULE
from cdpr_drake.systems._template import chain, check_finite, scalar_convertible, seconds, value


@scalar_convertible
class InverseKinematicsAngles(LeafSystem):
    """Motor angles for a desired pose, by the paper's inverse kinematics (Fig. 9, eq. 8).

    .. pydrake_system::

        name: InverseKinematicsAngles
        input_ports:
        - desired_pose
        output_ports:
        - motor_angles

    q = (l_model(pose) + arc + run - l(0)) / r, the arc being that round a pulley, with horizontal
    tensions of least norm for the nominal mass (A.2), within the robot's limits unless the rule
    says otherwise. All models but the ECM know no stretch: that is joint space control's error.

    desired_pose (6) is [roll, pitch, yaw, x, y, z] (rad, m) of X_WP; motor_angles (k) in rad.

    Args:
        robot: the robot as the controller believes it.
        cable_model: "ECM", "CMWE", "SCMWE" or "SLSM".
        rule: how tensions are chosen, one of `model.statics.RULES`.

    Raises:
        GeometryError, TensionError: at evaluation, where no cable tensions hold the platform.
    """

    def __init__(
        self, robot: CableRobot, cable_model: str = "SCMWE", rule: str = DEFAULT_RULE
    ) -> None:
        super().__init__()
        self.robot, self.cable_model = robot, cable_model_name(cable_model)
        self.rule = rule
        self._inverse = InverseKinematics(robot, cable_model, rule=rule)
        self._pose_port = self.DeclareVectorInputPort("desired_pose", 6)
        self.DeclareVectorOutputPort(
            "motor_angles", robot.num_cables, self._calc_angles, {self._pose_port.ticket()}
        )

    def motor_angles_at(self, X_WP: RigidTransform) -> np.ndarray:
        """Return the motor angles (k,) [rad] for a desired pose `X_WP`."""
        return self._inverse.motor_angles(X_WP)

    def _calc_angles(self, context: Context, output: BasicVector) -> None:
        pose = self._pose_port.Eval(context)
        check_finite(value(pose), self, context, "input desired_pose")
        plain = not pose.dtype.hasobject
        lengths, jacobian = self._inverse.lengths_and_jacobian(value(pose), not plain)
        angles = motor_angles(self.robot, lengths)
        if not plain:
            angles = chain(angles, jacobian / self.robot.winch.transmission, pose)
        output.SetFromVector(angles)


@scalar_convertible
class ExponentialApproach(LeafSystem):
    """A desired pose that moves from start to goal as exact visual servoing would move it.

    .. pydrake_system::

        name: ExponentialApproach
        output_ports:
        - desired_pose
        - desired_twist

    s(t) = s(0) exp(-integral of lambda), the gain lambda rising linearly over the ramp time:
    the profile of eq. (18), for joint space control, which must not be given a step.

    desired_pose (6) is [roll, pitch, yaw, x, y, z] (rad, m) of X_WP; desired_twist (6) is
    [omega; v] of the platform in W.

    Args:
        robot: the robot, for the target frame on its platform.
        start: X_WP at the start, or [roll, pitch, yaw, x, y, z].
        goal: X_WP at the goal, in either form.
        gain: lambda [1/s].
        ramp_time: time over which the gain rises from zero [s].
    """

    def __init__(
        self,
        robot: CableRobot,
        start: RigidTransform | ArrayLike,
        goal: RigidTransform | ArrayLike,
        gain: float = 0.1,
        ramp_time: float = 1.0,
    ) -> None:
        super().__init__()
        self.robot, self.gain, self.ramp_time = robot, gain, ramp_time
        self.start, self.goal = as_pose(start), as_pose(goal)
        self._X_PM = robot.cameras.X_PM
        self._initial_error = pose_error(self.start, self.goal, self._X_PM)
        time = {self.time_ticket()}
        self.DeclareVectorOutputPort("desired_pose", 6, self._calc_pose, time)
        self.DeclareVectorOutputPort("desired_twist", 6, self._calc_twist, time)

    def _error(self, time: float) -> np.ndarray:
        ramped = min(time, self.ramp_time)
        spent = time - ramped + (0.5 * ramped**2 / self.ramp_time if self.ramp_time else 0.0)
        return self._initial_error * np.exp(-self.gain * spent)

    def _target(self, error: np.ndarray) -> RigidTransform:
        """Return X_WM with the goal at `error` from it."""
        X_MM = RigidTransform(RotationMatrix(exp_rotation(error[:3])), error[3:])
        return self.goal @ self._X_PM @ X_MM.inverse()

    def _calc_pose(self, context: Context, output: BasicVector) -> None:
        X_WM = self._target(self._error(seconds(context)))
        output.SetFromVector(pose_to_vector(X_WM @ self._X_PM.inverse()))

    def _calc_twist(self, context: Context, output: BasicVector) -> None:
        time = seconds(context)
        gain = self.gain * (min(time / self.ramp_time, 1.0) if self.ramp_time else 1.0)
        error = self._error(time)
        R_WM = self._target(error).rotation()
        tau = servo_twist(error, gain)
        omega, v_M = R_WM @ tau[:3], R_WM @ tau[3:]
        p_ME = R_WM @ self._X_PM.inverse().translation()
        output.SetFromVector(np.concatenate([omega, v_M + np.cross(omega, p_ME)]))
