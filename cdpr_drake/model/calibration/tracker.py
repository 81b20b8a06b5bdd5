"""A laser tracker: points in its frame S, frames by the reflectors fixed to them (section 4.3)."""

from __future__ import annotations

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


def locate(frame: UncertainPose, points: Array, variance: float) -> tuple[Array, Array]:
    """Return points (n, 3) [m] in a frame, and their standard deviations (n, 3).

    Args:
        frame: pose of the frame in S, as registered.
        points: (n, 3) [m], measured in S.
        variance: of each coordinate of them [m2].
    """
    X = frame.inverse()
    R = X.X.rotation().matrix()
    sigmas = []
    for p in points:
        J = np.hstack([-skew(R @ p), np.eye(3)])
        sigmas.append(np.sqrt(np.diag(J @ X.covariance @ J.T) + variance))
    return at(X.X, points), np.array(sigmas)
