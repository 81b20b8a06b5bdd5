"""The blocks of any diagram, what each answers about itself, and what their states are called.

What may be answered is in `systems.answers`. The name of a state is the path of its block, then
what the block says it is: "robot/platform/roll", "robot/winches/angle[3]", "held_rates[8]".
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from pydrake.systems.framework import Context, Diagram, System

from cdpr_drake.diagrams.drake_blocks import answers_of
from cdpr_drake.model.signals import joined, vector_names


class Block(NamedTuple):
    """A system inside a diagram that is no diagram itself.

    Attributes:
        path: names of the diagrams around it, then its own.
        system: the system, of any scalar type.
    """

    path: tuple[str, ...]
    system: System

    def __str__(self) -> str:
        """How messages name it: its path and its class."""
        kind = type(self.system).__name__.split("_𝓣")[0]
        return f'block "{"/".join(self.path)}" ({kind})'

    def answer(self, name: str) -> Any:
        """Return the method or attribute `name` with which it answers, None if it does not."""
        return getattr(answers_of(self.system), name, None)

    def context(self, root: Context) -> Context:
        """Return its own context, mutable, in that of the diagram, `root`."""
        return self.system.GetMyMutableContextFromRoot(root)

    @property
    def group_sizes(self) -> list[int]:
        """Size of each group of its discrete state."""
        values = self.system.AllocateDiscreteVariables()
        return [values.get_vector(i).size() for i in range(values.num_groups())]


def blocks(system: System, path: tuple[str, ...] = ()) -> Iterator[Block]:
    """Yield each block of a diagram, in the order of the diagram's state; a leaf yields itself.

    Args:
        system: a diagram or system of any scalar type.
        path: names of the diagrams around it.
    """
    if not hasattr(system, "GetSystems"):
        yield Block(path or (system.get_name(),), system)
        return
    for part in system.GetSystems():
        yield from blocks(part, (*path, part.get_name()))


def fed_ports(diagram: Diagram) -> Iterator[tuple[str, tuple[str, ...], str]]:
    """Yield (input port, path of a block, its port) for each port that an input of a diagram feeds.

    Args:
        diagram: the diagram; a leaf system feeds no other.
    """
    if not hasattr(diagram, "GetSystems"):
        return
    for i in range(diagram.num_input_ports()):
        port = diagram.get_input_port(i)
        for system, index in diagram.GetInputPortLocators(port.get_index()):
            inner, block = system.get_input_port(index).get_name(), system.get_name()
            if not hasattr(system, "GetSystems"):
                yield port.get_name(), (block,), inner
            for name, path, leaf_port in fed_ports(system):
                if name == inner:
                    yield port.get_name(), (block, *path), leaf_port


def continuous_state_names(system: System) -> tuple[str, ...]:
    """Return the names of a system's continuous states, in its own order.

    Args:
        system: a system or diagram.
    """
    return tuple(name for block in blocks(system) for name in _continuous(block))


def discrete_state_names(system: System) -> tuple[str, ...]:
    """Return the names of a system's discrete states, group after group.

    Args:
        system: a system or diagram.
    """
    return tuple(name for block in blocks(system) for name in _discrete(block))


def _continuous(block: Block) -> list[str]:
    size, path = block.system.num_continuous_states(), "/".join(block.path)
    own = block.answer("state_names") or ()
    if len(own) != size:
        own = [f"x[{i + 1}]" for i in range(size)]
    return [joined(path, name) for name in own]


def _discrete(block: Block) -> list[str]:
    sizes, path = block.group_sizes, "/".join(block.path)
    own = block.answer("discrete_state_names") or ()
    if sizes and len(own) == sum(sizes):
        return [joined(path, name) for name in own]
    return [
        name
        for group, size in enumerate(sizes)
        for name in vector_names(path if len(sizes) == 1 else f"{path}/{group + 1}", size)
    ]


def hand_over(diagram: System, context: Context, other: System, target: Context) -> tuple[str, ...]:
    """Put time and states of one diagram into another by their names: a run that goes on there.

    Blocks of the same path and kind hand over their abstract state too: generators of noise. What
    has no namesake stays as it is in the other; parameters and inputs do.

    Args:
        diagram: whose states are handed over.
        context: its context.
        other: gets them, e.g. the same loop around a robot that has picked something up.
        target: the other's context, changed.

    Returns:
        the names of the other's states that were not given any.
    """
    target.SetTime(context.get_time())
    given = {block.path: block for block in blocks(diagram)}
    values = dict(zip(*_named_states(diagram, context), strict=True))
    names, mine = _named_states(other, target)
    _set_states(target, np.array([values.get(n, v) for n, v in zip(names, mine, strict=True)]))
    for block in blocks(other):
        source = given.get(block.path)
        if source is not None and type(source.system) is type(block.system):
            theirs, own = source.context(context), block.context(target)
            for i in range(min(s.system.num_abstract_states() for s in (source, block))):
                own.get_mutable_abstract_state(i).SetFrom(theirs.get_abstract_state(i))
    return tuple(name for name in names if name not in values)


def _named_states(system: System, context: Context) -> tuple[tuple[str, ...], np.ndarray]:
    discrete = context.get_discrete_state()
    groups = [discrete.get_vector(i).CopyToVector() for i in range(discrete.num_groups())]
    names = continuous_state_names(system) + discrete_state_names(system)
    return names, np.concatenate([context.get_continuous_state_vector().CopyToVector(), *groups])


def _set_states(context: Context, values: np.ndarray) -> None:
    n = context.get_continuous_state_vector().size()
    context.SetContinuousState(values[:n])
    for group in range(context.get_discrete_state().num_groups()):
        size = context.get_discrete_state(group).size()
        context.SetDiscreteState(group, values[n : n + size])
        n += size
