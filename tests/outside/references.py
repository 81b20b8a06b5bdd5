"""References of one's own: a circle as a system, and two trajectories of Drake's."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.framework import BasicVector, Context, LeafSystem
from pydrake.trajectories import PiecewisePolynomial, PiecewisePose


class Circle(LeafSystem):
    """A desired pose on a horizontal circle, and its twist. For floats alone.

    Args:
        start: [roll, pitch, yaw, x, y, z] (rad, m) at time 0; the centre is at smaller x.
        radius: [m].
        period: [s].
        tells_twist: whether there is an output desired_twist.
    """

    def __init__(
        self, start: ArrayLike, radius: float, period: float, tells_twist: bool = True
    ) -> None:
        super().__init__()
        self._start, self._radius = np.asarray(start, float), radius
        self._omega = 2.0 * np.pi / period
        self.DeclareVectorOutputPort("desired_pose", 6, self._calc_pose, {self.time_ticket()})
        if tells_twist:
            self.DeclareVectorOutputPort("desired_twist", 6, self._calc_twist, {self.time_ticket()})

    def at(self, time: float) -> np.ndarray:
        """Return the pose at a `time` [s]."""
        angle = self._omega * time
        way = [0.0, 0.0, 0.0, np.cos(angle) - 1.0, np.sin(angle), 0.0]
        return self._start + self._radius * np.array(way)

    def _calc_pose(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self.at(context.get_time()))

    def _calc_twist(self, context: Context, output: BasicVector) -> None:
        angle, speed = self._omega * context.get_time(), self._radius * self._omega
        output.SetFromVector([0.0, 0.0, 0.0, -speed * np.sin(angle), speed * np.cos(angle), 0.0])


def numbers(start: ArrayLike, goal: ArrayLike, duration: float) -> PiecewisePolynomial:
    """Return a way of [roll, pitch, yaw, x, y, z] without a jump in speed, from start to goal."""
    ends = np.column_stack([start, goal])
    return PiecewisePolynomial.CubicWithContinuousSecondDerivatives(
        [0.0, duration], ends, np.zeros((6, 1)), np.zeros((6, 1))
    )


def transforms(start: ArrayLike, goal: ArrayLike, duration: float) -> PiecewisePose:
    """Return a way of transforms X_WP from start to goal."""
    ends = [np.asarray(pose, float) for pose in (start, goal)]
    return PiecewisePose.MakeCubicLinearWithEndLinearVelocity(
        [0.0, duration], [RigidTransform(RollPitchYaw(p[:3]), p[3:]) for p in ends]
    )
