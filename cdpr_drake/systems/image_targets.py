"""The pose cameras, from their images: pixels as a camera delivers them to a measured pose."""

from __future__ import annotations

from typing import Any

from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context
from pydrake.systems.sensors import ImageRgba8U

from cdpr_drake.errors import GeometryError
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.vision.image_pose import ImagePoseEstimator
from cdpr_drake.model.vision.outages import POSE_CAMERA, Outage, Outages
from cdpr_drake.model.vision.pose import PoseEstimate
from cdpr_drake.systems.held_pose import HeldPose


class ImageTargets(HeldPose):
    """The platform's pose from the images of the pose cameras, taken at each sample.

    .. pydrake_system::

        name: ImageTargets
        input_ports:
        - image_1, ..., one per pose camera
        output_ports:
        - measured_pose
        - noise_covariance
        - fixed_covariance
        - num_targets
        - num_cameras
        - age
        - frames_lost
        - images_lost

    The images are abstract, of type ImageRgba8U, as Drake's RgbdSensor gives them. At k T the white
    points are found in them, in windows around where the pose held predicts them, or, where that
    leads to nothing, in the whole images; the pose follows as in `TargetCameras`, whose outputs
    these are, see `HeldPose`. Where there is no pose, the last is held. The system knows nothing of
    the platform but its images.

    Args:
        believed: the robot as the controller believes it.
        sample_time: period T [s]; that of the robot's cameras if None.
        estimator: "joint" or "mean", see `PoseEstimator`.
        outages: when cameras deliver no image.

    Raises:
        RobotFileError: the robot has no pose cameras or no patterns.
        ValueError: an unknown estimator, or an outage of a camera that is not there.
        GeometryError: at an update, when an image is not of the camera's size.
        SimulationError: at an update, when no pose has been measured yet and none can be.
    """

    def __init__(
        self,
        believed: CableRobot,
        sample_time: float | None = None,
        estimator: str = "joint",
        outages: tuple[Outage, ...] = (),
    ) -> None:
        cameras = believed.cameras
        period = cameras.sample_time if sample_time is None else sample_time
        super().__init__(believed, period)
        self._sizes = [(c.intrinsics.height, c.intrinsics.width) for c in cameras.pose_cameras]
        self._estimate = ImagePoseEstimator(believed, estimator)
        self._outages = Outages(outages, POSE_CAMERA, self.num_cameras)
        self._ports = [
            self.DeclareAbstractInputPort(f"image_{i + 1}", Value(ImageRgba8U()))
            for i in range(self.num_cameras)
        ]

    def measure(self, context: Context, prior: RigidTransform | None) -> PoseEstimate | None:
        """Return the pose that the images show now, or None; see `HeldPose`.

        Args:
            context: the system's own.
            prior: the pose held; None in the first frame.
        """
        return self._estimate(self.see(context), prior)

    def measure_at_rest(self, context: Context) -> PoseEstimate | None:
        """Return the pose that all images show now, searched for all over them, or None.

        Args:
            context: the system's own.
        """
        return self._estimate([self._image(context, i) for i in range(self.num_cameras)])

    def see(self, context: Context) -> list[Any]:
        """Return the images now, (height, width, 4) of uint8; None of a camera that fails.

        Args:
            context: the system's own.
        """
        lost = self._outages.at(context.get_time())
        return [None if i in lost else self._image(context, i) for i in range(self.num_cameras)]

    def _image(self, context: Context, camera: int) -> Any:
        image = self._ports[camera].Eval(context).data
        if image.shape[:2] != self._sizes[camera]:
            (height, width), (got, across) = self._sizes[camera], image.shape[:2]
            raise GeometryError(
                f"image {camera + 1} is of {across} x {got} pixels; "
                f"the camera has {width} x {height}"
            )
        return image
