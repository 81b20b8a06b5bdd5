"""A diagram to first order about a context, by AutoDiffXd, or block by block where one has none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.autodiffutils import InitializeAutoDiff
from pydrake.systems.framework import Context, Diagram, InputPort, OutputPort

from cdpr_drake.diagrams.blocks import Block, blocks
from cdpr_drake.errors import LinearizationError
from cdpr_drake.study.block_by_block import Pieces, pieces
from cdpr_drake.study.state_space import Array
from cdpr_drake.study.twin import Twin, twin_of, value_and_gradient


@dataclass(frozen=True, kw_only=True, eq=False)
class FirstOrder:
    """Values and derivatives at a point, by z = [continuous x (n); discrete d (m); inputs u (w)].

    Attributes:
        f: (n,) dx/dt and its derivatives (n, n + m + w).
        update: (m,) what each entry of d becomes at its next update, and its derivatives.
        y: (p,) outputs, and their derivatives.
        by_differences: names of the blocks whose derivatives are differences, for want of
            AutoDiffXd.
    """

    f: tuple[Array, Array]
    update: tuple[Array, Array]
    y: tuple[Array, Array]
    by_differences: tuple[str, ...] = ()


def first_order(
    diagram: Diagram,
    context: Context,
    inputs: Sequence[InputPort],
    outputs: Sequence[OutputPort],
    discrete: bool = False,
) -> FirstOrder:
    """Return a diagram to first order about a context.

    Args:
        diagram: the diagram, or a single system.
        context: the point.
        inputs: its vector input ports that vary; open ones count as zero.
        outputs: its vector output ports.
        discrete: whether the discrete states vary, and their updates are asked for.

    Raises:
        LinearizationError: a block has abstract state, or an abstract input and no AutoDiffXd;
            names it.
    """
    for block in blocks(diagram):
        if block.system.num_abstract_states():
            raise LinearizationError(f"{block} has abstract state, which has no derivative")
    twin = twin_of(diagram)
    if twin is None:
        # First as a whole, for an input that is open shows its name here.
        diagram.EvalTimeDerivatives(context)
        for port in outputs:
            port.Eval(context)
        given = context.Clone()
        for port in inputs:  # an open one would stay open, and have no effect
            port.FixValue(given, port_value(port, context))
        return _assembled(pieces(diagram, given), inputs, outputs, discrete)
    return _of_twin(twin, diagram, context, inputs, outputs, discrete)


def port_value(port: InputPort, context: Context) -> Array:
    """Return what an input port reads, zeros if it is open.

    Args:
        port: the port.
        context: its diagram's context.
    """
    return port.Eval(context) if port.HasValue(context) else np.zeros(port.size())


def _of_twin(
    twin: Twin,
    diagram: Diagram,
    context: Context,
    inputs: Sequence[InputPort],
    outputs: Sequence[OutputPort],
    discrete: bool,
) -> FirstOrder:
    own, system = twin.context(diagram, context), twin.system
    width = sum(port.size() for port in inputs)
    column = twin.seed(context, own, discrete, width)
    total = column + width
    for port in inputs:
        u = port_value(port, context)
        dual = InitializeAutoDiff(u, total, column).ravel()
        system.get_input_port(port.get_index()).FixValue(own, dual)
        column += u.size
    f = system.EvalTimeDerivatives(own).CopyToVector()
    update = [_updated(block, own) for block in blocks(system)] if discrete else []
    y = [system.get_output_port(port.get_index()).Eval(own) for port in outputs]
    return FirstOrder(
        f=value_and_gradient(f, total), update=_stacked(update, total), y=_stacked(y, total)
    )


def _updated(block: Block, root: Context) -> np.ndarray:
    """Return the discrete state of a block after its next update."""
    system = block.system
    if not system.num_discrete_state_groups():
        return np.zeros(0)
    after = system.EvalUniquePeriodicDiscreteUpdate(system.GetMyContextFromRoot(root))
    return np.concatenate([after.get_vector(i).CopyToVector() for i in range(after.num_groups())])


def _stacked(values: Sequence[np.ndarray], width: int) -> tuple[Array, Array]:
    pairs = [value_and_gradient(v, width) for v in values]
    return (
        np.concatenate([np.zeros(0), *(v for v, _ in pairs)]),
        np.vstack([np.zeros((0, width)), *(g for _, g in pairs)]),
    )


def _assembled(
    found: Pieces, inputs: Sequence[InputPort], outputs: Sequence[OutputPort], discrete: bool
) -> FirstOrder:
    f, update, y = found.joined([p.get_name() for p in inputs], [p.get_name() for p in outputs])
    if not discrete:
        n, m = f[0].size, update[0].size
        keep = np.r_[0:n, n + m : f[1].shape[1]]
        f, y = (f[0], f[1][:, keep]), (y[0], y[1][:, keep])
        update = (np.zeros(0), np.zeros((0, keep.size)))
    return FirstOrder(f=f, update=update, y=y, by_differences=found.by_differences)
