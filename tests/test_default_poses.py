"""Where questions start that name no pose: the middle of the wrench-feasible workspace."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform

from cdpr_drake.analysis import (
    compare_cable_models,
    is_wrench_feasible,
    level_workspace,
    middle_of_workspace,
)
from cdpr_drake.analysis.home import room
from cdpr_drake.errors import GeometryError, TensionError
from cdpr_drake.model.distribution import feasibility_margin
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.robot import CableRobot, load_robot, robot_names
from cdpr_drake.model.statics import weight_wrench, wrench_matrix
from cdpr_drake.runs.moves import move_near_the_middle

OUTSIDE = Path(__file__).parent / "outside"
ROBOTS = (*robot_names(), str(OUTSIDE / "box.yaml"), str(OUTSIDE / "desk.yaml"))
"""Suspended and fully constrained, from 0.125 kg to 100 kg, from 1 m to 98 m."""


@pytest.fixture(params=ROBOTS)
def robot(request: pytest.FixtureRequest) -> CableRobot:
    return load_robot(request.param)


def margin(robot: CableRobot, X_WP: RigidTransform) -> float:
    """Return by a linear programme how far inside their limits tensions can be [N]."""
    geometry = cable_geometry(robot, X_WP)
    limits = robot.cable.limits
    return feasibility_margin(
        wrench_matrix(geometry), weight_wrench(robot, geometry), *limits
    ).margin


def test_a_robot_rests_in_the_middle_and_can_move_about(robot: CableRobot) -> None:
    start, goal = move_near_the_middle(robot)
    np.testing.assert_array_equal(start.GetAsMatrix34(), middle_of_workspace(robot).GetAsMatrix34())
    shift = goal.translation() - start.translation()
    size = np.ptp(robot.drawing_points, axis=0)
    assert 0.0 < shift[0] < 0.1 * size[0] and shift[1] == 0.0 and shift[2] > 0.0
    low, high = robot.cable.limits
    for share in np.linspace(0.0, 1.0, 5):
        X_WP = RigidTransform(start.translation() + share * shift)
        assert margin(robot, X_WP) >= 0.0
        chord = rest_state(robot, X_WP).chord_tension
        assert low - 1e-6 <= chord.min() and chord.max() <= high + 1e-6


def test_a_cell_is_feasible_if_a_linear_programme_says_so(robot: CableRobot) -> None:
    low, high = room(robot)
    places = np.random.default_rng(3).uniform(low, high, (60, 3))
    told = [is_wrench_feasible(robot, RigidTransform(p)) for p in places]
    margins = np.array([margin(robot, RigidTransform(p)) for p in places])
    clear = np.abs(margins) > 1e-6 * robot.cable.max_tension
    np.testing.assert_array_equal(np.array(told)[clear], margins[clear] > 0.0)


@pytest.mark.parametrize("floor", [None, 0.0])
@pytest.mark.parametrize("name", ["cogiro-22m", "ipanema-2", "acrobot"])
def test_where_the_world_has_its_origin_does_not_matter(name: str, floor: float | None) -> None:
    robot, shift = load_robot(name).replace(floor=floor), np.array([3.0, -2.0, -50.0])
    lifted = None if robot.floor is None else robot.floor + shift[2]
    moved = robot.replace(drawing_points=robot.drawing_points + shift, floor=lifted)
    expected = middle_of_workspace(robot).translation() + shift
    np.testing.assert_allclose(middle_of_workspace(moved).translation(), expected, atol=1e-9)


def test_a_robot_that_can_hold_its_platform_nowhere_says_why() -> None:
    robot = load_robot("ipanema-2")
    heavy = robot.with_payload(1000.0)
    with pytest.raises(TensionError, match=r"none of 729 places .* would have to give way by"):
        level_workspace(heavy)
    few = robot.replace(
        drawing_points=robot.drawing_points[:4], attachment_points=robot.attachment_points[:4],
        cable=robot.cable.replace(drum_run=0.0), winch=robot.winch.replace(encoder_zero_length=0.0),
        load_cells=robot.load_cells.replace(gain=1.0, bias=0.0),
    )  # fmt: skip
    with pytest.raises(GeometryError, match="4 cables has rank below 6"):
        middle_of_workspace(few)


def test_cable_models_are_compared_on_any_robot() -> None:
    rows = compare_cable_models(["ipanema-2", "segesta-10", "acrobot"], ["ECM"]).rows
    for row in rows:
        np.testing.assert_allclose(row.gamma.eigenvalues, 1.0, atol=1e-6)
