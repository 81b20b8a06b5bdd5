"""Cameras, tangent cameras, load cells: what they report, noise, calibration, derivatives."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from samples import random_pose, rotation
from scipy.linalg import expm
from system_checks import check_derivatives, fixed_context
from test_systems import misplaced, usual_inputs, usual_state

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import log_rotation, pose_to_vector, vector_to_pose
from cdpr_drake.systems import CableTangentCameras, CameraMeasurement, LoadCellFilter

SEEDS = pytest.mark.parametrize("seed", range(3))
DRAWS = 3000


def noisy(robot: CableRobot, position: float, orientation: float) -> CableRobot:
    cameras = robot.cameras.replace(position_noise=position, orientation_noise=orientation)
    return robot.replace(cameras=cameras)


def measured(system: CameraMeasurement, X: RigidTransform, noise: object = None) -> RigidTransform:
    inputs = {"pose": pose_to_vector(X)}
    if noise is not None:
        inputs["noise"] = np.asarray(noise, float)
    context = fixed_context(system, inputs)
    return vector_to_pose(system.GetOutputPort("measured_pose").Eval(context))


# --- the pose


@SEEDS
def test_exact_cameras_measure_the_pose(cogiro: CableRobot, seed: int) -> None:
    X = random_pose(np.random.default_rng(seed))
    assert measured(CameraMeasurement(cogiro), X).IsNearlyEqualTo(X, 1e-14)


@SEEDS
def test_a_wrong_calibration_shifts_the_pose_exactly(cogiro: CableRobot, seed: int) -> None:
    X, believed = random_pose(np.random.default_rng(seed)), misplaced(cogiro)
    true, wrong = cogiro.cameras, believed.cameras
    seen = true.X_WF.inverse() @ X @ true.X_PM  # X_FM: what images show
    expected = wrong.X_WF @ seen @ wrong.X_PM.inverse()
    got = measured(CameraMeasurement(cogiro, believed), X)
    assert got.IsNearlyEqualTo(expected, 1e-14)
    assert not got.IsNearlyEqualTo(X, 1e-2)


@SEEDS
def test_noise_turns_and_shifts_the_target_frame(cogiro: CableRobot, seed: int) -> None:
    robot = noisy(cogiro, position=0.002, orientation=0.003)
    generator = np.random.default_rng(seed)
    X, n = random_pose(generator), generator.normal(size=6)
    X_PM = robot.cameras.X_PM
    true = X @ X_PM
    motion = true.InvertAndCompose(measured(CameraMeasurement(robot), X, n) @ X_PM)
    np.testing.assert_allclose(motion.translation(), 0.002 * n[3:], atol=1e-14)
    # Turned by the quaternion (1, phi / 2): the angle to its third order.
    angle = log_rotation(motion.rotation().matrix())
    np.testing.assert_allclose(angle, 0.003 * n[:3], atol=0.003**3 * np.linalg.norm(n[:3]) ** 3)


def test_statistics_of_the_measured_pose(cogiro: CableRobot) -> None:
    robot = noisy(cogiro, position=0.002, orientation=0.003)
    system = CameraMeasurement(robot)
    generator, X = np.random.default_rng(0), RigidTransform(rotation([0.1, 0.2, -0.1]), [1, 0, 1.0])
    X_PM = robot.cameras.X_PM
    errors = []
    for n in generator.normal(size=(DRAWS, 6)):
        motion = (X @ X_PM).InvertAndCompose(measured(system, X, n) @ X_PM)
        errors.append([*log_rotation(motion.rotation().matrix()), *motion.translation()])
    errors = np.array(errors)
    sigma = np.repeat([0.003, 0.002], 3)
    assert np.all(np.abs(errors.mean(0)) < 5.0 * sigma / math.sqrt(DRAWS))
    np.testing.assert_allclose(errors.std(0) / sigma, 1.0, atol=5.0 / math.sqrt(2.0 * DRAWS))
    correlation = np.corrcoef(errors.T) - np.eye(6)
    assert np.abs(correlation).max() < 5.0 / math.sqrt(DRAWS)


@SEEDS
@pytest.mark.parametrize("connected", [True, False])
def test_derivatives_of_the_measured_pose(cogiro: CableRobot, seed: int, connected: bool) -> None:
    robot = noisy(cogiro, position=0.01, orientation=0.02)
    generator = np.random.default_rng(seed)
    inputs = {"pose": np.concatenate([generator.uniform(-1.2, 1.2, 3), [0.3, -0.2, 1.0]])}
    if connected:
        inputs["noise"] = generator.normal(size=6)
    check_derivatives(CameraMeasurement(robot, misplaced(robot)), inputs)


def test_derivatives_of_the_measured_pose_in_all_quadrants(cogiro: CableRobot) -> None:
    for roll in (-3.0, -1.0, 1.0, 3.0):
        for yaw in (-3.0, -1.0, 1.0, 3.0):
            pose = np.array([roll, 0.4, yaw, 0.3, -0.2, 1.0])
            check_derivatives(CameraMeasurement(cogiro), {"pose": pose})


# --- tangents


def test_tangents_pass_without_noise_and_stay_unit_vectors_with_it(cogiro: CableRobot) -> None:
    system = CableTangentCameras(cogiro)
    values = usual_inputs(cogiro, "CableTangentCameras")
    port = system.GetOutputPort("measured_tangents")
    quiet = port.Eval(fixed_context(system, {"tangents": values["tangents"]}))
    np.testing.assert_allclose(quiet, values["tangents"], atol=1e-15)
    got = port.Eval(fixed_context(system, values)).reshape(8, 3)
    np.testing.assert_allclose(np.linalg.norm(got, axis=1), 1.0, atol=1e-15)
    raw = (values["tangents"] + 2e-3 * values["noise"]).reshape(8, 3)
    np.testing.assert_allclose(got, raw / np.linalg.norm(raw, axis=1)[:, None], atol=1e-15)


def test_statistics_of_the_measured_tangents(cogiro: CableRobot) -> None:
    system = CableTangentCameras(cogiro)
    u = usual_inputs(cogiro, "CableTangentCameras")["tangents"]
    context = fixed_context(system, {"tangents": u})
    noise, port = system.GetInputPort("noise"), system.GetOutputPort("measured_tangents")
    errors = []
    for n in np.random.default_rng(0).normal(size=(DRAWS // 8, 24)):
        noise.FixValue(context, n)
        errors.append((port.Eval(context) - u).reshape(8, 3))
    squares = (np.array(errors) ** 2).sum(axis=2).ravel()
    # Two directions across the tangent, 2 mrad each; along it only to second order.
    sigma = cogiro.cameras.tangent_noise
    assert squares.mean() == pytest.approx(2.0 * sigma**2, rel=5.0 / math.sqrt(squares.size))


@pytest.mark.parametrize("connected", [True, False])
def test_derivatives_of_the_measured_tangents(cogiro: CableRobot, connected: bool) -> None:
    cameras = cogiro.cameras.replace(tangent_noise=0.05)
    values = usual_inputs(cogiro, "CableTangentCameras", optional=connected)
    check_derivatives(CableTangentCameras(cogiro.replace(cameras=cameras)), values)


# --- load cells


def with_cells(robot: CableRobot, **fields: object) -> CableRobot:
    return robot.replace(load_cells=robot.load_cells.replace(**fields))


def filtered(
    system: LoadCellFilter, tension: np.ndarray, time: float, **extra: np.ndarray
) -> np.ndarray:
    """Return what is measured a time after a step from zero, by the exponential of its matrix."""
    n = system.robot.load_cells.order * tension.size
    inputs = {"tension_at_winch": tension, **extra}

    def rate(state: np.ndarray) -> np.ndarray:
        context = fixed_context(system, inputs, state)
        return system.EvalTimeDerivatives(context).CopyToVector()

    constant = rate(np.zeros(n))
    matrix = np.zeros((n + 1, n + 1))
    matrix[:n, n] = constant
    for j, unit in enumerate(np.eye(n)):
        matrix[:n, j] = rate(unit) - constant
    state = np.random.default_rng(0).normal(size=n)
    np.testing.assert_allclose(rate(state), matrix[:n, :n] @ state + constant)  # it is linear
    end = fixed_context(system, inputs, expm(time * matrix)[:n, n])
    return system.GetOutputPort("measured_tension").Eval(end)


@pytest.mark.parametrize("time", [0.02, 0.1, 0.5])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_step_responses(cogiro: CableRobot, order: int, time: float) -> None:
    robot = with_cells(cogiro, order=order, cutoff=2.0)
    steps = np.linspace(100.0, 800.0, 8)
    x = 2.0 * math.pi * 2.0 * time
    rest = math.exp(-x) * sum(x**n / math.factorial(n) for n in range(order))
    got = filtered(LoadCellFilter(robot), steps, time)
    np.testing.assert_allclose(got, steps * (1.0 - rest), rtol=1e-9)


def test_a_simulated_step_response(cogiro: CableRobot) -> None:
    system = LoadCellFilter(with_cells(cogiro, order=2, cutoff=2.0))
    context = fixed_context(system, {"tension_at_winch": np.full(8, 500.0)}, np.zeros(16))
    Simulator(system, context).AdvanceTo(0.1)
    x = 0.4 * math.pi
    got = system.GetOutputPort("measured_tension").Eval(context)
    np.testing.assert_allclose(got, 500.0 * (1.0 - (1.0 + x) * math.exp(-x)), rtol=1e-3)


def test_bias_gain_and_what_the_controller_believes(cogiro: CableRobot) -> None:
    T, n = np.linspace(100.0, 800.0, 8), np.linspace(-1.0, 2.0, 8)
    bias, gain = np.linspace(-30.0, 40.0, 8), np.linspace(0.9, 1.2, 8)
    true = with_cells(cogiro, bias=bias, gain=gain, noise=12.0)
    # Calibrated: the reading is the tension, the noise divided by the gain with it.
    exact = filtered(LoadCellFilter(true), T, 9.0, noise=n)
    np.testing.assert_allclose(exact, T + 12.0 * n / gain, rtol=1e-9)
    # The controller takes the cells for ideal: it sees their reading.
    ideal = filtered(LoadCellFilter(true, cogiro), T, 9.0, noise=n)
    np.testing.assert_allclose(ideal, gain * T + bias + 12.0 * n, rtol=1e-9)
    # Or it corrects ideal cells for what they do not have.
    wrong = filtered(LoadCellFilter(cogiro, true), T, 9.0)
    np.testing.assert_allclose(wrong, (T - bias) / gain, rtol=1e-9)
    reading = LoadCellFilter(true, cogiro).reading(T)
    np.testing.assert_allclose(reading, gain * T + bias)


@pytest.mark.parametrize("order", [1, 2])
def test_a_filter_at_its_reading_rests(cogiro: CableRobot, order: int) -> None:
    system = LoadCellFilter(with_cells(misplaced(cogiro), order=order), cogiro)
    T = np.linspace(100.0, 800.0, 8)
    state = np.tile(system.reading(T), order)
    context = fixed_context(system, {"tension_at_winch": T}, state)
    derivatives = system.EvalTimeDerivatives(context).CopyToVector()
    np.testing.assert_allclose(derivatives, 0.0, atol=1e-9)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("connected", [True, False])
def test_derivatives_of_the_filter(cogiro: CableRobot, order: int, connected: bool) -> None:
    robot = with_cells(misplaced(cogiro), order=order)
    inputs = usual_inputs(cogiro, "LoadCellFilter", optional=connected)
    state = np.tile(usual_state("LoadCellFilter"), order)
    check_derivatives(LoadCellFilter(robot, cogiro), inputs, state)
