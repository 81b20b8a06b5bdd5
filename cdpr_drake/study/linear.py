"""Linear models of continuous diagrams: several ports at once, by name, without Drake's crashes."""

from __future__ import annotations

import warnings
from collections.abc import Iterable

import numpy as np
from pydrake.systems.framework import Context, Diagram, InputPort, OutputPort, PortDataType

from cdpr_drake.diagrams.blocks import blocks, continuous_state_names
from cdpr_drake.errors import LinearizationError
from cdpr_drake.model.signals import vector_names
from cdpr_drake.study.first_order import first_order, port_value
from cdpr_drake.study.state_space import StateSpace
from cdpr_drake.study.twin import open_ports_named


class LinearizationWarning(UserWarning):
    """A linear model is right, but may not be the one that was meant."""


def linearize(
    diagram: Diagram,
    context: Context,
    inputs: Iterable[str] | None = None,
    outputs: Iterable[str] | None = None,
    *,
    require_equilibrium: bool | None = None,
) -> StateSpace:
    """Return the linear model of a continuous diagram about a context, by its ports' names.

    dx/dt = f0 + A (x - x0) + B (u - u0), y = y0 + C (x - x0) + D (u - u0), by AutoDiffXd,
    block by block with differences for those that have none (`by_differences` names them). The
    diagram is converted at the first call; later ones take milliseconds. The time stands still: the
    gain of a control law is what it is at the context's time, and a LinearizationWarning says so
    where that is still on its ramp (`equilibrium` gives a context past it).

    Args:
        diagram: any diagram, or a single system, all of its state continuous.
        context: the point, in time too.
        inputs: names of vector input ports, open ones counting as zero; those that have a value if
            None.
        outputs: names of vector output ports; all of them if None.
        require_equilibrium: True raises an error if the state would not stay (some |dx/dt| above
            1e-6), False accepts it silently, None warns. The model tells by `is_equilibrium` and
            `derivatives`.

    Raises:
        LinearizationError: a block has discrete or abstract state, or an abstract input and no
            AutoDiffXd; an input port without which nothing can be computed is open; no
            equilibrium, where one is required. The message names block or port.
        KeyError: there is no port of that name.
    """
    return Linearizer(diagram)._linearize(context, inputs, outputs, require_equilibrium)


class Linearizer:
    """A continuous diagram ready to be linearised many times; see `linearize`.

    Args:
        diagram: any diagram, or a single system, all of its state continuous.

    Raises:
        LinearizationError: a block has discrete or abstract state.
    """

    def __init__(self, diagram: Diagram) -> None:
        for block in blocks(diagram):
            if block.system.num_discrete_state_groups():
                raise LinearizationError(
                    f"{block} has discrete state: linearize takes all-continuous diagrams "
                    "(sample_time=None, no noise sources); for a sampled loop ask one_period_map"
                )
        self.diagram = diagram
        self._states = continuous_state_names(diagram)

    def __call__(
        self,
        context: Context,
        inputs: Iterable[str] | None = None,
        outputs: Iterable[str] | None = None,
        *,
        require_equilibrium: bool | None = None,
    ) -> StateSpace:
        """Return the linear model about a context; arguments and errors as for `linearize`.

        Args:
            context: the point, in time too.
            inputs: names of vector input ports.
            outputs: names of vector output ports.
            require_equilibrium: whether the state has to stay where it is.
        """
        return self._linearize(context, inputs, outputs, require_equilibrium)

    def _linearize(
        self,
        context: Context,
        inputs: Iterable[str] | None,
        outputs: Iterable[str] | None,
        require_equilibrium: bool | None,
    ) -> StateSpace:
        diagram, n = self.diagram, len(self._states)
        with open_ports_named(diagram, "linearize"):
            in_ports = input_ports(diagram, context, inputs)
            out_ports = output_ports(diagram, outputs)
            found = first_order(diagram, context, in_ports, out_ports)
        (f0, AB), (y0, CD) = found.f, found.y
        u0 = [port_value(port, context) for port in in_ports]
        model = StateSpace(
            A=AB[:, :n],
            B=AB[:, n:],
            C=CD[:, :n],
            D=CD[:, n:],
            states=self._states,
            inputs=port_names(in_ports),
            outputs=port_names(out_ports),
            time=context.get_time(),
            x0=context.get_continuous_state_vector().CopyToVector() if n else np.zeros(0),
            u0=np.concatenate([np.zeros(0), *u0]),
            y0=y0,
            derivatives=f0,
            by_differences=found.by_differences,
        )
        self._check(model, require_equilibrium)
        return model

    def _check(self, model: StateSpace, require_equilibrium: bool | None) -> None:
        warn_on_ramp(self.diagram, model.time, stacklevel=5)
        if require_equilibrium is False or model.is_equilibrium:
            return
        worst = int(np.argmax(np.abs(model.derivatives)))
        message = (
            f"not an equilibrium: d/dt {model.states[worst]} = {model.derivatives[worst]:.3g} "
            f"at t = {model.time:g} s"
        )
        if require_equilibrium:
            raise LinearizationError(message)
        warnings.warn(message, LinearizationWarning, stacklevel=4)


def warn_on_ramp(diagram: Diagram, time: float, stacklevel: int = 2) -> None:
    """Warn of each block of a diagram that does something else later: whose gain still rises.

    Args:
        diagram: the diagram.
        time: [s].
        stacklevel: as for `warnings.warn`.
    """
    for block in blocks(diagram):
        steady_after = block.answer("steady_after")
        if steady_after is not None and time < steady_after:
            describe = block.answer("transient")
            what = f"has {describe(time)}" if describe is not None else "is on its way"
            warnings.warn(
                f"{block} {what} at t = {time:g} s: set the context's time to "
                f"{steady_after:g} s or later",
                LinearizationWarning,
                stacklevel=stacklevel,
            )


def input_ports(diagram: Diagram, context: Context, names: Iterable[str] | None) -> list[InputPort]:
    """Return the vector input ports of the given names, or those that have a value.

    Args:
        diagram: the diagram.
        context: its context.
        names: of the ports, or None.

    Raises:
        KeyError: there is no vector input port of that name.
        LinearizationError: a port asked for is open, and nothing can be computed without it.
    """
    if names is None:
        ports = [diagram.get_input_port(i) for i in range(diagram.num_input_ports())]
        return [p for p in ports if _is_vector(p) and p.HasValue(context)]
    ports = [_port(diagram, name, "input") for name in _listed(names)]
    if any(not port.HasValue(context) for port in ports):
        # An optional port that is open counts as zero; a required one shows here, by Drake's error.
        diagram.EvalTimeDerivatives(context)
        for i in range(diagram.num_output_ports()):
            diagram.get_output_port(i).Eval(context)
    return ports


def output_ports(diagram: Diagram, names: Iterable[str] | None) -> list[OutputPort]:
    """Return the vector output ports of the given names, or all of them.

    Args:
        diagram: the diagram.
        names: of the ports, or None.

    Raises:
        KeyError: there is no vector output port of that name.
    """
    if names is None:
        ports = [diagram.get_output_port(i) for i in range(diagram.num_output_ports())]
        return [p for p in ports if _is_vector(p)]
    return [_port(diagram, name, "output") for name in _listed(names)]


def port_names(ports: Iterable[InputPort | OutputPort]) -> tuple[str, ...]:
    """Return the names of all entries of some ports.

    Args:
        ports: vector ports.
    """
    return tuple(n for port in ports for n in vector_names(port.get_name(), port.size()))


def _listed(names: Iterable[str]) -> list[str]:
    return [names] if isinstance(names, str) else list(names)


def _is_vector(port: InputPort | OutputPort) -> bool:
    return port.get_data_type() == PortDataType.kVectorValued


def _port(diagram: Diagram, name: str, kind: str) -> InputPort | OutputPort:
    has = diagram.HasInputPort if kind == "input" else diagram.HasOutputPort
    get = diagram.GetInputPort if kind == "input" else diagram.GetOutputPort
    port = get(name) if has(name) else None
    if port is None or not _is_vector(port):
        count = diagram.num_input_ports() if kind == "input" else diagram.num_output_ports()
        at = diagram.get_input_port if kind == "input" else diagram.get_output_port
        known = ", ".join(at(i).get_name() for i in range(count) if _is_vector(at(i)))
        raise KeyError(f'no vector {kind} port "{name}"; there are: {known or "none"}')
    return port
