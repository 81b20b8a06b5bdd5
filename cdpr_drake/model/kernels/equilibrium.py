"""The balance of a platform hanging at rest on elastic catenaries, and the pose where it holds.

Arguments in common: R (3, 3), p (3,) [m]: the pose X_WP; length (k,) [m]: total unstrained lengths;
points (2, k, 3) [m]: p_WA and p_PB; constants (6 + k,) = [w (N/m); stiffness (3); damping time (s);
breaking load (N); runs (m)]; body (4,) = [mass g (N), x_G, y_G, z_G (m)]. Written: out (k, 14) and
jacobian (k, 14, 8) as in `catenary.cable_forces_jacobian`; wrench (6,) [torque; force] on the
platform at its origin, in W; stiffness (6, 6), its change with a motion [rotation; translation] in
W; turn (3, 3), scratch. rotation (3,) [rad]: a rotation vector; step (6,): a motion; tolerance: of
the wrench over the weight [-]; max_iterations: evaluations of the balance at most.
"""

from __future__ import annotations

import math

import numpy as np

from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.catenary import cable_forces_jacobian

MAX_ROTATION = 0.3  # of one step [rad]
MAX_TRANSLATION = 1.0  # of one step [m]
MAX_TRIES = 30  # of lengths along one step
LEAST_STEP = 1e-14  # below it what is left is round-off of stiff cables


@jit
def _add_moment(ex, ey, ez, fx, fy, fz, stiffness):
    """Add [f]x [e]x, the change of e x f as e turns with the platform, to stiffness[:3, :3]."""
    dot = ex * fx + ey * fy + ez * fz
    e = (ex, ey, ez)
    f = (fx, fy, fz)
    for a in range(3):
        for b in range(3):
            stiffness[a, b] += e[a] * f[b]
        stiffness[a, a] -= dot


@jit
def balance(R, p, length, points, constants, body, out, jacobian, wrench, stiffness):
    """Write the wrench on the platform and its stiffness. Return the status of the cables."""
    k = points.shape[1]
    p_WB = np.zeros((k, 3))
    still = np.zeros((k, 3))
    r00, r01, r02 = float(R[0, 0]), float(R[0, 1]), float(R[0, 2])
    r10, r11, r12 = float(R[1, 0]), float(R[1, 1]), float(R[1, 2])
    r20, r21, r22 = float(R[2, 0]), float(R[2, 1]), float(R[2, 2])
    x, y, z = float(p[0]), float(p[1]), float(p[2])
    for i in range(k):
        bx, by, bz = float(points[1, i, 0]), float(points[1, i, 1]), float(points[1, i, 2])
        p_WB[i, 0] = r00 * bx + r01 * by + r02 * bz + x
        p_WB[i, 1] = r10 * bx + r11 * by + r12 * bz + y
        p_WB[i, 2] = r20 * bx + r21 * by + r22 * bz + z
    status = cable_forces_jacobian(
        points[0], p_WB, still, length, np.zeros(k), float(constants[0]), constants[1:4],
        constants[6:], float(constants[4]), out, jacobian,
    )  # fmt: skip
    if status:
        return status
    weight = float(body[0])
    gx, gy, gz = float(body[1]), float(body[2]), float(body[3])
    Gx = r00 * gx + r01 * gy + r02 * gz
    Gy = r10 * gx + r11 * gy + r12 * gz
    Gz = r20 * gx + r21 * gy + r22 * gz
    wrench[:] = 0.0
    wrench[0], wrench[1], wrench[5] = -Gy * weight, Gx * weight, -weight
    stiffness[:] = 0.0
    _add_moment(Gx, Gy, Gz, 0.0, 0.0, -weight, stiffness)
    for i in range(k):
        ex, ey, ez = float(p_WB[i, 0]) - x, float(p_WB[i, 1]) - y, float(p_WB[i, 2]) - z
        fx, fy, fz = float(out[i, 0]), float(out[i, 1]), float(out[i, 2])
        wrench[0] += ey * fz - ez * fy
        wrench[1] += ez * fx - ex * fz
        wrench[2] += ex * fy - ey * fx
        wrench[3] += fx
        wrench[4] += fy
        wrench[5] += fz
        _add_moment(ex, ey, ez, fx, fy, fz, stiffness)
        for b in range(6):
            # The velocity of B under a unit motion b.
            if b < 3:
                vx = ez if b == 1 else (-ey if b == 2 else 0.0)
                vy = ex if b == 2 else (-ez if b == 0 else 0.0)
                vz = ey if b == 0 else (-ex if b == 1 else 0.0)
            else:
                vx = 1.0 if b == 3 else 0.0
                vy = 1.0 if b == 4 else 0.0
                vz = 1.0 if b == 5 else 0.0
            J = jacobian[i]
            dx = float(J[0, 0]) * vx + float(J[0, 1]) * vy + float(J[0, 2]) * vz
            dy = float(J[1, 0]) * vx + float(J[1, 1]) * vy + float(J[1, 2]) * vz
            dz = float(J[2, 0]) * vx + float(J[2, 1]) * vy + float(J[2, 2]) * vz
            stiffness[0, b] += ey * dz - ez * dy
            stiffness[1, b] += ez * dx - ex * dz
            stiffness[2, b] += ex * dy - ey * dx
            stiffness[3, b] += dx
            stiffness[4, b] += dy
            stiffness[5, b] += dz
    return 0


@jit
def rotated(R, rotation, turn):
    """Return exp([rotation]x) R, orthogonal to round-off whatever R has gathered."""
    x, y, z = float(rotation[0]), float(rotation[1]), float(rotation[2])
    angle = math.sqrt(x * x + y * y + z * z)
    s, c = 1.0, 0.5
    if angle > 1e-8:
        s = math.sin(angle) / angle
        c = 2.0 * (math.sin(0.5 * angle) / angle) ** 2
    turn[0, 0], turn[0, 1], turn[0, 2] = (
        1.0 - c * (y * y + z * z),
        c * x * y - s * z,
        c * x * z + s * y,
    )
    turn[1, 0], turn[1, 1], turn[1, 2] = (
        c * x * y + s * z,
        1.0 - c * (x * x + z * z),
        c * y * z - s * x,
    )
    turn[2, 0], turn[2, 1], turn[2, 2] = (
        c * x * z - s * y,
        c * y * z + s * x,
        1.0 - c * (x * x + y * y),
    )
    new = np.zeros((3, 3))
    for a in range(3):
        for b in range(3):
            new[a, b] = turn[a, 0] * R[0, b] + turn[a, 1] * R[1, b] + turn[a, 2] * R[2, b]
    for a in range(3):
        for b in range(3):
            turn[a, b] = new[0, a] * new[0, b] + new[1, a] * new[1, b] + new[2, a] * new[2, b]
    out = np.zeros((3, 3))
    for a in range(3):
        for b in range(3):
            product = new[a, 0] * turn[0, b] + new[a, 1] * turn[1, b] + new[a, 2] * turn[2, b]
            out[a, b] = 1.5 * new[a, b] - 0.5 * product
    return out


@jit
def descent_step(wrench, stiffness):
    """Return a motion [rotation; translation] that lowers the energy, limited in size.

    It is Newton's step with the stiffness made positive definite, its eigenvalues' sizes kept.
    """
    values, vectors = np.linalg.eigh(-0.5 * (stiffness + stiffness.T))
    values = np.abs(values)
    values = np.maximum(values, 1e-9 * values.max())
    step = vectors @ ((vectors.T @ wrench) / values)
    turn = math.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
    shift = math.sqrt(step[3] ** 2 + step[4] ** 2 + step[5] ** 2)
    return step / max(1.0, turn / MAX_ROTATION, shift / MAX_TRANSLATION)


@jit
def find_equilibrium(
    R, p, length, points, constants, body, tolerance, max_iterations, out, jacobian, wrench
):
    """Move the pose R, p, in place, to an equilibrium: downhill in energy by `descent_step`.

    Each step goes as long as the energy falls along it. Return (status of the cables, residual):
    the largest part of the wrench over the weight (torques per metre).
    """
    new_wrench = np.zeros(6)
    stiffness = np.zeros((6, 6))
    turn = np.zeros((3, 3))
    step = np.zeros(6)
    weight = float(body[0])
    status, tries, fraction, descent = 0, 0, 0.0, 0.0
    new_R, new_p = R, p
    # One call of `balance`, for the start and all that is tried: it is long to compile.
    for evaluation in range(max_iterations):
        status = balance(
            new_R, new_p, length, points, constants, body, out, jacobian, new_wrench, stiffness
        )
        if status:
            break
        ahead = float(step @ new_wrench)
        if tries < MAX_TRIES and ahead <= 0.0 and ahead < -0.5 * descent:
            # Beyond the lowest point along the step: go back by the secant of the slope.
            fraction *= max(0.1, descent / (descent - ahead))
            tries += 1
        else:
            if evaluation > 0 and fraction * math.sqrt(step @ step) < LEAST_STEP:
                break
            R[:] = new_R
            p[:] = new_p
            wrench[:] = new_wrench
            if np.abs(wrench).max() <= tolerance * weight:
                break
            step = descent_step(wrench, stiffness)
            fraction, descent, tries = 1.0, float(step @ wrench), 0
        new_R = rotated(R, fraction * step[:3], turn)
        new_p = p + fraction * step[3:]
    return status, np.abs(wrench).max() / weight
