"""What a simulation does with a predicted mode: its amplitude, period by period."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, Diagram

from cdpr_drake.diagrams import make_simulator
from cdpr_drake.diagrams.step import StepWarning, choose_step
from cdpr_drake.study.modes import DEADBEAT
from cdpr_drake.study.sampled import OnePeriodMap, one_period_map
from cdpr_drake.study.state_space import Array

LARGEST_STEP = 2.5e-3
"""Of the integrator [s]: coarser ones damp a platform's modes visibly."""

NEUTRAL_DISTANCE = 1e-7
"""Eigenvalues of a period's map this close to 1 are neutral."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedMode:
    """A mode of the one-period map followed through a simulation.

    Attributes:
        time: (n,) [s] since the start, one entry a period.
        amplitude: (n,) of the mode, 1 at the start.
        predicted: ln(z) / T [1/s] of the mode; its real part is the rate of growth.
    """

    time: Array
    amplitude: Array
    predicted: complex

    @property
    def growth(self) -> float:
        """Rate of growth [1/s] that fits the amplitude best; negative if it decays."""
        return float(np.polyfit(self.time, np.log(self.amplitude), 1)[0])


def simulate_modes(
    diagram: Diagram,
    context: Context,
    duration: float,
    *,
    which: Sequence[int] = (0,),
    size: float = 1e-5,
    max_step: float | None = None,
) -> tuple[SimulatedMode, ...]:
    """Return how modes of a sampled loop grow or decay in a nonlinear simulation.

    The loop starts from its rest, moved along the modes' shapes. The amplitude of a mode is the
    part of the state along it, by its left eigenvector, to which no other mode contributes.

    Args:
        diagram: a sampled loop.
        context: its rest, at an instant at which samples are taken; it is left unchanged.
        duration: [s].
        which: of the modes that are not neutral, 0 being the one of slowest decay.
        size: largest change of the platform's coordinates at the start, by each [m, rad].
        max_step: step of the integrator [s]; if None, 2.5 ms, or less where the robot's modes need
            it: coarser steps damp lightly damped modes by themselves.

    Raises:
        ValueError: a step that is not positive and finite.
        LinearizationError: the diagram is not a sampled loop of the kind `one_period_map` takes.
    """
    period_map = one_period_map(diagram, context)
    values, left, right = _eigen(period_map)
    values, left, right = values[list(which)], left[:, list(which)], right[:, list(which)]
    own = diagram.CreateDefaultContext()
    own.SetTimeStateAndParametersFrom(context)
    diagram.FixInputPortsFrom(diagram, context, own)
    rest = _state(own)
    pose = [i for i, name in enumerate(period_map.states) if "platform/" in name][:6]
    shapes = right * size / np.abs(right[pose]).max(axis=0)
    _set_state(own, rest + shapes.real.sum(axis=1))
    step = choose_step(diagram, own, max_step, LARGEST_STEP)
    if step.doubt:
        warnings.warn(step.doubt, StepWarning, stacklevel=2)
    simulator = make_simulator(diagram, own, max_step=step)
    simulator.Initialize()
    start, T = context.get_time(), period_map.period
    count = round(duration / T)
    amplitude = np.empty((count + 1, len(values)))
    for i in range(count + 1):
        simulator.AdvanceTo(start + i * T)
        amplitude[i] = np.abs(left.conj().T @ (_state(own) - rest))
    amplitude /= amplitude[0]
    time: Array = T * np.arange(count + 1, dtype=np.float64)
    return tuple(
        SimulatedMode(time=time, amplitude=a, predicted=complex(np.log(z)) / T)
        for z, a in zip(values, amplitude.T, strict=True)
    )


def _eigen(period_map: OnePeriodMap) -> tuple[Any, Any, Any]:
    """Return eigenvalues, left and right eigenvectors of the modes that are not neutral."""
    from scipy.linalg import eig

    values, left, right = eig(period_map.matrix, left=True, right=True)
    kept = (np.abs(values - 1.0) > NEUTRAL_DISTANCE) & (np.abs(values) > DEADBEAT)
    upper = np.flatnonzero(kept & (values.imag >= 0.0))
    order = upper[np.argsort(-np.abs(values[upper]))]
    return values[order], left[:, order], right[:, order]


def _state(context: Context) -> Array:
    discrete = context.get_discrete_state()
    parts = [discrete.get_vector(g).CopyToVector() for g in range(discrete.num_groups())]
    return np.concatenate([context.get_continuous_state_vector().CopyToVector(), *parts])


def _set_state(context: Context, state: Array) -> None:
    n = context.num_continuous_states()
    context.SetContinuousState(state[:n])
    for group in range(context.num_discrete_state_groups()):
        size = context.get_discrete_state(group).size()
        context.SetDiscreteState(group, state[n : n + size])
        n += size
