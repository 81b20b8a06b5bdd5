"""The paper's four cable models: unstrained length, its row, slopes and sag (eqs. 2, 4 to 9, 11).

A cable hangs in a vertical plane from its drawing point A to its attachment point B, which lies at
(Bx, Bz) from A: Bx horizontal, Bz up, negative where the robot is suspended. H is the horizontal
part of its tension, the same all along. The models, from all effects to none:

    ECM    elastic catenary, a series in H / EA of a given order (eq. 6)
    CMWE   catenary without elasticity (eq. 7), the series' first term
    SCMWE  parabola, its weight spread along the chord (eq. 8)
    SLSM   straight line (eq. 9)

All arguments are numbers or arrays over cables and broadcast against each other; so do the results.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

CABLE_MODELS = ("ECM", "CMWE", "SCMWE", "SLSM")
"""The models' names, the paper's."""

_POSITIVE = ("Bx", "H", "T", "EA")
_NOT_NEGATIVE = ("T_A", "w")


class CableEnds(NamedTuple):
    """Directions and forces at both ends of cables, each an array over cables.

    Angles are from the horizontal, in the cable's plane, positive upwards on the way from A to B.
    Forces are parts of the tension directed from A to B: the cable pulls the platform with
    -(H, V_B) and the drawing point with (H, V_A).

    Attributes:
        alpha: [rad] slope of the tangent at the drawing point A.
        beta: [rad] slope of the tangent at the attachment point B.
        beta0: [rad] slope of the chord from A to B.
        dbeta: [rad] beta - beta0, without the loss of digits of that difference.
        V_A: [N] vertical force at A.
        V_B: [N] vertical force at B.
        T_A: [N] tension at the drawing point A.
        T_B: [N] tension at the attachment point B.
    """

    alpha: Array
    beta: Array
    beta0: Array
    dbeta: Array
    V_A: Array
    V_B: Array
    T_A: Array
    T_B: Array


def cable_model_name(model: str) -> str:
    """Return a cable model's name as it stands in `CABLE_MODELS`.

    Whoever takes a name from a user, in Python or on a command line, takes it through this, so that
    all take the same spellings. The functions of this module are asked by those: they take a name
    as it stands.

    Args:
        model: the name, in upper or lower case.

    Raises:
        ValueError: an unknown model; the message names the known ones.
    """
    return CABLE_MODELS[cable_model_index(str(model).strip().upper())]


def cable_model_index(model: str) -> int:
    """Return the number by which the kernels know a cable model.

    Args:
        model: one of `CABLE_MODELS`.

    Raises:
        ValueError: an unknown model; the message names the known ones.
    """
    if model not in CABLE_MODELS:
        raise ValueError(f'unknown cable model "{model}"; known are {", ".join(CABLE_MODELS)}')
    return CABLE_MODELS.index(model)


def unstrained_length(
    model: str,
    Bx: ArrayLike,
    Bz: ArrayLike,
    H: ArrayLike,
    w: ArrayLike,
    EA: ArrayLike,
    order: int = 4,
) -> Array:
    """Return the unstrained length l of cables [m] (eqs. 6 to 9).

    Args:
        model: one of `CABLE_MODELS`.
        Bx: (k,) [m] horizontal distance from A to B, positive.
        Bz: (k,) [m] height of B over A.
        H: (k,) [N] horizontal tension, positive.
        w: (k,) [N/m] weight per unstrained metre; 0 gives the straight cable.
        EA: (k,) [N] axial stiffness; only the ECM uses it. May be infinite.
        order: terms of the ECM's series, O_l of the paper.

    Raises:
        ValueError: an unknown model, an argument out of range, a tension that reaches EA (the
            ECM's series diverges), a cable too slack for a finite length.
    """
    return _lengths_and_rows(model, Bx, Bz, H, w, EA, order)[..., 0]


def instantaneous_row(
    model: str,
    Bx: ArrayLike,
    Bz: ArrayLike,
    H: ArrayLike,
    w: ArrayLike,
    EA: ArrayLike,
    order: int = 4,
) -> Array:
    """Return the rows [N1, N2, N3] (k, 3) of dl/dt = N1 Bx' + N2 Bz' + N3 H' (eq. 11, Table 3).

    N1 and N2 have no unit, N3 is in m/N. The paper's row has a 0 for By' as its second entry. Near
    the vertical N1 and N3 of the ECM grow as 1/Bx; `instantaneous_row_chord` does not.

    Args:
        model: one of `CABLE_MODELS`.
        Bx: (k,) [m] horizontal distance from A to B, positive.
        Bz: (k,) [m] height of B over A.
        H: (k,) [N] horizontal tension, positive.
        w: (k,) [N/m] weight per unstrained metre; 0 gives the straight cable.
        EA: (k,) [N] axial stiffness; only the ECM uses it. May be infinite.
        order: terms of the ECM's series, O_l of the paper.

    Raises:
        ValueError: as `unstrained_length`.
    """
    return _lengths_and_rows(model, Bx, Bz, H, w, EA, order)[..., 1:]


def instantaneous_row_chord(
    model: str,
    Bx: ArrayLike,
    Bz: ArrayLike,
    T: ArrayLike,
    w: ArrayLike,
    EA: ArrayLike,
    order: int = 4,
) -> Array:
    """Return the rows [M1, M2, M3] (k, 3) of dl/dt = M1 Bx' + M2 Bz' + M3 T' (eq. 11 in T).

    The same rates as by `instantaneous_row`, with the chord tension T = H L / Bx in the place of H,
    finite up to the vertical cable. M1 and M2 have no unit, M3 is in m/N.

    Args:
        model: one of `CABLE_MODELS`.
        Bx: (k,) [m] horizontal distance from A to B, 0 included.
        Bz: (k,) [m] height of B over A.
        T: (k,) [N] chord tension, positive: the part of the tension along the chord that H implies.
        w: (k,) [N/m] weight per unstrained metre; 0 gives the straight cable.
        EA: (k,) [N] axial stiffness; only the ECM uses it. May be infinite.
        order: terms of the ECM's series, O_l of the paper.

    Raises:
        ValueError: as `unstrained_length`, and where A and B coincide.
    """
    from cdpr_drake.model.kernels import cable_models as kernels

    columns = _columns(("Bx", "w"), Bx=Bx, Bz=Bz, T=T, w=w, EA=EA)
    x, z, chord_tension = columns[:3]
    _refuse("Bx", x, (x == 0.0) & (z == 0.0), "A and B must not coincide")
    rows = _checked_rows(kernels.length_and_row_T, model, order, columns, chord_tension)
    _refuse_infinite(rows, chord_tension, "T")
    return rows[..., 1:]


def profile(
    x: ArrayLike, Bx: ArrayLike, Bz: ArrayLike, H: ArrayLike, w: ArrayLike, model: str = "ECM"
) -> Array:
    """Return the height z(x) [m] of cables over their drawing points (eq. 2).

    Args:
        x: [m] horizontal distance from A, from 0 to Bx; broadcasts with the rest, so give it a
            trailing axis of its own, (n, 1), for n points on each of k cables.
        Bx: (k,) [m] horizontal distance from A to B, positive.
        Bz: (k,) [m] height of B over A.
        H: (k,) [N] horizontal tension, positive.
        w: (k,) [N/m] weight per unstrained metre.
        model: one of `CABLE_MODELS`; the ECM and CMWE share the catenary.

    Raises:
        ValueError: an unknown model, an argument out of range, a cable too slack.
    """
    from cdpr_drake.model.kernels import cable_models as kernels

    columns = _columns(x=x, Bx=Bx, Bz=Bz, H=H, w=w)
    height = _over_cables(kernels.profile_height, (cable_model_index(model),), columns)
    _refuse_infinite(height, columns[3], "H")
    return height


def cable_angles(
    Bx: ArrayLike, Bz: ArrayLike, H: ArrayLike, w: ArrayLike, model: str = "ECM"
) -> CableEnds:
    """Return the slopes of cables and the forces at both ends (eqs. 4 and 5).

    Args:
        Bx: (k,) [m] horizontal distance from A to B, positive.
        Bz: (k,) [m] height of B over A.
        H: (k,) [N] horizontal tension, positive.
        w: (k,) [N/m] weight per unstrained metre.
        model: one of `CABLE_MODELS`; the ECM and CMWE share the catenary, the SCMWE's is the
            parabola, the SLSM's the chord.

    Raises:
        ValueError: an unknown model, an argument out of range, a cable too slack.
    """
    from cdpr_drake.model.kernels import cable_models as kernels

    columns = _columns(Bx=Bx, Bz=Bz, H=H, w=w)
    ends = _over_cables(kernels.cable_ends, (cable_model_index(model),), columns, 6)
    horizontal = columns[2]
    _refuse_infinite(ends, horizontal, "H")
    V_A, V_B = ends[..., 4], ends[..., 5]
    return CableEnds(
        alpha=ends[..., 0],
        beta=ends[..., 1],
        beta0=ends[..., 2],
        dbeta=ends[..., 3],
        V_A=V_A,
        V_B=V_B,
        T_A=np.hypot(horizontal, V_A),
        T_B=np.hypot(horizontal, V_B),
    )


def sag(Bx: ArrayLike, Bz: ArrayLike, H: ArrayLike, w: ArrayLike, model: str = "ECM") -> Array:
    """Return the sag of cables [m]: the largest vertical distance from the chord to the cable.

    Args:
        Bx: (k,) [m] horizontal distance from A to B, positive.
        Bz: (k,) [m] height of B over A.
        H: (k,) [N] horizontal tension, positive.
        w: (k,) [N/m] weight per unstrained metre.
        model: one of `CABLE_MODELS`; the ECM and CMWE share the catenary.

    Raises:
        ValueError: an unknown model, an argument out of range, a cable too slack.
    """
    from cdpr_drake.model.kernels import cable_models as kernels

    columns = _columns(Bx=Bx, Bz=Bz, H=H, w=w)
    depth = _over_cables(kernels.largest_sag, (cable_model_index(model),), columns)
    _refuse_infinite(depth, columns[2], "H")
    return depth


def horizontal_tension(
    model: str, Bx: ArrayLike, Bz: ArrayLike, T_A: ArrayLike, w: ArrayLike
) -> tuple[Array, NDArray[np.bool_]]:
    """Return H (k,) [N], and which cables are slack, from the tension at the drawing point.

    The pose takes the place of the measured tangent of eq. (16): H = T_A cos(alpha), alpha by the
    model. A cable is slack if T_A is less than it needs to hang; its H is then w Bx / 20.

    Args:
        model: one of `CABLE_MODELS`: the catenary for ECM and CMWE, the parabola for SCMWE, the
            chord for SLSM.
        Bx: (k,) [m] horizontal distance from A to B, positive.
        Bz: (k,) [m] height of B over A.
        T_A: (k,) [N] tension at the drawing point, not negative.
        w: (k,) [N/m] weight per unstrained metre.

    Raises:
        ValueError: an unknown model or an argument out of range.
    """
    from cdpr_drake.model.kernels import cable_models as kernels

    columns = _columns(Bx=Bx, Bz=Bz, T_A=T_A, w=w)
    if cable_model_index(model) == kernels.SLSM:
        columns = (*columns[:3], np.zeros_like(columns[3]))
    is_catenary = model in ("ECM", "CMWE")
    kernel = kernels.horizontal_force_catenary if is_catenary else kernels.horizontal_force_parabola
    result = _over_cables(kernel, (), columns, 2)
    return result[..., 0], result[..., 1] != 0.0


def _lengths_and_rows(
    model: str,
    Bx: ArrayLike,
    Bz: ArrayLike,
    H: ArrayLike,
    w: ArrayLike,
    EA: ArrayLike,
    order: int,
) -> Array:
    from cdpr_drake.model.kernels import cable_models as kernels

    columns = _columns(Bx=Bx, Bz=Bz, H=H, w=w, EA=EA)
    x, z, horizontal = columns[:3]
    chord_tension = horizontal * np.hypot(x, z) / x
    rows = _checked_rows(kernels.length_and_row, model, order, columns, chord_tension)
    _refuse_infinite(rows, horizontal, "H")
    return rows


def _checked_rows(
    kernel: Callable[..., Any],
    model: str,
    order: int,
    columns: tuple[Array, ...],
    chord_tension: Array,
) -> Array:
    """Return [l, row] of a kernel for each cable, where the ECM's series converges."""
    from cdpr_drake.model.kernels import cable_models as kernels

    head = (cable_model_index(model), _order(order))
    Bx, Bz, _, w, EA = columns
    if model == "ECM":
        tension = _over_cables(kernels.largest_tension, (), (Bx, Bz, chord_tension, w))
        text = "reaches EA, where the series of eq. (6) diverges"
        _refuse("largest tension [N]", tension, np.greater_equal(tension, EA), text)
    return _over_cables(kernel, head, columns, 4)


def _columns(
    not_negative: tuple[str, ...] = _NOT_NEGATIVE, **values: ArrayLike
) -> tuple[Array, ...]:
    """Return the values as arrays of one shape, each within the range its name implies."""
    arrays = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in values.values()))
    for name, array in zip(values, arrays, strict=True):
        finite = ~np.isnan(array) if name == "EA" else np.isfinite(array)
        _refuse(name, array, ~finite, "must be finite")
        if name in not_negative:
            _refuse(name, array, array < 0.0, "must not be negative")
        elif name in _POSITIVE:
            _refuse(name, array, array <= 0.0, "must be positive")
    return arrays


def _refuse(name: str, array: Array, bad: Any, text: str) -> None:
    """Raise a ValueError that names the first bad value and its place."""
    if not bad.any():
        return
    place = tuple(int(i) for i in np.argwhere(bad)[0])
    index = f"[{', '.join(map(str, place))}]" if place else ""
    raise ValueError(f"{name}{index} = {array[place]:.6g}: {text}")


def _refuse_infinite(values: Array, tension: Array, name: str) -> None:
    bad: Any = ~np.isfinite(values)
    if values.ndim > tension.ndim:
        bad = bad.any(axis=-1)
    _refuse(name, tension, bad, "the cable is too slack for numbers of this size")


def _order(order: int) -> int:
    try:
        number = operator.index(order)
    except TypeError:
        number = 0
    if number < 1:
        raise ValueError(f"order = {order!r}: must be a whole number, at least 1")
    return number


def _over_cables(
    kernel: Callable[..., Any], head: tuple[int, ...], columns: tuple[Array, ...], *width: int
) -> Array:
    """Return what a scalar kernel returns for each cable, along a last axis of a given width."""
    with np.errstate(over="ignore", invalid="ignore"):  # refused by the caller, by name
        cables = zip(*(column.ravel().tolist() for column in columns), strict=True)
        rows = [kernel(*head, *cable) for cable in cables]
    return np.array(rows, dtype=float).reshape((*columns[0].shape, *width))
