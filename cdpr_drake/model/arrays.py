"""A robot as the arrays that the kernels take: the one place that packs them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array


class RobotArrays(NamedTuple):
    """A robot in numbers, each array contiguous and the reader's own.

    Attributes:
        points: (2, k, 3) [m] p_WA, where the cables leave the frame, and p_PB.
        constants: (6 + k,) weight w [N/m]; stiffness (3); damping time [s]; breaking load [N]; runs
            from drum to eyelet (k) [m].
        body: (5,) weight m g [N], p_PG [m] and w [N/m].
        target: (4, 3) orientation R_PM of the target frame, and p_PM [m].
        solid: (8, 3) [mass, gravity, 0]; p_PG; inertia about G in P; its inverse.
    """

    points: Array
    constants: Array
    body: Array
    target: Array
    solid: Array

    @property
    def stiffness(self) -> Array:
        """The law of EA(T), (3,)."""
        return self.constants[1:4]

    @property
    def run(self) -> Array:
        """The geometric lengths from drum to eyelet (k,) [m]."""
        return self.constants[6:]


def robot_arrays(robot: CableRobot) -> RobotArrays:
    """Return a robot as the kernels take it.

    Args:
        robot: the robot.
    """
    cable, X_PM, w = robot.cable, robot.cameras.X_PM, robot.weight_per_metre
    law = [w, *cable.stiffness.as_array(), cable.damping_time, cable.breaking_load]
    inertia = np.array(robot.inertia, float)
    scalars = [robot.mass, robot.gravity, 0.0]
    return RobotArrays(
        points=np.array([robot.drawing_points, robot.attachment_points], float),
        constants=np.array([*law, *cable.drum_run], float),
        body=np.array([robot.mass * robot.gravity, *robot.center_of_mass, w]),
        target=np.vstack([X_PM.rotation().matrix(), X_PM.translation()]),
        solid=np.vstack([scalars, robot.center_of_mass, inertia, np.linalg.inv(inertia)]),
    )
