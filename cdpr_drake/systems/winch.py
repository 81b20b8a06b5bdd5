"""Winches under PID control."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, ContinuousState, LeafSystem

from cdpr_drake.model.equilibrium import RestState
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.winch import WinchModel
from cdpr_drake.systems._template import check_finite, lift, numbered, scalar_convertible, value

AT_REST = 1e-6
"""How far desired motor angles may be from those of a rest, relative to these."""


@scalar_convertible
class WinchDynamics(LeafSystem):
    """k winches whose motors follow desired angles under PID control (Fig. 9).

    .. pydrake_system::

        name: WinchDynamics
        input_ports:
        - desired_motor_angle
        - tension_at_drawing_point
        output_ports:
        - unstrained_length
        - unstrained_length_rate
        - motor_angle
        - motor_rate
        - motor_torque
        - tension_at_winch
        - state

    J d2q/dt2 = tau + r T_W - b dq/dt - tau_c tanh(dq/dt / v_s), with tau = Kp (q_d - q) + Ki
    integral(q_d - q) - Kd dq/dt within the torque limit, the integral held while it would push
    the torque further out; l = l(0) + r q, q > 0 pays out; T_W = T_A exp(-mu theta tanh(dl/dt /
    v_l)). Friction and capstan are off by default; both are stiff when their speeds are small.

    All ports but state have size k: angles in rad, unstrained length in m from the drum
    on, torque in N m, tensions in N. State, and the port of that name (3 k):
    [angle (k); rate (k); integral (k)].

    Args:
        robot: the robot, for its winch.
    """

    def __init__(self, robot: CableRobot) -> None:
        super().__init__()
        self.robot = robot
        self._model = WinchModel(robot)
        self._transmission = robot.winch.transmission
        self._zero_length = robot.winch.encoder_zero_length
        self._capstan = robot.winch.capstan_exponent > 0.0
        k = self._k = robot.num_cables
        state = self.DeclareContinuousState(k, k, k)
        self._desired_port = self.DeclareVectorInputPort("desired_motor_angle", k)
        self._tension_port = self.DeclareVectorInputPort("tension_at_drawing_point", k)
        own = {self.xc_ticket()}
        for name, calc in (
            ("unstrained_length", self._calc_length),
            ("unstrained_length_rate", self._calc_length_rate),
            ("motor_angle", self._calc_angle),
            ("motor_rate", self._calc_rate),
        ):
            self.DeclareVectorOutputPort(name, k, calc, own)
        self.DeclareVectorOutputPort(
            "motor_torque", k, self._calc_torque, own | {self._desired_port.ticket()}
        )
        self.DeclareVectorOutputPort(
            "tension_at_winch", k, self._calc_tension, own | {self._tension_port.ticket()}
        )
        self._state_port = self.DeclareStateOutputPort("state", state)
        self.state_names = numbered("angle", "rate", "integral", count=k)

    def set_at_rest(self, context: Context, rest: RestState) -> None:
        """Hold the tensions of a `rest` at its motor angles, in a `context`."""
        tension = rest.tension_at_drawing_point
        context.SetContinuousState(self._model.at_rest(rest.motor_angles, tension)[0])

    def not_at_rest(self, context: Context) -> str:
        """Return why the desired angles do not let the winches rest in a `context`, or ""."""
        desired, angle = self._desired_port.Eval(context), self._state(context)[: self._k]
        return not_at_rest(self._model, desired, angle, self._tension_port.Eval(context))

    def residual_scale(self, context: Context) -> np.ndarray:
        """Return 1 rad/s, the holding torque over the inertia, and the angles, in a `context`."""
        winch, angle = self.robot.winch, self._state(context)[: self._k]
        tension = np.abs(self._tension_port.Eval(context))
        holding = np.maximum(winch.transmission * tension / winch.inertia, 1.0)
        return np.concatenate([np.ones(self._k), holding, np.maximum(1.0, np.abs(angle))])

    def _state(self, context: Context) -> np.ndarray:
        return context.get_continuous_state_vector().CopyToVector()

    def _evaluate(self, x: np.ndarray, desired: np.ndarray, tension: np.ndarray) -> np.ndarray:
        """Return [derivative (3 k); torque (k); tension at the winch (k)]."""
        args = x, desired, tension
        return lift(self._model, tuple(map(value, args)), *args)

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        """Write the derivatives of the state in a context."""
        x = self._state_port.Eval(context)
        desired, tension = self._desired_port.Eval(context), self._tension_port.Eval(context)
        if not x.dtype.hasobject:
            xdot, finite = self._model.derivatives(x, desired, tension)
        else:
            xdot, finite = self._evaluate(x, desired, tension)[: 3 * self._k], False
        if not finite:
            check_finite(value(xdot), self, context, "derivatives")
        derivatives.SetFromVector(xdot)

    def _calc_length(self, context: Context, output: BasicVector) -> None:
        angle = self._state(context)[: self._k]
        output.SetFromVector(self._zero_length + self._transmission * angle)

    def _calc_length_rate(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._transmission * self._state(context)[self._k : 2 * self._k])

    def _calc_angle(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._state(context)[: self._k])

    def _calc_rate(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._state(context)[self._k : 2 * self._k])

    def _calc_torque(self, context: Context, output: BasicVector) -> None:
        desired = self._desired_port.Eval(context)
        y = self._evaluate(self._state(context), desired, np.zeros(self._k))
        torque = y[3 * self._k : 4 * self._k]
        check_finite(value(torque), self, context, "motor torque")
        output.SetFromVector(torque)

    def _calc_tension(self, context: Context, output: BasicVector) -> None:
        tension = self._tension_port.Eval(context)
        check_finite(value(tension), self, context, "input tension_at_drawing_point")
        if self._capstan:
            tension = self._evaluate(self._state(context), np.zeros(self._k), tension)
        output.SetFromVector(tension[-self._k :])


def not_at_rest(
    winch: WinchModel, desired: np.ndarray, angle: np.ndarray, tension: np.ndarray
) -> str:
    """Return why desired angles do not let winches rest, or "".

    Args:
        winch: the winches.
        desired: (k,) desired motor angles [rad].
        angle: (k,) motor angles [rad].
        tension: (k,) [N] at the drawing points.
    """
    wanted = winch.at_rest(angle, tension)[1]
    error = np.abs(desired - wanted)
    if np.max(error / np.maximum(1.0, np.abs(wanted))) <= AT_REST:
        return ""
    return (
        f"it is given desired motor angles up to {np.max(error):.3g} rad from those at which it "
        "rests; what they come from has to implement set_at_rest(context, rest), and take "
        "rest.desired_motor_angles, or motor_angles_at(X_WP) (see cdpr_drake.systems.answers)"
    )
