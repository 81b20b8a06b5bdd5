"""The cameras and patterns of a robot, as records: what `robot.Cameras` is made of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.errors import RobotFileError
from cdpr_drake.model.records import Record

if TYPE_CHECKING:
    from cdpr_drake.model.robot import CableRobot, Cameras

Problems = Iterator[tuple[str, str]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Intrinsics(Record):
    """How a camera projects, in OpenCV's model: x right, y down, z along the optical axis.

    With x' = x / z, y' = y / z and r2 = x'^2 + y'^2, the pixel is camera_matrix [x'', y'', 1] with
    x'' = x' (1 + k1 r2 + k2 r2^2 + k3 r2^3) + 2 p1 x' y' + p2 (r2 + 2 x'^2), y'' alike.

    Args:
        camera_matrix: (3, 3) [px], [[fx, 0, cx], [0, fy, cy], [0, 0, 1]].
        distortion: (5,) [-], k1, k2, p1, p2, k3.
        width: [px], of the image.
        height: [px], of the image.
    """

    camera_matrix: np.ndarray
    distortion: np.ndarray = field(default_factory=lambda: np.zeros(5))
    width: int
    height: int


@dataclass(frozen=True, kw_only=True, eq=False)
class PoseCamera(Record):
    """A fixed camera that sees the platform.

    Args:
        X_FC: pose of the camera in the fixed camera frame F.
        intrinsics: how it projects.
    """

    X_FC: RigidTransform
    intrinsics: Intrinsics


@dataclass(frozen=True, kw_only=True, eq=False)
class Pattern(Record):
    """A plane pattern of points on the platform.

    Args:
        X_MT: pose of the pattern's frame T in the target frame M; its z axis points away from the
            platform, which is convex: what hides a pattern is the face it is on.
        points: (n, 2) [m], at least four, x and y in T.
        point_diameter: [m], of a point: a white disc on the dark face.
    """

    X_MT: RigidTransform
    points: np.ndarray
    point_diameter: float = 0.1


@dataclass(frozen=True, kw_only=True, eq=False)
class StereoPair(Record):
    """Two fixed cameras that see some cables near their drawing points.

    Args:
        X_FL: pose of the left camera in the fixed camera frame F.
        X_LR: pose of the right camera in the left one.
        left: how the left camera projects.
        right: how the right camera projects.
        cables: the cables it sees, counting from 1 as in the paper.
    """

    X_FL: RigidTransform
    X_LR: RigidTransform
    left: Intrinsics
    right: Intrinsics
    cables: tuple[int, ...]


def camera_problems(cameras: Cameras) -> Problems:
    """Yields (field, what is wrong) for the cameras of a robot, their patterns and noise.

    Args:
        cameras: of the robot.
    """
    for index, camera in enumerate(cameras.pose_cameras):
        where = f"cameras.pose_cameras[{index}]"
        yield from _transform(f"{where}.X_FC", camera.X_FC)
        yield from _intrinsics(f"{where}.intrinsics", camera.intrinsics)
    for index, pattern in enumerate(cameras.patterns):
        where = f"cameras.patterns[{index}]"
        yield from _transform(f"{where}.X_MT", pattern.X_MT)
        yield from _points(f"{where}.points", pattern.points)
        if not 0.0 < pattern.point_diameter < np.inf:
            yield f"{where}.point_diameter", f"must be positive, got {pattern.point_diameter}"
    for index, pair in enumerate(cameras.stereo_pairs):
        where = f"cameras.stereo_pairs[{index}]"
        yield from _transform(f"{where}.X_FL", pair.X_FL)
        yield from _transform(f"{where}.X_LR", pair.X_LR)
        yield from _intrinsics(f"{where}.left", pair.left)
        yield from _intrinsics(f"{where}.right", pair.right)
        if not np.linalg.norm(pair.X_LR.translation()) > 1e-6:
            yield f"{where}.X_LR", "the two cameras are at one place, and see no depth"
        if len(set(pair.cables)) != len(pair.cables) or min(pair.cables, default=0) < 1:
            yield f"{where}.cables", f"must be different numbers from 1 on, got {pair.cables}"
    segment = cameras.cable_segment
    if segment.shape != (2,) or not 0.0 <= segment[0] < segment[1] < np.inf:
        got = segment.tolist()
        yield "cameras.cable_segment", f"must be two lengths, the second larger, got {got}"
    if cameras.edge_points < 2:
        yield "cameras.edge_points", f"must be at least 2, got {cameras.edge_points}"
    if cameras.pixel_bias_seed < 0:
        yield "cameras.pixel_bias_seed", f"must be >= 0, got {cameras.pixel_bias_seed}"


def observers(robot: CableRobot) -> np.ndarray:
    """The index (k,) of the stereo pair that sees each cable.

    Args:
        robot: the robot.

    Raises:
        RobotFileError: a cable is seen by none or by two, or is not there.
    """
    k = robot.num_cables
    pairs = np.full(k, -1)
    file = f"robot {robot.name!r}"
    for index, pair in enumerate(robot.cameras.stereo_pairs):
        for cable in pair.cables:
            where = f"cameras.stereo_pairs[{index}].cables"
            if cable > k:
                raise RobotFileError(file, where, f"there is no cable {cable} among {k}")
            if pairs[cable - 1] >= 0:
                raise RobotFileError(file, where, f"another pair sees cable {cable} too")
            pairs[cable - 1] = index
    if np.any(pairs < 0):
        missing = int(np.argmin(pairs)) + 1
        raise RobotFileError(file, "cameras.stereo_pairs", f"no pair sees cable {missing}")
    return pairs


def _transform(where: str, X: Any) -> Problems:
    if not (np.all(np.isfinite(X.GetAsMatrix34())) and X.rotation().IsValid()):
        yield where, "must be a finite translation and a rotation"


def _intrinsics(where: str, camera: Intrinsics) -> Problems:
    matrix = camera.camera_matrix
    if matrix.shape != (3, 3) or not np.all(np.isfinite(matrix)):
        yield f"{where}.camera_matrix", f"must be finite, of shape (3, 3), got {matrix.tolist()}"
        return
    if np.linalg.matrix_rank(matrix) != 3:
        yield f"{where}.camera_matrix", f"is singular: {matrix.tolist()}"
    plain = matrix.copy()
    plain[[0, 0, 1, 1], [0, 2, 1, 2]] = 0.0
    if not np.array_equal(plain, np.diag([0.0, 0.0, 1.0])):
        form = "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]"
        yield f"{where}.camera_matrix", f"must be {form}, got {matrix.tolist()}"
    if not (matrix[0, 0] > 0.0 and matrix[1, 1] > 0.0):
        yield f"{where}.camera_matrix", "must have positive focal lengths"
    coefficients = camera.distortion
    if coefficients.shape != (5,) or not np.all(np.isfinite(coefficients)):
        got = coefficients.tolist()
        yield f"{where}.distortion", f"must be five numbers k1, k2, p1, p2, k3, got {got}"
    for name in ("width", "height"):
        if getattr(camera, name) < 1:
            yield f"{where}.{name}", f"must be at least 1 px, got {getattr(camera, name)}"


def _points(where: str, points: np.ndarray) -> Problems:
    if points.ndim != 2 or points.shape[1] != 2 or not np.all(np.isfinite(points)):
        yield where, f"must be finite, of shape (n, 2), got shape {points.shape}"
    elif len(points) < 4:
        yield where, f"must be at least four points to give a pose, got {len(points)}"
    else:
        spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if spread[1] < 1e-6 * max(spread[0], 1e-300):
            yield where, "all lie on one line"
