"""Sampled loops, exactly: the Jacobian of one period, with the continuous plant in between.

A sampled loop is a continuous flow between instants at which samples are taken and held values
change. Near a rest, with the state z = [x; d] of continuous and discrete states,

    dx/dt = A x + E d between events,   d <- G z for the blocks whose event it is,

so that a period is a product of matrix exponentials and updates: exact for any latency, as no
approximation of the delay is made. Updates at the same instant all read the state before it.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, Diagram

from cdpr_drake.diagrams.blocks import blocks, continuous_state_names, discrete_state_names
from cdpr_drake.errors import LinearizationError
from cdpr_drake.study.first_order import first_order
from cdpr_drake.study.linear import LinearizationWarning, warn_on_ramp
from cdpr_drake.study.state_space import EQUILIBRIUM_TOLERANCE, Array
from cdpr_drake.study.twin import open_ports_named, twin_of, value_and_gradient

SAME_INSTANT = 1e-9
"""Events closer than this share of a period are taken for simultaneous."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OnePeriodMap:
    """z -> M z over one period, from just before a sample is taken to just before the next.

    Attributes:
        matrix: M (n, n).
        period: T [s].
        states: n names, continuous states first, then discrete ones.
        drift: (n,) change of the state over a period at the point itself, zero at a rest.
        by_differences: names of the blocks that know no AutoDiffXd, linearised by differences.
    """

    matrix: Array
    period: float
    states: tuple[str, ...]
    drift: Array
    by_differences: tuple[str, ...] = ()

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Eigenvalues z of M (n,); inside the unit circle what decays."""
        return np.linalg.eigvals(self.matrix).astype(complex)

    @property
    def is_equilibrium(self) -> bool:
        """Whether the state stays where it is: no change above 1e-6 in a period."""
        return bool(np.all(np.abs(self.drift) <= EQUILIBRIUM_TOLERANCE))

    def __repr__(self) -> str:
        return f"<OnePeriodMap: {len(self.states)} states, period {self.period:g} s>"


@dataclass(frozen=True, kw_only=True, eq=False)
class HybridModel:
    """A sampled loop's linear pieces about a point.

    Attributes:
        A: (n, n) [1/s].
        E: (n, m) how discrete states drive the continuous ones.
        events: (offset [s] in the period, rows of d that change, their values (rows, n + m)).
        period: T [s].
        states: n + m names.
        derivatives: (n,) dx/dt at the point.
        mismatch: (m,) change of d by its updates at the point.
        by_differences: names of the blocks that know no AutoDiffXd, linearised by differences.
    """

    A: Array
    E: Array
    events: tuple[tuple[float, NDArray[np.intp], Array], ...]
    period: float
    states: tuple[str, ...]
    derivatives: Array
    mismatch: Array
    by_differences: tuple[str, ...] = ()

    def map(self) -> OnePeriodMap:
        """Return the one-period map: flows and updates multiplied in the order of time."""
        n, m = self.E.shape
        M = np.eye(n + m)
        now = 0.0
        for offset, rows, update in self._merged():
            M[:n] = self._flow(offset - now) @ M
            now = offset
            M[n + rows] = update @ M
        M[:n] = self._flow(self.period - now) @ M
        drift = np.concatenate([self.period * self.derivatives, self.mismatch])
        return OnePeriodMap(
            matrix=M,
            period=self.period,
            states=self.states,
            drift=drift,
            by_differences=self.by_differences,
        )

    def flow(self, duration: float) -> Array:
        """Return (n + m, n + m): z after a time without events.

        Args:
            duration: [s].
        """
        n, m = self.E.shape
        return np.vstack([self._flow(duration), np.eye(n + m)[n:]])

    def _flow(self, duration: float) -> Array:
        """Return (n, n + m): x after a time without events."""
        from scipy.linalg import expm

        n, m = self.E.shape
        F = np.eye(n, n + m)
        if duration <= 0.0:
            return F
        held = np.flatnonzero(self.E.any(axis=0))
        A = np.zeros((n + held.size, n + held.size))
        A[:n, :n], A[:n, n:] = self.A, self.E[:, held]
        G = expm(duration * A)
        F[:, :n], F[:, n + held] = G[:n, :n], G[:n, n:]
        return F

    def _merged(self) -> list[tuple[float, NDArray[np.intp], Array]]:
        """Return the events in order, simultaneous ones as one."""
        merged: list[tuple[float, NDArray[np.intp], Array]] = []
        for offset, rows, update in sorted(self.events, key=lambda event: event[0]):
            if merged and offset - merged[-1][0] <= SAME_INSTANT * self.period:
                first, earlier, values = merged[-1]
                both = np.concatenate([earlier, rows]), np.vstack([values, update])
                merged[-1] = (first, *both)
            else:
                merged.append((offset, rows, update))
        return merged


def one_period_map(
    diagram: Diagram, context: Context, *, require_equilibrium: bool | None = None
) -> OnePeriodMap:
    """Return the exact Jacobian of one period of a sampled loop about a rest.

    The period begins with the samples, at k T. Held motor rates change where the loop's latency
    puts them, frames later too. As for `linearize` the time stands still otherwise: a gain on its
    ramp is warned of.

    Args:
        diagram: a loop with blocks of discrete state that update once a period each.
        context: its rest, from `equilibrium`.
        require_equilibrium: True raises an error if the state would not stay, False accepts it
            silently, None warns: away from a rest the Jacobian is that of the pieces, not of the
            run.

    Raises:
        LinearizationError: a block has abstract state, knows no AutoDiffXd, or updates at no or
            several rates; there is no discrete state; a required input is open; no equilibrium,
            where one is required. The message names block or port.
    """
    result = hybrid_model(diagram, context).map()
    warn_on_ramp(diagram, context.get_time(), stacklevel=3)
    if require_equilibrium is False or result.is_equilibrium:
        return result
    worst = int(np.argmax(np.abs(result.drift)))
    message = f"not at rest: {result.states[worst]} drifts by {result.drift[worst]:.3g} in a period"
    if require_equilibrium:
        raise LinearizationError(message)
    warnings.warn(message, LinearizationWarning, stacklevel=2)
    return result


def hybrid_model(diagram: Diagram, context: Context) -> HybridModel:
    """Return the linear pieces of a sampled loop about a context; see `one_period_map`.

    Args:
        diagram: the loop.
        context: its rest.

    Raises:
        LinearizationError: as for `one_period_map`.
    """
    schedule, period = _schedule(diagram)
    with open_ports_named(diagram, "one_period_map"):
        found = first_order(diagram, context, [], [], discrete=True)
    n = len(found.f[0])
    events, before, first = [], [], 0
    for block in blocks(diagram):
        sizes = block.group_sizes
        if not sizes:
            continue
        rows = first + np.arange(sum(sizes))
        state = block.context(context).get_discrete_state()
        before += [state.get_vector(group).CopyToVector() for group in range(len(sizes))]
        events += [(offset, rows, found.update[1][rows]) for offset in schedule[block.path]]
        first += rows.size
    return HybridModel(
        A=found.f[1][:, :n],
        E=found.f[1][:, n:],
        events=tuple(events),
        period=period,
        states=continuous_state_names(diagram) + discrete_state_names(diagram),
        derivatives=found.f[0],
        mismatch=found.update[0] - np.concatenate(before),
        by_differences=found.by_differences,
    )


def simulated_period_map(
    diagram: Diagram, context: Context, *, step: float = 2.5e-4, periods: int = 1
) -> Array:
    """Return the Jacobian (n, n) of a simulated period, by Drake's own simulator in AutoDiffXd.

    The independent check of `one_period_map`: events, holds and delays as Drake runs them. The
    third-order Runge-Kutta steps are fixed, since steps chosen by error control are not smooth.

    Args:
        diagram: the loop.
        context: its rest, at an instant k T at which samples are taken.
        step: of the integrator [s].
        periods: how many.

    Raises:
        LinearizationError: as for `one_period_map`.
    """
    from pydrake.autodiffutils import AutoDiffXd
    from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator_

    _, period = _schedule(diagram)
    twin = twin_of(diagram)
    if twin is None:
        raise LinearizationError("a block of the diagram does not support AutoDiffXd")
    own = twin.context(diagram, context)
    total = twin.seed(context, own, discrete=True)
    simulator = Simulator_[AutoDiffXd](twin.system, own)
    integrator = ResetIntegratorFromFlags(simulator, "runge_kutta3", AutoDiffXd(step))
    integrator.set_fixed_step_mode(True)
    simulator.Initialize()
    simulator.AdvanceTo(context.get_time() + periods * period)
    x = own.get_continuous_state_vector().CopyToVector()
    d = [own.get_discrete_state(g).CopyToVector() for g in range(len(twin.group_sizes))]
    return value_and_gradient(np.concatenate([x, *d]), total)[1]


def _schedule(diagram: Diagram) -> tuple[dict[tuple[str, ...], list[float]], float]:
    """Return when in the period each block with discrete state updates, and the period [s]."""
    found = {}
    for block in blocks(diagram):
        path, leaf = block
        if leaf.num_abstract_states():
            raise LinearizationError(f"{block} has abstract state, which has no derivative")
        if not leaf.num_discrete_state_groups():
            continue
        event = leaf.GetUniquePeriodicDiscreteUpdateAttribute()
        if event is None:
            raise LinearizationError(f"{block} has discrete state without one periodic update")
        found[path] = (event.period_sec(), event.offset_sec())
    if not found:
        raise LinearizationError(
            f'"{diagram.get_name()}" has no sampled block, so no period: use linearize'
        )
    longest = max(period for period, _ in found.values())
    schedule = {}
    for path, (period, offset) in found.items():
        count = round(longest / period)
        if abs(count * period - longest) > SAME_INSTANT * longest:
            raise LinearizationError(
                f'block "{"/".join(path)}" updates every {period:g} s, which does not divide the '
                f"longest period, {longest:g} s"
            )
        start = offset % period
        schedule[path] = [start + i * period for i in range(count)]
    return schedule, longest
