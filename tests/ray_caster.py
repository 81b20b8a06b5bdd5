"""Images of the patterns by casting rays from pixels: slow, simple, and apart from the package."""

from __future__ import annotations

import cv2
import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.model.robot import CableRobot

BACKGROUND, FACE, POINT = 100.0, 26.0, 240.0
PARTS = 4  # rays per pixel, across and down


def cast_images(
    robot: CableRobot, X_WP: RigidTransform, noise: float = 0.0, seed: int = 0
) -> list[np.ndarray]:
    """Return what each pose camera sees, (height, width, 4) of uint8."""
    generator = np.random.default_rng(seed)
    images = []
    for camera in robot.cameras.pose_cameras:
        X_WC = robot.cameras.X_WF @ camera.X_FC
        X_CM = X_WC.inverse() @ X_WP @ robot.cameras.X_PM
        grey = _cast(robot, camera.intrinsics, X_CM)
        if noise:
            grey = grey + noise * generator.standard_normal(grey.shape)
        grey = np.clip(np.round(grey), 0, 255).astype(np.uint8)
        images.append(np.dstack([grey, grey, grey, np.full_like(grey, 255)]))
    return images


def _cast(robot: CableRobot, intrinsics: object, X_CM: RigidTransform) -> np.ndarray:
    image = np.full((intrinsics.height, intrinsics.width), BACKGROUND)  # type: ignore[attr-defined]
    corners = np.array(np.meshgrid([-0.6, 0.6], [-0.6, 0.6], [-0.6, 0.6])).reshape(3, -1).T
    ahead = np.array([X_CM @ p for p in corners])
    if ahead[:, 2].min() < 0.1:
        return image
    K, distortion = intrinsics.camera_matrix, intrinsics.distortion  # type: ignore[attr-defined]
    pixels, _ = cv2.projectPoints(ahead, np.zeros(3), np.zeros(3), K, distortion)
    low = np.maximum(np.floor(pixels.min(axis=(0, 1))), 0).astype(int)
    high = np.minimum(np.ceil(pixels.max(axis=(0, 1))) + 1, image.shape[::-1]).astype(int)
    if np.any(high <= low):
        return image
    rays = _rays(low, high, K, distortion)
    colours = np.full(rays.shape[:2], BACKGROUND)
    for pattern in robot.cameras.patterns:
        X_TC = (X_CM @ pattern.X_MT).inverse()
        origin, R = X_TC.translation(), X_TC.rotation().matrix()
        if origin[2] < 0.0:
            continue
        x, y, z = (R[i, 0] * rays[..., 0] + R[i, 1] * rays[..., 1] + R[i, 2] for i in range(3))
        a, b = origin[0] - x * (origin[2] / z), origin[1] - y * (origin[2] / z)
        on_face = np.maximum(np.abs(a), np.abs(b)) < 0.5
        a, b, colour = a[on_face], b[on_face], np.full(np.count_nonzero(on_face), FACE)
        for u, v in pattern.points:
            colour[(a - u) ** 2 + (b - v) ** 2 < (0.5 * pattern.point_diameter) ** 2] = POINT
        colours[on_face] = colour
    width, height = high - low
    parts = colours.reshape(height, PARTS, width, PARTS)
    image[low[1] : high[1], low[0] : high[0]] = parts.mean(axis=(1, 3))
    return image


def _rays(low: np.ndarray, high: np.ndarray, K: np.ndarray, distortion: np.ndarray) -> np.ndarray:
    """Where the rays of all parts of the pixels from low to high meet z = 1."""
    u, v = (np.arange(a - 1.0, b + 1.0) for a, b in zip(low, high, strict=True))
    uv = np.stack(np.meshgrid(u, v), axis=-1)
    flat = cv2.undistortPoints(uv.reshape(-1, 1, 2), K, distortion, criteria=(3, 30, 1e-9))
    rays = flat.reshape(uv.shape)
    across = 0.5 * (rays[1:-1, 2:] - rays[1:-1, :-2])
    down = 0.5 * (rays[2:, 1:-1] - rays[:-2, 1:-1])
    part = (np.arange(PARTS) + 0.5) / PARTS - 0.5
    within = (
        rays[1:-1, None, 1:-1, None]
        + across[:, None, :, None] * part[:, None]
        + down[:, None, :, None] * part[:, None, None, None]
    )
    return within.reshape(PARTS * within.shape[0], -1, 2)
