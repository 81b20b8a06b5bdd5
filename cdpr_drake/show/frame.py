"""What holds the drawing points up in a drawing: posts around the robot, beams over it.

A pulley is held by its bearing, which is a little before the drawing point, where a cable enters.

A post stands behind each group of neighbouring drawing points, as high as its highest; the others
of the group are on short arms. No post stands where the platform moves: drawing points in the
middle hang from beams between the posts, and where there are none, from a portal.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.room import Room

NEAR = 0.06
"""Drawing points within this share of the robot's size in plan stand together."""

BEHIND = 0.006
"""How far outside its drawing points a post stands, over the room's size."""

INSIDE = 0.75
"""A group is in the middle if others reach farther than it does over this, in its direction."""

STUB = 0.3
"""Groups in the middle below this share of the room's height stand on the floor."""

LEAST = 1e-3
"""Shorter bars, over the room's size, are left out."""

BEARING = 0.75
"""How far before its entry point a pulley is held, over its radius."""

POST, BEAM, ARM = 1.0, 0.6, 0.4
"""Thickness over that of a post."""


class Bar(NamedTuple):
    """A round bar of the frame.

    Attributes:
        start: (3,) [m], in W.
        end: (3,) [m].
        thickness: over that of a post.
    """

    start: np.ndarray
    end: np.ndarray
    thickness: float


def frame_bars(robot: CableRobot, room: Room) -> list[Bar]:
    """Return the bars that hold the drawing points; those of no length are left out.

    Args:
        robot: the robot.
        room: it stands in.
    """
    held = robot.drawing_points - BEARING * robot.pulley_radii[:, None] * robot.pulley_axes
    middle = held[:, :2].mean(axis=0)
    B = robot.attachment_points[:, :2]
    clear = float(np.linalg.norm(B - B.mean(axis=0), axis=1).max()) + 0.02 * room.size
    ceiling = float(held[:, 2].max())
    groups = _groups(held)
    outer = [g for g in groups if _reaches_out(g, groups, middle, clear)]
    inner = [g for g in groups if not any(g is o for o in outer)]
    low = room.floor + STUB * (ceiling - room.floor)
    hung = [g for g in inner if g[:, 2].max() > low]
    bars = [_upright(p, room.floor, ARM) for g in inner if g[:, 2].max() <= low for p in g]
    feet = [_foot(group, middle, BEHIND * room.size) for group in outer]
    bars += [Bar(np.array([*f, p[2]]), p, ARM) for f, g in zip(feet, outer, strict=True) for p in g]
    tops = [np.array([*f, g[:, 2].max()]) for f, g in zip(feet, outer, strict=True)]
    if hung:
        if len(feet) < 2:
            aside = np.array([clear + 0.1 * room.size, 0.0])
            feet += [middle - aside, middle + aside]
        tops = [np.array([*foot, ceiling]) for foot in feet]
        bars += _hangers(hung, tops)
    bars += [_upright(top, room.floor, POST) for top in tops]
    return [bar for bar in bars if np.linalg.norm(bar.end - bar.start) > LEAST * room.size]


def _hangers(hung: list[np.ndarray], tops: list[np.ndarray]) -> list[Bar]:
    """Return beams between two tops of posts each, and the bars from there to groups of points."""
    bars = []
    for group in hung:
        knee = np.array([*group[:, :2].mean(axis=0), tops[0][2]])
        ends = min(itertools.combinations(tops, 2), key=lambda pair: _detour(knee, *pair))
        bars += [Bar(end, knee, BEAM) for end in ends]
        bars += [Bar(knee, point, ARM) for point in group]
    return bars


def _groups(points: np.ndarray) -> list[np.ndarray]:
    """Return drawing points (n, 3) that stand together in plan."""
    near = NEAR * float(np.linalg.norm(np.ptp(points[:, :2], axis=0)))
    groups: list[list[np.ndarray]] = []
    for point in points:
        for group in groups:
            if np.linalg.norm(np.mean(group, axis=0)[:2] - point[:2]) <= near:
                group.append(point)
                break
        else:
            groups.append([point])
    return [np.array(group) for group in groups]


def _reaches_out(
    group: np.ndarray, groups: list[np.ndarray], middle: np.ndarray, clear: float
) -> bool:
    """Return whether a group is clear of the platform, and none is much farther out its way."""
    out = group[:, :2].mean(axis=0) - middle
    reach = float(np.linalg.norm(out))
    if reach <= clear:
        return False
    farthest = max(float(((g[:, :2] - middle) @ out).max()) / reach for g in groups)
    return reach >= INSIDE * farthest


def _foot(group: np.ndarray, middle: np.ndarray, behind: float) -> np.ndarray:
    """Return where in plan (2,) a post of a group stands, a little outside of it."""
    foot = group[:, :2].mean(axis=0)
    out = foot - middle
    return np.asarray(foot + behind * out / float(np.linalg.norm(out)))


def _upright(top: np.ndarray, floor: float, thickness: float) -> Bar:
    return Bar(np.array([top[0], top[1], floor]), top, thickness)


def _detour(point: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
    """Return how much longer the way from start to end is over a point."""
    way = np.linalg.norm(point - start) + np.linalg.norm(end - point)
    return float(way - np.linalg.norm(end - start))
