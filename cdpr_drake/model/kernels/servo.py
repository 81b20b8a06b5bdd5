"""The control law of eqs. (14), (18) and (19), cable by cable.

Every function takes real or complex numbers: evaluated at z + i h, the imaginary part divided by h
is the exact derivative, so that one source gives the value and the Jacobian.

Arguments in common: model, order: the cable model's index and the order of its series; roll, pitch,
yaw: extrinsic x-y-z angles [rad]; R (3, 3): rotation matrix; G (6, 6), b (6,): matrix and
right-hand side; D (6, k), x (k,): of D x = b; gain [1/s]; limits [m/s, rad/s] of speed; z, s, out,
jacobian, rates: inputs and results named in each function; points, body, stiffness, run: as in
`model.arrays`; X_PM (4, 3) = [R_PM; p_PM]; R_M, EM: orientation of the target frame and offset from
E to M, in W; twist (6,) = [omega; v].
"""

from __future__ import annotations

import numpy as np

from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.cable_models import (
    SLSM,
    chord_tension_catenary,
    length_and_row_T,
    run_row,
)
from cdpr_drake.model.kernels.geometry import (
    arm_and_chord,
    cross,
    followed,
    sagging_chord,
    set_column,
    turned,
)

RANK_DEFICIENT = -1
STEP = 1e-40

CONTACT_ROUNDS = 2
"""Of finding tension and contact with a pulley from each other, a thousand times better each."""

STEEP2 = 4e-4
"""Square of the cosine of the elevation above which a chord is near the vertical, by a degree."""


@jit
def rpy_matrix(roll, pitch, yaw, R):
    """Write the rotation matrix of extrinsic x-y-z angles into R (3, 3)."""
    cr, sr = np.cos(roll), np.sin(roll)
    cp, sp = np.cos(pitch), np.sin(pitch)
    cy, sy = np.cos(yaw), np.sin(yaw)
    R[0, 0], R[0, 1], R[0, 2] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    R[1, 0], R[1, 1], R[1, 2] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    R[2, 0], R[2, 1], R[2, 2] = -sp, cp * sr, cp * cr


@jit
def rotation_log(R, out):
    """Write the rotation vector of R into out (3,), by way of the quaternion's largest part."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    if trace.real > 0.0:
        w = 0.5 * np.sqrt(1.0 + trace)
        x = (R[2, 1] - R[1, 2]) / (4.0 * w)
        y = (R[0, 2] - R[2, 0]) / (4.0 * w)
        z = (R[1, 0] - R[0, 1]) / (4.0 * w)
    elif R[0, 0].real >= R[1, 1].real and R[0, 0].real >= R[2, 2].real:
        x = 0.5 * np.sqrt(1.0 + R[0, 0] - R[1, 1] - R[2, 2])
        w = (R[2, 1] - R[1, 2]) / (4.0 * x)
        y = (R[0, 1] + R[1, 0]) / (4.0 * x)
        z = (R[0, 2] + R[2, 0]) / (4.0 * x)
    elif R[1, 1].real >= R[2, 2].real:
        y = 0.5 * np.sqrt(1.0 - R[0, 0] + R[1, 1] - R[2, 2])
        w = (R[0, 2] - R[2, 0]) / (4.0 * y)
        x = (R[0, 1] + R[1, 0]) / (4.0 * y)
        z = (R[1, 2] + R[2, 1]) / (4.0 * y)
    else:
        z = 0.5 * np.sqrt(1.0 - R[0, 0] - R[1, 1] + R[2, 2])
        w = (R[1, 0] - R[0, 1]) / (4.0 * z)
        x = (R[0, 2] + R[2, 0]) / (4.0 * z)
        y = (R[1, 2] + R[2, 1]) / (4.0 * z)
    if w.real < 0.0:
        w, x, y, z = -w, -x, -y, -z
    n2 = x * x + y * y + z * z
    if n2.real < 1e-8:
        r = n2 / (w * w)
        factor = 2.0 / w * (1.0 - r / 3.0 + r * r / 5.0)
    else:
        n = np.sqrt(n2)
        if n.real < w.real:
            factor = 2.0 * np.arctan(n / w) / n
        else:
            factor = (np.pi - 2.0 * np.arctan(w / n)) / n
    out[0], out[1], out[2] = factor * x, factor * y, factor * z


@jit
def solve_symmetric(G, b):
    """Solve G x = b in place of b by LDL^T, for G symmetric (6, 6); False if G is singular.

    G = D D^T is taken for singular where a pivot is below 1e-12 of its largest diagonal entry: a
    singular value of D near 1e-6 of the largest, as in `statics.check_rank`.
    """
    n = b.shape[0]
    largest = 0.0
    for j in range(n):
        largest = max(largest, G[j, j].real)
    for j in range(n):
        d = G[j, j]
        for m in range(j):
            d = d - G[j, m] * G[j, m] * G[m, m]
        if not d.real > 1e-12 * largest:
            return False
        G[j, j] = d
        for i in range(j + 1, n):
            v = G[i, j]
            for m in range(j):
                v = v - G[i, m] * G[j, m] * G[m, m]
            G[i, j] = v / d
    for i in range(n):
        for m in range(i):
            b[i] = b[i] - G[i, m] * b[m]
    for i in range(n):
        b[i] = b[i] / G[i, i]
    for i in range(n - 1, -1, -1):
        for m in range(i + 1, n):
            b[i] = b[i] - G[m, i] * b[m]
    return True


@jit
def least_norm(D, b, x):
    """Write the x (k,) of least norm with D x = b, for D (6, k); False at a rank below 6."""
    gram = np.zeros((6, 6), b.dtype)
    for a in range(6):
        for c in range(a + 1):
            for i in range(D.shape[1]):
                gram[a, c] += D[a, i] * D[c, i]
    if not solve_symmetric(gram, b):
        return False
    for i in range(D.shape[1]):
        x[i] = 0.0 * b[0]
        for a in range(6):
            x[i] += D[a, i] * b[a]
    return True


@jit
def norm_weight(c2):
    """Return the square of what a chord tension weighs in the norm of the horizontal tensions.

    That is c2 = c^2, with c the cosine of the chord's elevation, but above zero for chords near the
    vertical (`STEEP2`), whose horizontal tension is none whatever they pull.
    """
    if c2.real < STEEP2:
        return (c2 * c2 + STEEP2 * STEEP2) / (2.0 * STEEP2)
    return c2


@jit
def chord_tension(T_A, cos_alpha, Bx, Bz, L, w):
    """Return the chord tension: T_A cos_alpha over the chord's cosine (eq. 16), not below w L / 20.

    Bx, Bz, L: of the chord [m], horizontal, up, along it.

    Near the vertical, where one cosine over the other says nothing, that of the catenary with T_A.
    """
    c = Bx / L
    share = (c * c / STEEP2 - 0.25) / 0.75
    floor = 0.05 * w * L.real
    T = floor + 0.0 * T_A
    if share.real > 0.0:
        measured = T_A * cos_alpha / c
        if measured.real > floor:
            T = measured
    if share.real < 1.0:
        hanging, _slack = chord_tension_catenary(Bx, Bz, T_A, w)
        if share.real <= 0.0:
            return hanging
        T = hanging + share * share * (3.0 - 2.0 * share) * (T - hanging)
    return T


@jit
def length_rates(model, order, R, p, twist, T_A, cos_alpha, points, body, stiffness, run, rates):
    """Write the rates of the unstrained lengths (eq. 13) for a twist [omega; v] of E in W.

    R, p: the pose; T_A, cos_alpha (k,): tension at the drawing points and cosine of the tangents'
    elevation there, so that H = T_A cos_alpha (eq. 16); run (k,): runs from drum to drawing point
    whose stretch, and that of the arc round a pulley, the law models (negative: it does not).
    Returns False when the wrench matrix has rank below 6.

    Rows and tensions are those at the contact of the moment. A cable that rolls on its pulley adds
    to the arc what its span loses, so that this changes no row.

    Among the rates of the tensions that keep the balance those of the horizontal tensions are of
    least norm, written in chord tensions: H' = c T' + T c'.
    """
    k = run.shape[0]
    weight, w = body[0], body[4]
    sag = 0.0 if model == SLSM else w
    models_run = False
    omega = (twist[0], twist[1], twist[2])
    D = np.zeros((6, k), R.dtype)
    change = np.zeros(6, R.dtype)
    by_T = np.zeros(k, R.dtype)
    known = np.zeros(k, R.dtype)
    scale = np.zeros(k, R.dtype)
    for i in range(k):
        arm, b, AB, arc = arm_and_chord(i, R, p, points)
        tension = T_A[i] if T_A[i].real > 0.0 else 0.0 * T_A[i]
        ax, ay, Bz = AB
        Bx = np.sqrt(ax * ax + ay * ay)
        L = np.sqrt(Bx * Bx + Bz * Bz)
        T = chord_tension(tension, cos_alpha[i], Bx, Bz, L, w)
        if points[3, i, 0] != 0.0:
            for _round in range(CONTACT_ROUNDS):
                AB, arc = sagging_chord(i, points, b, AB, T, sag)
                ax, ay, Bz = AB
                Bx = np.sqrt(ax * ax + ay * ay)
                L = np.sqrt(Bx * Bx + Bz * Bz)
                T = chord_tension(tension, cos_alpha[i], Bx, Bz, L, w)
        # Velocity of B, as seen from A.
        turn = cross(omega, arm)
        v_B = (twist[3] + turn[0], twist[4] + turn[1], twist[5] + turn[2])
        vx, vy, vz = followed(i, points, b, AB, v_B)
        outwards = ax * vx + ay * vy
        EA = stiffness[0] + 0.0 * tension
        if stiffness[1] != 0.0:
            EA = stiffness[0] - stiffness[1] / (tension + stiffness[2])
        _, M1, M2, M3 = length_and_row_T(model, order, Bx, Bz, T, w, EA)
        if run[i] >= 0.0:
            models_run = True
            N1, N2, N3 = run_row(run[i] + arc, EA, Bx, Bz, T, w)
            M1, M2, M3 = M1 + N1, M2 + N2, M3 + N3
        rates[i] = M2 * vz
        if Bx != 0.0:  # else M1 is zero
            rates[i] += M1 / Bx * outwards
        if model == SLSM and run[i] < 0.0:
            continue
        by_T[i] = M3
        ux, uy, uz = ax / L, ay / L, Bz / L
        # Change of theta_B = T u + (w L / 2) z at constant T, and of its moment about E.
        dL = ux * vx + uy * vy + uz * vz
        stiff = T / L
        gx, gy, gz = stiff * (vx - dL * ux), stiff * (vy - dL * uy), stiff * (vz - dL * uz)
        gz = gz + 0.5 * w * dL
        turned_moment = cross(turn, (T * ux, T * uy, T * uz + 0.5 * w * L))
        moment = cross(arm, (gx, gy, gz))
        for a in range(3):
            change[a] += turned_moment[a] + moment[a]
        change[3] += gx
        change[4] += gy
        change[5] += gz
        c2 = ux * ux + uy * uy
        scale[i] = 1.0 / np.sqrt(norm_weight(c2))
        known[i] = scale[i] * stiff * (outwards / L - c2 * dL)  # T c c' over the weight
        set_column(i, arm, (scale[i] * ux, scale[i] * uy, scale[i] * uz), D)
    if model == SLSM and not models_run:
        return True
    # The weight's moment changes as G turns about E: d(EG x m g) = (omega x EG) x m g.
    turn = cross(omega, turned(R, body[1:4]))
    change[0] += turn[1] * weight
    change[1] -= turn[0] * weight
    for a in range(6):
        for i in range(k):
            change[a] -= D[a, i] * known[i]
    lacking = np.zeros(k, R.dtype)
    if not least_norm(D, change, lacking):
        return False
    for i in range(k):
        rates[i] -= by_T[i] * scale[i] * (lacking[i] + known[i])
    return True


@jit
def target_error(pose, desired, X_PM, R_M, EM, s):
    """Write the pose error s = [s_w; s_t] (6,), R_WM (3, 3) and EM (3,) in W.

    pose, desired: [roll, pitch, yaw, x, y, z]; X_PM (4, 3) = [R_PM; p_PM].
    """
    R = np.zeros((3, 3), pose.dtype)
    R_d = np.zeros((3, 3), pose.dtype)
    R_Md = np.zeros((3, 3), pose.dtype)
    error = np.zeros((3, 3), pose.dtype)
    step = np.zeros(3, pose.dtype)
    rpy_matrix(pose[0], pose[1], pose[2], R)
    rpy_matrix(desired[0], desired[1], desired[2], R_d)
    for a in range(3):
        for b in range(3):
            EM[a] += R[a, b] * X_PM[3, b]
            step[a] += R_d[a, b] * X_PM[3, b]
            for c in range(3):
                R_M[a, b] += R[a, c] * X_PM[c, b]
                R_Md[a, b] += R_d[a, c] * X_PM[c, b]
        step[a] += desired[3 + a] - pose[3 + a] - EM[a]
    for a in range(3):
        for b in range(3):
            s[3 + a] += R_M[b, a] * step[b]
            for c in range(3):
                error[a, b] += R_M[c, a] * R_Md[c, b]
    rotation_log(error, s)


@jit
def pose_error(z, X_PM, out):
    """Write s = [s_w; s_t] (6,) for z = [pose (6); desired pose (6)]."""
    R_M = np.zeros((3, 3), z.dtype)
    EM = np.zeros(3, z.dtype)
    target_error(z[0:6], z[6:12], X_PM, R_M, EM, out)


@jit
def pose_error_jacobian(z, X_PM, out, jacobian):
    """Write s and its Jacobian (6, 12) with respect to z, by complex steps."""
    zc = np.zeros(12, np.complex128)
    for j in range(12):
        zc[j] = z[j]
    for j in range(12):
        zc[j] = zc[j] + STEP * 1j
        yc = np.zeros(6, np.complex128)
        pose_error(zc, X_PM, yc)
        zc[j] = z[j]
        for i in range(6):
            jacobian[i, j] = yc[i].imag / STEP
            out[i] = yc[i].real


@jit
def motor_rates(model, order, gain, limits, z, points, body, stiffness, run, X_PM, out):
    """Evaluate the law: out = [motor rates (k); s_w; s_t], the rates times the transmission.

    z = [pose (6); desired pose (6); desired twist (6); T_A (k); tangents at A (3 k)]; X_PM (4, 3) =
    [R_PM; p_PM]; limits = [speed, angular speed]. Returns False at a rank below 6.
    """
    k = run.shape[0]
    R = np.zeros((3, 3), z.dtype)
    R_M = np.zeros((3, 3), z.dtype)
    EM = np.zeros(3, z.dtype)
    s = np.zeros(6, z.dtype)
    rpy_matrix(z[0], z[1], z[2], R)
    target_error(z[0:6], z[6:12], X_PM, R_M, EM, s)
    # tau = lambda (s_t + s_t x s_w, s_w) in M, taken to E in W (D_t), plus the feed-forward.
    vx = gain * (s[3] + s[4] * s[2] - s[5] * s[1])
    vy = gain * (s[4] + s[5] * s[0] - s[3] * s[2])
    vz = gain * (s[5] + s[3] * s[1] - s[4] * s[0])
    twist = np.zeros(6, z.dtype)
    for a in range(3):
        twist[a] = gain * (R_M[a, 0] * s[0] + R_M[a, 1] * s[1] + R_M[a, 2] * s[2]) + z[12 + a]
        twist[3 + a] = R_M[a, 0] * vx + R_M[a, 1] * vy + R_M[a, 2] * vz + z[15 + a]
    # The feed-forward is the velocity of a rigid frame through the desired pose: at M it is
    # v* + omega* x (M - E*); so that E moves with that less omega x EM.
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        twist[3 + a] -= twist[b] * EM[c] - twist[c] * EM[b]
        offset_b = EM[b] + z[3 + b] - z[9 + b]
        offset_c = EM[c] + z[3 + c] - z[9 + c]
        twist[3 + a] += z[12 + b] * offset_c - z[12 + c] * offset_b
    limit_twist(limits, EM, twist)
    cos_alpha = np.zeros(k, z.dtype)
    for i in range(k):
        ux, uy, uz = z[18 + k + 3 * i], z[19 + k + 3 * i], z[20 + k + 3 * i]
        horizontal = ux * ux + uy * uy
        if horizontal.real > 0.0:
            cos_alpha[i] = np.sqrt(horizontal / (horizontal + uz * uz))
    for a in range(6):
        out[k + a] = s[a]
    return length_rates(
        model, order, R, z[3:6], twist, z[18 : 18 + k], cos_alpha,
        points, body, stiffness, run, out,
    )  # fmt: skip


@jit
def limit_twist(limits, EM, twist):
    """Scale the twist [omega; v] of E so that M keeps within the speed limits (m/s, rad/s)."""
    vx = twist[3] + twist[1] * EM[2] - twist[2] * EM[1]
    vy = twist[4] + twist[2] * EM[0] - twist[0] * EM[2]
    vz = twist[5] + twist[0] * EM[1] - twist[1] * EM[0]
    speed2 = vx * vx + vy * vy + vz * vz
    angular2 = twist[0] * twist[0] + twist[1] * twist[1] + twist[2] * twist[2]
    over = speed2 / (limits[0] * limits[0])
    over_angular = angular2 / (limits[1] * limits[1])
    if over_angular.real > over.real:
        over = over_angular
    if over.real > 1.0:
        scale = 1.0 / np.sqrt(over)
        for a in range(6):
            twist[a] = twist[a] * scale


@jit
def motor_rates_jacobian(
    model, order, gain, limits, z, points, body, stiffness, run, X_PM, out, jacobian
):
    """Evaluate the law and its Jacobian (k + 6, n) with respect to z (n,), by complex steps."""
    n = z.shape[0]
    zc = np.zeros(n, np.complex128)
    yc = np.zeros(out.shape[0], np.complex128)
    for j in range(n):
        zc[j] = z[j]
    for j in range(n):
        zc[j] = zc[j] + STEP * 1j
        for i in range(out.shape[0]):
            yc[i] = 0.0
        if not motor_rates(model, order, gain, limits, zc, points, body, stiffness, run, X_PM, yc):
            return False
        zc[j] = z[j]
        for i in range(out.shape[0]):
            jacobian[i, j] = yc[i].imag / STEP
            out[i] = yc[i].real
    return True
