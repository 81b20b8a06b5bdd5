"""The robot itself: platform, cables and winches."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RotationalInertia, RpyFloatingJoint, SpatialInertia, UnitInertia
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Demultiplexer

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.systems import CatenaryCableForce, WinchDynamics

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
)
"""The output ports of `make_cable_robot`, which the control loops export too."""


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

    Blocks: "platform", "cables", "winches". pose (6) is [roll, pitch, yaw, x, y, z] (rad, m) of
    X_WP; external_wrench (6) is [torque; force] at the platform's origin in W.

    Args:
        robot: the robot; any number of cables.
    """
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("platform", make_platform(robot))
    cables = builder.AddNamedSystem("cables", CatenaryCableForce(robot))
    winches = builder.AddNamedSystem("winches", WinchDynamics(robot))
    split = builder.AddNamedSystem("pose_and_twist", Demultiplexer([6, 6]))

    def connect(source: str, system: object, target: str) -> None:
        builder.Connect(winches.GetOutputPort(source), system.GetInputPort(target))  # type: ignore[attr-defined]

    state = plant.get_state_output_port()
    builder.Connect(state, cables.GetInputPort("platform_state"))
    builder.Connect(state, split.get_input_port())
    connect("unstrained_length", cables, "unstrained_length")
    connect("unstrained_length_rate", cables, "unstrained_length_rate")
    builder.Connect(
        cables.GetOutputPort("platform_wrench"), plant.get_applied_generalized_force_input_port()
    )
    builder.Connect(
        cables.GetOutputPort("tension_at_drawing_point"),
        winches.GetInputPort("tension_at_drawing_point"),
    )
    builder.ExportInput(winches.GetInputPort("desired_motor_angle"), "desired_motor_angles")
    builder.ExportInput(cables.GetInputPort("external_wrench"), "external_wrench")

    ports = {
        "pose": split.get_output_port(0),
        "platform_state": state,
        "tension_at_winch": winches.GetOutputPort("tension_at_winch"),
        "unstrained_length": winches.GetOutputPort("unstrained_length"),
        "motor_angles": winches.GetOutputPort("motor_angle"),
        "motor_rates": winches.GetOutputPort("motor_rate"),
        "motor_torques": winches.GetOutputPort("motor_torque"),
    }
    for name in ROBOT_OUTPUTS:
        builder.ExportOutput(ports[name] if name in ports else cables.GetOutputPort(name), name)
    diagram = builder.Build()
    diagram.set_name("cable_robot")
    return diagram


def platform_pose(diagram: Diagram, context: object) -> RigidTransform:
    """Return X_WP in a context of `make_cable_robot` or of a loop around it.

    Args:
        diagram: a diagram that exports "pose".
        context: its context.
    """
    from cdpr_drake.model.rotations import vector_to_pose

    return vector_to_pose(diagram.GetOutputPort("pose").Eval(context))
