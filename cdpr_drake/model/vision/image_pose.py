"""The platform's pose from images: points tracked around a prediction, or searched for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.vision.blobs import Image, find_all, find_near
from cdpr_drake.model.vision.discs import DiscImages
from cdpr_drake.model.vision.pattern_search import PatternSearch
from cdpr_drake.model.vision.pose import PoseEstimate, PoseEstimator
from cdpr_drake.model.vision.targets import Sightings

MARGIN = 12.0
"""How far a point may have moved in an image since the last frame [px]."""

LARGEST_ERROR = 1.5
"""A pose that leaves more than this between points and their images is of other things [px]."""


class ImagePoseEstimator:
    """Estimates the platform's pose from the images of the pose cameras.

    As ViSP does, the pose a frame ago says where in the images to look for each point. Where that
    leads to no pose, all spots of the whole images are found and the patterns searched for among
    them. What perspective and distortion do to the centre of a disc's image is taken out.

    Args:
        robot: the robot as the controller believes it.
        estimator: "joint" or "mean", see `PoseEstimator`.

    Raises:
        RobotFileError: the robot has no pose cameras, or no patterns.
        ValueError: an unknown estimator.
    """

    def __init__(self, robot: CableRobot, estimator: str = "joint") -> None:
        self._discs = DiscImages(robot)
        self._estimate = PoseEstimator(robot, estimator)
        self._search = PatternSearch(robot)

    def __call__(
        self, images: Sequence[Image | None], prior: RigidTransform | None = None
    ) -> PoseEstimate | None:
        """Return the pose, or None where too little is seen.

        Args:
            images: of all pose cameras; None for one that delivers none.
            prior: the pose a frame ago.
        """
        if prior is not None:
            estimate = self._estimate(self.track(images, prior), prior)
            if _is_good(estimate):
                return estimate
        rough = self.search(images, prior)
        for _ in range(2):  # once more with what the first told about where to look
            if rough is None:
                return None
            estimate = self._estimate(self.track(images, rough), rough)
            rough = estimate.X_WP if estimate is not None else None
        return estimate if _is_good(estimate) else None

    def track(self, images: Sequence[Image | None], X_WP: RigidTransform) -> Sightings:
        """Return the points found near to where they should be.

        Args:
            images: of all pose cameras; None for one that delivers none.
            X_WP: about where the platform is.
        """
        shape = (self._discs.num_cameras, self._discs.num_points)
        pixels, visible = np.zeros((*shape, 2)), np.zeros(shape, dtype=bool)
        views = self._discs(X_WP)
        bias = views.centroid - views.pixel
        expected = np.column_stack([views.centroid, views.half_size + MARGIN, views.area])
        # Plain numbers: NumPy's own, one at a time, would take half of the time.
        rows = zip(views.camera.tolist(), views.point.tolist(), expected.tolist(), strict=True)
        for i, (camera, point, (u, v, across, down, area)) in enumerate(rows):
            image = images[camera]
            blob = None if image is None else find_near(image, u, v, (across, down), area)
            if blob is not None:
                pixels[camera, point] = blob.u - bias[i, 0], blob.v - bias[i, 1]
                visible[camera, point] = True
        return Sightings(pixels=pixels, visible=visible)

    def search(
        self, images: Sequence[Image | None], prior: RigidTransform | None = None
    ) -> RigidTransform | None:
        """Return about where the platform is, from the whole images, or None.

        Args:
            images: of all pose cameras; None for one that delivers none.
            prior: a pose it had, to tell sides apart that look the same.
        """
        return self._search([_spots(image) for image in images], prior)


def _spots(image: Image | None) -> Array:
    """Return (m, 2) [px]: the centres of all spots of an image, the largest first."""
    blobs = [] if image is None else sorted(find_all(image), key=lambda blob: -blob.area)
    return np.array([(blob.u, blob.v) for blob in blobs]).reshape(-1, 2)


def _is_good(estimate: PoseEstimate | None) -> bool:
    return estimate is not None and estimate.pixel_error <= LARGEST_ERROR
