"""A robot drawn in Meshcat: frame, floor, platform, and the sagging cables as short bars."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from pydrake.geometry import Box, Cylinder, Meshcat, Rgba, Sphere
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.model.robot import CableRobot, RigidBody

STEEL = (0.45, 0.48, 0.52)
PLATFORM = (0.10, 0.30, 0.60)
GOAL = (0.0, 0.55, 0.35)
CAMERA = (0.1, 0.1, 0.1)
PAYLOAD = (0.60, 0.42, 0.22)
GHOSTS = ((0.80, 0.40, 0.0), (0.80, 0.47, 0.65), (0.35, 0.35, 0.35))
"""Colours of the platforms of other runs, sRGB."""


def drawing_scale(robot: CableRobot) -> float:
    """Return the robot's size over that of CoGiRo, by which lines are drawn thicker.

    Args:
        robot: the robot.
    """
    return float(np.linalg.norm(np.ptp(robot.drawing_points, axis=0))) / 19.0


def draw_surroundings(meshcat: Meshcat, robot: CableRobot) -> None:
    """Draw floor, posts, drawing points and the fixed camera, and place the viewer.

    Args:
        meshcat: where to draw.
        robot: the robot.
    """
    scale = drawing_scale(robot)
    meshcat.SetProperty("/Background", "top_color", [0.86, 0.91, 0.96])
    meshcat.SetProperty("/Background", "bottom_color", [0.97, 0.97, 0.97])
    for path in ("/Grid", "/Axes"):
        meshcat.SetProperty(path, "visible", False)
    _light_evenly(meshcat)
    _draw_floor(meshcat, robot)
    for i, top in enumerate(_post_tops(robot)):
        foot = np.array([top[0], top[1], 0.0])
        draw_bar(meshcat, f"/robot/post{i + 1}", foot, top, 0.06 * scale, STEEL)
    for i, point in enumerate(robot.drawing_points):
        path = f"/robot/drawing_point{i + 1}"
        meshcat.SetObject(path, Sphere(0.07 * scale), Rgba(*STEEL))
        meshcat.SetTransform(path, RigidTransform(point))
    _draw_camera(meshcat, robot.cameras.X_WF, 0.25 * scale)
    place_viewer(meshcat, robot)


def place_viewer(
    meshcat: Meshcat, robot: CableRobot, distance: float = 1.5, aside: float = 0.13
) -> None:
    """Look at the whole robot, from the front left and above, with room for a legend on the left.

    Args:
        meshcat: whose camera to move.
        robot: the robot.
        distance: from which, over the robot's size.
        aside: room for the legend, over the robot's size.
    """
    low, high = robot.drawing_points.min(axis=0), robot.drawing_points.max(axis=0)
    size = float(np.linalg.norm(high - low))
    target = np.array([*(0.5 * (low + high))[:2], 0.42 * high[2]])
    direction = np.array([-0.42, -1.0, 0.40])
    to_the_left = np.cross(direction, [0.0, 0.0, 1.0])
    target += aside * size * to_the_left / np.linalg.norm(to_the_left)
    lens = Meshcat.PerspectiveCamera()
    lens.fov = 36.0
    lens.far = 10.0 * size
    meshcat.SetCamera(lens)
    meshcat.SetCameraPose(target + distance * size * direction / np.linalg.norm(direction), target)


def draw_platform(
    meshcat: Meshcat,
    path: str,
    robot: CableRobot,
    colour: Sequence[float],
    *,
    ghost: bool = False,
    faces: bool = True,
) -> None:
    """Draw the box around the attachment points; the frame at `path` is P.

    The payload is the solid box of its mass and inertia.

    Args:
        meshcat: where to draw.
        path: under which the pieces go.
        robot: the robot.
        colour: (3,) sRGB.
        ghost: whether to draw it transparent, without attachment points and payload.
        faces: whether to fill the box.
    """
    points = robot.attachment_points
    low, high = points.min(axis=0), points.max(axis=0)
    flat = 0.05 * float(np.max(high - low))
    low, high = np.minimum(low, high - flat), np.maximum(high, low + flat)
    radius = 0.025 * float(np.max(high - low))
    if faces:
        meshcat.SetObject(f"{path}/faces", Box(*(high - low)), Rgba(*colour, 0.2))
        meshcat.SetTransform(f"{path}/faces", RigidTransform(0.5 * (low + high)))
    for i, (p, q) in enumerate(_box_edges(low, high)):
        draw_bar(meshcat, f"{path}/edge{i}", p, q, radius, colour, 0.5 if ghost else 1.0)
    if ghost:
        return
    for i, point in enumerate(points):
        meshcat.SetObject(f"{path}/attachment_point{i + 1}", Sphere(1.8 * radius), Rgba(0, 0, 0))
        meshcat.SetTransform(f"{path}/attachment_point{i + 1}", RigidTransform(point))
    if robot.payload.mass > 0.0:
        _draw_payload(meshcat, f"{path}/payload", robot.payload)


def draw_path(
    meshcat: Meshcat, path: str, points: np.ndarray, radius: float, colour: Sequence[float]
) -> None:
    """Draw the way of a point as a chain of bars of equal length.

    Args:
        meshcat: where to draw.
        path: under which the bars go.
        points: (n, 3) [m].
        radius: [m].
        colour: (3,) sRGB.
    """
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    stops = np.linspace(0.0, travelled[-1], 61)
    chain = np.column_stack([np.interp(stops, travelled, axis) for axis in points.T])
    for i, (p, q) in enumerate(itertools.pairwise(chain)):
        if np.linalg.norm(q - p) > 1e-6:
            draw_bar(meshcat, f"{path}/{i}", p, q, radius, colour)


def draw_bar(
    meshcat: Meshcat,
    path: str,
    start: ArrayLike,
    end: ArrayLike,
    radius: float,
    colour: Sequence[float],
    opacity: float = 1.0,
) -> None:
    """Draw a round bar between two points.

    Args:
        meshcat: where to draw.
        path: of the bar.
        start: (3,) [m], in the frame of the path's parent.
        end: (3,) [m], in the same frame.
        radius: [m].
        colour: (3,) sRGB.
        opacity: 0 to 1.
    """
    X, length = bar_pose(start, end)
    meshcat.SetObject(path, Cylinder(radius, length), Rgba(*colour, opacity))
    meshcat.SetTransform(path, X)


def bar_pose(start: ArrayLike, end: ArrayLike) -> tuple[RigidTransform, float]:
    """Return the pose of a cylinder along z between two points, and its length [m].

    Args:
        start: (3,) [m].
        end: (3,) [m], elsewhere.
    """
    p, q = np.asarray(start, float), np.asarray(end, float)
    length = float(np.linalg.norm(q - p))
    return RigidTransform(RotationMatrix.MakeFromOneVector(q - p, 2), 0.5 * (p + q)), length


def _light_evenly(meshcat: Meshcat) -> None:
    """Light from all sides, so that colours that stand for numbers keep their meaning."""
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 2.2)
    meshcat.SetProperty("/Lights/FillLight/<object>", "intensity", 0.6)
    for light in ("SpotLight", "PointLightNegativeX", "PointLightPositiveX"):
        meshcat.SetProperty(f"/Lights/{light}/<object>", "intensity", 0.0)


def _post_tops(robot: CableRobot) -> list[np.ndarray]:
    """Return one point for each group of neighbouring drawing points, a little outside of it."""
    points = robot.drawing_points
    near = 0.06 * float(np.linalg.norm(np.ptp(points[:, :2], axis=0)))
    groups: list[list[np.ndarray]] = []
    for point in points:
        for group in groups:
            if np.linalg.norm(np.mean(group, axis=0)[:2] - point[:2]) < near:
                group.append(point)
                break
        else:
            groups.append([point])
    middle = points.mean(axis=0)[:2]
    tops = []
    for group in groups:
        top = np.mean(group, axis=0)
        outwards = top[:2] - middle
        reach = float(np.linalg.norm(outwards))
        if reach > 0.0:
            top[:2] += 0.12 * drawing_scale(robot) * outwards / reach
        tops.append(top)
    return tops


def _draw_floor(meshcat: Meshcat, robot: CableRobot) -> None:
    """Draw a grid under the robot, one line a metre, or every 5 or 10 for a large one."""
    low, high = robot.drawing_points.min(axis=0), robot.drawing_points.max(axis=0)
    step = next(s for s in (1.0, 5.0, 10.0, 100.0, np.inf) if (high - low).max() / s < 40.0)
    x0, y0 = step * (np.floor(low[:2] / step) - 1.0)
    x1, y1 = step * (np.ceil(high[:2] / step) + 1.0)
    xs, ys = np.arange(x0, x1 + 0.5 * step, step), np.arange(y0, y1 + 0.5 * step, step)
    start = [(x, y0, 0.0) for x in xs] + [(x0, y, 0.0) for y in ys]
    end = [(x, y1, 0.0) for x in xs] + [(x1, y, 0.0) for y in ys]
    meshcat.SetLineSegments(
        "/robot/floor", np.array(start).T, np.array(end).T, 1.0, Rgba(0.72, 0.74, 0.77)
    )


def _draw_camera(meshcat: Meshcat, X_WF: RigidTransform, size: float) -> None:
    """Draw the fixed camera: a body, and the edges of what it looks into, along +z of F."""
    meshcat.SetObject("/robot/camera", Box(0.6 * size, 0.6 * size, size), Rgba(*CAMERA))
    meshcat.SetTransform("/robot/camera", X_WF)
    corners = [
        np.array([sx, sy, 2.0]) * size for sx, sy in ((-1, -0.8), (1, -0.8), (1, 0.8), (-1, 0.8))
    ]
    start = [np.zeros(3)] * 4 + corners
    end = corners + corners[1:] + corners[:1]
    meshcat.SetLineSegments(
        "/robot/camera/view", np.array(start).T, np.array(end).T, 1.0, Rgba(*CAMERA)
    )


def _draw_payload(meshcat: Meshcat, path: str, payload: RigidBody) -> None:
    """Draw the solid box of a payload's mass and inertia, or a ball where it is a point."""
    moments, axes = np.linalg.eigh(payload.inertia)
    squares = 6.0 / payload.mass * (moments.sum() - 2.0 * moments)
    if squares.min() <= 0.0:
        meshcat.SetObject(path, Sphere(0.15), Rgba(*PAYLOAD))
        meshcat.SetTransform(path, RigidTransform(payload.center_of_mass))
        return
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    meshcat.SetObject(path, Box(*np.sqrt(squares)), Rgba(*PAYLOAD))
    R = RotationMatrix.ProjectToRotationMatrix(axes)
    meshcat.SetTransform(path, RigidTransform(R, payload.center_of_mass))


def _box_edges(low: np.ndarray, high: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the twelve edges of a box."""
    corners = [np.where([i & 1, i & 2, i & 4], high, low) for i in range(8)]
    return [(corners[i], corners[i | bit]) for bit in (1, 2, 4) for i in range(8) if not i & bit]
