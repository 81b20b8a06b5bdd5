"""Tensions within bounds that balance a wrench, closest to preferred ones, in real numbers.

The quadratic programme min sum q (t - p)^2, A t = w, lower <= t <= upper has as its dual a concave
function of n multipliers y, whose gradient is w - A t(y), t = p + A^T y / q cut off at the bounds:
smooth but for kinks where a tension meets a bound. Newton's steps between the kinks (Qi and Sun,
Math. Programming 58, 1993), each as long as the dual grows along it, end after finitely many. Along
a direction in which the dual grows for ever lies the proof that there are no such tensions.
"""

from __future__ import annotations

import math

import numpy as np

from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.servo import solve_symmetric

ROUNDS = 100
EXACT, ENOUGH = 1e-13, 1e-9
"""Residuals over the largest that tensions within the bounds could leave."""

SOFT = 1e-9
"""What is added to the diagonal where too few tensions are free of their bounds to fix y."""


@jit
def _cut(x, low, high):
    return min(max(x, low), high)


@jit
def _slope(a, u, v, q, low, high, rise):
    """Return the dual's slope at a step `a` along a direction: rise - sum q v t."""
    for i in range(u.shape[0]):
        rise -= q[i] * v[i] * _cut(u[i] + a * v[i], low[i], high[i])
    return rise


@jit
def _longest_rise(u, v, q, low, high, rise):
    """Return how far along v the dual grows, and its slope there if it grows for ever, else 0."""
    a, slope = 0.0, _slope(0.0, u, v, q, low, high, rise)
    while slope > 0.0:
        kink = math.inf
        for i in range(u.shape[0]):
            if v[i] != 0.0:
                for bound in (low[i], high[i]):
                    at = (bound - u[i]) / v[i]
                    if a < at < kink:
                        kink = at
        if kink == math.inf:
            return a, slope
        after = _slope(kink, u, v, q, low, high, rise)
        if after <= 0.0:
            return a + (kink - a) * slope / (slope - after), 0.0
        a, slope = kink, after
    return a, 0.0


@jit
def _scaled(A, w, rows, load):
    """Write matrix and wrench with the matrix's rows scaled to length 1."""
    n, k = A.shape
    for a in range(n):
        size = 0.0
        for i in range(k):
            size += A[a, i] * A[a, i]
        size = math.sqrt(size) if size > 0.0 else 1.0
        load[a] = w[a] / size
        for i in range(k):
            rows[a, i] = A[a, i] / size


@jit
def _newton(rows, q, is_free, r, v):
    """Turn the dual's gradient r (n,) into Newton's step, in place, and write v = A^T r / q."""
    n, k = rows.shape
    G = np.zeros((n, n))
    stiffest = 0.0
    for i in range(k):
        for a in range(n):
            stiffest = max(stiffest, rows[a, i] * rows[a, i] / q[i])
            if is_free[i]:
                for b in range(a + 1):
                    G[a, b] += rows[a, i] * rows[b, i] / q[i]
    for a in range(n):
        G[a, a] += SOFT * stiffest if stiffest > 0.0 else 1.0
    if not solve_symmetric(G, r):
        return False
    for i in range(k):
        v[i] = 0.0
        for a in range(n):
            v[i] += rows[a, i] * r[a] / q[i]
    return True


@jit
def within_bounds(A, w, low, high, wish, q, t):
    """Write t (k,) of least sum q (t - wish)^2 with A t = w, low <= t <= high; return a status.

    A (n, k), w (n,), the others (k,), q > 0; all finite. 0: found; 1: there are none; 2: neither
    was proved.
    """
    n, k = A.shape
    rows, load, r = np.zeros((n, k)), np.zeros(n), np.zeros(n)
    _scaled(A, w, rows, load)
    u, v, is_free = np.zeros(k), np.zeros(k), np.ones(k, np.bool_)
    largest, residual = 0.0, math.inf
    for a in range(n):
        largest = max(largest, abs(load[a]))
    for i in range(k):
        u[i] = wish[i]
        largest = max(largest, abs(low[i]), abs(high[i]))
    for turn in range(ROUNDS):
        residual, rise = 0.0, 0.0
        for i in range(k):
            # At first as if there were no bounds.
            is_free[i] = turn == 0 or low[i] < u[i] < high[i]
            t[i] = u[i] if is_free[i] else _cut(u[i], low[i], high[i])
        for a in range(n):
            r[a] = load[a]
            for i in range(k):
                r[a] -= rows[a, i] * t[i]
            residual = max(residual, abs(r[a]))
        if turn > 0 and residual <= EXACT * largest:
            return 0
        if not _newton(rows, q, is_free, r, v):
            return 2
        for a in range(n):
            rise += r[a] * load[a]
        step = 1.0
        if turn > 0:
            step, slope = _longest_rise(u, v, q, low, high, rise)
            if slope > ENOUGH * abs(rise):
                return 1
        for i in range(k):
            u[i] += step * v[i]
    return 0 if residual <= ENOUGH * largest else 2
