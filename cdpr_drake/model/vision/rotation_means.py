"""Means of rotations and of poses (Gramkow 2001, Moakher 2002: the paper's [61, 62])."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.model.rotations import Array, exp_rotation, log_rotation


def chordal_mean(rotations: ArrayLike, weights: ArrayLike | None = None) -> Array:
    """Return the rotation matrix (3, 3) that minimises sum w |R - R_i|^2, by quaternions.

    It is the dominant eigenvector of sum w q q^T; q and -q count alike, so no signs are aligned.

    Args:
        rotations: (n, 3, 3).
        weights: (n,), all 1 if None.

    Raises:
        ValueError: no rotations, or weights that do not fit them.
    """
    R, w = _checked(rotations, weights)
    q = np.array([RotationMatrix(r).ToQuaternion().wxyz() for r in R])
    _, vectors = np.linalg.eigh((w[:, None] * q).T @ q)
    s, x, y, z = vectors[:, -1]
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - s * z), 2.0 * (x * z + s * y)],
            [2.0 * (x * y + s * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - s * x)],
            [2.0 * (x * z - s * y), 2.0 * (y * z + s * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def chordal_mean_svd(rotations: ArrayLike, weights: ArrayLike | None = None) -> Array:
    """Return the mean of `chordal_mean` as the rotation nearest to sum w R: U diag(1, 1, d) V^T.

    Args:
        rotations: (n, 3, 3).
        weights: (n,), all 1 if None.

    Raises:
        ValueError: no rotations, or weights that do not fit them.
    """
    R, w = _checked(rotations, weights)
    U, _, Vt = np.linalg.svd(np.einsum("i,ijk->jk", w, R))
    return (U * [1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt


def karcher_mean(rotations: ArrayLike, weights: ArrayLike | None = None) -> Array:
    """Return the rotation matrix (3, 3) that minimises sum w angle(R^T R_i)^2, the geodesic mean.

    Args:
        rotations: (n, 3, 3), all within a right angle of each other.
        weights: (n,), all 1 if None.

    Raises:
        ValueError: no rotations, weights that do not fit them, or no convergence.
    """
    R, w = _checked(rotations, weights)
    mean = chordal_mean(R, w)
    for _ in range(100):
        step = w @ [log_rotation(mean.T @ r) for r in R] / w.sum()
        mean = mean @ exp_rotation(step)
        if np.linalg.norm(step) < 1e-14:
            return mean
    raise ValueError("the rotations are too far apart to have a mean")


def mean_pose(poses: list[RigidTransform], weights: ArrayLike | None = None) -> RigidTransform:
    """Return the mean translation with the chordal mean rotation (section 4.2).

    Args:
        poses: of one frame in another.
        weights: (n,), all 1 if None.

    Raises:
        ValueError: no poses, or weights that do not fit them.
    """
    rotation = chordal_mean([X.rotation().matrix() for X in poses], weights)
    w = np.ones(len(poses)) if weights is None else np.asarray(weights, float)
    translation = w @ [X.translation() for X in poses] / w.sum()
    return RigidTransform(RotationMatrix(rotation), translation)


def _checked(rotations: ArrayLike, weights: ArrayLike | None) -> tuple[Array, Array]:
    R = np.asarray(rotations, float)
    if R.ndim != 3 or R.shape[1:] != (3, 3) or len(R) < 1:
        raise ValueError(f"rotations must have shape (n, 3, 3) with n >= 1, got {R.shape}")
    w = np.ones(len(R)) if weights is None else np.asarray(weights, float)
    if w.shape != (len(R),) or not np.all(w >= 0.0) or not w.sum() > 0.0:
        raise ValueError(f"weights must be {len(R)} numbers >= 0, not all 0, got {w.tolist()}")
    return R, w
