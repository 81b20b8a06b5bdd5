"""A linear model with named states, inputs and outputs."""

from __future__ import annotations

import importlib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

EQUILIBRIUM_TOLERANCE = 1e-6
"""Largest |dx/dt| at a point taken for an equilibrium, as in Drake's own `Linearize`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StateSpace:
    """dx/dt = f0 + A (x - x0) + B (u - u0), y = y0 + C (x - x0) + D (u - u0) at one point.

    Attributes:
        A: (n, n) [1/s, in the states' units].
        B: (n, m).
        C: (p, n).
        D: (p, m).
        states: n names.
        inputs: m names, each beginning with its port's.
        outputs: p names, each beginning with its port's.
        time: [s] the time of the point.
        x0: (n,) state.
        u0: (m,) input.
        y0: (p,) output.
        derivatives: f0 (n,), zero at an equilibrium.
        by_differences: names of the blocks that know no AutoDiffXd, linearised by differences.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    time: float
    x0: Array
    u0: Array
    y0: Array
    derivatives: Array
    by_differences: tuple[str, ...] = ()

    @property
    def is_equilibrium(self) -> bool:
        """Whether the state stays where it is: no |dx/dt| above 1e-6, as Drake has it."""
        return bool(np.all(np.abs(self.derivatives) <= EQUILIBRIUM_TOLERANCE))

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Eigenvalues of A (n,) [1/s]."""
        return np.linalg.eigvals(self.A).astype(complex)

    def select(
        self, inputs: Iterable[str] | None = None, outputs: Iterable[str] | None = None
    ) -> StateSpace:
        """Return the model with some of its inputs and outputs, in the order asked for.

        Args:
            inputs: names of ports or of single inputs; all if None.
            outputs: names of ports or of single outputs; all if None.

        Raises:
            KeyError: there is no such input or output.
        """
        i = _chosen(self.inputs, inputs)
        o = _chosen(self.outputs, outputs)
        return replace(
            self,
            B=self.B[:, i],
            C=self.C[o],
            D=self.D[np.ix_(o, i)],
            inputs=tuple(self.inputs[k] for k in i),
            outputs=tuple(self.outputs[k] for k in o),
            u0=self.u0[i],
            y0=self.y0[o],
        )

    def to_drake(self) -> Any:
        """Return the model as a pydrake LinearSystem, in deviations from the point."""
        from pydrake.systems.primitives import LinearSystem

        return LinearSystem(self.A, self.B, self.C, self.D)

    def to_scipy(self) -> Any:
        """Return the model as a scipy.signal.StateSpace, in deviations from the point."""
        from scipy.signal import StateSpace as ScipyStateSpace

        return ScipyStateSpace(self.A, self.B, self.C, self.D)

    def to_control(self) -> Any:
        """Return the model as python-control's `ss` with the same names, "/" and "[]" kept.

        Raises:
            ImportError: the package `control` is not installed.
        """
        try:
            control = importlib.import_module("control")
        except ImportError:
            raise ImportError(
                "to_control needs the package `control` (pip install control); "
                "to_scipy and to_drake do without"
            ) from None
        return control.ss(
            self.A, self.B, self.C, self.D,
            states=list(self.states), inputs=list(self.inputs), outputs=list(self.outputs),
        )  # fmt: skip

    def __repr__(self) -> str:
        n, m, p = len(self.states), len(self.inputs), len(self.outputs)
        where = "" if self.is_equilibrium else ", not at an equilibrium"
        return f"<StateSpace: {n} states, {m} inputs, {p} outputs at t = {self.time:g} s{where}>"


def matching(names: tuple[str, ...], wanted: str) -> list[int]:
    """Return where in `names` a port or a single entry is, by the name `wanted`.

    Args:
        names: of all entries, in order.
        wanted: a whole name, or that of the port or block before "/" or "[".
    """
    starts = (f"{wanted}/", f"{wanted}[")
    return [i for i, name in enumerate(names) if name == wanted or name.startswith(starts)]


def _chosen(names: tuple[str, ...], wanted: Iterable[str] | None) -> list[int]:
    if wanted is None:
        return list(range(len(names)))
    chosen: list[int] = []
    for name in [wanted] if isinstance(wanted, str) else wanted:
        found = matching(names, name)
        if not found:
            raise KeyError(f'no "{name}" among {", ".join(names)}')
        chosen += found
    return chosen
