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
from cdpr_drake.model.statics import weight_wrench, what_limits_allow, wrench_matrix


class InverseKinematics:
    """Unstrained lengths of a robot's cables at any pose, by one of the paper's cable models.

    The horizontal tensions are those of least norm that balance the robot's nominal mass (A.2).
    Lengths include the run from drum to eyelet, unstretched: l = l_model(pose) + run.

    Args:
        robot: the robot as the controller knows it.
        cable_model: "ECM", "CMWE", "SCMWE" (eq. 8, the paper's choice) or "SLSM".
        order: order of the series of the ECM.

    Raises:
        ValueError: an unknown cable model.
    """

    def __init__(self, robot: CableRobot, cable_model: str = "SCMWE", order: int = 4) -> None:
        from cdpr_drake.model.kernels import inverse as kernel

        self.robot, self._kernel = robot, kernel
        self._head = (cable_model_index(cable_model_name(cable_model)), order)
        arrays = RobotArrays(robot)
        self._robot_arrays = (arrays.points, arrays.body, arrays.stiffness)

    def lengths(self, pose: RigidTransform | ArrayLike) -> Array:
        """Return the total unstrained lengths (k,) [m] at a `pose`, X_WP or [rpy, xyz].

        Raises:
            GeometryError: the wrench matrix has rank below 6.
            TensionError: some cable would have to push.
        """
        return self.lengths_and_jacobian(_vector(pose), with_jacobian=False)[0]

    def lengths_and_jacobian(self, pose: Array, with_jacobian: bool = True) -> tuple[Array, Array]:
        """Return lengths (k,) [m] and their Jacobian (k, 6) with respect to the `pose` vector.

        Args:
            pose: [roll, pitch, yaw, x, y, z] (rad, m).
            with_jacobian: whether to fill the Jacobian, zero otherwise.

        Raises:
            GeometryError: the wrench matrix has rank below 6.
            TensionError: some cable would have to push.
        """
        k = self.robot.num_cables
        out, H, jacobian = np.zeros(k), np.zeros(k), np.zeros((k, 6))
        if with_jacobian:
            status = self._kernel.unstrained_lengths_jacobian(
                *self._head, pose, *self._robot_arrays, out, H, jacobian
            )
        else:
            status = self._kernel.unstrained_lengths(*self._head, pose, *self._robot_arrays, out, H)
        if status < 0:
            raise GeometryError("the wrench matrix has rank below 6 at the desired pose")
        if status > 0:
            geometry = cable_geometry(self.robot, pose)
            wrench = weight_wrench(self.robot, geometry)
            allowed = what_limits_allow(self.robot, wrench_matrix(geometry), wrench)
            raise TensionError(
                f"at the desired pose {np.array2string(pose, precision=3)} the tensions of least "
                f"norm would need cable {status} to push, and joint space control takes no others; "
                f"{allowed}"
            )
        return out + self.robot.cable.drum_run, jacobian

    def motor_angles(self, pose: RigidTransform | ArrayLike) -> Array:
        """Return the motor angles (k,) [rad] at a `pose`, X_WP or [rpy, xyz].

        Raises:
            GeometryError: the wrench matrix has rank below 6.
            TensionError: some cable would have to push.
        """
        return motor_angles(self.robot, self.lengths(pose))


def motor_angles(robot: CableRobot, lengths: ArrayLike) -> Array:
    """Return the motor angles (k,) [rad] at which the cables have given unstrained lengths.

    Args:
        robot: the robot, for the transmission and the length at encoder zero.
        lengths: (k,) [m] total unstrained lengths, run from drum to eyelet included.
    """
    winch = robot.winch
    return (np.asarray(lengths, float) - winch.encoder_zero_length) / winch.transmission


def _vector(pose: RigidTransform | ArrayLike) -> Array:
    return pose_to_vector(as_pose(pose))
