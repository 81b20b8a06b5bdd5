"""Cables that leave swivelling pulleys: where they do, and what that does to forces and Jacobian.

A pulley of radius rho, to the cable's centre line, turns about an axis a through its entry point F,
along which the cable arrives: a is the direction in which the cable moves at F, away from the drum.
Its centre is F + rho e with a unit vector e normal to a. The cable wraps it by theta and leaves it
at A, along t = cos(theta) a + sin(theta) e. Free to swivel, and without weight, the pulley stands
so that t is the tangent of the hanging cable at A; a cable at speed leaves where one at rest does.
Run and wrapped arc have no weight and carry the tension at A. At rho = 0, an eyelet, A is F.

Arguments in common: i: the cable; points (4, k, 3), constants: as in `model.arrays`; p_WB, v_WB,
length, rate, out, jacobian: as in `catenary.cable_forces_jacobian`; w [N/m], law (3,): weight of
the cables, and EA(T); pulley = (F, a, rho [m], run [m] from the drum to F, upright: whether a is
vertical, so that e comes from B); theta [rad], wrap = (theta, its sine, its cosine), e: of a
contact; t_A: unit tangent of the cable at A; differs: whether a Jacobian is asked for; p_WA (k, 3),
run (k,): written, A and the run with the arc; hanging = (p_WB, v_WB, length, rate, w, law, p_WA,
run, out).
"""

from __future__ import annotations

import math

import numpy as np

from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.catenary import (
    AFRESH,
    cable_forces,
    cable_forces_jacobian,
    differentiate,
    force,
    secant_stiffness,
    sketch,
)
from cdpr_drake.model.kernels.geometry import (
    away_from_entry,
    cross,
    dot,
    is_upright,
    straight_contact,
    vector,
)

SETTLED, ROUGHLY = 1e-6, 1e-4
"""Angles [rad] after which one more step is exact to round-off: for any cable, and at most; between
them the more, the less the matrix of the steps, wrong by part of the bend round the pulley, is off.
"""

TIGHT = 1e-9
"""Angles [rad] that are not worth another step: they move A by nanometres at most."""

FOUND = 1e-12
"""Angles [rad] at which a search ends."""

ROUNDS, SKETCHES = 30, 2

LARGEST_TURN, LARGEST_SWIVEL = 0.7, 1.0  # rad a step

WALK = 0.1  # of swivel a step [rad]

NOT_HUNG = (True, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
"""What `catenary.force` returns where it has not been called."""


@jit
def _wrap(theta):
    """Return (theta, its sine, its cosine)."""
    return theta, math.sin(theta), math.cos(theta)


@jit
def _angle(y, x):
    """Return atan2(y, x), to 1e-16 for small ones by a series."""
    if abs(y) < 1e-3 * x:
        t = y / x
        return t * (1.0 - t * t * (1.0 / 3.0 - t * t * 0.2))
    return math.atan2(y, x)


@jit
def misfit(a, wrap, e, t_A):
    """Return the angles (r1, r2) by which wrap and swivel miss the tangent t_A of the cable."""
    _theta, s, c = wrap
    along, out, aside = dot(a, t_A), dot(e, t_A), dot(cross(a, e), t_A)
    sign = 1.0 if s >= 0.0 else -1.0
    return _angle(c * out - s * along, c * along + s * out), _angle(sign * aside, sign * out)


@jit
def _turned_about(a, e, angle):
    """Return e, normal to a, turned about a."""
    f, c, s = cross(a, e), math.cos(angle), math.sin(angle)
    x, y, z = c * e[0] + s * f[0], c * e[1] + s * f[1], c * e[2] + s * f[2]
    size = math.sqrt(x * x + y * y + z * z)
    return x / size, y / size, z / size


@jit
def _place(i, pulley, wrap, e, p_WA, run):
    """Write A and the run, with the arc, for a contact at wrap and e."""
    (x, y, z), a, rho, own_run, _upright = pulley
    if rho > 0.0:
        dx, dy, dz = away_from_entry(a, rho, wrap, e)
        x, y, z = x + dx, y + dy, z + dz
    p_WA[i, 0], p_WA[i, 1], p_WA[i, 2] = x, y, z
    run[i] = own_run + rho * abs(wrap[0])  # below zero as if e were turned round


@jit
def _settle(
    i, pulley, wrap, e, span, p_WB, v_WB, length, rate, w, law, damping_time, differs, p_WA, run,
    out,
):  # fmt: skip
    """Find the contact from a straight cable's, `span` long, by quasi-Newton steps.

    Return (failed, wrap, e, hung), and row i of `out` written there; hung: what `catenary.force`
    has returned. The first steps are for cables as sketched; their matrix is that of a straight
    cable with the curvature of this one, and Broyden's rule improves it.
    """
    _F, a, rho, _run, upright = pulley
    J11, J12, J21 = -1.0, 0.0, 0.0
    J22 = -1.0 - rho * (1.0 - wrap[2]) / max(span * abs(wrap[1]), 1e-9)
    enough, r1, r2, turn, swivel = SETTLED, 0.0, 0.0, 0.0, 0.0
    is_last, hung, nearby = False, NOT_HUNG, AFRESH
    for count in range(ROUNDS):
        solves = count >= SKETCHES
        _place(i, pulley, wrap, e, p_WA, run)
        if not solves:
            t_A, kappa, nearby = sketch(i, p_WA, p_WB, length, run, w, law, nearby)
            J11 = -1.0 - a[2] * rho * kappa
            enough = min(max(SETTLED, 5e-10 / max(rho * kappa, 1e-9)), ROUGHLY)
        else:
            hung = force(
                i, p_WA, p_WB, v_WB, length, rate, w, law, run, damping_time, differs, nearby, out
            )
            if hung[0]:  # no span left, or nearly none: back half of the way
                if max(abs(turn), abs(swivel)) < SETTLED:
                    return True, wrap, e, hung
                turn, swivel, nearby, is_last = 0.5 * turn, 0.5 * swivel, AFRESH, False
                wrap, e = _wrap(wrap[0] - turn), _turned_about(a, e, -swivel)
                continue
            nearby = (hung[1], hung[2], float(out[i, 13]))
            t_A = (out[i, 5], out[i, 6], out[i, 7])
        new1, new2 = misfit(a, wrap, e, t_A)
        if upright:
            new2 = 0.0
        size = max(abs(new1), abs(new2 * wrap[1]))
        if solves and (is_last or size < TIGHT):
            return not (size < enough and 0.0 <= wrap[0] < 2.0 * math.pi), wrap, e, hung
        square = turn * turn + swivel * swivel
        if square > 0.0 and r1 != 0.0:
            g1 = (new1 - r1 - J11 * turn - J12 * swivel) / square
            g2 = (new2 - r2 - J21 * turn - J22 * swivel) / square
            J11, J12 = J11 + g1 * turn, J12 + g1 * swivel
            J21, J22 = J21 + g2 * turn, J22 + g2 * swivel
        r1, r2 = (new1, new2) if solves else (0.0, 0.0)
        det = J11 * J22 - J12 * J21
        if not abs(det) > 1e-9:
            return True, wrap, e, hung
        turn = min(max((J12 * new2 - J22 * new1) / det, -LARGEST_TURN), LARGEST_TURN)
        swivel = min(max((J21 * new1 - J11 * new2) / det, -LARGEST_SWIVEL), LARGEST_SWIVEL)
        theta = wrap[0] + turn
        if not upright:
            e = _turned_about(a, e, swivel)
        is_last = solves and size < enough
        if theta < 0.0 and not upright and not is_last:
            theta, e, r1 = -theta, (-e[0], -e[1], -e[2]), 0.0
            J12, J21 = -J12, -J21
        wrap = _wrap(theta)
    return True, wrap, e, hung


@jit
def _tangent(i, pulley, theta, e, near, hanging):
    """Return the angle of the tangent at A in the pulley's plane, nearest to the angle `near`.

    A cable that has no span left counts as one that wraps too much.
    """
    p_WB, v_WB, length, rate, w, law, p_WA, run, out = hanging
    _place(i, pulley, _wrap(theta), e, p_WA, run)
    failed, _H, _V_B, _Bx, _linear = force(
        i, p_WA, p_WB, v_WB, length, rate, w, law, run, 0.0, False, AFRESH, out
    )
    if failed:
        return theta - math.copysign(1.0, theta)
    t_A = (out[i, 5], out[i, 6], out[i, 7])
    angle = math.atan2(dot(e, t_A), dot(pulley[1], t_A))
    return angle + 2.0 * math.pi * round((near - angle) / (2.0 * math.pi))


@jit
def _hold(i, pulley, theta, e, near, hanging):
    """Find the wrap at which the cable's tangent is the pulley's, for a swivel that is held.

    From theta on, where the tangent's angle is the one nearest to `near`, that way which brings the
    two together: by steps until they have passed each other, then between. Write `out` there.
    Return (failed, theta).
    """
    bracket, walks, way, value = (theta, 0.0, theta, 0.0, 0), True, 0.0, 1.0
    for count in range(300):
        near = _tangent(i, pulley, theta, e, near, hanging)
        value = near - theta
        if abs(value) < FOUND:
            return False, theta
        if count == 0:
            way = math.copysign(WALK, value)
        walks = walks and value * way > 0.0
        bracket = _narrowed(bracket, theta, value, value * way > 0.0)
        if walks:
            theta += way
            if abs(theta) > 2.0 * math.pi:
                return True, theta
            continue
        if abs(bracket[0] - bracket[2]) < 1e-15:
            break
        near = bracket[0] + bracket[1]
        theta = _between(bracket, count)
    return not abs(value) < SETTLED, theta


@jit
def _narrowed(bracket, x, value, is_low):
    """Return a bracket (low, value there, high, value there, side) with x in place of one end.

    The value at an end that stays twice is halved (the Illinois rule).
    """
    low, at_low, high, at_high, side = bracket
    if is_low:
        return x, value, high, at_high * (0.5 if side == 1 else 1.0), 1
    return low, at_low * (0.5 if side == -1 else 1.0), x, value, -1


@jit
def _between(bracket, count):
    """Return where the line through a bracket's ends is zero; of every third time its middle."""
    low, at_low, high, at_high, _side = bracket
    x = (at_low * high - at_high * low) / (at_low - at_high)
    if count % 3 == 2 or not min(low, high) < x < max(low, high):
        x = 0.5 * (low + high)
    return x


@jit
def _moment(i, pulley, theta, e, hanging):
    """Return (failed, theta, m): the wrap of a held swivel, and its cable's moment about a.

    The wrap nearby, or the least there is, to either side of the drawing point or to that of e.
    """
    failed, found, start, near = True, theta, theta, theta
    for _attempt in range(3):
        failed, found = _hold(i, pulley, start, e, near, hanging)
        if not failed:
            break
        start, near = 0.0, 0.0 if start != 0.0 else math.pi
    out = hanging[8]
    return failed, found, dot(cross(pulley[1], e), (out[i, 5], out[i, 6], out[i, 7]))


@jit
def _search(i, pulley, theta, e, hanging):
    """Find the contact by walking the pulley about its axis. Return (failed, theta, e).

    The moment of the cable about the axis, m = (a x e) . t_A at the wrap that fits, is minus the
    slope of a periodic energy: uphill it falls through zero, where the pulley stands.
    """
    a, upright = pulley[1], pulley[4]
    if upright:
        failed, theta, m = _moment(i, pulley, theta, e, hanging)
        return failed or not 0.0 <= theta < 2.0 * math.pi, theta, e
    first, angle, bracket = e, 0.0, (0.0, 0.0, 0.0, 0.0, 0)
    m, failed, walks, way = 1.0, False, True, 0.0
    for count in range(300):
        e = _turned_about(a, first, angle)
        failed, found, m = _moment(i, pulley, theta, e, hanging)
        if not failed:
            theta = found
            if abs(m) < FOUND:
                break
            if way == 0.0:
                way = math.copysign(WALK, m)
        walks = walks and (failed or m * way > 0.0)
        if not failed:
            bracket = _narrowed(bracket, angle, m, m * way > 0.0)
        if walks:
            angle += way if way != 0.0 else WALK
            if abs(angle) > 2.0 * math.pi:
                break
            continue
        if failed or abs(bracket[0] - bracket[2]) < 1e-15:
            break
        angle = _between(bracket, count)
    if theta < 0.0:
        theta, e = -theta, (-e[0], -e[1], -e[2])
    return failed or not (abs(m) < SETTLED and theta < 2.0 * math.pi), theta, e


@jit
def _find(
    i, pulley, wrap, e, span, p_WB, v_WB, length, rate, w, law, damping_time, differs, p_WA, run,
    out,
):  # fmt: skip
    """Find the contact: from the straight cable's; by a search; from others about the axis.

    Arguments and result as those of `_settle`.
    """
    upright, start = pulley[4], e
    for attempt in range(10):
        if attempt == 1:
            hanging = (p_WB, v_WB, length, rate, w, law, p_WA, run, out)
            failed, theta, new_e = _search(i, pulley, wrap[0], start, hanging)
            found = _wrap(theta)
            _place(i, pulley, found, new_e, p_WA, run)
            hung = force(
                i, p_WA, p_WB, v_WB, length, rate, w, law, run, damping_time, differs, AFRESH, out
            )
            failed = failed or hung[0]
        else:
            failed, found, new_e, hung = _settle(
                i, pulley, wrap, e, span, p_WB, v_WB, length, rate, w, law, damping_time, differs,
                p_WA, run, out,
            )  # fmt: skip
        if not failed or (upright and attempt > 0):
            break
        if attempt > 0:
            wrap, e = _wrap(0.1), _turned_about(pulley[1], start, 0.25 * math.pi * attempt)
    return failed, found, new_e, hung


@jit
def _damped_parts(i, rate, v, viscosity, rho, run, out, jacobian, damped, by_turn):
    """Write what damping adds to the first five outputs, and to their change with theta.

    The gradient e of the stretch is by B and the length (kernels/catenary.py), and the run enters
    the span as the length does, over 1 + strain: of e itself the strain changes too, which its
    share of the length says, run / (1 + strain) = length - l0.
    """
    for row in range(5):
        damped[row], by_turn[row] = 0.0, 0.0
    pull = jacobian[i, 3, 7]  # - viscosity e_l^2
    if pull == 0.0:
        return
    e_l = -math.sqrt(-pull / viscosity)
    e_B = (
        -jacobian[i, 0, 7] / (viscosity * e_l),
        -jacobian[i, 1, 7] / (viscosity * e_l),
        -jacobian[i, 2, 7] / (viscosity * e_l),
    )
    T_d = viscosity * (dot(e_B, v) + e_l * rate)
    share = rho * e_l / run
    d_B = (
        share * jacobian[i, 13, 0], share * jacobian[i, 13, 1], share * jacobian[i, 13, 2]
    )  # fmt: skip
    d_l = share * (jacobian[i, 13, 6] - 1.0)
    dT_d = viscosity * (dot(d_B, v) + d_l * rate)
    t_B = (out[i, 8], out[i, 9], out[i, 10])
    for a in range(3):
        damped[a] = -e_B[a] * T_d
        by_turn[a] = -(d_B[a] * T_d + e_B[a] * dT_d)
    damped[3], by_turn[3] = -e_l * T_d, -(d_l * T_d + e_l * dT_d)
    damped[4] = dot(e_B, t_B) * T_d
    by_turn[4] = dot(d_B, t_B) * T_d + dot(e_B, t_B) * dT_d


@jit
def _follow(i, pulley, wrap, e, B, strain, damped, l, by_contact, jacobian):
    """Add to jacobian[i] what comes from the contact's following B and the length.

    by_contact (2, 14): scratch, its first five `_damped_parts`' by_turn; damped (5,): from there.
    """
    F, a, rho, _run, upright = pulley
    _theta, s, c = wrap
    f = cross(a, e)
    t = (c * a[0] + s * e[0], c * a[1] + s * e[1], c * a[2] + s * e[2])
    n = (c * e[0] - s * a[0], c * e[1] - s * a[1], c * e[2] - s * a[2])
    r = rho * (1.0 - c)
    by_turn, by_swivel = by_contact[0], by_contact[1]
    for row in range(14):
        X_B = vector(jacobian[i, row])
        own = damped[row] / l if row < 5 else 0.0
        more = by_turn[row] if row < 5 else 0.0
        along = dot(X_B, t) + (float(jacobian[i, row, 6]) - own) / (1.0 + strain)
        by_turn[row] = more - rho * along
        by_swivel[row] = -r * dot(X_B, f)
    # The conditions n . t_A = 0 and f . t_A = 0, by theta and sigma.
    turn_t, swivel_t = vector(by_turn[5:8]), vector(by_swivel[5:8])
    a11, a12 = dot(n, turn_t) - 1.0, dot(n, swivel_t)
    a21, a22 = dot(f, turn_t), dot(f, swivel_t) - s
    away = dot((B[0] - F[0], B[1] - F[1], B[2] - F[2]), e)
    det = a11 * a22 - a12 * a21
    for j in range(4):
        column = j if j < 3 else 6
        t_x = vector(jacobian[i, 5:8, column])
        b1, b2 = dot(n, t_x), dot(f, t_x)
        if upright or abs(s) < 1e-9:
            swivel = f[j] / away if j < 3 else 0.0
            turn = -(b1 + a12 * swivel) / a11
        else:
            turn, swivel = -(a22 * b1 - a12 * b2) / det, -(a11 * b2 - a21 * b1) / det
        for row in range(14):
            jacobian[i, row, column] += by_turn[row] * turn + by_swivel[row] * swivel


@jit
def robot_forces(points, p_WB, v_WB, length, rate, constants, differs, out, jacobian):
    """As `catenary.cable_forces_jacobian`, or without the Jacobian unless it `differs`.

    Status: also 1 + i where B is inside of the pulley, or the cable goes round all of it.
    """
    k = length.shape[0]
    has_pulleys = False
    for i in range(k):
        has_pulleys = has_pulleys or points[3, i, 0] > 0.0
    if not has_pulleys:
        w, law, damping_time = float(constants[0]), constants[1:4], float(constants[4])
        if differs:
            return cable_forces_jacobian(
                points[0], p_WB, v_WB, length, rate, w, law, constants[6:], damping_time,
                out, jacobian,
            )  # fmt: skip
        return cable_forces(
            points[0], p_WB, v_WB, length, rate, w, law, constants[6:], damping_time, out
        )
    return _over_pulleys(points, p_WB, v_WB, length, rate, constants, differs, out, jacobian)


@jit
def _over_pulleys(points, p_WB, v_WB, length, rate, constants, differs, out, jacobian):
    """As `robot_forces`, for cables of which some leave over pulleys."""
    k = length.shape[0]
    p_WA, run = np.empty((k, 3)), np.empty(k)
    damped, by_contact = np.empty(5), np.empty((2, 14))
    w, law, damping_time = float(constants[0]), constants[1:4], float(constants[4])
    for i in range(k):
        F, a, B = vector(points[0, i]), vector(points[2, i]), vector(p_WB[i])
        rho = float(points[3, i, 0])
        pulley = (F, a, rho, float(constants[6 + i]), is_upright(a))
        wrap, e = (0.0, 0.0, 1.0), a
        if rho > 0.0:
            wrap, e, span = straight_contact(F, a, rho, B)
            if not span > 0.0:
                return i + 1
            failed, wrap, e, hung = _find(
                i, pulley, wrap, e, span, p_WB, v_WB, length, rate, w, law, damping_time, differs,
                p_WA, run, out,
            )  # fmt: skip
        else:
            _place(i, pulley, wrap, e, p_WA, run)
            hung = force(
                i, p_WA, p_WB, v_WB, length, rate, w, law, run, damping_time, differs, AFRESH, out
            )
            failed = hung[0]
        if not failed and differs:
            failed = differentiate(
                i, p_WA, p_WB, v_WB, length, rate, w, law, run, damping_time,
                hung[1], hung[2], hung[3], hung[4], out, jacobian,
            )  # fmt: skip
            if rho > 0.0:
                h, V_A = out[i, 12], hung[2] - w * out[i, 13]
                T_A, l = math.sqrt(h * h + V_A * V_A), float(length[i])
                EA, _slope = secant_stiffness(T_A, float(law[0]), float(law[1]), float(law[2]))
                _damped_parts(
                    i, float(rate[i]), vector(v_WB[i]), EA * damping_time / l, rho, run[i],
                    out, jacobian, damped, by_contact[0],
                )  # fmt: skip
                _follow(i, pulley, wrap, e, B, T_A / EA, damped, l, by_contact, jacobian)
        if failed:
            return i + 1
    return 0
