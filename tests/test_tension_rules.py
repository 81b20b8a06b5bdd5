"""The rule for tensions along moves of many robots: continuous, balanced, within the limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cdpr_drake.analysis import level_workspace
from cdpr_drake.errors import TensionError
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.robot import CableRobot, load_robot, robot_names
from cdpr_drake.model.rotations import as_pose
from cdpr_drake.model.statics import (
    tension_distribution,
    weight_wrench,
    wrench_matrix,
)

ROBOTS = (*robot_names(), str(Path(__file__).parent / "outside" / "box.yaml"))
MOVES, LOOKS = 100, 3
STEP = 1e-6  # m


def _balance(robot: CableRobot, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the wrench matrix and the wrench that the tensions balance."""
    geometry = cable_geometry(robot, as_pose(pose))
    return wrench_matrix(geometry), weight_wrench(robot, geometry)


@pytest.mark.parametrize("name", ROBOTS)
def test_the_default_rule_is_continuous(name: str) -> None:
    """A jump would be the same for a step and a tenth of it; what is smooth is a tenth."""
    robot, draw = load_robot(name), np.random.default_rng(11)
    places = level_workspace(robot)
    low, high = robot.cable.limits
    bound, seen = 0, 0
    for _ in range(MOVES):
        first, last = places[draw.choice(len(places), 2, replace=False)]
        turns = draw.normal(0.0, 0.05, (2, 3))
        ends = np.concatenate([turns, [first, last]], axis=1)
        length = np.linalg.norm(last - first)
        for share in draw.uniform(0.0, 1.0, LOOKS):
            at = [share + h / length for h in (0.0, 0.1 * STEP, STEP)]
            try:
                t = [tension_distribution(robot, ends[0] + s * (ends[1] - ends[0])) for s in at]
            except TensionError:  # on the way the platform leaves the workspace
                continue
            largest = np.abs(t[0]).max()
            short, long = np.abs(t[1] - t[0]).max(), np.abs(t[2] - t[0]).max()
            # A jump within the first tenth shows in the short step, one after it in the long step.
            steep = 10.0 * STEP / np.linalg.norm(np.ptp(robot.attachment_points, axis=0))
            assert short <= (0.1 * steep + 1e-6) * largest
            assert long <= (steep + 1e-6) * largest
            assert low <= t[0].min() and t[0].max() <= high
            seen += 1
            least = np.linalg.lstsq(
                *_balance(robot, ends[0] + share * (ends[1] - ends[0])), rcond=None
            )[0]
            if np.all(least >= low) and np.all(least <= high):
                np.testing.assert_allclose(t[0], least, rtol=1e-9)
            else:
                bound += 1
    assert seen > 200
    fully_constrained = np.ptp(robot.drawing_points[:, 2]) > 0.2 * robot.drawing_points[:, 2].max()
    assert bound > 200 if fully_constrained else bound < 100
