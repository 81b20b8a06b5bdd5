"""The paper's equations term by term, corrected or with the slips of the printed text left in.

Slips go by the names of `SLIPS`. Nothing here is used by the controller, which has forms of its own
(`model.cable_models`, `model.statics`).
"""

from __future__ import annotations

from math import comb

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake import CableRobot
from cdpr_drake.model.cable_models import instantaneous_row
from cdpr_drake.model.kinematics import D_B, CableGeometry, D_Bf, cable_geometry
from cdpr_drake.model.rotations import Array, skew
from cdpr_drake.model.servo import interaction_matrix
from cdpr_drake.model.statics import D_ext, D_tau, D_theta, attachment_forces

SLIPS = {
    "half_plane": "(1) γ = tan⁻¹(uy/ux), not atan2; (17) no sign",
    "k_p": "(6), (11) k_p = (j-1)/2 for odd j",
    "bracket": "(11) Biz in the first numerator of N_i3",
    "factor": "(11) last term of N_i3 without j-1",
    "sign_of_H": "(16) θ_Bx = -θ_Ax, tangents from A to B",
    "unit_vector": "A.2 u_B a unit vector, not the force",
    "no_com": "A.2 no term for the centre of mass",
}
"""The slips that change the law of eq. (19), by name."""

A_I_READINGS = ("-1 under the root", "-1 in the exponent")
"""How the first line of a_i (eq. 2) may be read; its second line is the same."""


def printed_a(Bx: Array, Bz: Array, mu: Array, reading: int) -> Array:
    """Return a_i (k,) of eq. (2) as printed.

    Args:
        Bx: (k,) [m].
        Bz: (k,) [m].
        mu: (k,) w / H [1/m].
        reading: index of `A_I_READINGS`.
    """
    x, z = mu * Bx, mu * Bz
    last = np.exp(-x) - 1.0 if reading == 0 else np.exp(-x - 1.0)
    below = np.exp(x) + np.exp(-x) - 1.0
    return np.log((z + np.sqrt(z * z + np.exp(x) + last)) / below)


def ecm(
    Bx: Array, Bz: Array, H: Array, w: float, EA: float, order: int, slip: str = ""
) -> tuple[Array, Array]:
    """Return lengths (k,) [m] and rows (k, 3) of the ECM by the sums of eqs. (6) and (11).

    Args:
        Bx: (k,) [m].
        Bz: (k,) [m].
        H: (k,) [N].
        w: [N/m].
        EA: [N].
        order: O_l.
        slip: one of `SLIPS`, or none.
    """
    h = 0.5 * w * Bx / H
    a = np.arcsinh(w * Bz / H / (2.0 * np.sinh(h))) - h
    u = a + 2.0 * h
    length, N1, N2, N3 = (np.zeros_like(Bx) for _ in range(4))
    for j in range(1, order + 1):
        even = j % 2 == 0
        k_p = j // 2 if even or slip == "k_p" else (j + 1) // 2
        sum1, sum2, sum3 = (np.zeros_like(Bx) for _ in range(3))
        for k in range(k_p):
            n, C = j - 2 * k, comb(j, k)
            sum1 += C / (w * n) * (np.sinh(n * u) - np.sinh(n * a))
            sum2 += C * np.cosh(n * u)
            sum3 += C * (np.cosh(n * u) - np.cosh(n * a)) / (np.sinh(u) - np.sinh(a))
        constant = comb(j, j // 2) if even else 0
        power = (-H / (2.0 * EA)) ** (j - 1)
        length += H * power * (sum1 + constant * Bx / (2.0 * H))
        N1 += power * (sum2 - np.sinh(u) * sum3 + 0.5 * constant)
        N2 += power * sum3
        first = Bx * np.sinh(u) - Bz
        if slip == "bracket":
            first = Bx * np.sinh(u) * Bz - Bz
        last = 1 if slip == "factor" else j - 1
        N3 += power * (
            first / H * sum3 - Bx / H * sum2 + j * sum1 + last * constant * Bx / (2.0 * H)
        )
    return length, np.stack([N1, N2, N3], axis=-1)


def length_rates(
    robot: CableRobot, X_WP: RigidTransform, H: Array, model: str, order: int, slip: str = ""
) -> Array:
    """Return D_a (k, 6) of eq. (14) for a twist [omega; v] of E in W, with a slip left in.

    Args:
        robot: the robot.
        X_WP: the pose.
        H: (k,) [N].
        model: "ECM" for the sums of eq. (11), "SCMWE" or "SLSM".
        order: O_l.
        slip: one of `SLIPS`, or none.
    """
    geometry = cable_geometry(robot, X_WP)
    w = robot.weight_per_metre
    EA = robot.cable.stiffness(float(np.mean(H)))
    Bx, Bz = geometry.Bx, geometry.Bz
    if model == "ECM":
        N = ecm(Bx, Bz, H, w, EA, order, slip)[1]
    else:
        N = instantaneous_row(model, Bx, Bz, H, w, EA)
    rates = tension_rates(robot, geometry, -H if slip == "sign_of_H" else H, slip)
    if slip == "sign_of_H":  # lengths are even in H, so are N1 and N2, and N3 is odd
        N = N * [1.0, 1.0, -1.0]
    point = D_B(geometry)
    D = N[:, :1] * point[:, 0] + N[:, 1:2] * point[:, 2] + N[:, 2:] * rates
    if slip == "half_plane":
        # Bx and its rate change sign, and so does tan(beta0): the cosine of beta0 does not.
        D[geometry.u[:, 0] < 0.0] *= -1.0
    return D


def tension_rates(robot: CableRobot, geometry: CableGeometry, H: Array, slip: str = "") -> Array:
    """Return D_s (k, 6) of A.2, with a slip left in.

    Args:
        robot: the robot.
        geometry: the chords at a pose.
        H: (k,) [N].
        slip: one of `SLIPS`, or none.
    """
    change = D_tau(robot, geometry, H).sum(0)
    if slip == "unit_vector":
        force = attachment_forces(robot, geometry, H)
        D_EB = D_Bf(geometry).copy()
        D_EB[:, :, 3:] = 0.0
        unit = force / np.linalg.norm(force, axis=1)[:, None]
        change[:3] += (skew(force - unit) @ D_EB).sum(0)
    if slip != "no_com":
        change = change - D_ext(robot, geometry)
    return -np.linalg.lstsq(D_theta(geometry), change, rcond=None)[0]


def servo_twist_by_inversion(error: Array, gain: float, sign: float) -> Array:
    """Return tau = -gain L_s^-1 s (6,), with either sign of the term theta/2 [u]x in L_w.

    Args:
        error: s = [s_w; s_t] (6,).
        gain: lambda [1/s].
        sign: -1 as derived, +1 for the other one.
    """
    L = interaction_matrix(error)
    if sign > 0.0:
        L[:3, :3] -= skew(error[:3])  # L has -L_w there, and L_w has -[theta u]x / 2
    return np.asarray(-gain * np.linalg.solve(L, error))
