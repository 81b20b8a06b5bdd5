"""Modes: eigenvalues with frequency, damping, time constant and the states that take part, by name.

Participation factors (Perez-Arriaga, Verghese, Schweppe, IEEE Trans. PAS 1982) are the products of
left and right eigenvectors, state by state; unlike mode shapes they do not depend on units. Real
parts that agree make a cluster that only has a common invariant subspace; its factors are then
those of nearby eigenvectors and good for names, not for digits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cdpr_drake.model.signals import ERROR, POSE, TWIST
from cdpr_drake.study.sampled import OnePeriodMap
from cdpr_drake.study.state_space import Array, StateSpace

Complex = NDArray[np.complex128]

NEUTRAL = 1e-6
"""Rates below this [1/s] count as zero: neither growing nor decaying."""

DEADBEAT = 1e-6
"""Eigenvalues of a period's map below this have died out within the period."""

ROUND_OFF = 1e-7
"""Imaginary parts below this share of an eigenvalue are the round-off of a repeated real one.

So are those that would take months to go round: two zeros that round-off made a pair stay two.
"""


@dataclass(frozen=True, kw_only=True)
class Mode:
    """One real eigenvalue, or one pair of complex ones.

    Attributes:
        eigenvalue: s [1/s], the one with positive imaginary part; for a sampled loop ln(z) / T.
        z: of the one-period map, None for a continuous model.
        frequency: undamped natural frequency |s| / 2 pi [Hz], 0 for a real eigenvalue. A sampled
            loop shows frequencies above 1 / 2 T, which decay within a few periods, folded down.
        damping: ratio -Re(s) / |s|; 1 for a real eigenvalue that decays, NaN for a neutral one.
        time_constant: -1 / Re(s) [s]; negative if it grows, infinite if it does neither.
        participation: share of each state (n,), adding up to 1.
        shape: right eigenvector (n,), largest entry 1.
    """

    eigenvalue: complex
    z: complex | None
    frequency: float
    damping: float
    time_constant: float
    participation: Array
    shape: Complex

    @property
    def is_neutral(self) -> bool:
        """Whether it neither grows nor decays, by less than 1e-6 1/s."""
        return abs(self.eigenvalue) < NEUTRAL

    @property
    def is_stable(self) -> bool:
        """Whether it decays."""
        return self.eigenvalue.real < 0.0 and not self.is_neutral

    @property
    def grows(self) -> bool:
        """Whether it grows, by more than 1e-6 1/s: an undamped oscillation does not."""
        return self.eigenvalue.real > NEUTRAL


@dataclass(frozen=True, kw_only=True)
class Modes:
    """The modes of a linear model, slowest decay first; prints as a table.

    Attributes:
        modes: the modes.
        states: names of the n states.
        period: T [s] of a sampled loop, None for a continuous model.
        deadbeat: how many eigenvalues of a sampled loop are zero: gone within a period.
    """

    modes: tuple[Mode, ...]
    states: tuple[str, ...]
    period: float | None = None
    deadbeat: int = 0

    def __len__(self) -> int:
        return len(self.modes)

    def __getitem__(self, index: int) -> Mode:
        return self.modes[index]

    @property
    def neutral(self) -> tuple[Mode, ...]:
        """The modes that neither grow nor decay."""
        return tuple(mode for mode in self.modes if mode.is_neutral)

    @property
    def unstable(self) -> tuple[Mode, ...]:
        """The modes that grow."""
        return tuple(mode for mode in self.modes if mode.grows)

    def participants(self, mode: Mode, count: int = 3) -> list[tuple[str, float]]:
        """Return the groups of states that take part most, with their share.

        States that differ only in their number, one for each cable, count together; so do a
        coordinate of the platform and its velocity.

        Args:
            mode: one of the modes.
            count: how many groups at most; those below 5 % are left out.
        """
        groups: dict[str, float] = {}
        for name, share in zip(self.states, mode.participation, strict=True):
            group = _group(name, self.states)
            groups[group] = groups.get(group, 0.0) + float(share)
        ranked = sorted(groups.items(), key=lambda item: -item[1])
        return [(name, share) for name, share in ranked[:count] if share >= 0.05]

    def name(self, mode: Mode) -> str:
        """Return a short name: what the mode is, by the states that take part most.

        Args:
            mode: one of the modes.
        """
        if mode.is_neutral:
            return "neutral"
        group = self.participants(mode, 1)
        if not group:
            return "mixed"
        return "/".join(group[0][0].split("/")[-2:])

    def __str__(self) -> str:
        head = ["eigenvalue [1/s]", "f [Hz]", "damping", "tau [s]", "states that take part"]
        widths = (19, 8, 9, 8)
        lines = ["".join(f"{h:<{w}}" for h, w in zip(head, (*widths, 0), strict=True))]
        for mode in self.modes:
            cells = self._cells(mode)
            line = "".join(f"{c:<{w}}" for c, w in zip(cells, widths, strict=False))
            lines.append((line + _fitted(self.participants(mode), 79 - sum(widths))).rstrip())
        if self.deadbeat:
            lines.append(f"and {self.deadbeat} that end within a period of {self.period:g} s")
        return "\n".join(lines)

    def _cells(self, mode: Mode) -> tuple[str, str, str, str]:
        s = mode.eigenvalue
        if mode.is_neutral:
            return "0", "", "", "neutral"
        value = f"{s.real:.4g}" + (f" ± {s.imag:.4g}i" if s.imag else "")
        oscillates = s.imag != 0.0
        return (
            value,
            f"{mode.frequency:.3g}" if oscillates else "",
            f"{100.0 * mode.damping:.3g} %" if oscillates else "",
            f"{mode.time_constant:.3g}",
        )

    def _repr_html_(self) -> str:
        head = ("eigenvalue [1/s]", "f [Hz]", "damping", "τ [s]", "states that take part")
        rows = []
        for mode in self.modes:
            part = ", ".join(f"{n} {100 * p:.0f} %" for n, p in self.participants(mode))
            cells = "".join(f"<td>{escape(c)}</td>" for c in (*self._cells(mode), part))
            color = ' style="color:#b00"' if mode.grows else ""
            rows.append(f"<tr{color}>{cells}</tr>")
        titles = "".join(f"<th>{h}</th>" for h in head)
        tail = ""
        if self.deadbeat:
            tail = f"<p>and {self.deadbeat} that end within a period of {self.period:g} s</p>"
        return f"<table><tr>{titles}</tr>{''.join(rows)}</table>{tail}"


def modes(model: StateSpace | OnePeriodMap | ArrayLike) -> Modes:
    """Return the modes of a linear model, slowest decay first.

    Args:
        model: a StateSpace, a OnePeriodMap (its eigenvalues z become s = ln(z) / T), or a matrix A
            (n, n) of dx/dt = A x.

    Raises:
        ValueError: the matrix is not square, or not finite.
    """
    if isinstance(model, OnePeriodMap):
        return modes_of(model.matrix, model.states, model.period)
    if isinstance(model, StateSpace):
        return modes_of(model.A, model.states)
    A = np.asarray(model, float)
    if A.ndim != 2 or A.shape[0] != A.shape[1]:
        raise ValueError(f"modes need a square matrix, got {A.shape}")
    return modes_of(A, tuple(f"x[{i + 1}]" for i in range(len(A))))


def modes_of(A: Array, states: tuple[str, ...], period: float | None = None) -> Modes:
    """Return the modes of a matrix whose states have names.

    Args:
        A: (n, n) of dx/dt = A x, or of one period's z[n + 1] = A z[n].
        states: n names.
        period: T [s] of a sampled system.

    Raises:
        ValueError: the matrix is not finite.
    """
    if not np.all(np.isfinite(A)):
        raise ValueError("modes need a matrix of finite numbers")
    values, shapes, shares = _eigen(A)
    found = []
    deadbeat = 0
    for i, value in enumerate(values):
        if period is not None and abs(value) < DEADBEAT:
            deadbeat += 1
            continue
        s = complex(value) if period is None else complex(np.log(value)) / period
        if abs(s.imag) <= max(ROUND_OFF * abs(s), NEUTRAL):
            s = complex(s.real)
        elif value.imag < 0.0:
            continue
        found.append(_mode(s, None if period is None else complex(value), shapes[:, i], shares[i]))
    found.sort(key=lambda mode: (-mode.eigenvalue.real, mode.eigenvalue.imag))
    return Modes(modes=tuple(found), states=states, period=period, deadbeat=deadbeat)


def _mode(s: complex, z: complex | None, shape: Complex, share: Array) -> Mode:
    oscillates = s.imag != 0.0
    neutral = abs(s) < NEUTRAL
    return Mode(
        eigenvalue=s,
        z=z,
        frequency=abs(s) / (2.0 * math.pi) if oscillates else 0.0,
        damping=math.nan if neutral else -s.real / abs(s),
        time_constant=math.inf if neutral or s.real == 0.0 else -1.0 / s.real,
        participation=share,
        shape=shape / shape[np.argmax(np.abs(shape))],
    )


def _eigen(A: Array) -> tuple[Complex, Complex, Array]:
    """Return eigenvalues (n,), right eigenvectors (n, n), participation (n, n) mode by state."""
    from scipy.linalg import eig, matrix_balance

    # Balancing keeps eigenvectors of badly scaled states (radians, newtons) accurate.
    balanced, scale = matrix_balance(A, permute=False)
    values, left, right = eig(balanced, left=True, right=True)
    shares = np.abs(left.conj() * right).T
    total = shares.sum(axis=1, keepdims=True)
    shares = np.where(total > 0.0, shares / np.where(total > 0.0, total, 1.0), 1.0 / len(A))
    return values, scale @ right, shares


def _group(name: str, states: tuple[str, ...]) -> str:
    """Return the group a state counts with: that of all cables, or of coordinate and velocity."""
    block, _, entry = name.split("[")[0].rpartition("/")
    if entry in TWIST:
        i = TWIST.index(entry)
        for coordinate in (POSE[i], ERROR[i]):
            if f"{block}/{coordinate}" in states:
                return f"{block}/{coordinate}"
    return f"{block}/{entry}" if block else entry


def _fitted(participants: list[tuple[str, float]], width: int) -> str:
    """Return the participants in as many characters, paths shortened from the left."""
    parts: list[str] = []
    for name, share in participants:
        short = "/".join(name.split("/")[-2:])
        text = f"{short} {100 * share:.0f}%"
        if len(", ".join([*parts, text])) > width:
            break
        parts.append(text)
    return ", ".join(parts)


def named(modes_found: Modes) -> list[dict[str, Any]]:
    """Return the modes as plain numbers and texts, e.g. for JSON.

    Args:
        modes_found: from `modes`.
    """
    return [
        {
            "real": mode.eigenvalue.real,
            "imag": mode.eigenvalue.imag,
            "frequency": mode.frequency,
            "damping": None if mode.is_neutral else mode.damping,
            "time_constant": None if mode.is_neutral else mode.time_constant,
            "name": modes_found.name(mode),
            "states": dict(modes_found.participants(mode)),
        }
        for mode in modes_found.modes
    ]
