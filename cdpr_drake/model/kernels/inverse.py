"""Inverse kinematics (eqs. 6 to 9) with statics by a rule, in real or complex numbers.

Arguments in common: model, order: the cable model's index and the order of its series; rule: see
below; pose (6,) [roll, pitch, yaw, x, y, z]; points, body, stiffness: as in `model.arrays`; limits
(3,): lowest, highest, preferred chord tension [N]; A (6, k): wrench matrix; load (6,): wrench to
balance; out (k,) [m] and T (k,) [N]: results; jacobian (k, 6): of out; chords (k, 3), arcs (k,):
from where the cables leave to where they attach, and round the pulleys [m]; w [N/m].

Statuses: 0, the number of a cable that would push, RANK_DEFICIENT, INFEASIBLE where no tensions
within the limits hold the weight, CORNER where tensions within them have no derivative, or INSIDE
where an attachment point is inside of a pulley.
"""

from __future__ import annotations

import numpy as np

from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.cable_models import (
    ECM,
    SLSM,
    drawing_point_tension,
    length_and_row_T,
)
from cdpr_drake.model.kernels.distribution import within_bounds
from cdpr_drake.model.kernels.geometry import (
    arm_and_chord,
    dot,
    sagging_chord,
    set_column,
    turned,
)
from cdpr_drake.model.kernels.servo import (
    CONTACT_ROUNDS,
    RANK_DEFICIENT,
    STEP,
    least_norm,
    norm_weight,
    rpy_matrix,
    solve_symmetric,
)

LEAST, LEAST_WITHIN, CLOSEST = range(3)
"""Rules: horizontal tensions of least norm; of least norm within the limits of the chord tensions;
chord tensions closest to the preferred one within the limits."""

INFEASIBLE, CORNER, INSIDE = -2, -3, -4


@jit
def bounded(rule, A, load, weight, limits, T):
    """Write chord tensions T (k,) within limits by a rule, for a wrench matrix A (6, k).

    weight (k,): what squares of the tensions weigh. Found in real numbers; once more among those
    that are free of their limits, so that a complex part follows. Returns a status.
    """
    k = T.shape[0]
    low, high, wish = limits[0], limits[1], limits[2] if rule == CLOSEST else 0.0
    A_r, load_r = np.zeros((6, k)), np.zeros(6)
    q, t = np.ones(k), np.zeros(k)
    for a in range(6):
        load_r[a] = load[a].real
        for i in range(k):
            A_r[a, i] = A[a, i].real
    if rule == LEAST_WITHIN:
        for i in range(k):
            q[i] = weight[i].real
    ones = np.ones(k)
    if within_bounds(A_r, load_r, low * ones, high * ones, wish * ones, q, t) != 0:
        return INFEASIBLE
    G = np.zeros((6, 6), T.dtype)
    left = np.zeros(6, T.dtype)
    free = 0
    for a in range(6):
        left[a] = load[a]
    for i in range(k):
        T[i] = t[i] + 0.0 * load[0]
        is_free = low < t[i] < high
        free += 1 if is_free else 0
        held = wish if is_free else t[i]
        for a in range(6):
            left[a] -= A[a, i] * held
            if is_free:
                for b in range(a + 1):
                    own = 1.0 if rule == CLOSEST else weight[i]
                    G[a, b] += A[a, i] * A[b, i] / own
    if free < 6 or not solve_symmetric(G, left):
        return CORNER
    for i in range(k):
        if low < t[i] < high:
            T[i] = wish + 0.0 * load[0]
            own = 1.0 if rule == CLOSEST else weight[i]
            for a in range(6):
                T[i] += A[a, i] * left[a] / own
    return 0


@jit
def tensions(rule, A, load, weight, limits, T):
    """Write chord tensions T (k,) that balance a load (6,) by a rule; see `bounded`."""
    k = T.shape[0]
    if rule != CLOSEST:
        D, b = np.zeros((6, k), T.dtype), np.zeros(6, T.dtype)
        within = True
        for a in range(6):
            b[a] = load[a]
            for i in range(k):
                D[a, i] = A[a, i] / np.sqrt(weight[i])
        if not least_norm(D, b, T):
            return RANK_DEFICIENT
        for i in range(k):
            T[i] = T[i] / np.sqrt(weight[i])
            within = within and limits[0] <= T[i].real <= limits[1]
        if rule == LEAST or within:
            return 0
    return bounded(rule, A, load, weight, limits, T)


@jit
def _balance(R, pose, points, body, chords, D, load, weight):
    """Write D (6, k), load (6,) and what squares of tensions weigh (k,), for chords (k, 3)."""
    w = body[4]
    Gx, Gy, _Gz = turned(R, body[1:4])
    load[0], load[1], load[2] = -Gy * body[0], Gx * body[0], 0.0 * Gx
    load[3], load[4], load[5] = 0.0 * Gx, 0.0 * Gx, -body[0] + 0.0 * Gx
    for i in range(points.shape[1]):
        ax, ay, az = chords[i, 0], chords[i, 1], chords[i, 2]
        arm = turned(R, points[1, i])
        Bx = np.sqrt(ax * ax + ay * ay)
        L = np.sqrt(Bx * Bx + az * az)
        ux, uy = ax / L, ay / L
        weight[i] = norm_weight(ux * ux + uy * uy)
        set_column(i, arm, (ux, uy, az / L), D)
        half = 0.5 * w * L
        load[0] -= arm[1] * half
        load[1] += arm[0] * half
        load[5] -= half


@jit
def _sag(R, pose, points, w, T, chords, arcs):
    """Move chords and arcs, in place, to where cables of chord tensions T (k,) leave pulleys."""
    for i in range(points.shape[1]):
        if points[3, i, 0] == 0.0:
            continue
        AB = (chords[i, 0], chords[i, 1], chords[i, 2])
        arm = turned(R, points[1, i])
        b = (arm[0] + pose[3], arm[1] + pose[4], arm[2] + pose[5])
        least = 0.05 * w * np.sqrt(dot(AB, AB))
        tension = T[i] if T[i].real > least.real else least
        (chords[i, 0], chords[i, 1], chords[i, 2]), arcs[i] = sagging_chord(
            i, points, b, AB, tension, w
        )


@jit
def unstrained_lengths(model, order, rule, pose, points, body, stiffness, limits, out, T):
    """Write unstrained lengths (k,), of spans and arcs, and chord tensions T (k,) at a pose (6,).

    What horizontal tensions weigh near the vertical, `servo.norm_weight` says. Arcs stretch where
    the model does. Returns a status.
    """
    k = points.shape[1]
    w = body[4]
    R = np.zeros((3, 3), pose.dtype)
    rpy_matrix(pose[0], pose[1], pose[2], R)
    D = np.zeros((6, k), pose.dtype)
    chords = np.zeros((k, 3), pose.dtype)
    arcs = np.zeros(k, pose.dtype)
    weight = np.zeros(k, pose.dtype)
    load = np.zeros(6, pose.dtype)
    rounds = 1
    for i in range(k):
        _arm, _b, (chords[i, 0], chords[i, 1], chords[i, 2]), arcs[i] = arm_and_chord(
            i, R, pose[3:6], points
        )
        if arcs[i].real < -0.5:
            return INSIDE
        if points[3, i, 0] != 0.0 and model != SLSM:
            rounds = 1 + CONTACT_ROUNDS
    status = 0
    for again in range(rounds):
        if again > 0:
            _sag(R, pose, points, w, T, chords, arcs)
        _balance(R, pose, points, body, chords, D, load, weight)
        status = tensions(rule, D, load, weight, limits, T)
        if status in (RANK_DEFICIENT, INFEASIBLE):
            return status
    for i in range(k):
        if not T[i].real > 0.0:
            status = i + 1
            continue
        EA = stiffness[0] + 0.0 * T[i]
        if stiffness[1] != 0.0:
            EA = stiffness[0] - stiffness[1] / (T[i] + stiffness[2])
        ax, ay, az = chords[i, 0], chords[i, 1], chords[i, 2]
        Bx = np.sqrt(ax * ax + ay * ay)
        out[i], _, _, _ = length_and_row_T(model, order, Bx, az, T[i], w, EA)
        if model == ECM:
            arcs[i] /= 1.0 + drawing_point_tension(Bx, az, T[i], w)[0] / EA
        out[i] += arcs[i]
    return status


@jit
def unstrained_lengths_jacobian(
    model, order, rule, pose, points, body, stiffness, limits, out, T, jacobian
):
    """As `unstrained_lengths`, with the Jacobian (k, 6) with respect to the pose vector."""
    k = points.shape[1]
    zc = np.zeros(6, np.complex128)
    yc = np.zeros(k, np.complex128)
    Tc = np.zeros(k, np.complex128)
    for j in range(6):
        zc[j] = pose[j]
    for j in range(6):
        zc[j] = zc[j] + STEP * 1j
        status = unstrained_lengths(model, order, rule, zc, points, body, stiffness, limits, yc, Tc)
        if status != 0:
            return status
        zc[j] = pose[j]
        for i in range(k):
            jacobian[i, j] = yc[i].imag / STEP
            out[i] = yc[i].real
            T[i] = Tc[i].real
    return 0
