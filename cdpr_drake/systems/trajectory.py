"""Any Drake trajectory of poses as a reference."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.systems.framework import BasicVector, Context, LeafSystem
from pydrake.trajectories import Trajectory

from cdpr_drake.model.rotations import Array, pose_to_vector
from cdpr_drake.systems._template import scalar_convertible, seconds


@scalar_convertible
class TrajectoryReference(LeafSystem):
    """A desired pose, and its twist, that follow a trajectory from its start to its end.

    .. pydrake_system::

        name: TrajectoryReference
        output_ports:
        - desired_pose
        - desired_twist

    Before its start the trajectory counts as at its start, after its end as at its end, and the
    platform stands. desired_pose (6) is [roll, pitch, yaw, x, y, z] (rad, m) of X_WP; desired_twist
    (6) is [omega; v] of the platform in W.

    Args:
        trajectory: of [roll, pitch, yaw, x, y, z] (6, 1), or of 4 x 4 transforms X_WP, as
            `PiecewisePose` has them. Its time is the diagram's [s].

    Raises:
        ValueError: the trajectory is of something else.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        super().__init__()
        shape = (trajectory.rows(), trajectory.cols())
        if shape not in ((6, 1), (4, 4)):
            raise ValueError(
                "a trajectory of poses is of (6, 1) [roll, pitch, yaw, x, y, z] or of (4, 4) "
                f"transforms, got {shape}"
            )
        self.trajectory, self._of_transforms = trajectory, shape == (4, 4)
        time = {self.time_ticket()}
        self.DeclareVectorOutputPort("desired_pose", 6, self._calc_pose, time)
        self.DeclareVectorOutputPort("desired_twist", 6, self._calc_twist, time)

    def _time(self, context: Context) -> float:
        start, end = self.trajectory.start_time(), self.trajectory.end_time()
        return min(max(seconds(context), start), end)

    def _calc_pose(self, context: Context, output: BasicVector) -> None:
        value = self.trajectory.value(self._time(context))
        if self._of_transforms:
            value = pose_to_vector(RigidTransform(value))
        output.SetFromVector(np.ravel(value))

    def _calc_twist(self, context: Context, output: BasicVector) -> None:
        time = self._time(context)
        moving = self.trajectory.start_time() <= seconds(context) < self.trajectory.end_time()
        output.SetFromVector(self._twist(time) if moving else np.zeros(6))

    def _twist(self, time: float) -> Array:
        value, rate = self.trajectory.value(time), self.trajectory.EvalDerivative(time)
        if not self._of_transforms:
            rpy = RollPitchYaw(np.ravel(value)[:3])
            omega = rpy.CalcAngularVelocityInParentFromRpyDt(np.ravel(rate)[:3])
            return np.concatenate([omega, np.ravel(rate)[3:]])
        if rate.size == 6:  # PiecewisePose gives a spatial velocity
            return np.ravel(rate)
        turning = rate[:3, :3] @ RotationMatrix(value[:3, :3]).matrix().T  # [omega]x
        omega = np.array([turning[2, 1], turning[0, 2], turning[1, 0]])
        return np.concatenate([omega, rate[:3, 3]])
