"""The platform's pose as fixed cameras deliver it, through what is true and what is believed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, as_pose


class MeasuredPose:
    """X_WP measured = X_WF^ X_WF^-1 X_WP X_PM N X_PM^^-1, ^ marking what the controller believes.

    N is a small motion in M: it turns by a rotation vector (to third order) and shifts.

    Args:
        robot: the true robot, for its transforms X_WF and X_PM.
        calibrated: the robot as the controller believes it.
    """

    def __init__(self, robot: CableRobot, calibrated: CableRobot) -> None:
        from cdpr_drake.model.kernels import camera as kernel

        self._kernel = kernel
        true, believed = robot.cameras, calibrated.cameras
        self._transforms = (
            _stacked(believed.X_WF @ true.X_WF.inverse()),
            _stacked(true.X_PM),
            _stacked(believed.X_PM.inverse()),
        )

    def __call__(self, z: Array) -> Array:
        """Return the measured pose (6,) for `z` (12,) = [pose (6); noise (6)].

        The pose is [roll, pitch, yaw, x, y, z] (rad, m), the noise [rotation; translation].
        """
        out = np.zeros(6)
        self._kernel.measured_pose(z, *self._transforms, out)
        return out

    def with_jacobian(self, z: Array) -> tuple[Array, Array]:
        """Return the measured pose (6,) and its Jacobian (6, 12) with respect to `z`."""
        out, jacobian = np.zeros(6), np.zeros((6, 12))
        self._kernel.measured_pose_jacobian(z, *self._transforms, out, jacobian)
        return out, jacobian


def _stacked(X: RigidTransform) -> Array:
    return np.vstack([X.rotation().matrix(), X.translation()])


def true_from_seen(
    robot: CableRobot, believed: CableRobot, seen: RigidTransform | ArrayLike
) -> RigidTransform:
    """Return X_WP when the controller measures the platform at the pose `seen`.

    Args:
        robot: the true robot.
        believed: the robot as the controller knows it.
        seen: the measured X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
    """
    true, ours = robot.cameras, believed.cameras
    if true.X_WF == ours.X_WF and true.X_PM == ours.X_PM:
        return as_pose(seen)
    X_FM = ours.X_WF.InvertAndCompose(as_pose(seen) @ ours.X_PM)
    return true.X_WF @ X_FM @ true.X_PM.inverse()
