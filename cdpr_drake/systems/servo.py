"""Position-based visual servoing (eqs. 18 and 19) and the pose error it drives to zero."""

from __future__ import annotations

import math

from pydrake.systems.framework import BasicVector, Context, ContinuousState, LeafSystem

from cdpr_drake.model.equilibrium import RestState
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.servo import MotorRateLaw, PoseErrorMap, ServoSettings
from cdpr_drake.systems._template import (
    check_finite,
    finite_inputs,
    lift,
    numbered,
    optional_input,
    scalar_convertible,
    seconds,
    value,
)


@scalar_convertible
class PositionBasedVisualServo(LeafSystem):
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

    def __init__(self, robot: CableRobot, settings: ServoSettings | None = None) -> None:
        super().__init__()
        self.robot = robot
        self.settings = (settings if settings is not None else ServoSettings()).of(robot)
        self.steady_after = self.settings.ramp_time
        self._law = MotorRateLaw(robot, self.settings)
        self._error = PoseErrorMap(robot)
        k = self._k = robot.num_cables
        self._pose_port = self.DeclareVectorInputPort("measured_pose", 6)
        self._tangents_port = self.DeclareVectorInputPort("measured_tangents", 3 * k)
        self._tension_port = self.DeclareVectorInputPort("measured_tension", k)
        self._desired_port = self.DeclareVectorInputPort("desired_pose", 6)
        self._twist_port = self.DeclareVectorInputPort("desired_twist", 6)
        needed = {self.all_input_ports_ticket(), self.time_ticket()}
        poses = {self._pose_port.ticket(), self._desired_port.ticket()}
        self.DeclareVectorOutputPort("motor_rates", k, self._calc_rates, needed)
        self.DeclareVectorOutputPort("pose_error", 6, self._calc_error, poses)

    def transient(self, time: float) -> str:
        """Return what is still on its ramp at a `time` [s], "" if nothing is."""
        s = self.settings
        if time >= s.ramp_time:
            return ""
        return f"a gain of {s.gain_at(time):g}/s, on its way to {s.gain:g}/s"

    def _calc_rates(self, context: Context, output: BasicVector) -> None:
        args = (
            self._pose_port.Eval(context),
            self._desired_port.Eval(context),
            optional_input(self._twist_port, context),
            self._tension_port.Eval(context),
            self._tangents_port.Eval(context),
        )
        z = finite_inputs(self, context, *args)
        gain = self.settings.gain_at(seconds(context))
        output.SetFromVector(lift(self._law, (z, gain), *args)[: self._k])

    def _calc_error(self, context: Context, output: BasicVector) -> None:
        pose, desired = self._pose_port.Eval(context), self._desired_port.Eval(context)
        z = finite_inputs(self, context, pose, desired)
        output.SetFromVector(lift(self._error, (z,), pose, desired))


@scalar_convertible
class PoseError(LeafSystem):
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

    def __init__(self, robot: CableRobot) -> None:
        super().__init__()
        self.robot = robot
        self._error = PoseErrorMap(robot)
        self._pose_port = self.DeclareVectorInputPort("pose", 6)
        self._desired_port = self.DeclareVectorInputPort("desired_pose", 6)
        tickets = {self._pose_port.ticket(), self._desired_port.ticket()}
        self.DeclareVectorOutputPort("pose_error", 6, self._calc_error, tickets)

    def _calc_error(self, context: Context, output: BasicVector) -> None:
        pose, desired = self._pose_port.Eval(context), self._desired_port.Eval(context)
        z = finite_inputs(self, context, pose, desired)
        output.SetFromVector(lift(self._error, (z,), pose, desired))


@scalar_convertible
class MotorAngleIntegrator(LeafSystem):
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

    def __init__(self, num_cables: int) -> None:
        super().__init__()
        self.num_cables = num_cables
        state = self.DeclareContinuousState(num_cables)
        self._rates_port = self.DeclareVectorInputPort("motor_rates", num_cables)
        self.DeclareStateOutputPort("motor_angles", state)
        self.state_names = numbered("angle", count=num_cables)

    def set_at_rest(self, context: Context, rest: RestState) -> None:
        """Ask for the motor angles of a `rest`, in a `context`."""
        context.SetContinuousState(rest.desired_motor_angles)

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        """Write the derivatives of the state in a context."""
        rates = self._rates_port.Eval(context)
        if rates.dtype.hasobject or not rates.dot(rates) < math.inf:
            check_finite(value(rates), self, context, "input motor_rates")
        derivatives.SetFromVector(rates)
