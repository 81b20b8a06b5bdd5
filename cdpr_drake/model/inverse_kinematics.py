"""Inverse kinematics: from a desired pose to unstrained lengths and motor angles (eqs. 6 to 9)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.errors import GeometryError, TensionError
from cdpr_drake.model.arrays import RobotArrays
from cdpr_drake.model.cable_models import cable_model_index, cable_model_name
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, as_pose, pose_to_vector
from cdpr_drake.model.statics import (
    DEFAULT_RULE,
    MINIMUM_NORM,
    check_rule,
    distribute,
    preferred_tension,
    weight_wrench,
    what_limits_allow,
    without_tension,
    wrench_matrix,
)

STEP = 1e-6
"""Of the differences that make a Jacobian where a tension is at its limit [m, rad]."""


class InverseKinematics:
    """Unstrained lengths of a robot's cables at any pose, by one of the paper's cable models.

    The horizontal tensions are those of least norm that balance the robot's nominal mass (A.2),
    within the robot's limits of the tension or whatever they are. Lengths include the arc round a
    pulley, which stretches where the cable model does, and the run from the drum, unstretched:
    l = l_model(pose) + arc + run. Cables leave their pulleys along the tangent of the parabola.

    Args:
        robot: the robot as the controller knows it.
        cable_model: "ECM", "CMWE", "SCMWE" (eq. 8, the paper's choice) or "SLSM".
        order: order of the series of the ECM.
        rule: how tensions are chosen, one of `model.statics.RULES`; the paper has "minimum norm".

    Raises:
        ValueError: an unknown cable model or rule.
    """

    def __init__(
        self,
        robot: CableRobot,
        cable_model: str = "SCMWE",
        order: int = 4,
        rule: str = DEFAULT_RULE,
    ) -> None:
        from cdpr_drake.model.kernels import inverse as kernel

        check_rule(rule)
        self.robot, self.cable_model, self.order, self.rule = robot, cable_model, order, rule
        self._kernel = kernel
        arrays = RobotArrays(robot)
        known = {MINIMUM_NORM: kernel.LEAST, DEFAULT_RULE: kernel.LEAST_WITHIN}
        index = cable_model_index(cable_model_name(cable_model))
        self._head = (index, order, known.get(rule, kernel.CLOSEST))
        limits = np.array([*robot.cable.limits, preferred_tension(robot, rule)])
        self._tail = (arrays.points, arrays.body, arrays.stiffness, limits)

    def lengths(self, pose: RigidTransform | ArrayLike) -> Array:
        """Return the total unstrained lengths (k,) [m] at a `pose`, X_WP or [rpy, xyz].

        Raises:
            GeometryError: the wrench matrix has rank below 6.
            TensionError: the rule finds no tensions that hold the platform.
        """
        return self.lengths_and_jacobian(_vector(pose), with_jacobian=False)[0]

    def lengths_and_jacobian(self, pose: Array, with_jacobian: bool = True) -> tuple[Array, Array]:
        """Return lengths (k,) [m] and their Jacobian (k, 6) with respect to the `pose` vector.

        Args:
            pose: [roll, pitch, yaw, x, y, z] (rad, m).
            with_jacobian: whether to fill the Jacobian, zero otherwise.

        Raises:
            GeometryError: the wrench matrix has rank below 6.
            TensionError: the rule finds no tensions that hold the platform.
        """
        k, kernel = self.robot.num_cables, self._kernel
        out, T, jacobian = np.zeros(k), np.zeros(k), np.zeros((k, 6))
        if with_jacobian:
            status = kernel.unstrained_lengths_jacobian(
                *self._head, pose, *self._tail, out, T, jacobian
            )
        else:
            status = kernel.unstrained_lengths(*self._head, pose, *self._tail, out, T)
        if status == kernel.CORNER and with_jacobian:
            steps = STEP * np.eye(6)
            ends = [[self.lengths(pose + sign * step) for sign in (1.0, -1.0)] for step in steps]
            jacobian = np.array([(ahead - behind) / (2.0 * STEP) for ahead, behind in ends]).T
            return self.lengths(pose), jacobian
        if status not in (0, kernel.CORNER):
            self._refuse(pose, status)
        return out + self.robot.cable.drum_run, jacobian

    def _refuse(self, pose: Array, status: int) -> None:
        """Raise what a status of the kernel other than zero means."""
        if status == self._kernel.RANK_DEFICIENT:
            raise GeometryError("the wrench matrix has rank below 6 at the desired pose")
        geometry = cable_geometry(self.robot, pose)
        matrix, wrench = wrench_matrix(geometry), weight_wrench(self.robot, geometry)
        if status == self._kernel.INFEASIBLE:
            distribute(self.robot, matrix, wrench, self.rule, as_pose(pose))  # which says why not
            raise TensionError(
                f"the desired pose {np.array2string(pose, precision=3)} is at the very edge of "
                "what tensions within the limits can hold"
            )
        where = f"at the desired pose {np.array2string(pose, precision=3)}"
        if self.rule != MINIMUM_NORM:
            raise TensionError(f"{where} {without_tension(status)}")
        raise TensionError(
            f"{where} the tensions of least "
            f"norm would need cable {status} to push; "
            f"{what_limits_allow(self.robot, matrix, wrench)}"
        )

    def motor_angles(self, pose: RigidTransform | ArrayLike) -> Array:
        """Return the motor angles (k,) [rad] at a `pose`, X_WP or [rpy, xyz].

        Raises:
            GeometryError: the wrench matrix has rank below 6.
            TensionError: the rule finds no tensions that hold the platform.
        """
        return motor_angles(self.robot, self.lengths(pose))


def motor_angles(robot: CableRobot, lengths: ArrayLike) -> Array:
    """Return the motor angles (k,) [rad] at which the cables have given unstrained lengths.

    Args:
        robot: the robot, for the transmission and the length at encoder zero.
        lengths: (k,) [m] total unstrained lengths, from the drum on.
    """
    winch = robot.winch
    return (np.asarray(lengths, float) - winch.encoder_zero_length) / winch.transmission


def lengths_at(robot: CableRobot, angles: Array) -> Array:
    """Return the total unstrained lengths (k,) [m] of the cables at given motor angles.

    Args:
        robot: the robot, for the transmission and the length at encoder zero.
        angles: (k,) [rad].
    """
    return robot.winch.encoder_zero_length + robot.winch.transmission * angles


def _vector(pose: RigidTransform | ArrayLike) -> Array:
    return pose_to_vector(as_pose(pose))
