"""The integrator's step: chosen from the robot's modes, and looked at again as they change."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context, Diagram

from cdpr_drake.diagrams.blocks import Block, blocks
from cdpr_drake.errors import EquilibriumError
from cdpr_drake.model.equilibrium import state_at
from cdpr_drake.model.rest_model import rest_model
from cdpr_drake.model.rotations import Array, vector_to_pose
from cdpr_drake.model.step_size import amplification, largest_steps, step_error, suitable_steps

MAX_STEP = 0.01
"""Usual step of the fixed-step Runge-Kutta 3 integrator [s]: six to a period of CoGiRo's winches.

None is chosen above it.
"""

NEUTRAL = 1e-6
"""Rates below this [1/s] limit no step, as they count as zero in `study.modes`."""

TENSION_RISE = 1.1
"""A cable's tension has changed much when it has grown by this factor: modes are faster then."""

SHIFT, TURN = 0.05, 0.1
"""A platform has moved far by this part of its shortest cable, or by this angle [rad]."""


class StepWarning(UserWarning):
    """The integrator's step is too coarse for a mode of the robot."""


@dataclass(frozen=True, kw_only=True)
class Step:
    """The integrator's step, and why it is that.

    Attributes:
        size: [s].
        decided_by: "usual", where `MAX_STEP` does; "modes", where one of them needs less; "given",
            where somebody asked for it; "accuracy", where that decides it and this is the largest.
        eigenvalue: of the mode that allows the smallest step [1/s]; None if no mode is known.
        limit: the largest step [s] that suits that mode, if it was chosen, or that is not too
            coarse for it, if it was given.
        suitable: the step that is chosen where none is given [s].
        since: the time [s] at which a run took to it; None from the start on.

    Raises:
        ValueError: a size that is not positive and finite.
    """

    size: float = MAX_STEP
    decided_by: str = "usual"
    eigenvalue: complex | None = None
    limit: float = math.inf
    suitable: float = MAX_STEP
    since: float | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.size) and self.size > 0.0):
            raise ValueError(
                f"the integrator's step, max_step, must be positive and finite, got {self.size} s"
            )

    @property
    def mode(self) -> str:
        """The mode that allows the smallest step, in words; "" if no mode is known."""
        return "" if self.eigenvalue is None else mode_in_words(self.eigenvalue)

    @property
    def doubt(self) -> str:
        """Why the step is too coarse, in a line; "" if it is not."""
        if self.eigenvalue is None or self.size <= self.limit:
            return ""
        z = self.size * self.eigenvalue
        wrong = min(step_error(self.eigenvalue, self.size), 1.0)
        what = f"it gets {100.0 * wrong:.0f} % of its motion wrong"
        if z.real <= 0.0 and abs(amplification(z)) > 1.0:
            what = "in such steps it grows without end"
        when = "" if self.since is None else f" from {self.since:.3g} s on"
        return (
            f"the integrator's step of {1e3 * self.size:g} ms is too coarse{when} for {self.mode}: "
            f"{what}; {_floored(1e3 * self.suitable):g} ms would do"
        )


def mode_in_words(eigenvalue: complex) -> str:
    """Return a mode as part of a sentence: by its frequency, or by its rate if it has none.

    Args:
        eigenvalue: of the mode [1/s].
    """
    if abs(eigenvalue.imag) > 1e-6 * abs(eigenvalue):
        return f"a mode at {abs(eigenvalue) / (2.0 * math.pi):.3g} Hz"
    grows = "grows" if eigenvalue.real > 0.0 else "decays"
    rate = abs(eigenvalue.real)
    return f"a mode that {grows} at a rate of {rate:{'.3g' if rate < 100.0 else '.0f'}}/s"


def divided(largest: float, limit: float) -> float:
    """Return the largest step of which a whole number makes up `largest`, not above `limit` [s].

    So steps meet the instants of a record and, with the usual ones, those at which a loop samples.
    """
    return largest / max(1, math.ceil(largest / limit - 1e-9))


def choose_step(
    diagram: Diagram, context: Context, max_step: float | None = None, largest: float = MAX_STEP
) -> Step:
    """Return the step of Runge-Kutta 3 for a diagram where it is now.

    It is chosen from the modes of the robot with its winches under control, by the linear model
    about the platform's pose with the cables' lengths and tensions there, and from what blocks
    answer for `eigenvalues`: load cells' and Drake's filters, and a user's blocks that do. Other
    blocks, and what they do to the robot's modes, a stiff spring say, do not count.

    Args:
        diagram: the diagram; without cables, and where they have no catenary, only the blocks
            count.
        context: its context.
        max_step: the step if somebody asked for one [s].
        largest: a step is not chosen above it [s], but as a whole part of it.

    Raises:
        ValueError: a step that is not positive and finite.
    """
    values = _eigenvalues(diagram, context)
    values = values[np.abs(values) > NEUTRAL]
    limits = suitable_steps(values)
    suitable = divided(largest, float(np.min(limits, initial=math.inf)))
    if max_step is not None:
        limits = largest_steps(values)
    eigenvalue, limit = None, math.inf
    if values.size:
        first = int(np.argmin(limits))
        eigenvalue, limit = complex(values[first]), float(limits[first])
    if max_step is not None:
        size, decided_by = max_step, "given"
    else:
        size, decided_by = suitable, "usual" if suitable == largest else "modes"
    return Step(
        size=size, decided_by=decided_by, eigenvalue=eigenvalue, limit=limit, suitable=suitable
    )


class StepWatch:
    """A look at the step of a run, when tensions have risen or the platform has moved far.

    A step that was chosen becomes smaller where needed, never larger; one that was given stays.

    Args:
        diagram: the diagram.
        context: its context, at the start.
        step: the step at the start.

    Attributes:
        step: what it is now; of one that was given, whether it is too coarse.
    """

    def __init__(self, diagram: Diagram, context: Context, step: Step) -> None:
        self.step = step
        self._diagram, self._context = diagram, context
        # Where no mode is known, or does not matter, there is nothing to look at.
        self._cables = None if step.eigenvalue is None else _cables_of(diagram)
        self._tension: Array = np.zeros(0)
        self._pose: Array = np.zeros(6)
        self._shift = math.inf

    def look(self, time: float, pose: Array, tension: Array) -> bool:
        """Look at the step again where the robot has changed much; return whether it is another.

        Args:
            time: [s].
            pose: (6,) of the platform.
            tension: (k,) [N] at the drawing points.
        """
        if self._cables is None or not self._has_changed(pose, tension):
            return False
        self._tension, self._pose = tension.copy(), pose.copy()
        self._shift = SHIFT * float(np.min(_port(self._cables, self._context, LENGTH)))
        given = self.step.size if self.step.decided_by == "given" else None
        found = choose_step(self._diagram, self._context, given)
        if found.limit >= self.step.size or self.step.doubt:
            return False
        self.step = dataclasses.replace(found, since=time)
        return True

    def _has_changed(self, pose: Array, tension: Array) -> bool:
        if not self._tension.size or (tension > TENSION_RISE * self._tension).any():
            return True
        moved = np.abs(pose - self._pose)
        return bool(moved[:3].max() > TURN or moved[3:].max() > self._shift)


STATE, LENGTH = "platform_state", "unstrained_length"
"""Ports by which a block that has the cables says where the robot is."""


def _cables_of(diagram: Diagram) -> Block | None:
    """Return the block that has the cables, if it says where the robot is."""
    for block in blocks(diagram):
        system = block.system
        if block.answer("cable_robot") is not None and all(
            system.HasOutputPort(name) or system.HasInputPort(name) for name in (STATE, LENGTH)
        ):
            return block
    return None


def _port(block: Block, context: Context, name: str) -> Array:
    """Return what is at a port of a block, an output or an input."""
    system = block.system
    port = system.GetOutputPort if system.HasOutputPort(name) else system.GetInputPort
    value: Array = port(name).Eval(block.context(context))
    return value


def _eigenvalues(diagram: Diagram, context: Context) -> np.ndarray:
    """Return the eigenvalues (n,) that a step has to follow [1/s]."""
    found = [_robot_eigenvalues(diagram, context)]
    for block in blocks(diagram):
        own = block.answer("eigenvalues")
        if own is not None:
            found.append(np.ravel(np.asarray(own, complex)))
    return np.concatenate(found)


def _robot_eigenvalues(diagram: Diagram, context: Context) -> np.ndarray:
    """Return the eigenvalues (n,) of the robot with its winches; none where it cannot be."""
    cables = _cables_of(diagram)
    if cables is None:
        return np.zeros(0, complex)
    robot = cables.system.cable_robot
    pose, length = (_port(cables, context, name) for name in (STATE, LENGTH))
    try:
        model = rest_model(robot, state_at(robot, vector_to_pose(pose[:6]), length))
    except EquilibriumError:  # the run will tell, by cable and time
        return np.zeros(0, complex)
    A = model.controlled()[0]
    return np.linalg.eigvals(A) if np.isfinite(A).all() else np.zeros(0, complex)


def _floored(value: float) -> float:
    """Return a positive value rounded down to three digits."""
    unit: float = 10.0 ** (math.floor(math.log10(value)) - 2)
    return math.floor(value / unit + 1e-9) * unit
