"""Winches under PID control, in real or complex numbers.

Arguments: x (3 k,) state, desired (k,) motor angles [rad], T_A (k,) tensions at the drawing points
[N], p (11,) parameters; out (5 k,): [derivative of the state (3 k); torques (k) [N m]; tensions at
the winches T_W (k) [N]].
"""

from __future__ import annotations

import numpy as np

from cdpr_drake.model.kernels import jit


@jit
def winch_derivatives(x, desired, T_A, p, out):
    """Write the derivatives of x = [angle (k); rate (k); integral (k)], the torques and tensions.

    Returns whether the derivatives are finite.

    p = [inertia, damping, Kp, Ki, Kd, torque limit, transmission, Coulomb torque, Coulomb rate,
    capstan exponent, capstan speed].
    """
    k = desired.shape[0]
    size = 0.0
    for i in range(k):
        rate = x[k + i]
        error = desired[i] - x[i]
        wanted = p[2] * error + p[3] * x[2 * k + i] - p[4] * rate
        torque = wanted
        integrate = error
        if abs(wanted.real) > p[5]:
            # Saturated: integrate only what brings the torque back (conditional integration).
            pushes_out = wanted.real * error.real > 0.0
            torque = 0.0 * wanted + (p[5] if wanted.real > 0.0 else -p[5])
            if pushes_out:
                integrate = 0.0 * error
        T_W = T_A[i] + 0.0 * rate
        if p[9] > 0.0:
            T_W = T_A[i] * np.exp(-p[9] * np.tanh(p[6] * rate / p[10]))
        load = p[6] * T_W - p[1] * rate
        if p[7] > 0.0:
            load = load - p[7] * np.tanh(rate / p[8])
        acceleration = (torque + load) / p[0]
        size += abs(rate.real) + abs(acceleration.real) + abs(integrate.real)
        out[i] = rate
        out[k + i] = acceleration
        out[2 * k + i] = integrate
        out[3 * k + i] = torque
        out[4 * k + i] = T_W
    return size < np.inf
