"""Winches under PID control, in real or complex numbers.

Arguments: x (3 k,) state, desired (k,) motor angles [rad], T_A (k,) tensions at the drawing points
[N], p (11,) parameters; results: xdot (3 k,), torque (k,) [N m], T_W (k,) tensions at the winches
[N].
"""

from __future__ import annotations

import numpy as np

from cdpr_drake.model.kernels import jit


@jit
def winch_derivatives(x, desired, T_A, p, xdot, torque, T_W):
    """Write the derivatives of x = [angle (k); rate (k); integral (k)], the torques and tensions.

    p = [inertia, damping, Kp, Ki, Kd, torque limit, transmission, Coulomb torque, Coulomb rate,
    capstan exponent, capstan speed].
    """
    k = desired.shape[0]
    for i in range(k):
        rate = x[k + i]
        error = desired[i] - x[i]
        wanted = p[2] * error + p[3] * x[2 * k + i] - p[4] * rate
        torque[i] = wanted
        integrate = error
        if abs(wanted.real) > p[5]:
            # Saturated: integrate only what brings the torque back (conditional integration).
            pushes_out = wanted.real * error.real > 0.0
            torque[i] = 0.0 * wanted + (p[5] if wanted.real > 0.0 else -p[5])
            if pushes_out:
                integrate = 0.0 * error
        T_W[i] = T_A[i]
        if p[9] > 0.0:
            T_W[i] = T_A[i] * np.exp(-p[9] * np.tanh(p[6] * rate / p[10]))
        load = p[6] * T_W[i] - p[1] * rate
        if p[7] > 0.0:
            load = load - p[7] * np.tanh(rate / p[8])
        xdot[i] = rate
        xdot[k + i] = (torque[i] + load) / p[0]
        xdot[2 * k + i] = integrate
