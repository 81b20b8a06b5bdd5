"""Rotations as the control law needs them: rotation vectors, pose vectors, their derivatives.

A pose vector is [roll, pitch, yaw, x, y, z] (rad, m) of X_WP, Drake's extrinsic x-y-z angles; a
rotation vector is the axis times the angle, the paper's u theta.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.autodiffutils import AutoDiffXd
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import (
    RigidTransform,
    RigidTransform_,
    RollPitchYaw,
    RollPitchYaw_,
    RotationMatrix,
)

Array = NDArray[np.float64]

_POSES = (RigidTransform, RigidTransform_[AutoDiffXd])


def numbers(a: ArrayLike) -> Array:
    """Return `a` as an array of float, or of AutoDiffXd if these are in it."""
    array = np.asarray(a)
    return array if array.dtype == object else np.asarray(array, float)


def skew(a: ArrayLike) -> Array:
    """Return the cross-product matrix [a]x of a 3-vector `a`, or of each row of an (n, 3) array."""
    a = numbers(a)
    S = np.full((*a.shape, 3), 0.0, a.dtype)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        S[..., j, i], S[..., i, j] = a[..., k], -a[..., k]
    return S


def exp_rotation(rotation_vector: ArrayLike) -> Array:
    """Return the (3, 3) rotation matrix of a `rotation_vector` (3,) [rad]."""
    phi = np.asarray(rotation_vector, float)
    half = 0.5 * math.sqrt(phi @ phi)
    xyz = (0.5 * math.sin(half) / half if half > 1e-8 else 0.5) * phi
    wxyz = np.array([math.cos(half), *xyz])
    # The quaternion is of unit norm up to round-off, which matters to Drake's check only.
    matrix: Array = RotationMatrix(Quaternion(wxyz=wxyz / math.sqrt(wxyz @ wxyz))).matrix()
    return matrix


def log_rotation(R: ArrayLike) -> Array:
    """Return the rotation vector (3,) [rad], angle in [0, pi], of a rotation matrix `R` (3, 3).

    Taken by way of the quaternion, which keeps full precision near 0 and near pi.
    """
    q = RotationMatrix(np.asarray(R, float)).ToQuaternion()
    w, v = q.w(), q.xyz()
    if w < 0.0:
        w, v = -w, -v
    n = float(np.linalg.norm(v))
    if n < 1e-8:
        return 2.0 * v / w
    return 2.0 * np.arctan2(n, w) / n * v


def rotation_interaction_matrix(rotation_vector: ArrayLike) -> Array:
    """Return L_w (3, 3) with d(s_w)/dt = -L_w omega for s_w = log(R_MM*), omega of M in M.

    The matrix L_w of section 5 (Malis, Chaumette, Boudet 1999) for the error taken from the
    current to the desired frame: its theta/2 term is negative.

    Args:
        rotation_vector: s_w (3,) [rad].
    """
    phi = np.asarray(rotation_vector, float)
    theta = float(np.linalg.norm(phi))
    K = skew(phi)
    if theta < 1e-2:
        square = 1.0 / 12.0 + theta**2 / 720.0 + theta**4 / 30240.0
    else:
        square = (1.0 - 0.5 * theta / np.tan(0.5 * theta)) / theta**2
    return np.eye(3) - 0.5 * K + square * (K @ K)


def pose_to_vector(X_WP: RigidTransform) -> Array:
    """Return [roll, pitch, yaw, x, y, z] (rad, m) of the pose `X_WP`."""
    return np.concatenate([RollPitchYaw(X_WP.rotation()).vector(), X_WP.translation()])


def vector_to_pose(pose: ArrayLike) -> RigidTransform:
    """Return the RigidTransform X_WP of a `pose` vector [roll, pitch, yaw, x, y, z] (rad, m)."""
    pose = numbers(pose)
    if pose.dtype == object:
        return RigidTransform_[AutoDiffXd](RollPitchYaw_[AutoDiffXd](pose[:3]), pose[3:])
    if pose.shape != (6,) or not np.all(np.isfinite(pose)):
        raise ValueError(f"a pose is six finite numbers [roll, pitch, yaw, x, y, z], got {pose}")
    return RigidTransform(RollPitchYaw(pose[:3]), pose[3:])


def as_pose(pose: RigidTransform | ArrayLike) -> RigidTransform:
    """Return X_WP of a `pose` given as RigidTransform or as [roll, pitch, yaw, x, y, z]."""
    return pose if isinstance(pose, _POSES) else vector_to_pose(pose)


def rpy_rate_matrix(rpy: ArrayLike) -> Array:
    """Return E (3, 3) with omega_W = E d(rpy)/dt, for angles `rpy` (3,) [rad]."""
    _, p, y = np.asarray(rpy, float)
    return np.array(
        [
            [np.cos(y) * np.cos(p), -np.sin(y), 0.0],
            [np.sin(y) * np.cos(p), np.cos(y), 0.0],
            [-np.sin(p), 0.0, 1.0],
        ]
    )
