"""Where a robot is calibrated: it stands there, boards are held, and a laser tracker looks on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.model.calibration.boards import Board, Camera, crossing, hold, see
from cdpr_drake.model.calibration.cameras import (
    CalibratedCamera,
    CalibratedPair,
    TrackedBoard,
    calibrate_camera,
    calibrate_pair,
)
from cdpr_drake.model.calibration.motions import UncertainPose
from cdpr_drake.model.calibration.setup import CalibrationSetup
from cdpr_drake.model.calibration.tracker import LaserTracker, LocatedPoints, at, locate, register
from cdpr_drake.model.calibration.transforms import (
    CalibratedTransforms,
    PlatformViews,
    calibrate_transforms,
)
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, exp_rotation
from cdpr_drake.model.vision.cameras import PoseCamera, StereoPair
from cdpr_drake.model.vision.targets import TargetImages

LAYOUT_SEED = 43
"""Of where boards are held and the platform is moved: planned, and alike for all seeds of noise."""

BOARD_DISTANCE = 1.5
"""Of the checkerboard from a pose camera [m]."""

SQUARE_PER_DISTANCE, LARGEST_SQUARE = 1.0 / 15.0, 0.15
"""Side of a square over the board's distance [-], so that it fills half of the image; and the side
of the largest that can be handled [m]."""

LEAST_PIXEL_NOISE = 0.01
"""Images are not trusted to better [px], whatever the robot says."""


def platform_poses(robot: CableRobot, count: int, turn: float) -> list[RigidTransform]:
    """Return poses X_WP of the platform amid the robot, that turn a little about all axes.

    Args:
        robot: the robot.
        count: how many.
        turn: root mean square about each axis [rad].
    """
    generator = np.random.default_rng(LAYOUT_SEED)
    A = robot.drawing_points
    middle, size = A.mean(axis=0), np.ptp(A, axis=0)
    low = [*(middle[:2] - 0.15 * size[:2]), 0.15 * middle[2]]
    high = [*(middle[:2] + 0.15 * size[:2]), 0.45 * middle[2]]
    places = generator.uniform(low, high, (count, 3))
    turns = generator.standard_normal((count, 3))
    turns -= turns.mean(axis=0)
    turns *= turn / np.maximum(np.sqrt(np.mean(turns**2, axis=0)), 1e-300)
    return [
        RigidTransform(RotationMatrix(exp_rotation(phi)), p)
        for phi, p in zip(turns, places, strict=True)
    ]


def corners(points: Array, floor: float | None = None) -> Array:
    """Return the corners (8, 3) of the box around points.

    Args:
        points: (n, 3) [m].
        floor: height of the lower four; that of the lowest point if None.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    if floor is not None:
        low = np.array([low[0], low[1], floor])
    grid = np.array(np.meshgrid(*zip(low, high, strict=True), indexing="ij"))
    return grid.reshape(3, -1).T.copy()


@dataclass(frozen=True, kw_only=True, eq=False)
class _Held:
    """Poses in which a board is held in front of cameras."""

    board: Board
    X_LD: list[RigidTransform]


class Site:
    """The true robot, the instruments, and their noise.

    Attributes:
        tracker: the laser tracker.

    Args:
        robot: the true robot.
        setup: how it is calibrated.
        images: what its pose cameras see, with the setup's share of noise.
        generator: of all noise.
    """

    def __init__(
        self,
        robot: CableRobot,
        setup: CalibrationSetup,
        images: TargetImages,
        generator: np.random.Generator,
    ) -> None:
        self._robot, self._setup, self._images = robot, setup, images
        self._generator = generator
        size = np.ptp(robot.drawing_points, axis=0)
        X_WS = RigidTransform(
            RotationMatrix(exp_rotation([0.02, -0.03, 0.7])),
            robot.drawing_points.mean(axis=0) * [1.0, 1.0, 0.0]
            + [0.1 * size[0], -0.4 * size[1], 1.5],
        )
        self.tracker = LaserTracker(X_WS, setup.scale * setup.tracker_noise, generator)

    def see(self, eyes: PoseCamera | StereoPair) -> CalibratedCamera | CalibratedPair:
        """Return a pose camera or a stereo pair, `eyes`, from views of a board."""
        return self.see_camera(eyes) if isinstance(eyes, PoseCamera) else self.see_pair(eyes)

    def see_camera(self, camera: PoseCamera) -> CalibratedCamera:
        """Return a pose camera from its views of a board."""
        cameras = [(RigidTransform(), camera.intrinsics)]
        held = self._hold(cameras, BOARD_DISTANCE)
        size = camera.intrinsics.width, camera.intrinsics.height
        views = self._views(cameras[0], held)
        return calibrate_camera(held.board, views, *size, self._setup.corner_noise)

    def see_pair(self, pair: StereoPair) -> CalibratedPair:
        """Return a stereo pair from views of a board, some of them tracked."""
        cameras = [(RigidTransform(), pair.left), (pair.X_LR, pair.right)]
        held = self._hold(cameras, crossing(pair.X_LR))
        setup, reflectors = self._setup, held.board.reflectors
        X_WL = self._robot.cameras.X_WF @ pair.X_FL
        tracked = TrackedBoard(
            known=reflectors,
            measured=self.tracker(
                np.array([at(X_WL @ X, reflectors) for X in held.X_LD[: setup.tracked_views]])
            ),
            sigma=setup.tracker_noise,
        )
        left, right = (self._views(camera, held) for camera in cameras)
        sizes = [(c.width, c.height) for c in (pair.left, pair.right)]
        return calibrate_pair(held.board, left, right, sizes, setup.corner_noise, tracked)

    def measure_points(self) -> tuple[UncertainPose, LocatedPoints, LocatedPoints]:
        """Return X_WS, the A_i (with pulleys where the cables enter them), and the B_i."""
        robot, setup = self._robot, self._setup
        references = corners(robot.drawing_points, floor=0.0)
        X_SW = register(references, self.tracker(references), setup.tracker_noise)
        A = self._locate(X_SW, RigidTransform(), robot.drawing_points, setup.drawing_point)
        X_WP = platform_poses(robot, 1, 0.0)[0]  # where the platform stands to be measured
        nests = corners(robot.attachment_points)
        X_SP = register(nests, self.tracker(at(X_WP, nests)), setup.tracker_noise)
        B = self._locate(X_SP, X_WP, robot.attachment_points, setup.attachment_point)
        return X_SW.inverse(), A, B

    def see_platform(
        self, cameras: Sequence[CalibratedCamera], poses: Sequence[RigidTransform]
    ) -> CalibratedTransforms:
        """Return X_SF, X_PM and the pose cameras from poses that tracker and cameras see."""
        robot, setup = self._robot, self._setup
        nests = corners(robot.attachment_points)
        draw = self._generator.standard_normal
        views = PlatformViews(
            sightings=[self._images(X, draw(self._images.noise_size)) for X in poses],
            known=nests,
            measured=self.tracker(np.array([at(X, nests) for X in poses])),
            sigma=setup.tracker_noise,
            pixel_noise=max(robot.cameras.pixel_noise, LEAST_PIXEL_NOISE),
            pixel_bias=robot.cameras.pixel_bias,
        )
        known = tuple(
            camera.replace(intrinsics=seen.intrinsics)
            for camera, seen in zip(robot.cameras.pose_cameras, cameras, strict=True)
        )
        start = robot.replace(cameras=robot.cameras.replace(pose_cameras=known))
        return calibrate_transforms(start, views, [c.covariance for c in cameras])

    def _hold(self, cameras: Sequence[Camera], distance: float) -> _Held:
        square = min(SQUARE_PER_DISTANCE * distance, LARGEST_SQUARE)
        board, layout = Board(square=square), np.random.default_rng(LAYOUT_SEED)
        return _Held(board=board, X_LD=hold(board, cameras, distance, self._setup.views, layout))

    def _views(self, camera: Camera, held: _Held) -> Array:
        views = np.array([see(camera, at(X, held.board.points)) for X in held.X_LD])
        sigma = self._setup.scale * self._setup.corner_noise
        return views + sigma * self._generator.standard_normal(views.shape)

    def _locate(
        self, frame: UncertainPose, X: RigidTransform, points: Array, bend: float
    ) -> LocatedPoints:
        """Return points in a frame from clouds around them.

        Args:
            frame: as registered, in S.
            X: where it is, in W.
            points: (n, 3) [m], in it.
            bend: standard deviation of where the cable bends in the middle of the cloud [m].
        """
        setup, draw = self._setup, self._generator.standard_normal
        middles = points + setup.scale * bend * draw(points.shape)
        around = setup.scale * setup.cloud_noise * draw((setup.cloud, *points.shape))
        measured = self.tracker(at(X, middles + around)).mean(axis=0)
        touch = (setup.cloud_noise**2 + setup.tracker_noise**2) / setup.cloud
        return locate(frame, measured, touch, bend**2)
