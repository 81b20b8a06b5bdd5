"""The gain matrix: the loop's slow eigenvalues without the loop."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydrake.math import RigidTransform
from study_samples import MODELS, POSE, miscalibrated, robot_of_a_class

from cdpr_drake.analysis import (
    comparable_pose,
    compare_cable_models,
    gain_matrix,
    map_gain_matrix,
    platform_modes,
)
from cdpr_drake.analysis.gain_matrix import target_twist
from cdpr_drake.diagrams import make_cable_robot, make_vision_based_control
from cdpr_drake.errors import EquilibriumError, TensionError
from cdpr_drake.model.equilibrium import forward_kinematics, platform_balance, rest_state
from cdpr_drake.model.kinematics import D_t
from cdpr_drake.model.rest_model import mass_matrix, rest_model
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.servo import ServoSettings
from cdpr_drake.study import equilibrium, excursion, linearize, pose_error_response


def slow_eigenvalues(loop: Any, pose: Any, count: int = 6) -> np.ndarray:
    """Return the loop's six slow eigenvalues that are not zero, slowest first."""
    values = linearize(loop, equilibrium(loop, pose), [], []).eigenvalues
    values = values[np.argsort(np.abs(values))]
    return values[np.abs(values) > 1e-6][:count]


# --- the robot's linear model at rest


def test_the_linear_model_by_hand_is_that_of_the_diagram(cogiro: CableRobot) -> None:
    diagram = make_cable_robot(cogiro)
    model = linearize(diagram, equilibrium(diagram, POSE), ["desired_motor_angles"], [])
    A, B = rest_model(cogiro, rest_state(cogiro, POSE)).controlled()
    np.testing.assert_allclose(model.A, A, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(model.B, B, rtol=0.0, atol=1e-10)
    assert platform_modes(cogiro, POSE, "controlled").states == model.states


def test_the_stiffness_is_that_of_the_balance(cogiro: CableRobot) -> None:
    rest = rest_state(cogiro, POSE)
    _, stiffness, _ = platform_balance(cogiro, rest.X_WP, rest.unstrained_length)
    np.testing.assert_allclose(rest_model(cogiro, rest).stiffness, stiffness, rtol=0, atol=1e-7)


def test_the_platform_settles_as_predicted_when_lengths_change(cogiro: CableRobot) -> None:
    rest = rest_state(cogiro, POSE)
    predicted = rest_model(cogiro, rest).pose_per_length[:, 2]
    h = 1e-5
    moved = []
    for sign in (1.0, -1.0):
        length = rest.unstrained_length.copy()
        length[2] += sign * h
        moved.append(forward_kinematics(cogiro, length, rest.X_WP).X_WP.translation())
    np.testing.assert_allclose((moved[0] - moved[1]) / (2 * h), predicted[3:], rtol=1e-5, atol=1e-7)


def test_the_mass_matrix_is_the_plant_s(cogiro: CableRobot) -> None:
    robot = cogiro.with_payload(110.0)
    plant = make_cable_robot(robot).GetSubsystemByName("platform")
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, POSE)
    R = RigidTransform(rest_state(robot, POSE).X_WP).rotation().matrix()
    np.testing.assert_allclose(mass_matrix(robot, R), plant.CalcMassMatrix(context), atol=1e-9)


# --- Gamma


@pytest.mark.parametrize("name", ["cogiro", "cogiro-22m", "cogiro-37m", "cogiro-98m"])
def test_its_eigenvalues_are_the_loop_s(name: str) -> None:
    robot = load_robot(name)
    pose = comparable_pose(robot)
    for model in MODELS:
        loop = make_vision_based_control(robot, model, gain=0.03, sample_time=None)
        gamma = gain_matrix(robot, None, pose, model)
        slow = np.sort(slow_eigenvalues(loop, pose).real / -0.03)
        np.testing.assert_allclose(gamma.eigenvalues.real, slow, rtol=5e-4)
        assert np.abs(gamma.eigenvalues.imag).max() < 1e-9  # coupling, not oscillation
        assert gamma.is_stable


def test_with_a_wrong_calibration_too(cogiro: CableRobot) -> None:
    believed = miscalibrated(cogiro)
    loop = make_vision_based_control(cogiro, "SLSM", gain=0.01, sample_time=None, believed=believed)
    gamma = gain_matrix(cogiro, believed, POSE, "SLSM")
    slow = np.sort(slow_eigenvalues(loop, POSE).real / -0.01)
    np.testing.assert_allclose(gamma.eigenvalues.real, slow, rtol=2e-4)
    exact = gain_matrix(cogiro, None, POSE, "SLSM")
    assert np.abs(gamma.matrix - exact.matrix).max() > 1e-3


def test_with_a_load_cell_that_reads_nothing(cogiro: CableRobot) -> None:
    """The law then takes the tension that the others let expect, and so does the gain matrix."""
    gain = np.ones(8)
    gain[2] = 1e-3
    broken = cogiro.replace(load_cells=cogiro.load_cells.replace(gain=gain))
    loop = make_vision_based_control(broken, "ECM", gain=0.01, sample_time=None, believed=cogiro)
    gamma = gain_matrix(broken, cogiro, POSE, "ECM")
    slow = np.sort(slow_eigenvalues(loop, POSE).real / -0.01)
    np.testing.assert_allclose(gamma.eigenvalues.real, slow, rtol=2e-4)
    whole = gain_matrix(cogiro, None, POSE, "ECM")
    assert 0.0 < np.abs(gamma.matrix - whole.matrix).max() < 1e-6


def test_exact_knowledge_makes_it_the_identity(cogiro: CableRobot) -> None:
    no_run = cogiro.replace(cable=cogiro.cable.replace(drum_run=np.zeros(8)))
    gamma = gain_matrix(no_run, None, POSE, "ECM").matrix
    np.testing.assert_allclose(gamma, np.eye(6), atol=1e-4)
    modelled = ServoSettings(model_drum_run=True)
    gamma = gain_matrix(cogiro, None, POSE, "ECM", settings=modelled).matrix
    np.testing.assert_allclose(gamma, np.eye(6), atol=1e-4)


def test_it_is_the_motion_had_per_motion_asked_for(cogiro: CableRobot) -> None:
    """Change the lengths as the law would for a twist, let the platform settle, see how M moved."""
    gamma = gain_matrix(cogiro, None, POSE, "SLSM")
    rest = gamma.rest.rest
    h = 1e-4
    for column in (0, 5):
        ends = []
        for sign in (1.0, -1.0):
            length = rest.unstrained_length + sign * h * gamma.length_rates[:, column]
            ends.append(forward_kinematics(cogiro, length, rest.X_WP).X_WP)
        X_PM = cogiro.cameras.X_PM
        moved = (ends[1] @ X_PM).InvertAndCompose(ends[0] @ X_PM)
        rotation = moved.rotation().ToAngleAxis()
        twist = np.concatenate([rotation.angle() * rotation.axis(), moved.translation()]) / (2 * h)
        np.testing.assert_allclose(twist, gamma.matrix[:, column], atol=1e-6)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("drum_run", [0.0, 5.4])
@pytest.mark.parametrize("num_cables", [7, 10])
def test_random_robots_with_exact_knowledge(
    cogiro: CableRobot, num_cables: int, drum_run: float, seed: int
) -> None:
    robot, pose = robot_of_a_class(cogiro, num_cables, drum_run, seed)
    loop = make_vision_based_control(
        robot, "ECM", gain=0.1, sample_time=None, model_drum_run=drum_run > 0.0
    )
    values = linearize(loop, equilibrium(loop, pose), [], []).eigenvalues
    values = values[np.argsort(np.abs(values))]
    neutral, servo, others = np.split(values, [num_cables - 6, num_cables])
    assert np.abs(neutral).max() < 1e-6
    np.testing.assert_allclose(servo, -0.1, rtol=0.01)
    assert others.real.max() < 0.0


def test_the_target_s_twist_is_eq_19(cogiro: CableRobot) -> None:
    X_WP = rest_state(cogiro, POSE).X_WP
    R, p = X_WP.rotation().matrix(), cogiro.cameras.X_PM.translation()
    np.testing.assert_allclose(target_twist(cogiro, X_WP), D_t(R, p), atol=1e-14)


# --- what it predicts


def test_its_response_is_the_linear_loop_s(cogiro: CableRobot) -> None:
    gamma = gain_matrix(cogiro, None, POSE, "SLSM")
    loop = make_vision_based_control(cogiro, "SLSM", gain=0.03, sample_time=None)
    model = linearize(loop, equilibrium(loop, POSE), ["desired_pose"], ["pose_error"])
    error = np.array([0.05, -0.02, 0.1, 1.0, 0.3, -0.5])
    time = np.linspace(0.0, 150.0, 151)
    slow = gamma.response(time, error, 0.03)
    full = pose_error_response(model, error, time)
    np.testing.assert_allclose(slow[0], error, rtol=0, atol=1e-12)
    np.testing.assert_allclose(full[0], error, rtol=0, atol=1e-12)
    assert np.abs(slow - full)[10:].max() < 2e-4
    assert np.abs(full[-1]).max() < 0.02


def test_the_excursion_is_the_coupling(cogiro: CableRobot) -> None:
    gamma = gain_matrix(cogiro, None, POSE, "SLSM")
    start = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    s = gamma.response(np.linspace(0.0, 10.0, 2001), start, gain=1.0)
    aside, turned = np.linalg.norm(s[:, 4:], axis=1).max(), np.linalg.norm(s[:, :3], axis=1).max()
    assert gamma.excursion(start) == pytest.approx((aside, turned), rel=1e-3)
    # To first order x exp(-x) <= 1/e of the off-diagonal entries of the column.
    column = gamma.coupling[:, 3]
    assert aside == pytest.approx(np.linalg.norm(column[3:]) / np.e, rel=0.05)
    assert turned == pytest.approx(np.linalg.norm(column[:3]) / np.e, rel=0.05)
    assert excursion(start * np.exp(-np.linspace(0, 9, 10))[:, None]) == (0.0, 0.0)


def test_it_prints_with_its_axes(cogiro: CableRobot) -> None:
    text = str(gain_matrix(cogiro, None, POSE, "SLSM"))
    assert "omega_x" in text and "eigenvalues" in text
    assert max(len(line) for line in text.splitlines()) <= 80


# --- maps


def test_a_map_is_the_matrices_pose_by_pose(cogiro: CableRobot) -> None:
    believed = miscalibrated(cogiro)
    poses = [POSE, [0.0, 0.0, 0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 9.0, 9.0, 1.0]]
    found = map_gain_matrix(cogiro, believed, poses, "SCMWE")
    for i in (0, 1):
        one = gain_matrix(cogiro, believed, poses[i], "SCMWE")
        np.testing.assert_array_equal(found.matrices[i], one.matrix)
        np.testing.assert_allclose(found.eigenvalues[i], one.eigenvalues, rtol=1e-12)
        assert found.slowest[i] == pytest.approx(one.eigenvalues.real.min())
        assert found.coupling[i] == pytest.approx(np.abs(one.coupling).max())
    assert list(found.reasons) == [2] and "wrench-feasible" in found.reasons[2]
    assert np.isnan(found.slowest[2]) and np.isnan(found.matrices[2]).all()
    np.testing.assert_allclose(found.poses[0], POSE, atol=1e-12)


def test_a_map_of_nothing_is_empty(cogiro: CableRobot) -> None:
    found = map_gain_matrix(cogiro, None, [])
    assert found.matrices.shape == (0, 6, 6) and found.slowest.shape == (0,)


def test_what_cannot_be_is_refused(cogiro: CableRobot) -> None:
    with pytest.raises(ValueError, match="unknown cable model"):
        gain_matrix(cogiro, None, POSE, "STRAIGHT")
    with pytest.raises((TensionError, EquilibriumError)):
        gain_matrix(cogiro, None, [0.0, 0.0, 0.0, 9.0, 9.0, 1.0])
    with pytest.raises(ValueError, match="unknown rule"):
        map_gain_matrix(cogiro, None, [POSE], tensions="best")


# --- models and sizes


def test_a_worse_model_is_slower_and_more_coupled_the_larger_the_robot() -> None:
    found = compare_cable_models()
    assert len(found.rows) == 16
    for rows in zip(found.of("ECM"), found.of("SCMWE"), found.of("SLSM"), strict=True):
        slowest = [row.slowest for row in rows]
        assert slowest == sorted(slowest, reverse=True)
        assert [r.excursion_mm for r in rows] == sorted(r.excursion_mm for r in rows)
    for model in MODELS:
        rows = found.of(model)
        assert [r.size for r in rows] == sorted(r.size for r in rows)
        slowest = [row.slowest for row in rows]
        assert slowest == sorted(slowest, reverse=True)
        assert rows[-1].dbeta_deg > 5.0 * rows[0].dbeta_deg
    # A parabola is as good as a catenary but on the largest robot, and there nearly.
    for catenary, parabola in zip(found.of("CMWE"), found.of("SCMWE"), strict=True):
        assert parabola.slowest == pytest.approx(catenary.slowest, rel=2e-3)
    assert max(len(line) for line in str(found).splitlines()) <= 80


def test_robots_may_be_given_with_their_poses_and_calibrations(cogiro: CableRobot) -> None:
    believed = miscalibrated(cogiro)
    found = compare_cable_models(
        [cogiro], ["SLSM"], poses={"cogiro": POSE}, believed={"cogiro": believed}
    )
    (row,) = found.rows
    np.testing.assert_array_equal(
        row.gamma.matrix, gain_matrix(cogiro, believed, POSE, "SLSM").matrix
    )
    assert row.move == pytest.approx(0.1 * row.size)


def test_comparable_poses_are_alike(cogiro: CableRobot) -> None:
    large = load_robot("cogiro-98m")
    for robot in (cogiro, large):
        p = comparable_pose(robot).translation()
        middle = robot.drawing_points.mean(axis=0)
        offset = robot.drawing_points[0] - middle
        np.testing.assert_allclose((p - middle)[:2], 0.4 * offset[:2])
        assert p[2] == pytest.approx(0.2 * middle[2])
