"""A robot at rest in a browser, with sliders for pose, payload and gain; see `explore_pose`."""

from __future__ import annotations

import logging
import math
import time

import numpy as np
from numpy.typing import ArrayLike
from pydrake.geometry import Meshcat, MeshcatParams
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.analysis.explore import Snapshot, explore_pose
from cdpr_drake.errors import GeometryError
from cdpr_drake.model.digits import round_step
from cdpr_drake.model.kinematics import CableEnds, cable_ends
from cdpr_drake.model.robot import CableRobot, Pulleys
from cdpr_drake.model.room import room_of
from cdpr_drake.model.rotations import as_pose, pose_to_vector
from cdpr_drake.model.statics import DEFAULT_RULE
from cdpr_drake.show import scene
from cdpr_drake.show.cables import (
    CABLE_RADIUS,
    SEGMENTS,
    cable_shapes,
    hanging_ends,
    linear,
    tension_colours,
)
from cdpr_drake.show.explore_page import HOST, PageServer, panel_html
from cdpr_drake.show.labels import labels_html
from cdpr_drake.show.pulleys import draw_pulley, draw_wrap, groove_depths, swivel_pose, turned

POSE = ("roll [deg]", "pitch [deg]", "yaw [deg]", "x [m]", "y [m]", "z [m]")
"""Names of the sliders of the pose, in the order of a pose vector."""

PAYLOAD, GAIN, STOP = "payload [kg]", "gain [1/s]", "Stop"

TILT, TURN = 30.0, 90.0
"""How far roll and pitch, and yaw, can be dragged [deg]."""

PERIOD = 0.02
"""Time between two looks at the sliders [s]."""

REFUSED = (0.80, 0.15, 0.05)
"""Colour of the platform where it cannot rest, sRGB."""


class Explorer:
    """Draws a robot where the sliders say and tells what there is to tell of it.

    Args:
        robot: the robot, with the payload to begin with.
        pose: X_WP to begin with, or [roll, pitch, yaw, x, y, z] (rad, m).
        cable_model: of the law.
        gain: lambda [1/s] to begin with.
        port: of the page, from 1024 on; Meshcat takes the next one. 0 for any two that are free.
        tensions: one of `model.statics.RULES`.

    Raises:
        ValueError: an unknown cable model or rule, or a gain that is not positive.
        OSError, RuntimeError: a port is taken.
    """

    def __init__(
        self,
        robot: CableRobot,
        pose: RigidTransform | ArrayLike,
        cable_model: str = "SCMWE",
        gain: float = 0.1,
        port: int = 0,
        tensions: str = DEFAULT_RULE,
    ) -> None:
        self._robot, self._cable_model, self._tensions = robot, cable_model, tensions
        self._drawn: CableRobot | None = None
        X_WP = as_pose(pose)
        self.snapshot = self._ask(X_WP, gain)
        self._room = room_of(robot, [X_WP])
        self.meshcat = _meshcat(port + 1 if port else 0)
        over = labels_html(scene.labels_of(robot, self._room))
        title = f"{robot.name} at rest"
        self._page = PageServer(
            title, self.meshcat.port(), port, over, scene.scale_note(robot, self._room)
        )
        scene.draw_surroundings(self.meshcat, robot, self._room, scene.BETWEEN_PANELS)
        scene.draw_platform(self.meshcat, "/refused", robot, self._room, REFUSED, ghost=True)
        self._draw_bars()
        self._add_controls(pose_to_vector(as_pose(pose)), gain)
        self._values: tuple[float, ...] = ()
        self.update()

    @property
    def address(self) -> str:
        """Of the page, for a browser."""
        return self._page.address

    @property
    def stopped(self) -> bool:
        """Whether somebody has clicked on Stop."""
        return self.meshcat.GetButtonClicks(STOP) > 0

    def update(self) -> bool:
        """Ask and draw anew if a slider has moved since the last time; return whether one has."""
        values = tuple(map(self.meshcat.GetSliderValue, (*POSE, PAYLOAD, GAIN)))
        if values == self._values:
            return False
        self._values = values
        pose = np.array([*np.radians(values[:3]), *values[3:6]])
        if abs(values[6] - self._robot.payload.mass) > 1e-9:
            self._robot = self._robot.with_payload(values[6])
        self.snapshot = self._ask(pose, values[7])
        self._draw(self.snapshot)
        return True

    def run(self, idle: float = 0.0) -> str:
        """Follow the sliders until somebody stops it, and return why it ended.

        Args:
            idle: time without a browser [s] after which to end; 0 for never.
        """
        last_seen = time.monotonic()
        while not self.stopped:
            if self.meshcat.GetNumActiveConnections():
                last_seen = time.monotonic()
            elif idle and time.monotonic() - last_seen > idle:
                return f"no browser for {idle:g} s"
            if not self.update():
                time.sleep(PERIOD)
        return "stopped in the browser"

    def close(self) -> None:
        """End both servers.

        Drake aborts the process if Meshcat goes on another thread than it was made on, as it might
        when garbage is collected; so it goes here.
        """
        self._page.close()
        del self.meshcat

    def _ask(self, pose: RigidTransform | ArrayLike, gain: float) -> Snapshot:
        return explore_pose(
            self._robot, pose, self._cable_model, gain=gain, tensions=self._tensions
        )

    def _add_controls(self, pose: np.ndarray, gain: float) -> None:
        fine = _fine(self._room.size / 2000.0)
        low = fine * np.ceil(self._room.low / fine - 1e-9)
        high = fine * np.floor(self._room.high / fine + 1e-9)
        begin = [*np.degrees(pose[:3]), *pose[3:]]
        spans = [(-TILT, TILT, 0.5), (-TILT, TILT, 0.5), (-TURN, TURN, 0.5)]
        spans += [(float(low[i]), float(high[i]), fine) for i in range(3)]
        # Position first: it is what one drags most.
        for i in (3, 4, 5, 0, 1, 2):
            self._add_slider(POSE[i], *spans[i], begin[i])
        mass = self._robot.payload.mass
        most = round_step(max(3.0 * self._robot.platform.mass, 2.0 * mass))
        self._add_slider(PAYLOAD, 0.0, most, _fine(most / 500.0), mass)
        # Meshcat rounds to steps: a small gain needs small ones, not to become another, or zero.
        step = min(0.01, 10.0 ** (math.floor(math.log10(gain)) - 1))
        self._add_slider(GAIN, step, max(5.0, gain), step, gain)
        self.meshcat.AddButton(STOP)

    def _add_slider(self, name: str, low: float, high: float, step: float, value: float) -> None:
        low, high = min(low, value), max(high, value)
        self.meshcat.AddSlider(name, low, high, step, value)

    def _draw_bars(self) -> None:
        """Draw pulleys, and bars of length 1, to be placed and stretched."""
        radius = CABLE_RADIUS * scene.drawing_scale(self._room)
        self._depths = groove_depths(self._robot, radius)
        for cable, depth in enumerate(self._depths):
            for segment in range(SEGMENTS):
                path = _bar_path(cable, segment)
                scene.draw_unit_bar(self.meshcat, path, radius if segment else depth, radius)
            if self._robot.pulley_radii[cable] > 0.0:
                draw_pulley(
                    self.meshcat, _pulley_path(cable), self._robot.pulley_radii[cable], depth
                )

    def _draw(self, snapshot: Snapshot) -> None:
        if snapshot.robot is not self._drawn:
            self.meshcat.Delete("/platform")
            scene.draw_platform(
                self.meshcat, "/platform", snapshot.robot, self._room, scene.PLATFORM
            )
            self._drawn = snapshot.robot
        rests = snapshot.answers is not None
        for path, visible in (("/platform", rests), ("/refused", not rests)):
            self.meshcat.SetProperty(path, "visible", visible)
        for path in ("/platform", "/refused"):
            self.meshcat.SetTransform(path, snapshot.pose)
        limits = (0.0, 1.0)
        if snapshot.answers is not None:
            limits = (0.0, round_step(float(snapshot.answers.tension.max())))
        self._draw_cables(snapshot, limits)
        self._page.panel = panel_html(snapshot, limits)

    def _draw_cables(self, snapshot: Snapshot, limits: tuple[float, float]) -> None:
        """Draw the cables at rest, coloured by tension; where there is no rest, grey chords."""
        robot = snapshot.robot
        if snapshot.answers is None:
            ends = _chords(robot, snapshot.pose)
            along = np.linspace(0.0, 1.0, SEGMENTS + 1)[:, None]
            shapes = ends.p_WA[:, None] + along * np.asarray(ends.chord)[:, None]
            colours = np.full((robot.num_cables, 3), 0.5)
            lengths = robot.cable.drum_run + np.linalg.norm(ends.chord, axis=1)
            if ends.contact is not None:
                lengths = lengths + robot.pulley_radii * ends.contact.theta
        else:
            pose = pose_to_vector(snapshot.pose)[None]
            lengths = snapshot.answers.rest.rest.unstrained_length
            (ends,) = hanging_ends(robot, pose, lengths[None])
            shapes = cable_shapes(robot, pose, lengths[None], ends=[ends])[0]
            colours = linear(tension_colours(snapshot.answers.tension, limits))
        for cable, (points, colour) in enumerate(zip(shapes, colours, strict=True)):
            for segment in range(SEGMENTS):
                path = _bar_path(cable, segment)
                X, length = scene.bar_pose(points[segment], points[segment + 1])
                self.meshcat.SetTransform(path, X)
                self.meshcat.SetProperty(path, "scale", [1.0, 1.0, length])
                self._colour(path, colour)
        self._draw_pulleys(robot, ends, turned(robot, lengths), colours)

    def _draw_pulleys(
        self, robot: CableRobot, ends: CableEnds, angles: np.ndarray, colours: np.ndarray
    ) -> None:
        """Swivel the pulleys, turn them by angles (k,) [rad], and draw the cables round them."""
        for cable in np.flatnonzero(robot.pulley_radii).tolist():
            path, rho = _pulley_path(cable), robot.pulley_radii[cable]
            self.meshcat.SetProperty(path, "visible", ends.contact is not None)
            if ends.contact is None:
                continue
            self.meshcat.SetTransform(path, swivel_pose(robot, ends.contact, cable))
            turn = RigidTransform(RotationMatrix.MakeZRotation(angles[cable]))
            self.meshcat.SetTransform(f"{path}/wheel/turning", turn)
            wrap = ends.contact.theta[cable : cable + 1]
            pieces, _ = draw_wrap(self.meshcat, path, rho, self._depths[cable], wrap)
            for piece in (f"{path}/run", *pieces):
                self._colour(piece, colours[cable])

    def _colour(self, path: str, colour: np.ndarray) -> None:
        self.meshcat.SetProperty(f"{path}/<object>", "color", [*colour.tolist(), 1.0])


def _chords(robot: CableRobot, pose: RigidTransform) -> CableEnds:
    """Return the ends of straight cables, without the pulleys if the platform is inside of one."""
    try:
        return cable_ends(robot, pose)
    except GeometryError:
        return cable_ends(robot.replace(pulleys=Pulleys()), pose)


def _meshcat(port: int) -> Meshcat:
    """Return a Meshcat for this machine only; its own address is not logged: the page has it."""
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(max(log.getEffectiveLevel(), logging.WARNING))
    try:
        return Meshcat(MeshcatParams(host=HOST, port=port, show_stats_plot=False))
    finally:
        log.setLevel(level)


def _bar_path(cable: int, segment: int) -> str:
    return f"/cables/{cable + 1}/{segment + 1}"


def _pulley_path(cable: int) -> str:
    return f"/pulleys/{cable + 1}"


def _fine(step: float) -> float:
    """Return the power of ten next below or at a step of a slider."""
    return float(10.0 ** math.floor(math.log10(step) + 1e-9))
