"""Load cells: filters in series, and what the balance of the platform says of their readings.

Arguments in common: z = [pose (6); readings (k) [N]; stuck (k)], float or complex; pose, reading,
memory (3 k,): the same in parts, memory = [reading when it last changed; what was expected then;
stuck]; points, body: as in `model.arrays`; p (11,) = [reading below which a cell may be dead, above
which it is not, max_tension, noise tolerated [N], part of the weight tolerated, least trust, least
tension over w Bx, length that torques are divided by [m], part of what is tolerated over which a
reading goes missing, change of a reading that counts as none [N], step of a frame]; M (6, k + 2), G
(6, 6): see `weigh`; i, j: columns; x: a number; out, jacobian, after: results.
"""

from __future__ import annotations

import numpy as np

from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.geometry import arm_and_chord, set_column
from cdpr_drake.model.kernels.servo import STEP, rpy_matrix


@jit
def filter_derivatives(x, tension, noise, p, xdot):
    """Write the derivatives of n_f first-order filters in series and return whether all are finite.

    Arguments: x, xdot (n_f k,), filter after filter; tension [N], noise [-] (k,); p (4, k): gain,
    bias [N] and sigma [N] of the readings, and the filters' rate 2 pi f_c [1/s].
    """
    k = tension.shape[0]
    size = 0.0
    for i in range(k):
        rate = float(p[3, i])
        before = float(p[0, i]) * float(tension[i]) + float(p[1, i]) + float(p[2, i] * noise[i])
        for j in range(i, x.shape[0], k):
            after = float(x[j])
            change = rate * (before - after)
            size += abs(change)
            xdot[j] = change
            before = after
    return size < np.inf


@jit
def weigh(z, points, body, p, M, G, low, floor):
    """Write the balance of the platform on k cables whose cells are trusted more or less.

    M (6, k + 2): columns of each cable's wrench [torque / p[7]; force] per unit of tension, of what
    the readings leave unbalanced, and of the platform's weight; G (6, 6): the sum of the cables'
    outer products over the trust in their cells; low (k,): 1 for a reading below p[0], 0 above
    p[1]; floor (k,) [N]: least tension of each cable for the law.
    """
    k = points.shape[1]
    R = np.zeros((3, 3), z.dtype)
    rpy_matrix(z[0], z[1], z[2], R)
    w, radius = body[4], p[7]
    for a in range(2):
        sign = 1.0 - 2.0 * a
        for b in range(3):
            M[a, k + 1] -= sign * R[1 - a, b] * body[1 + b] * body[0] / radius
    M[5, k + 1] -= body[0]
    for a in range(6):
        M[a, k] = -M[a, k + 1]
    for i in range(k):
        arm, _b, (ax, ay, az), _arc = arm_and_chord(i, R, z[3:6], points)
        L = np.sqrt(ax * ax + ay * ay + az * az)
        set_column(i, arm, (ax / L, ay / L, az / L), M)
        for a in range(3):
            M[a, i] /= radius
        # Tension along the chord: at A it is larger by the weight of half the cable's height.
        chord = z[6 + i] + 0.5 * w * az
        half = 0.5 * w * L
        M[0, k] += half * arm[1] / radius
        M[1, k] -= half * arm[0] / radius
        M[5, k] += half
        low[i] = within((p[1] - z[6 + i]) / (p[1] - p[0]))
        floor[i] = p[6] * w * np.sqrt(ax * ax + ay * ay)
        if floor[i].real > p[0]:
            floor[i] = p[0]
        trust = (1.0 - low[i]) * (1.0 - z[6 + k + i])
        if trust.real < p[5]:
            trust = p[5] + 0.0 * trust
        doubt = 1.0 / trust
        for a in range(6):
            M[a, k] += M[a, i] * chord
            doubted = M[a, i] * doubt
            for b in range(a + 1):
                G[a, b] += doubted * M[b, i]
    # With fewer than six cables G is singular: what their wrenches do not span does not count.
    ridge = 1e-9 * (G[0, 0] + G[1, 1] + G[2, 2] + G[3, 3] + G[4, 4] + G[5, 5])
    for a in range(6):
        G[a, a] += ridge


@jit
def within(x):
    """Return x, but 0 below 0 and 1 above 1."""
    if x.real < 0.0:
        return 0.0 * x
    if x.real > 1.0:
        return 1.0 + 0.0 * x
    return x


@jit
def reduce_by(G, M):
    """Replace the columns of M by C^-1 M for G = C C^T, of which products are x^T G^-1 y."""
    n = G.shape[0]
    for j in range(n):
        for m in range(j):
            G[j, j] -= G[j, m] * G[j, m]
        scale = 1.0 / np.sqrt(G[j, j])
        for c in range(M.shape[1]):
            M[j, c] *= scale
        for i in range(j + 1, n):
            for m in range(j):
                G[i, j] -= G[i, m] * G[j, m]
            G[i, j] *= scale
            for c in range(M.shape[1]):
                M[i, c] -= G[i, j] * M[j, c]


@jit
def product(M, i, j):
    """Return the product of columns i and j of M (6, n)."""
    total = M[0, i] * M[0, j]
    for a in range(1, 6):
        total += M[a, i] * M[a, j]
    return total


@jit
def judge_readings(z, points, body, p, out):
    """Write what the balance of the platform says of k readings, as `model.load_cells` explains.

    out (4, k): plausible tension [N], expectation [N], how far the cell is dead (0 to 1), noise
    tolerated of reading less expectation [N].
    """
    k = points.shape[1]
    M = np.zeros((6, k + 2), z.dtype)
    G = np.zeros((6, 6), z.dtype)
    low = np.zeros(k, z.dtype)
    floor = np.zeros(k, z.dtype)
    weigh(z, points, body, p, M, G, low, floor)
    reduce_by(G, M)
    for i in range(k):
        reading, stuck = z[6 + i], z[6 + k + i]
        surplus, load = product(M, i, k), product(M, i, k + 1)
        own = product(M, i, i)
        amplified = 0.0 * reading
        for j in range(k):
            share = product(M, i, j)
            amplified += share * share
        noise = p[3] * np.sqrt(amplified) / own
        if load.real < 0.0:
            load = -load
        tolerated = noise + p[4] * load / own
        expected = reading - surplus / own
        if expected.real > p[2]:
            expected = p[2] + 0.0 * expected
        missing = within(((expected - reading) / tolerated - 1.0) / p[8])
        dead = low[i] * missing
        used = reading + (1.0 - (1.0 - dead) * (1.0 - stuck)) * (expected - reading)
        if used.real < floor[i].real:
            used = floor[i]
        out[0, i], out[1, i], out[2, i], out[3, i] = used, expected, dead, noise


@jit
def judge_readings_jacobian(z, points, body, p, out, jacobian):
    """Write `judge_readings` and its Jacobian (4, k, n) by z (n,), by complex steps."""
    zc = np.zeros(z.shape[0], np.complex128)
    yc = np.zeros(out.shape, np.complex128)
    for j in range(z.shape[0]):
        zc[j] = z[j]
    for j in range(z.shape[0]):
        zc[j] = zc[j] + STEP * 1j
        judge_readings(zc, points, body, p, yc)
        zc[j] = z[j]
        for a in range(out.shape[0]):
            for i in range(out.shape[1]):
                jacobian[a, i, j] = yc[a, i].imag / STEP
                out[a, i] = yc[a, i].real


@jit
def judge_parts(pose, reading, memory, points, body, p, out):
    """Write `judge_readings` for an input in parts."""
    k = points.shape[1]
    z = np.empty(6 + 2 * k)
    z[:6] = pose
    for i in range(k):
        z[6 + i] = reading[i]
        z[6 + k + i] = memory[2 * k + i]
    judge_readings(z, points, body, p, out)


@jit
def plausible_tension(pose, reading, memory, points, body, p, out):
    """Write the plausible tensions (k,) [N] alone into out."""
    k = points.shape[1]
    judged = np.empty((4, k))
    judge_parts(pose, reading, memory, points, body, p, judged)
    for i in range(k):
        out[i] = judged[0, i]


@jit
def remember(pose, reading, memory, points, body, p, after):
    """Write what is remembered of k cells a frame later (3 k,), as `model.load_cells` explains."""
    k = points.shape[1]
    judged = np.empty((4, k))
    judge_parts(pose, reading, memory, points, body, p, judged)
    for i in range(k):
        then, expected, stuck = memory[i], memory[k + i], memory[2 * k + i]
        goal = 0.0
        if abs(reading[i] - then) <= p[9]:
            if stuck > 0.5 or abs(judged[1, i] - expected) > judged[3, i]:
                goal = 1.0
        else:
            then, expected = reading[i], judged[1, i]
        after[i], after[k + i] = then, expected
        after[2 * k + i] = stuck + min(max(goal - stuck, -p[10]), p[10])
