"""Equilibria of whole loops: the context in which everything is at rest, and how nearly it is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.primitives import RandomSource

from cdpr_drake.diagrams import rest_context, robot_of
from cdpr_drake.errors import EquilibriumError, GeometryError, TensionError
from cdpr_drake.model.camera import true_from_seen
from cdpr_drake.model.equilibrium import gravity_wrench
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import as_pose, pose_to_vector, vector_to_pose
from cdpr_drake.model.statics import weight_wrench, wrench_matrix
from cdpr_drake.study.names import (
    block_name,
    continuous_state_names,
    discrete_state_names,
    group_sizes,
    leaves,
)
from cdpr_drake.study.state_space import Array
from cdpr_drake.systems import LoadCellFilter, MotorAngleIntegrator, WinchDynamics

TOLERANCE = 1e-9
"""Largest residual of an equation at an equilibrium, relative to the equation's largest term."""


def equilibrium(loop: Any, pose: RigidTransform | ArrayLike, tensions: str = "minimum norm") -> Any:
    """Return the context in which a whole loop is at rest with the desired pose set to `pose`.

    Plant, winches, filters, samples and latency buffers are at rest, and the time is past the ramp
    of the gain. Under vision-based control the controller sees no error: with a calibration other
    than the robot's own the platform rests where it is *seen* at the pose. Under joint space
    control the pose is what is asked for; the true pose and the tensions are results.

    Args:
        loop: a diagram of this package, or one built around it.
        pose: desired X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        tensions: "minimum norm" (of the chord tensions), or "within limits"; without effect under
            joint space control, where the winches' angles decide.

    Raises:
        EquilibriumError: there is no such rest, or a residual is above 1e-9 of the largest term of
            its equation; names residual and limiting cable.
        ValueError: an unknown rule for the tensions.
    """
    for path, leaf in leaves(loop):
        if isinstance(leaf, RandomSource):
            raise EquilibriumError(
                f"{block_name(path, leaf)} never rests: make the loop without noise, or start a "
                "noisy one from rest_context"
            )
    desired = as_pose(pose)
    true = true_pose(loop, desired)
    try:
        context = rest_context(loop, true, tensions)
    except (TensionError, GeometryError) as error:  # these name the limiting cable
        raise EquilibriumError(f"{error}; {_shortfall(robot_of(loop), true, tensions)}") from None
    if loop.HasInputPort("desired_pose"):
        loop.GetInputPort("desired_pose").FixValue(context, pose_to_vector(desired))
    context.SetTime(settled_time(loop))
    rest = residuals(loop, context)
    if not rest.largest <= TOLERANCE:
        cable = _slackest_cable(loop, context)
        raise EquilibriumError(
            f"not at rest: {rest.worst} changes by {rest.largest:.2e} of the largest term of its "
            f"equation; limiting cable {cable}"
        )
    return context


def settled_time(loop: Any) -> float:
    """Return the first time [s] at which all gains are past their ramps and a period begins.

    Args:
        loop: the diagram.
    """
    ramp = max(
        (getattr(getattr(s, "settings", None), "ramp_time", 0.0) for _, s in leaves(loop)),
        default=0.0,
    )
    period = sample_period(loop)
    return ramp if period is None else math.ceil(ramp / period - 1e-9) * period


def sample_period(loop: Any) -> float | None:
    """Return the longest period [s] of the loop's discrete updates, None if it has none.

    Args:
        loop: the diagram.
    """
    events = [s.GetUniquePeriodicDiscreteUpdateAttribute() for _, s in leaves(loop)]
    return max((e.period_sec() for e in events if e is not None), default=None)


def true_pose(loop: Any, seen: RigidTransform | ArrayLike) -> RigidTransform:
    """Return X_WP of the platform when the loop's cameras measure it at the pose `seen`.

    X_WP = X_WF X_WF'^-1 X_WP' X_PM' X_PM^-1, the calibrated transforms and the measured pose
    primed. A loop without cameras sees the truth.

    Args:
        loop: the diagram.
        seen: the measured X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
    """
    for path, system in leaves(loop):
        if path[-1] == "camera" and hasattr(system, "calibrated"):
            return true_from_seen(system.robot, system.calibrated, seen)
    return as_pose(seen)


@dataclass(frozen=True, kw_only=True)
class Residuals:
    """How far a context is from rest, equation by equation.

    Attributes:
        names: of the states, continuous then discrete.
        value: (n,) rate of change of the continuous states, change at the next update of the
            discrete ones.
        scale: (n,) the largest term of each equation.
    """

    names: tuple[str, ...]
    value: Array
    scale: Array

    @property
    def ratio(self) -> Array:
        """Size of each residual relative to the largest term of its equation (n,)."""
        return np.abs(self.value) / self.scale

    @property
    def largest(self) -> float:
        """The largest ratio."""
        return float(np.max(self.ratio, initial=0.0))

    @property
    def worst(self) -> str:
        """The name of the state with the largest ratio."""
        return self.names[int(np.argmax(self.ratio))]


def residuals(loop: Any, context: Any) -> Residuals:
    """Return how far a context of a diagram is from rest, relative to each equation's largest term.

    The largest term is: for the platform's balance the largest of its weight and the cables'
    forces, and of their torques; for a winch the holding torque r T; for the integral of its error
    the motor angle; for a filter its reading; for commanded motor rates the gain times an error of
    1 m, over the transmission; for a sample what it samples. Where a rate of change is all there is
    in an equation (dx/dt = v), and in blocks of other kinds, it is one SI unit, or the state itself
    if that is larger.

    Args:
        loop: a diagram of this package, or one built around it.
        context: its context.
    """
    derivatives = loop.EvalTimeDerivatives(context)
    values, scales = [derivatives.CopyToVector()], []
    discrete, discrete_scales = [], []
    rate_scale = _commanded_rate_scale(loop)
    for path, system in leaves(loop):
        own = system.GetMyContextFromRoot(context)
        if system.num_continuous_states():
            scales.append(_scale(loop, context, system, own, rate_scale))
        sizes = group_sizes(system)
        if not sizes:
            continue
        if system.GetUniquePeriodicDiscreteUpdateAttribute() is None:
            # A source of noise holds its sample until it draws the next.
            discrete += [np.zeros(size) for size in sizes]
            discrete_scales += [np.ones(size) for size in sizes]
            continue
        after = system.EvalUniquePeriodicDiscreteUpdate(own)
        for group, size in enumerate(sizes):
            state = own.get_discrete_state(group).CopyToVector()
            discrete.append(after.get_vector(group).CopyToVector() - state)
            if path[-1] == "held_rates":
                discrete_scales.append(np.full(size, rate_scale))
            else:
                discrete_scales.append(np.maximum(1.0, np.abs(state)))
    return Residuals(
        names=continuous_state_names(loop) + discrete_state_names(loop),
        value=np.concatenate([*values, *discrete]),
        scale=np.concatenate([*scales, *discrete_scales]),
    )


def _scale(loop: Any, context: Any, system: Any, own: Any, rate_scale: float) -> Array:
    x = own.get_continuous_state_vector().CopyToVector()
    if isinstance(system, MultibodyPlant) and system.num_velocities() == 6 and x.size == 12:
        return _platform_scale(loop, context, system, own)
    if isinstance(system, WinchDynamics):
        winch, k = system.robot.winch, system.robot.num_cables
        tension = system.GetInputPort("tension_at_drawing_point").Eval(own)
        holding = winch.transmission * np.abs(tension) / winch.inertia
        return np.concatenate([np.ones(k), holding, np.maximum(1.0, np.abs(x[:k]))])
    if isinstance(system, LoadCellFilter):
        return 2.0 * math.pi * system.robot.load_cells.cutoff * np.maximum(1.0, np.abs(x))
    if isinstance(system, MotorAngleIntegrator):
        return np.full(x.size, rate_scale)
    return np.maximum(1.0, np.abs(x))


def _platform_scale(loop: Any, context: Any, plant: MultibodyPlant, own: Any) -> Array:
    """Return scales of [d pose; d omega; d v]: largest torque and force through the mass matrix."""
    robot = robot_of(loop)
    X_WP = vector_to_pose(plant.GetPositions(own))
    geometry = cable_geometry(robot, X_WP)
    weight = gravity_wrench(robot, X_WP)
    pull = np.abs(loop.GetOutputPort("tension_at_attachment_point").Eval(context))
    arms = np.linalg.norm(wrench_matrix(geometry)[:3], axis=0)
    torque = max(np.linalg.norm(weight[:3]), np.max(pull * arms))
    force = max(np.linalg.norm(weight[3:]), np.max(pull))
    mass = np.diag(plant.CalcMassMatrix(own))
    return np.concatenate([np.ones(6), torque / mass[:3], force / mass[3:]])


def _commanded_rate_scale(loop: Any) -> float:
    for _, system in leaves(loop):
        settings: Any = getattr(system, "settings", None)
        if hasattr(settings, "gain"):
            return settings.gain / system.robot.winch.transmission
    return 1.0


def _slackest_cable(loop: Any, context: Any) -> str:
    tension = loop.GetOutputPort("tension_at_drawing_point").Eval(context)
    i = int(np.argmin(tension))
    return f"{i + 1} ({tension[i]:.1f} N at the drawing point)"


def _shortfall(robot: CableRobot, X_WP: RigidTransform, tensions: str) -> str:
    """Say what the best tensions allowed leave of the weight's wrench."""
    from scipy.optimize import lsq_linear

    bounds = (0.0, np.inf)
    if tensions == "within limits":
        bounds = (robot.cable.min_tension, robot.cable.max_tension)
    geometry = cable_geometry(robot, X_WP)
    matrix, weight = wrench_matrix(geometry), weight_wrench(robot, geometry)
    best = lsq_linear(matrix, weight, bounds)
    residual = float(np.linalg.norm(matrix @ best.x - weight) / np.linalg.norm(weight))
    if residual < 1e-9:
        return 'other tensions balance it: try tensions="within limits"'
    return f"whatever the tensions allowed, a residual of {residual:.2g} of the weight remains"
