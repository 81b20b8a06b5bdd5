"""The paper's four cable models, one cable at a time (Dallej et al. 2019, eqs. 2, 4 to 9, 11).

Arguments throughout: Bx, Bz [m] of B from A in the cable's plane, x horizontal, z up; H [N]
horizontal tension, T [N] chord tension, T_A [N] tension at the drawing point; w [N/m] weight per
unstrained metre; EA [N]; model ECM = 0, CMWE = 1, SCMWE = 2, SLSM = 3, where ECM and CMWE share the
catenary's shape and the SCMWE's is a parabola; order of the ECM's series. Nothing is checked here.

They are real or complex, mixed as they come: evaluated at x + i h, the imaginary part divided by h
is the exact derivative. Branches look at real parts only.

The chord from A to B has the length L and the direction (c, s). Lengths and rows are formed from
L, c, s and T = H / c, which stay finite for a vertical cable, where Bx and H are 0. Of the angles h
and m of eq. (2) only h = w L / 2T is formed: sinh m = Bz / (Bx shc h), and with l the length of
the CMWE cosh m = l / (Bx shc h), so that no logarithm is needed.

No sum below cancels as w -> 0 or h -> 0; each tends to the straight cable's value.
"""

from __future__ import annotations

import cmath
import math

import numpy as np

from cdpr_drake.model.kernels import is_compiled, jit

ECM, CMWE, SCMWE, SLSM = range(4)

MAX_NEWTON_STEPS = 60  # 2 to 4 when taut; up to 20 where the branches meet and steps only halve


def _python_sqrt(x):
    """Return the square root of a float or complex x."""
    return cmath.sqrt(x) if isinstance(x, complex) else math.sqrt(x)


# np.sqrt returns a NumPy scalar, with which all arithmetic that follows takes four times as long.
sqrt = np.sqrt if is_compiled() else _python_sqrt


# --- functions that need a series near 0


@jit
def shc_coshc(h):
    """Return shc(h) = sinh(h) / h and coshc(h) = cosh(h) - shc(h), which is h^2 / 3 near 0."""
    x = h * h
    if x.real >= 1.0:
        shc = np.sinh(h) / h
        return shc, np.cosh(h) - shc
    # Taylor series in x, nested: the terms x^k / (2k + 1)! and 2k x^k / (2k + 1)!
    shc = 1.0 + x / 156.0 * (1.0 + x / 210.0 * (1.0 + x / 272.0))
    shc = 1.0 + x / 42.0 * (1.0 + x / 72.0 * (1.0 + x / 110.0 * shc))
    shc = 1.0 + x / 6.0 * (1.0 + x / 20.0 * shc)
    coshc = 1.0 + x / 130.0 * (1.0 + x / 180.0 * (1.0 + x / 238.0 * (1.0 + x / 304.0)))
    coshc = 1.0 + x / 28.0 * (1.0 + x / 54.0 * (1.0 + x / 88.0 * coshc))
    coshc = x / 3.0 * (1.0 + x / 10.0 * coshc)
    return shc, coshc


@jit
def ashc_oma(y):
    """Return ashc(y) = asinh(y) / y and oma(y) = 1 - ashc(y), which is y^2 / 6 near 0; y >= 0."""
    if y.real >= 1.0:
        ashc = np.arcsinh(y) / y
        return ashc, 1.0 - ashc
    # With v = tanh(asinh(y) / 2), asinh y = 2 atanh v and oma = sum of 2 v^(2k) / (4 k^2 - 1).
    v = y / (1.0 + sqrt(1.0 + y * y))
    x = v * v
    power = 2.0 * x
    oma = power / 3.0
    k = 1
    while power.real > 1e-15 * oma.real:
        k += 1
        power = power * x
        oma = oma + power / (4 * k * k - 1)
    return 1.0 - oma, oma


@jit
def angle(y, x):
    """Return atan2(y, x), for complex numbers too."""
    if abs(y.real) <= abs(x.real):
        half_turn = 0.0 if x.real >= 0.0 else math.copysign(math.pi, y.real)
        return np.arctan(y / x) + half_turn
    return math.copysign(0.5 * math.pi, y.real) - np.arctan(x / y)


# --- shape of the cable


@jit
def catenary_parameters(Bx, Bz, H, w):
    """Return (a, m, h) of the profile (eq. 2): a is the asinh of the slope at A, m + h that at B.

    The paper's a_i, in a form that neither cancels nor overflows.
    """
    h = 0.5 * w * Bx / H
    if h.real > 700.0:
        m = np.arcsinh(Bz * (w / H) * np.exp(-h))  # sinh h = exp(h) / 2, past its overflow
    else:
        m = np.arcsinh(Bz / (Bx * shc_coshc(h)[0]))
    return m - h, m, h


@jit
def profile_height(model, x, Bx, Bz, H, w):
    """Return the height z(x) [m] of the cable over A at the distance x [m] (eq. 2)."""
    if model == SLSM:
        return x * Bz / Bx
    if model == SCMWE:
        return x / Bx * (Bz - 0.5 * w / H * sqrt(Bx * Bx + Bz * Bz) * (Bx - x))
    a = catenary_parameters(Bx, Bz, H, w)[0]
    u = 0.5 * w / H * x
    return x * shc_coshc(u)[0] * np.sinh(u + a)


@jit
def largest_sag(model, Bx, Bz, H, w):
    """Return the largest vertical distance [m] from the chord down to the cable."""
    if model == SLSM:
        return 0.0
    if model == SCMWE:
        return 0.125 * w / H * Bx * sqrt(Bx * Bx + Bz * Bz)
    t = Bz / Bx
    _, m, h = catenary_parameters(Bx, Bz, H, w)
    # The slope is t at u = m + d; d = O(h^2), below round-off of the sag for the smallest h.
    d, ratio, drop = 0.0 * m, 0.0, 0.0
    if h.real > 1e-7:
        d = np.arcsinh(t) - m
        ratio = d / h
        drop = np.sinh(m) * ratio * (shc_coshc(h)[0] - shc_coshc(d)[0]) / h
    lens = shc_coshc(0.5 * (h + d))[0] * shc_coshc(0.5 * (h - d))[0]
    return 0.5 * Bx * h * (0.5 * np.cosh(m) * (1.0 - ratio * ratio) * lens + drop)


@jit
def cable_ends(model, Bx, Bz, H, w):
    """Return (alpha, beta, beta0, dbeta, V_A, V_B): slopes and vertical forces at both ends.

    Eqs. (4) and (5). Angles [rad] from the horizontal: alpha of the tangent at A, beta of that at
    B, beta0 of the chord, dbeta = beta - beta0 without cancellation. V_A, V_B [N]: vertical part of
    the tension, directed from A to B.
    """
    L = sqrt(Bx * Bx + Bz * Bz)
    c, s = Bx / L, Bz / L
    T = H / c
    middle, half_weight = 0.0, 0.0
    if model == SCMWE:
        half_weight = 0.5 * w * L
    elif model != SLSM:
        shc, coshc = shc_coshc(0.5 * w * L / T)
        middle = T * s * coshc / shc
        half_weight = 0.5 * w * L * sqrt(s * s + (c * shc) * (c * shc))
    beyond = middle + half_weight
    V_A, V_B = T * s + middle - half_weight, T * s + beyond
    # The turn from the chord (c, s) to the tangent at B, by cross and dot product with (H, V_B).
    dbeta = angle(c * beyond, H * c + V_B * s)
    return angle(V_A, H), angle(V_B, H), angle(s, c), dbeta, V_A, V_B


@jit
def largest_tension(Bx, Bz, T, w):
    """Return the tension [N] at the upper end of the catenary, the largest along the cable.

    By T_A + T_B = w l coth h and T_B - T_A = w Bz.
    """
    L = sqrt(Bx * Bx + Bz * Bz)
    shc, coshc = shc_coshc(0.5 * w * L / T)
    length = sqrt(Bz * Bz + Bx * shc * Bx * shc)
    rise = Bz if Bz.real >= 0.0 else -Bz
    return T * length / L * (1.0 + coshc / shc) + 0.5 * w * rise


# --- lengths and rows


@jit
def _catenary_terms(order, L, c, s, T, w, EA):
    """Return the length of eq. (6), truncated, and the sums from which all its rows are made.

    The j-th power of cosh u is written with multiples n = j - 2k of the angle, as in the paper.
    Here the outer sum runs over n: sinh(n h) / sinh h and eps^(n-1) cosh(n m), eps^(n-1) sinh(n m)
    with eps = H / EA follow from one recurrence each, and the inner sum over k has no functions.
    Terms that grow as cosh(n m) near the vertical stay apart in sum_C, for the callers to scale.
    """
    shc, coshc = shc_coshc(0.5 * w * L / T)
    cosh_h = shc + coshc
    inverse = 1.0 / (L * shc)
    lam = L * c * shc
    Bz = L * s
    l_c = sqrt(Bz * Bz + lam * lam)  # eq. (7)
    if order == 1:
        return l_c, Bz / l_c, lam / l_c, 0.0, 0.0, 0.0, shc, coshc
    strain = T / EA
    eps = strain * c
    eps2 = eps * eps
    # n = 0: the constant part of even powers, C(j, j/2) Bx / 2
    constant, constant_H = 0.0, 0.0
    term = -0.5 * eps
    for j in range(2, order + 1, 2):
        constant = constant + term
        constant_H = constant_H + (j - 1) * term
        term = term * eps2 * (j + 1.0) / (j + 2.0)
    length, sum_R, N2, sum_C, inner = L * c * constant, 0.0, 0.0, 0.0, 0.0
    U, U_before = 1.0, 0.0  # sinh(n h) / sinh h, here and below for n, and for n - 1
    C, C_before = l_c, eps * lam  # lam eps^(n-1) cosh(n m), and eps^2 times that for n - 1
    S, S_before = Bz, 0.0  # the same of sinh
    R = lam / l_c  # eps^(n-1) cosh((n-1) m) / cosh m
    twice_cosh_h = 2.0 * cosh_h
    twice_cosh_m = 2.0 * strain * l_c * inverse  # times eps
    lead = 1.0
    for n in range(1, order + 1):
        term, total = lead, lead
        total_k = 0.0  # sum of the terms times 2k / n, divided by eps^2
        for k in range(1, (order - n) // 2 + 1):
            j = n + 2 * k
            term = term * (0.25 * j * (j - 1) / (k * (n + k)))
            total_k = total_k + (2.0 * k / n) * term
            term = term * eps2
            total = total + term
        UC = U * C
        length = length + total * UC / n
        sum_R = sum_R + total * U * R
        N2 = N2 + total * U * S
        sum_C = sum_C + total * U_before * C
        inner = inner + total_k * UC
        if n < order:
            R = eps * C / l_c
            U, U_before = twice_cosh_h * U - U_before, U
            C, C_before = twice_cosh_m * C - C_before, eps2 * C
            S, S_before = twice_cosh_m * S - S_before, eps2 * S
            lead = -0.5 * lead
    N2 = N2 / l_c
    sum_C = sum_C * inverse
    rest_H = constant_H + inner * strain * eps / L
    return length, N2, sum_R, sum_C, constant, rest_H, shc, coshc


@jit
def _parabola_terms(L, c, T, w):
    """Return (q, cY, ashc, oma) of eq. (8).

    q = (T_A + T_B) / T; Y as in l = (L / 2) (q / 2 + 2 s^2 / q + c^2 Y ashc(rho Y)), rho = w L / T.
    """
    rho = w * L / T
    x, y = 1.0 - 0.25 * rho * rho, rho * c
    product = sqrt(x * x + y * y)  # T_A T_B / T^2
    q = sqrt(2.0 + 0.5 * rho * rho + 2.0 * product)
    # Two forms of one number; 1e-300 keeps a vertical cable, folded from rho = 2, finite.
    Y = q * (product - x) / (y * y + 1e-300) if rho.real > 2.0 else q / (product + x + 1e-300)
    ashc, oma = ashc_oma(rho * Y)
    return q, c * Y, ashc, oma


@jit
def length_and_row(model, order, Bx, Bz, H, w, EA):
    """Return (l, N1, N2, N3): unstrained length and its row, dl = N1 dBx + N2 dBz + N3 dH.

    Eqs. (6) to (9) and (11). l [m], N1, N2 [-], N3 [m/N].
    """
    L = sqrt(Bx * Bx + Bz * Bz)
    c, s = Bx / L, Bz / L
    T = H / c
    if model == SLSM:
        return L, c, s, 0.0
    if model == SCMWE:
        q, cY, ashc, oma = _parabola_terms(L, c, T, w)
        length = 0.5 * L * (0.5 * q + 2.0 * s * s / q + c * cY * ashc)
        N1 = 0.5 * cY * (1.0 + ashc + c * c * oma)
        N2 = 2.0 * s / q + 0.5 * s * c * cY * oma
        return length, N1, N2, -0.5 * L / T * cY * oma
    if model == CMWE:
        order = 1
    length, N2, sum_R, sum_C, constant, rest_H, shc, coshc = _catenary_terms(
        order, L, c, s, T, w, EA
    )
    N1 = (shc + coshc) * sum_R - sum_C / c + constant
    return length, N1, N2, L / T * (sum_C / c + rest_H - coshc * sum_R)


@jit
def length_and_row_T(model, order, Bx, Bz, T, w, EA):
    """Return (l, M1, M2, M3): as `length_and_row` with dl = M1 dBx + M2 dBz + M3 dT; Bx >= 0.

    The chord tension T = H L / Bx instead of H keeps the row finite up to the vertical cable. M1,
    M2 [-], M3 [m/N].
    """
    L = sqrt(Bx * Bx + Bz * Bz)
    c, s = Bx / L, Bz / L
    if model == SLSM:
        return L, c, s, 0.0
    if model == SCMWE:
        q, cY, ashc, oma = _parabola_terms(L, c, T, w)
        length = 0.5 * L * (0.5 * q + 2.0 * s * s / q + c * cY * ashc)
        M1 = cY * (c * c + s * s * ashc)
        M2 = 2.0 * s / q + s * c * cY * oma
        return length, M1, M2, -0.5 * L / T * c * cY * oma
    if model == CMWE:
        order = 1
    length, N2, sum_R, sum_C, constant, rest_H, shc, coshc = _catenary_terms(
        order, L, c, s, T, w, EA
    )
    N3 = sum_C + c * (rest_H - coshc * sum_R)  # times c T / L
    M1 = sum_R * (shc + c * c * coshc) - c * sum_C + constant + s * s * rest_H
    return length, M1, N2 - s * N3, L / T * N3


# --- tension at the drawing point


@jit
def _drawing_point(L, c, s, T, w):
    """Return (T_A, V_A / T_A, dV_A/dT, shc h, coshc h, l) of the catenary."""
    shc, coshc = shc_coshc(0.5 * w * L / T)
    lam = L * c * shc
    length = sqrt(L * s * L * s + lam * lam)
    V_A = T * s * (1.0 + coshc / shc) - 0.5 * w * length
    V_A_T = s / (shc * shc) + 0.5 * w * L / T * lam / length * c * coshc
    T_A = sqrt(T * c * T * c + V_A * V_A)
    return T_A, V_A / T_A, V_A_T, shc, coshc, length


@jit
def drawing_point_tension(Bx, Bz, T, w):
    """Return (T_A, dT_A/dBx, dT_A/dBz, dT_A/dT): tension of the catenary at the drawing point.

    T_A^2 = (c T)^2 + V_A^2 with V_A of eq. (4).
    """
    L = sqrt(Bx * Bx + Bz * Bz)
    c, s = Bx / L, Bz / L
    T_A, sin_A, V_A_T, shc, coshc, length = _drawing_point(L, c, s, T, w)
    turn = T / (L * shc * shc)
    half_weight = 0.5 * w * L / length  # times the row of the CMWE, which has 1 / length in it
    V_A_x = -c * (turn * s + half_weight * shc * (shc + c * c * coshc))
    V_A_z = T / L * (1.0 + coshc / shc) - turn * s * s
    V_A_z = V_A_z - half_weight * s * (1.0 + c * c * shc * coshc)
    aside = T * T * c * s / (L * T_A)
    by_T = T * c * c / T_A + sin_A * V_A_T
    return T_A, aside * s + sin_A * V_A_x, sin_A * V_A_z - aside * c, by_T


@jit
def run_row(run, EA, Bx, Bz, T, w):
    """Return the derivatives of run / (1 + T_A / EA) with respect to (Bx, Bz, T).

    The unstrained length of the run [m] from the drum to A, which stretches with the tension T_A.
    """
    T_A, by_Bx, by_Bz, by_T = drawing_point_tension(Bx, Bz, T, w)
    stretch = 1.0 + T_A / EA
    factor = -run / (EA * stretch * stretch)
    return factor * by_Bx, factor * by_Bz, factor * by_T


@jit
def horizontal_force_parabola(Bx, Bz, T_A, w):
    """Return (H, slack): horizontal tension from that at the drawing point, by the parabola.

    Slack (1, else 0): T_A is below what the hanging cable needs, and H is the floor w Bx / 20.
    w = 0 gives the straight cable, H = T_A cos(beta0).
    """
    L = sqrt(Bx * Bx + Bz * Bz)
    c, s = Bx / L, Bz / L
    weight = w * L
    floor = 0.05 * weight
    T, slack = floor, 1
    rest = T_A * T_A - 0.25 * (weight * c) * (weight * c)
    if not (T_A.real <= 0.0 or rest.real <= 0.0):
        taut = 0.5 * weight * s + sqrt(rest)
        if not taut.real <= floor.real:
            T, slack = taut, 0
    return T * c, slack


@jit
def horizontal_force_catenary(Bx, Bz, T_A, w):
    """Return (H, slack): horizontal tension from that at the drawing point, by the catenary.

    Slack (1, else 0): T_A is below what the hanging cable needs, and H is the floor w Bx / 20.
    """
    T, slack = chord_tension_catenary(Bx, Bz, T_A, w)
    return T * Bx / sqrt(Bx * Bx + Bz * Bz), slack


@jit
def chord_tension_catenary(Bx, Bz, T_A, w):
    """Return (T, slack): chord tension from that at the drawing point, by the catenary; Bx >= 0.

    Slack (1, else 0): T_A is below what the hanging cable needs, and T is the floor w L / 20.
    Newton on the taut branch in the chord tension, of which T_A is a convex function: from above,
    the iterates fall monotonically to the root.
    """
    L = sqrt(Bx * Bx + Bz * Bz)
    c, s = Bx / L, Bz / L
    weight = w * L
    floor = 0.05 * weight
    T = T_A + weight * s if s.real > 0.0 else T_A  # T_B or T_A, both at least T
    slack = 0
    for _ in range(MAX_NEWTON_STEPS):
        if T.real <= floor.real:
            slack = 1
            break
        value, sin_A, V_A_T, _, _, _ = _drawing_point(L, c, s, T, w)
        slope = T * c * c / value + sin_A * V_A_T
        if slope.real <= 0.0:
            slack = 1  # past the least T_A: there is no root
            break
        error = value - T_A
        step = error / slope
        T = T - step
        if abs(step.real) <= 1e-13 * T.real or abs(error.real) <= 1e-15 * (T_A + weight).real:
            break  # in T, or in T_A where a flat slope leaves T to round-off
    if slack == 1:
        T = floor
    return T, slack
