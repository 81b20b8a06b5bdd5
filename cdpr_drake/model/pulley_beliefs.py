"""What a controller may believe of pulleys: they are not there, or not quite as they are."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.model.kinematics import cable_ends
from cdpr_drake.model.robot import CableRobot, Pulleys
from cdpr_drake.model.rotations import exp_rotation

Belief = Callable[[CableRobot, RigidTransform], CableRobot]
"""Makes, of the true robot and X_WP at the start of a move, the robot as it is believed to be."""

LARGER = 1.1
"""Believed radius over the true one."""

TILT, SEED = math.radians(5.0), 0
"""By how much axes are believed to be tilted [rad]; of the directions in which."""


def as_they_are(robot: CableRobot, start: RigidTransform) -> CableRobot:
    """Return the robot itself.

    Args:
        robot: the true robot.
        start: X_WP at the start, which makes no difference.
    """
    return robot


def entry_points(robot: CableRobot, start: RigidTransform) -> CableRobot:
    """Return a robot with eyelets where the cables enter the pulleys.

    Args:
        robot: the true robot.
        start: X_WP at the start, which makes no difference.
    """
    return robot.replace(pulleys=Pulleys())


def points_at_start(robot: CableRobot, start: RigidTransform) -> CableRobot:
    """Return a robot with eyelets where straight cables leave the pulleys at the start.

    The arcs they wrap there belong to the runs from the drums.

    Args:
        robot: the true robot.
        start: X_WP at the start.

    Raises:
        GeometryError: an attachment point is inside of a pulley there; names the cable.
    """
    ends = cable_ends(robot, start)
    wrap = 0.0 if ends.contact is None else ends.contact.theta
    run = robot.cable.drum_run + robot.pulley_radii * wrap
    return robot.replace(
        drawing_points=ends.p_WA, pulleys=Pulleys(), cable=robot.cable.replace(drum_run=run)
    )


def larger_pulleys(robot: CableRobot, start: RigidTransform) -> CableRobot:
    """Return a robot with radii larger by a tenth.

    Args:
        robot: the true robot.
        start: X_WP at the start, which makes no difference.
    """
    pulleys = robot.pulleys
    return robot.replace(pulleys=pulleys.replace(radius=LARGER * pulleys.radius))


def tilted_axes(robot: CableRobot, start: RigidTransform) -> CableRobot:
    """Return a robot with each axis tilted by 5 degrees, always in the same random directions.

    Vertical axes are tilted about horizontal lines.

    Args:
        robot: the true robot.
        start: X_WP at the start, which makes no difference.
    """
    axes = robot.pulley_axes
    draws = np.random.default_rng(SEED).standard_normal((robot.num_cables, 3))
    across = np.cross(axes, draws)
    turns = TILT * across / np.linalg.norm(across, axis=1, keepdims=True)
    tilted = np.array([exp_rotation(t) @ a for t, a in zip(turns, axes, strict=True)])
    return robot.replace(pulleys=robot.pulleys.replace(axis=tilted))


BELIEFS: Mapping[str, Belief] = {
    "true": as_they_are,
    "entry point": entry_points,
    "point at the start": points_at_start,
    "radius +10 %": larger_pulleys,
    "axis 5 deg off": tilted_axes,
}
"""By name; the first is what the others are compared with."""
