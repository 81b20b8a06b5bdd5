"""What a calibration leaves: the robot as it is believed, and how wrong that is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.errors import CalibrationError
from cdpr_drake.model.calibration.motions import difference
from cdpr_drake.model.calibration.setup import CalibrationSetup
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.vision.pose import PoseEstimator
from cdpr_drake.model.vision.targets import TargetImages


@dataclass(frozen=True, kw_only=True, eq=False)
class ParameterGroup:
    """Parameters of one kind, after a calibration.

    What the measurements predict of the errors has two parts. Noise is new each time: calibrating n
    times and taking the mean leaves an n-th of its variance. What is fixed comes out the same each
    time: where a cable bends in the middle of the cloud of points around it, and the fixed bias of
    each point of a pattern in each pose camera. A control loop lives with one calibration, so for
    it both are one fixed error.

    Attributes:
        name: of the group.
        unit: of errors and standard deviations.
        labels: (n,), of the parameters.
        errors: (n,), calibrated less true.
        noise_sigmas: (n,), the standard deviations predicted of the noise.
        fixed_sigmas: (n,), those of what is fixed.
    """

    name: str
    unit: str
    labels: tuple[str, ...]
    errors: Array
    noise_sigmas: Array
    fixed_sigmas: Array

    @property
    def sigmas(self) -> Array:
        """Standard deviations of both parts together (n,), of a single calibration's errors."""
        return np.hypot(self.noise_sigmas, self.fixed_sigmas)

    @property
    def rms_fixed_sigma(self) -> float:
        """Root mean square of the fixed standard deviations."""
        return float(np.sqrt(np.mean(self.fixed_sigmas**2)))

    @property
    def rms_noise_sigma(self) -> float:
        """Root mean square of the standard deviations of the noise."""
        return float(np.sqrt(np.mean(self.noise_sigmas**2)))

    @property
    def rms_error(self) -> float:
        """Root mean square of the errors."""
        return float(np.sqrt(np.mean(self.errors**2)))

    @property
    def rms_sigma(self) -> float:
        """Root mean square of the standard deviations of both parts together."""
        return float(np.sqrt(np.mean(self.sigmas**2)))

    @property
    def largest(self) -> int:
        """Index of the largest error."""
        return int(np.argmax(np.abs(self.errors)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """A calibration, and how wrong it is.

    Attributes:
        true: the true robot.
        robot: the calibrated one, with the true one's other data; what `calibrated` takes in
            `make_vision_based_control`.
        groups: errors and standard deviations of all parameters.
        poses: X_WP of the platform in the calibration.
        setup: how it was made.
        seed: of its noise.
    """

    true: CableRobot
    robot: CableRobot
    groups: tuple[ParameterGroup, ...]
    poses: tuple[RigidTransform, ...]
    setup: CalibrationSetup
    seed: int

    def group(self, name: str) -> ParameterGroup:
        """Return a group by its `name`; raises KeyError if there is none."""
        for group in self.groups:
            if group.name == name:
                return group
        raise KeyError(f"no group {name!r} among {', '.join(g.name for g in self.groups)}")

    def pose_errors(self, poses: Sequence[RigidTransform] | None = None) -> Array:
        """Return how wrong the pose is that exact images give with the calibrated robot.

        Args:
            poses: X_WP where to ask (n); those of the calibration if None.

        Returns:
            (n, 6): measured less true, [rotation vector; translation] in W [rad, m]; what a goal
            given in W is missed by.
        """
        return seen_wrongly(self.true, self.robot, self.poses if poses is None else poses)

    def camera_frame_error(self, p_WQ: Array) -> Array:
        """Return how far a point fixed in F is thought to be from where it is (3,) [m].

        Args:
            p_WQ: (3,) [m], where it is. At the origin of F this is the error of X_WF's translation.
        """
        X = self.robot.cameras.X_WF @ self.true.cameras.X_WF.inverse()
        return np.asarray(X @ np.asarray(p_WQ, float) - p_WQ, float)


def seen_wrongly(true: CableRobot, believed: CableRobot, poses: Sequence[RigidTransform]) -> Array:
    """Return measured less true poses (n, 6) [rad, m], from images without noise and bias.

    Args:
        true: the true robot.
        believed: the robot as the controller believes it.
        poses: X_WP (n).

    Raises:
        CalibrationError: in a pose no camera sees a pattern.
    """
    exact = true.replace(cameras=true.cameras.replace(pixel_noise=0.0, pixel_bias=0.0))
    images, estimate = TargetImages(exact), PoseEstimator(believed)
    errors = []
    for X_WP in poses:
        found = estimate(images(X_WP), X_WP)
        if found is None:
            raise CalibrationError(f"no camera sees a pattern at {X_WP.translation()} m")
        errors.append(difference(found.X_WP, X_WP))
    return np.array(errors)
