"""The exact elastic catenary (Irvine) of each cable: forces, tensions, tangents and their Jacobian.

A cable of total unstrained `length` runs from its drum to the drawing point A (geometric length
`drum_run`, tension T_A, weight neglected) and hangs from A to the attachment point B (unstrained
length l0). It obeys Hooke's law with the secant stiffness EA(T_A), one value per cable:

    EA(T) = asymptote - softening / (T + offset)        l0 = length - drum_run / (1 + T_A / EA(T_A))
    Bx = H l0/EA + (H/w) D          D = asinh(V_B/H) - asinh(V_A/H),   V_A = V_B - w l0
    Bz = l0 (V_A + V_B) (1/(2 EA) + 1/(T_A + T_B))                     T = hypot(H, V)

(Irvine, Cable Structures, 1981). (H, V) is the tension vector directed from A to B in the vertical
plane of the cable, x horizontal from A to B, z up. Every sum below is written so that nothing
cancels for a tight cable: with S = T_A + T_B, y = w l0/S and atanh y = y + y^3 b(y^2) the geometric
part G of the flexibility d(Bx,Bz)/d(H,V_B) = (l0/EA) I + G has

    trace G = D/w = (2 l0/S)(1 + y^2 b)      det G = H^2/(T_A T_B) (2 l0/S)^2 y^2 b / (1 - y^2)

Structural damping. A cable that gains chord by losing sag does not stretch. How fast it stretches
follows from its tension at rest, T in the middle of the span, T^2 = H^2 + ((V_A + V_B)/2)^2, as
Hooke's law has it for the whole length l, run included:

    s = e_B . v_B + e_l dl/dt,      e = (l / EA_t) dT/d(p_WB, l),      EA_t = dT/d(T/EA(T)) at T_A
    T_d = (EA t_d / l) s,           force on the platform - e_B T_d,   T_A - e_l T_d

(Kelvin and Voigt's material: EA t_d per unit of strain rate.) Force and rate share the gradient e,
so the power taken out is T_d s >= 0. A straight cable has e_B along itself and e_l = -(1 + T/EA);
sag makes e smaller, by 1/(1 + lambda^2/12) with Irvine's lambda^2, and a slack cable damps hardly
anything. T_d is cut back, keeping its sign, where it would turn the tension at A or that along the
tangent at B negative.

Arguments, float64 in SI units:
    Bx, Bz: B seen from A [m]; Bx > 0 horizontal, Bz up.
    l0: unstrained length of the span A-B [m].
    H: horizontal tension [N], > 0.
    w: weight per unstrained metre [N/m], >= 0.
    EA: constant axial stiffness [N]. stiffness: (3,) [asymptote [N], softening [N2], offset [N]],
        the law of EA(T), T [N]; softening = 0 for a constant EA.
    p_WA, p_WB: (k, 3) drawing and attachment points [m], v_WB: (k, 3) velocity of the latter [m/s],
        all in W.
    length, length_rate: (k,) total unstrained length [m], run included, and its rate [m/s].
    drum_run: (k,) geometric length of the run from the drum to A [m].
    damping_time: [s], t_d below.
    clamped, linear: Bx as clamped and the linearisation, from `force`.
    out: (k, 14), jacobian: (k, 14, 8), C-contiguous, written.

A status is 0, or 1 + the index of the cable that failed: a number that is not finite or out of
range, no span left beside the run (length <= drum_run), B at A.
"""

from __future__ import annotations

import math

from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.geometry import chord, vector

MAX_ITERATIONS = 40
# Vertical cables: the plane of the cable is undefined at Bx = 0, so Bx is kept above this times L.
MIN_SLOPE = 1e-6
# An exactly vertical cable is taken to lean this little (times L) towards +x.
MIN_LEAN = 1e-12
MIN_WEIGHT = 1e-9  # [N/m]
# Outside these the squares and products below would leave the range of float64.
MIN_LENGTH, MAX_LENGTH = 1e-9, 1e9  # [m]
MIN_STIFFNESS, MAX_STIFFNESS = 1e-3, 1e15  # [N]
MAX_WEIGHT = 1e9  # [N/m]
MAX_SPEED, MAX_DAMPING_TIME = 1e9, 1e9  # [m/s], [s]

AFRESH = (0.0, 0.0, 0.0)


@jit
def secant_stiffness(T, asymptote, softening, offset):
    """Return (EA(T), dEA/dT)."""
    if softening == 0.0:
        return asymptote, 0.0
    r = softening / (T + offset)
    return asymptote - r, r / (T + offset)


@jit
def _strain(T, asymptote, softening, offset):
    """Return the first and second derivative [1/N, 1/N2] of the strain T/EA(T)."""
    EA, dEA = secant_stiffness(T, asymptote, softening, offset)
    soft = 1.0 / EA
    bend = dEA * soft
    if softening == 0.0:
        return soft, 0.0
    return soft * (1.0 - T * bend), 2.0 * bend * soft * (T / (T + offset) + T * bend - 1.0)


@jit
def _series(t):
    """b(t) = (atanh y - y)/y^3 with t = y^2 < 0.81."""
    if t < 1e-4:
        return 1 / 3 + t * (1 / 5 + t * (1 / 7 + t / 9))
    if t < 1e-2:
        tail = 1 / 9 + t * (1 / 11 + t * (1 / 13 + t * (1 / 15 + t / 17)))
        return 1 / 3 + t * (1 / 5 + t * (1 / 7 + t * tail))
    y = math.sqrt(t)
    return (math.atanh(y) - y) / (t * y)


@jit
def _log_sum(V, T, H):
    """asinh(V/H) + ln H without cancellation for V < 0."""
    if V >= 0.0:
        return math.log(V + T)
    return 2.0 * math.log(H) - math.log(T - V)


@jit
def _span(H, V_B, l0, w):
    """Return (T_A, T_B, X, Z, Gxx, Gxz, Gzz, det G): the inextensible part of the span and of its
    flexibility. X, Z [m] are what the cable would span if it did not stretch.
    """
    V_A = V_B - w * l0
    H2 = H * H
    T_A = math.sqrt(H2 + V_A * V_A)
    T_B = math.sqrt(H2 + V_B * V_B)
    S = T_A + T_B
    P = T_A * T_B
    f = l0 / S
    Z = f * (V_A + V_B)
    y = w * f
    Gxz = -H * Z / P
    if y < 0.5:
        t = y * y
        tb = t * _series(t)
        u = 1.0 / (1.0 - t)
        trace = 2.0 * f * (1.0 + tb)
        H2P = H2 / P
        Gzz = 2.0 * f * u * H2P
        # 1 - H^2/P, which is small for a nearly horizontal cable
        rest = (H2 * (V_A * V_A + V_B * V_B) + V_A * V_A * V_B * V_B) / (P * (P + H2))
        Gxx = 2.0 * f * (tb + u * (rest - t))
        return T_A, T_B, H * trace, Z, Gxx, Gxz, Gzz, H2P * 4.0 * f * f * tb * u
    D = _log_sum(V_B, T_B, H) - _log_sum(V_A, T_A, H)
    if V_A * V_B > 0.0:
        # H^2 sinh D and H^2 (cosh D - 1) of two ends of the same slope
        sinh = H2 * abs(V_B * V_B - V_A * V_A) / (abs(V_B) * T_A + abs(V_A) * T_B)
        C = P + V_A * V_B
        cosh1 = H2 * (V_A * V_A + V_B * V_B + H2 - C) / C
    else:
        sinh = V_B * T_A - V_A * T_B
        cosh1 = P - V_A * V_B - H2
    slope = sinh / P
    det = max(D * slope - 2.0 * cosh1 / P, 0.0) / (w * w)
    return T_A, T_B, H * D / w, Z, (D - slope) / w, Gxz, slope / w, det


@jit
def _linearise(H, V_B, l0, length, run, w, asymptote, softening, offset):
    """Linearise a cable about (H, V_B, l0): d(x,z) = A d(H,V_B) + m dr, where the closure of the
    run asks for l0 + r. With k, mu: dl0 = mu dr + k (H dH + V_A dV_B).

    Return (x, z, r, Kxx, Kxz, Kzx, Kzz, mx, mz, mu, k, T_A, T_B, EA, dEA) with K = A^-1 (symmetric
    for constant EA).
    """
    T_A, T_B, X, Z, Gxx, Gxz, Gzz, det = _span(H, V_B, l0, w)
    EA, dEA = secant_stiffness(T_A, asymptote, softening, offset)
    V_A = V_B - w * l0
    soft = 1.0 / EA
    flat = 1.0 / T_A
    e = l0 * soft
    Vm = 0.5 * (V_A + V_B)
    x = X + H * e
    z = Z + Vm * e
    det += e * (e + Gxx + Gzz)
    Jxx = Gxx + e
    Jzz = Gzz + e
    g = soft + flat
    gx = g * H
    gz = g * V_A
    if run == 0.0 and softening == 0.0:
        i = 1.0 / det
        Kxz = -Gxz * i
        return (
            x, z, length - l0, Jzz * i, Kxz, Kxz, Jxx * i,
            gx, gz, 1.0, 0.0, T_A, T_B, EA, dEA,
        )  # fmt: skip
    # Unstrained length in the run, as it follows from T_A.
    unstretch = 1.0 / (1.0 + T_A * soft)
    part = run * unstretch
    kappa = part * unstretch * (EA - T_A * dEA) * soft * soft
    slope = w * V_A * flat
    mu = 1.0 / (1.0 + kappa * slope)
    k = kappa * mu * flat
    # The stiffness follows T_A too: dT_A = mu ((H dH + V_A dV_B)/T_A - slope dr)
    d = -e * dEA * soft * mu
    bx = gx * k + d * H * flat
    bz = gz * k + d * Vm * flat
    mx = gx * mu - d * slope * H
    mz = gz * mu - d * slope * Vm
    i = 1.0 / (det + Jzz * bx * H - Gxz * (bz * H + bx * V_A) + Jxx * bz * V_A)
    return (
        x, z, length - part - l0,
        (Jzz + bz * V_A) * i, -(Gxz + bx * V_A) * i, -(Gxz + bz * H) * i, (Jxx + bx * H) * i,
        mx, mz, mu, k, T_A, T_B, EA, dEA,
    )  # fmt: skip


@jit
def _cubic(p, q):
    """Positive root of T^3 + p T^2 = q (q > 0), by Newton's method from above."""
    if p < 0.0:
        T = q / (p * p)
        if T + p > 0.0:
            T = min(T, q ** (1 / 3))
        T -= p
    else:
        T = q ** (1 / 3)
        if p > T:
            T = math.sqrt(q / p)
    for _ in range(30):
        step = (T * T * (T + p) - q) / (T * (3.0 * T + 2.0 * p))
        T -= step
        if step < 1e-4 * T:
            break
    return T


@jit
def _deep_sag(ratio):
    """Solve sinh(xi)/xi = ratio > 1 roughly, in logarithmic form."""
    if ratio < 3.0:
        xi = math.sqrt(6.0 * (ratio - 1.0))
    else:
        xi = math.log(2.0 * ratio)
        xi += math.log(xi)
    if xi < 0.1:
        return xi
    target = math.log(2.0 * ratio)
    for _ in range(4):
        q = math.exp(-2.0 * xi)
        value = xi + math.log((1.0 - q) / xi) - target
        xi -= value / ((1.0 + q) / (1.0 - q) - 1.0 / xi)
    return xi


@jit
def _guess(Bx, Bz, L, length, run, w, asymptote, softening, offset):
    """First estimate (H, V_B, l0): parabola with stretch, run and span in series; or a deep sag."""
    EA = asymptote
    weight = w * Bx
    sag = L * weight * weight / (24.0 * length)
    slack = (length - L - run) / length
    half = -0.5 * w * Bz  # T_A above the mean tension
    lift = -half * run / length
    if softening != 0.0:
        T = 0.0
        # The tension that stretches a weightless cable this far under the law: a quadratic.
        if slack < 0.0:
            T = -0.5 * (slack * asymptote + offset)
            T += math.sqrt(T * T - slack * (asymptote * offset - softening))
        EA, _dEA = secant_stiffness(max(T + half, 0.0), asymptote, softening, offset)
        T = _cubic(EA * slack - lift, EA * sag)
        EA, _dEA = secant_stiffness(max(T + half, 0.0), asymptote, softening, offset)
    T = _cubic(EA * slack - lift, EA * sag)
    l0 = length
    if run > 0.0:
        l0 = length - run / (1.0 + max(T + half, 0.0) / EA)
    if w * L <= 0.3 * T:
        # With T the mean of T_A and T_B the equations of the span are explicit.
        y = 0.5 * w * l0 / T
        H = Bx / (l0 * (1.0 / EA + (1.0 + y * y / 3.0) / T))
        return H, Bz / (l0 * (1.0 / EA + 1.0 / T)) + 0.5 * w * l0, l0
    H = T * Bx / L
    V_B = T * Bz / L + 0.5 * w * l0
    stretched = l0 * (1.0 + min(T, w * L) / EA)
    across = (stretched - Bz) * (stretched + Bz)
    if across > Bx * Bx * (1.0 + 1e-12):
        xi = _deep_sag(math.sqrt(across) / Bx)
        H = weight / (2.0 * xi)
        V_B = 0.5 * w * (stretched + Bz / math.tanh(xi))
    return H, V_B, l0


@jit
def _newton(Bx, Bz, L, length, run, w, asymptote, softening, offset, H, V_B, l0):
    """Newton's method from a good guess. Return (H, V_B, l0, iterations, near, linearisation);
    iterations > 40: failed. The linearisation (Kxx, Kxz, Kzx, Kzz, mx, mz, mu, k) is of the last
    round; near: that was at the solution, to 1e-11.

    It ends with a step below 1e-8 of the smallest tension: what is left is the square of that.
    Failing this (near-vertical cables determine a tiny H to about 1e-8 only), when the residual is
    round-off.
    """
    linear = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for iteration in range(1, MAX_ITERATIONS + 1):
        x, z, r, Kxx, Kxz, Kzx, Kzz, mx, mz, mu, k, T_A, T_B, _EA, _dEA = _linearise(
            H, V_B, l0, length, run, w, asymptote, softening, offset
        )
        rx = Bx - x
        rz = Bz - z
        ex = rx - mx * r
        ez = rz - mz * r
        dH = Kxx * ex + Kxz * ez
        dV = Kzx * ex + Kzz * ez
        dl = mu * r + k * (H * dH + (V_B - w * l0) * dV)
        linear = (Kxx, Kxz, Kzx, Kzz, mx, mz, mu, k)
        least = 1e-8 * min(T_A, T_B)
        if abs(dH) <= 1e-8 * H and abs(dV) <= least and abs(dl) <= 1e-10 * l0:
            near = abs(dH) <= 1e-11 * H and abs(dV) <= 1e-3 * least
            return H + dH, V_B + dV, l0 + dl, iteration, near, linear
        if iteration > 3 and abs(rz) <= 1e-15 * L and abs(r) <= 1e-15 * length:
            noise = abs(x) + Bx
            if 2.0 * w * l0 > T_A + T_B:
                noise += (abs(V_B) + w * l0) * (H / w) * (1.0 / T_A + 1.0 / T_B)
            if abs(rx) <= 4e-16 * noise:
                return H, V_B, l0, iteration, True, linear
        step = 1.0
        if dH < -0.9 * H:
            step = -0.9 * H / dH
        H += step * dH
        V_B += step * dV
        l0 = max(l0 + step * dl, 0.5 * (length - run))
        if not (H < 1e300 and abs(V_B) < 1e300):
            break
    return H, V_B, l0, MAX_ITERATIONS + 1, False, linear


@jit
def _potential(H, V_B, l0, w, EA, X, S):
    """Phi(H, V_B) = integral of T + T^2/(2 EA) over the span; its gradient is (x, z)."""
    V_A = V_B - w * l0
    V = V_A + V_B
    squares = H * H + (V_A * V_A + V_A * V_B + V_B * V_B) / 3.0
    return 0.25 * l0 * (V * V / S + S) + 0.5 * H * X + 0.5 * l0 / EA * squares


@jit
def _minimise(Bx, Bz, L, l0, w, EA, H, V_B):
    """Minimise the convex Phi - H Bx - V_B Bz, with backtracking, for given l0 and EA.

    Slower than `_newton`, for the cables that defeat it. Return (H, V_B, T_A, iterations).
    """
    T_A = H
    for iteration in range(1, 5 * MAX_ITERATIONS + 1):
        x, z, _r, Kxx, Kxz, _Kzx, Kzz, _mx, _mz, _mu, _k, T_A, T_B, _EA, _dEA = _linearise(
            H, V_B, l0, l0, 0.0, w, EA, 0.0, 0.0
        )
        rx = Bx - x
        rz = Bz - z
        dH = Kxx * rx + Kxz * rz
        dV = Kxz * rx + Kzz * rz
        noise = (abs(V_B) + w * l0) * (H / w) * (1.0 / T_A + 1.0 / T_B)
        floor = abs(rx) <= 4e-16 * (abs(x) + Bx + noise) and abs(rz) <= 1e-15 * L
        if floor or (abs(dH) <= 1e-12 * H and abs(dV) <= 1e-12 * (T_A + T_B)):
            return H, V_B, T_A, iteration
        step = 1.0
        if dH < -0.9 * H:
            step = -0.9 * H / dH
        X = x - H * l0 / EA
        start = _potential(H, V_B, l0, w, EA, X, T_A + T_B) - H * Bx - V_B * Bz
        slope = -(rx * dH + rz * dV)
        for _ in range(40):
            H1 = H + step * dH
            V1 = V_B + step * dV
            TA1, TB1, X1, _Z, _Gxx, _Gxz, _Gzz, _det = _span(H1, V1, l0, w)
            value = _potential(H1, V1, l0, w, EA, X1, TA1 + TB1) - H1 * Bx - V1 * Bz
            if value <= start + 1e-4 * step * slope + 1e-13 * (T_A + T_B) * L:
                break
            step *= 0.5
        H += step * dH
        V_B += step * dV
    return H, V_B, T_A, 5 * MAX_ITERATIONS + 1


@jit
def _plain_tension(T, Bx, Bz, L, length, run, w, asymptote, softening, offset, H, V_B):
    """Solve the span with the run and the stiffness taken at the tension T.

    Return (T_A - T, H, V_B, l0, failed).
    """
    EA, _dEA = secant_stiffness(T, asymptote, softening, offset)
    l0 = length - run / (1.0 + T / EA)
    H, V_B, T_A, iterations = _minimise(Bx, Bz, L, l0, w, EA, H, V_B)
    return T_A - T, H, V_B, l0, iterations > 5 * MAX_ITERATIONS


@jit
def _bracket(Bx, Bz, L, length, run, w, asymptote, softening, offset):
    """Find T_A between bounds (Illinois rule) around the plain solver: slow, a last resort.

    Return (H, V_B, l0, iterations, failed).
    """
    H, V_B, l0 = _guess(Bx, Bz, L, length, run, w, asymptote, softening, offset)
    low = 0.0
    at_low, H, V_B, l0, failed = _plain_tension(
        low, Bx, Bz, L, length, run, w, asymptote, softening, offset, H, V_B
    )
    if failed:
        return H, V_B, l0, 1, True
    if run == 0.0 and softening == 0.0:
        return H, V_B, l0, 1, False
    high = at_low
    at_high = at_low
    for _ in range(60):
        at_high, H, V_B, l0, failed = _plain_tension(
            high, Bx, Bz, L, length, run, w, asymptote, softening, offset, H, V_B
        )
        if failed or at_high <= 0.0:
            break
        low, at_low = high, at_high
        high *= 2.0
    side = 0
    value = at_high
    for iteration in range(1, 201):
        if failed or abs(value) <= 1e-14 * high or high - low <= 1e-15 * high:
            return H, V_B, l0, iteration, failed
        T = (at_low * high - at_high * low) / (at_low - at_high)
        value, H, V_B, l0, failed = _plain_tension(
            T, Bx, Bz, L, length, run, w, asymptote, softening, offset, H, V_B
        )
        if value > 0.0:
            low, at_low = T, value
            at_high *= 0.5 if side == 1 else 1.0
            side = 1
        else:
            high, at_high = T, value
            at_low *= 0.5 if side == -1 else 1.0
            side = -1
    return H, V_B, l0, 201, True


@jit
def _admissible(Bx, L, length, run, w, asymptote, softening, offset):
    """Whether the numbers describe a cable; false for NaN and for no span left beside the run."""
    if not (MIN_LENGTH <= L <= MAX_LENGTH and Bx >= 0.0):
        return False
    if not (run >= 0.0 and length - run >= MIN_LENGTH and length <= MAX_LENGTH):
        return False
    if not (0.0 <= w <= MAX_WEIGHT and MIN_STIFFNESS <= asymptote <= MAX_STIFFNESS):
        return False
    if softening == 0.0:
        return True
    if not (softening > 0.0 and offset > 0.0 and offset <= MAX_STIFFNESS):
        return False
    return asymptote - softening / offset >= MIN_STIFFNESS


@jit
def _solve(Bx, Bz, L, length, run, w, asymptote, softening, offset, start):
    """Solve an admissible cable. Return (H, V_B, l0, iterations, failed, near, linearisation), the
    last two as `_newton` does; start: (H, V_B, l0) nearby, or a guess is made where H is 0.
    """
    H, V_B, l0 = start
    if H == 0.0:
        H, V_B, l0 = _guess(Bx, Bz, L, length, run, w, asymptote, softening, offset)
    H, V_B, l0, iterations, near, linear = _newton(
        Bx, Bz, L, length, run, w, asymptote, softening, offset, H, V_B, l0
    )
    if iterations <= MAX_ITERATIONS:
        return H, V_B, l0, iterations, False, near, linear
    H, V_B, l0, more, failed = _bracket(Bx, Bz, L, length, run, w, asymptote, softening, offset)
    return H, V_B, l0, iterations + more, failed, False, linear


@jit
def solve_catenary(Bx, Bz, l0, w, EA):
    """Solve a span without run for its end force. Return (H, V_B, iterations, status)."""
    if not (math.isfinite(Bx) and math.isfinite(Bz)):
        return 0.0, 0.0, 0, 1
    L = math.sqrt(Bx * Bx + Bz * Bz)
    if not (_admissible(Bx, L, l0, 0.0, w, EA, 0.0, 0.0) and Bx > 0.0):
        return 0.0, 0.0, 0, 1
    H, V_B, _l0, iterations, failed, _near, _linear = _solve(
        max(Bx, 1e-10 * L), Bz, L, l0, 0.0, max(w, MIN_WEIGHT), EA, 0.0, 0.0, AFRESH
    )
    return H, V_B, iterations, 1 if failed else 0


@jit
def _leaning_chord(i, p_WA, p_WB):
    """Return (dx, dy, Bz, Bx, L) of cable i; a vertical cable leans a little towards +x."""
    dx, dy, Bz = chord(i, p_WA, vector(p_WB[i]))
    Bx = math.sqrt(dx * dx + dy * dy)
    lean = MIN_LEAN * abs(Bz)
    if Bx < lean:
        dx = lean
        dy = 0.0
        Bx = lean
    return dx, dy, Bz, Bx, math.sqrt(Bx * Bx + Bz * Bz)


@jit
def sketch(i, p_WA, p_WB, length, drum_run, w, stiffness, start):
    """Return (t_A, kappa, start): nearly the unit tangent [-] and the curvature [1/m] of cable i
    at A, and (H, V_B, l0), a step of Newton's from `start`; zeros for what is no cable.
    """
    dx, dy, Bz, Bx, L = _leaning_chord(i, p_WA, p_WB)
    l, run = float(length[i]), float(drum_run[i])
    asymptote, softening, offset = float(stiffness[0]), float(stiffness[1]), float(stiffness[2])
    if not _admissible(Bx, L, l, run, w, asymptote, softening, offset):
        return (0.0, 0.0, 0.0), 0.0, AFRESH
    w, level = max(w, MIN_WEIGHT), max(Bx, MIN_SLOPE * L)
    H, V_B, l0 = start
    if H == 0.0:
        H, V_B, l0 = _guess(level, Bz, L, l, run, w, asymptote, softening, offset)
    x, z, r, Kxx, Kxz, Kzx, Kzz, mx, mz, mu, k, _T_A, _T_B, _EA, _dEA = _linearise(
        H, V_B, l0, l, run, w, asymptote, softening, offset
    )
    ex, ez = level - x - mx * r, Bz - z - mz * r
    dH, dV = Kxx * ex + Kxz * ez, Kzx * ex + Kzz * ez
    if abs(dH) < 0.1 * H and abs(dV) < 0.1 * H:
        l0 += mu * r + k * (H * dH + (V_B - w * l0) * dV)
        H, V_B = H + dH, V_B + dV
    V_A = V_B - w * l0
    T_A = math.sqrt(H * H + V_A * V_A)
    share = H / (level * T_A)
    return (share * dx, share * dy, V_A / T_A), w * H / (T_A * T_A), (H, V_B, l0)


@jit
def _in_plane(H, V_A, linear):
    """Return d(H, V_B, l0)/d(Bx), then /d(Bz), /d(length), from a linearisation at the solution."""
    Kxx, Kxz, Kzx, Kzz, mx, mz, mu, k = linear
    dH = -(Kxx * mx + Kxz * mz)
    dV = -(Kzx * mx + Kzz * mz)
    return (
        (Kxx, Kzx, k * (H * Kxx + V_A * Kzx)),
        (Kxz, Kzz, k * (H * Kxz + V_A * Kzz)),
        (dH, dV, mu + k * (H * dH + V_A * dV)),
    )


@jit
def _stretch(H, V_m, w, moves, flexibility):
    """Return (e_x, e_z, e_l): how much a cable stretches with Bx, Bz [-] and its length [-].

    moves: from `_in_plane`; flexibility: l / EA_t [m/N].
    """
    T = math.sqrt(H * H + V_m * V_m)
    a = flexibility * H / T
    b = flexibility * V_m / T
    x, z, l = moves
    return (
        a * x[0] + b * (x[1] - 0.5 * w * x[2]),
        a * z[0] + b * (z[1] - 0.5 * w * z[2]),
        a * l[0] + b * (l[1] - 0.5 * w * l[2]),
    )


@jit
def _damping(viscosity, speed, e_l, e_t, T_A, T_B):
    """Return (T_d, cut): the damping tension viscosity * speed, cut back where T_A - e_l T_d or
    T_B + e_t T_d would be negative; cut is 1 at A, 2 at B, 0 if nothing was cut.
    """
    T_d = viscosity * speed
    cut = 0
    if e_l * T_d > T_A:
        T_d = T_A / e_l
        cut = 1
    if e_t * T_d < -T_B:
        T_d = -T_B / e_t
        cut = 2
    return T_d, cut


@jit
def _steepest(L, Bz):
    """Return the height of the steepest chord that has a plane, of length L, as Bz up or down."""
    return math.copysign(1.0, Bz) * L * math.sqrt(1.0 - MIN_SLOPE * MIN_SLOPE)


@jit
def force(
    i, p_WA, p_WB, v_WB, length, length_rate, w, stiffness, drum_run, damping_time, differs, start,
    out,
):  # fmt: skip
    """Write row i of `out`. Return (failed, H, V_B, Bx as clamped, linearisation) for
    `differentiate`; the linearisation is at the solution if the cable is damped or `differs`;
    start: as in `_solve`.
    """
    dx, dy, Bz, Bx, L = _leaning_chord(i, p_WA, p_WB)
    l = float(length[i])
    run = float(drum_run[i])
    rate = float(length_rate[i])
    asymptote = float(stiffness[0])
    softening = float(stiffness[1])
    offset = float(stiffness[2])
    vx = float(v_WB[i, 0])
    vy = float(v_WB[i, 1])
    vz = float(v_WB[i, 2])
    speed = abs(vx) + abs(vy) + abs(vz) + abs(rate)
    none = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    in_range = speed <= MAX_SPEED and 0.0 <= damping_time <= MAX_DAMPING_TIME
    if not (in_range and _admissible(Bx, L, l, run, w, asymptote, softening, offset)):
        return True, 0.0, 0.0, Bx, none
    w = max(w, MIN_WEIGHT)
    clamped = max(Bx, MIN_SLOPE * L)
    if clamped > Bx:
        Bz = _steepest(L, Bz)
    H, V_B, l0, _iterations, failed, near, linear = _solve(
        clamped, Bz, L, l, run, w, asymptote, softening, offset, start
    )
    # H/Bx stays finite for a vertical cable: with it the horizontal force needs no direction.
    q = H / clamped
    hx = q * dx
    hy = q * dy
    h = q * Bx
    V_A = V_B - w * l0
    T_A = math.sqrt(h * h + V_A * V_A)
    T_B = math.sqrt(h * h + V_B * V_B)
    EA, _dEA = secant_stiffness(T_A, asymptote, softening, offset)
    T_d = 0.0
    e_q = 0.0
    e_z = 0.0
    e_l = 0.0
    e_t = 0.0
    cut = 0
    damped = damping_time > 0.0 and speed > 0.0
    if (differs or damped) and not near:
        _x, _z, _r, Kxx, Kxz, Kzx, Kzz, mx, mz, mu, k, _TA, _TB, _EA, _d = _linearise(
            H, V_B, l0, l, run, w, asymptote, softening, offset
        )
        linear = (Kxx, Kxz, Kzx, Kzz, mx, mz, mu, k)
    if damped:
        flexibility, _bend = _strain(T_A, asymptote, softening, offset)
        moves = _in_plane(H, V_A, linear)
        e_x, e_z, e_l = _stretch(H, 0.5 * (V_A + V_B), w, moves, l * flexibility)
        e_q = e_x / clamped
        e_t = (e_q * h * Bx + e_z * V_B) / T_B
        stretching = e_q * (dx * vx + dy * vy) + e_z * vz + e_l * rate
        T_d, cut = _damping(EA * damping_time / l, stretching, e_l, e_t, T_A, T_B)
    out[i, 0] = -(hx + T_d * e_q * dx)
    out[i, 1] = -(hy + T_d * e_q * dy)
    out[i, 2] = -(V_B + T_d * e_z)
    out[i, 3] = 0.0 if cut == 1 else T_A - e_l * T_d
    out[i, 4] = 0.0 if cut == 2 else T_B + e_t * T_d
    out[i, 5] = hx / T_A
    out[i, 6] = hy / T_A
    out[i, 7] = V_A / T_A
    out[i, 8] = hx / T_B
    out[i, 9] = hy / T_B
    out[i, 10] = V_B / T_B
    # V_B Bx - H Bz with Bx, Bz replaced by the equations of the span: the chord cancels.
    f = l0 / (T_A + T_B)
    y = w * f
    bend = w * l0 * (0.5 * l0 / EA + f)
    if y < 0.9:
        bend += 2.0 * V_B * f * y * y * _series(y * y)
        cross = h * bend
    else:
        cross = V_B * Bx - h * Bz
    out[i, 11] = math.atan2(cross, h * Bx + V_B * Bz)
    out[i, 12] = h
    out[i, 13] = l0
    return failed or not math.isfinite(T_d + V_B + h + T_A), H, V_B, clamped, linear


@jit
def cable_forces(p_WA, p_WB, v_WB, length, length_rate, w, stiffness, drum_run, damping_time, out):
    """Write the state of each cable into `out` (k, 14). Return 0, or 1 + the index that failed.

    Columns: 0:3 force of the cable on the platform at B, in W [N]; 3 T_A, 4 T_B with damping [N],
    the latter along the tangent; 5:8, 8:11 unit tangents at A and B at rest, directed from A to B,
    in W; 11 angle at B from the chord to the cable [rad]; 12 H without damping [N]; 13 unstrained
    length of the span [m].
    """
    for i in range(len(length)):
        failed, _H, _V_B, _Bx, _linear = force(
            i, p_WA, p_WB, v_WB, length, length_rate, w, stiffness, drum_run, damping_time, False,
            AFRESH, out,
        )  # fmt: skip
        if failed:
            return i + 1
    return 0


@jit
def _curvature(H, V_B, l0, run, w, asymptote, softening, offset, moves, g):
    """Return d2T/d(Bx, Bz, length)2 of the tension T in the middle of the span, as three rows.

    g = dT/d(Bx, Bz, length). With the span's equations E(u, q) = 0 of u = (H, V_B, l0), which are
    linear in q = (Bx, Bz, length), d2T/dq2 = M^T (d2T/du2 - sum g_i d2E_i/du2) M with M = du/dq.
    """
    V_A = V_B - w * l0
    V_m = V_B - 0.5 * w * l0
    T_A = math.sqrt(H * H + V_A * V_A)
    T_B = math.sqrt(H * H + V_B * V_B)
    T_m = math.sqrt(H * H + V_m * V_m)
    sA, sB, cA, cB = V_A / T_A, V_B / T_B, H / T_A, H / T_B
    f = l0 / (T_A + T_B)
    Gzz = 2.0 * f * cA * cB / (1.0 - w * w * f * f) if w * f < 0.5 else (sB - sA) / w
    Gxz = -f * (V_A + V_B) * cA / T_B
    EA, dEA = secant_stiffness(T_A, asymptote, softening, offset)
    # The stretch of the span per newton is l0 c(T_A), what is left in the run R p(T_A).
    c = 1.0 / EA
    c1 = -dEA * c * c
    c2 = 0.0
    if softening != 0.0:
        c2 = 2.0 * dEA * c * c * (dEA * c + 1.0 / (T_A + offset))
    strain1, strain2 = _strain(T_A, asymptote, softening, offset)
    p = 1.0 / (1.0 + T_A * c)
    p1 = -strain1 * p * p
    p2 = (2.0 * strain1 * strain1 * p - strain2) * p * p
    # By H, V_B, l0 each: changes of H; of V at A and in the middle; of T there; of l0 c; of l0.
    by_H = (1.0, 0.0, 0.0, cA, H / T_m, l0 * c1 * cA, 0.0)
    by_V = (0.0, 1.0, 1.0, sA, V_m / T_m, l0 * c1 * sA, 0.0)
    by_l = (0.0, -w, -0.5 * w, -w * sA, -0.5 * w * V_m / T_m, c - l0 * c1 * w * sA, 1.0)
    # Second derivatives of the inextensible span (X, Z).
    sines = sB * sB + sB * sA + sA * sA
    cosines = cB * cB + cB * cA + cA * cA
    XV, ZV = Gxz * (1.0 - cosines) / H, Gzz * (sines - 1.0) / H
    slope = sA * cA / T_A
    rates = (H, V_m, T_A, T_m, l0, c1, c2, run * p1, run * p2, g)
    HH = _pair(by_H, by_H, -Gzz * sines / H, XV, rates)
    HV = _pair(by_H, by_V, XV, ZV, rates)
    VV = _pair(by_V, by_V, ZV, Gxz * cosines / H, rates)
    Hl = _pair(by_H, by_l, sA * sA / T_A, -slope, rates)
    Vl = _pair(by_V, by_l, -slope, cA * cA / T_A, rates)
    ll = _pair(by_l, by_l, w * slope, -w * cA * cA / T_A, rates)
    S = ((HH, HV, Hl), (HV, VV, Vl), (Hl, Vl, ll))
    x, z, l = moves
    Sx, Sz, Sl = _times(S, x), _times(S, z), _times(S, l)
    xz, xl, zl = _dot(x, Sz), _dot(x, Sl), _dot(z, Sl)
    return (_dot(x, Sx), xz, xl), (xz, _dot(z, Sz), zl), (xl, zl, _dot(l, Sl))


@jit
def _pair(a, b, X, Z, rates):
    """Return the second derivative, by a and b as in `_curvature`, of T in the middle minus
    g . (x, z, length); X, Z are those of the inextensible span.
    """
    H, V_m, T_A, T_m, l0, c1, c2, p1, p2, g = rates
    T_A2 = (a[0] * b[0] + a[1] * b[1] - a[3] * b[3]) / T_A
    T_m2 = (a[0] * b[0] + a[2] * b[2] - a[4] * b[4]) / T_m
    e = l0 * (c2 * a[3] * b[3] + c1 * T_A2) + c1 * (a[3] * b[6] + b[3] * a[6])
    x = X + a[0] * b[5] + b[0] * a[5] + H * e
    z = Z + a[2] * b[5] + b[2] * a[5] + V_m * e
    return T_m2 - g[0] * x - g[1] * z - g[2] * (p2 * a[3] * b[3] + p1 * T_A2)


@jit
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit
def _times(S, a):
    """Return the product of S, three rows, and a (3)."""
    return _dot(S[0], a), _dot(S[1], a), _dot(S[2], a)


@jit
def differentiate(
    i, p_WA, p_WB, v_WB, length, length_rate, w, stiffness, drum_run, damping_time,
    H, V_B, clamped, linear, out, jacobian,
):  # fmt: skip
    """Write jacobian[i] from the solution in out[i]. Return whether a number is not finite."""
    dx, dy, Bz, Bx, L = _leaning_chord(i, p_WA, p_WB)
    l = float(length[i])
    rate = float(length_rate[i])
    vx = float(v_WB[i, 0])
    vy = float(v_WB[i, 1])
    vz = float(v_WB[i, 2])
    asymptote = float(stiffness[0])
    softening = float(stiffness[1])
    offset = float(stiffness[2])
    w = max(w, MIN_WEIGHT)
    l0 = float(out[i, 13])
    q = H / clamped
    hx = q * dx
    hy = q * dy
    h = q * Bx
    V_A = V_B - w * l0
    T_A = math.sqrt(h * h + V_A * V_A)
    T_B = math.sqrt(h * h + V_B * V_B)
    EA, dEA = secant_stiffness(T_A, asymptote, softening, offset)
    strain1, strain2 = _strain(T_A, asymptote, softening, offset)
    flexibility = l * strain1
    moves = _in_plane(H, V_A, linear)
    e_x, e_z, e_l = _stretch(H, 0.5 * (V_A + V_B), w, moves, flexibility)
    e_q = e_x / clamped
    e_t = (e_q * h * Bx + e_z * V_B) / T_B
    viscosity = EA * damping_time / l
    across = dx * vx + dy * vy
    stretching = e_q * across + e_z * vz + e_l * rate
    T_d, cut = _damping(viscosity, stretching, e_l, e_t, T_A, T_B)
    bends = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    if T_d != 0.0:
        g = (e_x / flexibility, e_z / flexibility, e_l / flexibility)
        bends = _curvature(
            H, V_B, l0, float(drum_run[i]), w, asymptote, softening, offset, moves, g
        )
    for c in (0, 1, 2, 6):
        px = 1.0 if c == 0 else 0.0
        py = 1.0 if c == 1 else 0.0
        pz = 1.0 if c == 2 else 0.0
        along = dx * px + dy * py
        dBx, dBz = along / Bx, pz
        if clamped > Bx:
            dL = (along + Bz * pz) / L
            dBx, dBz = MIN_SLOPE * dL, _steepest(dL, Bz)
        change = (dBx, dBz, 1.0 if c == 6 else 0.0)
        dl = change[2]
        dH = moves[0][0] * dBx + moves[1][0] * dBz + moves[2][0] * dl
        dV_B = moves[0][1] * dBx + moves[1][1] * dBz + moves[2][1] * dl
        dl0 = moves[0][2] * dBx + moves[1][2] * dBz + moves[2][2] * dl
        dq = (dH - q * dBx) / clamped
        dhx = dq * dx + q * px
        dhy = dq * dy + q * py
        dh = dq * Bx + q * along / Bx
        dV_A = dV_B - w * dl0
        dT_A = (h * dh + V_A * dV_A) / T_A
        dT_B = (h * dh + V_B * dV_B) / T_B
        dT_d = 0.0
        de_q = 0.0
        de_z = 0.0
        de_l = 0.0
        de_t = 0.0
        if T_d != 0.0:
            grows = dl / l + strain2 / strain1 * dT_A
            de_q = (flexibility * _dot(bends[0], change) + grows * e_x - e_q * dBx) / clamped
            de_z = flexibility * _dot(bends[1], change) + grows * e_z
            de_l = flexibility * _dot(bends[2], change) + grows * e_l
            de_t = de_q * h * Bx + e_q * (dh * Bx + h * along / Bx) + de_z * V_B + e_z * dV_B
            de_t = (de_t - e_t * dT_B) / T_B
            if cut == 1:
                dT_d = (dT_A - T_d * de_l) / e_l
            elif cut == 2:
                dT_d = -(dT_B + T_d * de_t) / e_t
            else:
                drift = vx * px + vy * py
                dT_d = viscosity * (de_q * across + e_q * drift + de_z * vz + de_l * rate)
                dT_d += T_d * (dEA / EA * dT_A - dl / l)
        jacobian[i, 0, c] = -(dhx + (dT_d * e_q + T_d * de_q) * dx + T_d * e_q * px)
        jacobian[i, 1, c] = -(dhy + (dT_d * e_q + T_d * de_q) * dy + T_d * e_q * py)
        jacobian[i, 2, c] = -(dV_B + dT_d * e_z + T_d * de_z)
        jacobian[i, 3, c] = 0.0 if cut == 1 else dT_A - dT_d * e_l - T_d * de_l
        jacobian[i, 4, c] = 0.0 if cut == 2 else dT_B + dT_d * e_t + T_d * de_t
        jacobian[i, 5, c] = (dhx - hx * dT_A / T_A) / T_A
        jacobian[i, 6, c] = (dhy - hy * dT_A / T_A) / T_A
        jacobian[i, 7, c] = (dV_A - V_A * dT_A / T_A) / T_A
        jacobian[i, 8, c] = (dhx - hx * dT_B / T_B) / T_B
        jacobian[i, 9, c] = (dhy - hy * dT_B / T_B) / T_B
        jacobian[i, 10, c] = (dV_B - V_B * dT_B / T_B) / T_B
        turn = (Bx * pz - Bz * along / Bx) / (L * L)
        jacobian[i, 11, c] = (h * dV_B - V_B * dh) / (T_B * T_B) - turn
        jacobian[i, 12, c] = dh
        jacobian[i, 13, c] = dl0
    if cut:
        viscosity = 0.0
    for c in (3, 4, 5, 7):
        dT_d = viscosity * e_l
        if c == 3:
            dT_d = viscosity * e_q * dx
        elif c == 4:
            dT_d = viscosity * e_q * dy
        elif c == 5:
            dT_d = viscosity * e_z
        for row in range(5, 14):
            jacobian[i, row, c] = 0.0
        jacobian[i, 0, c] = -dT_d * e_q * dx
        jacobian[i, 1, c] = -dT_d * e_q * dy
        jacobian[i, 2, c] = -dT_d * e_z
        jacobian[i, 3, c] = -dT_d * e_l
        jacobian[i, 4, c] = dT_d * e_t
    return not math.isfinite(sum(moves[0]) + sum(moves[1]) + sum(moves[2]) + viscosity)


@jit
def cable_forces_jacobian(
    p_WA, p_WB, v_WB, length, length_rate, w, stiffness, drum_run, damping_time, out, jacobian
):
    """As `cable_forces`, and write d out / d(p_WB, v_WB, length, length_rate) to `jacobian`
    (k, 14, 8). Where the damping is held at its limit the derivative is that of the limit.
    """
    for i in range(len(length)):
        failed, H, V_B, Bx, linear = force(
            i, p_WA, p_WB, v_WB, length, length_rate, w, stiffness, drum_run, damping_time, True,
            AFRESH, out,
        )  # fmt: skip
        if not failed:
            failed = differentiate(
                i, p_WA, p_WB, v_WB, length, length_rate, w, stiffness, drum_run, damping_time,
                H, V_B, Bx, linear, out, jacobian,
            )  # fmt: skip
        if failed:
            return i + 1
    return 0


@jit
def irvine_row_softening(Bx, Bz, H, w, asymptote, softening, offset):
    """The span that carries the horizontal tension H, for EA(T_A), and its derivatives.

    Return (V_B, l0, dV_B/dBx, dV_B/dBz, dV_B/dH, dl0/dBx, dl0/dBz, dl0/dH, status).
    """
    zero = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1)
    if not (math.isfinite(Bz) and 0.0 < Bx < MAX_LENGTH and 0.0 < H < MAX_STIFFNESS):
        return zero
    L = math.sqrt(Bx * Bx + Bz * Bz)
    if not _admissible(Bx, L, 1.0, 0.0, w, asymptote, softening, offset):
        return zero
    w = max(w, MIN_WEIGHT)
    half = 0.5 * w * Bx / H
    if half > 300.0:
        return zero
    # Inextensible catenary, shortened by its stretch.
    across = Bx * (1.0 + half * half / 6.0)
    if half > 1e-4:
        across = 2.0 * H / w * math.sinh(half)
    m = math.asinh(Bz / across)
    V_B = H * math.sinh(m + half)
    l0 = across * math.cosh(m)
    EA, _dEA = secant_stiffness(H * math.cosh(m), asymptote, softening, offset)
    l0 /= 1.0 + H * math.cosh(m) / EA
    converged = False
    for _ in range(MAX_ITERATIONS):
        V_A = V_B - w * l0
        T_A, T_B, X, Z, Gxx, Gxz, Gzz, _det = _span(H, V_B, l0, w)
        EA, dEA = secant_stiffness(T_A, asymptote, softening, offset)
        e = l0 / EA
        Vm = 0.5 * (V_A + V_B)
        d = -e * dEA / (EA * T_A)
        g = 1.0 / EA + 1.0 / T_A
        # Columns of d(x, z)/d(H, V_B, l0)
        xH = Gxx + e + d * H * H
        xV = Gxz + d * H * V_A
        xl = g * H - d * H * w * V_A
        zH = Gxz + d * Vm * H
        zV = Gzz + e + d * Vm * V_A
        zl = g * V_A - d * Vm * w * V_A
        div = xl * zV - xV * zl
        rx = Bx - X - H * e
        rz = Bz - Z - Vm * e
        dV = (xl * rz - zl * rx) / div
        dl = (zV * rx - xV * rz) / div
        if converged:
            return (
                V_B + dV, l0 + dl,
                -zl / div, xl / div, (zl * xH - xl * zH) / div,
                zV / div, -xV / div, (xV * zH - zV * xH) / div,
                0,
            )  # fmt: skip
        # Then once more round, so that the derivatives are taken at the solution.
        converged = abs(dV) <= 1e-8 * min(T_A, T_B) and abs(dl) <= 1e-8 * l0
        converged = converged or (abs(rx) + abs(rz) <= 1e-15 * L and abs(rx) <= 1e-9 * Bx)
        step = 1.0
        if dl < -0.5 * l0:
            step = -0.5 * l0 / dl
        V_B += step * dV
        l0 += step * dl
        if not (l0 < 1e300 and abs(V_B) < 1e300):
            break
    return zero


@jit
def irvine_row(Bx, Bz, H, w, EA):
    """As `irvine_row_softening` for a constant EA."""
    return irvine_row_softening(Bx, Bz, H, w, EA, 0.0, 0.0)


@jit
def irvine_from_horizontal(Bx, Bz, H, w, EA):
    """Return (V_B, l0, status) of the span that carries the horizontal tension H."""
    V_B, l0, _a, _b, _c, _d, _e, _f, status = irvine_row_softening(Bx, Bz, H, w, EA, 0.0, 0.0)
    return V_B, l0, status


@jit
def robot_length(Bx, Bz, H, run, constants):
    """Return (V_A, V_B, total unstrained length, status) of a cable at rest with the tension H.

    With the cables' `constants` packed as in `model.arrays`, and its own run from the drum, with
    the arc round its pulley.
    """
    w, asymptote, softening, offset = constants[0], constants[1], constants[2], constants[3]
    V_B, l0, _a, _b, _c, _d, _e, _f, status = irvine_row_softening(
        Bx, Bz, H, w, asymptote, softening, offset
    )
    V_A = V_B - w * l0
    T_A = math.sqrt(H * H + V_A * V_A)
    EA = asymptote - softening / (T_A + offset)
    return V_A, V_B, l0 + run / (1.0 + T_A / EA), status
