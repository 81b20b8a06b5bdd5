"""OpenCV's camera model with derivatives with respect to points and parameters, for many points.

A camera is a vector (9,) [fx, fy, cx, cy, k1, k2, p1, p2, k3], see `Intrinsics`.
"""

from __future__ import annotations

import numpy as np

from cdpr_drake.model.rotations import Array
from cdpr_drake.model.vision.cameras import Intrinsics

PARAMETERS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")


def as_vector(camera: Intrinsics) -> Array:
    """Return a `camera` as a vector (9,)."""
    K = camera.camera_matrix
    return np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2], *camera.distortion])


def as_intrinsics(vector: Array, width: int, height: int) -> Intrinsics:
    """Return a camera as a record.

    Args:
        vector: (9,).
        width: of the image [px].
        height: of the image [px].
    """
    fx, fy, cx, cy = vector[:4]
    return Intrinsics(
        camera_matrix=np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
        distortion=vector[4:],
        width=width,
        height=height,
    )


def project(camera: Array, points: Array) -> tuple[Array, Array, Array]:
    """Return pixels (n, 2), and their derivatives by points (n, 2, 3) and camera (n, 2, 9).

    Args:
        camera: (9,).
        points: (n, 3) [m], in the camera's frame; pixels of those behind it are NaN.
    """
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = camera
    z = np.where(points[:, 2] > 1e-6, points[:, 2], np.nan)
    x, y = points[:, 0] / z, points[:, 1] / z
    r2, xy = x * x + y * y, 2.0 * x * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))
    a = x * radial + p1 * xy + p2 * (r2 + 2.0 * x * x)
    b = y * radial + p2 * xy + p1 * (r2 + 2.0 * y * y)
    a_x = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
    b_y = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
    mixed = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y
    by_point = np.empty((z.size, 2, 3))
    by_point[:, 0, 0], by_point[:, 0, 1] = fx * a_x / z, fx * mixed / z
    by_point[:, 1, 0], by_point[:, 1, 1] = fy * mixed / z, fy * b_y / z
    by_point[:, :, 2] = -(by_point[:, :, 0] * x[:, None] + by_point[:, :, 1] * y[:, None])
    by_camera = np.zeros((z.size, 2, 9))
    by_camera[:, 0, 0], by_camera[:, 1, 1] = a, b
    by_camera[:, 0, 2], by_camera[:, 1, 3] = 1.0, 1.0
    for column, power in ((4, r2), (5, r2 * r2), (8, r2 * r2 * r2)):
        by_camera[:, 0, column], by_camera[:, 1, column] = fx * x * power, fy * y * power
    by_camera[:, 0, 6], by_camera[:, 1, 6] = fx * xy, fy * (r2 + 2.0 * y * y)
    by_camera[:, 0, 7], by_camera[:, 1, 7] = fx * (r2 + 2.0 * x * x), fy * xy
    return np.stack([fx * a + cx, fy * b + cy], axis=1), by_point, by_camera
