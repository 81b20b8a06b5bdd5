"""Where a robot can hold its platform level, and the middle of that: where questions start from."""

from __future__ import annotations

import itertools

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.errors import GeometryError, TensionError
from cdpr_drake.model.distribution import minimum_norm_within
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.room import floor_height
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.statics import check_rank, weight_wrench, what_limits_allow, wrench_matrix

CELLS = 9
"""Along each axis of the room."""


def room(robot: CableRobot) -> tuple[Array, Array]:
    """Return the lowest and highest p_WP (3,) [m] of the level platform amid the drawing points.

    The room stands on the floor (`model.room`). Where the platform is larger than the room along an
    axis, both are the place where it sticks out as far at either side.

    Args:
        robot: the robot.
    """
    low, high = robot.drawing_points.min(axis=0), robot.drawing_points.max(axis=0)
    low[2] = floor_height(robot)
    points = robot.attachment_points
    first, last = low - points.min(axis=0), high - points.max(axis=0)
    middle = 0.5 * (first + last)
    return np.minimum(first, middle), np.maximum(last, middle)


def is_wrench_feasible(robot: CableRobot, X_WP: RigidTransform) -> bool:
    """Return whether tensions within the robot's limits hold its weight, in the statics of A.2.

    None do where an attachment point is inside of a pulley.

    Args:
        robot: the robot, with its payload.
        X_WP: the pose.
    """
    low, high = robot.cable.limits
    try:
        geometry = cable_geometry(robot, X_WP)
        matrix, wrench = wrench_matrix(geometry), weight_wrench(robot, geometry)
        check_rank(matrix)
        least = np.linalg.lstsq(matrix, wrench, rcond=None)[0]  # does at most poses
        if least.min() < low or least.max() > high:
            minimum_norm_within(matrix, wrench, low, high)
    except (GeometryError, TensionError):
        return False
    return True


def level_workspace(robot: CableRobot) -> Array:
    """Return p_WP (n, 3) [m]: cells of the room in which the level platform can be held.

    Args:
        robot: the robot, with its payload.

    Raises:
        GeometryError: the cables cannot control six degrees of freedom at the room's middle.
        TensionError: there is no such cell among `CELLS` along each axis.
    """
    low, high = room(robot)
    shares = (np.arange(CELLS) + 0.5) / CELLS
    cells = low + (high - low) * np.array(list(itertools.product(shares, repeat=3)))
    found = np.array([p for p in cells if is_wrench_feasible(robot, RigidTransform(p))])
    if not len(found):
        middle = RigidTransform(0.5 * (low + high))
        geometry = cable_geometry(robot, middle)
        matrix = wrench_matrix(geometry)
        check_rank(matrix)
        why = what_limits_allow(robot, matrix, weight_wrench(robot, geometry))
        raise TensionError(
            f"none of {len(cells)} places in the room of {robot.name} can hold its platform level; "
            f"in the middle, {why}"
        )
    return found


def middle_of_workspace(robot: CableRobot, places: Array | None = None) -> RigidTransform:
    """Return X_WP: level, in the middle of where the platform can be held so.

    Args:
        robot: the robot, with its payload.
        places: (n, 3) [m] its `level_workspace`, where that is at hand.

    Raises:
        GeometryError, TensionError: it can nowhere be held, see `level_workspace`.
    """
    places = level_workspace(robot) if places is None else places
    centre = RigidTransform(places.mean(axis=0))
    if is_wrench_feasible(robot, centre):
        return centre
    away = np.linalg.norm(places - centre.translation(), axis=1)
    return RigidTransform(places[np.argmin(away)])
