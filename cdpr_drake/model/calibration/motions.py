"""Poses that are known up to a small motion [rotation vector; translation] in their outer frame.

A pose X moved by d = [turn; shift] is the rotation exp(turn) R and the translation t + shift: the
motion of the inner frame's origin, and a turn about it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.model.rotations import Array, exp_rotation, log_rotation, skew


def moved(X: RigidTransform, d: Array) -> RigidTransform:
    """Return a pose `X` after a small motion `d` (6,) [rad, m]."""
    R = exp_rotation(d[:3]) @ X.rotation().matrix()
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(R), X.translation() + d[3:])


def difference(X: RigidTransform, Y: RigidTransform) -> Array:
    """Return the motion (6,) [rad, m] that takes the pose `Y` to `X`."""
    R = X.rotation().matrix() @ Y.rotation().matrix().T
    return np.concatenate([log_rotation(R), X.translation() - Y.translation()])


def product_jacobians(X: RigidTransform, Y: RigidTransform) -> tuple[Array, Array]:
    """Return how the motion of X Y follows from that of `X` and from that of `Y`, (6, 6) each."""
    R = X.rotation().matrix()
    of_X = np.eye(6)
    of_X[3:, :3] = -skew(R @ Y.translation())
    return of_X, np.kron(np.eye(2), R)


def inverse_jacobian(X: RigidTransform) -> Array:
    """Return how the motion of the inverse of a pose follows from that of `X`, (6, 6)."""
    back = -np.kron(np.eye(2), X.rotation().matrix().T)
    back[3:, :3] = -X.rotation().matrix().T @ skew(X.translation())
    return back


@dataclass(frozen=True, kw_only=True, eq=False)
class UncertainPose:
    """A pose and the covariance of its small motion.

    Attributes:
        X: the pose.
        covariance: (6, 6) [rad, m], of all there is to err.
        fixed_covariance: (6, 6) [rad, m], the part of it that measuring again leaves as it is.
    """

    X: RigidTransform
    covariance: Array
    fixed_covariance: Array = field(default_factory=lambda: np.zeros((6, 6)))

    @property
    def noise_covariance(self) -> Array:
        """The rest of it (6, 6): what the mean of n measurements has an n-th of."""
        return self.covariance - self.fixed_covariance

    def inverse(self) -> UncertainPose:
        """Return the inverse."""
        J = inverse_jacobian(self.X)
        return UncertainPose(
            X=self.X.inverse(),
            covariance=J @ self.covariance @ J.T,
            fixed_covariance=J @ self.fixed_covariance @ J.T,
        )

    def __matmul__(self, other: UncertainPose) -> UncertainPose:
        """Return the product with a pose whose errors are independent of this one's."""
        J, K = product_jacobians(self.X, other.X)
        return UncertainPose(
            X=self.X @ other.X,
            covariance=J @ self.covariance @ J.T + K @ other.covariance @ K.T,
            fixed_covariance=J @ self.fixed_covariance @ J.T + K @ other.fixed_covariance @ K.T,
        )


def between(
    X: RigidTransform, Y: RigidTransform, covariance: Array, fixed_covariance: Array
) -> UncertainPose:
    """Return X^-1 Y of two poses whose errors go together.

    Args:
        X: the one pose.
        Y: the other, in the same frame.
        covariance: (12, 12) [rad, m], of the motions of X and Y.
        fixed_covariance: (12, 12) [rad, m], the fixed part of it.
    """
    of_inverse, of_Y = product_jacobians(X.inverse(), Y)
    J = np.hstack([of_inverse @ inverse_jacobian(X), of_Y])
    return UncertainPose(
        X=X.inverse() @ Y,
        covariance=J @ covariance @ J.T,
        fixed_covariance=J @ fixed_covariance @ J.T,
    )
