"""Tensions that balance a wrench: of least norm, closest to preferred ones, in the middle; margin.

All functions take a wrench matrix (n, k), the wrench (n,) that the tensions t (k,) balance,
A t = w, and bounds lower <= t <= upper: numbers or arrays over the cables [N]. What the n rows are,
and in which sense a cable pulls, is the caller's: the same for matrix and wrench.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cdpr_drake.errors import TensionError
from cdpr_drake.model.rotations import Array

RANK_TOLERANCE = 1e-6
"""Singular values below this share of the largest count as none."""


@dataclass(frozen=True, kw_only=True)
class Margin:
    """How far inside their bounds tensions can be that balance a wrench.

    Attributes:
        margin: the largest s [N] with lower + s <= t <= upper - s for some t: negative where no
            tensions within the bounds balance the wrench, and then by how much these would have to
            give way; minus infinity where no tensions at all do.
        tension: (k,) such tensions [N], one choice where there are several; NaN without any.
    """

    margin: float
    tension: Array


def minimum_norm_within(
    matrix: ArrayLike, wrench: ArrayLike, lower: ArrayLike, upper: ArrayLike
) -> Array:
    """Return t (k,) of least norm that balance the wrench within the bounds.

    Where the tensions of least norm of all are within the bounds, these; continuous in all that it
    is given.

    Args:
        matrix: (n, k) wrench per unit of tension.
        wrench: (n,) to balance.
        lower: [N].
        upper: [N].

    Raises:
        TensionError: no tensions within the bounds balance the wrench.
    """
    return bounded_distribution(matrix, wrench, lower, upper, 0.0)


def bounded_distribution(
    matrix: ArrayLike, wrench: ArrayLike, lower: ArrayLike, upper: ArrayLike, preferred: ArrayLike
) -> Array:
    """Return t (k,), the closest to `preferred` that balance the wrench within the bounds.

    Solved exactly, by Newton's method on the dual problem (`kernels/distribution.py`).

    Args:
        matrix: (n, k) wrench per unit of tension.
        wrench: (n,) to balance.
        lower: [N].
        upper: [N].
        preferred: tensions to stay close to [N].

    Raises:
        TensionError: no tensions within the bounds balance the wrench.
        ValueError: what is given is not finite.
    """
    from cdpr_drake.model.kernels.distribution import within_bounds

    A, w = np.array(matrix, float), np.array(wrench, float)
    k = A.shape[1]
    low, high, wish = (np.array(_for_each(x, k)) for x in (lower, upper, preferred))
    for what in (A, w, low, high, wish):
        if not np.all(np.isfinite(what)):
            raise ValueError("matrix, wrench, bounds and preferred tensions must be finite")
    t = np.empty(k)
    status = within_bounds(A, w, low, high, wish, np.ones(k), t)
    if status == 0:
        return t
    if status == 2:
        raise TensionError("whether tensions within the bounds balance the wrench was not decided")
    particular, null = _solutions(A, w)
    if null.shape[1] == 0:
        raise TensionError("the only tensions that balance the wrench leave their limits")
    centre = particular + null @ (null.T @ (wish - particular))
    worst = int(np.argmax(np.maximum(low - centre, centre - high)))
    raise TensionError(
        f"no tensions between {low.min():g} and {high.max():g} N balance the wrench; "
        f"cable {worst + 1} is the furthest out ({centre[worst]:.1f} N)"
    )


def feasibility_margin(
    matrix: ArrayLike, wrench: ArrayLike, lower: ArrayLike, upper: ArrayLike
) -> Margin:
    """Return how far inside the bounds tensions can be that balance the wrench, and such tensions.

    A linear programme (HiGHS): the wrench can be balanced within the bounds if and only if the
    margin is not negative.

    Args:
        matrix: (n, k) wrench per unit of tension.
        wrench: (n,) to balance.
        lower: [N].
        upper: [N].
    """
    from scipy.optimize import linprog

    A, w = np.asarray(matrix, float), np.asarray(wrench, float)
    k = A.shape[1]
    low, high = _for_each(lower, k), _for_each(upper, k)
    try:
        _solutions(A, w)
    except TensionError:
        return Margin(margin=-np.inf, tension=np.full(k, np.nan))
    force = max(1.0, float(np.max(np.abs(np.concatenate([low, high])))))
    rows = np.linalg.norm(A, axis=1)
    rows[rows == 0.0] = 1.0
    one = np.ones((k, 1))
    found = linprog(
        np.append(np.zeros(k), -1.0),
        A_ub=np.block([[-np.eye(k), one], [np.eye(k), one]]),
        b_ub=np.concatenate([-low, high]) / force,
        A_eq=np.column_stack([A / rows[:, None], np.zeros(len(A))]),
        b_eq=w / rows / force,
        bounds=(None, None),
    )
    if found.status != 0:
        raise TensionError(f"the feasibility of a wrench was not decided: {found.message}")
    return Margin(margin=force * float(found.x[-1]), tension=force * found.x[:-1])


def barycentre(matrix: ArrayLike, wrench: ArrayLike, lower: ArrayLike, upper: ArrayLike) -> Array:
    """Return the centre of gravity t (k,) of all tensions in the bounds that balance the wrench.

    For one or two degrees of redundancy: the middle of a segment, or the centroid of a polygon, a
    square cut by the 2 k bounds (Mikelsons, Bruckmann, Hiller, Schramm, ICRA 2008).

    Args:
        matrix: (n, k) wrench per unit of tension.
        wrench: (n,) to balance.
        lower: [N].
        upper: [N].

    Raises:
        TensionError: no tensions within the bounds balance the wrench.
        ValueError: there are none, or more than two, degrees of redundancy.
    """
    A, w = np.asarray(matrix, float), np.asarray(wrench, float)
    low, high = _for_each(lower, A.shape[1]), _for_each(upper, A.shape[1])
    null = _solutions(A, w)[1]
    if null.shape[1] not in (1, 2):
        raise ValueError(
            f"the barycentre is for one or two degrees of redundancy, not {null.shape[1]}"
        )
    middle = bounded_distribution(A, w, low, high, 0.5 * (low + high))
    if null.shape[1] == 1:
        slope = null[:, 0]
        steep = np.abs(slope) > RANK_TOLERANCE * np.max(np.abs(slope))
        ends = (np.stack([low, high]) - middle)[:, steep] / slope[steep]
        return middle + 0.5 * (ends.min(axis=0).max() + ends.max(axis=0).min()) * slope
    reach = float(np.linalg.norm(high - low))
    polygon = reach * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    for i in range(len(low)):
        polygon = _cut(polygon, null[i], low[i] - middle[i])
        polygon = _cut(polygon, -null[i], middle[i] - high[i])
    return np.clip(middle + null @ _centroid(polygon), low, high)


def _cut(polygon: Array, normal: Array, least: float) -> Array:
    """Return the part of a convex polygon (m, 2) in which normal @ x is not below the least."""
    if not len(polygon):
        return polygon
    inside = polygon @ normal - least
    corners = []
    for i, (x, d) in enumerate(zip(polygon, inside, strict=True)):
        j = (i + 1) % len(polygon)
        if d >= 0.0:
            corners.append(x)
        if (d > 0.0 > inside[j]) or (d < 0.0 < inside[j]):
            corners.append(x + d / (d - inside[j]) * (polygon[j] - x))
    return np.array(corners).reshape(-1, 2)


def _centroid(polygon: Array) -> Array:
    """Return the centre of gravity of a convex polygon (m, 2), of its corners if it has no area."""
    if len(polygon) == 0:
        return np.zeros(2)
    from_first = polygon - polygon[0]
    x, y = from_first[1:-1], from_first[2:]
    areas = x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0]
    size = float(np.max(np.abs(from_first))) ** 2
    if not abs(areas.sum()) > 1e-14 * size:
        corners: Array = polygon.mean(axis=0)
        return corners
    centre: Array = polygon[0] + (areas[:, None] * (x + y)).sum(axis=0) / (3.0 * areas.sum())
    return centre


def _for_each(value: ArrayLike, k: int) -> Array:
    return np.broadcast_to(np.asarray(value, float), (k,))


def _solutions(A: Array, w: Array) -> tuple[Array, Array]:
    """Return tensions (k,) that balance the wrench, of least norm, and the null space (k, m).

    Raises:
        TensionError: there are none.
    """
    particular = np.linalg.lstsq(A, w, rcond=None)[0]
    if np.abs(A @ particular - w).max() > RANK_TOLERANCE * np.abs(w).max():
        raise TensionError("no tensions at all balance the wrench: the matrix does not span it")
    _, singular, Vt = np.linalg.svd(A)
    null: Array = Vt[int(np.sum(singular > RANK_TOLERANCE * singular[0])) :].T
    return np.asarray(particular, float), null
