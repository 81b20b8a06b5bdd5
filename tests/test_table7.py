"""Table 7: the loop without dynamics is the simulation's, and the section says what came out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cdpr_drake.errors import EquilibriumError
from cdpr_drake.model.robot import load_robot
from cdpr_drake.model.servo import ServoSettings
from reproduction.assumptions import assumed, assumptions
from reproduction.table7 import drag, work
from reproduction.table7 import section as table7
from reproduction.table7 import variations as table7_variations
from reproduction.table7.claims import ALONG, excursions, one_for_three
from reproduction.table7.large_robot import (
    GOAL,
    MODELS,
    START,
    believed_robot,
    final_errors,
    printed_errors,
    slow_run,
    time_to,
    true_robot,
)
from reproduction.table7.quasi_static import run_quasi_static
from reproduction.table7.variations import slow_errors, variations, vary


@pytest.fixture(scope="module")
def values() -> dict[str, Any]:
    return assumed("table7")


@pytest.fixture(scope="module")
def slow(values: dict[str, Any]) -> np.ndarray:
    return slow_errors(values)


@pytest.fixture(scope="module")
def moves() -> dict[str, Any]:
    return {f"move_{m}": work.move(m) for m in ("ECM", "SLSM")}


def test_an_exact_model_goes_straight_home_at_the_pace_of_the_gain(values: dict[str, Any]) -> None:
    run = slow_run(values | {"target_angle": 0.0, "ramp_time": 0.0}, "ECM")
    distance = np.linalg.norm(run.position_error, axis=1)
    expected = 20.0 * np.exp(-values["gain"] * run.time)
    np.testing.assert_allclose(distance, expected, rtol=0.01)
    assert np.abs(run.position_error[:, 1:]).max() < 0.02
    assert np.degrees(np.abs(run.rotation_error).max()) < 0.05


def test_a_ramp_takes_half_its_time(values: dict[str, Any]) -> None:
    error = values | {"target_angle": 0.0}
    with_ramp, without = (
        slow_run(error | {"ramp_time": ramp}, "ECM").position_error[-1, 0] for ramp in (10.0, 0.0)
    )
    assert with_ramp / without == pytest.approx(np.exp(5.0 * values["gain"]), rel=5e-3)


def test_a_turned_target_frame_leaves_the_platform_turned(values: dict[str, Any]) -> None:
    robot = true_robot(values)
    settings = ServoSettings(cable_model="ECM", gain=values["gain"])
    run = run_quasi_static(robot, believed_robot(robot, values), GOAL, GOAL, settings, 150.0)
    left = np.degrees(run.rotation_error[-1])
    signs = np.array(values["target_signs"])
    np.testing.assert_allclose(left, values["target_angle"] * signs, rtol=1e-3)
    assert np.linalg.norm(run.position_error[-1]) < 1e-5


def test_a_finer_step_changes_little(values: dict[str, Any]) -> None:
    robot = true_robot(values)
    settings = ServoSettings(cable_model="SLSM", gain=0.06, ramp_time=10.0)
    coarse, fine = (
        run_quasi_static(robot, robot, START, GOAL, settings, 105.0, step=step)
        for step in (1.5, 0.75)
    )
    np.testing.assert_allclose(coarse.position_error[-1], fine.position_error[-1], rtol=0.01)


def test_the_cable_gets_thicker_and_the_platform_larger(values: dict[str, Any]) -> None:
    thin, robot = load_robot("cogiro-98m"), true_robot(values)
    ratio = robot.cable.linear_density / thin.cable.linear_density
    assert robot.cable.section / thin.cable.section == pytest.approx(ratio)
    assert (robot.cable.diameter / thin.cable.diameter) ** 2 == pytest.approx(ratio)
    assert robot.cable.stiffness(0.0) == pytest.approx(60e9 * robot.cable.section)
    scale = np.linalg.norm(robot.attachment_points) / np.linalg.norm(thin.attachment_points)
    assert scale == pytest.approx(values["platform_scale"])
    assert robot.mass == values["mass"]


def test_what_is_left_has_the_order_and_size_printed(slow: np.ndarray) -> None:
    assert np.all(np.diff(slow[:, 0]) > 0.0)
    assert slow[3, 0] > 3.0 * slow[0, 0]
    assert np.exp(np.abs(np.log(slow / printed_errors()))).max() < 1.5


@pytest.mark.slow
@pytest.mark.needs("numba")  # without, it takes minutes
def test_no_fitted_value_does_better_elsewhere(values: dict[str, Any], slow: np.ndarray) -> None:
    def cost(errors: np.ndarray) -> float:
        return float((np.log(errors / printed_errors()) ** 2).sum())

    at_file = cost(slow)
    for name, factor in (
        ("linear_density", 1.1),
        ("platform_scale", 1.2),
        ("gain", 1.02),
        ("target_angle", 1.1),
    ):
        assert assumptions("table7")[name].kind == "fitted"
        for change in (factor, 1.0 / factor):
            assert cost(slow_errors(values | {name: values[name] * change})) > at_file, name


@pytest.mark.slow
@pytest.mark.needs("numba")  # without, it takes minutes
def test_dynamics_change_the_end_little(moves: dict[str, Any], slow: np.ndarray) -> None:
    for i, model in ((0, "ECM"), (3, "SLSM")):
        result = moves[f"move_{model}"]
        full = final_errors(result["position_error"], result["orientation_error"])
        np.testing.assert_allclose(full, slow[i], rtol=0.05)
        ratio = np.array(full) / printed_errors()[i]
        assert np.exp(np.abs(np.log(ratio))).max() < 1.5


@pytest.mark.slow
@pytest.mark.needs("numba")  # without, it takes minutes
def test_only_the_straight_line_model_strays(moves: dict[str, Any]) -> None:
    ecm, slsm = (np.array(excursions(moves[f"move_{m}"])) for m in ("ECM", "SLSM"))
    assert slsm[0] > 5.0 * ecm[0] and slsm[1] > 4.0 * ecm[1]


@pytest.mark.slow
@pytest.mark.needs("numba")  # without, it takes minutes
def test_a_run_holds_what_its_figure_needs(moves: dict[str, Any]) -> None:
    result = moves["move_ECM"]
    n = len(result["time"])
    assert result["time"][-1] == pytest.approx(105.0)
    shapes = {"position_error": 3, "orientation_error": 3, "velocity": 3, "tension": 8}
    for key, width in shapes.items():
        assert result[key].shape == (n, width)
    travelled = np.trapezoid(result["velocity"], result["time"], axis=0)
    np.testing.assert_allclose(
        travelled, result["position_error"][0] - result["position_error"][-1], atol=0.01
    )


@pytest.mark.slow
def test_an_undamped_mode_grows_at_half_the_gain(values: dict[str, Any]) -> None:
    """And drag of the size of the gain stops it; the simulations have more all along the way."""
    for x in (0.0, 20.0):
        found = work.stability(x)
        assert found["growth"] == pytest.approx(0.5 * values["gain"], rel=0.05)
        assert found["drag"] == pytest.approx(values["gain"], rel=0.05)
        assert found["drag"] < 0.6 * values["drag"]
        assert found["damping_time"] > 100 * values["damping_time"]


def test_a_least_value_is_one_from_which_on_all_is_stable() -> None:
    assert drag._least(lambda x: 0.3 - x, 1.0) == pytest.approx(0.3, rel=2e-3)
    assert drag._least(lambda x: 2.0 - x, 1.0) == np.inf
    with pytest.raises(ArithmeticError, match="alternate"):
        drag._least(lambda x: (x - 0.1) * (x - 0.5), 1.0)  # grows again above 0.5


def test_times_of_arrival_of_an_exponential() -> None:
    time = np.linspace(0.0, 100.0, 201)
    error = np.exp(-0.05 * time)[:, None] * np.array([20.0, 0.0, 0.0])
    assert time_to(time, error, 0.1) == pytest.approx(np.log(10.0) / 0.05)
    assert np.isnan(time_to(time, error, 1e-6))


def _results(final: np.ndarray, stray: float) -> dict[str, Any]:
    """Return made-up results: a move to `final` errors, SLSM straying by a factor more."""
    time = np.linspace(0.0, 105.0, 421)
    results: dict[str, Any] = {}
    keys = [(f"{kind}_{m}", i) for kind in ("move", "fast") for i, m in enumerate(MODELS)]
    for key, i in keys:
        rate = np.log(20.0 / (3e-3 * final[i, 0])) / 105.0
        position = np.zeros((len(time), 3))
        position[:, 0] = 20.0 * np.exp(-rate * time)
        factor = stray if "SLSM" in key else 1.0
        position[:, 2] = 0.02 * factor * np.sin(np.pi * time / 105.0)
        position[-1, 2] = 0.0
        orientation = np.radians(np.tile(final[i, 1], (len(time), 3)))
        results[key] = {
            "time": time,
            "position_error": position,
            "orientation_error": orientation,
            "orientation_error_seen": orientation,
            "velocity": np.gradient(-position, time, axis=0),
            "tension": np.full((len(time), 8), 200.0),
            "orientation_excursion": np.radians(0.3 * factor),
        }
    for key in variations():
        results[f"vary_{key}"] = {"errors": final, "failed": ""}
    results["vary_soft"] = {"errors": np.full((4, 2), np.nan), "failed": "slack"}
    for x in ALONG:
        stable = {"growth": 0.03, "frequency": 0.2, "drag": 0.06, "damping": 0.02}
        results[f"stable_{x}"] = {**stable, "damping_time": 0.5 if x == 0 else np.inf}
    results["fit"] = {"values": {n: assumed("table7")[n] for n in work.COARSE}, "errors": final}
    return results


def test_the_section_claims_what_the_numbers_say() -> None:
    section = table7.section(_results(printed_errors(), stray=10.0))
    assert [claim.agrees for claim in section.claims] == 6 * [True] + [False, True]
    kinds = [claim.kind for claim in section.claims]
    assert kinds == 5 * ["fitted"] + 2 * ["tested"] + ["fitted"]
    assert set(section.fitted) == set(assumptions("table7"))
    assert len(section.tables[-1].rows) == len(variations())
    swapped = printed_errors()[[1, 0, 2, 3]]
    wrong = table7.section(_results(swapped * [[3.0, 3.0]], stray=2.0))
    assert [claim.agrees for claim in wrong.claims] == [
        False, False, True, False, False, False, False, True,
    ]  # fmt: skip


def test_one_value_for_three_models_is_as_near_as_the_fit() -> None:
    factors = one_for_three()
    assert factors == pytest.approx([1.363, 1.225], abs=1e-3)
    (claim,) = (
        claim
        for claim in table7.section(_results(printed_errors() * 1.4, stray=10.0)).claims
        if claim.text == "the eight printed errors"
    )
    assert claim.agrees and claim.null_rate == 1.0 and "resolves nothing" in claim.reason


def test_sagging_models_that_stray_more_than_the_ecm_overshoot() -> None:
    results = _results(printed_errors(), stray=10.0)
    for model in ("CMWE", "SCMWE"):
        run = results[f"move_{model}"]
        run["position_error"] = run["position_error"] * np.array([1.0, 1.0, 1.2])
    found = {claim.text: claim for claim in table7.section(results).claims}
    assert found["CMWE and SCMWE overshoot, too, the ECM does not"].agrees


def test_a_move_that_cannot_be_made_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: Any) -> None:
        raise EquilibriumError("cable 3 has no catenary")

    monkeypatch.setattr(table7_variations, "slow_errors", refuse)
    result = vary("none")
    assert result["failed"] == "cable 3 has no catenary"
    assert np.isnan(result["errors"]).all()
