"""Contexts in which a whole diagram is at rest: each system puts itself there.

What a system answers for it is in `systems.answers`.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from pydrake.common import RandomGenerator
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, Diagram

from cdpr_drake.diagrams.blocks import Block, blocks, fed_ports
from cdpr_drake.errors import EquilibriumError
from cdpr_drake.model.equilibrium import RestState, forward_kinematics, rest_state
from cdpr_drake.model.inverse_kinematics import lengths_at
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, as_pose, pose_to_vector
from cdpr_drake.model.statics import DEFAULT_RULE

TOLERANCE = 1e-9
"""Rate of change of a state at rest, relative to the largest term of its equation."""


def rest_context(
    diagram: Diagram,
    pose: RigidTransform | ArrayLike,
    tensions: str = DEFAULT_RULE,
    seed: int | None = None,
) -> Context:
    """Return a context in which plant, winches, filters, samples and latency buffers are at rest.

    The robot rests at the pose, whatever the goal; an open input that feeds a port "desired_pose"
    is fixed at the pose, to be fixed at a goal by the caller. In a joint space loop the pose is
    what the controller asks for: lengths follow from its inverse kinematics, the true pose and
    tensions from them. Whatever else pulls at the platform there, a spring say, is borne too.

    Args:
        diagram: any diagram with a system that has cables (`CatenaryCableForce` or `FusedPlant`),
            whatever its blocks are called.
        pose: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        tensions: one of `model.statics.RULES`; without effect in a joint space loop.
        seed: of the diagram's noise sources, each with a generator of its own by the seed and the
            name of the source; None leaves them to Drake, whose seeds differ from one context to
            the next.

    Raises:
        GeometryError, TensionError, EquilibriumError: the robot cannot rest there, or a block has
            state that does not rest; names it.
        ValueError: the diagram has no cables.
    """
    context = diagram.CreateDefaultContext()
    inside = list(blocks(diagram))
    if seed is not None:
        _seed(inside, context, seed)
    X_WP = as_pose(pose)
    robot = robot_of(diagram)
    fix_inputs(diagram, context, {"desired_pose"}, pose_to_vector(X_WP))
    rest = _rest_of_weight(inside, robot, X_WP, tensions, None)
    wrench, scale = np.zeros(6), robot.mass * robot.gravity
    step, before = np.zeros(6), np.zeros(6)
    inverse = np.eye(6)  # of -d unbalanced / d wrench, which is 1 where the pose stays
    # Where the pose is not held, a long step may go beyond what the cables bear there.
    gives_way = any(block.answer("motor_angles_at") is not None for block in inside)
    reach = 0.3 * scale if gives_way else np.inf
    for _ in range(50):
        _place(diagram, inside, context, rest)
        unbalanced = _unbalanced(inside, context)
        if np.max(np.abs(unbalanced)) <= TOLERANCE * max(scale, np.max(np.abs(wrench))):
            break
        seen = inverse @ (before - unbalanced)
        if step @ seen:  # Broyden's update; without it, springs stiffer than the cables diverge
            inverse += np.outer(step - seen, step @ inverse) / (step @ seen)
        before, step = unbalanced, inverse @ unbalanced
        step *= min(1.0, reach / np.max(np.abs(step)))
        wrench = wrench + step
        rest = _rest_of_weight(inside, robot, X_WP, tensions, wrench)
    else:
        raise EquilibriumError(
            "no rest found: what else pulls at the platform changes with the pose more than the "
            f"cables' pull does; the last imbalance is {np.array2string(unbalanced, precision=3)}"
        )
    _settle(inside, context)
    for block in inside:
        _check(block, context)
    return context


def set_at_rest(diagram: Diagram, context: Context, rest: RestState) -> None:
    """Put every system of a diagram at rest in a state of the robot.

    Args:
        diagram: any diagram with cables.
        context: its context, changed.
        rest: the state.

    Raises:
        EquilibriumError: samples and memories do not come to rest.
    """
    inside = list(blocks(diagram))
    _place(diagram, inside, context, rest)
    _settle(inside, context)


def settle(diagram: Diagram, context: Context) -> None:
    """Have samples and memories take what their inputs are now, after an input or the time changed.

    Args:
        diagram: any diagram.
        context: its context, changed.

    Raises:
        EquilibriumError: samples and memories do not come to rest.
    """
    _settle(list(blocks(diagram)), context)


def robot_of(diagram: Diagram) -> CableRobot:
    """Return the true robot of a diagram.

    Args:
        diagram: the diagram.

    Raises:
        ValueError: it has no cables.
    """
    robot: CableRobot = cables_of(diagram).system.cable_robot
    return robot


def cables_of(diagram: Diagram) -> Block:
    """Return the block of a diagram that has the cables, and a port "tension_at_drawing_point".

    Args:
        diagram: the diagram.

    Raises:
        ValueError: there is none.
    """
    for block in blocks(diagram):
        if block.answer("cable_robot") is not None:
            return block
    raise ValueError(
        f'diagram "{diagram.get_name()}" has no cables: no CatenaryCableForce, no FusedPlant, and '
        'no other block with an attribute "cable_robot"'
    )


def fix_inputs(diagram: Diagram, context: Context, ports: set[str], value: Array) -> None:
    """Fix the inputs of a diagram that feed ports of given names.

    Args:
        diagram: the diagram.
        context: its context, changed.
        ports: names of ports of blocks.
        value: for each input.
    """
    for name, _, fed in fed_ports(diagram):
        if fed in ports:
            diagram.GetInputPort(name).FixValue(context, value)


def _seed(inside: Sequence[Block], context: Context, seed: int) -> None:
    """Give each source of noise a generator of its own, by the seed and its name.

    So what one draws does not depend on which others there are, or in which order. A source is
    called like the port that it feeds; where two are called alike, their paths count.
    """
    names = Counter(block.path[-1] for block in inside)
    for block in inside:
        name = block.path[-1] if names[block.path[-1]] == 1 else "/".join(block.path)
        digest = hashlib.sha256(f"{seed} {name}".encode()).digest()
        generator = RandomGenerator(int.from_bytes(digest[:4], "little"))
        block.system.SetRandomContext(block.context(context), generator)


def _rest_of_weight(
    inside: Sequence[Block],
    robot: CableRobot,
    X_WP: RigidTransform,
    tensions: str,
    wrench: Array | None,
) -> RestState:
    """Return the robot's rest under its weight and a wrench: where lengths, or the pose, say."""
    for block in inside:
        asked_for = block.answer("motor_angles_at")
        if asked_for is not None:
            return forward_kinematics(
                robot, lengths_at(robot, asked_for(X_WP)), X_WP, wrench=wrench
            )
    return rest_state(robot, X_WP, tensions, wrench)


def _place(diagram: Diagram, inside: Sequence[Block], context: Context, rest: RestState) -> None:
    """Have each system put itself at rest that can without a look at its inputs."""
    for block in inside:
        put = block.answer("set_at_rest")
        if put is not None:
            put(block.context(context), rest)
    angles = {"desired_motor_angle", "desired_motor_angles"}
    fix_inputs(diagram, context, angles, rest.desired_motor_angles)


def _unbalanced(inside: Sequence[Block], context: Context) -> Array:
    for block in inside:
        wrench = block.answer("unbalanced_wrench")
        if wrench is not None:
            unbalanced: Array = wrench(block.context(context))
            return unbalanced
    return np.zeros(6)


def _settle(inside: Sequence[Block], context: Context) -> None:
    """Have samples and memories take what their inputs are, until nothing changes any more.

    One may need another's first, wherever that stands in the order of the blocks: what it raises
    before then counts only if it stays.
    """
    settling = [(block, put) for block in inside if (put := block.answer("settle")) is not None]
    for _ in range(len(settling) + 2):
        failed: tuple[Block, Exception] | None = None
        changed = False
        for block, settle in settling:
            own = block.context(context)
            before = _state(block, own)
            try:
                settle(own)
            except Exception as error:
                failed = failed or (block, error)
            changed = changed or not np.array_equal(before, _state(block, own), equal_nan=True)
        if not changed:
            break
    else:
        raise EquilibriumError("samples and memories of the diagram do not come to rest")
    if failed is not None:
        raise failed[1]


def _state(block: Block, own: Context) -> Array:
    parts = [own.get_continuous_state_vector().CopyToVector()]
    discrete = own.get_discrete_state()
    parts += [discrete.get_vector(i).CopyToVector() for i in range(discrete.num_groups())]
    return np.concatenate(parts)


def _check(block: Block, context: Context) -> None:
    """Raise EquilibriumError where a block says it does not rest, or says nothing and moves."""
    asked = block.answer("not_at_rest")
    if asked is not None:
        if reason := asked(block.context(context)):
            raise EquilibriumError(f"{block} does not rest: {reason}")
    elif block.answer("set_at_rest") is None and block.answer("settle") is None:
        _check_unanswered(block, context)


def _check_unanswered(block: Block, context: Context) -> None:
    """Raise EquilibriumError where a block does not say how it rests, and its state changes."""
    system, own = block.system, block.context(context)
    before = _state(block, own)
    if not before.size:
        return
    n = system.num_continuous_states()
    change = [system.EvalTimeDerivatives(own).CopyToVector()] if n else []
    if system.num_discrete_state_groups():
        if system.GetUniquePeriodicDiscreteUpdateAttribute() is None:
            raise EquilibriumError(f"whether {block} rests is not known: {_ADVICE}")
        after = system.EvalUniquePeriodicDiscreteUpdate(own)
        values = [after.get_vector(i).CopyToVector() for i in range(after.num_groups())]
        change.append(np.concatenate(values) - before[n:])
    moves = np.abs(np.concatenate(change)) / np.maximum(1.0, np.abs(before))
    if not np.max(moves) <= TOLERANCE:
        raise EquilibriumError(
            f"{block} does not rest: its state {int(np.argmax(moves)) + 1} changes by "
            f"{np.concatenate(change)[np.argmax(moves)]:.3g}; {_ADVICE}"
        )


_ADVICE = (
    "its class has to implement set_at_rest(context, rest), from how the robot rests, or "
    "settle(context), from what its inputs are (see cdpr_drake.systems.answers)"
)
