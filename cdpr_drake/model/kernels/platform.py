"""All cables on one platform: from the platform's state to the wrench on it.

Arguments in common: state (12,) [roll, pitch, yaw, x, y, z, omega, v] of the platform in W;
attachment (k, 3) [m]: p_PB; p_WB, v_WB (k, 3): attachment points and their velocities in W; length,
rate (k,): total unstrained lengths and their rates; points (2, k, 3) [m]: p_WA and p_PB; constants
(6 + k,) = [w (N/m); stiffness (3); damping time (s); breaking load (N); runs (m)], few arguments
because each costs time at every call from Python; packed (6 + 9 k,): the result.
"""

from __future__ import annotations

import numpy as np

from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.catenary import cable_forces
from cdpr_drake.model.kernels.servo import rpy_matrix


@jit
def attachment_motion(state, attachment, p_WB, v_WB):
    """Write positions and velocities (k, 3) of the attachment points in W.

    state = [roll, pitch, yaw, x, y, z, omega (3), v (3)] of the platform in W.
    """
    R = np.zeros((3, 3))
    rpy_matrix(state[0], state[1], state[2], R)
    wx, wy, wz = state[6], state[7], state[8]
    for i in range(attachment.shape[0]):
        bx, by, bz = attachment[i, 0], attachment[i, 1], attachment[i, 2]
        ex = R[0, 0] * bx + R[0, 1] * by + R[0, 2] * bz
        ey = R[1, 0] * bx + R[1, 1] * by + R[1, 2] * bz
        ez = R[2, 0] * bx + R[2, 1] * by + R[2, 2] * bz
        p_WB[i, 0], p_WB[i, 1], p_WB[i, 2] = ex + state[3], ey + state[4], ez + state[5]
        v_WB[i, 0] = state[9] + wy * ez - wz * ey
        v_WB[i, 1] = state[10] + wz * ex - wx * ez
        v_WB[i, 2] = state[11] + wx * ey - wy * ex


@jit
def platform_cable_forces(state, length, rate, points, constants, packed):
    """Write the cables' wrench [torque; force] at the platform's origin and their outputs, packed.

    packed = [wrench (6); T_A (k); T_B (k); t_A (3 k); t_B (3 k); dbeta (k)]. Returns the status of
    `cable_forces`, or minus the number of a cable whose tension is not below the breaking load.
    """
    k = points.shape[1]
    p_WB = np.empty((k, 3))
    v_WB = np.empty((k, 3))
    out = np.empty((k, 14))
    attachment_motion(state, points[1], p_WB, v_WB)
    status = cable_forces(
        points[0], p_WB, v_WB, length, rate,
        constants[0], constants[1:4], constants[6:], constants[4], out,
    )  # fmt: skip
    for a in range(6):
        packed[a] = 0.0
    for i in range(k):
        ex, ey, ez = p_WB[i, 0] - state[3], p_WB[i, 1] - state[4], p_WB[i, 2] - state[5]
        fx, fy, fz = out[i, 0], out[i, 1], out[i, 2]
        packed[0] += ey * fz - ez * fy
        packed[1] += ez * fx - ex * fz
        packed[2] += ex * fy - ey * fx
        packed[3] += fx
        packed[4] += fy
        packed[5] += fz
        packed[6 + i], packed[6 + k + i] = out[i, 3], out[i, 4]
        for a in range(3):
            packed[6 + 2 * k + 3 * i + a] = out[i, 5 + a]
            packed[6 + 5 * k + 3 * i + a] = out[i, 8 + a]
        packed[6 + 8 * k + i] = out[i, 11]
        if status == 0 and not max(out[i, 3], out[i, 4]) < constants[5]:
            status = -i - 1
    return status
