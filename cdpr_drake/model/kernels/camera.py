"""A measured pose: calibration error, noise, and back to roll, pitch and yaw, in real or complex.

Arguments: y, x: numbers; A, B: transforms (4, 3), rotation over translation; z (12,) = [pose (6);
noise (6)], the pose [roll, pitch, yaw, x, y, z], the noise [rotation; translation] in the target
frame; left, target, right (4, 3): the constant transforms; out (6,) and jacobian (6, 12): results.
"""

from __future__ import annotations

import numpy as np

from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.servo import STEP, rpy_matrix


@jit
def atan2(y, x):
    """Return the angle of (x, y): the real parts' angle, plus what is left of it by arctan."""
    angle = np.arctan2(y.real, x.real)
    c, s = np.cos(angle), np.sin(angle)
    return angle + np.arctan((y * c - x * s) / (x * c + y * s))


@jit
def compose(A, B, out):
    """Write the product of two transforms (4, 3) into out (4, 3)."""
    for a in range(3):
        for b in range(3):
            out[a, b] = A[a, 0] * B[0, b] + A[a, 1] * B[1, b] + A[a, 2] * B[2, b]
        out[3, a] = A[3, a] + A[a, 0] * B[3, 0] + A[a, 1] * B[3, 1] + A[a, 2] * B[3, 2]


@jit
def measured_pose(z, left, target, right, out):
    """Write the pose vector of left X_WP target N right, with the small motion N of the noise."""
    X = np.zeros((4, 3), z.dtype)
    Y = np.zeros((4, 3), z.dtype)
    N = np.zeros((4, 3), z.dtype)
    rpy_matrix(z[0], z[1], z[2], X)
    for a in range(3):
        X[3, a] = z[3 + a]
        N[3, a] = z[9 + a]
    # Turn by the quaternion (1, noise / 2), normalised.
    x, y, w = 0.5 * z[6], 0.5 * z[7], 0.5 * z[8]
    n = 2.0 / (1.0 + x * x + y * y + w * w)
    N[0, 0], N[0, 1], N[0, 2] = 1.0 - n * (y * y + w * w), n * (x * y - w), n * (x * w + y)
    N[1, 0], N[1, 1], N[1, 2] = n * (x * y + w), 1.0 - n * (x * x + w * w), n * (y * w - x)
    N[2, 0], N[2, 1], N[2, 2] = n * (x * w - y), n * (y * w + x), 1.0 - n * (x * x + y * y)
    compose(left, X, Y)
    compose(Y, target, X)
    compose(X, N, Y)
    compose(Y, right, X)
    out[0] = atan2(X[2, 1], X[2, 2])
    out[1] = atan2(-X[2, 0], np.sqrt(X[0, 0] * X[0, 0] + X[1, 0] * X[1, 0]))
    out[2] = atan2(X[1, 0], X[0, 0])
    for a in range(3):
        out[3 + a] = X[3, a]


@jit
def measured_pose_jacobian(z, left, target, right, out, jacobian):
    """Write the measured pose and its Jacobian (6, 12) with respect to z, by complex steps."""
    zc = np.zeros(12, np.complex128)
    yc = np.zeros(6, np.complex128)
    for j in range(12):
        zc[j] = z[j]
    for j in range(12):
        zc[j] = zc[j] + STEP * 1j
        measured_pose(zc, left, target, right, yc)
        zc[j] = z[j]
        for i in range(6):
            jacobian[i, j] = yc[i].imag / STEP
            out[i] = yc[i].real
