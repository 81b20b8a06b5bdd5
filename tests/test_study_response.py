"""Responses and the numbers that describe them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from study_samples import POSE

from cdpr_drake.diagrams import make_vision_based_control, simulate
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import as_pose, exp_rotation, pose_to_vector
from cdpr_drake.study import (
    equilibrium,
    excursion,
    initial_response,
    linearize,
    pose_error_response,
    record_metrics,
    response_metrics,
    side_by_side,
    step_response,
)
from cdpr_drake.study.response import free_response

T = np.linspace(0.0, 100.0, 10001)


def straight(rate: float = 0.1) -> np.ndarray:
    """Return an error that decays exponentially along a line."""
    return np.exp(-rate * T)[:, None] * np.array([0.1, -0.2, 0.05, 1.0, -0.5, 0.3])


def test_an_exponential_on_a_line() -> None:
    metrics = response_metrics(T, straight())
    size = math.sqrt(1.34)
    assert metrics.excursion_mm == pytest.approx(0.0, abs=1e-9)
    assert metrics.excursion_deg == pytest.approx(0.0, abs=1e-9)
    assert metrics.rise == pytest.approx((math.log(9.0) / 0.1,) * 2, rel=1e-4)
    assert metrics.settling == pytest.approx((math.log(50.0) / 0.1,) * 2, rel=1e-4)
    angle = math.degrees(np.linalg.norm([0.1, 0.2, 0.05]))
    expected = (math.log(1e3 * size) / 0.1, math.log(angle / 0.1) / 0.1)
    assert metrics.settling_absolute == pytest.approx(expected, rel=1e-4)
    assert metrics.final == pytest.approx((1e3 * size * math.exp(-10), angle * math.exp(-10)))
    assert metrics.tension_range is None


def test_what_goes_sideways_and_what_overshoots_is_excursion() -> None:
    error = straight()
    error[:, 3:] = np.exp(-0.1 * T)[:, None] * [1.0, 0.0, 0.0]
    error[:, 4] = 0.02 * np.sin(T)
    error[:, :3] = 0.0
    error[:, 2] = math.radians(0.3) * np.sin(T)
    assert excursion(error) == pytest.approx((0.02, math.radians(0.3)), rel=1e-4)
    beyond = np.zeros((3, 6))
    beyond[:, 3] = [1.0, 0.2, -0.05]  # past the goal by 5 cm
    assert excursion(beyond) == pytest.approx((0.05, 0.0))
    away = np.zeros((3, 6))
    away[:, 3] = [1.0, 1.3, 0.0]  # the wrong way by 30 cm
    assert excursion(away) == pytest.approx((0.3, 0.0))


def test_what_does_not_happen_takes_infinitely_long() -> None:
    error = np.ones((T.size, 6))
    error[:, :3] = 0.0
    metrics = response_metrics(T, error)
    assert metrics.rise == (math.inf, math.inf)
    assert metrics.settling[0] == metrics.settling_absolute[0] == math.inf
    assert metrics.settling[1] == 0.0


def test_leaving_again_counts() -> None:
    error = straight()
    error[8000] = 0.5
    assert response_metrics(T, error).settling[0] == pytest.approx(80.01, abs=0.01)


def test_tensions_and_thresholds() -> None:
    pull = np.array([[100.0, 300.0], [80.0, 250.0]])
    metrics = response_metrics([0.0, 1.0], np.zeros((2, 6)), pull, threshold=(5.0, 1.0))
    assert metrics.tension_range == (80.0, 300.0) and metrics.threshold == (5.0, 1.0)
    with pytest.raises(ValueError, match="times"):
        response_metrics([0.0, 1.0], np.zeros((3, 6)))


def test_free_responses_are_exponentials() -> None:
    A = np.array([[-0.1, 1.0], [-1.0, -0.1]])
    for time in (np.array([0.0, 0.5, 1.0]), np.array([0.2, 0.5, 1.7])):
        x = free_response(A, time, [1.0, 0.0])
        decay = np.exp(-0.1 * time)
        expected = np.column_stack([decay * np.cos(time), -decay * np.sin(time)])
        np.testing.assert_allclose(x, expected, atol=1e-12)


def test_responses_of_a_model_agree_with_scipy(cogiro: CableRobot) -> None:
    from scipy.signal import lsim

    loop = make_vision_based_control(cogiro, sample_time=None)
    model = linearize(loop, equilibrium(loop, POSE), ["desired_pose"], ["pose_error"])
    time = np.linspace(0.0, 2.0, 201)
    step = step_response(model, {"desired_pose/x": 0.1, "desired_pose/yaw": -0.05}, time)
    u = np.tile([0.0, 0.0, -0.05, 0.1, 0.0, 0.0], (time.size, 1))
    np.testing.assert_allclose(step, lsim(model.to_scipy(), u, time)[1], atol=1e-9)
    x0 = np.zeros(52)
    x0[5] = 0.01
    free = initial_response(model, x0, time)
    np.testing.assert_allclose(free, lsim(model.to_scipy(), 0 * u, time, x0)[1], atol=1e-9)
    with pytest.raises(KeyError, match='no input "nonsense"'):
        step_response(model, {"nonsense": 1.0}, time)


@pytest.mark.needs("numba")
def test_a_linear_model_beside_a_simulation(cogiro: CableRobot) -> None:
    """A move of 5 cm and 1 degree: small enough for the linear model to be right within 2 %."""
    loop = make_vision_based_control(cogiro, "SLSM", gain=0.2, sample_time=None)
    goal = equilibrium(loop, POSE)
    model = linearize(loop, goal, ["desired_pose"], ["pose_error", "tension_at_winch"])
    error = np.array([0.0, 0.0, math.radians(1.0), 0.04, 0.0, 0.03])
    X_PM = cogiro.cameras.X_PM
    X_MM = type(X_PM)(exp_matrix(error[:3]), error[3:])
    start = as_pose(POSE) @ X_PM @ X_MM.inverse() @ X_PM.inverse()
    context = equilibrium(loop, pose_to_vector(start))
    loop.GetInputPort("desired_pose").FixValue(context, POSE)
    record = simulate(loop, context, context.get_time() + 25.0, max_step=0.01)
    time = record.time - record.time[0]
    linear = pose_error_response(model, error, time)
    np.testing.assert_allclose(record["pose_error"][0], error, atol=1e-12)
    assert np.abs(linear - record["pose_error"]).max() < 4e-4
    a, b = response_metrics(time, linear), record_metrics(record)
    assert a.settling == pytest.approx(b.settling, rel=0.02)
    assert a.rise == pytest.approx(b.rise, rel=0.02)
    assert a.excursion_mm == pytest.approx(b.excursion_mm, abs=0.2)
    assert b.tension_range is not None and 0.0 < b.tension_range[0] < b.tension_range[1]
    table = side_by_side({"linear": a, "simulated": b})
    assert "linear" in table.splitlines()[0] and "simulated" in table.splitlines()[0]
    assert max(len(line) for line in table.splitlines()) <= 80
    assert str(b).splitlines() == side_by_side({"": b}).splitlines()


def exp_matrix(rotation_vector: np.ndarray) -> object:
    from pydrake.math import RotationMatrix

    return RotationMatrix(exp_rotation(rotation_vector))
