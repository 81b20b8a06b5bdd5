"""A diagram to first order, put together from its blocks: for those that lack AutoDiffXd.

Each block is linearised by itself, by AutoDiffXd or else by differences, and the wires between them
make one linear model of the whole: u = W y + V e for the blocks' inputs and outputs and the
diagram's inputs e, so that y = (I - D W)^-1 (C z + D V e).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.autodiffutils import InitializeAutoDiff
from pydrake.systems.framework import (
    Context,
    Diagram,
    InputPort,
    LeafSystem,
    OutputPort,
    OutputPortIndex,
    PortDataType,
    System,
)

from cdpr_drake.diagrams.blocks import Block, blocks
from cdpr_drake.errors import LinearizationError
from cdpr_drake.study.state_space import Array
from cdpr_drake.study.twin import value_and_gradient

STEP = 1e-4
"""Of a difference, and more where a variable is above 100: their errors are of order STEP^4."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Piece:
    """One block to first order: values and derivatives by its [x; d; u].

    Attributes:
        sizes: of x, d and u.
        f: dx/dt.
        update: d after the block's next update.
        y: vector outputs one after another.
        exact: whether by AutoDiffXd.
    """

    sizes: tuple[int, int, int]
    f: tuple[Array, Array]
    update: tuple[Array, Array]
    y: tuple[Array, Array]
    exact: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Pieces:
    """All blocks of a diagram to first order, and the wires between them.

    Attributes:
        diagram: the diagram.
        blocks: in the order of its state.
        pieces: one for each.
    """

    diagram: Diagram
    blocks: tuple[Block, ...]
    pieces: tuple[Piece, ...]

    @property
    def by_differences(self) -> tuple[str, ...]:
        """The names of the blocks without AutoDiffXd."""
        pairs = zip(self.blocks, self.pieces, strict=True)
        return tuple("/".join(block.path) for block, piece in pairs if not piece.exact)

    def joined(
        self, inputs: Sequence[str], outputs: Sequence[str]
    ) -> tuple[tuple[Array, Array], tuple[Array, Array], tuple[Array, Array]]:
        """Return dx/dt, updates and outputs with their derivatives by [x; d; e] of the diagram.

        Args:
            inputs: names of the diagram's input ports, which make up e.
            outputs: names of its output ports.
        """
        n, m = (sum(piece.sizes[i] for piece in self.pieces) for i in range(2))
        W, V = self._wires(inputs)
        f, update, y = (self._side_by_side(kind) for kind in ("f", "update", "y"))
        # y by [x; d; e], then u, then all else.
        C, D = y[1][:, : n + m], y[1][:, n + m :]
        Y = np.linalg.solve(np.eye(len(D)) - D @ W, np.hstack([C, D @ V]))
        U = W @ Y
        U[:, n + m :] += V
        e = V.shape[1]
        F, G = (
            np.pad(J[:, : n + m], ((0, 0), (0, e))) + J[:, n + m :] @ U for J in (f[1], update[1])
        )
        places, _ = self._places()
        rows = [np.r_[places[self._exported(name)]] for name in outputs]
        picked = np.concatenate([np.zeros(0, int), *rows])
        return (f[0], F), (update[0], G), (y[0][picked], Y[picked])

    def _side_by_side(self, kind: str) -> tuple[Array, Array]:
        """Return values of all blocks and their derivatives by all [x; d; u], which do not mix."""
        ends = [np.cumsum([0, *(piece.sizes[i] for piece in self.pieces)]) for i in range(3)]
        starts = np.cumsum([0, *(end[-1] for end in ends)])
        found = [getattr(piece, kind) for piece in self.pieces]
        value = np.concatenate([np.zeros(0), *(v for v, _ in found)])
        whole, row = np.zeros((value.size, starts[-1])), 0
        for i, (_, J) in enumerate(found):
            columns = [s + np.arange(e[i], e[i + 1]) for s, e in zip(starts, ends, strict=False)]
            whole[row : row + len(J), np.concatenate(columns)] = J
            row += len(J)
        return value, whole

    def _wires(self, inputs: Sequence[str]) -> tuple[Array, Array]:
        """Return W, V of u = W y + V e, with e the named inputs of the diagram."""
        sources, targets = self._places()
        sizes = [self.diagram.GetInputPort(name).size() for name in inputs]
        e = np.cumsum([0, *sizes])
        u = sum(piece.sizes[2] for piece in self.pieces)
        W, V = np.zeros((u, sum(len(piece.y[0]) for piece in self.pieces))), np.zeros((u, e[-1]))
        for key, part in targets.items():
            source = self._source(*key)
            if source in inputs:
                i = inputs.index(source)
                V[part, e[i] : e[i + 1]] = np.eye(sizes[i])
            elif isinstance(source, tuple):
                W[part, sources[source]] = np.eye(part.stop - part.start)
        return W, V

    def _places(self) -> tuple[dict[_Key, slice], dict[_Key, slice]]:
        """Return where the outputs of the blocks are in y, and their inputs in u."""
        places: tuple[dict[_Key, slice], dict[_Key, slice]] = ({}, {})
        for found, ports in zip(places, (vector_outputs, vector_inputs), strict=True):
            start = 0
            for block in self.blocks:
                for port in ports(block.system):
                    found[block.path, int(port.get_index())] = slice(start, start + port.size())
                    start += port.size()
        return places

    def _source(self, path: tuple[str, ...], index: int) -> _Key | str | None:
        """Return what feeds an input of a block: another's output, or an input of the diagram."""
        if not hasattr(self.diagram, "GetSystems"):
            return str(self.diagram.get_input_port(index).get_name())
        diagrams = [self.diagram]
        for name in path[:-1]:
            diagrams.append(diagrams[-1].GetSubsystemByName(name))
        for depth in range(len(path) - 1, -1, -1):
            diagram, name = diagrams[depth], path[depth]
            for (target, entered), (source, left) in diagram.connection_map().items():
                if target.get_name() == name and int(entered) == index:
                    return _output(path[:depth], source, left)
            for i in range(diagram.num_input_ports()):
                port = diagram.get_input_port(i)
                locators = diagram.GetInputPortLocators(port.get_index())
                if any(s.get_name() == name and int(at) == index for s, at in locators):
                    index = i
                    break
            else:
                return None
        return str(self.diagram.get_input_port(index).get_name())

    def _exported(self, name: str) -> _Key:
        index = self.diagram.GetOutputPort(name).get_index()
        if not hasattr(self.diagram, "GetSystems"):
            return self.blocks[0].path, int(index)
        return _output((), *self.diagram.get_output_port_locator(index))


_Key = tuple[tuple[str, ...], int]


def pieces(diagram: Diagram, context: Context) -> Pieces:
    """Return the blocks of a diagram to first order about a context.

    Args:
        diagram: the diagram.
        context: the point.

    Raises:
        LinearizationError: a block has an abstract input that is connected, or an input open that
            it needs.
    """
    inside = tuple(blocks(diagram))
    found = tuple(_piece(block, block.context(context)) for block in inside)
    return Pieces(diagram=diagram, blocks=inside, pieces=found)


def vector_inputs(system: System) -> list[InputPort]:
    """Return the vector input ports of a `system`."""
    ports = (system.get_input_port(i) for i in range(system.num_input_ports()))
    return [port for port in ports if port.get_data_type() == PortDataType.kVectorValued]


def vector_outputs(system: System) -> list[OutputPort]:
    """Return the vector output ports of a `system`."""
    ports = (system.get_output_port(i) for i in range(system.num_output_ports()))
    return [port for port in ports if port.get_data_type() == PortDataType.kVectorValued]


def _output(path: tuple[str, ...], system: System, index: int) -> _Key:
    """Return the block, and its port, behind an output of a system or diagram at a path."""
    while hasattr(system, "GetSystems"):
        path = (*path, system.get_name())
        system, index = system.get_output_port_locator(OutputPortIndex(int(index)))
    return (*path, system.get_name()), int(index)


def _piece(block: Block, own: Context) -> Piece:
    system = block.system
    ports = vector_inputs(system)
    others = {system.get_input_port(i) for i in range(system.num_input_ports())} - set(ports)
    if any(port.HasValue(own) for port in others):  # a MultibodyPlant has some, open
        raise LinearizationError(f"{block} takes an abstract input, which has no derivative")
    x = own.get_continuous_state_vector().CopyToVector()
    d = [own.get_discrete_state(i).CopyToVector() for i in range(len(block.group_sizes))]
    u = [port.Eval(own) if port.HasValue(own) else None for port in ports]
    shown = [np.zeros(p.size()) if v is None else v for p, v in zip(ports, u, strict=True)]
    parts = [x, *d, *shown]
    twin = system.ToAutoDiffXdMaybe()
    local = (system if twin is None else twin).CreateDefaultContext()
    local.SetTimeStateAndParametersFrom(own)

    def evaluate(z: np.ndarray) -> tuple[np.ndarray, ...]:
        return _evaluated(system if twin is None else twin, local, z, parts, len(d), u)

    z = np.concatenate([np.zeros(0), *parts])
    if twin is None:
        f, update, y = _differences(evaluate, z)
    else:
        duals = evaluate(InitializeAutoDiff(z).ravel() if z.size else z)
        f, update, y = (value_and_gradient(v, z.size) for v in duals)
    sizes = (x.size, sum(v.size for v in d), z.size - x.size - sum(v.size for v in d))
    return Piece(sizes=sizes, f=f, update=update, y=y, exact=twin is not None)


def _evaluated(
    system: LeafSystem,
    own: Context,
    z: np.ndarray,
    parts: Sequence[Array],
    groups: int,
    inputs: Sequence[Array | None],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return dx/dt, the updated discrete state and the outputs of a block at z = [x; d; u].

    An input that is open stays open: the block then does without it, whatever z says.
    """
    cut = np.split(z, np.cumsum([part.size for part in parts])[:-1])
    if parts[0].size:
        own.SetContinuousState(cut[0])
    for group in range(groups):
        own.SetDiscreteState(group, cut[1 + group])
    ports = vector_inputs(system)
    for port, given, value in zip(ports, inputs, cut[1 + groups :], strict=True):
        if given is not None:
            port.FixValue(own, value)
    f = system.EvalTimeDerivatives(own).CopyToVector()
    update = np.zeros(0)
    if groups:
        after = system.EvalUniquePeriodicDiscreteUpdate(own)
        update = np.concatenate([after.get_vector(i).CopyToVector() for i in range(groups)])
    y = [port.Eval(own) for port in vector_outputs(system)]
    return f, update, np.concatenate([np.zeros(0), *y])


def _differences(
    evaluate: Callable[[Array], tuple[Array, ...]], z: Array
) -> list[tuple[Array, Array]]:
    """Return values and derivatives by central differences, extrapolated once (Richardson)."""
    values = evaluate(z)
    columns: list[list[Array]] = [[] for _ in values]
    for i in range(z.size):
        h = STEP * max(1.0, abs(z[i]) / 100.0)
        slopes = []
        for step in (h, 0.5 * h):
            ahead, behind = z.copy(), z.copy()
            ahead[i] += step
            behind[i] -= step
            pairs = zip(evaluate(ahead), evaluate(behind), strict=True)
            slopes.append([(a - b) / (ahead[i] - behind[i]) for a, b in pairs])
        for k, column in enumerate(columns):
            column.append((4.0 * slopes[1][k] - slopes[0][k]) / 3.0)
    return [
        (v, np.column_stack(c) if c else np.zeros((v.size, 0)))
        for v, c in zip(values, columns, strict=True)
    ]
