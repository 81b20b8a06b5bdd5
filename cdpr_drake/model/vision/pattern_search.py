"""Patterns among spots: which spot is which point, and the pose that follows, with no guess."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.vision.discs import DiscImages
from cdpr_drake.model.vision.pose import FEWEST_POINTS, plane_poses

MOST_TURNED = np.radians(45.0)
"""Patterns that look the same from four sides leave the platform's turn open by right angles. On
its cables it cannot be turned farther than this from upright, or from where it was last seen."""

OFF_AFFINE = 0.2
"""How far perspective moves a point of a pattern from where an affine map of three others puts it,
in sides of those three's triangle."""

NEAR = 10.0
"""Spots this near to where a point should be speak for a pose [px]."""

MOST_SPOTS = 30
"""No more spots of an image than this are combined: the largest."""


class PatternSearch:
    """Finds the platform from spots in the images of all cameras, without knowing where it was.

    Five spots are a pattern if an affine map that takes three of its points to three spots takes
    the others near spots too. Each such labelling gives, by the pattern's plane, one or two poses.
    Of all these the best is the one for which most points are seen where they should be, in all
    images; a platform turned by more than `MOST_TURNED` is believed only if there is no other.

    Args:
        robot: the robot as the controller believes it.

    Raises:
        RobotFileError: it has no pose cameras, or no patterns.
    """

    def __init__(self, robot: CableRobot) -> None:
        setup = robot.cameras
        self._discs = DiscImages(robot)
        self._intrinsics = [c.intrinsics for c in setup.pose_cameras]
        self._X_WC = [setup.X_WF @ c.X_FC for c in setup.pose_cameras]
        self._patterns = [p.points for p in setup.patterns]
        self._X_TP = [(setup.X_PM @ p.X_MT).inverse() for p in setup.patterns]

    def __call__(
        self, spots: Sequence[Array], prior: RigidTransform | None = None
    ) -> RigidTransform | None:
        """Return a pose X_WP, good to some pixels, or None.

        Args:
            spots: (m, 2) [px] for each camera, the largest first.
            prior: a pose it had; upright if None.
        """
        upright = RotationMatrix() if prior is None else prior.rotation()
        poses = [X for c, pixels in enumerate(spots) for X in self._poses(c, pixels[:MOST_SPOTS])]
        likely = [X for X in poses if _angle(upright, X.rotation()) <= MOST_TURNED]
        ranked = [(self._support(X, spots), X) for X in likely or poses]
        support, best = max(ranked, key=lambda pair: pair[0], default=(0.0, None))
        return best if support >= 0.5 * FEWEST_POINTS else None

    def _poses(self, camera: int, pixels: Array) -> Iterator[RigidTransform]:
        """Yield the poses that patterns among the spots of one image have."""
        for points, X_TP in zip(self._patterns, self._X_TP, strict=True):
            flat = np.pad(points, ((0, 0), (0, 1)))
            for labels in labellings(points, pixels):
                for X_CT in plane_poses(flat, pixels[labels], self._intrinsics[camera]):
                    yield self._X_WC[camera] @ X_CT @ X_TP

    def _support(self, X_WP: RigidTransform, spots: Sequence[Array]) -> float:
        """Return how many points are seen where they should be; those a little off count less."""
        views = self._discs(X_WP)
        support = 0.0
        for camera, pixels in enumerate(spots):
            expected = views.centroid[views.camera == camera]
            if len(pixels) and len(expected):
                distance = np.linalg.norm(expected[:, None] - pixels, axis=2).min(axis=1)
                support += float(np.sum(np.maximum(1.0 - (distance / NEAR) ** 2, 0.0)))
        return support


def labellings(points: Array, pixels: Array) -> list[NDArray[np.intp]]:
    """Return every way (n,) in which spots may be the points of a pattern, seen from its front.

    Args:
        points: (n, 2) [m], of the pattern: x to the right, y up.
        pixels: (m, 2) [px], of the spots.
    """
    if len(pixels) < len(points):
        return []
    base = max(itertools.permutations(range(len(points)), 3), key=lambda i: _area(points, i))
    rest = [i for i in range(len(points)) if i not in base]
    expected = (points[rest] - points[base[0]]) @ np.linalg.inv(
        points[list(base[1:])] - points[base[0]]
    )
    found = []
    first, second = (index.ravel() for index in np.indices(2 * (len(pixels),)))
    for origin, pixel in enumerate(pixels):
        offset = pixels - pixel
        a, b = offset[first], offset[second]
        area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        seen = area < -1.0  # a front turns the other way round where y points down
        a, b, area = a[seen], b[seen], area[seen]
        # Every spot in terms of the two sides a, b of the triangle.
        s = (offset[:, 0] * b[:, 1:] - offset[:, 1] * b[:, :1]) / area[:, None]
        t = (offset[:, 1] * a[:, :1] - offset[:, 0] * a[:, 1:]) / area[:, None]
        gaps = np.stack([np.hypot(s - x, t - y) for x, y in expected], axis=1)
        match = gaps.argmin(axis=2)
        good = np.all(gaps.min(axis=2) < OFF_AFFINE, axis=1)
        for i in np.flatnonzero(good):
            labels = np.empty(len(points), dtype=np.intp)
            labels[list(base)] = origin, first[seen][i], second[seen][i]
            labels[rest] = match[i]
            if len(set(labels.tolist())) == len(labels):
                found.append(labels)
    return found


def _area(points: Array, corners: tuple[int, ...]) -> float:
    """Return twice the area of a triangle of points, above 0 if they go round anticlockwise."""
    (a, b), (c, d) = points[list(corners[1:])] - points[corners[0]]
    return float(a * d - b * c)


def _angle(A: RotationMatrix, B: RotationMatrix) -> float:
    """Return the angle between two rotations [rad]."""
    return float(np.arccos(np.clip(0.5 * (np.trace((A.inverse() @ B).matrix()) - 1.0), -1.0, 1.0)))
