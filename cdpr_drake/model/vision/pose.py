"""The platform's pose from the points of its patterns: the paper's mean, and a joint estimate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, skew
from cdpr_drake.model.vision.cameras import Intrinsics
from cdpr_drake.model.vision.rotation_means import mean_pose
from cdpr_drake.model.vision.targets import Sightings, TargetGeometry

ESTIMATORS = ("joint", "mean")
"""Ways to a pose: "joint", least squares over all images; "mean", of one pose per image."""

FEWEST_POINTS = 4
"""Points of a pattern that must be seen to use it (appendix B)."""

SUSPECT_ERROR = 5.0
"""Pixels' errors this many times what is expected make the joint estimate start afresh."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PoseEstimate:
    """A measured pose.

    Covariances are of a small motion [rotation vector; translation] of P in W [rad, m]. Neither
    knows of a wrong calibration of cameras, lenses or patterns, which adds an error of its own.

    Attributes:
        X_WP: the pose.
        noise_covariance: (6, 6), of the white noise of the pixels: new in each frame, so that the
            mean of n frames has an n-th of it.
        fixed_covariance: (6, 6), of the fixed bias of each point in each camera, over all biases
            there could be: for one robot it is one and the same error, as long as the platform
            stays where it is, and no averaging takes any of it away.
        num_targets: how many different points took part.
        num_cameras: how many cameras took part.
        pixel_error: root mean square of what is left of the pixels' errors [px].
    """

    X_WP: RigidTransform
    noise_covariance: Array
    fixed_covariance: Array
    num_targets: int
    num_cameras: int
    pixel_error: float

    @property
    def covariance(self) -> Array:
        """The sum of both (6, 6): of a single frame of a robot whose biases are not known."""
        return self.noise_covariance + self.fixed_covariance


@dataclass(frozen=True, kw_only=True, eq=False)
class _View:
    """One pattern in one camera: indices of its points, and their pixels."""

    camera: int
    pattern: int
    points: NDArray[np.intp]
    seen: Array


class PoseEstimator:
    """Estimates the platform's pose from what the pose cameras see.

    "mean" is the paper's (section 4.2): OpenCV gives a pose for each pattern in each image (IPPE;
    of the two answers of a plane pattern the one that suits the other images), refined by least
    squares; then the mean translation and the chordal mean rotation of F_m. "joint" minimises the
    squared errors of all pixels of all images over the one pose they share.

    Args:
        robot: the robot as the controller believes it.
        estimator: "joint" or "mean".

    Raises:
        RobotFileError: the robot has no pose cameras, or no patterns.
        ValueError: an unknown estimator.
    """

    def __init__(self, robot: CableRobot, estimator: str = "joint") -> None:
        from cdpr_drake.model.kernels import vision as kernel

        if estimator not in ESTIMATORS:
            known = ", ".join(ESTIMATORS)
            raise ValueError(f'unknown estimator "{estimator}"; known are {known}')
        self.estimator = estimator
        self._kernel = kernel
        setup = robot.cameras
        self._geometry = TargetGeometry(robot)
        self._intrinsics = [c.intrinsics for c in setup.pose_cameras]
        self._X_WC = [setup.X_WF @ c.X_FC for c in setup.pose_cameras]
        self._X_TP = [X.inverse() for X in self._geometry.X_PT]
        self._flat = np.vstack([np.pad(p.points, ((0, 0), (0, 1))) for p in setup.patterns])
        self._X_PM = setup.X_PM
        self._variances = setup.pixel_noise**2, setup.pixel_bias**2
        self.pixel_sigma = float(np.hypot(setup.pixel_noise, setup.pixel_bias))

    def __call__(
        self, sightings: Sightings, prior: RigidTransform | None = None
    ) -> PoseEstimate | None:
        """Return the pose, or None where too little is seen.

        Args:
            sightings: of all cameras.
            prior: the pose a frame ago. "joint" starts from it; it also decides between the two
                poses of a single plane pattern.
        """
        views = self._views(sightings)
        if not views:
            return None
        if self.estimator == "mean":
            return self._mean(views, prior)
        estimate = self._joint(views, prior) if prior is not None and len(views) > 1 else None
        if estimate is None or estimate.pixel_error > SUSPECT_ERROR * max(self.pixel_sigma, 0.2):
            start = self._mean(views, prior)
            afresh = None if start is None else self._joint(views, start.X_WP)
            if afresh and (not estimate or afresh.pixel_error < estimate.pixel_error):
                estimate = afresh
        return estimate

    def view_poses(
        self, sightings: Sightings, prior: RigidTransform | None = None
    ) -> list[PoseEstimate]:
        """Return the pose from each pattern in each image, refined, ambiguity resolved.

        Args:
            sightings: of all cameras.
            prior: the pose a frame ago; used only where there is a single view.
        """
        return self._view_poses(self._views(sightings), prior)

    def _views(self, sightings: Sightings) -> list[_View]:
        views = []
        pattern = self._geometry.pattern
        for c, t in np.ndindex(len(self._X_WC), len(self._X_TP)):
            points = np.flatnonzero(sightings.visible[c] & (pattern == t))
            if points.size >= FEWEST_POINTS:
                seen = sightings.pixels[c, points]
                views.append(_View(camera=c, pattern=t, points=points, seen=seen))
        return views

    def _joint(self, views: list[_View], start: RigidTransform) -> PoseEstimate | None:
        which, points, seen = self._stacked(views)
        X, information = _rows(start), np.empty((6, 6))
        steps, cost = self._kernel.minimise(
            points, which, seen, self._geometry.cameras, X, information
        )
        if steps < 0:
            return None
        # Both are independent from pixel to pixel, and all pixels weigh the same.
        per_pixel: Any = np.linalg.inv(information)
        noise, bias = self._variances
        return PoseEstimate(
            X_WP=_transform(X),
            noise_covariance=noise * per_pixel,
            fixed_covariance=bias * per_pixel,
            num_targets=len(set(np.concatenate([v.points for v in views]).tolist())),
            num_cameras=len({v.camera for v in views}),
            pixel_error=float(np.sqrt(cost / seen.size)),
        )

    def _mean(self, views: list[_View], prior: RigidTransform | None) -> PoseEstimate | None:
        poses = self._view_poses(views, prior)
        if not poses:
            return None
        X_WM = mean_pose([e.X_WP @ self._X_PM for e in poses])
        X_WP = X_WM @ self._X_PM.inverse()
        # The mean is of motions of M: v_M = v_P + omega x p_PM.
        to_M, to_P = np.eye(6), np.eye(6)
        to_P[3:, :3] = skew(X_WP.rotation() @ self._X_PM.translation())
        to_M[3:, :3] = -to_P[3:, :3]

        def of_mean(covariances: list[Array]) -> Array:
            total = sum((to_M @ C @ to_M.T for C in covariances), np.zeros((6, 6)))
            return np.asarray(to_P @ total @ to_P.T / len(poses) ** 2)

        return PoseEstimate(
            X_WP=X_WP,
            noise_covariance=of_mean([e.noise_covariance for e in poses]),
            fixed_covariance=of_mean([e.fixed_covariance for e in poses]),
            num_targets=len(set(np.concatenate([v.points for v in views]).tolist())),
            num_cameras=len({v.camera for v in views}),
            pixel_error=self._pixel_error(self._stacked(views), X_WP),
        )

    def _view_poses(self, views: list[_View], prior: RigidTransform | None) -> list[PoseEstimate]:
        answers = [self._candidates(view) for view in views]
        flat = [X for answer in answers for X in answer]
        if not flat:
            return []
        if len(views) > 1 or prior is None:
            everything = self._stacked(views)
            reference = min(flat, key=lambda X: self._pixel_error(everything, X))
        else:
            reference = prior
        nearest = [min(a, key=lambda X: _angle(reference, X)) for a in answers if a]
        kept = [view for view, answer in zip(views, answers, strict=True) if answer]
        refined = [self._joint([v], X) for v, X in zip(kept, nearest, strict=True)]
        return [e for e in refined if e is not None]

    def _candidates(self, view: _View) -> list[RigidTransform]:
        """Return the one or two poses X_WP that explain a plane pattern in an image."""
        camera = view.camera
        poses = plane_poses(self._flat[view.points], view.seen, self._intrinsics[camera])
        return [self._X_WC[camera] @ X_CT @ self._X_TP[view.pattern] for X_CT in poses]

    def _pixel_error(self, stacked: tuple[Any, Array, Array], X_WP: RigidTransform) -> float:
        which, points, seen = stacked
        G, g = np.empty((6, 6)), np.empty(6)
        cost = self._kernel.normal_equations(
            points, which, seen, self._geometry.cameras, _rows(X_WP), G, g
        )
        return float(np.sqrt(cost / seen.size))

    def _stacked(self, views: list[_View]) -> tuple[Any, Array, Array]:
        which = np.repeat([v.camera for v in views], [v.points.size for v in views])
        points = self._geometry.points[np.concatenate([v.points for v in views])]
        return which, points, np.concatenate([v.seen for v in views])


def plane_poses(points: Array, seen: Array, camera: Intrinsics) -> list[RigidTransform]:
    """Return the one or two poses X_CT that explain points of a plane in an image; none if bad.

    Args:
        points: (n, 3) [m], at least four, in T, their z coordinates 0.
        seen: (n, 2) [px], where they are seen.
        camera: how the camera projects.
    """
    import cv2

    matrix, distortion = camera.camera_matrix, camera.distortion
    try:
        _, turns, shifts, _ = cv2.solvePnPGeneric(
            points, seen, matrix, distortion, flags=cv2.SOLVEPNP_IPPE
        )
    except cv2.error:  # three points on a line with one beside it
        return []
    poses = []
    for turn, shift in zip(turns, shifts, strict=True):
        if np.all(np.isfinite(turn)) and np.all(np.isfinite(shift)):
            R_CT: Any = cv2.Rodrigues(turn)[0]
            rotation = RotationMatrix.ProjectToRotationMatrix(R_CT)
            poses.append(RigidTransform(rotation, shift.ravel()))
    return poses


def _rows(X: RigidTransform) -> Array:
    return np.vstack([X.rotation().matrix(), X.translation()])


def _transform(X: Array) -> RigidTransform:
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(X[:3]), X[3])


def _angle(X: RigidTransform, Y: RigidTransform) -> float:
    """Return minus the trace of the turn between two poses: it grows with the angle."""
    return -float(np.sum(X.rotation().matrix() * Y.rotation().matrix()))
