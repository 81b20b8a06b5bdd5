"""What the control loops share: the plant with its parts, references, exports, sources of noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

from pydrake.common import RandomDistribution
from pydrake.systems.framework import Diagram, DiagramBuilder, InputPort, OutputPort, System
from pydrake.systems.primitives import Adder, RandomSource
from pydrake.trajectories import Trajectory

from cdpr_drake.diagrams.robot import ROBOT_OUTPUTS
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.systems import TrajectoryReference, ZeroWhenOpen

SystemOrMaker: TypeAlias = System | Callable[[CableRobot], System]
"""A system, which fits in one diagram, or what makes one for a robot, which fits in any number."""


def made(slot: SystemOrMaker, robot: CableRobot, what: str) -> System:
    """Return what a slot holds, as a system.

    Args:
        slot: a system, or what makes one.
        robot: to make it for.
        what: it is, for the message.

    Raises:
        TypeError: it is neither.
        ValueError: the system is part of a diagram already.
    """
    system = slot if isinstance(slot, System) or not callable(slot) else slot(robot)
    if not isinstance(system, System):
        made_by = f" from {slot!r}" if system is not slot else ""
        raise TypeError(
            f"a {what} is a Drake system, or makes one for a robot; got {system!r}{made_by}"
        )
    path = system.GetSystemPathname().removeprefix("::")
    if "::" in path:
        raise ValueError(f'the {what} is in a diagram already, as "{path}"; {_ONE_EACH}')
    return system


_ONE_EACH = "a system fits in one place: give what makes one, lambda robot: ..."


def add_once(builder: DiagramBuilder, name: str, system: System, what: str) -> System:
    """Add a user's system to a loop and return it.

    Args:
        builder: of the loop.
        name: of the block.
        system: as `made` returns it.
        what: it is, for the message.

    Raises:
        ValueError: it is in the loop already, at which Drake would end the process.
    """
    if any(other is system for other in builder.GetSystems()):
        raise ValueError(
            f'the {what} is in the loop already, as "{system.get_name()}"; {_ONE_EACH}'
        )
    return builder.AddNamedSystem(name, system)


def class_of(system: System) -> str:
    """Return what messages call a user's `system`: its class, not its address."""
    return type(system).__name__


def check_robot(robot: object, what: str = "a loop is made for") -> None:
    """Raise TypeError, with what is wanted, unless something is a `robot`; `what` begins it."""
    if isinstance(robot, CableRobot):
        return
    hint = f'; load_robot("{robot}") makes one' if isinstance(robot, str) else ""
    raise TypeError(f"{what} a CableRobot, got {robot!r}{hint}")


def add_plant(
    builder: DiagramBuilder, plant: System, robot: CableRobot, parts: tuple[SystemOrMaker, ...]
) -> InputPort:
    """Add the block "robot", and parts that pull at its platform; return its input for a wrench.

    Args:
        builder: of the loop.
        plant: as `make_plant` makes it.
        robot: the true robot.
        parts: systems with an output "wrench" (6) [torque; force] on the platform at its origin in
            W, and inputs called as outputs of the plant.

    Raises:
        TypeError: a part is none, or not in a tuple.
        ValueError: a part lacks the output, has an input that the plant does not have, or is in a
            diagram already.
    """
    if not isinstance(parts, Sequence):
        raise TypeError(f"parts of the plant are a tuple, (part,) for one; got {parts!r}")
    builder.AddNamedSystem("robot", plant)
    target = plant.GetInputPort("external_wrench")
    if not parts:
        return target
    external = builder.AddNamedSystem("external_wrench", ZeroWhenOpen(6))
    total = builder.AddNamedSystem("wrench_of_parts", Adder(len(parts) + 1, 6))
    builder.Connect(external.get_output_port(), total.get_input_port(0))
    builder.Connect(total.get_output_port(), target)
    for number, slot in enumerate(parts, 1):
        part = made(slot, robot, "part of the plant")
        name = _free_name(builder, part, f"part_{number}")
        add_once(builder, name, part, "part of the plant")
        if not part.HasOutputPort("wrench"):
            raise ValueError(f'{class_of(part)} has no output "wrench" on the platform')
        builder.Connect(part.GetOutputPort("wrench"), total.get_input_port(number))
        for i in range(part.num_input_ports()):
            port = part.get_input_port(i)
            if not plant.HasOutputPort(port.get_name()):
                known = ", ".join(ROBOT_OUTPUTS)
                raise ValueError(
                    f'a part has an input "{port.get_name()}", and the plant has: {known}'
                )
            builder.Connect(plant.GetOutputPort(port.get_name()), port)
    return external.get_input_port()


def add_reference(
    builder: DiagramBuilder,
    reference: SystemOrMaker | Trajectory | None,
    robot: CableRobot,
    wanted: Mapping[str, list[InputPort]],
) -> None:
    """Feed inputs by a block "reference"; export those that it does not have, or all without one.

    Args:
        builder: of the loop.
        reference: a system with outputs "desired_pose" and perhaps "desired_twist", what makes one
            for a robot, or a Drake trajectory of poses.
        robot: the true robot.
        wanted: inputs by the name of what they want.

    Raises:
        TypeError: it is none.
        ValueError: it has no output "desired_pose", or is in a diagram already.
    """
    system = None
    if reference is not None:
        if isinstance(reference, Trajectory):
            reference = TrajectoryReference(reference)
        system = add_once(builder, "reference", made(reference, robot, "reference"), "reference")
        if not system.HasOutputPort("desired_pose"):
            raise ValueError(f'the reference, {class_of(system)}, has no output "desired_pose"')
        builder.ExportOutput(system.GetOutputPort("desired_pose"), "desired_pose")
    for name, ports in wanted.items():
        if not ports:
            continue
        if system is not None and system.HasOutputPort(name):
            for port in ports:
                builder.Connect(system.GetOutputPort(name), port)
        else:
            index = builder.ExportInput(ports[0], name)
            for port in ports[1:]:
                builder.ConnectInput(index, port)


def add_noise(
    builder: DiagramBuilder, ports: Mapping[str, InputPort], noise: bool, period: float
) -> None:
    """Export inputs for noise, or feed each by a source that is called like it.

    Args:
        builder: of the loop.
        ports: the inputs by name.
        noise: whether to feed them.
        period: how long a sample lasts [s].
    """
    for name, port in ports.items():
        if not noise:
            builder.ExportInput(port, name)
            continue
        source = RandomSource(RandomDistribution.kGaussian, port.size(), period)
        builder.Connect(builder.AddNamedSystem(name, source).get_output_port(), port)


def finish(builder: DiagramBuilder, plant: System, name: str) -> Diagram:
    """Export the plant's outputs and return the diagram.

    Args:
        builder: of the loop.
        plant: its plant.
        name: of the diagram.
    """
    for port in (*ROBOT_OUTPUTS, "desired_motor_angles"):
        builder.ExportOutput(plant.GetOutputPort(port), port)
    diagram = builder.Build()
    diagram.set_name(name)
    return diagram


def export(builder: DiagramBuilder, ports: Mapping[str, OutputPort]) -> None:
    """Export outputs by name.

    Args:
        builder: of the loop.
        ports: the outputs.
    """
    for name, port in ports.items():
        builder.ExportOutput(port, name)


def _free_name(builder: DiagramBuilder, system: System, otherwise: str) -> str:
    """Return a system's own name, if it has been given one that is free."""
    name = system.get_name()
    given = name and not name.startswith(type(system).__name__) and "/" not in name
    taken = any(other.get_name() == name for other in builder.GetSystems())
    return name if given and not taken else otherwise
