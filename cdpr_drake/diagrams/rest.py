"""Contexts in which a whole diagram is at rest."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike
from pydrake.common import RandomGenerator
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, Diagram, InputPort, System
from pydrake.systems.primitives import DiscreteTimeDelay, ZeroOrderHold

from cdpr_drake.model.equilibrium import RestState, forward_kinematics, rest_state
from cdpr_drake.model.inverse_kinematics import InverseKinematics, motor_angles
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, as_pose, pose_to_vector
from cdpr_drake.model.winch import WinchModel
from cdpr_drake.systems.fused_plant import FusedPlant
from cdpr_drake.systems.held_pose import HeldPose
from cdpr_drake.systems.load_cell import LoadCellFilter
from cdpr_drake.systems.plausible_tension import PlausibleTension
from cdpr_drake.systems.stereo import StereoCameras


def rest_context(
    diagram: Diagram,
    pose: RigidTransform | ArrayLike,
    tensions: str = "minimum norm",
    seed: int | None = None,
) -> Context:
    """Return a context in which plant, winches, filters, samples and latency buffers are at rest.

    The robot rests at the pose, whatever the goal; an open input "desired_pose" is fixed at the
    pose, to be fixed at a goal by the caller. In a joint space loop the pose is what the controller
    asks for: lengths follow from its inverse kinematics, the true pose and tensions from them.

    Args:
        diagram: a diagram of this package, or one built around it.
        pose: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        tensions: "minimum norm" (of the chord tensions), or "within limits"; without effect in a
            joint space loop.
        seed: of the diagram's noise sources; None leaves them to Drake, whose seeds differ from
            one context to the next.

    Raises:
        GeometryError, TensionError, EquilibriumError: the robot cannot rest there.
    """
    context = diagram.CreateDefaultContext()
    if seed is not None:
        diagram.SetRandomContext(context, RandomGenerator(seed))
    target = pose_to_vector(as_pose(pose))
    for index in range(diagram.num_input_ports()):
        port = diagram.get_input_port(index)
        if port.get_name() == "desired_pose":
            port.FixValue(context, target)
        elif port.get_name() == "desired_motor_angles":
            port.FixValue(context, np.zeros(port.size()))
    systems = {path: system for path, system in leaf_systems(diagram)}
    rest = _rest(systems, as_pose(pose), tensions)
    set_at_rest(diagram, context, rest)
    return context


def set_at_rest(diagram: Diagram, context: Context, rest: RestState) -> None:
    """Put every system of a diagram at rest in a state of the robot.

    Args:
        diagram: a diagram of this package, or one built around it.
        context: its context, changed.
        rest: the state.
    """
    systems = dict(leaf_systems(diagram))
    robot = robot_of(diagram)
    tension = rest.tension_at_drawing_point
    platform = np.concatenate([pose_to_vector(rest.X_WP), np.zeros(6)])
    angles = motor_angles(robot, rest.unstrained_length)
    winches, desired = WinchModel(robot).at_rest(angles, tension)
    for path, system in systems.items():
        own = system.GetMyMutableContextFromRoot(context)
        name = path[-1]
        if name == "platform":
            system.SetPositionsAndVelocities(own, platform)
        elif name == "winches":
            own.SetContinuousState(winches)
        elif name == "load_cells":
            own.SetContinuousState(_filters_at_rest(system, tension))
        elif name == "integrator":
            own.SetContinuousState(desired)
        elif isinstance(system, FusedPlant):
            filters = _filters_at_rest(system, tension)
            own.SetContinuousState(np.concatenate([platform, winches, filters, desired]))
        elif name == "held_rates":
            own.SetDiscreteState(np.zeros(system.get_output_port().size()))
    port = _input_port(diagram, "desired_motor_angles")
    if port is not None:
        port.FixValue(context, desired)
    _fill_samplers(systems, context)


def _filters_at_rest(system: LoadCellFilter | FusedPlant, tension: Array) -> Array:
    """Return the state of a system's load cells under tensions (k,) [N] that do not change."""
    return np.tile(system.reading(tension), system.robot.load_cells.order)


def _fill_samplers(systems: dict[tuple[str, ...], System], context: Context) -> None:
    """Fill holds and delay lines with what their input is now, cameras with what they see."""
    for path, system in systems.items():
        if isinstance(system, HeldPose | StereoCameras):
            system.set_at_rest(system.GetMyMutableContextFromRoot(context))
        if path[-1].startswith("sampled_") and isinstance(
            system, ZeroOrderHold | DiscreteTimeDelay
        ):
            own = system.GetMyMutableContextFromRoot(context)
            value = system.get_input_port().Eval(own)
            size = own.get_discrete_state_vector().size()
            own.SetDiscreteState(np.tile(value, size // value.size))
    for system in systems.values():
        if isinstance(system, PlausibleTension):  # whose inputs are samples
            system.set_at_rest(system.GetMyMutableContextFromRoot(context))


def leaf_systems(diagram: Diagram) -> Iterator[tuple[tuple[str, ...], System]]:
    """Yield (path of names, system) for every system inside a diagram that is not a diagram.

    Args:
        diagram: the diagram.
    """
    for system in diagram.GetSystems():
        if isinstance(system, Diagram):
            for path, leaf in leaf_systems(system):
                yield (system.get_name(), *path), leaf
        else:
            yield (system.get_name(),), system


def robot_of(diagram: Diagram) -> CableRobot:
    """Return the true robot of a diagram of this package.

    Args:
        diagram: the diagram.

    Raises:
        ValueError: it has no block "cables".
    """
    for path, system in leaf_systems(diagram):
        if path[-1] == "cables" or isinstance(system, FusedPlant):
            return system.robot
    raise ValueError(f'diagram "{diagram.get_name()}" has no block "cables", so no cable robot')


def _rest(systems: dict[tuple[str, ...], System], X_WP: RigidTransform, tensions: str) -> RestState:
    robot = next(
        s.robot for path, s in systems.items() if path[-1] == "cables" or isinstance(s, FusedPlant)
    )
    for path, system in systems.items():
        if path[-1] == "inverse_kinematics":
            angles = InverseKinematics(system.robot, system.cable_model).motor_angles(X_WP)
            lengths = robot.winch.encoder_zero_length + robot.winch.transmission * angles
            return forward_kinematics(robot, lengths, X_WP)
    return rest_state(robot, X_WP, tensions)


def _input_port(diagram: Diagram, name: str) -> InputPort | None:
    return diagram.GetInputPort(name) if diagram.HasInputPort(name) else None
