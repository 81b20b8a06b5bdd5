"""How cables are drawn: their shapes, and colours that stand for tensions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from cdpr_drake.model.cables import CableSet
from cdpr_drake.model.catenary import CableState, cable_shape, elastic_catenary
from cdpr_drake.model.kinematics import CableEnds, cable_ends
from cdpr_drake.model.pulleys import has_pulleys
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import vector_to_pose

SEGMENTS = 8
"""Straight bars that stand for a cable; the sag of one is 1/64 of the cable's."""

CABLE_RADIUS = 0.025
"""Of a robot of CoGiRo's size [m]; a cable's own 2 mm could not be seen."""


def hanging_ends(
    robot: CableRobot,
    poses: np.ndarray,
    lengths: np.ndarray,
    tangents: np.ndarray | None = None,
) -> list[CableEnds]:
    """Return the ends of the cables in n states; from pulleys they leave as they hang at rest.

    Args:
        robot: the robot.
        poses: (n, 6) [roll, pitch, yaw, x, y, z] (rad, m).
        lengths: (n, k) [m] unstrained, drum run included.
        tangents: (n, 3 k) unit vectors along which the cables leave, where they are known.

    Raises:
        EquilibriumError: a cable over a pulley has no catenary; names it.
    """
    known = [None] * len(poses) if tangents is None else tangents.reshape(len(poses), -1, 3)
    cables, found = CableSet(robot), []
    for pose, length, tangent in zip(poses, lengths, known, strict=True):
        X_WP = vector_to_pose(pose)
        if tangent is None and has_pulleys(robot):
            tangent = cables.balance(X_WP, length)[2][:, 5:8]
        found.append(cable_ends(robot, X_WP, tangent))
    return found


def cable_shapes(
    robot: CableRobot,
    poses: np.ndarray,
    lengths: np.ndarray,
    points: int = SEGMENTS + 1,
    ends: Sequence[CableEnds] | None = None,
) -> np.ndarray:
    """Return points (n, k, points, 3) [m] in W along the cables of n states, hanging at rest.

    They begin where the cables leave their pulleys, if there are any.

    Args:
        robot: the robot.
        poses: (n, 6) [roll, pitch, yaw, x, y, z] (rad, m).
        lengths: (n, k) [m] unstrained, drum run included.
        points: number of points on each cable.
        ends: of the cables in these states; `hanging_ends` if None.

    Raises:
        CableError: a length does not exceed the run from the drum.
        EquilibriumError: a cable over a pulley has no catenary; names it.
    """
    ends = hanging_ends(robot, poses, lengths) if ends is None else ends
    w, cable = robot.weight_per_metre, robot.cable
    shapes = np.empty((len(poses), robot.num_cables, points, 3))
    for shape, length, end in zip(shapes, lengths, ends, strict=True):
        state = _hanging(robot, end, length)
        shape[:] = cable_shape(
            end.p_WA,
            end.p_WB,
            state.horizontal_tension,
            -state.force_on_platform[:, 2],
            state.unstrained_span_length,
            w,
            cable.stiffness(state.tension_at_drawing_point),
            points,
        )
    return shapes


def _hanging(robot: CableRobot, ends: CableEnds, length: np.ndarray) -> CableState:
    """Return the state of cables at rest; the run from the drum goes on round the pulley."""
    cable, run = robot.cable, robot.cable.drum_run
    if ends.contact is not None:
        run = run + robot.pulley_radii * ends.contact.theta
    return elastic_catenary(ends.chord, length, robot.weight_per_metre, cable.stiffness, run)


def tension_colours(tension: np.ndarray, limits: tuple[float, float]) -> np.ndarray:
    """Return sRGB colours (..., 3) of tensions: dark blue for low, by purple to orange for high.

    Args:
        tension: (...) [N].
        limits: tensions of the two ends of the scale [N].
    """
    from matplotlib import colormaps

    low, high = limits
    part = np.clip((tension - low) / (high - low), 0.0, 1.0)
    return colormaps["plasma"](0.85 * part)[..., :3]


def linear(colours: np.ndarray) -> np.ndarray:
    """Return `colours` (..., 3), sRGB, linear in light, as properties in three.js hold them.

    It decodes the colour of an object, but none that is set as a property.
    """
    return np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)


def css(colour: ArrayLike) -> str:
    """Return a `colour` (3,), sRGB, as "#rrggbb"."""
    return "#" + "".join(f"{round(255 * float(c)):02x}" for c in np.asarray(colour))
