"""A move for a robot that no test of the paper is about."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.model.robot import CableRobot

START_HEIGHT, RISE, SHIFT = 0.3, 0.1, 0.05

DECAYS, LONGEST = 8.0, 400.0
"""How long a move takes by default: time constants of its gain, but at most so long [s]."""


def time_for(gain: float) -> float:
    """Return the time [s] for a move at a gain that robot file or limit decide, with three digits.

    Args:
        gain: lambda [1/s].
    """
    return float(f"{min(DECAYS / gain, LONGEST):.3g}")


def move_near_the_middle(robot: CableRobot) -> tuple[RigidTransform, RigidTransform]:
    """Return X_WP at the start and the goal of a short level move near the middle of a robot.

    It starts under the centroid of the drawing points at 30 % of their height over the ground (or
    over the lowest of them, if that is below ground), rises by 10 % of it and moves along x by 5 %
    of the room's length.

    Args:
        robot: the robot.
    """
    points = robot.drawing_points
    ground = min(0.0, float(points[:, 2].min()))
    height = float(points[:, 2].max()) - ground
    centre = points.mean(axis=0)
    start = np.array([centre[0], centre[1], ground + START_HEIGHT * height])
    shift = np.array([SHIFT * float(np.ptp(points[:, 0])), 0.0, RISE * height])
    return RigidTransform(start), RigidTransform(start + shift)
