"""A robot drawn in Meshcat: frame, floor, platform, and the sagging cables as short bars.

All is sized by the robot's `Room`, so that a robot of 1 m and one of 500 m look alike.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydrake.geometry import Box, Cylinder, Meshcat, Rgba, Sphere
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.model.digits import round_step, significant
from cdpr_drake.model.pulleys import has_pulleys
from cdpr_drake.model.robot import CableRobot, RigidBody
from cdpr_drake.model.room import Room
from cdpr_drake.show.cables import css
from cdpr_drake.show.frame import frame_bars
from cdpr_drake.show.labels import Label
from cdpr_drake.show.meshes import tapered_bar

STEEL = (0.45, 0.48, 0.52)
PLATFORM = (0.10, 0.30, 0.60)
GOAL = (0.0, 0.55, 0.35)
CAMERA = (0.1, 0.1, 0.1)
PAYLOAD = (0.60, 0.42, 0.22)
GHOSTS = ((0.80, 0.40, 0.0), (0.80, 0.47, 0.65), (0.35, 0.35, 0.35))
"""Colours of the platforms of other runs, sRGB."""


AXES = ((0.80, 0.15, 0.10), (0.10, 0.55, 0.15), (0.10, 0.30, 0.80))
"""Colours of x, y and z, sRGB."""

LEAST = 0.02
"""Over the room's size: a smaller platform is drawn in a ball so large, to be seen at all."""

VIEW = (-0.42, -1.0, 0.40)
"""From where one looks at a robot that is wider along x than along y."""

FIELD_OF_VIEW = math.radians(36.0)
"""From top to bottom."""

ASPECT = 1.6
"""Of the window, width over height, that the viewer is placed for."""


SHORTEST = 1e-6
"""Of a bar [m]: one of no length has no direction, and cannot be scaled to none."""


class Window(NamedTuple):
    """The part of a window that is free for the robot, from -1 to 1 along each side.

    Attributes:
        left: side.
        right: side.
        bottom: side.
        top: side.
    """

    left: float
    right: float
    bottom: float
    top: float


BESIDE_LEGEND = Window(-0.51, 0.93, -0.93, 0.88)
BETWEEN_PANELS = Window(-0.50, 0.54, -0.85, 0.85)


def drawing_scale(room: Room) -> float:
    """Return a room's size over that of CoGiRo, by which lines are drawn thicker.

    Args:
        room: the room.
    """
    return room.size / 20.0


def draw_surroundings(meshcat: Meshcat, robot: CableRobot, room: Room, window: Window) -> None:
    """Draw floor, frame, drawing points, axes and the fixed camera, and place the viewer.

    Pulleys, which move, are not among it; see `pulleys.draw_pulley`.

    Args:
        meshcat: where to draw.
        robot: the robot.
        room: it stands in.
        window: what of the page is free.
    """
    scale = drawing_scale(room)
    meshcat.SetProperty("/Background", "top_color", [0.86, 0.91, 0.96])
    meshcat.SetProperty("/Background", "bottom_color", [0.97, 0.97, 0.97])
    for path in ("/Grid", "/Axes"):
        meshcat.SetProperty(path, "visible", False)
    _light_evenly(meshcat)
    _draw_floor(meshcat, room)
    for i, bar in enumerate(frame_bars(robot, room)):
        radius = 0.06 * scale * bar.thickness
        draw_bar(meshcat, f"/robot/frame{i + 1}", bar.start, bar.end, radius, STEEL)
    for i, point in enumerate(robot.drawing_points):
        if robot.pulley_radii[i] > 0.0:
            continue  # it is in the pulley
        path = f"/robot/drawing_point{i + 1}"
        meshcat.SetObject(path, Sphere(0.07 * scale), Rgba(*STEEL))
        meshcat.SetTransform(path, RigidTransform(point))
    origin, length = _axes_of(room)
    for i, colour in enumerate(AXES):
        tip = origin + length * np.eye(3)[i]
        draw_bar(meshcat, f"/robot/axis{i + 1}", origin, tip, 0.03 * scale, colour)
    _draw_camera(meshcat, robot.cameras.X_WF, 0.25 * scale)
    place_viewer(meshcat, robot, room, window)


def labels_of(robot: CableRobot, room: Room) -> list[list[Label]]:
    """Return the cables' numbers at their drawing points, and the names of the axes of W.

    Args:
        robot: the robot.
        room: it stands in.
    """
    origin, length = _axes_of(room)
    high = 0.5 * (room.floor + float(robot.drawing_points[:, 2].max()))
    return [
        [
            Label(str(i + 1), point, "above" if point[2] > high else "out")
            for i, point in enumerate(robot.drawing_points)
        ],
        [
            Label(name, origin + 1.2 * length * axis, "on", css(colour))
            for name, axis, colour in zip("xyz", np.eye(3), AXES, strict=True)
        ],
    ]


def scale_note(robot: CableRobot, room: Room) -> str:
    """Return in words what the drawing's scale is, for a legend.

    Args:
        robot: the robot.
        room: it stands in.
    """
    step = significant(grid_step(room))
    note = f"Grid of {step} m, axes of W. Cables and frame are drawn thicker than they are."
    if has_pulleys(robot):
        note += " Pulleys are drawn at their size."
    if np.ptp(robot.attachment_points, axis=0).max() < LEAST * room.size:
        note += " The ball stands for a platform too small to be seen."
    return note


def place_viewer(meshcat: Meshcat, robot: CableRobot, room: Room, window: Window) -> None:
    """Look at the whole robot, from the front left and above, as near as the window allows.

    Args:
        meshcat: whose camera to move.
        robot: the robot.
        room: it stands in.
        window: what of the page is free.
    """
    lens = Meshcat.PerspectiveCamera()
    lens.fov = math.degrees(FIELD_OF_VIEW)
    lens.near, lens.far = 5e-4 * room.size, 20.0 * room.size
    meshcat.SetCamera(lens)
    points = in_view(robot, room)
    eye, target = fitted_view(points, _view_of(room), window)
    meshcat.SetCameraPose(eye, target)


def in_view(robot: CableRobot, room: Room) -> np.ndarray:
    """Return points (n, 3) [m] that the viewer shall see: the ends of all that is drawn at rest.

    The fixed camera is among them unless it is far from the robot.

    Args:
        robot: the robot.
        room: it stands in.
    """
    bars = [p for bar in frame_bars(robot, room) for p in (bar.start, bar.end)]
    origin, length = _axes_of(room)
    camera = np.asarray(robot.cameras.X_WF.translation(), float)
    outside = np.maximum(room.low - camera, camera - room.high).max()
    seen = [camera] if outside < 0.2 * room.size else []
    return np.vstack(
        [room.corners, robot.drawing_points, *bars, *(origin + length * np.eye(3)), *seen]
    )


def fitted_view(
    points: np.ndarray, direction: Sequence[float], window: Window
) -> tuple[np.ndarray, np.ndarray]:
    """Return the nearest place of a viewer (3,) [m] who sees all points, and a point ahead of it.

    With a point at (r, u, f) to the right, up and forward, the viewer at (R, U, F) sees it within
    the window where left (f - F) <= r - R <= right (f - F), with the window's sides at distance 1,
    and so for u. Of all points at once that leaves a span for R and one for U, the narrower
    the larger F is; the largest F leaves one of them no room.

    Args:
        points: (n, 3) [m], in W.
        direction: (3,) from the points to the viewer, not vertical.
        window: where the points shall be.
    """
    forward = -np.asarray(direction) / np.linalg.norm(direction)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    across, height, ahead = np.array([right, up, forward]) @ points.T
    half = math.tan(0.5 * FIELD_OF_VIEW)
    sides = [
        (across, ASPECT * half * window.left, ASPECT * half * window.right),
        (height, half * window.bottom, half * window.top),
    ]
    F = min(float((np.min(x - a * ahead) - np.max(x - b * ahead)) / (b - a)) for x, a, b in sides)
    R, U = (
        0.5 * float(np.min(x - a * ahead) + a * F + np.max(x - b * ahead) + b * F)
        for x, a, b in sides
    )
    eye = R * right + U * up + F * forward
    return eye, eye + (float(np.mean(ahead)) - F) * forward


def draw_platform(
    meshcat: Meshcat,
    path: str,
    robot: CableRobot,
    room: Room,
    colour: Sequence[float],
    *,
    ghost: bool = False,
    faces: bool = True,
) -> None:
    """Draw the box around the attachment points; the frame at `path` is P.

    Points in a line make a rod, and a point a ball. What is too small to be seen in so large a room
    is drawn in a ball that is seen. The payload is the solid box of its mass and inertia, no larger
    than the platform.

    Args:
        meshcat: where to draw.
        path: under which the pieces go.
        robot: the robot.
        room: it moves in.
        colour: (3,) sRGB.
        ghost: whether to draw it transparent, without attachment points and payload.
        faces: whether to fill the box.
    """
    points = robot.attachment_points
    low, high = points.min(axis=0), points.max(axis=0)
    length, least = float(np.max(high - low)), LEAST * room.size
    radius = min(0.025 * length, 0.003 * room.size)
    opacity = 0.5 if ghost else 1.0
    if length < least:
        is_point = length < 1e-3 * least
        ball = Rgba(*colour, 0.8 if is_point and not ghost else 0.55)
        meshcat.SetObject(f"{path}/ball", Sphere(0.5 * least), ball)
        meshcat.SetTransform(f"{path}/ball", RigidTransform(0.5 * (low + high)))
        if is_point:
            radius = 0.0
    for i, (p, q) in enumerate(_outline(points)):
        draw_bar(meshcat, f"{path}/edge{i}", p, q, radius, colour, opacity)
    sides = np.maximum(high - low, 2.0 * radius)
    if faces and radius > 0.0 and not _is_rod(points):
        meshcat.SetObject(f"{path}/faces", Box(*sides), Rgba(*colour, 0.2))
        meshcat.SetTransform(f"{path}/faces", RigidTransform(0.5 * (low + high)))
    if ghost:
        return
    if radius > 0.0:
        for i, point in enumerate(points):
            ball_path = f"{path}/attachment_point{i + 1}"
            meshcat.SetObject(ball_path, Sphere(1.8 * radius), Rgba(0, 0, 0))
            meshcat.SetTransform(ball_path, RigidTransform(point))
    if robot.payload.mass > 0.0:
        _draw_payload(meshcat, f"{path}/payload", robot.payload, max(length, least))


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
    """Draw a round bar between two points; nothing where they or their distance is nothing.

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
    if length <= SHORTEST or radius <= 0.0:
        return
    meshcat.SetObject(path, Cylinder(radius, length), Rgba(*colour, opacity))
    meshcat.SetTransform(path, X)


def draw_unit_bar(meshcat: Meshcat, path: str, start: float, end: float) -> None:
    """Draw a grey bar of length 1 along z, to be placed, stretched and coloured.

    Args:
        meshcat: where to draw.
        path: of the bar.
        start: radius at its lower end [m].
        end: radius at its upper end [m].
    """
    grey = Rgba(0.5, 0.5, 0.5)
    if start == end:
        meshcat.SetObject(path, Cylinder(end, 1.0), grey)
    else:
        meshcat.SetTriangleMesh(path, *tapered_bar(start, end), grey)


def bar_pose(start: ArrayLike, end: ArrayLike) -> tuple[RigidTransform, float]:
    """Return the pose of a cylinder along z between two points, and its length [m].

    Between points at the same place it is upright, of the length `SHORTEST`.

    Args:
        start: (3,) [m].
        end: (3,) [m].
    """
    p, q = np.asarray(start, float), np.asarray(end, float)
    length = float(np.linalg.norm(q - p))
    if length <= SHORTEST:
        return RigidTransform(0.5 * (p + q)), SHORTEST
    return RigidTransform(RotationMatrix.MakeFromOneVector(q - p, 2), 0.5 * (p + q)), length


def _light_evenly(meshcat: Meshcat) -> None:
    """Light from all sides, so that colours that stand for numbers keep their meaning."""
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 2.2)
    meshcat.SetProperty("/Lights/FillLight/<object>", "intensity", 0.6)
    for light in ("SpotLight", "PointLightNegativeX", "PointLightPositiveX"):
        meshcat.SetProperty(f"/Lights/{light}/<object>", "intensity", 0.0)


def grid_step(room: Room) -> float:
    """Return the distance of the floor's lines [m], some twenty along the longer side.

    Args:
        room: the robot's.
    """
    return round_step(float((room.high - room.low).max()) / 25.0)


def _floor_of(room: Room) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and highest x, y of the floor [m]: lines of the grid, one beyond the room.

    It is never a narrow strip.
    """
    step = grid_step(room)
    low, high = room.low[:2], room.high[:2]
    more = np.maximum(0.3 * (room.high - room.low).max() - (high - low), 0.0) / 2.0
    return step * (np.floor((low - more) / step + 1e-9) - 1.0), step * (
        np.ceil((high + more) / step - 1e-9) + 1.0
    )


def _axes_of(room: Room) -> tuple[np.ndarray, float]:
    """Return where the axes of W are drawn (3,), a front corner of the floor, and their length."""
    (x0, y0), (x1, y1) = _floor_of(room)
    x, y, _ = _view_of(room)
    step = grid_step(room)
    corner = np.array([x1 if x > 0.0 else x0, y1 if y > 0.0 else y0, room.floor])
    return corner, step * max(1, round(0.06 * room.size / step))


def _view_of(room: Room) -> tuple[float, float, float]:
    """Return the direction from a robot to its viewer, who looks at the wider side."""
    x, y, z = VIEW
    width, depth, _ = room.high - room.low
    return (-y, x, z) if depth > 1.2 * width else VIEW


def _draw_floor(meshcat: Meshcat, room: Room) -> None:
    """Draw a grid under the robot."""
    (x0, y0), (x1, y1) = _floor_of(room)
    step, z = grid_step(room), room.floor
    xs, ys = np.arange(x0, x1 + 0.5 * step, step), np.arange(y0, y1 + 0.5 * step, step)
    start = [(x, y0, z) for x in xs] + [(x0, y, z) for y in ys]
    end = [(x, y1, z) for x in xs] + [(x1, y, z) for y in ys]
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


def _draw_payload(meshcat: Meshcat, path: str, payload: RigidBody, largest: float) -> None:
    """Draw the solid box of a payload's mass and inertia, or a ball where it is a point.

    No side of it is longer than the `largest` [m].
    """
    moments, axes = np.linalg.eigh(payload.inertia)
    squares = 6.0 / payload.mass * (moments.sum() - 2.0 * moments)
    if squares.min() <= 0.0:
        meshcat.SetObject(path, Sphere(0.15 * largest), Rgba(*PAYLOAD))
        meshcat.SetTransform(path, RigidTransform(payload.center_of_mass))
        return
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    sides = np.sqrt(squares)
    meshcat.SetObject(path, Box(*(sides * min(1.0, largest / sides.max()))), Rgba(*PAYLOAD))
    R = RotationMatrix.ProjectToRotationMatrix(axes)
    meshcat.SetTransform(path, RigidTransform(R, payload.center_of_mass))


def _is_rod(points: np.ndarray) -> bool:
    """Return whether points (n, 3) are all on a line."""
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return len(spread) < 2 or bool(spread[1] < 0.01 * spread[0])


def _outline(points: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the edges of the box around points (n, 3), or the rod through them."""
    low, high = points.min(axis=0), points.max(axis=0)
    if _is_rod(points):
        along = points @ np.linalg.svd(points - points.mean(axis=0))[2][0]
        return [(points[along.argmin()], points[along.argmax()])]
    flat = 0.05 * float(np.max(high - low))
    low, high = np.minimum(low, high - flat), np.maximum(high, low + flat)
    corners = [np.where([i & 1, i & 2, i & 4], high, low) for i in range(8)]
    return [(corners[i], corners[i | bit]) for bit in (1, 2, 4) for i in range(8) if not i & bit]
