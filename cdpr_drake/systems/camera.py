"""The cameras that measure the platform's pose, and those that see the cables' tangents."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.common import RandomDistribution
from pydrake.common.eigen_geometry import Quaternion_
from pydrake.math import RigidTransform_, RollPitchYaw_, RotationMatrix_
from pydrake.systems.framework import LeafSystem_

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.systems._template import (
    GAUSSIAN_INPUT,
    chain,
    optional_input,
    system_template,
    value,
)


@system_template("CameraMeasurement")
def CameraMeasurement_(T: type) -> type:
    class Impl(LeafSystem_[T]):
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
            calibrated: the robot as the controller believes it; the true one if None.
        """

        def _construct(
            self, robot: CableRobot, calibrated: CableRobot | None = None, *, converter: Any = None
        ) -> None:
            super().__init__(converter=converter)
            self.robot = robot
            self.calibrated = calibrated if calibrated is not None else robot
            true, believed = robot.cameras, self.calibrated.cameras
            self._left = _cast(T, believed.X_WF @ true.X_WF.inverse())
            self._target = _cast(T, true.X_PM)
            self._right = _cast(T, believed.X_PM.inverse())
            self._sigma = np.repeat([true.orientation_noise, true.position_noise], 3)
            self._pose_port = self.DeclareVectorInputPort("pose", 6)
            self._noise_port = self.DeclareVectorInputPort(
                GAUSSIAN_INPUT, 6, RandomDistribution.kGaussian
            )
            tickets = {self._pose_port.ticket(), self._noise_port.ticket()}
            self.DeclareVectorOutputPort("measured_pose", 6, self._calc_pose, tickets)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.robot, other.calibrated, converter=converter)

        def _calc_pose(self, context: Any, output: Any) -> None:
            pose = self._pose_port.Eval(context)
            noise = self._sigma * optional_input(self._noise_port, context, 6)
            rpy = RollPitchYaw_[T](pose[:3].astype(_dtype(T)))
            X_WP = RigidTransform_[T](rpy, pose[3:].astype(_dtype(T)))
            X = self._left @ X_WP @ self._target @ _small_motion(T, noise) @ self._right
            measured = RollPitchYaw_[T](X.rotation()).vector()
            output.SetFromVector(np.concatenate([measured, X.translation()]))

    return Impl


def _dtype(T: type) -> type:
    return float if T is float else object


def _cast(T: type, X: Any) -> Any:
    return RigidTransform_[T](X.GetAsMatrix4().astype(_dtype(T)))


def _small_motion(T: type, noise: np.ndarray) -> Any:
    """Return the motion that turns by the vector noise[:3] (rad, small) and shifts by noise[3:]."""
    half = 0.5 * noise[:3]
    norm = (1.0 + half.dot(half)) ** 0.5
    wxyz: np.ndarray = np.concatenate([[1.0 / norm], half / norm]).astype(_dtype(T))
    rotation = RotationMatrix_[T](Quaternion_[T](wxyz=wxyz))
    return RigidTransform_[T](rotation, noise[3:].astype(_dtype(T)))


@system_template("CableTangentCameras")
def CableTangentCameras_(T: type) -> type:
    class Impl(LeafSystem_[T]):
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

        def _construct(self, robot: CableRobot, *, converter: Any = None) -> None:
            super().__init__(converter=converter)
            self.robot = robot
            self._sigma = robot.cameras.tangent_noise
            n = self._size = 3 * robot.num_cables
            self._tangents_port = self.DeclareVectorInputPort("tangents", n)
            self._noise_port = self.DeclareVectorInputPort(
                GAUSSIAN_INPUT, n, RandomDistribution.kGaussian
            )
            tickets = {self._tangents_port.ticket(), self._noise_port.ticket()}
            self.DeclareVectorOutputPort("measured_tangents", n, self._calc_tangents, tickets)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.robot, converter=converter)

        def _calc_tangents(self, context: Any, output: Any) -> None:
            u = self._tangents_port.Eval(context)
            noise = optional_input(self._noise_port, context, self._size)
            noisy = (value(u) + self._sigma * value(noise)).reshape(-1, 3)
            norm = np.linalg.norm(noisy, axis=1, keepdims=True)
            unit = noisy / norm
            if T is float:
                output.SetFromVector(unit.ravel())
                return
            jacobian = np.zeros((self._size, self._size))
            for i, (direction, length) in enumerate(zip(unit, norm[:, 0], strict=True)):
                block = slice(3 * i, 3 * i + 3)
                jacobian[block, block] = (np.eye(3) - np.outer(direction, direction)) / length
            output.SetFromVector(chain(unit.ravel(), [jacobian, self._sigma * jacobian], u, noise))

    return Impl


CameraMeasurement = CameraMeasurement_[None]
CableTangentCameras = CableTangentCameras_[None]
