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
    # Plain floats: uncompiled, arithmetic on NumPy's scalars takes four times as long.
    R = np.zeros((3, 3))
    rpy_matrix(float(state[0]), float(state[1]), float(state[2]), R)
    r00, r01, r02 = float(R[0, 0]), float(R[0, 1]), float(R[0, 2])
    r10, r11, r12 = float(R[1, 0]), float(R[1, 1]), float(R[1, 2])
    r20, r21, r22 = float(R[2, 0]), float(R[2, 1]), float(R[2, 2])
    x, y, z = float(state[3]), float(state[4]), float(state[5])
    wx, wy, wz = float(state[6]), float(state[7]), float(state[8])
    vx, vy, vz = float(state[9]), float(state[10]), float(state[11])
    for i in range(attachment.shape[0]):
        bx, by, bz = float(attachment[i, 0]), float(attachment[i, 1]), float(attachment[i, 2])
        ex = r00 * bx + r01 * by + r02 * bz
        ey = r10 * bx + r11 * by + r12 * bz
        ez = r20 * bx + r21 * by + r22 * bz
        p_WB[i, 0], p_WB[i, 1], p_WB[i, 2] = ex + x, ey + y, ez + z
        v_WB[i, 0] = vx + wy * ez - wz * ey
        v_WB[i, 1] = vy + wz * ex - wx * ez
        v_WB[i, 2] = vz + wx * ey - wy * ex


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
        float(constants[0]), constants[1:4], constants[6:], float(constants[4]), out,
    )  # fmt: skip
    x, y, z = float(state[3]), float(state[4]), float(state[5])
    tx, ty, tz, sx, sy, sz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(k):
        ex, ey, ez = float(p_WB[i, 0]) - x, float(p_WB[i, 1]) - y, float(p_WB[i, 2]) - z
        fx, fy, fz = float(out[i, 0]), float(out[i, 1]), float(out[i, 2])
        tx += ey * fz - ez * fy
        ty += ez * fx - ex * fz
        tz += ex * fy - ey * fx
        sx += fx
        sy += fy
        sz += fz
        packed[6 + i], packed[6 + k + i] = out[i, 3], out[i, 4]
        for a in range(3):
            packed[6 + 2 * k + 3 * i + a] = out[i, 5 + a]
            packed[6 + 5 * k + 3 * i + a] = out[i, 8 + a]
        packed[6 + 8 * k + i] = out[i, 11]
        if status == 0 and not max(out[i, 3], out[i, 4]) < constants[5]:
            status = -i - 1
    packed[0], packed[1], packed[2] = tx, ty, tz
    packed[3], packed[4], packed[5] = sx, sy, sz
    return status
