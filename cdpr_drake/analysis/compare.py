"""The four cable models on robots of growing size: what a worse model costs, without simulation.

Each comparison is a gain matrix: its slowest eigenvalue is the share of the gain lambda at which
the last of the error goes, and its coupling bends the way home.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.analysis.gain_matrix import GainMatrix, gain_matrix
from cdpr_drake.analysis.home import is_wrench_feasible, middle_of_workspace
from cdpr_drake.model.cable_models import CABLE_MODELS, cable_model_name
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.statics import DEFAULT_RULE

ROBOTS = ("cogiro", "cogiro-22m", "cogiro-37m", "cogiro-98m")
"""CoGiRo and its three larger versions (the paper's Table 6)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelComparison:
    """One cable model on one robot.

    Attributes:
        robot: name of the robot.
        size: longest side of the drawing points' box in plan [m].
        cable_model: the law's.
        gamma: the gain matrix.
        move: length of the moves judged [m].
        excursion_mm: largest distance from the straight way home, of moves along M's axes [mm].
        excursion_deg: largest rotation on the way of these moves [deg].
        dbeta_deg: largest angle between a cable and its chord at the platform [deg].
    """

    robot: str
    size: float
    cable_model: str
    gamma: GainMatrix
    move: float
    excursion_mm: float
    excursion_deg: float
    dbeta_deg: float

    @property
    def slowest(self) -> float:
        """Slowest rate of convergence over lambda [-]."""
        return float(self.gamma.eigenvalues.real.min())


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """All models on all robots; prints as a table.

    Attributes:
        rows: one for each robot and model, in the order of the robots.
    """

    rows: tuple[ModelComparison, ...]

    def of(self, cable_model: str) -> tuple[ModelComparison, ...]:
        """Return the rows of one model, in the order of the robots.

        Args:
            cable_model: "ECM", "CMWE", "SCMWE" or "SLSM".

        Raises:
            ValueError: an unknown cable model.
        """
        name = cable_model_name(cable_model)
        return tuple(row for row in self.rows if row.cable_model == name)

    def __str__(self) -> str:
        lines = [
            f"{'robot':<14}{'size':>7}{'model':>8}  {'eigenvalues of Gamma':<38}{'excursion':>10}"
        ]
        for row in self.rows:
            values = " ".join(f"{v:.3f}" for v in row.gamma.eigenvalues.real)
            lines.append(
                f"{row.robot:<14}{row.size:>5.0f} m{row.cable_model:>8}  {values:<38}"
                f"{row.excursion_mm:>7.2f} mm"
            )
        return "\n".join(lines)


def compare_cable_models(
    robots: Iterable[str | CableRobot] = ROBOTS,
    cable_models: Iterable[str] = CABLE_MODELS,
    *,
    poses: Mapping[str, RigidTransform | ArrayLike] | None = None,
    believed: Mapping[str, CableRobot] | None = None,
    move: float = 0.1,
    tensions: str = DEFAULT_RULE,
) -> Comparison:
    """Return the gain matrices of cable models on robots, with rates and excursions.

    Args:
        robots: robots, or names of built-in ones.
        cable_models: of the law.
        poses: where, by the robot's name, X_WP or [roll, pitch, yaw, x, y, z] (rad, m);
            `pose_to_compare` for those not given.
        believed: the robots as the controller knows them, by name; the true ones if not given.
        move: length of the moves judged, as a share of the robot's size.
        tensions: one of `model.statics.RULES`.

    Raises:
        GeometryError, TensionError, EquilibriumError: a robot cannot rest at its pose.
        RobotFileError: there is no robot of that name.
        ValueError: an unknown cable model or rule.
    """
    models = tuple(map(cable_model_name, cable_models))
    rows = []
    for item in robots:
        robot = item if isinstance(item, CableRobot) else load_robot(item)
        given = poses or {}
        pose = given[robot.name] if robot.name in given else pose_to_compare(robot)
        ours = (believed or {}).get(robot.name)
        rows += [_compare(robot, ours, pose, model, move, tensions) for model in models]
    return Comparison(rows=tuple(rows))


def comparable_pose(
    robot: CableRobot, toward: int = 1, distance: float = 0.4, height: float = 0.2
) -> RigidTransform:
    """Return a level pose at the same relative place in robots alike but for their size.

    Args:
        robot: the robot.
        toward: the cable (counting from 1) towards whose drawing point the platform stands.
        distance: how far on the way there from the middle of the drawing points, in plan.
        height: share of the drawing points' mean height.
    """
    points = robot.drawing_points
    middle = points.mean(axis=0)
    x, y = middle[:2] + distance * (points[toward - 1, :2] - middle[:2])
    return RigidTransform([x, y, height * middle[2]])


def pose_to_compare(robot: CableRobot) -> RigidTransform:
    """Return `comparable_pose` where the platform can be held there, else `middle_of_workspace`.

    Args:
        robot: the robot, with its payload.

    Raises:
        GeometryError, TensionError: it can nowhere be held level.
    """
    pose = comparable_pose(robot)
    return pose if is_wrench_feasible(robot, pose) else middle_of_workspace(robot)


def _compare(
    robot: CableRobot,
    believed: CableRobot | None,
    pose: RigidTransform | ArrayLike,
    cable_model: str,
    move: float,
    tensions: str,
) -> ModelComparison:
    gamma = gain_matrix(robot, believed, pose, cable_model, tensions=tensions)
    size = float(np.ptp(robot.drawing_points[:, :2], axis=0).max())
    starts = move * size * np.eye(6)[3:]
    aside = np.array([gamma.excursion(start) for start in starts]).max(axis=0)
    return ModelComparison(
        robot=robot.name,
        size=size,
        cable_model=cable_model,
        gamma=gamma,
        move=move * size,
        excursion_mm=float(1e3 * aside[0]),
        excursion_deg=float(np.degrees(aside[1])),
        dbeta_deg=float(np.degrees(np.abs(gamma.rest.dbeta).max())),
    )
