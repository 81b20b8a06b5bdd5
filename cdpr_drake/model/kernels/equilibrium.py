"""The balance of a platform hanging at rest on elastic catenaries, and the pose where it holds.

Arguments in common: R (3, 3), p (3,) [m]: the pose X_WP; length (k,) [m]: total unstrained lengths;
points, constants, body: as in `model.arrays`. Written: out (k, 14) and jacobian (k, 14, 8) as in
`catenary.cable_forces_jacobian`; wrench (6,) [torque; force] on the platform at its origin, in W;
stiffness (6, 6), its change with a motion [rotation; translation] in W; turn (3, 3), scratch.
rotation (3,) [rad]: a rotation vector; step (6,): a motion; tolerance: of the wrench over the
weight [-]; max_iterations: evaluations of the balance at most.
"""

from __future__ import annotations

import math

import numpy as np

from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.geometry import attachment_motion, cross, turned, vector
from cdpr_drake.model.kernels.pulley import robot_forces

MAX_ROTATION = 0.3  # of one step [rad]
MAX_TRANSLATION = 1.0  # of one step [m]
MAX_TRIES = 30  # of lengths along one step
LEAST_STEP = 1e-14  # below it what is left is round-off of stiff cables


@jit
def _add(arm, force, wrench):
    """Add [arm x force; force] to a wrench (6,)."""
    torque = cross(arm, force)
    for a in range(3):
        wrench[a] += torque[a]
        wrench[3 + a] += force[a]


@jit
def _add_moment(e, f, stiffness):
    """Add [f]x [e]x, the change of e x f as e turns with the platform, to stiffness[:3, :3]."""
    dot = e[0] * f[0] + e[1] * f[1] + e[2] * f[2]
    for a in range(3):
        for b in range(3):
            stiffness[a, b] += e[a] * f[b]
        stiffness[a, a] -= dot


@jit
def balance(R, p, length, points, constants, body, out, jacobian, wrench, stiffness):
    """Write the wrench on the platform and its stiffness. Return the status of the cables."""
    k = points.shape[1]
    p_WB, v_WB = np.zeros((k, 3)), np.zeros((k, 3))
    still = np.zeros(3)
    attachment_motion(R, p, still, still, points[1], p_WB, v_WB)
    status = robot_forces(points, p_WB, v_WB, length, np.zeros(k), constants, True, out, jacobian)
    if status:
        return status
    weight = float(body[0])
    Gx, Gy, Gz = turned((vector(R[0]), vector(R[1]), vector(R[2])), vector(body[1:4]))
    wrench[:] = 0.0
    wrench[0], wrench[1], wrench[5] = -Gy * weight, Gx * weight, -weight
    stiffness[:] = 0.0
    _add_moment((Gx, Gy, Gz), (0.0, 0.0, -weight), stiffness)
    x, y, z = vector(p)
    for i in range(k):
        bx, by, bz = vector(p_WB[i])
        arm, force = (bx - x, by - y, bz - z), vector(out[i])
        change = (vector(jacobian[i, 0]), vector(jacobian[i, 1]), vector(jacobian[i, 2]))
        _add(arm, force, wrench)
        _add_moment(arm, force, stiffness)
        for b in range(3):
            unit = (1.0 if b == 0 else 0.0, 1.0 if b == 1 else 0.0, 1.0 if b == 2 else 0.0)
            _add(arm, turned(change, cross(unit, arm)), stiffness[:, b])
            _add(arm, turned(change, unit), stiffness[:, 3 + b])
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
