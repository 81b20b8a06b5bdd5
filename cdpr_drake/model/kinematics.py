"""Where the cables are at a pose, and how that changes with the platform's twist (section 3, A.1).

Twists are [omega; v] (Drake's order; the paper's is the reverse): the angular velocity of the
platform and the velocity of its origin, the paper's E, expressed in the frame of the geometry.

All functions of this module take AutoDiffXd as well: a pose vector of them, a pose in them, a
geometry at such a pose.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.model.pulleys import Contact, contact, has_pulleys
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, as_pose, numbers, skew

MIN_HORIZONTAL_SPAN = 1e-12
"""Smallest Bx / L: a cable that hangs vertically has no plane, and is given one."""


class CableEnds(NamedTuple):
    """Where all k cables leave the frame and reach the platform, in W.

    Attributes:
        p_WA: (k, 3) [m] where they leave.
        p_WB: (k, 3) [m] where they attach.
        EB: (k, 3) [m] from the platform's origin to the attachment points.
        contact: with the pulleys; None for a robot that has none.
    """

    p_WA: Array
    p_WB: Array
    EB: Array
    contact: Contact | None = None

    @property
    def chord(self) -> Array:
        """From where the cables leave to where they attach (k, 3) [m]."""
        return self.p_WB - self.p_WA


def cable_ends(
    robot: CableRobot, pose: RigidTransform | ArrayLike, tangents: ArrayLike | None = None
) -> CableEnds:
    """Return the ends of all cables at a pose.

    The one place that knows; `kernels/geometry.py` is the same for the kernels.

    Args:
        robot: the robot.
        pose: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        tangents: (k, 3) unit vectors at the drawing points, from A to B, which say where cables
            leave their pulleys; those of straight cables if None.

    Raises:
        GeometryError: an attachment point is inside of a pulley; names the cable.
    """
    X_WP = as_pose(pose)
    EB = robot.attachment_points @ X_WP.rotation().matrix().T
    p_WB = EB + X_WP.translation()
    if not has_pulleys(robot):
        return CableEnds(robot.drawing_points, p_WB, EB)
    found = contact(robot, p_WB, None if tangents is None else numbers(tangents))
    return CableEnds(found.p_WA, p_WB, EB, found)


@dataclass(frozen=True, kw_only=True)
class CableGeometry:
    """The chords of all k cables at one pose; vectors are expressed in a frame F (W by default).

    Attributes:
        EB: (k, 3) [m] from the platform's origin to the attachment points.
        AB: (k, 3) [m] from where the cables leave to the attachment points.
        L: (k,) [m] length of the chord AB.
        u: (k, 3) unit vector of the chord, from A to B.
        Bx: (k,) [m] horizontal component of AB in the cable's plane, positive.
        Bz: (k,) [m] vertical component of AB, positive up.
        gamma: (k,) [rad] angle of the cable's plane about the vertical (eq. 1).
        x_A: (k, 3) horizontal unit vector in the cable's plane, from A towards B.
        y_A: (k, 3) horizontal unit vector normal to the cable's plane.
        z: (3,) unit vector pointing up.
        R_FP: (3, 3) orientation of the platform in F.
        AB_by_B: (k, 3, 3) change of AB with the attachment point: 1, but for a pulley that follows.
        arc: (k,) [m] length of cable round the pulley.
    """

    EB: Array
    AB: Array
    L: Array
    u: Array
    Bx: Array
    Bz: Array
    gamma: Array
    x_A: Array
    y_A: Array
    z: Array
    R_FP: Array
    AB_by_B: Array
    arc: Array


def cable_geometry(
    robot: CableRobot,
    pose: RigidTransform | ArrayLike,
    R_FW: ArrayLike | None = None,
    tangents: ArrayLike | None = None,
) -> CableGeometry:
    """Return the chords of all cables at a pose (eqs. 1, 5, 15).

    Args:
        robot: the robot.
        pose: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        R_FW: (3, 3) rotation to the frame F in which vectors are wanted, e.g. that of the paper's
            F_f; W itself if None.
        tangents: as in `cable_ends`.

    Raises:
        GeometryError: an attachment point is inside of a pulley; names the cable.
    """
    X_WP = as_pose(pose)
    ends = cable_ends(robot, X_WP, tangents)
    AB = ends.chord
    L = np.sqrt((AB * AB).sum(axis=1))
    Bx = np.maximum(_hypot(AB[:, 0], AB[:, 1]), MIN_HORIZONTAL_SPAN * L)
    gamma = np.arctan2(AB[:, 1], AB[:, 0])
    zero = 0.0 * gamma
    x_A = np.column_stack([np.cos(gamma), np.sin(gamma), zero])
    y_A = np.column_stack([-np.sin(gamma), np.cos(gamma), zero])
    R = np.eye(3) if R_FW is None else np.asarray(R_FW, float)
    AB_by_B = np.broadcast_to(np.eye(3), (len(L), 3, 3))
    arc = np.zeros(len(L))
    if ends.contact is not None:
        AB_by_B = R @ (AB_by_B - ends.contact.follows(robot, L)) @ R.T
        arc = robot.pulley_radii * ends.contact.theta
    return CableGeometry(
        EB=ends.EB @ R.T,
        AB=AB @ R.T,
        L=L,
        u=(AB / L[:, None]) @ R.T,
        Bx=Bx,
        Bz=AB[:, 2],
        gamma=gamma,
        x_A=x_A @ R.T,
        y_A=y_A @ R.T,
        z=R[:, 2],
        R_FP=R @ X_WP.rotation().matrix(),
        AB_by_B=AB_by_B,
        arc=arc,
    )


def _hypot(x: Array, y: Array) -> Array:
    """Return the length of (x, y): np.hypot, which does not know AutoDiffXd."""
    return np.sqrt(x * x + y * y) if x.dtype == object else np.hypot(x, y)


def D_Bf(geometry: CableGeometry) -> Array:
    """Return (k, 3, 6): velocity of each attachment point for a twist [omega; v] (A.1).

    Args:
        geometry: the chords at a pose.
    """
    k = len(geometry.L)
    return np.concatenate([-skew(geometry.EB), np.broadcast_to(np.eye(3), (k, 3, 3))], axis=2)


def D_AB(geometry: CableGeometry) -> Array:
    """Return (k, 3, 6): rate of each chord for a twist [omega; v], that of A with it.

    Args:
        geometry: the chords at a pose.
    """
    return geometry.AB_by_B @ D_Bf(geometry)


def D_u(geometry: CableGeometry) -> Array:
    """Return (k, 3, 6): rate of each chord's unit vector for a twist [omega; v] (A.1).

    Args:
        geometry: the chords at a pose.
    """
    u = geometry.u
    normal = np.eye(3) - u[:, :, None] * u[:, None, :]
    return normal @ D_AB(geometry) / geometry.L[:, None, None]


def gamma_row(geometry: CableGeometry) -> Array:
    """Return (k, 6): rate of the cable plane's angle gamma for a twist [omega; v] (A.1).

    Args:
        geometry: the chords at a pose.
    """
    return np.einsum("ki,kij->kj", geometry.y_A, D_AB(geometry)) / geometry.Bx[:, None]


def D_gamma(geometry: CableGeometry) -> Array:
    """Return (k, 3, 6): angular velocity of each cable's plane for a twist [omega; v] (A.1).

    Args:
        geometry: the chords at a pose.
    """
    return geometry.z[None, :, None] * gamma_row(geometry)[:, None, :]


def D_B(geometry: CableGeometry) -> Array:
    """Return (k, 3, 6): rate of (Bx, 0, Bz) in each cable's frame for a twist [omega; v] (A.1).

    The second row is zero: a cable stays in its own plane.

    Args:
        geometry: the chords at a pose.
    """
    velocity = D_AB(geometry)
    D = 0.0 * velocity
    D[:, 0] = np.einsum("ki,kij->kj", geometry.x_A, velocity)
    D[:, 2] = np.einsum("i,kij->kj", geometry.z, velocity)
    return D


def D_t(R_FM: ArrayLike, p_EM: ArrayLike) -> Array:
    """Return (6, 6): twist of E in F for a twist [omega; v] of M in M (eq. 19).

    Args:
        R_FM: (3, 3) orientation of the target frame in F.
        p_EM: (3,) [m] from E to M, expressed in M.
    """
    R = numbers(R_FM)
    D = np.zeros((6, 6)) + 0.0 * R[0, 0]
    D[:3, :3] = R
    D[3:, :3] = R @ skew(p_EM)
    D[3:, 3:] = R
    return D
