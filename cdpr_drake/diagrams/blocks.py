"""The blocks of any diagram, what each answers about itself, and what Drake's own blocks answer.

What may be answered is in `systems.answers`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JointIndex, RpyFloatingJoint
from pydrake.systems.framework import Context, Diagram, System
from pydrake.systems.primitives import (
    DiscreteTimeDelay,
    FirstOrderLowPassFilter,
    RandomSource,
    ZeroOrderHold,
)

from cdpr_drake.model.equilibrium import RestState
from cdpr_drake.model.rotations import pose_to_vector
from cdpr_drake.model.signals import POSE, TWIST, vector_names


class Block(NamedTuple):
    """A system inside a diagram that is no diagram itself.

    Attributes:
        path: names of the diagrams around it, then its own.
        system: the system, of any scalar type.
    """

    path: tuple[str, ...]
    system: System

    def __str__(self) -> str:
        """How messages name it: its path and its class."""
        kind = type(self.system).__name__.split("_𝓣")[0]
        return f'block "{"/".join(self.path)}" ({kind})'

    def answer(self, name: str) -> Any:
        """Return the method or attribute `name` with which it answers, None if it does not."""
        for kind, adapter in _ADAPTERS:
            if isinstance(self.system, kind):
                return getattr(adapter(self.system), name, None)
        return getattr(self.system, name, None)

    def context(self, root: Context) -> Context:
        """Return its own context, mutable, in that of the diagram, `root`."""
        return self.system.GetMyMutableContextFromRoot(root)

    @property
    def group_sizes(self) -> list[int]:
        """Size of each group of its discrete state."""
        values = self.system.AllocateDiscreteVariables()
        return [values.get_vector(i).size() for i in range(values.num_groups())]


def blocks(system: System, path: tuple[str, ...] = ()) -> Iterator[Block]:
    """Yield each block of a diagram, in the order of the diagram's state; a leaf yields itself.

    Args:
        system: a diagram or system of any scalar type.
        path: names of the diagrams around it.
    """
    if not hasattr(system, "GetSystems"):
        yield Block(path or (system.get_name(),), system)
        return
    for part in system.GetSystems():
        yield from blocks(part, (*path, part.get_name()))


def fed_ports(diagram: Diagram) -> Iterator[tuple[str, tuple[str, ...], str]]:
    """Yield (input port, path of a block, its port) for each port that an input of a diagram feeds.

    Args:
        diagram: the diagram; a leaf system feeds no other.
    """
    if not hasattr(diagram, "GetSystems"):
        return
    for i in range(diagram.num_input_ports()):
        port = diagram.get_input_port(i)
        for system, index in diagram.GetInputPortLocators(port.get_index()):
            inner, block = system.get_input_port(index).get_name(), system.get_name()
            if not hasattr(system, "GetSystems"):
                yield port.get_name(), (block,), inner
            for name, path, leaf_port in fed_ports(system):
                if name == inner:
                    yield port.get_name(), (block, *path), leaf_port


def joined(block: str, entry: str) -> str:
    """Return the name of an entry of a block: "block/entry", "block[3]".

    Args:
        block: its path.
        entry: its name there.
    """
    return f"{block}{entry}" if entry.startswith("[") or not entry else f"{block}/{entry}"


class _Plant:
    """What any MultibodyPlant answers: names of its joints' states."""

    def __init__(self, plant: MultibodyPlant) -> None:
        self._plant = plant

    @property
    def state_names(self) -> tuple[str, ...]:
        plant = self._plant
        if plant.time_step() > 0.0:
            return ()
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
        return (*q, *v)


class _Platform(_Plant):
    """What the plant of one rigid body on an RpyFloatingJoint answers."""

    def set_at_rest(self, context: Context, rest: RestState) -> None:
        state = np.concatenate([pose_to_vector(rest.X_WP), np.zeros(6)])
        self._plant.SetPositionsAndVelocities(context, state)

    def unbalanced_wrench(self, context: Context) -> np.ndarray:
        rate = self._plant.EvalTimeDerivatives(context).CopyToVector()[6:]
        unbalanced: np.ndarray = self._plant.CalcMassMatrix(context) @ rate
        return unbalanced

    def platform_scale(self, context: Context, torque: float, force: float) -> np.ndarray:
        """Return scales of [d pose; d omega; d v] for the cables' largest torque and force."""
        plant = self._plant
        weight = plant.CalcGravityGeneralizedForces(context)
        torque = max(torque, float(np.linalg.norm(weight[:3])))
        force = max(force, float(np.linalg.norm(weight[3:])))
        mass = np.diag(plant.CalcMassMatrix(context))
        return np.concatenate([np.ones(6), torque / mass[:3], force / mass[3:]])


def _of_plant(plant: MultibodyPlant) -> _Plant:
    if plant.time_step() > 0.0 or plant.num_velocities() != 6:
        return _Plant(plant)
    joints = (plant.get_joint(JointIndex(i)) for i in range(plant.num_joints()))
    on_rpy = any(isinstance(joint, RpyFloatingJoint) for joint in joints)
    return _Platform(plant) if on_rpy else _Plant(plant)


class _Hold:
    """What a hold or delay line answers: all of it is what its input is now."""

    def __init__(self, system: ZeroOrderHold | DiscreteTimeDelay) -> None:
        self._system = system

    def settle(self, context: Context) -> None:
        value = self._system.get_input_port().Eval(context)
        size = context.get_discrete_state_vector().size()
        context.SetDiscreteState(np.tile(value, size // value.size))


class _Delay(_Hold):
    @property
    def discrete_state_names(self) -> tuple[str, ...]:
        """The oldest sample comes first, the latest last."""
        name, width = self._system.get_name(), self._system.get_output_port().size()
        context = self._system.CreateDefaultContext()
        ages = reversed(range(context.get_discrete_state_vector().size() // width))
        entries = [n.removeprefix(name).removeprefix("/") for n in vector_names(name, width)]
        return tuple(
            joined(f"{age}_frames_ago", entry) if age else entry
            for age in ages
            for entry in entries
        )


class _Filter:
    """What a low-pass filter answers."""

    def __init__(self, system: FirstOrderLowPassFilter) -> None:
        self._system = system

    def settle(self, context: Context) -> None:
        context.SetContinuousState(self._system.get_input_port().Eval(context))


class _Source:
    """What a source of noise answers: its sample is at rest until it draws the next."""

    never_rests = True

    def __init__(self, system: RandomSource) -> None:
        pass

    def settle(self, context: Context) -> None:
        """Keep the sample."""


_ADAPTERS: tuple[tuple[type, Any], ...] = (
    (MultibodyPlant, _of_plant),
    (DiscreteTimeDelay, _Delay),
    (ZeroOrderHold, _Hold),
    (FirstOrderLowPassFilter, _Filter),
    (RandomSource, _Source),
)
