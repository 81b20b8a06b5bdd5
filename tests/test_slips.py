"""The printed equations term by term, what their slips do, and the cables' own modes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cdpr_drake.model.cable_models import instantaneous_row, unstrained_length
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.servo import D_a, servo_twist
from cdpr_drake.runs.paper_tests import paper_test
from reproduction.cable_modes import section as cable_modes
from reproduction.cable_modes import work as cable_work
from reproduction.slips import section as slips
from reproduction.slips.printed_equations import (
    SLIPS,
    ecm,
    length_rates,
    printed_a,
    servo_twist_by_inversion,
)

CABLE = (np.array([7.0, 7.5]), np.array([-4.0, -3.0]), np.array([400.0, 60.0]), 0.65727, 1.3e6)


@pytest.fixture(scope="module")
def effects() -> dict[str, Any]:
    return {case.key: case.function(**case.arguments) for case in slips.cases()}


@pytest.fixture(scope="module")
def modes() -> dict[str, Any]:
    return {case.key: case.function(**case.arguments) for case in cable_modes.cases()}


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_without_slips_the_sums_are_the_models_own(order: int) -> None:
    length, row = ecm(*CABLE, order)
    np.testing.assert_allclose(length, unstrained_length("ECM", *CABLE, order), rtol=1e-11)
    expected = instantaneous_row("ECM", *CABLE, order)
    np.testing.assert_allclose(row[:, :2], expected[:, :2], rtol=1e-9)
    np.testing.assert_allclose(row[:, 2], expected[:, 2], rtol=1e-6)


@pytest.mark.parametrize("model", ["ECM", "SCMWE", "SLSM"])
def test_without_slips_the_law_is_the_controller_s(cogiro: CableRobot, model: str) -> None:
    pose = paper_test(3).poses(cogiro)[0]
    H = np.linspace(200.0, 400.0, 8)
    np.testing.assert_allclose(
        length_rates(cogiro, pose, H, model, 4), D_a(cogiro, pose, H, model), rtol=1e-6, atol=1e-8
    )


def test_every_slip_changes_the_law(cogiro: CableRobot) -> None:
    pose = paper_test(3).poses(cogiro)[0]
    H = np.linspace(200.0, 400.0, 8)
    for slip in SLIPS:
        model = slips.MODEL_OF.get(slip, "ECM")
        right, wrong = (length_rates(cogiro, pose, H, model, 4, s) for s in ("", slip))
        assert np.abs(wrong - right).max() > 1e-12, slip


def test_the_printed_a_loses_the_attachment_point() -> None:
    a = printed_a(CABLE[0], CABLE[1], CABLE[3] / CABLE[2], 0)
    assert a[0] == pytest.approx(-0.0066, abs=5e-5)  # -0.5499 is right


def test_the_sign_in_the_interaction_matrix_cancels() -> None:
    s = np.array([0.3, -0.4, 0.2, 1.0, -0.5, 0.3])
    for sign in (-1.0, 1.0):
        np.testing.assert_allclose(
            servo_twist_by_inversion(s, 0.1, sign), servo_twist(s, 0.1), atol=1e-15
        )


def test_which_slips_a_robot_would_show(effects: dict[str, Any]) -> None:
    for place in slips.PLACES:
        found = effects[place]["effects"]
        for slip in set(SLIPS) - set(slips.MODEL_OF):  # the ECM is nearly exact at rest
            assert 0.95 < found[slip]["right"][0] <= found[slip]["right"][1] < 1.05
        assert found["half_plane"]["wrong"][0] < -0.9
        assert found["k_p"]["wrong"][1] < 0.1
        assert found["factor"]["change"] < 1e-6
        assert min(effects[place]["misses"]) > 1.0
        assert effects[place]["wrong_half_plane"] == 4
    large = effects["large"]["effects"]
    assert large["unit_vector"]["wrong"][0] < 0.0
    assert large["no_com"]["change"] > 10.0 * effects["cogiro"]["effects"]["no_com"]["change"]


def test_the_section_has_a_row_for_each_slip(effects: dict[str, Any]) -> None:
    law, _ = slips.section(effects).tables
    assert [row[0] for row in law.rows] == list(SLIPS.values())
    verdicts = {row[0]: row[-1] for row in law.rows}
    assert verdicts[SLIPS["half_plane"]] == "unstable"
    assert verdicts[SLIPS["k_p"]] == "does not move"
    assert verdicts[SLIPS["factor"]] == "nothing"


@pytest.mark.parametrize("ratio", [0.01, 1.0, 20.0, 39.0, 60.0, 1000.0])
def test_in_plane_modes_are_those_of_a_discretised_cable(ratio: float) -> None:
    """-v'' + lambda^2 (integral of v) = omega^2 v, v = 0 at both ends, by finite differences."""
    n = 400
    h = 1.0 / n
    A = np.diag(np.full(n - 1, 2.0)) - np.eye(n - 1, k=1) - np.eye(n - 1, k=-1)
    omega2 = np.linalg.eigvalsh(A / h**2 + ratio * h)[0]
    assert cable_work.in_plane_factor(ratio) == pytest.approx(np.sqrt(omega2) / np.pi, rel=1e-4)


def test_a_string_as_worked_by_hand() -> None:
    # 10 m, 256 N, 0.064 kg/m: waves run at sqrt(4000) = 63.2 m/s, twice the length in 0.316 s
    found = cable_work.string_frequencies(np.array([10.0]), np.array([256.0]), 0.064)
    assert found[0] == pytest.approx(3.162, abs=1e-3)


def test_cables_vibrate_as_expected_and_beside_the_platform(modes: dict[str, Any]) -> None:
    for place, result in modes.items():
        low, high = (2.0, 11.0) if place.startswith("test_") else (0.1, 1.0)
        assert np.all((result["string"] > low) & (result["string"] < high))
        factor = result["in_plane"] / result["string"]
        assert np.all((factor >= 1.0) & (factor <= 2.0))
    section = cable_modes.section(modes)
    assert section.claims[0].agrees
    assert len(section.tables[0].rows) == len(cable_modes.PLACES)
