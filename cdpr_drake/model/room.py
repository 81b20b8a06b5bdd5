"""The room of a robot: its floor, and the box by which what is drawn of it is sized."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.model.kinematics import cable_ends
from cdpr_drake.model.robot import CableRobot

DEPTH = 0.4
"""Of the room below drawing points that are all high up, over its longer side in plan."""

FLAT = 0.1
"""Drawing points whose heights differ by less, over that side, are all high up."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Room:
    """A box around a robot that stands on its floor.

    Attributes:
        low: (3,) [m] the lowest corner, in W.
        high: (3,) [m] the highest.
        floor: height of the floor in W [m].
    """

    low: np.ndarray
    high: np.ndarray
    floor: float

    @property
    def size(self) -> float:
        """The box's diagonal [m]."""
        return float(np.linalg.norm(self.high - self.low)) or 1.0

    @property
    def corners(self) -> np.ndarray:
        """Of the box (8, 3) [m], in W."""
        return np.array([np.where([i & 1, i & 2, i & 4], self.high, self.low) for i in range(8)])


def room_of(robot: CableRobot, poses: Sequence[RigidTransform] = ()) -> Room:
    """Return the box around the drawing points, the floor, and where the platform goes.

    A floor that the robot's file does not give is at the lowest of these.

    Args:
        robot: the robot.
        poses: X_WP that the platform comes to; level at its `home_position` if there are none.
    """
    poses = poses or (RigidTransform(home_position(robot)),)
    visited = np.vstack([cable_ends(robot, X_WP).p_WB for X_WP in poses])
    floor = floor_height(robot)
    if robot.floor is None:
        floor = min(floor, float(visited[:, 2].min()))
    points = np.vstack([robot.drawing_points, visited])
    low, high = points.min(axis=0), points.max(axis=0)
    low[2], high[2] = min(low[2], floor), max(high[2], floor)
    return Room(low=low, high=high, floor=floor)


def floor_height(robot: CableRobot) -> float:
    """Return the height of the floor in W [m]: what the robot's file gives, else a guess.

    That is the lowest of the drawing points and the platform at its `home_position`; under drawing
    points that are all high up, as those of suspended robots, it is `DEPTH` of the room's longer
    side below them.

    Args:
        robot: the robot.
    """
    if robot.floor is not None:
        return robot.floor
    lowest = float(robot.drawing_points[:, 2].min())
    bottom = float(home_position(robot)[2] + robot.attachment_points[:, 2].min())
    return min(lowest, bottom, lowest - _depth(robot))


def home_position(robot: CableRobot) -> np.ndarray:
    """Return p_WP (3,) [m]: the middle of the box between drawing points and floor.

    It asks of geometry only; `analysis.middle_of_workspace` asks where the cables can hold.

    Args:
        robot: the robot.
    """
    low, high = robot.drawing_points.min(axis=0), robot.drawing_points.max(axis=0)
    low[2] -= _depth(robot)
    if robot.floor is not None:
        low[2] = min(robot.floor, high[2])
    return 0.5 * (low + high)


def _depth(robot: CableRobot) -> float:
    """Return how far the room reaches below the lowest drawing point [m], 0 if some are below."""
    sides = np.ptp(robot.drawing_points, axis=0)
    side = float(sides[:2].max())
    if sides[2] > FLAT * side:
        return 0.0
    # Points on one vertical line say nothing of how far down it goes.
    depth = DEPTH * side if side > 0.0 else abs(float(robot.drawing_points[0, 2])) or 1.0
    return max(depth, 2.0 * float(np.ptp(robot.attachment_points[:, 2])))
