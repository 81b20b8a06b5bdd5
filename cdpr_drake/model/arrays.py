"""A robot as the arrays that the kernels take: the one place that packs them."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array


class RobotArrays:
    """A robot in numbers, each array contiguous and packed when first asked for.

    Args:
        robot: the robot.
    """

    def __init__(self, robot: CableRobot) -> None:
        self.robot = robot

    @cached_property
    def points(self) -> Array:
        """Where the cables leave and attach, (4, k, 3).

        Drawing points p_WA, or where the cables enter their pulleys, and attachment points p_PB
        [m]; unit vectors along the pulleys' axes; in the first column, their radii [m], 0 for none.
        """
        robot = self.robot
        radii = np.outer(robot.pulley_radii, [1.0, 0.0, 0.0])
        return np.array(
            [robot.drawing_points, robot.attachment_points, robot.pulley_axes, radii], float
        )

    @cached_property
    def constants(self) -> Array:
        """Those of the cables, (6 + k,).

        Weight w [N/m]; stiffness (3); damping time [s]; breaking load [N]; runs from drum to
        drawing point (k) [m].
        """
        cable = self.robot.cable
        law = [*cable.stiffness.as_array(), cable.damping_time, cable.breaking_load]
        return np.array([self.robot.weight_per_metre, *law, *cable.drum_run], float)

    @property
    def stiffness(self) -> Array:
        """The law of EA(T), (3,)."""
        return self.constants[1:4]

    @property
    def run(self) -> Array:
        """The runs from drum to drawing point, unstretched, (k,) [m]."""
        return self.constants[6:]

    @cached_property
    def body(self) -> Array:
        """Weight m g [N] of the platform, p_PG [m], and weight w of the cables [N/m], (5,)."""
        robot = self.robot
        weight = robot.mass * robot.gravity
        return np.array([weight, *robot.center_of_mass, robot.weight_per_metre])

    @cached_property
    def target(self) -> Array:
        """Orientation R_PM of the target frame, and p_PM [m], (4, 3)."""
        X_PM = self.robot.cameras.X_PM
        return np.vstack([X_PM.rotation().matrix(), X_PM.translation()])

    @cached_property
    def solid(self) -> Array:
        """Of the platform (8, 3): [mass, gravity, 0]; p_PG; inertia about G in P; its inverse."""
        robot = self.robot
        inertia = np.array(robot.inertia, float)
        scalars = [robot.mass, robot.gravity, 0.0]
        return np.vstack([scalars, robot.center_of_mass, inertia, np.linalg.inv(inertia)])
