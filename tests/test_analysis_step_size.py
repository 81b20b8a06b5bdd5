"""Which step of the integrator a robot's modes allow."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.systems.primitives import LinearSystem
from scipy.linalg import expm

from cdpr_drake.analysis import StepWarning, platform_modes, step_error, step_limit
from cdpr_drake.diagrams import make_simulator
from cdpr_drake.diagrams.simulation import MAX_STEP
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.step_size import (
    LARGEST_ERROR,
    LEAST_DAMPING,
    amplification,
    largest_steps,
    suitable_steps,
)
from cdpr_drake.runs import prepare, setup_of_test
from cdpr_drake.study import modes

SHORT: dict[str, Any] = {"noise": False, "until": 1.0}


@pytest.mark.parametrize("eigenvalue", [-40.0 + 90.0j, -1.0 + 30.0j, -120.0 + 0.0j, 5.0 + 20.0j])
@pytest.mark.parametrize("step", [0.002, 0.01, 0.025])
def test_the_error_is_that_of_the_integrator(eigenvalue: complex, step: float) -> None:
    a, b = eigenvalue.real, eigenvalue.imag
    A = np.array([[a, b], [-b, a]])
    system = LinearSystem(A, np.zeros((2, 0)), np.eye(2), np.zeros((2, 0)))
    context = system.CreateDefaultContext()
    start = np.array([1.0, 0.0])
    context.SetContinuousState(start)
    make_simulator(system, context, max_step=step).AdvanceTo(step)
    miss = context.get_continuous_state_vector().CopyToVector() - expm(A * step) @ start
    expected = np.linalg.norm(miss) / abs(eigenvalue * step)
    assert step_error(eigenvalue, step) == pytest.approx(expected, rel=1e-6)


def test_the_fastest_mode_sets_the_limit() -> None:
    found = step_limit(modes(np.diag([-1.0, -50.0, 0.0])), error=0.02)
    assert found.mode.eigenvalue == pytest.approx(-50.0)
    assert step_error(-50.0, found.step) == pytest.approx(0.02)
    slower = step_limit(modes(np.diag([-1.0, -25.0])), error=0.02)
    assert slower.step == pytest.approx(2.0 * found.step)
    with pytest.raises(ValueError, match="there are none"):
        step_limit(modes(np.zeros((2, 2))))
    with pytest.raises(ValueError, match="positive"):
        step_limit(modes(-np.eye(2)), error=0.0)


def test_the_default_step_suits_small_and_large_robots(cogiro: CableRobot) -> None:
    for robot in (cogiro, load_robot("cogiro-98m")):
        limit = step_limit(platform_modes(robot, [0, 0, 0, 0, 0, 2.0], "controlled"))
        assert MAX_STEP < limit.step < 2.0 * MAX_STEP
        assert 15.0 < limit.mode.frequency < 16.0  # the winches'


def test_a_run_with_coarse_steps_warns(cogiro: CableRobot) -> None:
    with pytest.warns(StepWarning, match=r"step of 25 ms is too coarse for a mode at 15.5 Hz"):
        prepare(setup_of_test(4, max_step=0.025, **SHORT))
    stiff = cogiro.replace(winch=cogiro.winch.replace(proportional_gain=2670.0))
    with pytest.warns(StepWarning, match="of 10 ms is too coarse for a mode at 4"):
        prepare(setup_of_test(4, stiff, max_step=0.01, **SHORT))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for robot in (cogiro, stiff):
            prepare(setup_of_test(4, robot, **SHORT))


@given(
    st.floats(1.0, 1e4),
    st.floats(0.0, 1.0),
    st.sampled_from([largest_steps, suitable_steps]),
)
def test_the_largest_step_is_the_one_of_the_error_allowed(
    rate: float, damping: float, steps: Callable[[complex], np.ndarray]
) -> None:
    eigenvalue = rate * complex(-damping, np.sqrt(1.0 - damping**2))
    allowed = LARGEST_ERROR
    if steps is suitable_steps:
        allowed *= max(damping, LEAST_DAMPING)
    (step,) = steps(eigenvalue)
    assert step_error(eigenvalue, step) == pytest.approx(allowed, rel=1e-6)
    assert step_error(eigenvalue, 0.9 * step) < allowed < step_error(eigenvalue, 1.1 * step)
    assert abs(amplification(step * eigenvalue)) < 1.0 + 1e-3  # far from where it is unstable


def test_what_does_not_move_limits_no_step() -> None:
    np.testing.assert_array_equal(largest_steps([0.0, -1.0]) == np.inf, [True, False])
    assert suitable_steps([]).size == 0
