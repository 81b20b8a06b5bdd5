"""Equilibria of whole loops: the context in which everything is at rest, and how nearly it is."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, Diagram, PortDataType

from cdpr_drake.diagrams.blocks import Block, blocks, continuous_state_names, discrete_state_names
from cdpr_drake.diagrams.rest import (
    TOLERANCE,
    cables_of,
    fix_inputs,
    rest_context,
    robot_of,
    settle,
)
from cdpr_drake.errors import EquilibriumError, GeometryError, TensionError
from cdpr_drake.model.rotations import as_pose, pose_to_vector
from cdpr_drake.model.statics import DEFAULT_RULE
from cdpr_drake.study.state_space import Array

MOMENT = 0.05
"""How long [s] after its rest an all-continuous loop is looked at once more: nothing may move."""


def equilibrium(
    loop: Diagram, pose: RigidTransform | ArrayLike, tensions: str = DEFAULT_RULE
) -> Context:
    """Return the context in which a whole loop is at rest with the desired pose set to `pose`.

    Plant, winches, filters, samples and latency buffers are at rest, and the time is past the ramp
    of the gain. Under vision-based control the controller sees no error: with a calibration other
    than the robot's own the platform rests where it is *seen* at the pose. Under joint space
    control the pose is what is asked for; the true pose and the tensions are results.

    Args:
        loop: any diagram with cables; its desired pose is an input that feeds ports
            "desired_pose", or none. Nothing has to be exported.
        pose: desired X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        tensions: one of `model.statics.RULES`; without effect under joint space control, where the
            winches' angles decide.

    Raises:
        EquilibriumError: there is no such rest, or a residual is above 1e-9 of the largest term of
            its equation, now or a moment later: under a moving reference nothing rests. Names the
            residual, and what moves or the limiting cable.
        ValueError: an unknown rule for the tensions.
    """
    for block in blocks(loop):
        if block.answer("never_rests"):
            raise EquilibriumError(
                f"{block} never rests: make the loop without noise, or start a noisy one from "
                "rest_context"
            )
    desired = as_pose(pose)
    true = true_pose(loop, desired)
    try:
        context = rest_context(loop, true, tensions)
    except (TensionError, GeometryError) as error:  # these name the limiting cable
        raise EquilibriumError(str(error)) from None
    fix_inputs(loop, context, {"desired_pose"}, pose_to_vector(desired))
    time = settled_time(loop)
    context.SetTime(time)
    settle(loop, context)
    for moment in (time + (sample_period(loop) or MOMENT), time):
        context.SetTime(moment)
        rest = residuals(loop, context)
        if not rest.largest <= TOLERANCE:
            raise EquilibriumError(
                f"not at rest: {rest.worst} changes by {rest.largest:.2e} of the largest term of "
                f"its equation; {_culprit(loop, context)}"
            )
    return context


def settled_time(loop: Diagram) -> float:
    """Return the first time [s] at which all gains are past their ramps and a period begins.

    Args:
        loop: the diagram.
    """
    ramp = max((block.answer("steady_after") or 0.0 for block in blocks(loop)), default=0.0)
    period = sample_period(loop)
    return ramp if period is None else math.ceil(ramp / period - 1e-9) * period


def sample_period(loop: Diagram) -> float | None:
    """Return the longest period [s] of the loop's discrete updates, None if it has none.

    Args:
        loop: the diagram.
    """
    events = [s.GetUniquePeriodicDiscreteUpdateAttribute() for _, s in blocks(loop)]
    return max((e.period_sec() for e in events if e is not None), default=None)


def true_pose(loop: Diagram, seen: RigidTransform | ArrayLike) -> RigidTransform:
    """Return X_WP of the platform when the loop's cameras measure it at the pose `seen`.

    X_WP = X_WF X_WF'^-1 X_WP' X_PM' X_PM^-1, the calibrated transforms and the measured pose
    primed. A loop without cameras sees the truth.

    Args:
        loop: the diagram.
        seen: the measured X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
    """
    for block in blocks(loop):
        answer = block.answer("true_pose")
        if answer is not None:
            true: RigidTransform = answer(robot_of(loop), seen)
            return true
    return as_pose(seen)


@dataclass(frozen=True, kw_only=True)
class Residuals:
    """How far a context is from rest, equation by equation.

    Attributes:
        names: of the states, continuous then discrete.
        value: (n,) rate of change of the continuous states, change at the next update of the
            discrete ones.
        scale: (n,) the largest term of each equation.
    """

    names: tuple[str, ...]
    value: Array
    scale: Array

    @property
    def ratio(self) -> Array:
        """Size of each residual relative to the largest term of its equation (n,)."""
        return np.abs(self.value) / self.scale

    @property
    def largest(self) -> float:
        """The largest ratio."""
        return float(np.max(self.ratio, initial=0.0))

    @property
    def worst(self) -> str:
        """The name of the state with the largest ratio."""
        return self.names[int(np.argmax(self.ratio))]


def residuals(loop: Diagram, context: Context) -> Residuals:
    """Return how far a context of a diagram is from rest, relative to each equation's largest term.

    The largest term is what a system says by `residual_scale`: for the platform's balance the
    largest of its weight and the cables' forces, and of their torques; for a winch the holding
    torque r T; for the integral of its error the motor angle; for a filter its reading. Where a
    rate of change is all there is in an equation (dx/dt = v), for samples, and in systems that do
    not say, it is one SI unit, or the state itself if that is larger.

    Args:
        loop: any diagram with cables.
        context: its context.
    """
    cables = cables_of(loop)
    pull = cables.answer("wrench_scale")
    torque_and_force = pull(cables.context(context)) if pull is not None else (0.0, 0.0)
    scales, discrete, discrete_scales = [], [], []
    for block in blocks(loop):
        if block.system.num_continuous_states():
            scales.append(_scale(block, block.context(context), torque_and_force))
        before, after = _discrete_states(block, block.context(context))
        discrete.append(after - before)
        discrete_scales.append(np.maximum(1.0, np.abs(before)))
    return Residuals(
        names=continuous_state_names(loop) + discrete_state_names(loop),
        value=np.concatenate([loop.EvalTimeDerivatives(context).CopyToVector(), *discrete]),
        scale=np.concatenate([*scales, *discrete_scales]),
    )


def _scale(block: Block, own: Context, pull: tuple[float, float]) -> Array:
    platform, scale = block.answer("platform_scale"), block.answer("residual_scale")
    found: Array
    if platform is not None:
        found = platform(own, *pull)
    elif scale is not None:
        found = scale(own)
    else:
        found = np.maximum(1.0, np.abs(own.get_continuous_state_vector().CopyToVector()))
    return found


def _discrete_states(block: Block, own: Context) -> tuple[Array, Array]:
    """Return the discrete states of a block now and after its next update, if it has one.

    A source of noise, which has none of its own, holds its sample until it draws the next.
    """
    state, system = own.get_discrete_state(), block.system
    groups = range(state.num_groups())
    before = np.concatenate([np.zeros(0), *(state.get_vector(i).CopyToVector() for i in groups)])
    if not before.size or system.GetUniquePeriodicDiscreteUpdateAttribute() is None:
        return before, before
    after = system.EvalUniquePeriodicDiscreteUpdate(own)
    return before, np.concatenate([after.get_vector(i).CopyToVector() for i in groups])


def _culprit(loop: Diagram, context: Context) -> str:
    """Return what a residual may come from: a source that moves, or the slackest cable."""
    sources = [block for block in blocks(loop) if not block.system.num_input_ports()]
    time, shown = context.get_time(), []
    for moment in (time, time + MOMENT):
        context.SetTime(moment)
        shown.append([_outputs(block, context) for block in sources])
    for block, now, then in zip(sources, *shown, strict=True):
        if not np.array_equal(now, then):
            return f"{block} moves, and a loop rests only while what drives it stands still"
    return f"limiting cable {_slackest_cable(loop, context)}"


def _outputs(block: Block, context: Context) -> Array:
    """Return all numbers that a block puts out."""
    ports = map(block.system.get_output_port, range(block.system.num_output_ports()))
    vectors = [p for p in ports if p.get_data_type() == PortDataType.kVectorValued]
    own = block.context(context)
    return np.concatenate([np.zeros(0), *(port.Eval(own) for port in vectors)])


def _slackest_cable(loop: Diagram, context: Context) -> str:
    cables = cables_of(loop)
    port = cables.system.GetOutputPort("tension_at_drawing_point")
    tension = port.Eval(cables.context(context))
    i = int(np.argmin(tension))
    return f"{i + 1} ({tension[i]:.1f} N at the drawing point)"
