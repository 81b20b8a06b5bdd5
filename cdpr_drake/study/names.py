"""Names of the states, inputs and outputs of any diagram.

A name is the path of the block, then what the entry is: "robot/platform/roll",
"robot/winches/angle[3]", "desired_pose/yaw", "motor_torques[8]". Numbers count from 1, as the
paper's cables do.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JointIndex, RpyFloatingJoint
from pydrake.systems.primitives import DiscreteTimeDelay

from cdpr_drake.systems import LoadCellFilter, MotorAngleIntegrator, WinchDynamics

POSE = ("roll", "pitch", "yaw", "x", "y", "z")
TWIST = ("omega_x", "omega_y", "omega_z", "v_x", "v_y", "v_z")
ERROR = ("rotation_x", "rotation_y", "rotation_z", "x", "y", "z")
WRENCH = ("torque_x", "torque_y", "torque_z", "force_x", "force_y", "force_z")

_SIX = {"pose_error": ERROR, "pose": POSE, "twist": TWIST, "wrench": WRENCH}


def leaves(system: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield (path of names, system) for each system inside a diagram that is none itself.

    The order is that of the diagram's state. A system that is no diagram yields itself.

    Args:
        system: a system or diagram of any scalar type.
        path: names of the diagrams around it.
    """
    if not hasattr(system, "GetSystems"):
        yield path or (system.get_name(),), system
        return
    for part in system.GetSystems():
        yield from leaves(part, (*path, part.get_name()))


def block_name(path: tuple[str, ...], system: Any) -> str:
    """Return how messages name a block: its path and its class.

    Args:
        path: names of the diagrams around it, and its own.
        system: the block.
    """
    kind = type(system).__name__.split("_𝓣")[0]
    return f'block "{"/".join(path)}" ({kind})'


def vector_names(name: str, size: int) -> tuple[str, ...]:
    """Return the names of the entries of a vector, by what its port or block is called.

    Args:
        name: of the port or block.
        size: number of entries.
    """
    if size == 12 and name.endswith("platform_state"):
        return tuple(f"{name}/{part}" for part in POSE + TWIST)
    if size == 6:
        for word, parts in _SIX.items():
            if word in name:
                return tuple(f"{name}/{part}" for part in parts)
    if "tangents" in name and size % 3 == 0:
        return tuple(f"{name}[{i // 3 + 1}]/{'xyz'[i % 3]}" for i in range(size))
    return tuple(f"{name}[{i + 1}]" for i in range(size)) if size > 1 else (name,)


def continuous_state_names(system: Any) -> tuple[str, ...]:
    """Return the names of a system's continuous states, in its own order.

    A leaf system may say what its states are by an attribute `state_names`, one text for each.

    Args:
        system: a system or diagram.
    """
    return tuple(
        f"{'/'.join(path)}/{name}" for path, leaf in leaves(system) for name in _state_names(leaf)
    )


def discrete_state_names(system: Any) -> tuple[str, ...]:
    """Return the names of a system's discrete states, group after group.

    A leaf system may say what they are by an attribute `discrete_state_names`, one text for each.

    Args:
        system: a system or diagram.
    """
    names: list[str] = []
    for path, leaf in leaves(system):
        if leaf.num_discrete_state_groups() == 0:
            continue
        block = "/".join(path)
        sizes = group_sizes(leaf)
        own = getattr(leaf, "discrete_state_names", None)
        if own is not None and len(own) == sum(sizes):
            names += [f"{block}/{name}" for name in own]
            continue
        if isinstance(leaf, DiscreteTimeDelay):
            # The oldest sample comes first, the latest last.
            width = leaf.get_output_port().size()
            for age in reversed(range(sizes[0] // width)):
                names += vector_names(f"{block}/{age}_frames_ago" if age else block, width)
            continue
        for group, size in enumerate(sizes):
            names += vector_names(block if len(sizes) == 1 else f"{block}/{group + 1}", size)
    return tuple(names)


def group_sizes(leaf: Any) -> list[int]:
    """Return the size of each group of discrete states of a leaf system.

    Args:
        leaf: the system.
    """
    values = leaf.AllocateDiscreteVariables()
    return [values.get_vector(i).size() for i in range(values.num_groups())]


def _state_names(leaf: Any) -> list[str]:
    size = leaf.num_continuous_states()
    own = getattr(leaf, "state_names", None)
    if own is not None and len(own) == size:
        return list(own)
    if isinstance(leaf, MultibodyPlant):
        return _plant_state_names(leaf)
    if isinstance(leaf, WinchDynamics):
        groups = ["angle", "rate", "integral"]
    elif isinstance(leaf, MotorAngleIntegrator):
        groups = ["angle"]
    elif isinstance(leaf, LoadCellFilter):
        order = leaf.robot.load_cells.order
        groups = [f"stage_{i + 1}" for i in range(order - 1)] + ["tension"]
    else:
        groups = ["x"]
    count = size // len(groups)
    return [f"{group}[{i + 1}]" for group in groups for i in range(count)]


def _plant_state_names(plant: MultibodyPlant) -> list[str]:
    joints = [plant.get_joint(JointIndex(i)) for i in range(plant.num_joints())]
    joints = [joint for joint in joints if joint.num_velocities()]
    q = [f"q[{i + 1}]" for i in range(plant.num_positions())]
    v = [f"v[{i + 1}]" for i in range(plant.num_velocities())]
    for joint in joints:
        prefix = f"{joint.name()}_" if len(joints) > 1 else ""
        is_rpy = isinstance(joint, RpyFloatingJoint)
        for i in range(joint.num_positions()):
            suffix = POSE[i] if is_rpy else joint.position_suffix(i) or joint.name()
            q[joint.position_start() + i] = prefix + suffix
        for i in range(joint.num_velocities()):
            suffix = TWIST[i] if is_rpy else joint.velocity_suffix(i) or f"{joint.name()}_rate"
            v[joint.velocity_start() + i] = prefix + suffix
    return q + v
