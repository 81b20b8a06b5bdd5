"""The one-period map of sampled loops, by two routes and in simulation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import DiscreteTimeDelay, Integrator, LinearSystem, ZeroOrderHold
from study_samples import POSE, miscalibrated

from cdpr_drake.diagrams import make_vision_based_control
from cdpr_drake.errors import LinearizationError
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.study import (
    LinearizationWarning,
    equilibrium,
    linearize,
    one_period_map,
    simulate_modes,
    simulated_period_map,
)
from cdpr_drake.study.sampled import hybrid_model


def sampled_integrator(gain: float, latency_frames: int, phase: float, period: float = 0.1) -> Any:
    """Return x' = u, u = -gain x held from k T + phase on, by a sample of some frames ago."""
    builder = DiagramBuilder()
    x = builder.AddNamedSystem("x", Integrator(1))
    law = builder.AddNamedSystem("law", LinearSystem(D=[[-gain]]))
    hold = builder.AddNamedSystem("hold", ZeroOrderHold(period, 1, offset_sec=phase))
    sampler = builder.AddNamedSystem("sampler", DiscreteTimeDelay(period, latency_frames, 1))
    builder.Connect(x.get_output_port(), sampler.get_input_port())
    builder.Connect(sampler.get_output_port(), law.get_input_port())
    builder.Connect(law.get_output_port(), hold.get_input_port())
    builder.Connect(hold.get_output_port(), x.get_input_port())
    return builder.Build()


def test_by_hand() -> None:
    """x+ = x + phase u + (T - phase) u+, u+ = -gain y, y the sample."""
    gain, phase, T = 3.0, 0.03, 0.1
    diagram = sampled_integrator(gain, 0, phase, T)
    found = one_period_map(diagram, diagram.CreateDefaultContext())
    assert found.states == ("x/x[1]", "hold", "sampler")
    expected = np.array(
        [[1.0 - gain * (T - phase), phase, 0.0], [-gain, 0.0, 0.0], [1.0, 0.0, 0.0]]
    )
    np.testing.assert_allclose(found.matrix, expected, atol=1e-14)
    assert found.period == T and found.is_equilibrium


def test_frames_of_latency_by_hand() -> None:
    """A latency of a frame and a phase: the sample used is one of a frame ago."""
    gain, phase, T = 3.0, 0.03, 0.1
    diagram = sampled_integrator(gain, 1, phase, T)
    found = one_period_map(diagram, diagram.CreateDefaultContext())
    assert found.states == ("x/x[1]", "hold", "sampler/1_frames_ago", "sampler")
    expected = np.array(
        [
            [1.0, phase, 0.0, -gain * (T - phase)],
            [0.0, 0.0, 0.0, -gain],
            [0.0, 0.0, 0.0, 1.0],
            [1.0, 0.0, 0.0, 0.0],
        ]
    )
    np.testing.assert_allclose(found.matrix, expected, atol=1e-14)


def test_updates_at_the_same_instant_read_the_old_state() -> None:
    """Without a phase the hold reads the sample before: a frame of latency more."""
    gain, T = 3.0, 0.1
    diagram = sampled_integrator(gain, 0, 0.0, T)
    found = one_period_map(diagram, diagram.CreateDefaultContext()).matrix
    expected = np.array([[1.0, 0.0, -gain * T], [0.0, 0.0, -gain], [1.0, 0.0, 0.0]])
    np.testing.assert_allclose(found, expected, atol=1e-14)


def test_rates_that_divide_each_other() -> None:
    builder = DiagramBuilder()
    x = builder.AddNamedSystem("x", Integrator(1))
    law = builder.AddNamedSystem("law", LinearSystem(D=[[-1.0]]))
    fast = builder.AddNamedSystem("fast", ZeroOrderHold(0.05, 1))
    slow = builder.AddNamedSystem("slow", ZeroOrderHold(0.1, 1, offset_sec=0.02))
    builder.Connect(x.get_output_port(), fast.get_input_port())
    builder.Connect(fast.get_output_port(), law.get_input_port())
    builder.Connect(law.get_output_port(), slow.get_input_port())
    builder.Connect(slow.get_output_port(), x.get_input_port())
    diagram = builder.Build()
    found = one_period_map(diagram, diagram.CreateDefaultContext())
    assert found.period == 0.1
    # fast takes x at 0, slow -x(0) at 0.02; fast x at 0.05 = x + 0.02 u - 0.03 x.
    expected = np.array([[1.0 - 0.08, 0.0, 0.02], [1.0 - 0.03, 0.0, 0.02], [-1.0, 0.0, 0.0]])
    np.testing.assert_allclose(found.matrix, expected, atol=1e-14)


def extrapolated(loop: Any, context: Any, periods: int = 1) -> np.ndarray:
    """Return the simulated map at two steps of the third-order integrator, carried on to zero."""
    coarse = simulated_period_map(loop, context, step=2e-3, periods=periods)
    fine = simulated_period_map(loop, context, step=1e-3, periods=periods)
    return fine + (fine - coarse) / 7.0


@pytest.mark.parametrize("latency", [0.0, 0.02, 0.04, 0.05, 0.09, 0.1, 0.13])
def test_drake_s_simulator_agrees(cogiro: CableRobot, latency: float) -> None:
    loop = make_vision_based_control(cogiro, "SLSM", gain=1.0, latency=latency)
    context = equilibrium(loop, POSE)
    exact = one_period_map(loop, context).matrix
    assert np.abs(extrapolated(loop, context) - exact).max() <= 1e-6 * np.abs(exact).max()


def test_the_difference_is_the_integrator_s(cogiro: CableRobot) -> None:
    """It falls with the third power of the step."""
    loop = make_vision_based_control(cogiro, "SLSM", gain=1.0, latency=0.04)
    context = equilibrium(loop, POSE)
    exact = one_period_map(loop, context).matrix
    coarse, fine = (
        np.abs(simulated_period_map(loop, context, step=step) - exact).max()
        for step in (1e-3, 5e-4)
    )
    assert fine <= 1e-6 * np.abs(exact).max()
    assert coarse / fine == pytest.approx(8.0, rel=0.1)


def test_with_a_wrong_calibration_too(cogiro: CableRobot) -> None:
    loop = make_vision_based_control(cogiro, "SLSM", gain=1.0, believed=miscalibrated(cogiro))
    context = equilibrium(loop, POSE)
    found = one_period_map(loop, context, require_equilibrium=True).matrix
    assert np.abs(extrapolated(loop, context) - found).max() <= 1e-6 * np.abs(found).max()


def test_two_periods_are_the_square(cogiro: CableRobot) -> None:
    loop = make_vision_based_control(cogiro, "SLSM", gain=1.0, latency=0.04)
    context = equilibrium(loop, POSE)
    one = one_period_map(loop, context).matrix
    two = extrapolated(loop, context, periods=2)
    assert np.abs(two - one @ one).max() <= 2e-6 * np.abs(one @ one).max()


@pytest.mark.parametrize("latency", [0.0, 0.04, 0.1])
def test_two_directions_are_neutral(cogiro: CableRobot, latency: float) -> None:
    loop = make_vision_based_control(cogiro, "ECM", latency=latency)
    z = one_period_map(loop, equilibrium(loop, POSE)).eigenvalues
    z = z[np.argsort(np.abs(z - 1.0))]
    assert np.abs(z[:2] - 1.0).max() < 1e-9
    servo = np.log(z[2:8]) / 0.05
    np.testing.assert_allclose(servo, -0.1, rtol=0.02)
    assert np.abs(z[2:]).max() < 1.0


def test_for_short_periods_it_is_the_continuous_loop(cogiro: CableRobot) -> None:
    sampled = make_vision_based_control(cogiro, "ECM", sample_time=1e-3, latency=0.0)
    continuous = make_vision_based_control(cogiro, "ECM", sample_time=None)
    z = one_period_map(sampled, equilibrium(sampled, POSE)).eigenvalues
    s = linearize(continuous, equilibrium(continuous, POSE), [], []).eigenvalues
    rates = np.log(z[np.abs(z) > 0.5]) / 1e-3
    for value in s[np.abs(s) < 60.0]:
        assert np.abs(rates - value).min() < 2e-3 * max(1.0, abs(value))


def test_the_parts_of_the_loop(cogiro: CableRobot) -> None:
    loop = make_vision_based_control(cogiro, latency=0.07)
    model = hybrid_model(loop, equilibrium(loop, POSE))
    offsets = sorted(offset for offset, _, _ in model.events)
    assert offsets == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.02])
    held = [i for i, name in enumerate(model.states[52:]) if name.startswith("held_rates")]
    np.testing.assert_array_equal(np.flatnonzero(model.E.any(axis=0)), held)
    np.testing.assert_allclose(model.flow(0.01) @ model.flow(0.02), model.flow(0.03), atol=1e-9)


@pytest.mark.needs("numba")
def test_the_servo_s_modes_decay_in_simulation_as_predicted(cogiro: CableRobot) -> None:
    loop = make_vision_based_control(cogiro, "SLSM", gain=0.1, latency=0.04)
    followed = simulate_modes(loop, equilibrium(loop, POSE), 8.0, which=range(6), max_step=5e-3)
    for mode in followed:
        assert mode.predicted.imag == 0.0
        assert mode.growth == pytest.approx(mode.predicted.real, rel=1e-3)


# --- never a crash


def test_off_equilibrium_warns_raises_or_is_silent_as_asked(cogiro: CableRobot) -> None:
    loop = make_vision_based_control(cogiro)
    context = equilibrium(loop, POSE)
    loop.GetInputPort("desired_pose").FixValue(context, np.add(POSE, [0, 0, 0, 0.1, 0, 0]))
    with pytest.warns(LinearizationWarning, match=r"held_rates.* drifts"):
        one_period_map(loop, context)
    with pytest.raises(LinearizationError, match="not at rest"):
        one_period_map(loop, context, require_equilibrium=True)
    assert not one_period_map(loop, context, require_equilibrium=False).is_equilibrium


def test_a_gain_on_its_ramp_is_warned_of(cogiro: CableRobot) -> None:
    loop = make_vision_based_control(cogiro)
    context = equilibrium(loop, POSE)
    context.SetTime(0.5)
    with pytest.warns(LinearizationWarning, match="gain of 0.05/s") as warned:
        one_period_map(loop, context)
    assert warned[0].filename == __file__


def test_what_has_no_period_is_refused(cogiro: CableRobot) -> None:
    continuous = make_vision_based_control(cogiro, sample_time=None)
    with pytest.raises(LinearizationError, match=r"no sampled block.*linearize"):
        one_period_map(continuous, continuous.CreateDefaultContext())
    noisy = make_vision_based_control(cogiro, noise=True)
    with pytest.raises(LinearizationError, match=r'"pose_noise" \(RandomSource\)'):
        one_period_map(noisy, noisy.CreateDefaultContext())


def test_rates_that_do_not_divide_each_other_are_refused() -> None:
    builder = DiagramBuilder()
    for name, period in (("a", 0.05), ("b", 0.07)):
        hold = builder.AddNamedSystem(name, ZeroOrderHold(period, 1))
        builder.ExportInput(hold.get_input_port(), name)
    diagram = builder.Build()
    with pytest.raises(LinearizationError, match=r'block "a" updates every 0\.05 s'):
        one_period_map(diagram, diagram.CreateDefaultContext())


def test_an_open_port_is_named(cogiro: CableRobot) -> None:
    loop = make_vision_based_control(cogiro)
    rest = equilibrium(loop, POSE)
    context = loop.CreateDefaultContext()
    context.SetTimeStateAndParametersFrom(rest)
    with pytest.raises(LinearizationError, match='input port "desired_pose" is open'):
        one_period_map(loop, context)


def test_the_map_says_what_it_is(cogiro: CableRobot) -> None:
    loop = make_vision_based_control(cogiro, latency=0.0)
    assert repr(one_period_map(loop, equilibrium(loop, POSE))) == (
        "<OnePeriodMap: 84 states, period 0.05 s>"
    )
    assert math.isclose(one_period_map(loop, equilibrium(loop, POSE)).period, 0.05)
