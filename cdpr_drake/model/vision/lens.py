"""What a camera makes of a pinhole's image, as a renderer draws it: distortion and noise."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np

from cdpr_drake.errors import RobotFileError
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.vision.cable_drawing import GREY_NOISE, QUANTILES
from cdpr_drake.model.vision.cameras import Intrinsics

_ZERO = 128  # the grey level that stands for no noise

LARGEST = 3.0
"""A pinhole's image this many times as wide as the camera's would be beyond all use."""


@dataclass(frozen=True, kw_only=True)
class Pinhole:
    """A camera without distortion, its pixels square, its axis in the middle of the image.

    Attributes:
        focal_length: [px].
        width: [px].
        height: [px].
    """

    focal_length: float
    width: int
    height: int

    @property
    def centre(self) -> tuple[float, float]:
        """Where the axis meets the image [px], the centre of the first pixel being (0, 0)."""
        return 0.5 * (self.width - 1), 0.5 * (self.height - 1)


class Lens:
    """Turns the image of a pinhole into that of a camera with distortion and noise.

    The pinhole has the camera's larger focal length, so that nothing is magnified, and sees all
    that the camera does. The noise of a pixel is white, and the same in all of its colours.

    Args:
        intrinsics: of the camera.
        grey_noise: standard deviation of a pixel [grey levels of 256].

    Raises:
        RobotFileError: the distortion leads too far outside of what a pinhole can see.
        ValueError: noise below 0.
    """

    def __init__(self, intrinsics: Intrinsics, grey_noise: float = GREY_NOISE) -> None:
        from scipy.special import ndtri

        if not grey_noise >= 0.0:
            raise ValueError(f"noise must be >= 0, got {grey_noise}")
        # Drawn by 16 random bits a pixel from as many equally likely values, around _ZERO.
        levels = np.round(_ZERO + grey_noise * ndtri(QUANTILES))
        self._levels = np.clip(levels, 0, 255).astype(np.uint8)
        rays = _rays(intrinsics)
        if rays is None:
            raise RobotFileError("camera", "distortion", "no pinhole sees what this lens does")
        f = float(max(intrinsics.camera_matrix[0, 0], intrinsics.camera_matrix[1, 1]))
        reach = f * np.abs(rays).max(axis=(0, 1))
        size = np.array([intrinsics.width, intrinsics.height])
        if not np.all(reach <= 0.5 * LARGEST * size):
            raise RobotFileError("camera", "distortion", "no pinhole sees what this lens does")
        width, height = (2 * int(np.ceil(r + 1.0)) for r in reach)
        self.pinhole = Pinhole(focal_length=f, width=width, height=height)
        self._map = (f * rays + self.pinhole.centre).astype(np.float32)

    def __call__(self, image: Any, out: Any, seed: int | None = None) -> None:
        """Write the camera's image.

        Args:
            image: (height, width, 4), uint8, of the pinhole.
            out: (height, width, 4), uint8, of the camera.
            seed: of the noise; none if None.
        """
        import cv2

        cv2.remap(image, self._map, None, cv2.INTER_LINEAR, dst=out)  # type: ignore[call-overload]
        if seed is not None:
            count = out.shape[0] * out.shape[1]
            bits = np.random.SFC64(seed).random_raw(count // 4 + 1).view(np.uint16)[:count]
            noise = self._levels[bits].reshape(out.shape[:2])
            grey = cv2.merge([noise, noise, noise, np.full_like(noise, _ZERO)])
            cv2.addWeighted(out, 1.0, grey, 1.0, -_ZERO, dst=out)


@functools.lru_cache(maxsize=4)  # cameras are often alike
def _rays(intrinsics: Intrinsics) -> Array | None:
    """Return (height, width, 2): where each pixel's ray meets the plane z = 1.

    None where there is no such ray: the distortion takes no direction there.
    """
    import cv2

    u, v = np.meshgrid(np.arange(float(intrinsics.width)), np.arange(float(intrinsics.height)))
    criteria = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 50, 1e-9)
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    matrix, distortion = intrinsics.camera_matrix, intrinsics.distortion
    rays: Any = cv2.undistortPoints(pixels[:, None], matrix, distortion, criteria=criteria)
    zero = np.zeros(3)
    back, _ = cv2.projectPoints(
        cv2.convertPointsToHomogeneous(rays), zero, zero, matrix, distortion
    )
    if not np.abs(back[:, 0] - pixels).max() < 1e-3:
        return None
    return rays.reshape(intrinsics.height, intrinsics.width, 2)
