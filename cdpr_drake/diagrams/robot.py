"""The robot itself: platform, cables and winches; with load cells and integrator, the plant."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RotationalInertia, RpyFloatingJoint, SpatialInertia, UnitInertia
from pydrake.systems.framework import (
    Context,
    Diagram,
    DiagramBuilder,
    InputPort,
    OutputPort,
    System,
)
from pydrake.systems.primitives import Adder, AffineSystem, Demultiplexer, PassThrough

from cdpr_drake.model.cables import packed_sizes
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.vision.outages import Outage
from cdpr_drake.systems import (
    CatenaryCableForce,
    FusedPlant,
    LoadCellFilter,
    MotorAngleIntegrator,
    WinchDynamics,
    ZeroWhenOpen,
)
from cdpr_drake.systems.fused_plant import check_command, fused_refusal

ROBOT_OUTPUTS = (
    "pose",
    "platform_state",
    "tension_at_winch",
    "tension_at_drawing_point",
    "tension_at_attachment_point",
    "tangents_at_drawing_point",
    "tangents_at_attachment_point",
    "dbeta",
    "unstrained_length",
    "motor_angles",
    "motor_rates",
    "motor_torques",
    "platform_acceleration",
)
"""The output ports of `make_cable_robot`, which plants and control loops export too."""


def make_platform(robot: CableRobot) -> MultibodyPlant:
    """Return the finalized plant of one rigid body on an RpyFloatingJoint named "platform".

    Its state is [roll, pitch, yaw, x, y, z, omega, v] in W; its applied_generalized_force port
    takes the wrench [torque; force] at the platform's origin in W.

    Args:
        robot: the robot, for mass, centre of mass and inertia of platform and payload together.
    """
    plant = MultibodyPlant(0.0)
    inertia = robot.inertia
    about_com = RotationalInertia(
        *np.diag(inertia), Ixy=inertia[0, 1], Ixz=inertia[0, 2], Iyz=inertia[1, 2]
    )
    central = SpatialInertia(
        robot.mass, np.zeros(3), UnitInertia().SetFromRotationalInertia(about_com, robot.mass)
    )
    body = plant.AddRigidBody("platform", central.Shift(-robot.center_of_mass))
    plant.AddJoint(RpyFloatingJoint("platform", plant.world_frame(), body.body_frame()))
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -robot.gravity])
    plant.Finalize()
    return plant


def make_cable_robot(robot: CableRobot) -> Diagram:
    """Return the diagram of the platform on its cables and winches.

    .. pydrake_system::

        name: cable_robot
        input_ports:
        - desired_motor_angles
        - external_wrench (may stay open)
        output_ports:
        - pose
        - platform_state
        - tension_at_winch
        - tension_at_drawing_point
        - tension_at_attachment_point
        - tangents_at_drawing_point
        - tangents_at_attachment_point
        - dbeta
        - unstrained_length
        - motor_angles
        - motor_rates
        - motor_torques
        - platform_acceleration

    Blocks: "platform", "cables", "winches", and "transmission" from motor angles to lengths; the
    rest splits and adds signals. pose (6) is [roll, pitch, yaw, x, y, z] (rad, m) of X_WP;
    external_wrench (6) is [torque; force] at the platform's origin in W; platform_acceleration (6)
    is [angular acceleration; acceleration of the platform's origin] in W (rad/s2, m/s2).

    Args:
        robot: the robot; any number of cables.
    """
    builder = DiagramBuilder()
    desired, wrench, outputs = _add_robot(builder, robot)
    builder.ExportInput(desired, "desired_motor_angles")
    builder.ExportInput(wrench, "external_wrench")
    for name in ROBOT_OUTPUTS:
        builder.ExportOutput(outputs[name], name)
    diagram = builder.Build()
    diagram.set_name("cable_robot")
    return diagram


def make_plant(
    robot: CableRobot,
    *,
    believed: CableRobot | None = None,
    command: str = "motor_rates",
    load_cells: bool = True,
    outages: tuple[Outage, ...] = (),
    fast: bool = False,
) -> System:
    """Return all that is continuous in a control loop: robot, load cells and integrator.

    .. pydrake_system::

        name: plant
        input_ports:
        - motor_rates (or desired_motor_angles, as `command` says)
        - external_wrench (may stay open)
        - tension_noise (may stay open; with load cells)
        output_ports:
        - those of make_cable_robot
        - measured_tension (with load cells)
        - desired_motor_angles

    Blocks: those of `make_cable_robot`, "load_cells", and "integrator" if motor rates command. The
    fast one is a `FusedPlant`, a single system with the same ports, the same names of states in the
    same order, and the same equations: for floats only, so not to linearise.

    Args:
        robot: the true robot; any number of cables.
        believed: the robot as the controller believes it; the true one if None.
        command: "motor_rates", which the plant integrates, or "desired_motor_angles".
        load_cells: whether the winches have them.
        outages: when load cells are stuck or dead; those of other sensors do not count.
        fast: whether to return the fast one.

    Raises:
        ValueError: an unknown command; an outage of a load cell that is not there; where fast, what
            `fused_refusal` says.
    """
    check_command(command)
    if fast:
        refusal = fused_refusal(robot, outages=outages, load_cells=load_cells)
        if refusal:
            raise ValueError(refusal)
        return FusedPlant(robot, believed, command=command, load_cells=load_cells)
    builder = DiagramBuilder()
    desired, wrench, outputs = _add_robot(builder, robot)
    cells = None
    if load_cells:
        cells = builder.AddNamedSystem("load_cells", LoadCellFilter(robot, believed, outages))
        builder.Connect(outputs["tension_at_winch"], cells.GetInputPort("tension_at_winch"))
    if command == "motor_rates":
        integrator = MotorAngleIntegrator(robot.num_cables)
        commanded = builder.AddNamedSystem("integrator", integrator)
        builder.ExportInput(commanded.get_input_port(), command)
        builder.Connect(commanded.get_output_port(), desired)
    else:
        commanded = builder.AddNamedSystem("command", PassThrough(robot.num_cables))
        builder.ConnectInput(builder.ExportInput(commanded.get_input_port(), command), desired)
    builder.ExportInput(wrench, "external_wrench")
    if cells is not None:
        builder.ExportInput(cells.GetInputPort("noise"), "tension_noise")
    for name in ROBOT_OUTPUTS:
        builder.ExportOutput(outputs[name], name)
    if cells is not None:
        builder.ExportOutput(cells.get_output_port(), "measured_tension")
    builder.ExportOutput(commanded.get_output_port(), "desired_motor_angles")
    diagram = builder.Build()
    diagram.set_name("plant")
    return diagram


def _add_robot(
    builder: DiagramBuilder, robot: CableRobot
) -> tuple[InputPort, InputPort, dict[str, OutputPort]]:
    """Add the blocks of a robot; return its inputs for desired angles and wrench, its outputs."""
    k = robot.num_cables
    plant = builder.AddNamedSystem("platform", make_platform(robot))
    cables = builder.AddNamedSystem("cables", CatenaryCableForce(robot))
    winches = builder.AddNamedSystem("winches", WinchDynamics(robot))
    external = builder.AddNamedSystem("external_wrench", ZeroWhenOpen(6))
    total = builder.AddNamedSystem("total_wrench", Adder(2, 6))

    state = plant.get_state_output_port()
    pose, _ = _split(builder, "platform_pose", state, [6, 6])
    motion = builder.AddNamedSystem("transmission", _transmission(robot))
    builder.Connect(winches.GetOutputPort("state"), motion.get_input_port())
    length, length_rate = _split(builder, "length_and_rate", motion.get_output_port(), [k, k])
    angle, rate, _ = _split(builder, "motor_state", winches.GetOutputPort("state"), [k, k, k])
    builder.Connect(state, cables.GetInputPort("platform_state"))
    builder.Connect(length, cables.GetInputPort("unstrained_length"))
    builder.Connect(length_rate, cables.GetInputPort("unstrained_length_rate"))
    sizes = packed_sizes(k)
    parts = _split(builder, "cable_outputs", cables.GetOutputPort("packed"), list(sizes.values()))
    outputs = dict(zip(sizes, parts, strict=True))
    tension = outputs["tension_at_drawing_point"]
    builder.Connect(tension, winches.GetInputPort("tension_at_drawing_point"))
    builder.Connect(outputs.pop("platform_wrench"), total.get_input_port(0))
    builder.Connect(external.get_output_port(), total.get_input_port(1))
    builder.Connect(total.get_output_port(), plant.get_applied_generalized_force_input_port())

    outputs |= {
        "pose": pose,
        "platform_state": state,
        # Without capstan friction the winch carries what the drawing point does.
        "tension_at_winch": winches.GetOutputPort("tension_at_winch")
        if robot.winch.capstan_exponent > 0.0
        else tension,
        "unstrained_length": length,
        "motor_angles": angle,
        "motor_rates": rate,
        "motor_torques": winches.GetOutputPort("motor_torque"),
        # The velocities of an RpyFloatingJoint are [omega; v] in W, so their rates are this.
        "platform_acceleration": plant.get_generalized_acceleration_output_port(),
    }
    return winches.GetInputPort("desired_motor_angle"), external.get_input_port(), outputs


def _split(
    builder: DiagramBuilder, name: str, port: OutputPort, sizes: list[int]
) -> list[OutputPort]:
    block = builder.AddNamedSystem(name, Demultiplexer(sizes))
    builder.Connect(port, block.get_input_port())
    return [block.get_output_port(i) for i in range(len(sizes))]


def _transmission(robot: CableRobot) -> AffineSystem:
    """Return [l; dl/dt] = [l(0) + r q; r dq/dt] of the winches' state [q; dq/dt; integral]."""
    k, winch = robot.num_cables, robot.winch
    D = np.hstack([winch.transmission * np.eye(2 * k), np.zeros((2 * k, k))])
    y0 = np.concatenate([winch.encoder_zero_length, np.zeros(k)])
    none = np.zeros((0, 0))
    return AffineSystem(
        A=none, B=np.zeros((0, 3 * k)), f0=np.zeros(0), C=np.zeros((2 * k, 0)), D=D, y0=y0
    )


def platform_pose(diagram: Diagram, context: Context) -> RigidTransform:
    """Return X_WP in a context of `make_cable_robot` or of a loop around it.

    Args:
        diagram: a diagram that exports "pose".
        context: its context.
    """
    from cdpr_drake.model.rotations import vector_to_pose

    return vector_to_pose(diagram.GetOutputPort("pose").Eval(context))
