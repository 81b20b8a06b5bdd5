"""A run as a page that a browser plays without a server: platform, cables, goal, other runs."""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from pydrake.geometry import Meshcat, MeshcatAnimation, MeshcatParams
from pydrake.math import RigidTransform

from cdpr_drake.diagrams import Record
from cdpr_drake.model.digits import significant
from cdpr_drake.model.kinematics import CableEnds
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.room import Room, room_of
from cdpr_drake.model.rotations import as_pose, vector_to_pose
from cdpr_drake.model.servo import pose_error
from cdpr_drake.show import scene
from cdpr_drake.show.cables import (
    CABLE_RADIUS,
    SEGMENTS,
    cable_shapes,
    css,
    hanging_ends,
    linear,
    tension_colours,
)
from cdpr_drake.show.overlay import Legend, add_legend
from cdpr_drake.show.pulleys import (
    draw_pulley,
    draw_wrap,
    groove_depths,
    swivel_pose,
    turned,
)

Colour = tuple[float, float, float]

LONGEST_PLAYBACK = 20.0
"""Longer runs are shown faster, in whole multiples, to last no longer than this [s]."""

PATH_RADIUS = 0.012
"""Of a robot of CoGiRo's size [m]."""

COLOUR_PERIOD = 5
"""Frames between two recorded colours; the player interpolates."""


def write_replay(
    path: str | os.PathLike[str],
    robot: CableRobot,
    record: Record,
    goal: RigidTransform | ArrayLike | None = None,
    *,
    others: Mapping[str, Record] | None = None,
    speed: float | None = None,
    title: str = "Cable robot replay",
    frames_per_second: int = 10,
) -> Path:
    """Write a run as one HTML file, played in a browser without a server or network.

    Cables are elastic catenaries between the recorded ends with the recorded lengths, coloured by
    the tension at the drawing point. From pulleys they leave along the recorded tangents, if there
    are any; pulleys swivel with them, and turn as the lengths say. "#t=12.5" at the end of the
    page's address stops the replay at that time of the run. Frames show recorded states; the player
    interpolates between them.

    Args:
        path: of the file, which is replaced if it exists.
        robot: the true robot.
        record: the run.
        goal: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m), drawn as a ghost.
        others: other runs by label, whose platforms are drawn as ghosts.
        speed: playback over real time; by default as little as keeps it to 20 s.
        title: of the page.
        frames_per_second: recorded frames per second of playback.

    Raises:
        ValueError: the record lacks a signal, or has no duration; the goal is no pose.
        OSError: the file cannot be written.
    """
    others = others or {}
    _check(record, others)
    goal = None if goal is None else as_pose(goal)
    pace = default_speed(record.time) if speed is None else speed
    frames = frame_times(record.time, pace, frames_per_second)
    index = nearest(record.time, frames)
    tension = record["tension_at_drawing_point"][index]
    limits = _nice_range(tension)

    meshcat = _quiet_meshcat()
    animation = MeshcatAnimation(frames_per_second)
    animation.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    animation.set_repetitions(10_000)
    poses = [X_WP for run in (record, *others.values()) for X_WP in _some_poses(run)]
    room = room_of(robot, poses if goal is None else [*poses, goal])
    scene.draw_surroundings(meshcat, robot, room, scene.BESIDE_LEGEND)
    colours = tension_colours(tension, limits)
    entries = _add_run(meshcat, animation, robot, room, record, index, colours)
    if goal is not None:
        scene.draw_platform(meshcat, "/goal", robot, room, scene.GOAL, ghost=True)
        meshcat.SetTransform("/goal", goal)
        entries.append(("goal", scene.GOAL))
    for number, (label, other) in enumerate(others.items(), start=1):
        colour = _add_other(meshcat, animation, robot, room, other, frames, number)
        entries.append((label, colour))
    entries.append(("fixed camera", scene.CAMERA))
    meshcat.SetAnimation(animation)

    legend = Legend(
        title=title,
        subtitle=f"{robot.name}, {robot.num_cables} cables, {significant(robot.mass)} kg",
        time=frames,
        frames_per_second=frames_per_second,
        speed=pace,
        tension=tension,
        tension_range=limits,
        colours=[css(c) for c in tension_colours(np.linspace(*limits, 17), limits)],
        errors=None if goal is None else _errors(robot, record["pose"][index], goal),
        entries=[(label, css(colour)) for label, colour in entries],
        note=scene.scale_note(robot, room),
        labels=scene.labels_of(robot, room),
    )
    file = Path(path)
    file.write_text(add_legend(meshcat.StaticHtml(), legend), encoding="utf-8")
    return file


def default_speed(time: np.ndarray) -> float:
    """Return the lowest whole speed at which a run lasts no longer than `LONGEST_PLAYBACK`.

    Args:
        time: (n,) [s] of the record.
    """
    return float(max(1, math.ceil((time[-1] - time[0]) / LONGEST_PLAYBACK - 1e-9)))


def frame_times(time: np.ndarray, speed: float, frames_per_second: int) -> np.ndarray:
    """Return the times of the frames [s], from the first to the last of a record.

    Args:
        time: (n,) [s] of the record.
        speed: playback over real time.
        frames_per_second: of playback.

    Raises:
        ValueError: a speed or a number of frames that is not positive.
    """
    if not (math.isfinite(speed) and speed > 0.0 and frames_per_second > 0):
        raise ValueError(
            f"speed and frames per second must be positive, got {speed}, {frames_per_second}"
        )
    step = speed / frames_per_second
    count = math.ceil((time[-1] - time[0]) / step - 1e-9) + 1
    return np.minimum(time[0] + step * np.arange(count), time[-1])


def nearest(time: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return the indices of the samples nearest to some times.

    Args:
        time: (n,) [s], rising.
        wanted: (m,) [s].
    """
    right = np.clip(np.searchsorted(time, wanted), 1, len(time) - 1)
    return right - (wanted - time[right - 1] < time[right] - wanted)


def _some_poses(record: Record) -> list[RigidTransform]:
    """Return X_WP at some fifty samples of a record, and at the last."""
    poses = record["pose"]
    return [vector_to_pose(p) for p in (*poses[:: max(1, len(poses) // 50)], poses[-1])]


def _quiet_meshcat() -> Meshcat:
    """Return a Meshcat on a free port; nobody is to connect to it, so its address is not logged."""
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(max(log.getEffectiveLevel(), logging.WARNING))
    try:
        return Meshcat(MeshcatParams(host="localhost", port=0))
    finally:
        log.setLevel(level)


def _check(record: Record, others: Mapping[str, Record]) -> None:
    for name in ("pose", "unstrained_length", "tension_at_drawing_point"):
        if name not in record.signals:
            raise ValueError(f'the record has no signal "{name}", which the replay shows')
    for label, run in {"the record": record, **others}.items():
        if "pose" not in run.signals:
            raise ValueError(f'{label}: no signal "pose", which the replay shows')
        if len(run.time) < 2:
            raise ValueError(f"{label}: {len(run.time)} samples, a replay needs two at least")


def _add_run(
    meshcat: Meshcat,
    animation: MeshcatAnimation,
    robot: CableRobot,
    room: Room,
    record: Record,
    index: np.ndarray,
    colours: np.ndarray,
) -> list[tuple[str, Colour]]:
    """Draw and animate platform, cables and pulleys at some samples; return the legend's entries.

    The cables have colours (n, k, 3) at these samples.
    """
    poses = record["pose"]
    scale = scene.drawing_scale(room)
    scene.draw_platform(meshcat, "/run/platform", robot, room, scene.PLATFORM)
    _animate_body(animation, "/run/platform", poses[index])
    scene.draw_path(meshcat, "/run/path", poses[:, 3:], PATH_RADIUS * scale, scene.PLATFORM)
    poses, lengths = poses[index], record["unstrained_length"][index]
    tangents = record.signals.get("tangents_at_drawing_point")
    ends = hanging_ends(robot, poses, lengths, None if tangents is None else tangents[index])
    radius = CABLE_RADIUS * scale
    depths = groove_depths(robot, radius)
    shapes = cable_shapes(robot, poses, lengths, ends=ends)
    _animate_cables(meshcat, animation, shapes, radius, depths)
    angles = turned(robot, lengths)
    wraps = _animate_pulleys(meshcat, animation, robot, ends, angles, depths)
    _animate_colours(animation, colours, wraps)
    entries: list[tuple[str, Colour]] = [("platform and its path", scene.PLATFORM)]
    if robot.payload.mass > 0.0:
        entries.append((f"payload, {significant(robot.payload.mass)} kg", scene.PAYLOAD))
    return entries


def _add_other(
    meshcat: Meshcat,
    animation: MeshcatAnimation,
    robot: CableRobot,
    room: Room,
    record: Record,
    frames: np.ndarray,
    number: int,
) -> Colour:
    """Draw and animate the platform of another run as a ghost, and return its colour."""
    colour = scene.GHOSTS[(number - 1) % len(scene.GHOSTS)]
    root, radius = f"/other{number}", PATH_RADIUS * scene.drawing_scale(room)
    scene.draw_platform(meshcat, f"{root}/platform", robot, room, colour, ghost=True, faces=False)
    poses = record["pose"]
    _animate_body(animation, f"{root}/platform", poses[nearest(record.time, frames)])
    scene.draw_path(meshcat, f"{root}/path", poses[:, 3:], radius, colour)
    return colour


def _animate_body(animation: MeshcatAnimation, path: str, poses: np.ndarray) -> None:
    for frame, pose in enumerate(poses):
        animation.SetTransform(frame, path, vector_to_pose(pose))


def _animate_cables(
    meshcat: Meshcat,
    animation: MeshcatAnimation,
    shapes: np.ndarray,
    radius: float,
    depths: np.ndarray,
) -> None:
    """Draw bars of length 1, which the animation places and stretches.

    Cables are as thin where they leave as the grooves (k,) [m] of pulleys are deep.
    """
    frames, cables, points, _ = shapes.shape
    for cable in range(cables):
        for segment in range(points - 1):
            path = _segment_path(cable, segment)
            scene.draw_unit_bar(meshcat, path, radius if segment else depths[cable], radius)
            for frame in range(frames):
                X, length = scene.bar_pose(*shapes[frame, cable, segment : segment + 2])
                animation.SetTransform(frame, path, X)
                animation.SetProperty(frame, path, "scale", [1.0, 1.0, length])


def _animate_pulleys(
    meshcat: Meshcat,
    animation: MeshcatAnimation,
    robot: CableRobot,
    ends: list[CableEnds],
    angles: np.ndarray,
    depths: np.ndarray,
) -> dict[int, list[str]]:
    """Draw pulleys that swivel, and turn by angles (n, k) [rad], and the cables round them.

    A wheel may turn more than once from frame to frame: the player interpolates between angles, as
    it could not between orientations. Returned are the paths of the cables round the pulleys.
    """
    contacts = [end.contact for end in ends if end.contact is not None]
    wraps: dict[int, list[str]] = {}
    for cable in np.flatnonzero(robot.pulley_radii).tolist():
        path, rho = f"/run/pulley{cable + 1}", robot.pulley_radii[cable]
        draw_pulley(meshcat, path, rho, depths[cable])
        theta = [contact.theta[cable] for contact in contacts]
        pieces, ends_at = draw_wrap(meshcat, path, rho, depths[cable], theta)
        for frame, contact in enumerate(contacts):
            animation.SetTransform(frame, path, swivel_pose(robot, contact, cable))
            wheel = f"{path}/wheel/turning"
            animation.SetProperty(frame, wheel, "rotation[z]", float(angles[frame, cable]))
            for piece, angle in list(zip(pieces, ends_at[frame], strict=True))[1:]:
                animation.SetProperty(frame, piece, "rotation[z]", float(angle))
        wraps[cable] = [f"{path}/run", *pieces]
    return wraps


def _animate_colours(
    animation: MeshcatAnimation, colours: np.ndarray, wraps: Mapping[int, list[str]]
) -> None:
    """Record colours (n, k, 3) of the cables, at some frames and the last.

    Every track must end at the last frame: each loops by itself.
    """
    last = len(colours) - 1
    values = linear(colours)
    for frame in sorted({*range(0, last, COLOUR_PERIOD), last}):
        for cable, colour in enumerate(values[frame]):
            paths = [_segment_path(cable, segment) for segment in range(SEGMENTS)]
            for path in paths + wraps.get(cable, []):
                animation.SetProperty(frame, f"{path}/<object>", "material.color", colour.tolist())


def _segment_path(cable: int, segment: int) -> str:
    return f"/run/cable{cable + 1}/{segment + 1}"


def _errors(robot: CableRobot, poses: np.ndarray, goal: RigidTransform) -> np.ndarray:
    """Return distance [m] and angle [rad] (n, 2) of the target frame to the goal."""
    X_PM = robot.cameras.X_PM
    s = np.array([pose_error(vector_to_pose(pose), goal, X_PM) for pose in poses])
    return np.column_stack([np.linalg.norm(s[:, 3:], axis=1), np.linalg.norm(s[:, :3], axis=1)])


def _nice_range(tension: np.ndarray) -> tuple[float, float]:
    """Return limits of a colour scale [N], multiples of a power of ten that the range asks for."""
    low, high = float(tension.min()), float(tension.max())
    span = high - low if high - low > 1e-6 * abs(high) else max(abs(high), 1e-6)
    step = 10.0 ** math.floor(math.log10(0.5 * span))
    first, last = math.floor(low / step), math.ceil(high / step)
    return step * first, step * max(last, first + 1)
