"""The pulleys over which cables leave, drawn at their true size: they swivel, and they turn.

A pulley is drawn in a frame S at its entry point F, with x along e, towards its centre, and z along
its swivel axis a, so that y is the axis of its wheel. The wheel is in a frame at its centre, with x
along e and z along its own axis, about which it turns as cable is paid out. The cable is on it from
the direction -x on, where it enters, by the wrap theta about z.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from pydrake.geometry import Cylinder, Meshcat, Rgba
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.model.pulleys import Contact
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.show import scene
from cdpr_drake.show.frame import BEARING
from cdpr_drake.show.meshes import TriangleMesh, bent_tube, revolved

WHEEL = (0.20, 0.23, 0.27)
MARK = (0.95, 0.75, 0.10)
"""Colours of a wheel and of the spoke that shows how it turns, sRGB."""

SPOKES = 5
"""Of a wheel, the marked one among them."""

DEEPEST = 0.2
"""Depth of the groove at most, over the pulley's radius: of a small pulley on a large robot, whose
cables are drawn thicker than they are."""

RIM = 0.14
"""Thickness of the rim under the groove, over the pulley's radius."""

MOST = 8
"""Pieces at most of the cable round a pulley that move."""


def groove_depths(robot: CableRobot, cable_radius: float) -> np.ndarray:
    """Return the radii (k,) [m] with which cables are drawn where they leave.

    It is the depth of the groove, or where there is no pulley the radius they have elsewhere.

    Args:
        robot: the robot.
        cable_radius: with which they are drawn elsewhere [m].
    """
    radii = robot.pulley_radii
    return np.where(radii > 0.0, np.minimum(cable_radius, DEEPEST * radii), cable_radius)


def draw_pulley(meshcat: Meshcat, path: str, radius: float, depth: float) -> None:
    """Draw a pulley: its wheel, and the fork and bearing that hold it; the frame at `path` is S.

    The wheel is at "wheel", and turns at "wheel/turning". It reaches to the cable's centre line,
    round which the upper half of its groove would be.

    Args:
        meshcat: where to draw.
        path: under which the pieces go.
        radius: rho [m], to the cable's centre line.
        depth: of the groove [m].
    """
    half, rod = 1.25 * depth, 0.06 * radius
    cheek, low = half + 1.5 * rod, -BEARING * radius
    for side in (-1.0, 1.0):
        arm = ([0.0, side * cheek, low], [radius, side * cheek, 0.0])
        scene.draw_bar(meshcat, f"{path}/fork{side:+.0f}", *arm, rod, scene.STEEL)
    bridge = ([0.0, -cheek, low], [0.0, cheek, low])
    scene.draw_bar(meshcat, f"{path}/bridge", *bridge, rod, scene.STEEL)
    axle = ([radius, -cheek, 0.0], [radius, cheek, 0.0])
    scene.draw_bar(meshcat, f"{path}/axle", *axle, 1.2 * rod, scene.STEEL)
    sleeve = ([0.0, 0.0, low - 0.15 * radius], [0.0, 0.0, low + 0.15 * radius])
    scene.draw_bar(meshcat, f"{path}/bearing", *sleeve, 0.06 * radius + depth, scene.STEEL)
    _draw_wheel(meshcat, f"{path}/wheel/turning", radius, depth, half)
    meshcat.SetTransform(f"{path}/wheel", wheel_pose(radius))


def _draw_wheel(meshcat: Meshcat, path: str, radius: float, depth: float, half: float) -> None:
    """Draw a wheel of the width 2 `half` [m]: rim, hub and spokes."""
    bottom = radius - depth
    inside = bottom - RIM * radius
    profile = [[inside, -half], [radius, -half], [bottom, -0.4 * half], [bottom, 0.4 * half]]
    rim = revolved([*profile, [radius, half], [inside, half]])
    meshcat.SetTriangleMesh(f"{path}/rim", *rim, Rgba(*WHEEL))
    meshcat.SetObject(f"{path}/hub", Cylinder(0.2 * radius, 2.0 * half), Rgba(*WHEEL))
    for i in range(SPOKES):
        turn = 2.0 * math.pi * i / SPOKES
        out = np.array([math.cos(turn), math.sin(turn), 0.0])
        name, colour = ("mark", MARK) if i == 0 else (f"spoke{i}", WHEEL)
        ends = (0.15 * radius * out, 1.05 * inside * out)
        scene.draw_bar(meshcat, f"{path}/{name}", *ends, 0.07 * radius, colour)


def draw_wrap(
    meshcat: Meshcat, path: str, radius: float, depth: float, wraps: ArrayLike
) -> tuple[list[str], np.ndarray]:
    """Draw the cable from a pulley's bearing round its wheel, for the wraps of n states.

    What is round the wheel is in pieces. Turned about z of the wheel, each by its angle, they are
    the cable from where it enters to where it leaves; the first does not move.

    Args:
        meshcat: where to draw.
        path: of the pulley, as in `draw_pulley`.
        radius: rho [m].
        depth: of the groove, and radius of the cable there [m].
        wraps: theta (n,) [rad].

    Returns:
        The paths of the pieces, and their angles (n, pieces) [rad].
    """
    run = ([0.0, 0.0, -BEARING * radius], np.zeros(3))
    grey = (0.5, 0.5, 0.5)
    scene.draw_bar(meshcat, f"{path}/run", *run, depth, grey)
    spans, angles = wrap_pieces(wraps)
    paths = [f"{path}/wheel/wrap{i + 1}" for i in range(len(spans))]
    for piece, span in zip(paths, spans, strict=True):
        meshcat.SetTriangleMesh(piece, *wrap_tube(radius, depth, span), Rgba(*grey))
    meshcat.SetTransform(paths[0], RigidTransform(RotationMatrix.MakeZRotation(angles[0, 0])))
    return paths, angles


def wrap_tube(radius: float, depth: float, span: float) -> TriangleMesh:
    """Return a piece of cable in the frame of its wheel; turned by 0 it ends where cable enters.

    Args:
        radius: rho [m].
        depth: radius of the cable [m].
        span: length of the piece [rad].
    """
    return bent_tube(radius, depth, math.pi - span, math.pi)


def wrap_pieces(wraps: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return how the cable round a pulley is put together of pieces that turn, and do not change.

    The first is as long as the least wrap; the others share the rest, and lie over each other and
    the first where the wrap is less than the greatest. They are as many as it takes for none to
    reach back beyond where the cable enters, but no more than `MOST`.

    Args:
        wraps: theta (n,) [rad].

    Returns:
        The lengths (pieces,) [rad], and where they end (n, pieces) [rad].
    """
    theta = np.asarray(wraps, float)
    least, most = float(theta.min()), float(theta.max())
    number = min(MOST, math.ceil((most - least) / max(least, 1e-9)))
    share = np.arange(number + 1) / max(number, 1)
    spans = np.concatenate([[least], np.full(number, (most - least) / max(number, 1))])
    return spans, least + share * (theta - least)[:, None]


def wheel_pose(radius: float) -> RigidTransform:
    """Return the pose in S of a wheel: its centre at (rho, 0, 0), its z along y of S.

    Args:
        radius: rho [m].
    """
    return RigidTransform(RotationMatrix.MakeXRotation(-0.5 * math.pi), [radius, 0.0, 0.0])


def swivel_pose(robot: CableRobot, contact: Contact, cable: int) -> RigidTransform:
    """Return X_WS of a pulley: where its entry point is, and which way it has swivelled.

    Args:
        robot: the robot.
        contact: where the cables leave.
        cable: of the pulley, from 0 on.
    """
    a, e = robot.pulley_axes[cable], contact.e[cable]
    R = RotationMatrix.ProjectToRotationMatrix(np.column_stack([e, np.cross(a, e), a]))
    return RigidTransform(R, robot.drawing_points[cable])


def turned(robot: CableRobot, lengths: ArrayLike) -> np.ndarray:
    """Return by how much wheels have turned about their z (..., k) [rad]: the cable paid out / rho.

    Zero is where no cable would be out; 0 for a cable without a pulley. What a cable has stretched
    by when it passes, a thousandth, is left out.

    Args:
        robot: the robot.
        lengths: (..., k) [m] unstrained, drum run included.
    """
    radii = robot.pulley_radii
    wheels = radii > 0.0
    return np.where(wheels, lengths, 0.0) / np.where(wheels, radii, 1.0)
