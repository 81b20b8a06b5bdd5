"""The state of one diagram handed to another by names, and noise that hangs on names alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cdpr_drake.diagrams import (
    GaussianSensing,
    ModelledSensing,
    hand_over,
    make_vision_based_control,
    rest_context,
    simulate,
)
from cdpr_drake.model.robot import CableRobot, load_robot

POSE = [0.0, 0.02, 0.1, 0.4, -0.3, 1.5]
GOAL = [0.0, 0.0, 0.0, 0.6, -0.1, 1.6]


@pytest.fixture(params=["cogiro", "cogiro-98m"])
def robot(request: pytest.FixtureRequest) -> CableRobot:
    """Two robots of different size."""
    return load_robot(request.param)


def started(robot: CableRobot, **options: Any) -> tuple[Any, Any]:
    """Return a noisy loop and its context on the way to the goal."""
    loop = make_vision_based_control(robot, gain=0.02, noise=True, **options)
    context = rest_context(loop, POSE, seed=3)
    loop.GetInputPort("desired_pose").FixValue(context, GOAL)
    return loop, context


@pytest.mark.parametrize("fast", [True, False])
def test_a_run_goes_on_in_another_loop_as_it_would_have(robot: CableRobot, fast: bool) -> None:
    """From the plant in blocks to the fused one and back, noise and latency buffers included."""
    options = {"latency": 0.13}
    loop, context = started(robot, fast=not fast, **options)
    simulate(loop, context, 0.52)
    other, target = started(robot, fast=fast, **options)
    assert hand_over(loop, context, other, target) == ()
    assert target.get_time() == context.get_time()
    runs = [simulate(d, c, 1.0, record=["pose", "measured_pose"]) for d, c in
            ((loop, context), (other, target))]  # fmt: skip
    for name in ("pose", "measured_pose"):
        np.testing.assert_allclose(runs[0][name], runs[1][name], rtol=0.0, atol=1e-9)
    assert np.ptp(runs[0]["measured_pose"][:, 3]) > 1e-3


def test_a_payload_picked_up_on_the_way_pulls_the_platform_down(robot: CableRobot) -> None:
    loop, context = started(robot)
    simulate(loop, context, 0.5)
    more = 20.0
    heavier, target = started(robot.with_payload(robot.payload.mass + more))
    assert hand_over(loop, context, heavier, target) == ()
    pose = [d.GetOutputPort("pose").Eval(c) for d, c in ((loop, context), (heavier, target))]
    np.testing.assert_array_equal(*pose)
    before, after = (
        d.GetOutputPort("platform_acceleration").Eval(c)[5]
        for d, c in ((loop, context), (heavier, target))
    )
    assert after < before - 0.5 * more / (robot.mass + more) * robot.gravity
    record = simulate(heavier, target, 1.5)
    assert record["pose"][-1, 5] < pose[0][5] - 1e-4


def test_what_has_no_namesake_stays_and_is_told(robot: CableRobot) -> None:
    loop, context = started(robot, sensing=ModelledSensing(modelled=("tensions",)))
    other, target = started(robot)
    cells = other.GetSubsystemByName("robot").GetOutputPort("measured_tension")
    own = other.GetSubsystemByName("robot").GetMyContextFromRoot(target)
    before = cells.Eval(own).copy()
    missing = hand_over(loop, context, other, target)
    k = robot.num_cables
    assert [n for n in missing if n.startswith("robot/")] == [
        f"robot/load_cells/tension[{i + 1}]" for i in range(k)
    ]
    assert {n.partition("[")[0] for n in missing} == {
        "robot/load_cells/tension", "tension_noise",
    }  # fmt: skip
    np.testing.assert_array_equal(cells.Eval(own), before)


def test_a_source_of_noise_draws_the_same_whatever_else_there_is(robot: CableRobot) -> None:
    """Without load cells there is one source less; the cameras' noise is the same to the bit."""
    records = []
    for sensing in (GaussianSensing(), ModelledSensing(modelled=("tensions",))):
        loop, context = started(robot, sensing=sensing)
        loop.GetInputPort("desired_pose").FixValue(context, POSE)
        records.append(simulate(loop, context, 0.3, record=["measured_pose", "pose"]))
    noise = [record["measured_pose"] - record["pose"] for record in records]
    np.testing.assert_allclose(noise[0], noise[1], rtol=0.0, atol=1e-9)
    assert noise[0].std() > 1e-4
    loop, context = started(robot)
    other = rest_context(loop, POSE, seed=4)
    assert not np.array_equal(
        *(loop.GetOutputPort("measured_tangents").Eval(c) for c in (context, other))
    )
