"""A laser tracker: points in its frame S, frames by the reflectors fixed to them (section 4.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.errors import CalibrationError
from cdpr_drake.model.calibration.motions import UncertainPose
from cdpr_drake.model.rotations import Array, skew

FEWEST_REFLECTORS = 3


class LaserTracker:
    """A simulated tracker, which sees all points.

    Args:
        X_WS: its pose.
        noise: standard deviation of each coordinate of a point [m].
        generator: of the noise.
    """

    def __init__(self, X_WS: RigidTransform, noise: float, generator: np.random.Generator) -> None:
        self.X_WS = X_WS
        self._noise, self._generator = noise, generator

    def __call__(self, points: Array) -> Array:
        """Return measured points (..., 3) in S of `points` (..., 3) in W [m]."""
        X_SW = self.X_WS.inverse()
        exact = points @ X_SW.rotation().matrix().T + X_SW.translation()
        return exact + self._noise * self._generator.standard_normal(points.shape)


def at(X: RigidTransform, points: Array) -> Array:
    """Return `points` (..., 3) given in the inner frame of a pose `X`, in the outer one."""
    return points @ X.rotation().matrix().T + X.translation()


def register(known: Array, measured: Array, sigma: float) -> UncertainPose:
    """Return the pose, in the tracker's frame S, of a frame in which points are known.

    The closed form of Kabsch and Umeyama, which is least squares for noise alike in all directions.

    Args:
        known: (n, 3) [m], in that frame.
        measured: (n, 3) [m], in S.
        sigma: standard deviation of each measured coordinate [m].

    Raises:
        CalibrationError: fewer than three points, or all on one line.
    """
    known, measured = np.asarray(known, float), np.asarray(measured, float)
    if known.ndim != 2 or known.shape[1] != 3 or measured.shape != known.shape:
        raise CalibrationError(
            f"reference points must be (n, 3) twice, got {known.shape} and {measured.shape}"
        )
    if len(known) < FEWEST_REFLECTORS:
        raise CalibrationError(
            f"a frame needs at least {FEWEST_REFLECTORS} reference points, got {len(known)}"
        )
    middle, centre = known.mean(axis=0), measured.mean(axis=0)
    spread = np.linalg.svd(known - middle, compute_uv=False)
    if spread[1] < 1e-6 * max(spread[0], 1e-300):
        raise CalibrationError("the reference points lie on one line: no frame follows from them")
    U, _, Vt = np.linalg.svd((measured - centre).T @ (known - middle))
    U[:, 2] *= np.sign(np.linalg.det(U @ Vt))
    R = U @ Vt
    rows = np.zeros((len(known), 3, 6))
    rows[:, :, :3], rows[:, :, 3:] = -skew(known @ R.T), np.eye(3)
    J = rows.reshape(-1, 6)
    rotation = RotationMatrix.ProjectToRotationMatrix(R)
    X = RigidTransform(rotation, centre - rotation @ middle)
    covariance = np.asarray(sigma**2 * np.linalg.inv(J.T @ J), float)
    return UncertainPose(X=X, covariance=covariance)


@dataclass(frozen=True, kw_only=True, eq=False)
class LocatedPoints:
    """Points in a frame, and how well they are known.

    Attributes:
        points: (n, 3) [m].
        noise_sigmas: (n, 3) [m], standard deviations of what measuring again averages out: of the
            frame, which is common to all points, and of touching them.
        fixed_sigmas: (n, 3) [m], of what no measuring again would take away.
    """

    points: Array
    noise_sigmas: Array
    fixed_sigmas: Array

    @property
    def sigmas(self) -> Array:
        """Standard deviations of both together (n, 3) [m]."""
        return np.hypot(self.noise_sigmas, self.fixed_sigmas)


def locate(frame: UncertainPose, points: Array, noise: float, fixed: float) -> LocatedPoints:
    """Return points in a frame.

    Args:
        frame: pose of the frame in S, as registered.
        points: (n, 3) [m], measured in S.
        noise: variance of each coordinate of them that measuring again averages out [m2].
        fixed: variance of each coordinate that it does not [m2].
    """
    X = frame.inverse()
    R = X.X.rotation().matrix()
    sigmas = []
    for p in points:
        J = np.hstack([-skew(R @ p), np.eye(3)])
        sigmas.append(np.sqrt(np.diag(J @ X.covariance @ J.T) + noise))
    shape = (len(points), 3)
    return LocatedPoints(
        points=at(X.X, points),
        noise_sigmas=np.reshape(sigmas, shape),
        fixed_sigmas=np.full(shape, np.sqrt(fixed)),
    )
