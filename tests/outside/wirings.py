"""The loop of Fig. 8 wired by hand, as anyone might: random names, order, nesting and pieces."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from pydrake.systems.framework import (
    BasicVector,
    Context,
    ContinuousState,
    Diagram,
    DiagramBuilder,
    DiscreteValues,
    InputPort,
    LeafSystem,
    OutputPort,
    System,
)
from pydrake.systems.primitives import (
    ConstantVectorSource,
    Demultiplexer,
    DiscreteTimeDelay,
    FirstOrderLowPassFilter,
    Gain,
    Integrator,
    Multiplexer,
    PassThrough,
    VectorLogSink,
    ZeroOrderHold,
)

import cdpr_drake as cdpr
from cdpr_drake.diagrams import make_platform
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.servo import ServoSettings
from cdpr_drake.systems import (
    CableTangentCameras,
    CameraMeasurement,
    CatenaryCableForce,
    LoadCellFilter,
    MotorAngleIntegrator,
    PlausibleTension,
    PositionBasedVisualServo,
    WinchDynamics,
)

MODELS = ("ECM", "CMWE", "SCMWE", "SLSM")


class Lag(LeafSystem):
    """A lag that says nothing of its rest: it begins at zero.

    Args:
        size: of its ports.
        rate: [1/s].
    """

    def __init__(self, size: int, rate: float = 5.0) -> None:
        super().__init__()
        self._rate = rate
        self._input = self.DeclareVectorInputPort("into", size)
        state = self.DeclareContinuousState(size)
        self.DeclareStateOutputPort("out_of", state)

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        """Follow the input."""
        x = context.get_continuous_state_vector().CopyToVector()
        derivatives.SetFromVector(self._rate * (self._input.Eval(context) - x))


class SettlingLag(Lag):
    """One that answers: it settles at its input."""

    def settle(self, context: Context) -> None:
        """Show the input."""
        context.SetContinuousState(self._input.Eval(context))


class Memory(LeafSystem):
    """The last sample, of a block that says nothing of its rest.

    Args:
        size: of its ports.
        period: [s].
    """

    def __init__(self, size: int, period: float) -> None:
        super().__init__()
        self._input = self.DeclareVectorInputPort("into", size)
        self.DeclareDiscreteState(size)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        self.DeclareVectorOutputPort("out_of", size, self._calc, {self.xd_ticket()})

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        discrete.set_value(self._input.Eval(context))

    def _calc(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state_vector().CopyToVector())


class SettlingMemory(Memory):
    """One that answers: it settles at its input."""

    def settle(self, context: Context) -> None:
        """Show the input."""
        context.SetDiscreteState(self._input.Eval(context))


@dataclass
class Net:
    """Systems and wires, before they are a diagram.

    Attributes:
        draw: of all that is random.
        systems: all of them, in any order.
        wires: from outputs to inputs.
        open: inputs that become inputs of the diagram, by the name they get.
        at_fault: what cannot rest; the refusal names one of them.
    """

    draw: np.random.Generator
    systems: list[System] = field(default_factory=list)
    wires: list[tuple[OutputPort, InputPort]] = field(default_factory=list)
    open: list[tuple[str, InputPort]] = field(default_factory=list)
    at_fault: list[System] = field(default_factory=list)

    def add(self, system: System) -> System:
        """Add a `system` under a name of its own and return it."""
        system.set_name(f"{self.word()}{len(self.systems)}")
        self.systems.append(system)
        return system

    def word(self) -> str:
        """Return a random word."""
        return "".join(self.draw.choice(list("abcdefghijklmnopqrstuvwxyz"), 6))

    def connect(self, output: OutputPort, port: InputPort) -> None:
        """Connect an `output` to an input `port`."""
        self.wires.append((output, port))

    def through(self, output: OutputPort, system: System) -> OutputPort:
        """Add a `system` of one input behind an `output`, and return its output."""
        self.add(system)
        self.connect(output, system.get_input_port(0))
        return system.get_output_port(0)

    def maybe(self, chance: float = 0.5) -> bool:
        """Return True with a `chance`."""
        return bool(self.draw.random() < chance)

    def diagram(self) -> Diagram:
        """Return the diagram, with its systems in random sub-diagrams."""
        return self._grouped(self.systems, depth=0)[0]

    def _grouped(
        self, members: list[System], depth: int
    ) -> tuple[Diagram, dict[int, InputPort], dict[int, OutputPort]]:
        """Return a diagram of some systems, and its ports by the wires that they continue."""
        builder, draw = DiagramBuilder(), self.draw
        place: dict[int, int] = {}
        parts: list[tuple[System, dict[int, InputPort], dict[int, OutputPort]]] = []
        groups = min(int(draw.integers(0, 4)) if depth < 3 else 0, len(members) // 2)
        which = draw.integers(-1, groups, len(members)) if groups else np.full(len(members), -1)
        for group in range(groups):
            inside = [s for s, g in zip(members, which, strict=True) if g == group]
            if inside:
                sub, ins, outs = self._grouped(inside, depth + 1)
                sub.set_name(f"{self.word()}_{depth}{group}")
                parts.append((sub, ins, outs))
                place |= {id(s): len(parts) - 1 for s in inside}
        for s in (s for s, g in zip(members, which, strict=True) if g < 0):
            parts.append((s, {}, {}))
            place[id(s)] = len(parts) - 1
        for i in draw.permutation(len(parts)):
            builder.AddNamedSystem(parts[i][0].get_name(), parts[i][0])
        ins, outs = {}, {}
        exported: dict[tuple[int, int], int] = {}
        for n, (output, port) in enumerate(self.wires):
            source = place.get(id(output.get_system()))
            target = place.get(id(port.get_system()))
            if source == target and (source is None or parts[source][0] is not port.get_system()):
                continue  # of others, or inside one sub-diagram
            here = None if source is None else parts[source][2].get(n, output)
            there = None if target is None else parts[target][1].get(n, port)
            if here is not None and there is not None:
                builder.Connect(here, there)
            elif here is not None:
                key = (id(output.get_system()), int(output.get_index()))
                if key not in exported:
                    exported[key] = builder.ExportOutput(here, f"{self.word()}{n}")
                outs[n] = exported[key]
            elif there is not None:
                ins[n] = builder.ExportInput(there, f"{self.word()}{n}")
        for m, (name, port) in enumerate(self.open):
            target = place.get(id(port.get_system()))
            if target is not None:
                there = parts[target][1].get(-1 - m, port)
                ins[-1 - m] = builder.ExportInput(there, name if depth == 0 else f"{name}{m}")
        diagram = builder.Build()
        return (
            diagram,
            {n: diagram.get_input_port(i) for n, i in ins.items()},
            {n: diagram.get_output_port(i) for n, i in outs.items()},
        )


def fig_8(
    robot: cdpr.CableRobot, pose: np.ndarray, tensions: str, draw: np.random.Generator
) -> Net:
    """Return a random wiring of the loop around a robot.

    Args:
        robot: the robot.
        pose: where it is to rest.
        tensions: how they are distributed there.
        draw: of all that is random.
    """
    net = Net(draw)
    k = robot.num_cables
    plant = net.add(make_platform(robot))
    cables = net.add(CatenaryCableForce(robot))
    winches = net.add(WinchDynamics(robot))
    state = plant.get_state_output_port()
    halves = net.add(Demultiplexer([6, 6]))
    net.connect(state, halves.get_input_port())
    pose_port = halves.get_output_port(0)
    if net.maybe(0.3):  # put together again
        both = net.add(Multiplexer([6, 6]))
        for i in range(2):
            net.connect(halves.get_output_port(i), both.get_input_port(i))
        state = both.get_output_port(0)
    net.connect(state, cables.GetInputPort("platform_state"))
    for name in ("unstrained_length", "unstrained_length_rate"):
        net.connect(winches.GetOutputPort(name), cables.GetInputPort(name))
    wrench = cables.GetOutputPort("platform_wrench")
    if net.maybe(0.3):
        wrench = net.through(wrench, Gain(1.0, 6))
    net.connect(wrench, plant.get_applied_generalized_force_input_port())
    net.connect(
        cables.GetOutputPort("tension_at_drawing_point"),
        winches.GetInputPort("tension_at_drawing_point"),
    )
    desired = winches.GetInputPort("desired_motor_angle")
    if net.maybe(0.1):  # no controller at all
        net.open.append((net.word(), desired))
        return net
    rates = _law(net, robot, pose_port, cables, winches, pose)
    rest = rest_state(robot, pose, tensions)
    which = draw.choice(["ours", "Drake's", "Drake's, told"], p=[0.7, 0.1, 0.2])
    if which == "ours":
        integrator: System = MotorAngleIntegrator(k)
    elif which == "Drake's":
        integrator = Integrator(k)
        net.at_fault.append(winches)
    else:
        integrator = Integrator(rest.desired_motor_angles)
    angles = net.through(rates, integrator)
    net.connect(angles, desired)
    if net.maybe(0.3):
        net.connect(angles, net.add(VectorLogSink(k, publish_period=0.1)).get_input_port())
    return net


def _law(
    net: Net,
    robot: cdpr.CableRobot,
    pose_port: OutputPort,
    cables: System,
    winches: System,
    pose: np.ndarray,
) -> OutputPort:
    """Add measurements, samplers and the law; return the motor rates."""
    k, draw = robot.num_cables, net.draw
    period = float(draw.choice([0.0, 0.04, 0.05]))
    measured = pose_port
    if net.maybe(0.8):
        measured = net.through(measured, CameraMeasurement(robot))
    tangents = cables.GetOutputPort("tangents_at_drawing_point")
    if net.maybe(0.8):
        tangents = net.through(tangents, CableTangentCameras(robot))
    tension = _filtered(net, robot, winches.GetOutputPort("tension_at_winch"))
    ports = []
    for port, size in ((measured, 6), (tension, k), (tangents, 3 * k)):
        ports.append(_sampled(net, port, size, period))
    measured, tension, tangents = ports
    if net.maybe(0.7):
        judge = net.add(PlausibleTension(robot, period or None))
        net.connect(measured, judge.GetInputPort("measured_pose"))
        net.connect(tension, judge.GetInputPort("measured_tension"))
        tension = judge.GetOutputPort("plausible_tension")
    settings = ServoSettings(cable_model=str(draw.choice(MODELS)), gain=0.1)
    servo = net.add(PositionBasedVisualServo(robot, settings))
    net.connect(measured, servo.GetInputPort("measured_pose"))
    net.connect(tangents, servo.GetInputPort("measured_tangents"))
    net.connect(tension, servo.GetInputPort("measured_tension"))
    goal = servo.GetInputPort("desired_pose")
    if net.maybe():
        net.open.append((net.word(), goal))
    else:
        net.connect(net.add(ConstantVectorSource(pose)).get_output_port(), goal)
    rates = servo.GetOutputPort("motor_rates")
    if net.maybe(0.3):
        rates = net.through(rates, PassThrough(k))
    if period and net.maybe(0.8):
        rates = net.through(rates, ZeroOrderHold(period, k, offset_sec=0.8 * period))
    return rates


def _filtered(net: Net, robot: cdpr.CableRobot, tension: OutputPort) -> OutputPort:
    """Return the tension behind a filter, or none."""
    k = robot.num_cables
    makers = {
        "ours": lambda: LoadCellFilter(robot),
        "Drake's": lambda: FirstOrderLowPassFilter(0.08, k),
        "none": lambda: PassThrough(k),
        "silent": lambda: Lag(k),
        "answers": lambda: SettlingLag(k),
    }
    kind = str(net.draw.choice(list(makers), p=[0.45, 0.15, 0.15, 0.1, 0.15]))
    filtered = makers[kind]()
    output = net.through(tension, filtered)
    if kind == "silent":
        net.at_fault.append(filtered)
    return output


def _sampled(net: Net, port: OutputPort, size: int, period: float) -> OutputPort:
    """Return a measurement behind a sampler, or none."""
    if not period:
        return port
    kind = str(
        net.draw.choice(
            ["none", "hold", "delay", "silent", "answers"], p=[0.3, 0.3, 0.2, 0.05, 0.15]
        )
    )
    if kind == "none":
        return port
    makers = {
        "hold": lambda: ZeroOrderHold(period, size),
        "delay": lambda: DiscreteTimeDelay(period, int(net.draw.integers(1, 4)), size),
        "silent": lambda: Memory(size, period),
        "answers": lambda: SettlingMemory(size, period),
    }
    sampler = makers[kind]()
    output = net.through(port, sampler)
    if kind == "silent":
        net.at_fault.append(sampler)
    return output
