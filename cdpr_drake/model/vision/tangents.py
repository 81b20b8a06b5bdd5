"""Tangents to the cables where they leave the frame, from stereo pairs (section 4.2, eq. 17)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform

from cdpr_drake.model.arrays import RobotArrays
from cdpr_drake.model.kinematics import CableEnds, cable_ends
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.vision.cameras import observers
from cdpr_drake.model.vision.targets import pack_camera

FLATTEST_CROSSING = 0.02
"""Planes that meet at an angle with a smaller sine give no direction [-]: normals known to 0.2 mrad
would leave it uncertain by 10 mrad."""

FARTHEST_ASIDE = 0.1
"""A cable hangs in the vertical plane of A and B: a direction farther out of it is wrong [-]."""

LEAST_TENSION = 0.1
"""Part of the cable's min_tension below which a measured tension is not believed [-]: a dead load
cell must not bend the cable that the images are compared with."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TangentEstimate:
    """Measured tangents of k cables.

    Attributes:
        tangents: (k, 3), unit, from A to B, in W; without meaning where not valid.
        valid: (k,), whether a cable was seen well enough.
        curvature_bias: (k,) [rad], angle between the tangent at A and the line laid through the
            sagging piece of cable that the pair sees; the tangents are free of it.
    """

    tangents: Array
    valid: NDArray[np.bool_]
    curvature_bias: Array


class StereoGeometry:
    """The cables of a robot and, for each, the two cameras that see it, packed for the kernels.

    Attributes:
        robot: the robot.
        pairs: (k,), the index of the stereo pair that sees each cable.
        lefts: (k, 21), its left cameras, packed.
        rights: (k, 21), its right cameras, packed.
        sizes: (k, 2, 2) [px], width and height of left and right images.
        stations: (n,) [m], where edges are looked at, from where it leaves along the cable.
        radius: of the cable [m].
        points: (4, k, 3), `RobotArrays.points`.
        shape: (k, 2, 2, n), of what is seen: by cable, camera, edge and station.

    Args:
        robot: the robot.

    Raises:
        RobotFileError: a cable is seen by no stereo pair, or by two.
    """

    def __init__(self, robot: CableRobot) -> None:
        from cdpr_drake.model.kernels import stereo as kernel

        self.kernel = kernel
        self.robot = robot
        setup = robot.cameras
        self.pairs = observers(robot)
        pairs = [setup.stereo_pairs[i] for i in self.pairs]
        X_WL = [setup.X_WF @ pair.X_FL for pair in pairs]
        self.lefts = np.array([pack_camera(X, p.left) for X, p in zip(X_WL, pairs, strict=True)])
        self.rights = np.array(
            [pack_camera(X @ p.X_LR, p.right) for X, p in zip(X_WL, pairs, strict=True)]
        )
        self.sizes = np.array(
            [[(c.width, c.height) for c in (p.left, p.right)] for p in pairs], float
        )
        start, end = setup.cable_segment
        self.stations = np.linspace(float(start), float(end), setup.edge_points)
        self.radius = 0.5 * robot.cable.diameter
        self.points = RobotArrays(robot).points
        self.shape = (robot.num_cables, 2, 2, setup.edge_points)

    def stiffness(self, tension: Array) -> Array:
        """Return EA (k,) [N] at tensions (k,) [N], at the drawing points.

        Args:
            tension: those.
        """
        return np.broadcast_to(self.robot.cable.stiffness(tension), tension.shape).copy()

    def believable(self, tension: ArrayLike) -> Array:
        """Return measured tensions (k,) [N], those of dead load cells raised to a floor.

        Args:
            tension: (k,) [N].
        """
        floor = LEAST_TENSION * self.robot.cable.min_tension + 1e-3
        return np.maximum(np.asarray(tension, float), floor)

    def leaving(self, tangents: Array) -> Array:
        """Return where cables leave (k, 3) [m], in W: the drawing points, or off their pulleys.

        A camera knows no pose; a cable's tangent says how far it wraps its pulley, and which way
        the pulley faces, up to half a turn of wrap: attachment points must stay farther than the
        pulley's diameter from its axis.

        Args:
            tangents: (k, 3), unit, there, from A to B, in W.
        """
        p_WA = np.empty((len(tangents), 3))
        self.kernel.leave(self.points, tangents, p_WA)
        return p_WA

    def ends(self, X_WP: RigidTransform) -> CableEnds:
        """Return the ends of all cables at a pose, as if they were straight.

        Args:
            X_WP: pose of the platform.
        """
        return cable_ends(self.robot, X_WP)


class CableImages:
    """The images of the cables near their drawing points: both edges of each, in both cameras.

    A cable is the curved elastic catenary, of the robot's diameter; its edges are seen at
    `edge_points` stations along the robot's `cable_segment`, from where it leaves the frame, each
    disturbed across the edge. Cables and pulleys hide nothing of each other.

    Args:
        robot: the true robot.

    Raises:
        RobotFileError: a cable is seen by no stereo pair, or by two.
    """

    def __init__(self, robot: CableRobot) -> None:
        self._stereo = StereoGeometry(robot)
        self._sigma = robot.cameras.line_noise
        self.pairs = self._stereo.pairs

    @property
    def noise_size(self) -> int:
        """The length of the noise vector of one frame."""
        return int(np.prod(self._stereo.shape))

    def __call__(
        self, tangents: ArrayLike, tension: ArrayLike, noise: Array | None = None
    ) -> Array:
        """Return pixels (k, 2, 2, n, 2): by cable, camera (left, right), edge and station.

        NaN marks points outside of the image.

        Args:
            tangents: (k, 3), unit, at the drawing points, from A to B, in W.
            tension: (k,) [N], at the drawing points.
            noise: (noise_size,) standard normal, scaled by the robot's line noise; none if None.
        """
        s = self._stereo
        T = np.array(tension, float)
        u = np.array(tangents, float).reshape(-1, 3)
        images = np.empty((*s.shape, 2))
        s.kernel.see(
            s.points, u, T, s.robot.weight_per_metre, s.stiffness(T), s.radius, s.stations,
            s.lefts, s.rights, s.sizes, images,
        )  # fmt: skip
        if noise is not None:
            s.kernel.shake(images, np.reshape(noise, s.shape), self._sigma)
        return images


class TangentEstimator:
    """Estimates the cables' tangents at their drawing points from images of stereo pairs.

    A line is fitted to each edge in each image; it and the camera's centre span a plane, and the
    plane midway of both edges holds the cable. The planes of both cameras meet in its direction
    (eq. 17), u = n_l x n_r / |n_l x n_r|, with both normals in W and the sign that the pose gives.
    What meets there is a line laid through a sagging piece of cable; the tangent at A follows with
    the measured tension, by comparing with the piece computed. A pulley moves A with the tangent,
    and so it does that of the piece computed.

    Args:
        robot: the robot as the controller believes it.

    Raises:
        RobotFileError: a cable is seen by no stereo pair, or by two.
    """

    def __init__(self, robot: CableRobot) -> None:
        self._stereo = StereoGeometry(robot)

    def __call__(self, images: Array, tension: ArrayLike, X_WP: RigidTransform) -> TangentEstimate:
        """Return the tangents.

        Args:
            images: (k, 2, 2, n, 2) [px], as `CableImages` gives them.
            tension: (k,) [N], measured, at the drawing points.
            X_WP: measured pose of the platform; the sign of the tangents follows from it.
        """
        s = self._stereo
        k = s.robot.num_cables
        chords = s.ends(X_WP).chord
        T = s.believable(tension)
        tangents, sines, bias = np.zeros((k, 3)), np.empty(k), np.empty(k)
        s.kernel.measure(
            np.ascontiguousarray(images), chords, s.points, T, s.robot.weight_per_metre,
            s.stiffness(T), s.radius, s.stations, s.lefts, s.rights, tangents, sines, bias,
        )  # fmt: skip
        across = np.column_stack([-chords[:, 1], chords[:, 0]])
        across /= np.maximum(np.linalg.norm(across, axis=1), 1e-9)[:, None]
        aside = np.abs(np.sum(tangents[:, :2] * across, axis=1))
        valid = (sines > FLATTEST_CROSSING) & (aside < FARTHEST_ASIDE)
        return TangentEstimate(tangents=tangents, valid=valid, curvature_bias=bias)
