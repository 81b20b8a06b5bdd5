"""All cables on one platform: from the platform's state to the wrench on it.

Arguments: state (12,) [roll, pitch, yaw, x, y, z, omega, v] of the platform in W; length, rate
(k,): total unstrained lengths and their rates; points, constants: as in `model.arrays`, few
arguments because each costs time at every call from Python; packed (6 + 9 k,): the result.
"""

from __future__ import annotations

import numpy as np

from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.geometry import attachment_motion, cross, vector
from cdpr_drake.model.kernels.pulley import robot_forces
from cdpr_drake.model.kernels.servo import rpy_matrix


@jit
def platform_cable_forces(state, length, rate, points, constants, packed):
    """Write the cables' wrench [torque; force] at the platform's origin and their outputs, packed.

    packed = [wrench (6); T_A (k); T_B (k); t_A (3 k); t_B (3 k); dbeta (k)]. Returns the status of
    `robot_forces`, or minus the number of a cable whose tension is not below the breaking load.
    """
    k = points.shape[1]
    p_WB = np.empty((k, 3))
    v_WB = np.empty((k, 3))
    out = np.empty((k, 14))
    R = np.zeros((3, 3))
    rpy_matrix(float(state[0]), float(state[1]), float(state[2]), R)
    attachment_motion(R, state[3:6], state[6:9], state[9:12], points[1], p_WB, v_WB)
    unused = np.empty((0, 14, 8))
    status = robot_forces(points, p_WB, v_WB, length, rate, constants, False, out, unused)
    x, y, z = vector(state[3:6])
    tx, ty, tz, sx, sy, sz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(k):
        (bx, by, bz), force = vector(p_WB[i]), vector(out[i])
        torque = cross((bx - x, by - y, bz - z), force)
        tx, ty, tz = tx + torque[0], ty + torque[1], tz + torque[2]
        sx, sy, sz = sx + force[0], sy + force[1], sz + force[2]
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
