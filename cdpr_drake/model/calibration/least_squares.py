"""Nonlinear least squares in double precision, with the covariance of what it finds.

Written for bundles of images: the parameters are moved, not added to, each block of residuals
depends on few of them, and most of them are poses that go with one view only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from cdpr_drake.errors import CalibrationError
from cdpr_drake.model.rotations import Array

State = TypeVar("State")
Block = tuple[Array, Array, NDArray[np.intp]]
"""Residuals (m,) over their standard deviations, their derivatives (m, q), the q parameters."""

MOST_STEPS = 100
CONVERGED = 1e-9  # of a step, in standard deviations of each parameter alone
ROUNDING = 1e-12  # of the cost, promised by a step that rounding hides
SMALLEST = 1e-18  # the same where the cost is zero
LEAST_INFORMATION = 1e-11  # smallest eigenvalue of the normal matrix scaled to a unit diagonal


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit(Generic[State]):
    """What least squares found.

    Attributes:
        state: where the residuals are least.
        covariance: (s, s), of the shared parameters, as the residuals' standard deviations tell it:
            of noise and what is fixed together, where both are in these.
        cost: sum of squares of the residuals.
        freedom: number of residuals less the parameters: what the cost should be, on average.
    """

    state: State
    covariance: Array
    cost: float
    freedom: int


def minimise(
    state: State,
    blocks: Callable[[State], Iterable[Block]],
    move: Callable[[State, Array], State],
    names: Sequence[str],
    shared: int,
) -> Fit[State]:
    """Return the state of least squares, by Levenberg and Marquardt's method.

    Args:
        state: where to start.
        blocks: gives the residuals at a state.
        move: gives a state moved by a step (p,).
        names: of the p parameters, for errors.
        shared: the first s parameters; the others are in sixes, of poses that no residual ties to
            each other, and are eliminated from the equations.

    Raises:
        CalibrationError: the residuals do not determine a parameter, or there is no convergence.
    """
    size, damping = len(names), 1e-6
    N, g, cost, count = normal_equations(blocks(state), size)
    for _ in range(MOST_STEPS):
        scale = _scale(N, names)
        scaled, slope = N / np.outer(scale, scale), g / scale
        step = _Reduced(scaled + damping * np.eye(size), shared, names).solve(slope)
        promised = float(step @ slope)
        if np.abs(step).max() < CONVERGED or promised < ROUNDING * cost + SMALLEST:
            of_shared = scale[:shared]
            covariance = _Reduced(scaled, shared, names).covariance()
            covariance /= np.outer(of_shared, of_shared)
            return Fit(state=state, covariance=covariance, cost=cost, freedom=count - size)
        trial = move(state, step / scale)
        new = normal_equations(blocks(trial), size)
        if new[2] <= cost:
            state, (N, g, cost, _), damping = trial, new, max(0.1 * damping, 1e-12)
        else:
            damping *= 10.0
    raise CalibrationError(
        f"no convergence in {MOST_STEPS} steps: the measurements contradict each other, or are "
        "too few"
    )


class _Reduced:
    """Normal equations, of a unit diagonal, from which the poses in sixes are eliminated."""

    def __init__(self, N: Array, shared: int, names: Sequence[str]) -> None:
        self._shared, self._names = shared, names
        count = (len(N) - shared) // 6
        every = np.arange(count)
        self._across = N[:shared, shared:].reshape(shared, count, 6).transpose(1, 0, 2)
        self._own = N[shared:, shared:].reshape(count, 6, count, 6)[every, :, every, :]
        least = np.linalg.eigvalsh(self._own)[:, 0]
        if np.any(least < LEAST_INFORMATION):
            raise self._undetermined(shared + 6 * int(np.argmin(least)))
        self._back = np.linalg.solve(self._own, self._across.transpose(0, 2, 1))
        self._left = N[:shared, :shared] - np.sum(self._across @ self._back, axis=0)

    def solve(self, g: Array) -> Array:
        """Return the step (p,) of a right-hand side `g` (p,)."""
        own = g[self._shared :].reshape(-1, 6, 1)
        alone = np.linalg.solve(self._own, own)
        step = np.linalg.solve(
            self._left, g[: self._shared] - np.sum(self._across @ alone, axis=0)[:, 0]
        )
        return np.concatenate([step, (alone[:, :, 0] - self._back @ step).ravel()])

    def covariance(self) -> Array:
        """Return the covariance (s, s) of the shared parameters."""
        values, vectors = np.linalg.eigh(self._left)
        if values[0] < LEAST_INFORMATION:
            raise self._undetermined(int(np.argmax(np.abs(vectors[:, 0]))))
        inverse: Array = (vectors / values) @ vectors.T
        return inverse

    def _undetermined(self, index: int) -> CalibrationError:
        return CalibrationError(f"the measurements do not determine {self._names[index]}")


def normal_equations(blocks: Iterable[Block], size: int) -> tuple[Array, Array, float, int]:
    """Return N (p, p) and g (p,) of the equations N d = g, the cost, and the number of residuals.

    Args:
        blocks: the residuals.
        size: number p of the parameters.
    """
    N, g, cost, count = np.zeros((size, size)), np.zeros(size), 0.0, 0
    for r, J, columns in blocks:
        N[np.ix_(columns, columns)] += J.T @ J
        g[columns] -= J.T @ r
        cost += float(r @ r)
        count += r.size
    return N, g, cost if np.isfinite(cost) else np.inf, count


def _scale(N: Array, names: Sequence[str]) -> Array:
    """Return what scales the normal matrix to a unit diagonal."""
    diagonal = np.diag(N)
    if not np.all(np.isfinite(diagonal)):
        raise CalibrationError(
            "the measurements cannot be explained at all: a point is behind a camera"
        )
    if not np.all(diagonal > 0.0):
        raise CalibrationError(f"nothing depends on {names[int(np.argmin(diagonal))]}")
    return np.sqrt(diagonal)
