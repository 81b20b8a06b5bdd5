"""Internal tension: the directions that visual servoing leaves alone, and how they drift.

The law commands motor rates in the range of D_m, six dimensions; the platform's pose says nothing
of the other k - 6, in which cables pull against each other. There nothing is controlled: each is an
eigenvalue at zero, and what a run adds up there stays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.diagrams import Record
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.rest_model import rest_model
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import vector_to_pose
from cdpr_drake.model.statics import DEFAULT_RULE, wrench_matrix
from cdpr_drake.study.state_space import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class NeutralDirections:
    """The k - 6 directions of motor angles that do not move the platform, at one pose.

    Attributes:
        names: "internal tension 1", ...
        tensions: (k - 6, k) [N], tensions at the drawing points, largest entry 1 N.
        lengths: (k - 6, k) [m], unstrained lengths that cause them.
    """

    names: tuple[str, ...]
    tensions: Array
    lengths: Array


def neutral_directions(
    robot: CableRobot, pose: RigidTransform | ArrayLike, tensions: str = DEFAULT_RULE
) -> NeutralDirections:
    """Return what visual servoing leaves neutral at a pose: internal tensions, by cable.

    Length changes dl with (dW/dl) dl = 0 load the cables against each other at an unmoved platform.

    Args:
        robot: the robot.
        pose: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        tensions: one of `model.statics.RULES`.

    Raises:
        GeometryError, TensionError, EquilibriumError: the robot cannot rest there.
    """
    model = rest_model(robot, rest_state(robot, pose, tensions))
    k = robot.num_cables
    lengths = np.linalg.svd(model.wrench_per_length)[2][6:]
    pulls = lengths @ model.tension[:, 12 : 12 + k].T
    scale = pulls[np.arange(k - 6), np.abs(pulls).argmax(axis=1)][:, None]
    return NeutralDirections(
        names=tuple(f"internal tension {i + 1}" for i in range(k - 6)),
        tensions=pulls / scale,
        lengths=lengths / scale,
    )


def internal_tension(robot: CableRobot, pose: ArrayLike, tension: ArrayLike) -> Array:
    """Return the part of cable tensions that holds no weight (n, k) [N], along a run.

    The projection on the null space of the wrench matrix at each pose.

    Args:
        robot: the robot.
        pose: (n, 6) [roll, pitch, yaw, x, y, z] (rad, m).
        tension: (n, k) [N] at the drawing points.
    """
    found = []
    for x, T in zip(np.asarray(pose, float), np.asarray(tension, float), strict=True):
        matrix = wrench_matrix(cable_geometry(robot, vector_to_pose(x)))
        found.append(T - np.linalg.pinv(matrix) @ (matrix @ T))
    return np.array(found)


def internal_tension_drift(robot: CableRobot, record: Record) -> Array:
    """Return how far each cable's internal tension has drifted since the start of a run (n, k) [N].

    Args:
        robot: the robot.
        record: from `simulate`, with "pose" and "tension_at_drawing_point".
    """
    internal = internal_tension(robot, record["pose"], record["tension_at_drawing_point"])
    return internal - internal[0]
