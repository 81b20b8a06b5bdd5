"""The AutoDiffXd copy of a diagram: made once, asked for derivatives many times."""

from __future__ import annotations

import re
import weakref
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.systems.framework import Context, System

from cdpr_drake.diagrams.blocks import blocks, fed_ports
from cdpr_drake.errors import LinearizationError

Array = NDArray[np.float64]

_TWINS: weakref.WeakKeyDictionary[System, Twin | None] = weakref.WeakKeyDictionary()


class Twin:
    """A diagram's AutoDiffXd copy, and no reference to the original.

    Use `twin_of`, which converts a diagram once: every conversion costs tens of milliseconds, and
    Drake 1.51 never frees one.

    Args:
        system: the copy.
    """

    def __init__(self, system: System) -> None:
        self.system = system
        self.num_states = system.num_continuous_states()
        self.group_sizes = [n for block in blocks(system) for n in block.group_sizes]

    def context(self, diagram: System, context: Context) -> Context:
        """Return a new AutoDiffXd context with the time, state, parameters and inputs of another.

        Args:
            diagram: the original.
            context: its context.
        """
        own = self.system.CreateDefaultContext()
        own.SetTimeStateAndParametersFrom(context)
        self.system.FixInputPortsFrom(diagram, context, own)
        return own

    def seed(self, context: Context, own: Context, discrete: bool = False, width: int = 0) -> int:
        """Make the states of an AutoDiffXd context the first independent variables.

        Args:
            context: the float context to take the values from.
            own: the AutoDiffXd context.
            discrete: whether the discrete states are variables too, after the continuous ones.
            width: number of variables besides these.

        Returns:
            number of states that are variables now.
        """
        n = self.num_states
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


def twin_of(diagram: System) -> Twin | None:
    """Return the twin of a diagram, converted the first time and kept as long as the diagram.

    Args:
        diagram: the diagram, or a single system.

    Returns:
        None if a block does not support AutoDiffXd.
    """
    if diagram not in _TWINS:
        converted = diagram.ToAutoDiffXdMaybe()
        _TWINS[diagram] = None if converted is None else Twin(converted)
    return _TWINS[diagram]


def value_and_gradient(y: np.ndarray, width: int) -> tuple[Array, Array]:
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
def open_ports_named(diagram: System, what: str) -> Iterator[None]:
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
        exported = {(at, fed): name for name, at, fed in fed_ports(diagram)}.get((path, port))
        shown = f'input port "{exported or port}" is open'
        if path:
            shown += f', and block "{"/".join(path)}" needs it'
        raise LinearizationError(f"{what}: {shown}; fix its value, or connect it") from None


_OPEN_PORT = re.compile(r"required InputPort\[\d+\] \((?P<port>.*?)\) of System (?P<path>\S+) ")
