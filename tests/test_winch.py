"""Winches: the PID against the exact linear solution, saturation, friction, derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context
from scipy.linalg import expm
from system_checks import check_derivatives, evaluate, fixed_context
from test_servo import few_cables

from cdpr_drake.model.robot import CableRobot, Winch
from cdpr_drake.systems import WinchDynamics


def robot_with(cogiro: CableRobot, k: int = 1, **fields: object) -> CableRobot:
    """Return CoGiRo with its first k cables and some fields of its winch changed."""
    few = few_cables(cogiro, k)
    return few.replace(winch=few.winch.replace(**fields))


def at(system: WinchDynamics, state: object, desired: object, tension: object) -> Context:
    inputs = {
        "desired_motor_angle": np.array(desired, float),
        "tension_at_drawing_point": np.array(tension, float),
    }
    return fixed_context(system, inputs, np.array(state, float))


def run(system: WinchDynamics, context: Context, until: float, accuracy: float) -> np.ndarray:
    """Return the state after a time, with error control."""
    simulator = Simulator(system, context)
    simulator.get_mutable_integrator().set_target_accuracy(accuracy)
    simulator.AdvanceTo(until)
    return context.get_continuous_state_vector().CopyToVector()


# --- values


def test_derivatives_and_outputs_by_hand(cogiro: CableRobot) -> None:
    robot = robot_with(
        cogiro, 2, damping=0.5, encoder_zero_length=np.array([6.0, 7.0]), torque_limit=1e4
    )
    system = WinchDynamics(robot)
    context = at(system, [10.0, 20.0, 1.5, -2.0, 0.3, -0.1], [10.2, 19.5], [400.0, 900.0])
    values = evaluate(system, context)
    # Kp 267, Ki 57, Kd 2.7, J 0.03, r 0.0225.
    torque = np.array([267 * 0.2 + 57 * 0.3 - 2.7 * 1.5, 267 * -0.5 + 57 * -0.1 + 2.7 * 2.0])
    acceleration = (torque + 0.0225 * np.array([400.0, 900.0]) - 0.5 * np.array([1.5, -2])) / 0.03
    expected = {
        "unstrained_length": [6.0 + 0.225, 7.0 + 0.45],
        "unstrained_length_rate": [0.0225 * 1.5, 0.0225 * -2.0],
        "motor_angle": [10.0, 20.0],
        "motor_rate": [1.5, -2.0],
        "motor_torque": torque,
        "tension_at_winch": [400.0, 900.0],
        "state": [10.0, 20.0, 1.5, -2.0, 0.3, -0.1],
        "derivatives": [1.5, -2.0, *acceleration, 0.2, -0.5],
    }
    assert set(values) == set(expected)
    for name, value in expected.items():
        np.testing.assert_allclose(values[name], value, rtol=1e-12, err_msg=name)


def test_a_tension_pays_the_cable_out_and_torque_holds_it(cogiro: CableRobot) -> None:
    system = WinchDynamics(few_cables(cogiro, 1))
    free = evaluate(system, at(system, [0, 0, 0], [0], [500.0]))
    assert free["derivatives"][1] == pytest.approx(0.0225 * 500.0 / 0.03)
    held = evaluate(system, at(system, [0, 0, -0.0225 * 500.0 / 57.0], [0], [500.0]))
    np.testing.assert_allclose(held["derivatives"], 0.0, atol=1e-12)
    np.testing.assert_allclose(held["motor_torque"], -0.0225 * 500.0)


def linear_solution(
    w: Winch, state: np.ndarray, desired: float, T_A: float, t: float
) -> np.ndarray:
    """Return [angle, rate, integral] of one unsaturated winch after a time."""
    Kp, Ki, Kd = w.proportional_gain, w.integral_gain, w.derivative_gain
    A = np.zeros((4, 4))  # of [angle, rate, integral, 1]
    A[0, 1] = 1.0
    A[1] = [-Kp, -Kd - w.damping, Ki, Kp * desired + w.transmission * T_A]
    A[1] /= w.inertia
    A[2] = [-1.0, 0.0, 0.0, desired]
    return (expm(A * t) @ [*state, 1.0])[:3]


@pytest.mark.parametrize("time", [0.01, 0.05, 0.3, 4.0])
def test_a_step_follows_the_exact_linear_solution(cogiro: CableRobot, time: float) -> None:
    robot = robot_with(cogiro, damping=0.2)
    system = WinchDynamics(robot)
    state = np.array([3.0, 0.0, -0.0225 * 400.0 / 57.0])
    end = run(system, at(system, state, [3.2], [420.0]), time, 1e-8)
    exact = linear_solution(robot.winch, state, 3.2, 420.0, time)
    np.testing.assert_allclose(end, exact, rtol=0.0, atol=1e-6)


def test_the_integral_removes_the_error_a_load_leaves(cogiro: CableRobot) -> None:
    system = WinchDynamics(few_cables(cogiro, 1))
    context = at(system, [0, 0, 0], [0.0], [300.0])
    assert run(system, context, 0.6, 1e-6)[0] == pytest.approx(0.0225 * 300.0 / 267.0, rel=0.15)
    assert abs(run(system, context, 40.0, 1e-6)[0]) < 1e-5  # slow pole -Ki / Kp = -0.21 per s
    (integral,) = context.get_continuous_state_vector().CopyToVector()[2:]
    assert integral == pytest.approx(-0.0225 * 300.0 / 57.0, rel=1e-3)


# --- saturation


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_torque_is_limited_and_the_integral_held(cogiro: CableRobot, sign: float) -> None:
    system = WinchDynamics(few_cables(cogiro, 1))  # 120 N m

    def values(angle: float, integral: float) -> tuple[float, float, float]:
        got = evaluate(system, at(system, [-sign * angle, 0, sign * integral], [0.0], [0.0]))
        return got["motor_torque"][0], got["derivatives"][1], got["derivatives"][2]

    torque, acceleration, integrate = values(1.0, 0.0)  # an error of 1 rad asks for 267 N m
    assert torque == sign * 120.0
    assert acceleration == pytest.approx(sign * 120.0 / 0.03)
    assert integrate == 0.0  # it would push further out
    torque, _, integrate = values(-0.1, 10.0)  # the integral asks for 570 N m, the error for -27
    assert torque == sign * 120.0
    assert integrate == pytest.approx(-sign * 0.1)  # it brings the torque back
    torque, _, integrate = values(0.4, 0.0)  # 107 N m, within the limit
    assert torque == pytest.approx(sign * 106.8)
    assert integrate == pytest.approx(sign * 0.4)


def test_a_long_saturation_does_not_wind_the_integral_up(cogiro: CableRobot) -> None:
    """A step that saturates for a second, and what integrating through it would have left."""
    robot = robot_with(cogiro, torque_limit=8.0, damping=0.5)
    system = WinchDynamics(robot)
    target, load = 10.0, 100.0
    hold = -0.0225 * load / 57.0
    context = at(system, [0.0, 0.0, hold], [target], [load])
    held, wound, saturated = [hold], hold, 0.0
    for step in range(1, 401):
        state = run(system, context, 0.01 * step, 1e-7)
        torque = system.GetOutputPort("motor_torque").Eval(context)[0]
        assert abs(torque) <= 8.0
        held.append(state[2])
        wound += 0.01 * (target - state[0])
        saturated += 0.01 * (abs(torque) == 8.0)
    assert saturated > 0.3
    assert max(np.abs(held)) < 0.5 * abs(wound)
    end = run(system, context, 60.0, 1e-6)
    np.testing.assert_allclose(end, [target, 0.0, hold], atol=2e-4)


# --- friction: it takes energy, whichever way the winch turns


@pytest.mark.parametrize("rate", [-3.0, -0.05, 0.0, 0.05, 3.0])
def test_dry_friction_opposes_the_motion(cogiro: CableRobot, rate: float) -> None:
    smooth = WinchDynamics(few_cables(cogiro, 1))
    rough = WinchDynamics(robot_with(cogiro, coulomb_torque=0.8, coulomb_rate=0.1))
    state = [0.0, rate, 0.0]
    without = evaluate(smooth, at(smooth, state, [0.0], [300.0]))["derivatives"][1]
    friction = 0.03 * (
        evaluate(rough, at(rough, state, [0.0], [300.0]))["derivatives"][1] - without
    )
    assert friction == pytest.approx(-0.8 * np.tanh(rate / 0.1), abs=1e-12)
    assert friction * rate <= 0.0


@pytest.mark.parametrize("rate", [-3.0, -0.05, 0.0, 0.05, 3.0])
def test_the_eyelet_raises_the_winch_s_share_when_it_reels_in(
    cogiro: CableRobot, rate: float
) -> None:
    system = WinchDynamics(robot_with(cogiro, capstan_exponent=0.2, capstan_speed=0.002))
    T_A, speed = 300.0, 0.0225 * rate
    context = at(system, [0.0, rate, 0.0], [0.0], [T_A])
    T_W = system.GetOutputPort("tension_at_winch").Eval(context)[0]
    assert pytest.approx(T_A * np.exp(-0.2 * np.tanh(speed / 0.002))) == T_W
    # The cable takes T_A dl/dt from what is beyond the eyelet, the drum gets T_W dl/dt.
    assert (T_A - T_W) * speed >= 0.0
    if rate < -1.0:
        assert pytest.approx(T_A * np.exp(0.2), rel=1e-6) == T_W
    # The winch's own tension accelerates it.
    derivatives = evaluate(system, context)["derivatives"]
    assert derivatives[1] == pytest.approx((-2.7 * rate + 0.0225 * T_W) / 0.03)


# --- derivatives


CASES = {
    "default": {},
    "saturated": {"torque_limit": 10.0},
    "viscous": {"damping": 0.3},
    "friction": {"coulomb_torque": 0.8, "coulomb_rate": 0.5},
    "capstan": {"capstan_exponent": 0.2, "capstan_speed": 0.05},
    "all": {
        "damping": 0.3,
        "coulomb_torque": 0.8,
        "coulomb_rate": 0.5,
        "capstan_exponent": 0.2,
        "capstan_speed": 0.05,
        "torque_limit": 10.0,
    },
}


@pytest.mark.parametrize("fields", CASES.values(), ids=CASES)
def test_derivatives(cogiro: CableRobot, fields: dict[str, float]) -> None:
    generator = np.random.default_rng(0)
    robot = robot_with(cogiro, 8, **fields)
    state = np.concatenate([generator.uniform(-0.1, 0.1, 8), generator.uniform(-2.0, 2.0, 16)])
    inputs = {
        "desired_motor_angle": generator.uniform(-0.2, 0.2, 8),
        "tension_at_drawing_point": generator.uniform(100.0, 900.0, 8),
    }
    system = WinchDynamics(robot)
    torque = system.GetOutputPort("motor_torque").Eval(fixed_context(system, inputs, state))
    some = np.abs(torque) == robot.winch.torque_limit
    assert some.any() == ("torque_limit" in fields) and not some.all()
    check_derivatives(system, inputs, state)
