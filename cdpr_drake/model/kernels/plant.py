"""All that is continuous in a control loop, in one function.

The state is y = [roll, pitch, yaw, x, y, z, omega, v of the platform in W (12); motor angles (k);
their rates (k); integrals of the angle errors (k); filters of the load cells, if there are any (n_f
k); desired motor angles, if motor rates command (k)], SI units and radians. out: the result, of the
length of the state it is of.
"""

from __future__ import annotations

import math

import numpy as np

from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.geometry import cross, turned
from cdpr_drake.model.kernels.load_cell import filter_derivatives
from cdpr_drake.model.kernels.platform import platform_cable_forces
from cdpr_drake.model.kernels.servo import rpy_matrix
from cdpr_drake.model.kernels.winch import winch_derivatives

NOT_FINITE = 1_000_000
"""Status of `plant_derivatives` where the cables are well but a derivative is not finite."""


@jit
def platform_derivatives(state, wrench, solid, out):
    """Write the derivatives (12,) of the platform under a wrench [torque; force] at its origin.

    solid (8, 3) = [mass, gravity, 0; p_PG; inertia about G in P (3 rows); its inverse (3 rows)].
    """
    R = np.zeros((3, 3))
    roll, pitch, yaw = float(state[0]), float(state[1]), float(state[2])
    rpy_matrix(roll, pitch, yaw, R)
    Rt, inertia, inverse = R.T, solid[2:5], solid[5:8]
    mass, gravity = float(solid[0, 0]), float(solid[0, 1])
    EG = turned(R, solid[1])
    omega = (float(state[6]), float(state[7]), float(state[8]))
    fx, fy, fz = float(wrench[3]), float(wrench[4]), float(wrench[5])
    # About G the weight has no moment, and the other forces act at the platform's origin.
    shift = cross(EG, (fx, fy, fz))
    tx, ty, tz = float(wrench[0]) - shift[0], float(wrench[1]) - shift[1], float(wrench[2])
    torque = turned(Rt, (tx, ty, tz - shift[2]))
    w = turned(Rt, omega)
    gyro = cross(w, turned(inertia, w))
    a = turned(inverse, (torque[0] - gyro[0], torque[1] - gyro[1], torque[2] - gyro[2]))
    alpha = turned(R, a)
    tangential = cross(alpha, EG)
    centripetal = cross(omega, cross(omega, EG))
    cy, sy = math.cos(yaw), math.sin(yaw)
    along = (cy * omega[0] + sy * omega[1]) / math.cos(pitch)
    out[0] = along
    out[1] = cy * omega[1] - sy * omega[0]
    out[2] = omega[2] + along * math.sin(pitch)
    out[3], out[4], out[5] = state[9], state[10], state[11]
    out[6], out[7], out[8] = alpha
    out[9] = fx / mass - tangential[0] - centripetal[0]
    out[10] = fy / mass - tangential[1] - centripetal[1]
    out[11] = fz / mass - gravity - tangential[2] - centripetal[2]


@jit
def plant_derivatives(
    y, command, noise, wrench, points, constants, solid, winch, cells, filters, out
):
    """Write dy/dt and return the status of `platform_cable_forces`, or NOT_FINITE.

    command (k,): the desired motor angles, or their rates where the state holds the angles; noise
    (k,): of the load cells, standard normal; wrench (6,): on the platform besides its cables and
    weight; points, constants: as in kernels/platform; solid: as above; winch: as in kernels/winch;
    cells (5, k): gains, biases, sigmas and rates of the load cells as in kernels/load_cell, and the
    unstrained lengths at motor angle zero; filters: n_f, 0 without load cells.
    """
    k = command.shape[0]
    first = 12 + 3 * k
    last = first + filters * k
    r = float(winch[6])
    packed = np.empty(6 + 9 * k)
    winches = np.empty(5 * k)
    length = np.empty(k)
    rate = np.empty(k)
    desired = np.empty(k)
    total = np.empty(6)
    integrates = last < y.shape[0]
    size = 0.0
    for i in range(k):
        length[i] = float(cells[4, i]) + r * float(y[12 + i])
        rate[i] = r * float(y[12 + k + i])
        desired[i] = command[i]
        if integrates:
            desired[i] = y[last + i]
            out[last + i] = command[i]
            size += abs(float(command[i]))
    status = platform_cable_forces(y[:12], length, rate, points, constants, packed)
    if status != 0:
        return status
    for i in range(6):
        total[i] = float(packed[i]) + float(wrench[i])
    platform_derivatives(y[:12], total, solid, out[:12])
    is_finite = winch_derivatives(y[12:first], desired, packed[6 : 6 + k], winch, winches)
    for i in range(3 * k):
        out[12 + i] = winches[i]
    filtered = filter_derivatives(
        y[first:last], winches[4 * k :], noise, cells[:4], out[first:last]
    )
    for i in range(12):
        size += abs(float(out[i]))
    if is_finite and filtered and size < np.inf:
        return 0
    return NOT_FINITE
