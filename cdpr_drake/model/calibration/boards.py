"""A checkerboard held in front of cameras: its corners, where it is held, how it is seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.errors import CalibrationError
from cdpr_drake.model.calibration.projection import as_vector, project
from cdpr_drake.model.calibration.tracker import at
from cdpr_drake.model.rotations import Array, exp_rotation
from cdpr_drake.model.vision.cameras import Intrinsics

TRIES_PER_VIEW = 40
MARGIN = 8.0  # of the image's edge, where no corner is looked for [px]
TILT = np.radians(35.0)  # of the board about each axis of its plane, at most
ROLL = np.radians(45.0)  # in its plane
DEPTH = (0.8, 1.5)  # times the distance asked for


@dataclass(frozen=True, kw_only=True)
class Board:
    """A checkerboard, flat and exact, with four reflectors of the laser tracker at its corners.

    Args:
        columns: of inner corners.
        rows: of inner corners.
        square: side of a square [m].
    """

    columns: int = 9
    rows: int = 7
    square: float = 0.08

    @property
    def points(self) -> Array:
        """Return the inner corners (n, 3) [m], in the board's frame D, its origin in the middle."""
        x, y = np.meshgrid(
            np.arange(self.columns) - 0.5 * (self.columns - 1),
            np.arange(self.rows) - 0.5 * (self.rows - 1),
        )
        flat = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
        return np.asarray(self.square * flat, float)

    @property
    def reflectors(self) -> Array:
        """Return the reflectors (4, 3) [m], in D."""
        x, y = 0.5 * (self.columns + 1) * self.square, 0.5 * (self.rows + 1) * self.square
        return np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])


Camera = tuple[RigidTransform, Intrinsics]
"""A camera: its pose in the frame of the first one, and how it projects."""


def see(camera: Camera, points: Array) -> Array:
    """Return the pixels (n, 2) of `points` (n, 3) given in the frame of the first camera.

    Args:
        camera: which sees them.
        points: [m].
    """
    X, intrinsics = camera
    return project(as_vector(intrinsics), at(X.inverse(), points))[0]


def hold(
    board: Board,
    cameras: Sequence[Camera],
    distance: float,
    count: int,
    generator: np.random.Generator,
) -> list[RigidTransform]:
    """Return poses of a board, in the first camera's frame, in which all cameras see all of it.

    Args:
        board: the board.
        cameras: which shall see it; the first at the identity.
        distance: typical, from the first camera [m].
        count: how many poses.
        generator: of the poses.

    Raises:
        CalibrationError: the cameras have too little of their view in common.
    """
    found: list[RigidTransform] = []
    first = cameras[0][1]
    K = first.camera_matrix
    tries = TRIES_PER_VIEW * count
    for _ in range(tries):
        if len(found) == count:
            break
        tilt_x, tilt_y = generator.uniform(-TILT, TILT, 2)
        roll, depth = generator.uniform(-ROLL, ROLL), distance * generator.uniform(*DEPTH)
        u, v = generator.uniform(0.1, 0.9, 2) * (first.width, first.height)
        ray = np.array([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], 1.0])
        R = exp_rotation([tilt_x, 0.0, 0.0]) @ exp_rotation([0.0, tilt_y, 0.0])
        R = R @ exp_rotation([0.0, 0.0, roll])
        X = RigidTransform(RotationMatrix.ProjectToRotationMatrix(R), depth * ray)
        if all(_inside(camera, at(X, board.points)) for camera in cameras):
            found.append(X)
    if len(found) < count:
        raise CalibrationError(
            f"a board is wholly in view in only {len(found)} of {tries} places tried; "
            f"{count} are needed"
        )
    return found


def crossing(X_LR: RigidTransform) -> float:
    """Return how far from the left camera of a pair the axes come nearest to each other [m].

    Args:
        X_LR: pose of the right camera in the left one. Where the axes do not meet in front of the
            cameras, three times the base line is returned.
    """
    t, axis = X_LR.translation(), X_LR.rotation().matrix()[:, 2]
    # The point of z = s nearest to the line t + r axis: s - r c = t_z, s c - r = axis . t.
    c, base = float(axis[2]), float(np.linalg.norm(t))
    if 1.0 - c * c > 1e-6:
        s = (t[2] - c * (axis @ t)) / (1.0 - c * c)
        if s > 0.5 * base:
            return float(s)
    return 3.0 * base


def _inside(camera: Camera, points: Array) -> bool:
    intrinsics = camera[1]
    pixels = see(camera, points)
    high = np.array([intrinsics.width, intrinsics.height]) - 1.0 - MARGIN
    return bool(np.all((pixels >= MARGIN) & (pixels <= high)))
