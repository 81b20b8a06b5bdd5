"""The search behind Table 6: a pose, load and internal tension whose sag comes near a given one.

A set of these is a mapping by the names of `NAMES`, or a row of numbers in their order. Many sets
are tried at once, with arrays over sets, robots and cables.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from cdpr_drake import CableRobot
from cdpr_drake.model.cable_models import cable_angles
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.statics import weight_wrench, wrench_matrix

NAMES = (
    "x", "y", "z", "roll", "pitch", "yaw", "com_x", "com_y", "mass", "tension_3", "tension_6",
)  # fmt: skip
"""Place of E over the robot's spans [-], angles [deg], horizontal CoM in P [m], mass [kg], and the
tensions [N] in cables 3 and 6 that set the internal ones."""

LEAST_TENSION = 5.0
"""A set whose chord tensions fall below this [N] is penalised."""


class ScaledRobots:
    """Robots that differ in size alone, with one platform, at one pose relative to their size.

    Chord tensions are those of least norm that balance weight and half cables (the paper's A.2,
    here in chord tensions), plus the part without effect on the platform of the vector that has
    tension_3 and tension_6 in these two cables and zero in the others.

    Args:
        robots: r of them.
    """

    def __init__(self, robots: Sequence[CableRobot]) -> None:
        self.robots = tuple(robots)
        self.spans = np.array([_spans(robot) for robot in robots])
        self._A = np.array([robot.drawing_points for robot in robots])
        self._B = robots[0].attachment_points
        self._w = robots[0].weight_per_metre
        self._gravity = robots[0].gravity
        self._com_z = float(robots[0].center_of_mass[2])

    def __call__(self, sets: Array) -> tuple[Array, Array]:
        """Return chord tensions [N] and dbeta [deg] of the SCMWE, both (n, r, k).

        Args:
            sets: (n, 11), columns as in `NAMES`.
        """
        n = len(sets)
        R = _rotations(np.radians(sets[:, 3:6]))
        EB = (R @ self._B.T).swapaxes(1, 2)[:, None]  # n, 1, k, 3
        AB = EB + (sets[:, None, :3] * self.spans)[:, :, None] - self._A
        EB = np.broadcast_to(EB, AB.shape)
        L = np.linalg.norm(AB, axis=-1)
        u = AB / L[..., None]
        com = np.column_stack([sets[:, 6:8], np.full(n, self._com_z)])
        weight = np.zeros((n, 1, 3))
        weight[..., 2] = -sets[:, 8:9] * self._gravity
        half = np.zeros_like(AB)
        half[..., 2] = 0.5 * self._w * L
        torque = np.cross((R @ com[..., None])[:, None, :, 0], weight) - np.cross(EB, half).sum(2)
        wrench = np.concatenate([torque, weight - half.sum(2)], axis=-1)
        matrix = np.concatenate([np.cross(EB, u), u], axis=-1).swapaxes(-1, -2)
        wanted = np.zeros(L.shape)
        wanted[..., 2], wanted[..., 5] = sets[:, 9:10], sets[:, 10:11]
        T = _closest(matrix, wrench, wanted)
        Bx = np.hypot(AB[..., 0], AB[..., 1])
        slope = AB[..., 2] / Bx
        H = np.maximum(T, 1e-9) * Bx / L
        turn = np.arctan(slope + 0.5 * self._w * L / H) - np.arctan(slope)
        return T, np.degrees(turn)

    def one(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Return the same (r, k) for one set, cable by cable from the package's own functions.

        Args:
            values: by the names of `NAMES`.
        """
        tensions, turns = [], []
        for robot, spans in zip(self.robots, self.spans, strict=True):
            loaded = robot.with_payload(0.0).replace(platform=_platform(robot, values))
            geometry = cable_geometry(loaded, pose_of(values, spans))
            wanted = np.zeros(robot.num_cables)
            wanted[2], wanted[5] = values["tension_3"], values["tension_6"]
            matrix = wrench_matrix(geometry)
            missing = weight_wrench(loaded, geometry) - matrix @ wanted
            T = wanted + np.linalg.lstsq(matrix, missing, rcond=None)[0]
            H = T * geometry.Bx / geometry.L
            ends = cable_angles(geometry.Bx, geometry.Bz, H, robot.weight_per_metre, "SCMWE")
            tensions.append(T)
            turns.append(np.degrees(ends.dbeta))
        return np.array(tensions), np.array(turns)


def pose_of(values: Mapping[str, float], spans: Array) -> RigidTransform:
    """Return X_WP of a set in a robot of the given spans.

    Args:
        values: by the names of `NAMES`.
        spans: (3,) [m].
    """
    angles = np.radians([values["roll"], values["pitch"], values["yaw"]])
    place = np.array([values["x"], values["y"], values["z"]]) * spans
    return RigidTransform(RollPitchYaw(angles), place)


def search(
    scaled: ScaledRobots,
    printed: Array,
    ranges: Mapping[str, tuple[float, float]],
    fixed: Mapping[str, float],
    *,
    seed: int = 0,
    generations: int = 250,
) -> dict[str, float]:
    """Return the set of least relative error (rms) among those in the ranges.

    Differential evolution (Storn and Price, J. Global Optimization, 1997) from sets spread over the
    ranges, then least squares from the best.

    Args:
        scaled: the robots.
        printed: (r, k) [deg], the dbeta to come near.
        ranges: of the values that are free, by name.
        fixed: the other values, by name.
        seed: of the sets to start with, and of their mixing.
        generations: how many times all sets are mixed.
    """
    from scipy.optimize import least_squares

    free = [NAMES.index(name) for name in ranges]
    low, high = np.array(list(ranges.values()), float).T
    template = np.array([fixed.get(name, 0.0) for name in NAMES])

    def misfit(points: Array) -> Array:
        """Return relative errors and penalties (n, 2 r k) at points (n, free) from 0 to 1."""
        sets = np.tile(template, (len(points), 1))
        sets[:, free] = low + (high - low) * points
        T, turn = scaled(sets)
        below = np.minimum(T - LEAST_TENSION, 0.0)
        return np.concatenate([turn / printed - 1.0, below], axis=-1).reshape(len(points), -1)

    best = _evolve(lambda points: (misfit(points) ** 2).sum(1), len(free), generations, seed)
    fit = least_squares(lambda x: misfit(x[None])[0], best, bounds=(0.0, 1.0), xtol=1e-12)
    template[free] = low + (high - low) * fit.x
    return dict(zip(NAMES, template.tolist(), strict=True))


def _evolve(cost: Any, size: int, generations: int, seed: int) -> Array:
    """Return the best point of the unit cube (size,) that differential evolution finds."""
    draw = np.random.default_rng(seed)
    n = 12 * size
    points = draw.random((n, size))
    costs = cost(points)
    for _ in range(generations):
        a, b = points[draw.integers(n, size=n)], points[draw.integers(n, size=n)]
        target = points[np.argmin(costs)] + draw.uniform(0.5, 1.0) * (a - b)
        mixed = np.where(draw.random((n, size)) < 0.7, target, points)
        outside = (mixed < 0.0) | (mixed > 1.0)
        mixed = np.where(outside, draw.random((n, size)), mixed)
        tried = cost(mixed)
        better = tried < costs
        points[better], costs[better] = mixed[better], tried[better]
    found: Array = points[np.argmin(costs)]
    return found


def _closest(matrix: Array, wrench: Array, wanted: Array) -> Array:
    """Return the tensions T closest to the `wanted` ones of those with matrix T = wrench."""
    missing = wrench[..., None] - matrix @ wanted[..., None]
    transposed = matrix.swapaxes(-1, -2)
    step: Array = transposed @ np.linalg.solve(matrix @ transposed, missing)
    return wanted + step[..., 0]


def _rotations(angles: Array) -> Array:
    """Return the matrices (n, 3, 3) of roll, pitch and yaw (n, 3)."""
    return np.array([RollPitchYaw(a).ToRotationMatrix().matrix() for a in angles])


def _platform(robot: CableRobot, values: Mapping[str, float]) -> Any:
    com = np.array([values["com_x"], values["com_y"], robot.center_of_mass[2]])
    return robot.platform.replace(mass=values["mass"], center_of_mass=com)


def _spans(robot: CableRobot) -> Array:
    """Return length and width between the drawing points, and the highest's height [m]."""
    points = robot.drawing_points
    x, y, _ = np.ptp(points, axis=0)
    return np.array([x, y, points[:, 2].max()])
