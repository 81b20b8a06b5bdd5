"""Position-based visual servoing (eqs. 18 and 19) and the pose error it drives to zero."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydrake.systems.framework import LeafSystem_

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.servo import MotorRateLaw, PoseErrorMap, ServoSettings
from cdpr_drake.systems._template import (
    chain,
    check_finite,
    optional_input,
    system_template,
    value,
)


@system_template("PositionBasedVisualServo")
def PositionBasedVisualServo_(T: type) -> type:
    class Impl(LeafSystem_[T]):
        """The vision-based control law: measurements and desired pose to motor rates (Fig. 8).

        .. pydrake_system::

            name: PositionBasedVisualServo
            input_ports:
            - measured_pose
            - measured_tangents
            - measured_tension
            - desired_pose
            - desired_twist (optional)
            output_ports:
            - motor_rates
            - pose_error

        dq/dt = D_m tau, tau = -lambda L_s^-1 s (eqs. 18, 19), with the instantaneous inverse
        kinematics of the chosen cable model (eq. 11, Table 3), H from tension and tangent (eq. 16),
        and the balance of A.2. The gain rises linearly over the ramp time; speeds above the limits
        scale the whole twist.

        Poses are [roll, pitch, yaw, x, y, z] (rad, m) of X_WP; tangents (3 k) unit vectors from A
        to B in W; measured_tension (k) [N] at the drawing points; desired_twist [omega; v] in W, a
        feed-forward, zero if left open; motor_rates (k) [rad/s]; pose_error (6) is s = [s_w; s_t],
        rotation vector [rad] and position [m] of the desired target frame in the current one.

        Args:
            robot: the robot as the controller believes it.
            settings: cable model, gain and limits; the defaults if None.

        Raises:
            GeometryError: the cables cannot control all six degrees of freedom.
        """

        def _construct(
            self,
            robot: CableRobot,
            settings: ServoSettings | None = None,
            *,
            converter: Any = None,
        ) -> None:
            super().__init__(converter=converter)
            self.robot = robot
            self.settings = settings if settings is not None else ServoSettings()
            self._law = MotorRateLaw(robot, self.settings)
            self._error = PoseErrorMap(robot)
            k = self._k = robot.num_cables
            self._pose_port = self.DeclareVectorInputPort("measured_pose", 6)
            self._tangents_port = self.DeclareVectorInputPort("measured_tangents", 3 * k)
            self._tension_port = self.DeclareVectorInputPort("measured_tension", k)
            self._desired_port = self.DeclareVectorInputPort("desired_pose", 6)
            self._twist_port = self.DeclareVectorInputPort("desired_twist", 6)
            self.DeclareVectorOutputPort(
                "motor_rates",
                k,
                self._calc_rates,
                {self.all_input_ports_ticket(), self.time_ticket()},
            )
            self.DeclareVectorOutputPort(
                "pose_error",
                6,
                self._calc_error,
                {self._pose_port.ticket(), self._desired_port.ticket()},
            )

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.robot, other.settings, converter=converter)

        def _calc_rates(self, context: Any, output: Any) -> None:
            args = (
                self._pose_port.Eval(context),
                self._desired_port.Eval(context),
                optional_input(self._twist_port, context, 6),
                self._tension_port.Eval(context),
                self._tangents_port.Eval(context),
            )
            z = np.concatenate([value(a) for a in args])
            check_finite(z, self, context, "inputs")
            time = context.get_time()
            gain = self.settings.gain_at(time if T is float else time.value())
            if T is float:
                output.SetFromVector(self._law(z, gain)[: self._k])
                return
            y, jacobian = self._law.with_jacobian(z, gain)
            blocks = np.split(jacobian[: self._k], [6, 12, 18, 18 + self._k], axis=1)
            output.SetFromVector(chain(y[: self._k], blocks, *args))

        def _calc_error(self, context: Any, output: Any) -> None:
            pose, desired = self._pose_port.Eval(context), self._desired_port.Eval(context)
            output.SetFromVector(_evaluate_error(self, context, pose, desired))

    return Impl


@system_template("PoseError")
def PoseError_(T: type) -> type:
    class Impl(LeafSystem_[T]):
        """The pose error s of eq. (18) between two poses of the platform.

        .. pydrake_system::

            name: PoseError
            input_ports:
            - pose
            - desired_pose
            output_ports:
            - pose_error

        s = [s_w; s_t] (6): rotation vector [rad] and position [m] of the desired target frame M* in
        the current one M; poses are [roll, pitch, yaw, x, y, z] (rad, m) of X_WP.

        Args:
            robot: the robot, for the target frame on its platform.
        """

        def _construct(self, robot: CableRobot, *, converter: Any = None) -> None:
            super().__init__(converter=converter)
            self.robot = robot
            self._error = PoseErrorMap(robot)
            self._pose_port = self.DeclareVectorInputPort("pose", 6)
            self._desired_port = self.DeclareVectorInputPort("desired_pose", 6)
            tickets = {self._pose_port.ticket(), self._desired_port.ticket()}
            self.DeclareVectorOutputPort("pose_error", 6, self._calc_error, tickets)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.robot, converter=converter)

        def _calc_error(self, context: Any, output: Any) -> None:
            pose, desired = self._pose_port.Eval(context), self._desired_port.Eval(context)
            output.SetFromVector(_evaluate_error(self, context, pose, desired))

    return Impl


def _evaluate_error(system: Any, context: Any, pose: np.ndarray, desired: np.ndarray) -> np.ndarray:
    z = np.concatenate([value(pose), value(desired)])
    check_finite(z, system, context, "inputs")
    if pose.dtype == desired.dtype == float:
        return system._error(z)
    s, jacobian = system._error.with_jacobian(z)
    return chain(s, np.split(jacobian, 2, axis=1), pose, desired)


@system_template("MotorAngleIntegrator")
def MotorAngleIntegrator_(T: type) -> type:
    class Impl(LeafSystem_[T]):
        """Motor rates integrated to the desired motor angles of the winches (Fig. 8).

        .. pydrake_system::

            name: MotorAngleIntegrator
            input_ports:
            - motor_rates
            output_ports:
            - motor_angles

        dq_d/dt = u, always in continuous time: rates held between samples make ramps of angles, not
        steps. State: desired angles (k) [rad].

        Args:
            num_cables: the number of cables k.
        """

        def _construct(self, num_cables: int, *, converter: Any = None) -> None:
            super().__init__(converter=converter)
            self.num_cables = num_cables
            state = self.DeclareContinuousState(num_cables)
            self._rates_port = self.DeclareVectorInputPort("motor_rates", num_cables)
            self.DeclareStateOutputPort("motor_angles", state)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.num_cables, converter=converter)

        def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
            """Write the derivatives of the state in a context."""
            rates = self._rates_port.Eval(context)
            if T is not float or not rates.dot(rates) < math.inf:
                check_finite(value(rates), self, context, "input motor_rates")
            derivatives.SetFromVector(rates)

    return Impl


PositionBasedVisualServo = PositionBasedVisualServo_[None]
PoseError = PoseError_[None]
MotorAngleIntegrator = MotorAngleIntegrator_[None]
