"""How cables are drawn: their shapes, and colours that stand for tensions."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from cdpr_drake.model.catenary import cable_shape, elastic_catenary
from cdpr_drake.model.kinematics import cable_ends
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import vector_to_pose

SEGMENTS = 8
"""Straight bars that stand for a cable; the sag of one is 1/64 of the cable's."""

CABLE_RADIUS = 0.025
"""Of a robot of CoGiRo's size [m]; a cable's own 2 mm could not be seen."""


def cable_shapes(
    robot: CableRobot, poses: np.ndarray, lengths: np.ndarray, points: int = SEGMENTS + 1
) -> np.ndarray:
    """Return points (n, k, points, 3) [m] in W along the cables of n states, hanging at rest.

    Args:
        robot: the robot.
        poses: (n, 6) [roll, pitch, yaw, x, y, z] (rad, m).
        lengths: (n, k) [m] unstrained, drum run included.
        points: number of points on each cable.

    Raises:
        CableError: a length does not exceed the run from the drum.
    """
    w, cable = robot.weight_per_metre, robot.cable
    shapes = np.empty((len(poses), robot.num_cables, points, 3))
    for shape, pose, length in zip(shapes, poses, lengths, strict=True):
        ends = cable_ends(robot, vector_to_pose(pose))
        state = elastic_catenary(ends.chord, length, w, cable.stiffness, cable.drum_run)
        shape[:] = cable_shape(
            ends.p_WA,
            ends.p_WB,
            state.horizontal_tension,
            -state.force_on_platform[:, 2],
            state.unstrained_span_length,
            w,
            cable.stiffness(state.tension_at_drawing_point),
            points,
        )
    return shapes


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
