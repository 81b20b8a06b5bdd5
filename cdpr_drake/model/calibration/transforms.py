"""^fT_b and ^mT_e from poses of the platform that tracker and cameras see (section 4.3, last step).

For each pose, X_SP X_PM = X_SC X_CM: the tracker gives X_SP, a camera X_CM, and X_PM and X_SC are
wanted, the robot-world and hand-eye problem A X = Z B. A closed form gives a start; what counts is
found by least squares of all pixels and all reflectors of all poses together, in which the
intrinsics stay as uncertain as the checkerboard left them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from cdpr_drake.errors import CalibrationError
from cdpr_drake.model.calibration.cameras import MOTION, turned_by
from cdpr_drake.model.calibration.hand_eye import robot_world_hand_eye
from cdpr_drake.model.calibration.least_squares import Block, minimise, normal_equations
from cdpr_drake.model.calibration.motions import (
    UncertainPose,
    between,
    difference,
    moved,
    product_jacobians,
)
from cdpr_drake.model.calibration.projection import PARAMETERS, as_intrinsics, as_vector, project
from cdpr_drake.model.calibration.tracker import at, register
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, skew
from cdpr_drake.model.vision.cameras import Intrinsics, PoseCamera
from cdpr_drake.model.vision.pose import PoseEstimator
from cdpr_drake.model.vision.rotation_means import mean_pose
from cdpr_drake.model.vision.targets import Sightings

FEWEST_POSES = 3

LEAST_TURN = np.radians(0.05)
"""Turns of the platform about two axes by less, root mean square, do not tell where M is [rad]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlatformViews:
    """What tracker and pose cameras see of the platform in n poses.

    Args:
        sightings: of the patterns, of each pose.
        known: (m, 3) [m], reflectors on the platform, in P.
        measured: (n, m, 3) [m], in the tracker's frame S.
        sigma: standard deviation of each measured coordinate of a reflector [m].
        pixel_noise: standard deviation of a pixel's coordinate, new in each pose [px].
        pixel_bias: the same, but fixed for each point in each camera [px].
    """

    sightings: Sequence[Sightings]
    known: Array
    measured: Array
    sigma: float
    pixel_noise: float
    pixel_bias: float


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibratedTransforms:
    """Cameras and target frame as the poses of the platform show them.

    The covariances of poses have a fixed part too, as those of the intrinsics have.

    Attributes:
        X_SF: pose of the fixed camera frame F in the tracker's frame S.
        X_PM: pose of the target frame.
        X_FC: pose of each pose camera in F; that of the first defines F, and is exact.
        intrinsics: of each pose camera.
        covariances: (9, 9) of each of them.
        fixed_covariances: (9, 9) of each, the part that the fixed bias of the patterns' points
            causes: it stays when the same platform is measured again.
        cost: sum of squares of the errors, in standard deviations.
        freedom: what the cost should be, on average.
    """

    X_SF: UncertainPose
    X_PM: UncertainPose
    X_FC: list[UncertainPose]
    intrinsics: list[Intrinsics]
    covariances: list[Array]
    fixed_covariances: list[Array]
    cost: float
    freedom: int


def calibrate_transforms(
    robot: CableRobot, views: PlatformViews, priors: Sequence[Array]
) -> CalibratedTransforms:
    """Return the transforms, and the intrinsics improved.

    Args:
        robot: with patterns, and with pose cameras as the checkerboard shows them. Of their poses
            only the first's in F is used; X_WF and X_PM are not.
        views: of the platform.
        priors: (9, 9) each, covariances of the intrinsics.

    Raises:
        CalibrationError: too few poses, poses that turn too little or about one axis, or a camera
            that never sees a pattern.
    """
    n = len(views.sightings)
    if n != len(views.measured):
        raise CalibrationError(
            f"{n} poses seen by cameras, but {len(views.measured)} by the tracker"
        )
    if n < FEWEST_POSES:
        raise CalibrationError(f"at least {FEWEST_POSES} poses of the platform are needed, got {n}")
    X_SP = [register(views.known, q, views.sigma).X for q in views.measured]
    _check_turns(X_SP)
    bundle = _Bundle(robot, views, priors)
    fit = minimise(bundle.start(X_SP), bundle.blocks, bundle.move, bundle.names, bundle.shared)
    fixed = bundle.fixed_covariance(fit.state)
    return bundle.result(fit.state, fit.covariance, fixed, fit.cost, fit.freedom)


def _check_turns(X_SP: Sequence[RigidTransform]) -> None:
    mean = mean_pose(list(X_SP))
    turns = np.array([difference(X, mean)[:3] for X in X_SP])
    sizes = np.linalg.svd(turns, compute_uv=False) / np.sqrt(len(turns))
    if sizes[1] < LEAST_TURN:
        how = "do not turn" if sizes[0] < LEAST_TURN else "all turn about one axis"
        raise CalibrationError(
            f"the poses of the platform {how}: where the target frame is on it cannot be told from "
            "where the camera is; turn it about two axes at least"
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class _State:
    """In the parameters' order."""

    X_PM: RigidTransform
    X_SC: list[RigidTransform]
    cameras: list[Array]
    X_SP: list[RigidTransform]


class _Bundle:
    """The least squares of all poses: 6 (M) + 6 c (cameras) + 9 c (intrinsics) + 6 n (poses)."""

    def __init__(self, robot: CableRobot, views: PlatformViews, priors: Sequence[Array]) -> None:
        setup = robot.cameras
        self._robot, self._views = robot, views
        self._known = [as_vector(c.intrinsics) for c in setup.pose_cameras]
        self._roots = [np.linalg.cholesky(np.linalg.inv(C)).T for C in priors]
        flat = [np.pad(p.points, ((0, 0), (0, 1))) for p in setup.patterns]
        self._points = np.vstack([at(p.X_MT, f) for p, f in zip(setup.patterns, flat, strict=True)])
        c, n = len(self._known), len(views.sightings)
        self._c, self.shared = c, 6 + 15 * c
        of_cameras = [f"of pose camera {i + 1}" for i in range(c)]
        self.names = [
            *(f"{name} of the target frame" for name in MOTION),
            *(f"{name} {camera}" for camera in of_cameras for name in MOTION),
            *(f"{name} {camera}" for camera in of_cameras for name in PARAMETERS),
            *(f"{name} of pose {k + 1}" for k in range(n) for name in MOTION),
        ]

    def start(self, X_SP: list[RigidTransform]) -> _State:
        """Return the closed form of the camera that sees most, and the others to suit."""
        seen = [self._poses_of_target(c) for c in range(self._c)]
        for c, poses in enumerate(seen):
            if not poses:
                raise CalibrationError(
                    f"pose camera {c + 1} sees no pattern in any of the {len(X_SP)} poses"
                )
        most = max(seen, key=len)
        _check_turns([X_SP[k] for k in most])
        X_PM = robot_world_hand_eye([X_SP[k] for k in most], list(most.values()))
        X_SC = [
            mean_pose([X_SP[k] @ X_PM @ X_CM.inverse() for k, X_CM in poses.items()])
            for poses in seen
        ]
        return _State(X_PM=X_PM, X_SC=X_SC, cameras=self._known, X_SP=X_SP)

    def _poses_of_target(self, camera: int) -> dict[int, RigidTransform]:
        """Return X_CM, as one camera sees it, by the index of the pose."""
        setup, nowhere = self._robot.cameras, RigidTransform()
        alone = PoseCamera(X_FC=nowhere, intrinsics=setup.pose_cameras[camera].intrinsics)
        estimate = PoseEstimator(
            self._robot.replace(
                cameras=setup.replace(X_WF=nowhere, X_PM=nowhere, pose_cameras=(alone,))
            )
        )
        found = {}
        for k, sightings in enumerate(self._views.sightings):
            one = Sightings(pixels=sightings.pixels[[camera]], visible=sightings.visible[[camera]])
            pose = estimate(one)
            if pose is not None:
                found[k] = pose.X_WP
        return found

    def move(self, state: _State, step: Array) -> _State:
        """Return a state after a step of the parameters."""
        c, first = self._c, self.shared
        camera_steps = step[6 : 6 + 6 * c].reshape(-1, 6)
        changes = step[6 + 6 * c : first].reshape(-1, 9)
        pose_steps = step[first:].reshape(-1, 6)
        return _State(
            X_PM=moved(state.X_PM, step[:6]),
            X_SC=[moved(X, d) for X, d in zip(state.X_SC, camera_steps, strict=True)],
            cameras=[k + d for k, d in zip(state.cameras, changes, strict=True)],
            X_SP=[moved(X, d) for X, d in zip(state.X_SP, pose_steps, strict=True)],
        )

    def blocks(self, state: _State) -> Iterator[Block]:
        """Yield what reflectors, checkerboard and images have against a state."""
        views = self._views
        for k, X in enumerate(state.X_SP):
            own = np.arange(self.shared + 6 * k, self.shared + 6 * k + 6)
            r = (at(X, views.known) - views.measured[k]).ravel() / views.sigma
            yield r, turned_by(X, views.known).reshape(-1, 6) / views.sigma, own
        for c in range(self._c):
            columns = np.arange(6 + 6 * self._c + 9 * c, 15 + 6 * self._c + 9 * c)
            root = self._roots[c]
            yield root @ (state.cameras[c] - self._known[c]), root, columns
            yield self._images(state, c)

    def fixed_covariance(self, state: _State) -> Array:
        """Return the part (s, s) of the shared parameters' covariance that biases cause.

        Estimates move by N^-1 J^T (S^-1/2 b) with biases b of the points, N the normal matrix and J
        = S^-1/2 times the pixels' derivatives, S their covariance; b is the same in all rows of a
        point.
        """
        noise, bias = self._views.pixel_noise, self._views.pixel_bias
        N = normal_equations(self.blocks(state), len(self.names))[0]
        pushed = np.zeros_like(N)
        for c in range(self._c):
            white, which = self._white(state, c)
            for point in np.unique(which):
                own = which == point
                pull = white[own, :, 1:].sum(axis=0)
                pushed += bias**2 / (noise**2 + np.count_nonzero(own) * bias**2) * pull.T @ pull
        scale = np.sqrt(np.diag(N))
        moved_by = np.linalg.inv(N / np.outer(scale, scale)) / np.outer(scale, scale)
        return np.asarray((moved_by @ pushed @ moved_by)[: self.shared, : self.shared])

    def _images(self, state: _State, c: int) -> Block:
        """Return all that one camera sees in all poses."""
        white, _ = self._white(state, c)
        white = white.reshape(-1, white.shape[2])
        used = np.flatnonzero(np.any(white[:, 1:] != 0.0, axis=0))
        return white[:, 0], white[:, 1 + used], used

    def _white(self, state: _State, c: int) -> tuple[Array, NDArray[np.intp]]:
        """Return errors and derivatives (n, 2, 1 + p) of what a camera sees, and whose they are.

        A bias ties one point's pixels together: they are freed of that, see `_whitened`.
        """
        views, first = self._views, self.shared
        rows, derivatives, which = [], [], []
        X_SC = state.X_SC[c]
        R_CS = X_SC.rotation().matrix().T
        for k, X_SP in enumerate(state.X_SP):
            visible = np.flatnonzero(views.sightings[k].visible[c])
            if visible.size == 0:
                continue
            p_M = self._points[visible]
            p_P = at(state.X_PM, p_M)
            p_S = at(X_SP, p_P)
            seen = views.sightings[k].pixels[c, visible]
            pixels, by_point, by_camera = project(state.cameras[c], at(X_SC.inverse(), p_S))
            J = np.zeros((visible.size, 2, first + 6 * len(state.X_SP)))
            by_S = by_point @ R_CS
            J[:, :, :6] = by_S @ X_SP.rotation().matrix() @ turned_by(state.X_PM, p_M)
            J[:, :, 6 + 6 * c : 9 + 6 * c] = by_S @ skew(p_S - X_SC.translation())
            J[:, :, 9 + 6 * c : 12 + 6 * c] = -by_S
            J[:, :, 6 + 6 * self._c + 9 * c : 15 + 6 * self._c + 9 * c] = by_camera
            J[:, :, first + 6 * k : first + 6 * k + 6] = by_S @ turned_by(X_SP, p_P)
            rows.append(pixels - seen)
            derivatives.append(J)
            which.append(visible)
        errors = np.concatenate(rows)[:, :, None]
        both = np.concatenate([errors, np.concatenate(derivatives)], axis=2)
        points = np.concatenate(which)
        return _whitened(both, points, views.pixel_noise, views.pixel_bias), points

    def result(
        self, state: _State, covariance: Array, fixed: Array, cost: float, freedom: int
    ) -> CalibratedTransforms:
        """Return what the parameters say of the robot."""
        c = self._c
        cameras = self._robot.cameras.pose_cameras
        X_CF = cameras[0].X_FC.inverse()
        X_SF = state.X_SC[0] @ X_CF
        J, _ = product_jacobians(state.X_SC[0], X_CF)
        X_FC = [UncertainPose(X=cameras[0].X_FC, covariance=np.zeros((6, 6)))]
        for i in range(1, c):
            both = np.r_[6:12, 6 + 6 * i : 12 + 6 * i]
            tied = np.eye(12)
            tied[:6, :6] = J
            C, D = (tied @ all_[np.ix_(both, both)] @ tied.T for all_ in (covariance, fixed))
            X_FC.append(between(X_SF, state.X_SC[i], C, D))
        slices = [slice(6 + 6 * c + 9 * i, 15 + 6 * c + 9 * i) for i in range(c)]
        return CalibratedTransforms(
            X_SF=UncertainPose(
                X=X_SF,
                covariance=J @ covariance[6:12, 6:12] @ J.T,
                fixed_covariance=J @ fixed[6:12, 6:12] @ J.T,
            ),
            X_PM=UncertainPose(
                X=state.X_PM, covariance=covariance[:6, :6], fixed_covariance=fixed[:6, :6]
            ),
            X_FC=X_FC,
            intrinsics=[
                as_intrinsics(k, camera.intrinsics.width, camera.intrinsics.height)
                for k, camera in zip(state.cameras, cameras, strict=True)
            ],
            covariances=[covariance[s, s] for s in slices],
            fixed_covariances=[fixed[s, s] for s in slices],
            cost=cost,
            freedom=freedom,
        )


def _whitened(rows: Array, which: NDArray[np.intp], noise: float, bias: float) -> Array:
    """Return rows (n, 2, q) for which the covariance noise^2 + bias^2 within a point is unity.

    For m rows of one point its inverse root is (1 - (1 - g) mean) / noise, where `mean` takes the
    mean of the rows and g = noise / sqrt(noise^2 + m bias^2).
    """
    white = rows / noise
    for point in np.unique(which):
        own = which == point
        g = noise / np.sqrt(noise**2 + np.count_nonzero(own) * bias**2)
        white[own] -= (1.0 - g) * white[own].mean(axis=0)
    return white
