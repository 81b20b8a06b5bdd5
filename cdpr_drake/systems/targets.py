"""The pose cameras: pixels of the patterns on the platform to its measured pose."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import vector_to_pose
from cdpr_drake.model.vision.outages import POSE_CAMERA, Outage, Outages
from cdpr_drake.model.vision.pose import PoseEstimate, PoseEstimator
from cdpr_drake.model.vision.targets import Sightings, TargetImages
from cdpr_drake.systems._template import check_finite, noise_input
from cdpr_drake.systems.held_pose import HeldPose


class TargetCameras(HeldPose):
    """The platform's pose from the points of its patterns, as sampled by the pose cameras.

    .. pydrake_system::

        name: TargetCameras
        input_ports:
        - pose
        - noise (optional)
        output_ports:
        - measured_pose
        - noise_covariance
        - fixed_covariance
        - num_targets
        - num_cameras
        - age
        - frames_lost
        - images_lost

    At k T the true cameras see the patterns (section 4.2), with noise and each point's fixed bias,
    and the pose is estimated with what the controller believes of cameras and patterns. Where too
    little is seen, the last pose is held. Poses are [roll, pitch, yaw, x, y, z] (rad, m) of X_WP;
    noise is standard normal, two numbers for each point in each camera, ignored if the port is left
    open; the covariances (36) are of a small motion [rotation vector; translation] of P in W [rad,
    m], row by row, see `HeldPose`: noise averages out over frames, fixed bias does not; num_targets
    and num_cameras say how many points and cameras took part in the last frame; age [s] is how long
    ago the pose held was measured; frames_lost counts the frames without a pose, images_lost the
    images of single cameras that were of no use. All is discrete state: no output depends on an
    input at once. OpenCV works on plain numbers, so there is no AutoDiffXd.

    Args:
        robot: the true robot.
        believed: the robot as the controller believes it; the true one if None.
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
        believed: CableRobot | None = None,
        sample_time: float | None = None,
        estimator: str = "joint",
        outages: tuple[Outage, ...] = (),
    ) -> None:
        period = robot.cameras.sample_time if sample_time is None else sample_time
        super().__init__(believed if believed is not None else robot, period)
        self.robot = robot
        self._images = TargetImages(robot)
        self._estimate = PoseEstimator(self.believed, estimator)
        self._outages = Outages(outages, POSE_CAMERA, self.num_cameras)
        self._pose_port = self.DeclareVectorInputPort("pose", 6)
        self._noise_port = noise_input(self, self._images.noise_size)

    def measure(self, context: Context, prior: RigidTransform | None) -> PoseEstimate | None:
        """Return the pose that the points seen now give, or None; see `HeldPose`.

        Args:
            context: the system's own.
            prior: the pose held; None in the first frame.
        """
        return self._estimate(self.see(context), prior)

    def measure_at_rest(self, context: Context) -> PoseEstimate | None:
        """Return the pose that all cameras show now without noise, or None.

        Args:
            context: the system's own.
        """
        return self._estimate(self._images(vector_to_pose(self._pose_port.Eval(context))))

    def see(self, context: Context) -> Sightings:
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
