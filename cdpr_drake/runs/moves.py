"""A move for a robot that no test of the paper is about."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.analysis.home import is_wrench_feasible, level_workspace, middle_of_workspace
from cdpr_drake.model.robot import CableRobot

RISE, SHIFT = 0.1, 0.05

DECAYS, LONGEST = 8.0, 400.0
"""How long a move takes by default: time constants of its gain, but at most so long [s]."""


def time_for(gain: float) -> float:
    """Return the time [s] for a move at a gain that robot file or limit decide, with three digits.

    Args:
        gain: lambda [1/s].
    """
    return float(f"{min(DECAYS / gain, LONGEST):.3g}")


def move_near_the_middle(robot: CableRobot) -> tuple[RigidTransform, RigidTransform]:
    """Return X_WP at the start and the goal of a short level move in the middle of a robot's reach.

    It starts at `middle_of_workspace`, rises by 10 % of the height of the workspace and moves along
    x by 5 % of its length, or by as much less, in halves, as keeps it in there.

    Args:
        robot: the robot, with its payload.

    Raises:
        GeometryError, TensionError: the platform can nowhere be held level.
    """
    places = level_workspace(robot)
    start = middle_of_workspace(robot, places)
    shift = np.array([SHIFT, 0.0, RISE]) * np.ptp(places, axis=0)
    shares = 0.5 ** np.arange(10)
    share = next((share for share in shares if _is_free(robot, start, share * shift)), shares[-1])
    return start, RigidTransform(start.translation() + share * shift)


def _is_free(robot: CableRobot, start: RigidTransform, shift: np.ndarray) -> bool:
    """Return whether the platform can be held on all of a straight way."""
    way = start.translation() + np.linspace(0.0, 1.0, 11)[1:, None] * shift
    return all(is_wrench_feasible(robot, RigidTransform(p)) for p in way)
