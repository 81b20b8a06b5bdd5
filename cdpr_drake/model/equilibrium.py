"""Exact statics on elastic catenaries: from a pose to rest tensions, and from lengths to a pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.errors import EquilibriumError, TensionError
from cdpr_drake.model.arrays import RobotArrays
from cdpr_drake.model.cables import CableSet, no_catenary, pose_arrays
from cdpr_drake.model.catenary import chord_tension
from cdpr_drake.model.inverse_kinematics import motor_angles
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.pulleys import has_pulleys
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, as_pose, exp_rotation
from cdpr_drake.model.statics import (
    DEFAULT_RULE,
    check_rank,
    distribute,
    without_tension,
    wrench_at,
    wrench_matrix,
)
from cdpr_drake.model.winch import WinchModel

TOLERANCE = 1e-11
"""Residual wrench relative to the weight (torques per metre of the platform) at an equilibrium."""


@dataclass(frozen=True, kw_only=True)
class RestState:
    """A robot at rest.

    Attributes:
        X_WP: the pose.
        unstrained_length: (k,) [m] from the drum on.
        chord_tension: (k,) [N] horizontal tension over cos(beta0).
        tension_at_drawing_point: (k,) [N].
        tension_at_attachment_point: (k,) [N].
        motor_angles: (k,) [rad].
        desired_motor_angles: (k,) [rad] what the winches are told for their motors to hold these.
        residual: largest unbalanced component over the weight, torques divided by 1 m.
    """

    X_WP: RigidTransform
    unstrained_length: Array
    chord_tension: Array
    tension_at_drawing_point: Array
    tension_at_attachment_point: Array
    motor_angles: Array
    desired_motor_angles: Array
    residual: float


def rest_state(
    robot: CableRobot,
    pose: RigidTransform | ArrayLike,
    rule: str = DEFAULT_RULE,
    wrench: ArrayLike | None = None,
) -> RestState:
    """Return the robot at rest at a pose, its chord tensions chosen by a rule.

    The tensions balance the platform's weight exactly, with the forces of the elastic catenary
    (Irvine, Cable Structures, 1981), not of a simplified model.

    Args:
        robot: the robot.
        pose: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        rule: one of `model.statics.RULES`.
        wrench: (6,) [torque; force] on the platform at its origin in W, besides weight and cables;
            none if None.

    Raises:
        GeometryError: the wrench matrix has rank below 6.
        TensionError: no such tensions.
        EquilibriumError: the iteration did not converge.
    """
    from cdpr_drake.model.kernels.catenary import robot_length

    X_WP = as_pose(pose)
    geometry = cable_geometry(robot, X_WP)
    check_rank(wrench_matrix(geometry))
    external = np.zeros(6) if wrench is None else np.asarray(wrench, float)
    weight = gravity_wrench(robot, X_WP) + external
    k, arrays, w = robot.num_cables, RobotArrays(robot), robot.weight_per_metre
    T, V_A, V_B, length = np.zeros(k), np.zeros(k), np.zeros(k), np.zeros(k)
    sag = 0.5 * w * geometry.L  # V_B - T sin(beta0): the part of theta_B that is not along u
    for _ in range(200):
        previous = T
        upwards = wrench_at(geometry.EB, geometry.z)
        load = weight - upwards.T @ sag
        T = distribute(robot, wrench_matrix(geometry), load, rule, X_WP)
        if T.min() <= 0.0:
            raise TensionError(without_tension(int(np.argmin(T)) + 1))
        H = T * geometry.Bx / geometry.L
        run = arrays.run + geometry.arc
        for i in range(k):
            V_A[i], V_B[i], length[i], status = robot_length(
                geometry.Bx[i], geometry.Bz[i], H[i], run[i], arrays.constants
            )
            if status:
                raise EquilibriumError(f"cable {i + 1} has no catenary at H = {H[i]:.3g} N")
        sag = V_B - T * (geometry.Bz / geometry.L)
        if np.max(np.abs(T - previous)) <= 1e-14 * np.max(np.abs(T)):
            break
        if has_pulleys(robot):  # the cables leave along their tangents
            pull = H[:, None] * geometry.x_A + V_A[:, None] * geometry.z
            tangents = pull / np.linalg.norm(pull, axis=1, keepdims=True)
            geometry = cable_geometry(robot, X_WP, tangents=tangents)
    unbalanced, _, out = platform_balance(robot, X_WP, length)
    residual = _relative(robot, unbalanced + external)
    if not residual <= 1e3 * TOLERANCE:
        raise EquilibriumError(
            f"no rest state found: residual {residual:.2e} of the weight; limiting cable "
            f"{int(np.argmin(T)) + 1} (chord tension {T.min():.2f} N)"
        )
    return _state(robot, X_WP, length, out, residual)


def gravity_wrench(robot: CableRobot, X_WP: RigidTransform) -> Array:
    """Return the weight's wrench [torque; force] (6,) at the platform's origin, in W.

    Args:
        robot: the robot.
        X_WP: the pose.
    """
    force = np.array([0.0, 0.0, -robot.mass * robot.gravity])
    return wrench_at(X_WP.rotation() @ robot.center_of_mass, force)


def platform_balance(
    robot: CableRobot, X_WP: RigidTransform, length: Array
) -> tuple[Array, Array, Array]:
    """Return the first three of `CableSet.balance`: wrench, stiffness, the cables' outputs.

    Args:
        robot: the robot.
        X_WP: the pose.
        length: (k,) [m] total unstrained lengths.

    Raises:
        EquilibriumError: a cable's catenary was not found.
    """
    return CableSet(robot).balance(X_WP, length)[:3]


def state_at(robot: CableRobot, X_WP: RigidTransform, length: Array) -> RestState:
    """Return the state that a robot would have if it stopped at a pose, in balance or not.

    Args:
        robot: the robot.
        X_WP: the pose.
        length: (k,) [m] total unstrained lengths.

    Raises:
        EquilibriumError: a cable's catenary was not found.
    """
    unbalanced, _, out = platform_balance(robot, X_WP, length)
    return _state(robot, X_WP, length, out, _relative(robot, unbalanced))


def forward_kinematics(
    robot: CableRobot,
    length: ArrayLike,
    guess: RigidTransform | ArrayLike,
    max_iterations: int = 1000,
    wrench: ArrayLike | None = None,
) -> RestState:
    """Return the equilibrium pose of the platform hanging on cables of given unstrained lengths.

    Descends the potential energy: Newton steps with the exact stiffness of the catenaries, made
    positive definite, each as long as the energy falls along it. So the equilibrium is stable.

    Args:
        robot: the robot.
        length: (k,) [m] total unstrained lengths, from the drum on.
        guess: a pose to start from, X_WP or [roll, pitch, yaw, x, y, z] (rad, m).
        max_iterations: after how many evaluations to give up.
        wrench: (6,) [torque; force] on the platform at its origin in W, besides weight and cables;
            none if None. From the equilibrium without it the platform follows by Newton's steps.

    Raises:
        EquilibriumError: no equilibrium was found from this guess; names the residual and the
            cable of least tension.
    """
    from cdpr_drake.model.kernels.equilibrium import find_equilibrium

    k = robot.num_cables
    length = np.array(length, float)
    if length.shape != (k,) or not np.all(length > 0.0):
        raise ValueError(f"lengths must be {k} positive numbers, got {length}")
    R, p = pose_arrays(as_pose(guess))
    out, jacobian, unbalanced = np.zeros((k, 14)), np.zeros((k, 14, 8)), np.zeros(6)
    arrays = RobotArrays(robot)
    status, residual = find_equilibrium(
        R, p, length, arrays.points, arrays.constants, arrays.body,
        TOLERANCE, max_iterations, out, jacobian, unbalanced,
    )  # fmt: skip
    if status:
        X_WP = RigidTransform(RotationMatrix.ProjectToRotationMatrix(R), p)
        raise EquilibriumError(str(no_catenary(robot, status, X_WP, length[status - 1])))
    if not residual <= 1e3 * TOLERANCE:
        slackest = int(np.argmin(out[:, 3]))
        raise EquilibriumError(
            f"no equilibrium for these lengths: residual {residual:.2e} of the weight; limiting "
            f"cable {slackest + 1} ({out[slackest, 3]:.2f} N at the drawing point)"
        )
    X_WP = RigidTransform(RotationMatrix(R), p)
    if wrench is not None and np.any(wrench):
        return _moved_by(robot, length, X_WP, np.asarray(wrench, float))
    return _state(robot, X_WP, length, out, residual)


def _moved_by(robot: CableRobot, length: Array, X_WP: RigidTransform, wrench: Array) -> RestState:
    """Return the rest of a platform that a wrench moves from its rest X_WP."""
    for _ in range(50):
        unbalanced, stiffness, out = platform_balance(robot, X_WP, length)
        residual = _relative(robot, unbalanced + wrench)
        if residual <= 10.0 * TOLERANCE:
            break
        step = -np.linalg.solve(stiffness, unbalanced + wrench)
        turn, shift = np.linalg.norm(step[:3]), np.linalg.norm(step[3:])
        step /= max(1.0, float(turn) / 0.3, float(shift))  # [rad], [m]
        R = RotationMatrix(exp_rotation(step[:3])) @ X_WP.rotation()
        X_WP = RigidTransform(R, X_WP.translation() + step[3:])
    if not residual <= 1e3 * TOLERANCE:
        raise EquilibriumError(
            f"no equilibrium under the wrench {np.array2string(wrench, precision=3)}: "
            f"residual {residual:.2e} of the weight"
        )
    return _state(robot, X_WP, length, out, residual)


def _state(
    robot: CableRobot, X_WP: RigidTransform, length: Array, out: Array, residual: float
) -> RestState:
    angles, cable = motor_angles(robot, length), robot.cable
    T_A, T_B = out[:, 3], out[:, 4]
    L = cable_geometry(robot, X_WP, tangents=out[:, 5:8]).L
    EA = cable.stiffness(T_A)
    return RestState(
        X_WP=X_WP,
        unstrained_length=length,
        chord_tension=chord_tension(L, out[:, 13], T_A, T_B, robot.weight_per_metre, EA),
        tension_at_drawing_point=T_A,
        tension_at_attachment_point=T_B,
        motor_angles=angles,
        desired_motor_angles=WinchModel(robot).at_rest(angles, T_A)[1],
        residual=residual,
    )


def _relative(robot: CableRobot, wrench: Array) -> float:
    return float(np.max(np.abs(wrench)) / (robot.mass * robot.gravity))
