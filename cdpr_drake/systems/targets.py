"""The pose cameras: pixels of the patterns on the platform to its measured pose."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.common import RandomDistribution
from pydrake.math import RigidTransform
from pydrake.systems.framework import LeafSystem

from cdpr_drake.errors import GeometryError, SimulationError
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, pose_to_vector, vector_to_pose
from cdpr_drake.model.vision.outages import POSE_CAMERA, Outage, Outages
from cdpr_drake.model.vision.pose import PoseEstimate, PoseEstimator
from cdpr_drake.model.vision.targets import Sightings, TargetImages
from cdpr_drake.systems._template import GAUSSIAN_INPUT, check_finite

# The discrete state: pose, covariance, and what is counted.
_POSE, _COVARIANCE = slice(0, 6), slice(6, 42)
_FRAMES, _TARGETS, _CAMERAS, _AGE, _LOST, _IMAGES_LOST = range(42, 48)
_SIZE = 48


class TargetCameras(LeafSystem):
    """The platform's pose from the points of its patterns, as sampled by the pose cameras.

    .. pydrake_system::

        name: TargetCameras
        input_ports:
        - pose
        - noise (optional)
        output_ports:
        - measured_pose
        - covariance
        - num_targets
        - num_cameras
        - age
        - frames_lost
        - images_lost

    At k T the true cameras see the patterns (section 4.2), with noise and each point's fixed bias,
    and the pose is estimated with what the controller believes of cameras and patterns. Where too
    little is seen, the last pose is held. Poses are [roll, pitch, yaw, x, y, z] (rad, m) of X_WP;
    noise is standard normal, two numbers for each point in each camera, ignored if the port is left
    open; covariance (36) is that of a small motion [rotation vector; translation] of P in W [rad,
    m], row by row; num_targets and num_cameras say how many points and cameras took part in the
    last frame; age [s] is how long ago the pose held was measured; frames_lost counts the frames
    without a pose, images_lost the images of single cameras that were of no use. All is discrete
    state: no output depends on an input at once. OpenCV works on plain numbers, so there is no
    AutoDiffXd.

    Args:
        robot: the true robot.
        calibrated: the robot as the controller believes it; the true one if None.
        sample_time: period T [s]; that of the robot's cameras if None.
        estimator: "joint" or "mean", see `PoseEstimator`.
        outages: when cameras see nothing.

    Raises:
        RobotFileError: the robot has no pose cameras or no patterns.
        ValueError: an unknown estimator, or an outage of a camera that is not there.
        SimulationError: at an update, when no pose has been measured yet and none can be.
    """

    def __init__(
        self,
        robot: CableRobot,
        calibrated: CableRobot | None = None,
        sample_time: float | None = None,
        estimator: str = "joint",
        outages: tuple[Outage, ...] = (),
    ) -> None:
        super().__init__()
        self.robot = robot
        self.calibrated = calibrated if calibrated is not None else robot
        self.sample_time = robot.cameras.sample_time if sample_time is None else sample_time
        self._images = TargetImages(robot)
        self._estimate = PoseEstimator(self.calibrated, estimator)
        self._outages = Outages(outages, POSE_CAMERA, self._images.num_cameras)
        self._pose_port = self.DeclareVectorInputPort("pose", 6)
        self._noise_port = self.DeclareVectorInputPort(
            GAUSSIAN_INPUT, self._images.noise_size, RandomDistribution.kGaussian
        )
        self.DeclareDiscreteState(_SIZE)
        self.DeclarePeriodicDiscreteUpdateEvent(self.sample_time, 0.0, self._update)
        for name, part in (
            ("measured_pose", _POSE),
            ("covariance", _COVARIANCE),
            ("num_targets", slice(_TARGETS, _TARGETS + 1)),
            ("num_cameras", slice(_CAMERAS, _CAMERAS + 1)),
            ("age", slice(_AGE, _AGE + 1)),
            ("frames_lost", slice(_LOST, _LOST + 1)),
            ("images_lost", slice(_IMAGES_LOST, _IMAGES_LOST + 1)),
        ):
            size = part.stop - part.start
            self.DeclareVectorOutputPort(name, size, self._part(part), {self.xd_ticket()})

    def set_at_rest(self, context: Any) -> None:
        """Make the held pose what all cameras see now without noise.

        Args:
            context: the system's own, changed.

        Raises:
            GeometryError: no camera sees enough of the platform.
        """
        pose = self._pose_port.Eval(context)
        estimate = self._estimate(self._images(vector_to_pose(pose)))
        if estimate is None:
            place = np.round(pose[3:], 3).tolist()
            raise GeometryError(f"no pose camera sees a whole pattern of the platform at {place} m")
        state = np.zeros(_SIZE)
        _record(state, estimate)
        context.SetDiscreteState(state)

    def see(self, context: Any) -> Sightings:
        """Return what the cameras see now.

        Args:
            context: the system's own.
        """
        noise = self._noise_port.Eval(context) if self._noise_port.HasValue(context) else None
        pose = self._pose_port.Eval(context)
        check_finite(pose if noise is None else np.append(pose, noise), self, context, "inputs")
        sightings = self._images(vector_to_pose(pose), noise)
        lost = self._outages.at(context.get_time())
        return sightings.without(list(lost)) if lost else sightings

    def _update(self, context: Any, discrete: Any) -> None:
        state: Array = context.get_discrete_state_vector().CopyToVector()
        prior: RigidTransform | None = None
        if state[_FRAMES] > 0.0:
            prior = vector_to_pose(state[_POSE])
        estimate = self._estimate(self.see(context), prior)
        if estimate is not None:
            _record(state, estimate)
        elif prior is None:
            what = "no pose camera sees a whole pattern of the platform"
            raise SimulationError("measured pose", context.get_time(), what)
        else:
            state[[_TARGETS, _CAMERAS]] = 0.0
            state[_AGE] += self.sample_time
            state[_LOST] += 1.0
        state[_IMAGES_LOST] += self._images.num_cameras - state[_CAMERAS]
        discrete.set_value(state)

    def _part(self, part: slice) -> Any:
        def calc(context: Any, output: Any) -> None:
            output.SetFromVector(context.get_discrete_state_vector().CopyToVector()[part])

        return calc


def _record(state: Array, estimate: PoseEstimate) -> None:
    """Write an estimate into the discrete state."""
    state[_POSE] = pose_to_vector(estimate.X_WP)
    state[_COVARIANCE] = estimate.covariance.ravel()
    state[_FRAMES] += 1.0
    state[[_TARGETS, _CAMERAS, _AGE]] = estimate.num_targets, estimate.num_cameras, 0.0
