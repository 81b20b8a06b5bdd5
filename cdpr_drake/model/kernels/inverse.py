"""Inverse kinematics (eqs. 6 to 9) with minimum-norm statics, in real or complex numbers.

Arguments in common: model, order: the cable model's index and the order of its series; pose (6,)
[roll, pitch, yaw, x, y, z]; points, body, stiffness: as in `model.arrays`; out (k,) [m] and T (k,)
[N]: results; jacobian (k, 6): of out.
"""

from __future__ import annotations

import numpy as np

from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.cable_models import length_and_row_T
from cdpr_drake.model.kernels.geometry import arm_and_chord, set_column, turned
from cdpr_drake.model.kernels.servo import STEP, least_norm, norm_weight, rpy_matrix


@jit
def unstrained_lengths(model, order, pose, points, body, stiffness, out, T):
    """Write the spans' unstrained lengths (k,) and chord tensions T (k,) at a pose (6,).

    The horizontal tensions are the minimum-norm solution of the static balance (A.2), see
    `servo.norm_weight`. Returns 0, -1 at a rank below 6, or the number of a cable that would push.
    """
    drawing, attachment = points[0], points[1]
    k = drawing.shape[0]
    w = body[4]
    R = np.zeros((3, 3), pose.dtype)
    rpy_matrix(pose[0], pose[1], pose[2], R)
    D = np.zeros((6, k), pose.dtype)
    Bx = np.zeros(k, pose.dtype)
    Bz = np.zeros(k, pose.dtype)
    scale = np.zeros(k, pose.dtype)
    load = np.zeros(6, pose.dtype)
    Gx, Gy, _Gz = turned(R, body[1:4])
    load[0], load[1], load[5] = -Gy * body[0], Gx * body[0], -body[0]
    for i in range(k):
        arm, (ax, ay, Bz[i]) = arm_and_chord(i, R, pose[3:6], drawing, attachment)
        Bx[i] = np.sqrt(ax * ax + ay * ay)
        L = np.sqrt(Bx[i] * Bx[i] + Bz[i] * Bz[i])
        ux, uy = ax / L, ay / L
        scale[i] = 1.0 / np.sqrt(norm_weight(ux * ux + uy * uy))
        set_column(i, arm, (scale[i] * ux, scale[i] * uy, scale[i] * Bz[i] / L), D)
        half = 0.5 * w * L
        load[0] -= arm[1] * half
        load[1] += arm[0] * half
        load[5] -= half
    if not least_norm(D, load, T):
        return -1
    status = 0
    for i in range(k):
        T[i] = scale[i] * T[i]
        if not T[i].real > 0.0:
            status = i + 1
            continue
        EA = stiffness[0] + 0.0 * T[i]
        if stiffness[1] != 0.0:
            EA = stiffness[0] - stiffness[1] / (T[i] + stiffness[2])
        out[i], _, _, _ = length_and_row_T(model, order, Bx[i], Bz[i], T[i], w, EA)
    return status


@jit
def unstrained_lengths_jacobian(model, order, pose, points, body, stiffness, out, T, jacobian):
    """As `unstrained_lengths`, with the Jacobian (k, 6) with respect to the pose vector."""
    k = points.shape[1]
    zc = np.zeros(6, np.complex128)
    yc = np.zeros(k, np.complex128)
    Tc = np.zeros(k, np.complex128)
    for j in range(6):
        zc[j] = pose[j]
    for j in range(6):
        zc[j] = zc[j] + STEP * 1j
        status = unstrained_lengths(model, order, zc, points, body, stiffness, yc, Tc)
        if status != 0:
            return status
        zc[j] = pose[j]
        for i in range(k):
            jacobian[i, j] = yc[i].imag / STEP
            out[i] = yc[i].real
            T[i] = Tc[i].real
    return 0
