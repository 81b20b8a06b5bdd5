"""One camera, or a stereo pair, from views of a checkerboard (section 4.3, first step).

OpenCV gives a start: it takes corners in single precision. What counts is found by least squares
of all corners in double precision, over intrinsics, distortion, the pose of the board in each view
and, of a pair, the pose of the right camera in the left.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.errors import CalibrationError
from cdpr_drake.model.calibration.boards import Board
from cdpr_drake.model.calibration.least_squares import Block, Fit, minimise
from cdpr_drake.model.calibration.motions import UncertainPose, moved
from cdpr_drake.model.calibration.projection import PARAMETERS, as_intrinsics, project
from cdpr_drake.model.calibration.tracker import at, register
from cdpr_drake.model.calibration.views import checked, first_guess
from cdpr_drake.model.rotations import Array, skew
from cdpr_drake.model.vision.cameras import Intrinsics

MOTION = ("turn x", "turn y", "turn z", "x", "y", "z")


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibratedCamera:
    """A camera as its views show it.

    Attributes:
        intrinsics: how it projects.
        covariance: (9, 9), of [fx, fy, cx, cy, k1, k2, p1, p2, k3]; all of it is the white noise of
            the corners, nothing fixed.
        X_CD: pose of the board in each view.
        cost: sum of squares of the corners' errors, in standard deviations.
        freedom: what the cost should be, on average.
    """

    intrinsics: Intrinsics
    covariance: Array
    X_CD: list[RigidTransform]
    cost: float
    freedom: int


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibratedPair:
    """A stereo pair as its views show it.

    Attributes:
        left: how the left camera projects.
        right: how the right one does.
        covariances: (9, 9) of each of the two; all of it is white noise, as that of the poses is.
        X_LR: pose of the right camera in the left one.
        X_SL: pose of the left camera in the tracker's frame, if the tracker saw the board.
        cost: sum of squares of the errors, in standard deviations.
        freedom: what the cost should be, on average.
    """

    left: Intrinsics
    right: Intrinsics
    covariances: tuple[Array, Array]
    X_LR: UncertainPose
    X_SL: UncertainPose | None
    cost: float
    freedom: int


@dataclass(frozen=True, kw_only=True, eq=False)
class TrackedBoard:
    """What the laser tracker measures of a board, in the first views of a pair.

    Args:
        known: (n, 3) [m], the reflectors in the board's frame D.
        measured: (views, n, 3) [m], in the tracker's frame S.
        sigma: standard deviation of each measured coordinate [m].
    """

    known: Array
    measured: Array
    sigma: float


def calibrate_camera(
    board: Board, images: Array, width: int, height: int, sigma: float
) -> CalibratedCamera:
    """Return a camera from views of a board.

    Args:
        board: the board.
        images: (views, n, 2) [px], the corners.
        width: of the image [px].
        height: of the image [px].
        sigma: standard deviation of each coordinate of a corner [px].

    Raises:
        CalibrationError: too few views, all of them parallel, or a parameter that they do not
            determine.
    """
    images = checked(board, images, width, height)
    camera, poses = first_guess(board, images, width, height)
    points = board.points

    def blocks(state: _State) -> Iterator[Block]:
        for v, (X, seen) in enumerate(zip(state.poses, images, strict=True)):
            r, by_camera, by_pose = _view(state.cameras[0], X, points, seen, sigma)
            yield r, np.hstack([by_camera, by_pose]), np.r_[0:9, 9 + 6 * v : 15 + 6 * v]

    start = _State(cameras=[camera], frames=[], poses=poses)
    names = [*PARAMETERS, *_pose_names(len(images))]
    fit = minimise(start, blocks, _move, names, shared=9)
    return CalibratedCamera(
        intrinsics=as_intrinsics(fit.state.cameras[0], width, height),
        covariance=fit.covariance,
        X_CD=fit.state.poses,
        cost=fit.cost,
        freedom=fit.freedom,
    )


def calibrate_pair(
    board: Board,
    left: Array,
    right: Array,
    sizes: Sequence[tuple[int, int]],
    sigma: float,
    tracked: TrackedBoard | None = None,
) -> CalibratedPair:
    """Return a stereo pair from views of a board that both cameras see.

    Args:
        board: the board.
        left: (views, n, 2) [px], the corners in the left images.
        right: (views, n, 2) [px], in the right ones.
        sizes: width and height of the left and of the right images [px].
        sigma: standard deviation of each coordinate of a corner [px].
        tracked: what the laser tracker saw of the board; without it X_SL is None.

    Raises:
        CalibrationError: too few views, all of them parallel, or a parameter that they do not
            determine.
    """
    images = [checked(board, i, *size) for i, size in zip((left, right), sizes, strict=True)]
    if len(images[0]) != len(images[1]):
        raise CalibrationError(f"{len(images[0])} left views, but {len(images[1])} right ones")
    starts = [first_guess(board, i, *size) for i, size in zip(images, sizes, strict=True)]
    X_LD, X_RD = starts[0][1], starts[1][1]
    frames = [X_RD[0] @ X_LD[0].inverse()]  # X_RL
    if tracked is not None:
        X_SD = register(tracked.known, tracked.measured[0], tracked.sigma).X
        frames.append(X_SD @ X_LD[0].inverse())  # X_SL
    first = 18 + 6 * len(frames)  # column of the first view's pose
    points = board.points

    def blocks(state: _State) -> Iterator[Block]:
        X_RL = state.frames[0]
        for v, X in enumerate(state.poses):
            own = np.arange(first + 6 * v, first + 6 * v + 6)
            r, by_camera, by_pose = _view(state.cameras[0], X, points, images[0][v], sigma)
            yield r, np.hstack([by_camera, by_pose]), np.r_[0:9, own]
            r, by_camera, by_RL, by_pose = _through(
                state.cameras[1], X_RL, X, points, images[1][v], sigma
            )
            yield r, np.hstack([by_camera, by_RL, by_pose]), np.r_[9:24, own]
            if tracked is not None and v < len(tracked.measured):
                yield _tracked_view(state.frames[1], X, tracked, v, np.r_[24:30, own])

    start = _State(cameras=[s[0] for s in starts], frames=frames, poses=X_LD)
    names = [f"{name} of the {side} camera" for side in ("left", "right") for name in PARAMETERS]
    for frame in ("the right camera", "the pair in the tracker's frame")[: len(frames)]:
        names += [f"{name} of {frame}" for name in MOTION]
    fit = minimise(start, blocks, _move, [*names, *_pose_names(len(X_LD))], shared=first)
    return _pair(fit, sizes)


@dataclass(frozen=True, kw_only=True, eq=False)
class _State:
    """Cameras (9,), poses of frames, and the board's pose in each view, as the parameters go."""

    cameras: list[Array]
    frames: list[RigidTransform]
    poses: list[RigidTransform]


def _move(state: _State, step: Array) -> _State:
    n, m = len(state.cameras), len(state.frames)
    steps = step[9 * n :].reshape(-1, 6)
    return _State(
        cameras=[c + step[9 * i : 9 * i + 9] for i, c in enumerate(state.cameras)],
        frames=[moved(X, d) for X, d in zip(state.frames, steps[:m], strict=True)],
        poses=[moved(X, d) for X, d in zip(state.poses, steps[m:], strict=True)],
    )


def _pair(fit: Fit[_State], sizes: Sequence[tuple[int, int]]) -> CalibratedPair:
    state, C = fit.state, fit.covariance
    X_RL = UncertainPose(X=state.frames[0], covariance=C[18:24, 18:24])
    X_SL = None
    if len(state.frames) > 1:
        X_SL = UncertainPose(X=state.frames[1], covariance=C[24:30, 24:30])
    return CalibratedPair(
        left=as_intrinsics(state.cameras[0], *sizes[0]),
        right=as_intrinsics(state.cameras[1], *sizes[1]),
        covariances=(C[:9, :9], C[9:18, 9:18]),
        X_LR=X_RL.inverse(),
        X_SL=X_SL,
        cost=fit.cost,
        freedom=fit.freedom,
    )


def turned_by(X: RigidTransform, points: Array) -> Array:
    """Return how `points` (n, 3) in the inner frame of a pose `X` move with it (n, 3, 6)."""
    J = np.zeros((len(points), 3, 6))
    J[:, :, :3], J[:, :, 3:] = -skew(points @ X.rotation().matrix().T), np.eye(3)
    return J


def _view(
    camera: Array, X: RigidTransform, points: Array, seen: Array, sigma: float
) -> tuple[Array, Array, Array]:
    """Return residuals (2n,) of a view and their derivatives by camera and by the board's pose."""
    pixels, by_point, by_camera = project(camera, at(X, points))
    r = (pixels - seen).ravel() / sigma
    by_pose = (by_point @ turned_by(X, points)).reshape(-1, 6) / sigma
    return r, by_camera.reshape(-1, 9) / sigma, by_pose


def _through(
    camera: Array, Y: RigidTransform, X: RigidTransform, points: Array, seen: Array, sigma: float
) -> tuple[Array, Array, Array, Array]:
    """Return the same for a camera at the inverse of Y, and the derivatives by Y as the third."""
    in_left = at(X, points)
    pixels, by_point, by_camera = project(camera, at(Y, in_left))
    r = (pixels - seen).ravel() / sigma
    by_Y = (by_point @ turned_by(Y, in_left)).reshape(-1, 6) / sigma
    by_pose = by_point @ Y.rotation().matrix() @ turned_by(X, points) / sigma
    return r, by_camera.reshape(-1, 9) / sigma, by_Y, by_pose.reshape(-1, 6)


def _tracked_view(
    X_SL: RigidTransform, X_LD: RigidTransform, tracked: TrackedBoard, view: int, columns: Any
) -> Block:
    in_left = at(X_LD, tracked.known)
    r = (at(X_SL, in_left) - tracked.measured[view]).ravel() / tracked.sigma
    by_SL = turned_by(X_SL, in_left)
    by_LD = X_SL.rotation().matrix() @ turned_by(X_LD, tracked.known)
    return r, np.dstack([by_SL, by_LD]).reshape(-1, 12) / tracked.sigma, columns


def _pose_names(views: int) -> list[str]:
    return [f"{name} of the board in view {v + 1}" for v in range(views) for name in MOTION]
