"""Every built-in robot with nothing but its name: rests, runs, limits, steps."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from cdpr_drake.analysis import gain_matrix
from cdpr_drake.commands.results import beyond_limits
from cdpr_drake.diagrams import JointSpaceLoop, VisionLoop
from cdpr_drake.model.robot import load_robot, robot_names
from cdpr_drake.runs.moves import move_near_the_middle
from cdpr_drake.runs.running import Run, prepare, run
from cdpr_drake.runs.setup import make_setup

LOOPS = {"VBC": VisionLoop(), "JSC": JointSpaceLoop(cable_model="ECM")}


def made(name: str, controller: str, **changes: object) -> Run:
    robot = load_robot(name)
    start, goal = move_near_the_middle(robot)
    loop = LOOPS[controller]
    return run(
        prepare(make_setup(robot=robot, start=start, goal=goal, loop=loop, noise=False, **changes))
    )


@pytest.mark.slow
@pytest.mark.needs("numba")  # uncompiled, the small robots' short steps take many minutes
@pytest.mark.parametrize("controller", LOOPS)
@pytest.mark.parametrize("name", robot_names())
def test_a_run_ends_where_its_gain_says(name: str, controller: str) -> None:
    """No slack; limits kept at rest; a move by vision ends at the pace of Gamma, to 0.1 mm."""
    found = made(name, controller)
    robot, setup, record = found.setup.robot, found.setup, found.record
    assert not record.slack_cables
    low, high = robot.cable.min_tension, robot.cable.max_tension
    tension = record["tension_at_drawing_point"]
    half_weight = (
        0.5 * robot.weight_per_metre * np.linalg.norm(np.ptp(robot.drawing_points, axis=0))
    )
    for at_rest in (tension[0], tension[-1]):
        assert low - half_weight <= at_rest.min() and at_rest.max() <= high + half_weight
    if controller == "JSC":
        return  # which does not see what is left
    way = np.linalg.norm(setup.goal.translation() - setup.start.translation())
    lost = 0.5 * setup.loop.law.ramp_time + setup.loop.timing.delay  # by ramp and latency [s]
    slowest = gain_matrix(robot, None, setup.goal).eigenvalues.real.min()  # 1 for an exact model
    left = np.exp(-slowest * setup.gain * (setup.until - lost)) * way
    assert np.linalg.norm(record["pose_error"][-1, 3:]) <= left + 1e-4


@pytest.mark.slow
@pytest.mark.needs("numba")
@pytest.mark.parametrize("name", ["ipanema-2", "segesta-10", "acrobot", "caroca", "cogiro-22m"])
def test_the_step_is_fine_enough(name: str) -> None:
    """Against a run at a tenth of it, from the first moment on."""
    usual = made(name, "VBC", gain=0.2, until=4.0)
    fine = made(name, "VBC", gain=0.2, until=4.0, max_step=0.1 * usual.record.step.size)
    apart = usual.record["pose"] - fine.record["pose"]
    assert np.linalg.norm(apart[:, 3:], axis=1).max() <= 5e-5
    tension = fine.record["tension_at_drawing_point"]
    assert np.abs(usual.record["tension_at_drawing_point"] / tension - 1.0).max() <= 0.01


def test_tensions_that_leave_the_limits_are_told() -> None:
    """Limits so narrow that the move leaves them on both sides, and the robot's own."""
    found = made("ipanema-2", "VBC", gain=0.5, until=3.0)
    assert beyond_limits(found) == ""
    tension = found.record["tension_at_drawing_point"]
    rest = tension[0]
    robot = found.setup.robot
    cable = robot.cable.replace(min_tension=rest.min(), max_tension=rest.max(), tension_margin=None)
    narrow = found.setup.replace(robot=robot.replace(cable=cable))
    told = beyond_limits(dataclasses.replace(found, setup=narrow))
    low, high = told.split("; ")
    assert low.startswith(f"tension below the robot's {rest.min():g} N in cable ")
    assert high.startswith(f"tension above the robot's {rest.max():g} N in cable ")
    assert low.endswith(" N") and "first at" in low
