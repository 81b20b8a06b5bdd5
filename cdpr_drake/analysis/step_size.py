"""Which step of the integrator a robot's modes allow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cdpr_drake.diagrams.step import StepWarning
from cdpr_drake.model.step_size import LARGEST_ERROR, largest_steps, step_error
from cdpr_drake.study.modes import Mode, Modes

__all__ = ["LARGEST_ERROR", "StepLimit", "StepWarning", "step_error", "step_limit"]


@dataclass(frozen=True, kw_only=True)
class StepLimit:
    """The largest step that does justice to all modes.

    Attributes:
        step: [s].
        mode: the one that sets the limit.
    """

    step: float
    mode: Mode


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
    moving = [mode for mode in modes.modes if not mode.is_neutral]
    if not moving:
        raise ValueError("a step is limited by modes that move, and there are none")
    steps = largest_steps([mode.eigenvalue for mode in moving], error)
    first = int(np.argmin(steps))
    return StepLimit(step=float(steps[first]), mode=moving[first])
