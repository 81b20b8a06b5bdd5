"""What Drake's own blocks answer about themselves, by their type; see `systems.answers`."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JointIndex, RpyFloatingJoint
from pydrake.systems.framework import Context, System
from pydrake.systems.primitives import (
    DiscreteTimeDelay,
    FirstOrderLowPassFilter,
    RandomSource,
    ZeroOrderHold,
)

from cdpr_drake.model.equilibrium import RestState
from cdpr_drake.model.rotations import pose_to_vector
from cdpr_drake.model.signals import POSE, TWIST, joined, vector_names


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

    @property
    def eigenvalues(self) -> np.ndarray:
        """The filter's, (n,) [1/s]."""
        rates: np.ndarray = -1.0 / self._system.get_time_constants_vector()
        return rates

    def settle(self, context: Context) -> None:
        context.SetContinuousState(self._system.get_input_port().Eval(context))


class _Source:
    """What a source of noise answers: its sample is at rest until it draws the next."""

    never_rests = True

    def __init__(self, system: RandomSource) -> None:
        pass

    def settle(self, context: Context) -> None:
        """Keep the sample."""


def answers_of(system: System) -> Any:
    """Return what answers for a system: an adapter for Drake's own, the system itself otherwise.

    Args:
        system: the system.
    """
    for kind, adapter in _ADAPTERS:
        if isinstance(system, kind):
            return adapter(system)
    return system


_ADAPTERS: tuple[tuple[type, Any], ...] = (
    (MultibodyPlant, _of_plant),
    (DiscreteTimeDelay, _Delay),
    (ZeroOrderHold, _Hold),
    (FirstOrderLowPassFilter, _Filter),
    (RandomSource, _Source),
)
