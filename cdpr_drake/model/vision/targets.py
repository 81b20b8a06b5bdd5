"""What the pose cameras see of the platform's patterns: pixels, noise, and what is hidden."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from cdpr_drake.errors import RobotFileError
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.vision.cameras import Intrinsics

MOST_OBLIQUE = np.radians(75.0)
"""A pattern seen at a larger angle from its normal is not found in an image [rad]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sightings:
    """The points of all patterns in the images of all pose cameras.

    Attributes:
        pixels: (c, n, 2) [px], of n points in c cameras; what is not visible may be anything.
        visible: (c, n), whether a point was found in a camera's image.
    """

    pixels: Array
    visible: NDArray[np.bool_]

    def without(self, cameras: list[int]) -> Sightings:
        """Return the sightings with the images of some `cameras` lost, by index from 0."""
        visible = self.visible.copy()
        visible[cameras] = False
        return Sightings(pixels=self.pixels, visible=visible)


def pack_camera(X_WC: RigidTransform, intrinsics: Intrinsics) -> Array:
    """Return a camera (21,) as kernels/vision.py takes it.

    Args:
        X_WC: pose of the camera.
        intrinsics: how it projects.
    """
    X_CW, K = X_WC.inverse(), intrinsics.camera_matrix
    row = (
        X_CW.rotation().matrix().ravel(),
        X_CW.translation(),
        [K[0, 0], K[1, 1], K[0, 2], K[1, 2]],
        intrinsics.distortion,
    )
    return np.concatenate(row)


class TargetGeometry:
    """Cameras and points of a robot, as arrays.

    Attributes:
        cameras: (c, 21), packed.
        points: (n, 3) [m], of all patterns one after another, in P.
        pattern: (n,), the index of each point's pattern.
        X_PT: the pose of each pattern in P.

    Args:
        robot: the robot.

    Raises:
        RobotFileError: it has no pose cameras, or no patterns.
    """

    def __init__(self, robot: CableRobot) -> None:
        setup = robot.cameras
        for name in ("pose_cameras", "patterns"):
            if not getattr(setup, name):
                raise RobotFileError(f"robot {robot.name!r}", f"cameras.{name}", "there are none")
        self.cameras = np.array(
            [pack_camera(setup.X_WF @ c.X_FC, c.intrinsics) for c in setup.pose_cameras]
        )
        self.X_PT = [setup.X_PM @ pattern.X_MT for pattern in setup.patterns]
        flat = [np.pad(p.points, ((0, 0), (0, 1))) for p in setup.patterns]
        # Rows: R p + t for each point p of a pattern, in its frame T.
        self.points = np.vstack(
            [
                p @ X.rotation().matrix().T + X.translation()
                for p, X in zip(flat, self.X_PT, strict=True)
            ]
        )
        self.pattern = np.repeat(np.arange(len(flat)), [len(p) for p in flat])


class TargetImages:
    """The images of the patterns in the pose cameras: projection, visibility, noise.

    A pattern is hidden where its face turns away (the platform is convex, so nothing else hides
    it), or is more oblique than `MOST_OBLIQUE`; a point is lost outside of the image. The cables
    hide nothing.

    Args:
        robot: the true robot.

    Raises:
        RobotFileError: it has no pose cameras, or no patterns.
    """

    def __init__(self, robot: CableRobot) -> None:
        from cdpr_drake.model.kernels import vision as kernel

        self._kernel = kernel
        self._geometry = TargetGeometry(robot)
        setup = robot.cameras
        self._sigma = setup.pixel_noise
        sizes = [(c.intrinsics.width, c.intrinsics.height) for c in setup.pose_cameras]
        self._sizes = np.array(sizes, float)[:, None]
        self._positions = np.array(
            [(setup.X_WF @ c.X_FC).translation() for c in setup.pose_cameras]
        )
        self.num_cameras, self.num_points = len(sizes), len(self._geometry.points)
        shape = (self.num_cameras, self.num_points, 2)
        generator = np.random.default_rng(setup.pixel_bias_seed)
        self.bias = setup.pixel_bias * generator.standard_normal(shape)
        self._which = np.repeat(np.arange(self.num_cameras), self.num_points)

    @property
    def noise_size(self) -> int:
        """The length of the noise vector of one frame."""
        return 2 * self.num_cameras * self.num_points

    def __call__(self, X_WP: RigidTransform, noise: Array | None = None) -> Sightings:
        """Return what the cameras see.

        Args:
            X_WP: pose of the platform.
            noise: (noise_size,) standard normal, scaled by the robot's pixel noise; none if None.
                The fixed bias of each point is always there.
        """
        shape = (self.num_cameras, self.num_points, 2)
        p_WQ = self._geometry.points @ X_WP.rotation().matrix().T + X_WP.translation()
        pixels = np.empty((self._which.size, 2))
        self._kernel.project_all(
            self._geometry.cameras, self._which, np.tile(p_WQ, (self.num_cameras, 1)), pixels
        )
        pixels = pixels.reshape(shape)
        faces = self._faces(X_WP)[:, self._geometry.pattern]
        ahead = self._in_front_of_image(p_WQ)
        pixels = pixels + self.bias
        if noise is not None:
            pixels = pixels + self._sigma * np.reshape(noise, shape)
        inside = np.all((pixels >= 0.0) & (pixels <= self._sizes - 1.0), axis=2)
        return Sightings(pixels=pixels, visible=faces & ahead & inside)

    def _faces(self, X_WP: RigidTransform) -> NDArray[np.bool_]:
        """Return (c, patterns): whether a pattern's face is turned to a camera."""
        X_WT = [X_WP @ X_PT for X_PT in self._geometry.X_PT]
        normals = np.array([X.rotation().matrix()[:, 2] for X in X_WT])
        to_camera = self._positions[:, None] - [X.translation() for X in X_WT]
        cosine = np.sum(to_camera * normals, axis=2) / np.linalg.norm(to_camera, axis=2)
        return cosine > np.cos(MOST_OBLIQUE)

    def _in_front_of_image(self, p_WQ: Array) -> NDArray[np.bool_]:
        """Return (c, n): whether a point is near the field of view without distortion.

        Far outside of it the polynomial of the distortion may lead back into the image.
        """
        cameras = self._geometry.cameras
        R_CW = cameras[:, :9].reshape(-1, 3, 3)
        p_CQ = np.einsum("cij,nj->cni", R_CW, p_WQ) + cameras[:, None, 9:12]
        depth = np.where(p_CQ[..., 2:] > 0.0, p_CQ[..., 2:], np.inf)
        plain = p_CQ[..., :2] / depth * cameras[:, None, 12:14] + cameras[:, None, 14:16]
        near = np.all((plain > -0.5 * self._sizes) & (plain < 1.5 * self._sizes), axis=2)
        return near & (p_CQ[..., 2] > 0.0)
