"""A whole robot's elastic catenaries: wrench, tensions and tangents from the platform's state."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform, RollPitchYaw

from cdpr_drake.errors import CableError, EquilibriumError, GeometryError
from cdpr_drake.model.arrays import RobotArrays
from cdpr_drake.model.kinematics import cable_ends
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, rpy_rate_matrix, skew

WIDTH = 14
"""Columns of a cable's outputs, as in `kernels.catenary.cable_forces`."""


def packed_sizes(num_cables: int) -> dict[str, int]:
    """Return names and sizes of the parts of `CableSet`'s packed result, in order.

    Args:
        num_cables: k.
    """
    return {
        "platform_wrench": 6,
        "tension_at_drawing_point": num_cables,
        "tension_at_attachment_point": num_cables,
        "tangents_at_drawing_point": 3 * num_cables,
        "tangents_at_attachment_point": 3 * num_cables,
        "dbeta": num_cables,
    }


class CableSet:
    """All k cables of a robot between their winches and the platform, moving or at rest.

    Attributes:
        arrays: the robot as the kernels take it.
        numbers: points and constants, as kernels/platform.py takes them.

    Args:
        robot: the robot.
    """

    def __init__(self, robot: CableRobot) -> None:
        from cdpr_drake.model.kernels import geometry, platform, pulley

        self._pulley, self._geometry, self._platform = pulley, geometry, platform
        self.robot = robot
        self.num_cables = robot.num_cables
        self._size = sum(packed_sizes(robot.num_cables).values())
        self.arrays = RobotArrays(robot)
        self.numbers = (self.arrays.points, self.arrays.constants)

    def __call__(self, state: Array, length: Array, rate: Array) -> tuple[Array, int]:
        """Return the packed result (6 + 9 k,), its parts as in `packed_sizes`, and a status.

        The wrench [torque; force] is at the platform's origin in W; status 0, or the number of the
        cable whose catenary was not found, or minus the number of one at its breaking load.

        Args:
            state: (12,) [roll, pitch, yaw, x, y, z, omega, v] of the platform in W.
            length: (k,) total unstrained lengths [m].
            rate: (k,) their rates [m/s].
        """
        packed = np.empty(self._size)
        status = self._platform.platform_cable_forces(state, length, rate, *self.numbers, packed)
        return packed, status

    def with_jacobian(self, state: Array, length: Array, rate: Array) -> tuple[Array, int, Array]:
        """Return the packed result, the status, and the Jacobian (6 + 9 k, 12 + 2 k).

        The Jacobian is with respect to [state (12); length (k); rate (k)]; zeros if the status is
        not 0.

        Args:
            state: (12,) as above.
            length: (k,) total unstrained lengths [m].
            rate: (k,) their rates [m/s].
        """
        k = self.num_cables
        packed, status = self(state, length, rate)
        if status:
            return packed, status, np.zeros((packed.size, 12 + 2 * k))
        points, constants = self.numbers
        p_WB, v_WB = np.empty((k, 3)), np.empty((k, 3))
        R = RollPitchYaw(state[:3]).ToRotationMatrix().matrix()
        self._geometry.attachment_motion(R, *state[3:].reshape(3, 3), points[1], p_WB, v_WB)
        out, local = np.empty((k, WIDTH)), np.zeros((k, WIDTH, 8))
        self._pulley.robot_forces(points, p_WB, v_WB, length, rate, constants, True, out, local)
        EB = p_WB - state[3:6]
        motion = _point_jacobian(state, EB)
        jacobian = np.zeros((k, WIDTH, 12 + 2 * k))
        jacobian[:, :, :12] = local[:, :, :6] @ motion
        cables = np.arange(k)
        jacobian[cables, :, 12 + cables] = local[:, :, 6]
        jacobian[cables, :, 12 + k + cables] = local[:, :, 7]
        torque = (skew(EB) @ jacobian[:, :3]).sum(0)
        arm = motion[:, :3].copy()
        arm[:, :, 3:6] = 0.0
        torque[:, :12] -= (skew(out[:, :3]) @ arm).sum(0)
        parts = [torque, jacobian[:, :3].sum(0), jacobian[:, 3], jacobian[:, 4]]
        parts += [jacobian[:, 5:8].reshape(3 * k, -1), jacobian[:, 8:11].reshape(3 * k, -1)]
        return packed, status, np.vstack([*parts, jacobian[:, 11]])

    def balance(self, X_WP: RigidTransform, length: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """Return what cables and weight do to the platform at rest.

        Args:
            X_WP: the pose.
            length: (k,) [m] total unstrained lengths.

        Returns:
            wrench [torque; force] (6,) at the platform's origin, in W; its derivative (6, 6) with
            respect to a small motion [rotation; translation] in W; the cables' outputs (k, 14) and
            Jacobians (k, 14, 8), as in `kernels.catenary.cable_forces_jacobian`.

        Raises:
            EquilibriumError: a cable's catenary was not found.
        """
        from cdpr_drake.model.kernels.equilibrium import balance

        out, jacobian = np.zeros((self.num_cables, WIDTH)), np.zeros((self.num_cables, WIDTH, 8))
        wrench, stiffness = np.zeros(6), np.zeros((6, 6))
        status = balance(
            *pose_arrays(X_WP), np.array(length, float), *self.numbers, self.arrays.body,
            out, jacobian, wrench, stiffness,
        )  # fmt: skip
        if status:
            length = np.asarray(length, float)
            raise EquilibriumError(str(no_catenary(self.robot, status, X_WP, length[status - 1])))
        return wrench, stiffness, out, jacobian


def no_catenary(
    robot: CableRobot, cable: int, X_WP: RigidTransform, length: float, time: float | None = None
) -> CableError:
    """Return the error that says why a cable has no place to hang.

    Args:
        robot: the robot.
        cable: its number, from 1.
        X_WP: the pose.
        length: [m] total unstrained length.
        time: of a run [s], or None.
    """
    radius = robot.pulley_radii[cable - 1]
    if radius > 0.0:
        try:
            ends = cable_ends(robot, X_WP)
        except GeometryError as error:
            return CableError(cable, time, str(error))
        assert ends.contact is not None
        straight = robot.cable.drum_run[cable - 1] + radius * ends.contact.theta[cable - 1]
        straight += np.linalg.norm(ends.chord[cable - 1])
        if length > straight:
            return CableError(
                cable,
                time,
                f"nowhere to leave its pulley: unstrained {length:.6g} m long, where a straight "
                f"cable has {straight:.6g} m, it would go all the way round",
            )
    return CableError(cable, time, f"no catenary of unstrained length {length:.6g} m")


def pose_arrays(X_WP: RigidTransform) -> tuple[Array, Array]:
    """Return rotation (3, 3) and translation (3,) of the pose `X_WP`, to be written to."""
    return np.array(X_WP.rotation().matrix(), order="C"), np.array(X_WP.translation())


def _point_jacobian(state: Array, EB: Array) -> Array:
    """Return (k, 6, 12): change of [p_WB; v_WB] with the platform's state."""
    k = len(EB)
    turn = -skew(EB) @ rpy_rate_matrix(state[:3])
    jacobian = np.zeros((k, 6, 12))
    jacobian[:, :3, :3] = turn
    jacobian[:, :3, 3:6] = np.eye(3)
    jacobian[:, 3:, :3] = skew(state[6:9]) @ turn
    jacobian[:, 3:, 6:9] = -skew(EB)
    jacobian[:, 3:, 9:] = np.eye(3)
    return jacobian
