"""Views of a checkerboard: whether they can tell a camera, and OpenCV's first guess of it."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.errors import CalibrationError
from cdpr_drake.model.calibration.boards import Board
from cdpr_drake.model.calibration.projection import as_vector
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.vision.cameras import Intrinsics

FEWEST_VIEWS = 3
"""Zhang's method needs three views of a plane for four intrinsics with some to spare."""

LEAST_TILT = np.radians(4.0)
"""Views of the board whose planes differ by less do not tell the focal length [rad]; distortion
makes parallel ones seem to differ by 2 degrees."""


def checked(board: Board, images: Array, width: int, height: int) -> Array:
    """Return the images as an array, if they can be used.

    Args:
        board: the board.
        images: (views, n, 2) [px], the corners.
        width: of the image [px].
        height: of the image [px].

    Raises:
        CalibrationError: they have a wrong shape, are too few, or are all parallel.
    """
    images = np.asarray(images, float)
    n = board.columns * board.rows
    if images.ndim != 3 or images.shape[1:] != (n, 2) or not np.all(np.isfinite(images)):
        raise CalibrationError(
            f"views must be finite, of shape (views, {n}, 2), got shape {images.shape}"
        )
    if len(images) < FEWEST_VIEWS:
        raise CalibrationError(
            f"a camera needs at least {FEWEST_VIEWS} views of the board, got {len(images)}"
        )
    if _largest_tilt(board, images, width, height) < LEAST_TILT:
        raise CalibrationError(
            "all views of the board are parallel to each other: they do not tell the focal length; "
            "tilt the board"
        )
    return images


def _largest_tilt(board: Board, images: Array, width: int, height: int) -> float:
    """Return the angle between the most different planes of the board [rad], roughly.

    A plane's line at infinity is seen where its normal says. Taking the image's width for the focal
    length, its middle for the principal point and no distortion is good enough to tell parallel
    planes.
    """
    import cv2

    normals = []
    for image in images:
        centred = (image - [0.5 * width, 0.5 * height]) / width
        H: Any = cv2.findHomography(board.points[:, :2], centred)[0]
        if H is None:
            raise CalibrationError("the corners of a view lie on one line")
        line = np.linalg.solve(H.T, np.array([0.0, 0.0, 1.0]))
        normals.append(line / np.linalg.norm(line))
    cosines = np.abs(np.array(normals) @ np.array(normals).T)
    return float(np.arccos(np.clip(cosines.min(), 0.0, 1.0)))


def first_guess(
    board: Board, images: Array, width: int, height: int
) -> tuple[Array, list[RigidTransform]]:
    """Return OpenCV's camera (9,) and poses of the board.

    Args:
        board: the board.
        images: (views, n, 2) [px], checked.
        width: of the image [px].
        height: of the image [px].

    Raises:
        CalibrationError: OpenCV finds none.
    """
    import cv2

    points = [board.points.astype(np.float32)] * len(images)
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)  # several add up in any order, and no two answers are the same
    try:
        found: Any = cv2.calibrateCamera(
            points,
            list(images.astype(np.float32)),
            (width, height),
            None,
            None,
        )
    except cv2.error as error:
        raise CalibrationError(f"OpenCV finds no camera that has these views: {error}") from None
    finally:
        cv2.setNumThreads(threads)
    _, K, distortion, turns, shifts = found
    poses = []
    for turn, shift in zip(turns, shifts, strict=True):
        R: Any = cv2.Rodrigues(turn)[0]
        poses.append(RigidTransform(RotationMatrix.ProjectToRotationMatrix(R), shift.ravel()))
    camera = Intrinsics(camera_matrix=K, distortion=distortion.ravel()[:5], width=1, height=1)
    return as_vector(camera), poses
