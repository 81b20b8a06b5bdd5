"""Where the cables of a robot are, in real or complex numbers; vectors are tuples (x, y, z).

The one place among the kernels that knows where a cable leaves the frame and where it reaches the
platform. `kinematics.cable_ends` is the same for NumPy's arrays.

A cable leaves its pulley (kernels/pulley.py) where the pulley stands as its own tangent asks; the
functions here take that of a straight cable, or of one that sags little, and real numbers or
complex ones, so that a complex step differentiates them.

Arguments in common: R (3, 3): orientation of the platform in W; position, omega, velocity (3,) [m,
rad/s, m/s]: of its origin; points (4, k, 3): as in `model.arrays`; attachment (k, 3) [m]: p_PB; i:
the cable; a, b, v: vectors, b also the attachment point in W; wrap, e: of a contact as in
kernels/pulley; D (6, k): wrench matrix; p_WB, v_WB
(k, 3): attachment points and their velocities in W; F, rho, B: of a pulley as in kernels/pulley;
AB: the chord, from where a cable leaves to b; T [N]: tension along it; w [N/m]: the cable's weight.
"""

from __future__ import annotations

import math

import numpy as np

from cdpr_drake.model.kernels import jit


@jit
def cross(a, b):
    """Return a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@jit
def turned(R, b):
    """Return R b, for R an array or its rows: a vector of the platform in W."""
    x, y, z = b[0], b[1], b[2]
    r, s, t = R[0], R[1], R[2]
    return (
        r[0] * x + r[1] * y + r[2] * z,
        s[0] * x + s[1] * y + s[2] * z,
        t[0] * x + t[1] * y + t[2] * z,
    )


@jit
def vector(a):
    """Return an array (3,) of floats as a vector.

    Uncompiled, arithmetic on NumPy's scalars takes four times as long as on these.
    """
    return float(a[0]), float(a[1]), float(a[2])


@jit
def dot(a, b):
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit
def less(a, factor, b):
    """Return a - factor b."""
    return a[0] - factor * b[0], a[1] - factor * b[1], a[2] - factor * b[2]


@jit
def chord(i, drawing, b):
    """Return the vector from the drawing point (k, 3) of cable i to b."""
    return b[0] - float(drawing[i, 0]), b[1] - float(drawing[i, 1]), b[2] - float(drawing[i, 2])


@jit
def is_upright(a):
    """Whether an axis is vertical: the pulley then stands in the plane of its cable, sag or not."""
    return a[0] * a[0] + a[1] * a[1] < 1e-18


@jit
def wrap_angle(s, c):
    """Return the angle from 0 (less round-off) to 2 pi of sine s and cosine c."""
    if c.real * c.real > s.real * s.real:
        angle = np.arctan(s / c)
        if c.real < 0.0:
            return angle + np.pi
        return angle + 2.0 * np.pi if angle.real < -1e-12 else angle
    return (1.5 if s.real < 0.0 else 0.5) * np.pi - np.arctan(c / s)


@jit
def away_from_axis(F, a, B):
    """Return (e, distance): the unit vector from the axis a through F to B, and their distance."""
    d = (B[0] - F[0], B[1] - F[1], B[2] - F[2])
    x = less(d, dot(d, a), a)
    distance = np.sqrt(dot(x, x))
    if distance.real > 1e-9:
        return (x[0] / distance, x[1] / distance, x[2] / distance), distance
    # No direction: +x, or what of it is normal to the axis; +y for an axis along x.
    side = (1.0, 0.0, 0.0) if abs(a[0]) < 0.9 else (0.0, 1.0, 0.0)
    x = less(side, dot(side, a), a)
    size = math.sqrt(dot(x, x))
    zero = 0.0 * distance
    return (x[0] / size + zero, x[1] / size + zero, x[2] / size + zero), distance


@jit
def straight_contact(F, a, rho, B):
    """Return (wrap, e, l) of a straight cable of length l from its pulley to B.

    wrap = (theta, its sine, its cosine); l is zero where B is inside of the pulley.
    """
    e, distance = away_from_axis(F, a, B)
    X, y = distance - rho, dot((B[0] - F[0], B[1] - F[1], B[2] - F[2]), a)
    square = X * X + y * y
    if not square.real > rho * rho:
        return (0.0 * X, 0.0 * X, 1.0 + 0.0 * X), e, 0.0 * X
    l = np.sqrt(square - rho * rho)
    s, c = (l * X + rho * y) / square, (l * y - rho * X) / square
    return (wrap_angle(s, c), s, c), e, l


@jit
def away_from_entry(a, rho, wrap, e):
    """Return FA, from where a cable enters its pulley to where it leaves it."""
    _theta, s, c = wrap
    v = s * s / (1.0 + c) if c.real > 0.0 else 1.0 - c
    return (
        rho * (s * a[0] + v * e[0]),
        rho * (s * a[1] + v * e[1]),
        rho * (s * a[2] + v * e[2]),
    )


@jit
def place_leaving(i, points, t, p_WA):
    """Write where cable i leaves, p_WA (3,), if it does so along the unit vector t.

    A = F + rho tan(theta / 2) (a + t), so t alone tells, for a wrap theta below half a turn. A
    cable that wraps farther, whose attachment point is within some 2 rho of the axis, has A on the
    other side of F; of one along -a the side is unknown, and F is written.
    """
    rho = float(points[3, i, 0])
    x, y, z = 0.0, 0.0, 0.0
    if rho > 0.0:
        a = vector(points[2, i])
        c = dot(a, t)
        p = less(t, c, a)
        s = math.sqrt(dot(p, p))
        if s > 1e-9:
            e = (p[0] / s, p[1] / s, p[2] / s)
            x, y, z = away_from_entry(a, rho, (0.0, s, c), e)
    for j, d in enumerate((x, y, z)):
        p_WA[j] = points[0, i, j] + d


@jit
def _chord_and_arc(F, a, rho, wrap, e, b):
    """Return the chord AB, from where a cable leaves its pulley, and the arc rho theta."""
    FA = away_from_entry(a, rho, wrap, e)
    return (b[0] - F[0] - FA[0], b[1] - F[1] - FA[1], b[2] - F[2] - FA[2]), rho * wrap[0]


@jit
def straight_chord(i, points, b):
    """Return the chord of cable i, were it straight, and the length of the arc round its pulley.

    The arc is below -0.5 m where b is inside of the pulley.
    """
    rho = float(points[3, i, 0])
    if rho == 0.0:
        return chord(i, points[0], b), 0.0 * b[0]
    F, a = vector(points[0, i]), vector(points[2, i])
    wrap, e, l = straight_contact(F, a, rho, b)
    AB, arc = _chord_and_arc(F, a, rho, wrap, e, b)
    return AB, arc if l.real > 0.0 else arc - 1.0


@jit
def sagging_chord(i, points, b, AB, T, w):
    """Return chord and arc, as `straight_chord`, of a cable that sags, from those of one nearby.

    Its tangent at A is that of T u - (w L / 2) z, with the chord's direction u and length L.
    """
    rho = float(points[3, i, 0])
    F, a = vector(points[0, i]), vector(points[2, i])
    L = np.sqrt(dot(AB, AB))
    share = 0.5 * w * L * L / T
    t = (AB[0], AB[1], AB[2] - share)
    size = np.sqrt(dot(t, t))
    t = (t[0] / size, t[1] / size, t[2] / size)
    e, _distance = away_from_axis(F, a, b)
    c = dot(a, t)
    p = less(t, c, a)
    s = dot(p, e)
    if not is_upright(a):
        across = np.sqrt(dot(p, p))
        if across.real > 1e-9:
            s = across if s.real >= 0.0 else -across
            e = (p[0] / s, p[1] / s, p[2] / s)
    return _chord_and_arc(F, a, rho, (wrap_angle(s, c), s, c), e, b)


@jit
def followed(i, points, b, AB, v):
    """Return v, of the attachment point, less that of A as the pulley swivels after it.

    As for a straight cable: a share r / R of what is normal to the pulley's plane, with r and R the
    distances of A and b from its axis. Nothing is taken off for the cable's rolling along itself.
    """
    if points[3, i, 0] == 0.0:
        return v
    F, a = vector(points[0, i]), vector(points[2, i])
    e, distance = away_from_axis(F, a, b)
    r = distance - dot(less(AB, dot(AB, a), a), e)
    across = less(less(v, dot(v, a), a), dot(v, e), e)
    return less(v, r / distance, across)


@jit
def arm_and_chord(i, R, position, points):
    """Return EB, from the platform's origin to the attachment point of cable i; that point; and
    chord and arc of `straight_chord`.
    """
    arm = turned(R, points[1, i])
    b = (arm[0] + position[0], arm[1] + position[1], arm[2] + position[2])
    AB, arc = straight_chord(i, points, b)
    return arm, b, AB, arc


@jit
def set_column(i, a, b, D):
    """Write the wrench [a x b; b] at the platform's origin of a force b on the arm a."""
    D[0, i], D[1, i], D[2, i] = cross(a, b)
    D[3, i], D[4, i], D[5, i] = b


@jit
def attachment_motion(R, position, omega, velocity, attachment, p_WB, v_WB):
    """Write positions and velocities of the attachment points in W; floats only."""
    (x, y, z), (wx, wy, wz), (vx, vy, vz) = vector(position), vector(omega), vector(velocity)
    rows = (vector(R[0]), vector(R[1]), vector(R[2]))
    for i in range(attachment.shape[0]):
        ex, ey, ez = turned(rows, vector(attachment[i]))
        p_WB[i, 0], p_WB[i, 1], p_WB[i, 2] = ex + x, ey + y, ez + z
        v_WB[i, 0] = vx + wy * ez - wz * ey
        v_WB[i, 1] = vy + wz * ex - wx * ez
        v_WB[i, 2] = vz + wx * ey - wy * ex
