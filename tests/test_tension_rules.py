"""The rule for tensions along moves of many robots: continuous, balanced, within the limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cdpr_drake.analysis import level_workspace, middle_of_workspace
from cdpr_drake.errors import TensionError
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.inverse_kinematics import InverseKinematics
from cdpr_drake.model.kernels import is_compiled
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.robot import CableRobot, load_robot, robot_names
from cdpr_drake.model.rotations import as_pose, pose_to_vector
from cdpr_drake.model.statics import (
    tension_distribution,
    weight_wrench,
    wrench_matrix,
)

ROBOTS = (*robot_names(), str(Path(__file__).parent / "outside" / "box.yaml"))
MOVES, LOOKS = (100 if is_compiled() else 10), 3
STEP = 1e-6  # m


@pytest.mark.parametrize("name", ["ipanema-2", "segesta-10", "acrobot", "cogiro"])
def test_a_tension_may_be_preferred_by_file_or_by_rule(name: str) -> None:
    robot = load_robot(name)
    pose = middle_of_workspace(robot)
    low, high = robot.cable.limits
    for share in (0.1, 0.6):
        wish = round(low + share * (high - low), 1)
        own = robot.replace(cable=robot.cable.replace(preferred_tension=wish))
        by_file = tension_distribution(own, pose, "within limits")
        by_rule = tension_distribution(robot, pose, f"within limits, close to {wish:g} N")
        np.testing.assert_array_equal(by_file, by_rule)
        matrix, wrench = _balance(robot, pose_to_vector(pose))
        np.testing.assert_allclose(matrix @ by_rule, wrench, atol=1e-9 * np.abs(wrench).max())
        # Along all that changes the internal tensions alone, none is closer.
        null = np.linalg.svd(matrix)[2][6:].T
        free = np.all((by_rule > low + 1e-6) & (by_rule < high - 1e-6))
        if free:
            np.testing.assert_allclose(null.T @ (by_rule - wish), 0.0, atol=1e-6 * high)
        state = rest_state(robot, pose, f"within limits, close to {wish:g} N")
        np.testing.assert_allclose(state.chord_tension, by_rule, rtol=1e-3)
        lengths = InverseKinematics(own, "ECM", rule="within limits").lengths(pose)
        same = InverseKinematics(robot, "ECM", rule=f"within limits, close to {wish:g} N")
        np.testing.assert_array_equal(same.lengths(pose), lengths)
    for rule in ("within limits, close to -3 N", "close to 3 N", "least"):
        with pytest.raises(ValueError, match="unknown rule"):
            tension_distribution(robot, pose, rule)


@pytest.mark.parametrize("name", ["ipanema-2", "segesta-10", "box"])
def test_a_lower_limit_of_zero_is_named_where_a_cable_rests_on_it(name: str) -> None:
    robot = load_robot(ROBOTS[-1] if name == "box" else name)
    limp = robot.replace(cable=robot.cable.replace(min_tension=0.0, tension_margin=None))
    pose = middle_of_workspace(limp)
    assert tension_distribution(limp, pose).min() == 0.0
    text = "lower limit of 0 N.*min_tension or cable.tension_margin above 0"
    with pytest.raises(TensionError, match=text):
        rest_state(limp, pose)
    with pytest.raises(TensionError, match=text):
        InverseKinematics(limp, "ECM").lengths(pose)
    rest_state(limp, pose, "within limits")  # which stays away from it


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
            # A jump within the first tenth makes the short step as long as the long one, one after
            # it the long step longer than ten short ones; a corner may change the slope.
            steep = 10.0 * STEP / np.linalg.norm(np.ptp(robot.attachment_points, axis=0))
            assert abs(long - 10.0 * short) <= (steep + 1e-6) * largest
            assert low <= t[0].min() and t[0].max() <= high
            seen += 1
            least = np.linalg.lstsq(
                *_balance(robot, ends[0] + share * (ends[1] - ends[0])), rcond=None
            )[0]
            if np.all(least >= low) and np.all(least <= high):
                np.testing.assert_allclose(t[0], least, rtol=1e-9)
            else:
                bound += 1
    assert seen > 2 * MOVES
    fully_constrained = np.ptp(robot.drawing_points[:, 2]) > 0.2 * robot.drawing_points[:, 2].max()
    assert bound > 2 * MOVES if fully_constrained else bound < MOVES
