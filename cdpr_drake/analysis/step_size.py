"""Which step of the integrator a robot's modes allow."""

from __future__ import annotations

import cmath
from dataclasses import dataclass

from cdpr_drake.study.modes import Mode, Modes

LARGEST_ERROR = 0.1
"""Part of its own motion by which a step may get the fastest mode wrong."""


class StepWarning(UserWarning):
    """The integrator's step is too coarse for a mode of the robot."""


@dataclass(frozen=True, kw_only=True)
class StepLimit:
    """The largest step that does justice to all modes.

    Attributes:
        step: [s].
        mode: the one that sets the limit.
    """

    step: float
    mode: Mode


def step_error(eigenvalue: complex, step: float) -> float:
    """Return how wrong one Runge-Kutta 3 step gets a mode, as a part of the mode's own motion.

    |R(z) - e^z| / |z| with z = step times eigenvalue and R(z) = 1 + z + z^2/2 + z^3/6: about
    |z|^3 / 24 where steps are small, and above 1 near where the method becomes unstable.

    Args:
        eigenvalue: of the mode [1/s].
        step: of the integrator [s].
    """
    z = complex(eigenvalue) * step
    if z == 0.0:
        return 0.0
    return abs(1.0 + z + z**2 / 2.0 + z**3 / 6.0 - cmath.exp(z)) / abs(z)


def step_limit(modes: Modes, error: float = LARGEST_ERROR) -> StepLimit:
    """Return the largest step of the default integrator that does justice to a robot's modes.

    Args:
        modes: of the continuous system, e.g. `platform_modes(robot, pose, "controlled")`.
        error: the part of its own motion by which a step may get a mode wrong.

    Raises:
        ValueError: no mode moves, or the error is not positive.
    """
    if not error > 0.0:
        raise ValueError(f"the error must be positive, got {error}")
    limits = [(_largest(m.eigenvalue, error), m) for m in modes.modes if not m.is_neutral]
    if not limits:
        raise ValueError("a step is limited by modes that move, and there are none")
    step, mode = min(limits, key=lambda limit: limit[0])
    return StepLimit(step=step, mode=mode)


def _largest(eigenvalue: complex, error: float) -> float:
    """Return the step from which on the error is above the one allowed, by bisection."""
    low, high = 0.0, 1.0 / abs(eigenvalue)
    while step_error(eigenvalue, high) <= error:
        low, high = high, 2.0 * high
    for _ in range(50):
        middle = 0.5 * (low + high)
        if step_error(eigenvalue, middle) <= error:
            low = middle
        else:
            high = middle
    return low
