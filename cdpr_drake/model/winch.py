"""Winch dynamics: the PID of Fig. 9 on a motor that carries its cable's tension."""

from __future__ import annotations

import numpy as np

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array

STEP = 1e-40


class WinchModel:
    """Angle, rate and error integral of k winches: J d2q/dt2 = tau + r T_W - b dq/dt - friction.

    tau = Kp (q_d - q) + Ki integral - Kd dq/dt (Fig. 9), limited, the integral held while it would
    push the torque further out. q > 0 pays out. T_W = T_A exp(-mu theta tanh(dl/dt / v_l)): an
    eyelet's friction raises the winch's share when it reels in (capstan equation). Friction terms
    are stiff when their speeds are small.

    Args:
        robot: the robot, for its winch.
    """

    def __init__(self, robot: CableRobot) -> None:
        from cdpr_drake.model.kernels import winch as kernel

        w = robot.winch
        self._evaluate = kernel.winch_derivatives
        self.num_cables = robot.num_cables
        self._winch = w
        self.parameters = np.array(
            [
                w.inertia,
                w.damping,
                w.proportional_gain,
                w.integral_gain,
                w.derivative_gain,
                w.torque_limit,
                w.transmission,
                w.coulomb_torque,
                w.coulomb_rate,
                w.capstan_exponent,
                w.capstan_speed,
            ],
            float,
        )

    def __call__(self, state: Array, desired: Array, T_A: Array) -> Array:
        """Return [derivative of the state (3 k); motor torques (k) [N m]; tensions T_W (k) [N]].

        Args:
            state: (3 k,) [angle (rad); rate (rad/s); integral of the angle error (rad s)].
            desired: (k,) desired motor angles [rad].
            T_A: (k,) tensions at the drawing points [N].
        """
        k = self.num_cables
        out = np.empty(5 * k, state.dtype)
        self._evaluate(state, desired, T_A, self.parameters, out)
        return out

    def at_rest(self, angle: Array, T_A: Array) -> tuple[Array, Array]:
        """Return the state (3 k) and the desired angles (k) [rad] with which the winches rest.

        The motors hold the torque - r T_A: by their integrals, or, if the PID has none, by angles
        that differ from the desired ones.

        Args:
            angle: (k,) motor angles [rad].
            T_A: (k,) tensions at the drawing points [N].
        """
        w, integral, desired = self._winch, np.zeros(angle.size), angle.copy()
        hold = w.transmission * T_A
        if w.integral_gain > 0.0:
            integral = -hold / w.integral_gain
        elif w.proportional_gain > 0.0:
            desired = angle - hold / w.proportional_gain
        return np.concatenate([angle, np.zeros(angle.size), integral]), desired

    def derivatives(self, state: Array, desired: Array, T_A: Array) -> tuple[Array, bool]:
        """Return the derivative of the state (3 k) alone, and whether it is finite.

        Args:
            state: (3 k,) as above.
            desired: (k,) desired motor angles [rad].
            T_A: (k,) tensions at the drawing points [N].
        """
        out = np.empty(5 * self.num_cables)
        finite: bool = self._evaluate(state, desired, T_A, self.parameters, out)
        return out[: 3 * self.num_cables], finite

    def with_jacobian(self, state: Array, desired: Array, T_A: Array) -> tuple[Array, Array]:
        """Return what a call returns and its Jacobian (5 k, 5 k) by [state; desired; T_A].

        Args:
            state: (3 k,) as above.
            desired: (k,) desired motor angles [rad].
            T_A: (k,) tensions at the drawing points [N].
        """
        k = self.num_cables
        z = np.concatenate([state, desired, T_A])
        jacobian = np.zeros((5 * k, 5 * k))
        cables = np.arange(k)
        for block in range(5):
            # No winch touches another: one complex step moves the same quantity of all of them.
            stepped = z.astype(complex)
            stepped[block * k : (block + 1) * k] += 1j * STEP
            y = self(stepped[: 3 * k], stepped[3 * k : 4 * k], stepped[4 * k :])
            for row in range(5):
                jacobian[row * k + cables, block * k + cables] = (
                    y[row * k : (row + 1) * k].imag / STEP
                )
        return self(state, desired, T_A), jacobian
