"""Rotations as the control law needs them: rotation vectors, pose vectors, their derivatives.

A pose vector is [roll, pitch, yaw, x, y, z] (rad, m) of X_WP, Drake's extrinsic x-y-z angles; a
rotation vector is the axis times the angle, the paper's u theta.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.autodiffutils import AutoDiffXd, ExtractValue
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import (
    RigidTransform,
    RigidTransform_,
    RollPitchYaw,
    RollPitchYaw_,
    RotationMatrix,
)

Array = NDArray[np.float64]

FULL_TURN = 2.0 * math.pi
"""The largest angle that a pose is written with [rad]."""

_POSES = (RigidTransform, RigidTransform_[AutoDiffXd])
_ANGLES = ("roll", "pitch", "yaw")
_ORDER = "[roll, pitch, yaw, x, y, z] in rad and m"
_BY_NAME = "cdpr_drake.pose(x=..., yaw_deg=...) takes them by name, angles in degrees"


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
    """Return X_WP of a `pose` given as RigidTransform or as [roll, pitch, yaw, x, y, z] (rad, m).

    This is for what people write. A state of a simulation goes through `vector_to_pose`: a platform
    may turn further than anybody would write.

    Raises:
        ValueError: it is no such vector, or an angle is beyond a full turn, as when degrees were
            given, or the position first.
    """
    if isinstance(pose, _POSES):
        return pose
    try:
        vector = _six_numbers(pose)
    except (TypeError, ValueError):
        raise ValueError(f"a pose is six finite numbers {_ORDER}, got {pose}; {_BY_NAME}") from None
    angles = _values(vector)[:3]
    for name, angle in zip(_ANGLES, angles, strict=True):
        if abs(angle) > FULL_TURN:
            raise ValueError(
                f"a pose is six finite numbers {_ORDER}, no angle beyond a full turn, 2 pi, "
                f"got {name} = {angle:g} rad; {_BY_NAME}"
            )
    return vector_to_pose(vector)


def pose(
    *,
    x: float = 0.0,
    y: float = 0.0,
    z: float = 0.0,
    roll_deg: float = 0.0,
    pitch_deg: float = 0.0,
    yaw_deg: float = 0.0,
) -> RigidTransform:
    """Return X_WP of a position and of roll, pitch and yaw, Drake's extrinsic x-y-z angles.

    Args:
        x: [m] of the platform's origin in W.
        y: [m] likewise.
        z: [m] likewise, upwards.
        roll_deg: [deg] about the x axis of W, turned first.
        pitch_deg: [deg] about the y axis of W, turned second.
        yaw_deg: [deg] about the z axis of W, turned last.

    Raises:
        ValueError: a value is not finite, or an angle is beyond a full turn, 360 degrees.
    """
    angles = {"roll_deg": roll_deg, "pitch_deg": pitch_deg, "yaw_deg": yaw_deg}
    for name, value in {"x": x, "y": y, "z": z, **angles}.items():
        if not math.isfinite(value):
            raise ValueError(f"{name} must be finite, got {value}")
        if name in angles and abs(value) > 360.0:
            raise ValueError(f"{name} is no larger than a full turn, 360 degrees, got {value:g}")
    return vector_to_pose([*(math.radians(a) for a in angles.values()), x, y, z])


def _six_numbers(pose: ArrayLike) -> Array:
    """Return `pose` as an array (6,) of float, or of AutoDiffXd if these are in it."""
    array = np.asarray(pose)
    if not any(isinstance(value, AutoDiffXd) for value in array.flat):
        array = array.astype(float)
    if array.shape != (6,) or not np.all(np.isfinite(_values(array))):
        raise ValueError("not six finite numbers")
    return array


def _values(array: Array) -> Array:
    """Return the values of an `array` (n,) of float or AutoDiffXd."""
    return ExtractValue(array).ravel() if array.dtype == object else array


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
