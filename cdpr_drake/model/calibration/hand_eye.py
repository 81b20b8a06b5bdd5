"""A start for the robot-world and hand-eye problem X_SP X_PM = X_SC X_CM, in closed form.

Its classical solution (Shah 2013) takes the camera's rotation from rotations alone, and is poor
where these are small. There the ways that the platform goes tell it. Both are tried.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.model.calibration.motions import difference
from cdpr_drake.model.rotations import Array


def robot_world_hand_eye(
    X_SP: Sequence[RigidTransform], X_CM: Sequence[RigidTransform]
) -> RigidTransform:
    """Return X_PM, the better of two closed forms.

    Args:
        X_SP: poses of the platform, from the tracker.
        X_CM: of the target in the same poses, from one camera.
    """
    answers = [
        _completed(R_SC, X_SP, X_CM) for R_SC in (_by_ways(X_SP, X_CM), _by_turns(X_SP, X_CM))
    ]
    return min(answers, key=lambda answer: answer[1])[0]


def _by_ways(X_SP: Sequence[RigidTransform], X_CM: Sequence[RigidTransform]) -> Array:
    """Return R_SC that lays the places of the target over those of the platform (Kabsch)."""
    p = np.array([X.translation() for X in X_SP])
    q = np.array([X.translation() for X in X_CM])
    U, _, Vt = np.linalg.svd((p - p.mean(axis=0)).T @ (q - q.mean(axis=0)))
    U[:, 2] *= np.sign(np.linalg.det(U @ Vt))
    R: Array = U @ Vt
    return R


def _by_turns(X_SP: Sequence[RigidTransform], X_CM: Sequence[RigidTransform]) -> Array:
    """Return R_SC from R_CM R_MP = R_CS R_SP: vec R_CS = (R_SP kron R_CM) vec R_MP (Shah)."""
    K = sum(
        (
            np.kron(P.rotation().matrix(), M.rotation().matrix())
            for P, M in zip(X_SP, X_CM, strict=True)
        ),
        np.zeros((9, 9)),
    )
    R_CS = np.linalg.svd(K)[0][:, 0].reshape(3, 3, order="F")
    R_CS = R_CS * np.sign(np.linalg.det(R_CS))
    R: Array = RotationMatrix.ProjectToRotationMatrix(R_CS).matrix().T
    return R


def _completed(
    R_SC: Array, X_SP: Sequence[RigidTransform], X_CM: Sequence[RigidTransform]
) -> tuple[RigidTransform, float]:
    """Return X_PM that suits R_SC best, and what is left."""
    total = np.zeros((3, 3))
    rows, right = [], []
    for P, M in zip(X_SP, X_CM, strict=True):
        R_SP = P.rotation().matrix()
        total += R_SP.T @ R_SC @ M.rotation().matrix()
        rows.append(np.hstack([R_SP, -np.eye(3)]))  # R_SP p_PM - p_SC = R_SC p_CM - p_SP
        right.append(R_SC @ M.translation() - P.translation())
    p = np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)[0]
    X_PM = RigidTransform(RotationMatrix.ProjectToRotationMatrix(total), p[:3])
    X_SC = RigidTransform(RotationMatrix.ProjectToRotationMatrix(R_SC), p[3:])
    left = [difference(P @ X_PM, X_SC @ M) for P, M in zip(X_SP, X_CM, strict=True)]
    return X_PM, float(np.sum(np.square(left)))
