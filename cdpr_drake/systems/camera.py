"""The cameras that measure the platform's pose, and those that see the cables' tangents."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from cdpr_drake.model.camera import MeasuredPose, true_from_seen
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.systems._template import (
    chain,
    check_finite,
    finite_inputs,
    lift,
    noise_input,
    optional_input,
    scalar_convertible,
    value,
)


@scalar_convertible
class CameraMeasurement(LeafSystem):
    """The platform's pose as the fixed cameras measure it, with noise and calibration error.

    .. pydrake_system::

        name: CameraMeasurement
        input_ports:
        - pose
        - noise (optional)
        output_ports:
        - measured_pose

    The cameras see X_FM = X_WF^-1 X_WP X_PM with the true transforms, turned and shifted by
    noise in M; the controller takes it back to the platform with those it believes (section
    4.1). Poses are [roll, pitch, yaw, x, y, z] (rad, m) of X_WP. noise (6) is standard normal,
    [rotation; translation], ignored if the port is left open.

    Args:
        robot: the true robot, for its transforms and noise.
        believed: the robot as the controller believes it; the true one if None.
    """

    def __init__(self, robot: CableRobot, believed: CableRobot | None = None) -> None:
        super().__init__()
        self.robot = robot
        self.believed = believed if believed is not None else robot
        true = robot.cameras
        self._measured = MeasuredPose(robot, self.believed)
        self._sigma = np.repeat([true.orientation_noise, true.position_noise], 3)
        self._pose_port = self.DeclareVectorInputPort("pose", 6)
        self._noise_port = noise_input(self, 6)
        tickets = {self._pose_port.ticket(), self._noise_port.ticket()}
        self.DeclareVectorOutputPort("measured_pose", 6, self._calc_pose, tickets)

    def true_pose(self, robot: CableRobot, seen: RigidTransform | ArrayLike) -> RigidTransform:
        """Return X_WP of the true `robot` when it is measured at the pose `seen`."""
        return true_from_seen(robot, self.believed, seen)

    def _calc_pose(self, context: Context, output: BasicVector) -> None:
        pose = self._pose_port.Eval(context)
        noise = self._sigma * optional_input(self._noise_port, context)
        z = finite_inputs(self, context, pose, noise)
        output.SetFromVector(lift(self._measured, (z,), pose, noise))


@scalar_convertible
class CableTangentCameras(LeafSystem):
    """The directions of the cables at their drawing points, as the stereo pairs measure them.

    .. pydrake_system::

        name: CableTangentCameras
        input_ports:
        - tangents
        - noise (optional)
        output_ports:
        - measured_tangents

    u = (u_A + sigma n) / |u_A + sigma n| for each cable: tangents (3 k) are unit vectors from A
    to B in W; noise (3 k) is standard normal, ignored if the port is left open.

    Args:
        robot: the robot, for the number of cables and the noise [rad].
    """

    def __init__(self, robot: CableRobot) -> None:
        super().__init__()
        self.robot = robot
        self._sigma = robot.cameras.tangent_noise
        n = self._size = 3 * robot.num_cables
        self._tangents_port = self.DeclareVectorInputPort("tangents", n)
        self._noise_port = noise_input(self, n)
        tickets = {self._tangents_port.ticket(), self._noise_port.ticket()}
        self.DeclareVectorOutputPort("measured_tangents", n, self._calc_tangents, tickets)

    def _calc_tangents(self, context: Context, output: BasicVector) -> None:
        u = self._tangents_port.Eval(context)
        noise = optional_input(self._noise_port, context)
        noisy = value(u) + self._sigma * value(noise)
        check_finite(noisy, self, context, "inputs")
        noisy = noisy.reshape(-1, 3)
        norm = np.sqrt(np.einsum("ij,ij->i", noisy, noisy))[:, np.newaxis]
        unit = noisy / norm
        if not u.dtype.hasobject:
            output.SetFromVector(unit.ravel())
            return
        jacobian = np.zeros((self._size, self._size))
        for i, (direction, length) in enumerate(zip(unit, norm[:, 0], strict=True)):
            block = slice(3 * i, 3 * i + 3)
            jacobian[block, block] = (np.eye(3) - np.outer(direction, direction)) / length
        both = np.hstack([jacobian, self._sigma * jacobian])
        output.SetFromVector(chain(unit.ravel(), both, u, noise))
