"""Rests of whole loops, and how nearly a context is one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from study_samples import POSE, miscalibrated

from cdpr_drake.analysis import comparable_pose
from cdpr_drake.diagrams import (
    make_cable_robot,
    make_joint_space_control,
    make_vision_based_control,
    platform_pose,
    rest_context,
    simulate,
)
from cdpr_drake.errors import EquilibriumError
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.inverse_kinematics import InverseKinematics
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.rotations import pose_to_vector
from cdpr_drake.model.servo import pose_error
from cdpr_drake.study import equilibrium, residuals, true_pose

LOOPS = {
    "robot": make_cable_robot,
    "joint": make_joint_space_control,
    "continuous": lambda r: make_vision_based_control(r, sample_time=None),
    "sampled": make_vision_based_control,
    "no latency": lambda r: make_vision_based_control(r, latency=0.0),
    "late": lambda r: make_vision_based_control(r, latency=0.13),
}


@pytest.mark.parametrize("rule", ["minimum norm", "within limits"])
@pytest.mark.parametrize("loop", LOOPS)
def test_everything_is_at_rest(cogiro: CableRobot, loop: str, rule: str) -> None:
    diagram = LOOPS[loop](cogiro)
    rest = residuals(diagram, equilibrium(diagram, POSE, rule))
    assert rest.largest <= 1e-9
    assert len(rest.names) == rest.value.size == rest.scale.size
    assert np.all(rest.scale > 0.0)


@pytest.mark.parametrize("name", ["cogiro-22m", "cogiro-98m"])
def test_large_robots_rest_too(name: str) -> None:
    robot = load_robot(name)
    diagram = make_vision_based_control(robot)
    assert residuals(diagram, equilibrium(diagram, comparable_pose(robot))).largest <= 1e-9


def test_the_rest_stays_put(cogiro: CableRobot) -> None:
    diagram = make_vision_based_control(cogiro, "SLSM")
    context = equilibrium(diagram, POSE)
    record = simulate(diagram, context, context.get_time() + 1.0)
    assert record.time[0] == 1.0  # past the ramp
    np.testing.assert_allclose(record["pose"], np.tile(POSE, (len(record.time), 1)), atol=1e-9)
    tension = record["tension_at_winch"]
    np.testing.assert_allclose(tension, np.tile(tension[0], (len(tension), 1)), rtol=1e-7)


def test_the_tensions_are_those_of_the_rule(cogiro: CableRobot) -> None:
    diagram = make_vision_based_control(cogiro)
    for rule in ("minimum norm", "within limits"):
        context = equilibrium(diagram, POSE, rule)
        expected = rest_state(cogiro, POSE, rule).tension_at_drawing_point
        found = diagram.GetOutputPort("tension_at_drawing_point").Eval(context)
        np.testing.assert_allclose(found, expected, rtol=1e-10)


def test_the_controller_sees_no_error_though_its_calibration_is_wrong(cogiro: CableRobot) -> None:
    believed = miscalibrated(cogiro)
    diagram = make_vision_based_control(cogiro, believed=believed)
    context = equilibrium(diagram, POSE)
    seen = diagram.GetOutputPort("pose_error_seen").Eval(context)
    true = diagram.GetOutputPort("pose_error").Eval(context)
    assert np.abs(seen).max() < 1e-12
    assert np.linalg.norm(true[3:]) > 2e-3
    np.testing.assert_allclose(
        diagram.GetOutputPort("measured_pose").Eval(context), POSE, atol=1e-12
    )
    assert platform_pose(diagram, context).IsNearlyEqualTo(true_pose(diagram, POSE), 1e-12)
    assert residuals(diagram, context).largest <= 1e-9


def test_under_joint_space_control_pose_and_tensions_are_results(cogiro: CableRobot) -> None:
    diagram = make_joint_space_control(cogiro)
    context = equilibrium(diagram, POSE)
    desired = diagram.GetInputPort("desired_pose").Eval(context)
    np.testing.assert_allclose(desired, POSE, rtol=0.0, atol=1e-15)
    error = pose_error(platform_pose(diagram, context), POSE, cogiro.cameras.X_PM)
    assert error[5] > 0.01  # it hangs below the goal: cables that the controller takes for stiff
    angles = diagram.GetOutputPort("motor_angles").Eval(context)
    wanted = InverseKinematics(cogiro, "SCMWE").motor_angles(POSE)
    np.testing.assert_allclose(angles, wanted, rtol=1e-12)


def test_the_time_is_past_the_ramp_at_the_start_of_a_period(cogiro: CableRobot) -> None:
    for ramp, period, expected in ((1.0, 0.05, 1.0), (0.62, 0.05, 0.65), (2.0, None, 2.0)):
        diagram = make_vision_based_control(cogiro, sample_time=period, ramp_time=ramp)
        assert equilibrium(diagram, POSE).get_time() == pytest.approx(expected, abs=1e-12)
    assert equilibrium(make_cable_robot(cogiro), POSE).get_time() == 0.0


# --- residuals


def changed(diagram: Any, block: str, entry: int, by: float) -> Any:
    """Return an equilibrium with one continuous state changed, by the state's name."""
    context = equilibrium(diagram, POSE)
    names = residuals(diagram, context).names
    x = context.get_continuous_state_vector().CopyToVector()
    x[names.index(block) + entry] += by
    context.SetContinuousState(x)
    return context


@pytest.mark.parametrize(
    ("state", "by", "worst", "ratio"),
    [
        # 1 % of the holding torque too much
        ("robot/winches/integral[3]", None, "robot/winches/rate[3]", 0.01),
        # 1 % of the reading
        ("robot/load_cells/tension[2]", None, "robot/load_cells/tension[2]", 0.01),
    ],
)
def test_residuals_are_relative_to_the_largest_term(
    cogiro: CableRobot, state: str, by: None, worst: str, ratio: float
) -> None:
    diagram = make_vision_based_control(cogiro, sample_time=None)
    names = residuals(diagram, equilibrium(diagram, POSE)).names
    x = equilibrium(diagram, POSE).get_continuous_state_vector().CopyToVector()
    found = residuals(diagram, changed(diagram, state, 0, ratio * x[names.index(state)]))
    assert found.worst == worst
    assert found.largest == pytest.approx(ratio, rel=0.02)


def test_an_unbalanced_force_is_relative_to_the_largest_force(cogiro: CableRobot) -> None:
    diagram = make_vision_based_control(cogiro, sample_time=None)
    context = equilibrium(diagram, POSE)
    weight = cogiro.mass * cogiro.gravity
    diagram.GetInputPort("external_wrench").FixValue(context, [0, 0, 0, 0, 0, 0.01 * weight])
    found = residuals(diagram, context)
    i = found.names.index("robot/platform/v_z")
    # The force acts at the platform's origin, not at its centre of mass: not all of it lifts.
    assert 0.002 < found.ratio[i] < 0.011


def test_a_sample_that_is_out_of_date_is_a_residual(cogiro: CableRobot) -> None:
    diagram = make_vision_based_control(cogiro)
    context = equilibrium(diagram, POSE)
    goal = np.add(POSE, [0, 0, 0, 0.1, 0, 0])
    diagram.GetInputPort("desired_pose").FixValue(context, goal)
    assert residuals(diagram, context).worst.startswith("held_rates")


# --- no rest


def test_where_no_tensions_hold_the_platform_the_error_says_so(cogiro: CableRobot) -> None:
    diagram = make_vision_based_control(cogiro)
    outside = [0.0, 0.0, 0.0, 9.0, 9.0, 1.0]
    with pytest.raises(
        EquilibriumError,
        match=r"outside the wrench-feasible workspace: .*give way by \d.*cable \d would bear",
    ):
        equilibrium(diagram, outside)
    with pytest.raises(EquilibriumError, match=r"outside the wrench-feas.*cable \d would bear"):
        equilibrium(diagram, [0.0, 0.0, 0.0, 6.0, 0.0, 1.0], "within limits")


def test_other_tensions_are_proposed_where_they_exist(cogiro: CableRobot) -> None:
    robot = cogiro.replace(cable=cogiro.cable.replace(min_tension=10.0))
    diagram = make_vision_based_control(robot)
    pose = [0.36, -0.3, 0.29, -5.73, -1.07, 2.05]
    equilibrium(diagram, pose, "within limits")
    equilibrium(diagram, pose)
    with pytest.raises(EquilibriumError, match=r'push.*"minimum norm within limits" finds some'):
        equilibrium(diagram, pose, "minimum norm")


def test_a_loop_that_is_driven_has_no_rest(cogiro: CableRobot) -> None:
    """Motors too weak to hold the cables."""
    weak = cogiro.replace(winch=cogiro.winch.replace(torque_limit=5.0))
    diagram = make_vision_based_control(weak)
    with pytest.raises(EquilibriumError, match=r"rate\[\d\].*limiting cable \d"):
        equilibrium(diagram, POSE)


@pytest.mark.parametrize("sample_time", [None, 0.05])
def test_noise_has_no_rest(cogiro: CableRobot, sample_time: float | None) -> None:
    diagram = make_vision_based_control(cogiro, sample_time=sample_time, noise=True)
    with pytest.raises(EquilibriumError, match=r'"pose_noise" \(RandomSource\) never rests'):
        equilibrium(diagram, POSE)
    disturbed = residuals(diagram, rest_context(diagram, POSE, seed=1))
    assert 1e-5 < disturbed.largest < 10.0


def test_an_unknown_rule_is_refused(cogiro: CableRobot) -> None:
    with pytest.raises(ValueError, match='unknown rule "best"'):
        equilibrium(make_vision_based_control(cogiro), POSE, "best")


def test_poses_come_as_transforms_too(cogiro: CableRobot) -> None:
    diagram = make_vision_based_control(cogiro)
    X_WP = true_pose(diagram, POSE)
    assert np.allclose(pose_to_vector(X_WP), POSE, atol=1e-12)
    a, b = equilibrium(diagram, X_WP), equilibrium(diagram, POSE)
    np.testing.assert_allclose(
        a.get_continuous_state_vector().CopyToVector(),
        b.get_continuous_state_vector().CopyToVector(),
        rtol=1e-9, atol=1e-9,
    )  # fmt: skip
