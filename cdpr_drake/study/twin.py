"""The AutoDiffXd copy of a diagram: made once, asked for derivatives many times."""

from __future__ import annotations

import re
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff

from cdpr_drake.errors import LinearizationError
from cdpr_drake.study.names import (
    block_name,
    continuous_state_names,
    discrete_state_names,
    group_sizes,
    leaves,
)

Array = NDArray[np.float64]

_TWINS: weakref.WeakKeyDictionary[Any, Twin] = weakref.WeakKeyDictionary()


class Twin:
    """A diagram's AutoDiffXd copy, the names of its states, and no reference to the original.

    Use `twin_of`, which converts a diagram once: every conversion costs tens of milliseconds, and
    Drake 1.51 never frees one.

    Args:
        diagram: the diagram, or a single system.

    Raises:
        LinearizationError: a block does not support AutoDiffXd, or its state is abstract; names
            the block.
    """

    def __init__(self, diagram: Any) -> None:
        for path, leaf in leaves(diagram):
            if leaf.num_abstract_states():
                raise LinearizationError(
                    f"{block_name(path, leaf)} has abstract state, which has no derivative"
                )
        system = diagram.ToAutoDiffXdMaybe()
        if system is None:
            for path, leaf in leaves(diagram):
                if leaf.ToAutoDiffXdMaybe() is None:
                    raise LinearizationError(
                        f"{block_name(path, leaf)} does not support AutoDiffXd"
                    )
            raise LinearizationError(f'"{diagram.get_name()}" does not support AutoDiffXd')
        self.system = system
        self.states = continuous_state_names(diagram)
        self.discrete_states = discrete_state_names(diagram)
        self.group_sizes = [n for _, leaf in leaves(diagram) for n in group_sizes(leaf)]

    def context(self, diagram: Any, context: Any) -> Any:
        """Return a new AutoDiffXd context with the time, state, parameters and inputs of another.

        Args:
            diagram: the original.
            context: its context.
        """
        own = self.system.CreateDefaultContext()
        own.SetTimeStateAndParametersFrom(context)
        self.system.FixInputPortsFrom(diagram, context, own)
        return own

    def seed(self, context: Any, own: Any, discrete: bool = False, width: int = 0) -> int:
        """Make the states of an AutoDiffXd context the first independent variables.

        Args:
            context: the float context to take the values from.
            own: the AutoDiffXd context.
            discrete: whether the discrete states are variables too, after the continuous ones.
            width: number of variables besides these.

        Returns:
            number of states that are variables now.
        """
        n = len(self.states)
        total = n + width + (sum(self.group_sizes) if discrete else 0)
        if n:
            x = context.get_continuous_state_vector().CopyToVector()
            own.SetContinuousState(InitializeAutoDiff(x, total, 0).ravel())
        if discrete:
            for group, size in enumerate(self.group_sizes):
                values = context.get_discrete_state(group).CopyToVector()
                vector = own.get_mutable_discrete_state(group)
                vector.SetFromVector(InitializeAutoDiff(values, total, n).ravel())
                n += size
        return n


def twin_of(diagram: Any) -> Twin:
    """Return the twin of a diagram, converted the first time and kept as long as the diagram.

    Args:
        diagram: the diagram, or a single system.

    Raises:
        LinearizationError: see `Twin`.
    """
    twin = _TWINS.get(diagram)
    if twin is None:
        twin = _TWINS[diagram] = Twin(diagram)
    return twin


def value_and_gradient(y: NDArray[Any], width: int) -> tuple[Array, Array]:
    """Return the values (p,) and the derivatives (p, width), zero where `y` carries none.

    Args:
        y: (p,) array of AutoDiffXd, or of float.
        width: number of independent variables.
    """
    if y.dtype != object:
        return np.asarray(y, float), np.zeros((y.size, width))
    # Drake's own Linearize trusts that there are derivatives, and ends the process if not.
    gradient = ExtractGradient(y) if y.size else np.zeros((0, 0))
    if gradient.shape[1] != width:
        gradient = np.zeros((y.size, width))
    return ExtractValue(y).ravel(), gradient


@contextmanager
def open_ports_named(diagram: Any, what: str) -> Iterator[None]:
    """Turn Drake's complaint about a required input port that is open into a LinearizationError.

    Args:
        diagram: what is evaluated.
        what: is being done, for the message.
    """
    try:
        yield
    except RuntimeError as error:
        found = _OPEN_PORT.search(str(error))
        if found is None:
            raise
        port, path = found["port"], tuple(found["path"].strip(":").split("::")[1:])
        exported = {leaf: name for name, leaf in _exported_inputs(diagram)}.get((path, port))
        shown = f'input port "{exported or port}" is open'
        if path:
            shown += f', and block "{"/".join(path)}" needs it'
        raise LinearizationError(f"{what}: {shown}; fix its value, or connect it") from None


_OPEN_PORT = re.compile(r"required InputPort\[\d+\] \((?P<port>.*?)\) of System (?P<path>\S+) ")


def _exported_inputs(diagram: Any) -> Iterator[tuple[str, tuple[tuple[str, ...], str]]]:
    """Yield (name, (path, port)) for each leaf's port that an input of the diagram feeds."""
    if not hasattr(diagram, "GetSystems"):
        return
    for i in range(diagram.num_input_ports()):
        port = diagram.get_input_port(i)
        for system, index in diagram.GetInputPortLocators(port.get_index()):
            inner = system.get_input_port(index).get_name()
            block = system.get_name()
            if not hasattr(system, "GetSystems"):
                yield port.get_name(), ((block,), inner)
            for name, (path, leaf_port) in _exported_inputs(system):
                if name == inner:
                    yield port.get_name(), ((block, *path), leaf_port)
