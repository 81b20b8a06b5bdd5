"""The exact elastic catenary (Irvine, Cable Structures, 1981), arrays over cables.

The plant's cables: forces, tensions, tangents and stiffness from the place of both ends and the
unstrained length; the shape they hang in; the energy they hold. The paper's own models, which its
control law uses, are in `cable_models`.

A cable hangs from its drawing point A to its attachment point B. Its unstrained length may include
the run from the drum to A, of geometric length R, which bears the tension T_A at the drawing point
and whose weight is neglected: l0 = length - R / (1 + T_A / EA). Frames: W, z up; p_AB is B - A.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cdpr_drake.errors import CableError

Array = NDArray[np.float64]

BLOCK = 256
"""How many cables are solved at a time: their Jacobians stay in the processor's cache."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CableState:
    """Forces and shape of k cables at rest, in W; see `elastic_catenary`."""

    force_on_platform: Array  # (k, 3) [N], of the cable on the platform, at B
    tension_at_drawing_point: Array  # (k,) [N], T_A
    tension_at_attachment_point: Array  # (k,) [N], T_B
    tangent_at_drawing_point: Array  # (k, 3) [-], unit, directed from A to B
    tangent_at_attachment_point: Array  # (k, 3) [-], unit, directed from A to B
    dbeta: Array  # (k,) [rad], beta - beta0 (eqs. 4, 5): from the chord to the cable at B, >= 0
    horizontal_tension: Array  # (k,) [N], H
    unstrained_span_length: Array  # (k,) [m], l0, between A and B
    position_stiffness: Array  # (k, 3, 3) [N/m], d force_on_platform / d p_WB
    length_stiffness: Array  # (k, 3) [N/m], d force_on_platform / d length


def elastic_catenary(
    p_AB: ArrayLike,
    length: ArrayLike,
    w: float,
    stiffness: Any,
    drum_run: ArrayLike = 0.0,
) -> CableState:
    """Return the state of elastic catenaries at rest, of one or of any number in one call.

    With (H, V) the tension directed from A to B in the cable's plane, V_A = V_B - w l0, T the norm:

        Bx = H l0 / EA + (H / w) (asinh(V_B / H) - asinh(V_A / H))
        Bz = (V_A + V_B) l0 / (2 EA) + (T_B - T_A) / w

    Slack cables hang too: there is an answer for any length above the run. Within 1e-6 of the
    vertical (Bx / L) the horizontal force is taken proportional to Bx.

    Args:
        p_AB: (k, 3) [m], B seen from A, in W.
        length: (k,) or one number [m], unstrained length, run included.
        w: [N/m], weight per unstrained metre.
        stiffness: an `AxialStiffness`, or a number [N] for a constant EA.
        drum_run: (k,) or one number [m], geometric length of the run from the drum to A.

    Raises:
        CableError: the length does not exceed the run, B is at A, a number is
            not finite or out of all range.
        ValueError: shapes that do not match.
    """
    p, length, run = _per_cable(p_AB, length, drum_run)
    k = len(p)
    law, w = _law(stiffness), float(w)
    out, by_position, by_length = np.empty((k, 14)), np.empty((k, 3, 3)), np.empty((k, 3))
    for start in range(0, k, BLOCK):
        part = slice(start, start + BLOCK)
        status, jacobian = _solve_at_rest(p[part], length[part], w, law, run[part], out[part])
        if status:
            i = start + status - 1
            raise CableError(i + 1, None, _why_none(p[i], length[i], w, law, run[i]))
        by_position[part], by_length[part] = jacobian[:, :3, :3], jacobian[:, :3, 6]
    return CableState(
        force_on_platform=out[:, :3],
        tension_at_drawing_point=out[:, 3],
        tension_at_attachment_point=out[:, 4],
        tangent_at_drawing_point=out[:, 5:8],
        tangent_at_attachment_point=out[:, 8:11],
        dbeta=out[:, 11],
        horizontal_tension=out[:, 12],
        unstrained_span_length=out[:, 13],
        position_stiffness=by_position,
        length_stiffness=by_length,
    )


def _why_none(p_AB: Array, length: float, w: float, law: Array, run: float) -> str:
    """Return why a cable has no catenary: the number that is out of range, or all that matter."""
    from cdpr_drake.model.kernels.catenary import (
        MAX_LENGTH,
        MAX_STIFFNESS,
        MAX_WEIGHT,
        MIN_LENGTH,
        MIN_STIFFNESS,
    )

    chord = float(np.linalg.norm(p_AB))
    at_rest = law[0] - (law[1] / law[2] if law[1] else 0.0)
    for name, value, unit, least, most in (
        ("p_AB, the chord,", chord, "m", MIN_LENGTH, MAX_LENGTH),
        ("length", max(length, 0.0), "m", 0.0, MAX_LENGTH),  # too little is said below
        ("w", w, "N/m", 0.0, MAX_WEIGHT),
        ("stiffness", law[0], "N", MIN_STIFFNESS, MAX_STIFFNESS),
        ("stiffness at no tension", at_rest, "N", MIN_STIFFNESS, MAX_STIFFNESS),
        ("drum_run", run, "m", 0.0, MAX_LENGTH),
    ):
        if not least <= value <= most:
            return f"{name} must be from {least:g} to {most:g} {unit}, got {value:g}"
    return (
        f"no elastic catenary of unstrained length {length:.6g} m, of which {run:.6g} m run from "
        f"the drum, over a chord of {chord:.6g} m"
    )


def _solve_at_rest(
    p_AB: Array, length: Array, w: float, law: Array, run: Array, out: Array
) -> tuple[int, Array]:
    """Write the kernel's `out` (k, 14) of cables at rest; return its status and Jacobian."""
    from cdpr_drake.model.kernels.catenary import cable_forces_jacobian

    zeros = np.zeros((len(p_AB), 3))
    jacobian = np.empty((len(p_AB), 14, 8))
    status = cable_forces_jacobian(
        zeros, p_AB, zeros, length, zeros[:, 0].copy(), w, law, run, 0.0, out, jacobian
    )
    return status, jacobian


def cable_shape(
    p_WA: ArrayLike,
    p_WB: ArrayLike,
    H: ArrayLike,
    V_B: ArrayLike,
    l0: ArrayLike,
    w: float,
    EA: ArrayLike,
    n: int = 40,
) -> Array:
    """Return points (k, n, 3) [m] in W along sagging cables, for drawing.

    The points are evenly spaced in unstrained length, from A to B. At the unstrained length s, with
    V = V_A + w s: x = H s / EA + (H / w) (asinh(V / H) - asinh(V_A / H)),
    z = s (V_A + V) (1 / (2 EA) + 1 / (T_A + T)).

    Args:
        p_WA: (k, 3) [m] drawing points in W.
        p_WB: (k, 3) [m] attachment points in W.
        H: (k,) [N] horizontal tension.
        V_B: (k,) [N] vertical tension at B; minus the vertical force on the platform.
        l0: (k,) [m] unstrained length of the span.
        w: [N/m] weight per unstrained metre.
        EA: (k,) or one number [N], axial stiffness.
        n: number of points, at least 2.
    """
    start, end = np.array(p_WA, float, ndmin=2), np.array(p_WB, float, ndmin=2)
    H, V_B, l0, EA = (_column(a, len(end)) for a in (H, V_B, l0, EA))
    s = l0 * np.linspace(0.0, 1.0, n)
    V_A = V_B - w * l0
    V = V_A + w * s
    # A hanging loop of no width still needs some to turn round in.
    H = np.maximum(H, 1e-9 * (np.abs(V_A) + np.abs(V_B)))
    S = np.hypot(H, V_A) + np.hypot(H, V)
    x = H * s * (1.0 / EA + _width(V_A / H, V / H, w * s / S) / S)
    points = np.empty((*s.shape, 3))
    across = (x / x[:, -1:])[..., None]
    points[..., :2] = start[:, None, :2] + across * (end - start)[:, None, :2]
    points[..., 2] = start[:, None, 2] + s * (V_A + V) * (0.5 / EA + 1.0 / S)
    return points


def chord_tension(L: Array, l0: Array, T_A: Array, T_B: Array, w: float, EA: ArrayLike) -> Array:
    """Return the chord tensions (k,) [N] of cables at rest: H over the cosine of the chord.

    T = L / (l0 / EA + (1 / w) ln((T_B + V_B) / (T_A + V_A))), the equation of the span divided by
    its width, which a vertical cable has not.

    Args:
        L: (k,) [m] lengths of the chords.
        l0: (k,) [m] unstrained lengths of the spans.
        T_A: (k,) [N] tensions at the drawing points.
        T_B: (k,) [N] tensions at the attachment points.
        w: [N/m] weight per unstrained metre.
        EA: (k,) or one number [N], axial stiffness.
    """
    both = T_A + T_B
    y = np.minimum(w * l0 / both, 1.0)  # 1 where a cable hangs as a loop without width
    with np.errstate(divide="ignore"):
        bent = 2.0 * np.arctanh(y) / np.maximum(y, 1e-300)
    return L / (l0 * (1.0 / np.asarray(EA) + np.where(y > 1e-8, bent, 2.0) / both))


def cable_energy(
    p_AB: ArrayLike,
    length: ArrayLike,
    w: float,
    stiffness: Any,
    drum_run: ArrayLike = 0.0,
) -> Array:
    """Return the potential energy of cables [J], (k,), for a constant EA.

    It is the sum of
        the strain energy of the span, integral of T^2 / (2 EA) over its unstrained length;
        the weight of the span times its height over A, integral of w z;
        the strain energy of the run from the drum to A.
    The cable on the drum is not in it. The span's part is the Legendre transform
    H Bx + V_B Bz - Phi of Phi = integral of T + T^2 / (2 EA), so with the run

        d/dp_WB = -force_on_platform        d/dlength = -(T_A + T_A^2 / (2 EA))

    With EA following the tension at the drawing point the stiffness is not symmetric and the force
    has no potential; such a law is refused.

    Args:
        p_AB: (k, 3) [m], B seen from A, in W.
        length: (k,) or one number [m], unstrained length, run included.
        w: [N/m], weight per unstrained metre.
        stiffness: an `AxialStiffness` with softening 0, or a number [N].
        drum_run: (k,) or one number [m], geometric length of the run from the drum to A.

    Raises:
        ValueError: a stiffness that depends on the tension, or shapes that do not match.
        CableError: as `elastic_catenary`.
    """
    EA, softening, _offset = _law(stiffness)
    if softening != 0.0:
        raise ValueError("no potential energy for a stiffness that depends on the tension")
    state = elastic_catenary(p_AB, length, w, stiffness, drum_run)
    p, _length, run = _per_cable(p_AB, length, drum_run)
    H, l0 = state.horizontal_tension, state.unstrained_span_length
    V_B = -state.force_on_platform[:, 2]
    T_A = state.tension_at_drawing_point
    S = T_A + state.tension_at_attachment_point
    V_A = V_B - w * l0
    squares = l0 / EA * (V_A * V_A + V_A * V_B + V_B * V_B) / 3.0
    stretch = H * l0 / EA
    span = 0.5 * (H * stretch + squares)
    inextensible = np.hypot(p[:, 0], p[:, 1]) - stretch
    mean = 0.25 * l0 * ((V_A + V_B) ** 2 / S + S)
    height = V_B * p[:, 2] - mean + 0.5 * H * inextensible - squares
    return span + height + 0.5 * T_A * T_A / EA * run / (1.0 + T_A / EA)


def _column(values: ArrayLike, k: int) -> Array:
    """Return a number or (k,) values as (k, 1)."""
    return np.broadcast_to(np.asarray(values, float), k)[:, None]


def _width(low: Array, high: Array, y: Array) -> Array:
    """Return (asinh(high) - asinh(low)) / y, where for slopes close together it is 2 atanh(y)/y."""
    tight = np.minimum(y, 0.5)
    series = 2.0 + tight * tight * (2.0 / 3.0)
    safe = np.maximum(tight, 1e-4)
    close = np.where(tight < 1e-4, series, 2.0 * np.arctanh(safe) / safe)
    return np.where(y < 0.5, close, (np.arcsinh(high) - np.arcsinh(low)) / np.maximum(y, 0.5))


def _law(stiffness: Any) -> Array:
    """Return [asymptote, softening, offset] of an `AxialStiffness` or a number."""
    if hasattr(stiffness, "as_array"):
        return np.array(stiffness.as_array(), float)
    return np.array([float(stiffness), 0.0, 1.0])


def _per_cable(p_AB: ArrayLike, length: ArrayLike, run: ArrayLike) -> tuple[Array, Array, Array]:
    """Return contiguous (k, 3), (k,), (k,) arrays."""
    p = np.array(p_AB, float, ndmin=2)
    if p.ndim != 2 or p.shape[1] != 3:
        raise ValueError(f"p_AB must be (k, 3), not {np.shape(p_AB)}")
    lengths = np.array(np.broadcast_to(np.asarray(length, float), len(p)))
    return p, lengths, np.array(np.broadcast_to(np.asarray(run, float), len(p)))
