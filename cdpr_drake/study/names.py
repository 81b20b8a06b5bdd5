"""Names of the states of any diagram: the path of a block, then what it says its entries are.

"robot/platform/roll", "robot/winches/angle[3]", "held_rates[8]"; see `systems.answers` for how a
system says what its states are. Ports' entries are named by `model.signals.vector_names`.
"""

from __future__ import annotations

from pydrake.systems.framework import System

from cdpr_drake.diagrams.blocks import Block, blocks, joined
from cdpr_drake.model.signals import vector_names


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
