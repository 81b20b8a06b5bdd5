"""Inverse kinematics (eqs. 6 to 9) with minimum-norm statics, in real or complex numbers.

Arguments in common: model, order: the cable model's index and the order of its series; pose (6,)
[roll, pitch, yaw, x, y, z]; drawing, attachment (k, 3) [m]: p_WA and p_PB; body = [mass g, x_G,
y_G, z_G, w]; stiffness (3,); out (k,) [m] and H (k,) [N]: results; jacobian (k, 6): of out.
"""

from __future__ import annotations

import numpy as np

from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.cable_models import length_and_row
from cdpr_drake.model.kernels.servo import STEP, rpy_matrix, solve_symmetric


@jit
def unstrained_lengths(model, order, pose, drawing, attachment, body, stiffness, out, H):
    """Write the spans' unstrained lengths (k,) and horizontal tensions H (k,) at a pose (6,).

    H is the minimum-norm solution of the static balance (A.2); body = [mass g, x_G, y_G, z_G, w];
    stiffness (3,). Returns 0, -1 at a rank below 6, or the number of a cable that would push.
    """
    k = drawing.shape[0]
    w = body[4]
    R = np.zeros((3, 3), pose.dtype)
    rpy_matrix(pose[0], pose[1], pose[2], R)
    D = np.zeros((6, k), pose.dtype)
    Bx = np.zeros(k, pose.dtype)
    Bz = np.zeros(k, pose.dtype)
    load = np.zeros(6, pose.dtype)
    Gx = R[0, 0] * body[1] + R[0, 1] * body[2] + R[0, 2] * body[3]
    Gy = R[1, 0] * body[1] + R[1, 1] * body[2] + R[1, 2] * body[3]
    load[0], load[1], load[5] = -Gy * body[0], Gx * body[0], -body[0]
    for i in range(k):
        bx, by, bz = attachment[i, 0], attachment[i, 1], attachment[i, 2]
        ex = R[0, 0] * bx + R[0, 1] * by + R[0, 2] * bz
        ey = R[1, 0] * bx + R[1, 1] * by + R[1, 2] * bz
        ez = R[2, 0] * bx + R[2, 1] * by + R[2, 2] * bz
        ax = ex + pose[3] - drawing[i, 0]
        ay = ey + pose[4] - drawing[i, 1]
        Bz[i] = ez + pose[5] - drawing[i, 2]
        Bx[i] = np.sqrt(ax * ax + ay * ay)
        t, cx, cy = Bz[i] / Bx[i], ax / Bx[i], ay / Bx[i]
        D[0, i], D[1, i], D[2, i] = ey * t - ez * cy, ez * cx - ex * t, ex * cy - ey * cx
        D[3, i], D[4, i], D[5, i] = cx, cy, t
        half = 0.5 * w * np.sqrt(Bx[i] * Bx[i] + Bz[i] * Bz[i])
        load[0] -= ey * half
        load[1] += ex * half
        load[5] -= half
    gram = np.zeros((6, 6), pose.dtype)
    for a in range(6):
        for b in range(a + 1):
            for i in range(k):
                gram[a, b] += D[a, i] * D[b, i]
    if not solve_symmetric(gram, load):
        return -1
    status = 0
    for i in range(k):
        H[i] = 0.0 * load[0]
        for a in range(6):
            H[i] += D[a, i] * load[a]
        if not H[i].real > 0.0:
            status = i + 1
            continue
        t = Bz[i] / Bx[i]
        EA = stiffness[0] + 0.0 * H[i]
        if stiffness[1] != 0.0:
            EA = stiffness[0] - stiffness[1] / (H[i] * np.sqrt(1.0 + t * t) + stiffness[2])
        out[i], _, _, _ = length_and_row(model, order, Bx[i], Bz[i], H[i], w, EA)
    return status


@jit
def unstrained_lengths_jacobian(
    model, order, pose, drawing, attachment, body, stiffness, out, H, jacobian
):
    """As `unstrained_lengths`, with the Jacobian (k, 6) with respect to the pose vector."""
    k = drawing.shape[0]
    zc = np.zeros(6, np.complex128)
    yc = np.zeros(k, np.complex128)
    Hc = np.zeros(k, np.complex128)
    for j in range(6):
        zc[j] = pose[j]
    for j in range(6):
        zc[j] = zc[j] + STEP * 1j
        status = unstrained_lengths(model, order, zc, drawing, attachment, body, stiffness, yc, Hc)
        if status != 0:
            return status
        zc[j] = pose[j]
        for i in range(k):
            jacobian[i, j] = yc[i].imag / STEP
            out[i] = yc[i].real
            H[i] = Hc[i].real
    return 0
