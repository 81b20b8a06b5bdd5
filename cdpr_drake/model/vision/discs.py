"""The patterns' points as discs: where their images have their centres, and how large they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.vision.targets import TargetGeometry, TargetImages

CORNERS = 16
"""Corners of the polygon that stands for a disc."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DiscViews:
    """The discs that cameras should see, one row each.

    Attributes:
        camera: (m,), index of the camera.
        point: (m,), index of the point among those of all patterns.
        pixel: (m, 2) [px], of the point itself, the disc's centre.
        centroid: (m, 2) [px], of the disc's image. Perspective and distortion move it away from
            the point: by 0.02 px for 0.1 m seen obliquely over 10 m.
        half_size: (m, 2) [px], of the image, across and down.
        area: (m,) [px], of the image.
    """

    camera: NDArray[np.intp]
    point: NDArray[np.intp]
    pixel: Array
    centroid: Array
    half_size: Array
    area: Array


class DiscImages:
    """The images of the patterns' discs in the pose cameras, at a pose of the platform.

    Args:
        robot: the robot.

    Raises:
        RobotFileError: it has no pose cameras, or no patterns.
    """

    def __init__(self, robot: CableRobot) -> None:
        from cdpr_drake.model.kernels import vision as kernel

        self._kernel = kernel
        exact = robot.cameras.replace(pixel_noise=0.0, pixel_bias=0.0)
        self._points = TargetImages(robot.replace(cameras=exact))
        self._cameras = TargetGeometry(robot).cameras
        self.num_cameras, self.num_points = self._points.num_cameras, self._points.num_points
        patterns = robot.cameras.patterns
        self._rims = np.concatenate([_rims(robot.cameras.X_PM @ p.X_MT, p) for p in patterns])

    def __call__(self, X_WP: RigidTransform) -> DiscViews:
        """Return what the cameras should see.

        Args:
            X_WP: pose of the platform.
        """
        sightings = self._points(X_WP)
        camera, point = np.nonzero(sightings.visible)
        R, p = X_WP.rotation().matrix(), X_WP.translation()
        rims = self._rims[point].reshape(-1, 3) @ R.T + p
        pixels = np.empty((len(rims), 2))
        self._kernel.project_all(self._cameras, np.repeat(camera, CORNERS), rims, pixels)
        pixel = sightings.pixels[camera, point]
        area, offset = _centroids(pixels.reshape(-1, CORNERS, 2) - pixel[:, None])
        corners = pixels.reshape(-1, CORNERS, 2)
        return DiscViews(
            camera=camera,
            point=point,
            pixel=pixel,
            centroid=pixel + offset,
            half_size=0.5 * (corners.max(axis=1) - corners.min(axis=1)),
            area=area,
        )


def _rims(X_PT: RigidTransform, pattern: object) -> Array:
    """Return (n, CORNERS, 3) [m], in P: polygons of the discs' area."""
    points, diameter = pattern.points, pattern.point_diameter  # type: ignore[attr-defined]
    angle = 2.0 * np.pi * np.arange(CORNERS) / CORNERS
    radius = 0.5 * diameter * np.sqrt(2.0 * np.pi / CORNERS / np.sin(2.0 * np.pi / CORNERS))
    circle = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    flat = np.pad(points[:, None] + circle, ((0, 0), (0, 0), (0, 1)))
    return flat @ X_PT.rotation().matrix().T + X_PT.translation()


def _centroids(polygons: Array) -> tuple[Array, Array]:
    """Return areas (m,) and centroids (m, 2) of polygons (m, corners, 2)."""
    a, b = polygons, np.roll(polygons, -1, axis=1)
    cross = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    twice = cross.sum(axis=1)
    centroid = np.sum((a + b) * cross[..., None], axis=1) / (3.0 * twice[:, None])
    return 0.5 * np.abs(twice), centroid
