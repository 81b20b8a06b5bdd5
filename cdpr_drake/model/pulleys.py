"""Where cables leave their pulleys: the NumPy twin of kernels/geometry.py, for all cables at once.

A pulley of radius rho turns about an axis a through its entry point F; its centre is F + rho e.
The cable wraps it by theta and leaves it at A = F + rho (sin(theta) a + (1 - cos(theta)) e), along
t = cos(theta) a + sin(theta) e. A straight cable to B, at the distance R from the axis and y along
it, has e towards B and, with X = R - rho and the free length l = sqrt(X^2 + y^2 - rho^2),

    sin(theta) = (l X + rho y) / (X^2 + y^2),    cos(theta) = (l y - rho X) / (X^2 + y^2)

(the closed form of the usual codes, e.g. Pott, Cable-Driven Parallel Robots, 2018, chapter 7, for
any wrap up to a whole turn). A cable that sags leaves where t is its own tangent.

All functions take AutoDiffXd as well.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cdpr_drake.errors import GeometryError
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array

NEAREST = 1e-9
"""Distance from the axis [m] below which B is on it, in no direction."""


class Contact(NamedTuple):
    """Where all k cables leave, in W.

    Attributes:
        p_WA: (k, 3) [m] where they leave.
        theta: (k,) [rad] by how much they wrap their pulleys, 0 to 2 pi.
        e: (k, 3) unit vectors from the drawing points to the pulleys' centres.
        tangent: (k, 3) unit vectors along which they leave.
        distance: (k,) [m] of the attachment points from the axes.
    """

    p_WA: Array
    theta: Array
    e: Array
    tangent: Array
    distance: Array

    def follows(self, robot: CableRobot, span: Array) -> Array:
        """Return (k, 3, 3): how A moves with B, as a straight cable rolls and swivels after it.

        Args:
            robot: the robot.
            span: (k,) [m] from A to B.
        """
        rho = robot.pulley_radii
        s, c = _dot(self.tangent, self.e), _dot(self.tangent, robot.pulley_axes)
        n = c[:, None] * self.e - s[:, None] * robot.pulley_axes
        aside = np.cross(robot.pulley_axes, self.e)
        roll = (rho / span)[:, None, None] * self.tangent[:, :, None] * n[:, None, :]
        swivel = (rho * (1.0 - c) / self.distance)[:, None, None]
        return roll + swivel * aside[:, :, None] * aside[:, None, :]


def has_pulleys(robot: CableRobot) -> bool:
    """Return whether any cable of a `robot` leaves over a pulley, rather than through an eyelet."""
    return bool(np.any(robot.pulleys.radius))


def contact(robot: CableRobot, p_WB: Array, tangents: Array | None = None) -> Contact:
    """Return where the cables leave.

    Args:
        robot: the robot.
        p_WB: (k, 3) [m] where they attach.
        tangents: (k, 3) unit vectors along which they leave, from A to B; those of straight cables
            if None.

    Raises:
        GeometryError: an attachment point is inside of a pulley; names the cable.
    """
    rho, a = robot.pulley_radii, robot.pulley_axes
    entry_to_B = p_WB - robot.drawing_points
    y = _dot(entry_to_B, a)
    x = entry_to_B - y[:, None] * a
    distance = _norm(x)
    e = np.where(_true(distance > NEAREST)[:, None], x / _above(distance)[:, None], _side(a))
    if tangents is None:
        X = distance - rho
        square = X * X + y * y
        inside = (rho > 0.0) & _true(square <= rho * rho)
        if np.any(inside):
            i = int(np.argmax(inside))
            raise GeometryError(
                f"the attachment point of cable {i + 1} is inside of its pulley, of radius "
                f"{1e3 * rho[i]:g} mm"
            )
        length = np.sqrt(np.where(rho > 0.0, square - rho * rho, 1.0 + 0.0 * square))
        square = np.where(rho > 0.0, square, 1.0 + 0.0 * square)
        s, c = (length * X + rho * y) / square, (length * y - rho * X) / square
    else:
        c = _dot(tangents, a)
        across = tangents - c[:, None] * a
        s = _dot(across, e)
        tilted = np.hypot(a[:, 0], a[:, 1]) > NEAREST  # else the pulley stands in the cable's plane
        size = _norm(across)
        turned = tilted & _true(size > NEAREST)
        s = np.where(turned, np.where(_true(s < 0.0), -size, size), s)
        e = np.where(turned[:, None], across / np.where(turned, s, 1.0)[:, None], e)
    p_WA = robot.drawing_points + rho[:, None] * (s[:, None] * a + (1.0 - c)[:, None] * e)
    tangent = c[:, None] * a + s[:, None] * e
    theta = np.arctan2(s, c)
    theta = np.where(_true(theta < -1e-12), theta + 2.0 * np.pi, theta)
    return Contact(p_WA, np.where(rho > 0.0, theta, 0.0 * theta), e, tangent, _above(distance))


def _dot(a: Array, b: Array) -> Array:
    return (a * b).sum(axis=-1)


def _norm(a: Array) -> Array:
    return np.sqrt((a * a).sum(axis=-1))


def _true(condition: Any) -> NDArray[np.bool_]:
    """Return comparisons of numbers or AutoDiffXd as truth values."""
    return np.asarray(condition, bool)


def _above(distance: Array) -> Array:
    """Return distances that can be divided by."""
    return np.where(_true(distance > NEAREST), distance, NEAREST + 0.0 * distance)


def _side(a: Array) -> Array:
    """Return a unit vector normal to each axis: +x less its part along it; +y for those along x."""
    along_x = np.abs(a[:, 0]) >= 0.9
    side = np.where(along_x[:, None], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])
    side = side - _dot(side, a)[:, None] * a
    return side / _norm(side)[:, None]
