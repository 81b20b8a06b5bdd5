"""A plain hall around a robot, for its cameras to look at: floor, walls, the frame, some crates."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pydrake.geometry import Box, Shape
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.room import room_of
from cdpr_drake.model.rotations import Array

Part = tuple[str, Shape, RigidTransform, tuple[float, float, float]]
"""Name, shape, X_WS, and colour (red, green, blue) from 0 to 1."""

FLOOR, JOINT, TAPE = (0.29, 0.30, 0.31), (0.24, 0.25, 0.26), (0.50, 0.41, 0.10)
WALL, SKIRTING, STEEL = (0.45, 0.47, 0.49), (0.24, 0.26, 0.28), (0.13, 0.25, 0.42)
CRATES = ((0.36, 0.24, 0.13), (0.30, 0.21, 0.13), (0.16, 0.27, 0.20))

SLAB = 12
"""Slabs of the floor along the longer side of the hall."""


def hall_parts(robot: CableRobot) -> Iterator[Part]:
    """Yield the parts of a hall that fits a robot and stands on its floor.

    Args:
        robot: the robot.
    """
    floor = room_of(robot).floor
    for name, shape, X_HS, colour in _parts(robot.drawing_points - [0.0, 0.0, floor]):
        yield name, shape, RigidTransform([0.0, 0.0, floor]) @ X_HS, colour


def _parts(drawing_points: Array) -> Iterator[Part]:
    """Yield the parts of a hall with its floor at z = 0."""
    low, high = drawing_points.min(axis=0), drawing_points.max(axis=0)
    middle, size = 0.5 * (low + high), high - low
    # A robot all in a plane, or in a line, has a hall of some width too.
    size = np.maximum(size, 0.1 * max(float(size.max()), float(high[2]), 1e-3))
    x, y = middle[:2]
    width, depth = 1.5 * size[:2] + 0.3 * size[:2].max()
    height = 1.6 * max(float(high[2]), 0.2 * float(size[:2].max()))
    unit = 0.01 * float(np.hypot(size[0], size[1]))  # what is thin in so large a hall
    yield "floor", Box(width, depth, unit), _at(x, y, -unit), FLOOR
    yield from _joints(x, y, width, depth, unit)
    for i, sign in enumerate((-1.0, 1.0)):
        across, along = x + 0.5 * sign * width, y + 0.5 * sign * depth
        yield f"wall_x{i}", Box(unit, depth, height), _at(across, y, 0.5 * height), WALL
        yield f"wall_y{i}", Box(width, unit, height), _at(x, along, 0.5 * height), WALL
        yield f"skirting_x{i}", Box(1.4 * unit, depth, 3.0 * unit), _at(across, y, 0.0), SKIRTING
        yield f"skirting_y{i}", Box(width, 1.4 * unit, 3.0 * unit), _at(x, along, 0.0), SKIRTING
        across, along = x + 0.42 * sign * size[0], y + 0.42 * sign * size[1]
        tape = 0.5 * unit
        yield f"tape_x{i}", Box(tape, 0.84 * size[1], tape), _at(across, y, -0.4 * unit), TAPE
        yield f"tape_y{i}", Box(0.84 * size[0], tape, tape), _at(x, along, -0.4 * unit), TAPE
    yield from _frame(drawing_points, middle, 2.0 * unit)
    for i, (a, b, turn) in enumerate(((0.40, -0.63, 0.2), (0.30, -0.65, -0.3), (-0.42, 0.62, 0.5))):
        edge = (3.6 + 1.2 * i) * unit
        X = RigidTransform(
            RotationMatrix.MakeZRotation(turn), [x + a * size[0], y + b * size[1], 0.5 * edge]
        )
        yield f"crate_{i}", Box(1.3 * edge, edge, edge), X, CRATES[i]


def _joints(x: float, y: float, width: float, depth: float, unit: float) -> Iterator[Part]:
    """Yield the joints between the slabs of the floor."""
    slab, thin = max(width, depth) / SLAB, 0.2 * unit
    for i in range(1, int(width / slab) + 1):
        place = _at(x - 0.5 * width + i * slab, y, -0.58 * unit)
        yield f"joint_x{i}", Box(thin, depth, thin), place, JOINT
    for i in range(1, int(depth / slab) + 1):
        place = _at(x, y - 0.5 * depth + i * slab, -0.58 * unit)
        yield f"joint_y{i}", Box(width, thin, thin), place, JOINT


def _frame(drawing_points: Array, middle: Array, side: float) -> Iterator[Part]:
    """Yield a post behind each group of drawing points, and beams from post to post."""
    outwards = drawing_points[:, :2] - middle[:2]
    angle = np.arctan2(outwards[:, 1], outwards[:, 0])
    order = np.argsort(angle)
    gaps = drawing_points[order] - drawing_points[np.roll(order, 1)]
    # Round the hall, a new group begins where there is a gap.
    begins = np.flatnonzero(np.linalg.norm(gaps, axis=1) > 10.0 * side)
    first = int(begins[0]) if begins.size else 0
    groups = np.split(np.roll(order, -first), begins[1:] - first)
    tops = []
    for i, group in enumerate(groups):
        p = drawing_points[group].mean(axis=0)
        out = p[:2] - middle[:2]
        p[:2] += 1.5 * side * out / max(float(np.linalg.norm(out)), 1e-9)
        tops.append(p)
        if p[2] > side:  # else the floor carries it
            yield f"post_{i}", Box(side, side, p[2]), _at(p[0], p[1], 0.5 * p[2]), STEEL
    for i, (a, b) in enumerate(zip(tops, [*tops[1:], tops[0]], strict=True)):
        length = float(np.hypot(*(b - a)[:2]))
        turn = RotationMatrix.MakeZRotation(float(np.arctan2((b - a)[1], (b - a)[0])))
        X = RigidTransform(turn, 0.5 * (a + b) + [0.0, 0.0, 0.4 * side])
        yield f"beam_{i}", Box(length + side, 0.8 * side, 0.8 * side), X, STEEL


def _at(x: float, y: float, z: float) -> RigidTransform:
    return RigidTransform([x, y, z])
