"""Modes, with the states that take part by name."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from study_samples import POSE

from cdpr_drake.analysis import internal_tension, neutral_directions, platform_modes
from cdpr_drake.diagrams import make_cable_robot, make_vision_based_control
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.statics import wrench_matrix
from cdpr_drake.study import Modes, OnePeriodMap, equilibrium, linearize, modes, one_period_map
from cdpr_drake.study.modes import named


def oscillator(frequency: float, damping: float) -> np.ndarray:
    w = 2.0 * math.pi * frequency
    return np.array([[0.0, 1.0], [-w * w, -2.0 * damping * w]])


def blocks(*parts: np.ndarray) -> np.ndarray:
    from scipy.linalg import block_diag

    return block_diag(*parts)


@pytest.fixture(scope="module")
def full(cogiro: CableRobot) -> Modes:
    loop = make_vision_based_control(cogiro, "ECM", sample_time=None)
    return modes(linearize(loop, equilibrium(loop, POSE), [], []))


def test_frequency_damping_and_time_constant() -> None:
    found = modes(blocks(oscillator(3.0, 0.02), [[-0.5]], [[0.0]], oscillator(1.0, -0.01)))
    grows, neutral, sways, decays = found.modes
    assert grows.frequency == pytest.approx(1.0) and grows.damping == pytest.approx(-0.01)
    assert grows.time_constant == pytest.approx(-1.0 / (0.01 * 2 * math.pi))
    assert neutral.is_neutral and math.isnan(neutral.damping)
    assert neutral.time_constant == math.inf and not neutral.is_stable
    assert sways.frequency == pytest.approx(3.0) and sways.damping == pytest.approx(0.02)
    assert sways.eigenvalue.imag > 0.0 and sways.is_stable
    assert decays.frequency == 0.0 and decays.damping == 1.0
    assert decays.time_constant == pytest.approx(2.0)
    assert found.unstable == (grows,) and found.neutral == (neutral,)


def test_states_take_part_whatever_their_unit() -> None:
    A = blocks(oscillator(3.0, 0.1), [[-0.5]])
    A[2, 0] = 0.3  # driven by the oscillator, which it does not act on
    scale = np.diag([1e3, 1.0, 1e-4])
    for matrix in (A, scale @ A @ np.linalg.inv(scale)):
        found = modes(matrix)
        real, sways = found.modes
        np.testing.assert_allclose(real.participation, [0.0, 0.0, 1.0], atol=1e-12)
        np.testing.assert_allclose(sways.participation, [0.5, 0.5, 0.0], atol=1e-12)
        np.testing.assert_allclose(matrix @ sways.shape, sways.eigenvalue * sways.shape, atol=1e-6)


def test_repeated_real_eigenvalues_stay_real() -> None:
    generator = np.random.default_rng(0)
    T = generator.normal(size=(8, 8))
    found = modes(T @ np.diag([-12.0] * 6 + [-1.0, -2.0]) @ np.linalg.inv(T))
    assert len(found) == 8
    assert all(mode.eigenvalue.imag == 0.0 for mode in found.modes)


def test_zeros_that_round_off_made_a_pair_stay_two() -> None:
    found = modes([[0.0, 1e-8, 0.0], [-1e-8, 0.0, 0.0], [0.0, 0.0, -1.0]])
    assert len(found) == 3 and len(found.neutral) == 2
    assert all(mode.eigenvalue.imag == 0.0 for mode in found.modes)


def test_a_period_s_map_shows_rates() -> None:
    T = 0.05
    M = np.diag([math.exp(-0.1 * T), 1.0, 0.0])
    found = modes(OnePeriodMap(matrix=M, period=T, states=("a", "b", "held"), drift=np.zeros(3)))
    assert [mode.eigenvalue.real for mode in found.modes] == pytest.approx([0.0, -0.1])
    assert found[1].z == pytest.approx(math.exp(-0.005))
    assert found.deadbeat == 1 and "1 that end within a period of 0.05 s" in str(found)


def test_what_is_no_matrix_is_refused() -> None:
    with pytest.raises(ValueError, match="square"):
        modes(np.zeros((2, 3)))
    with pytest.raises(ValueError, match="finite"):
        modes(np.full((2, 2), np.nan))


# --- of the loop


def test_the_loop_s_modes_are_recognised(full: Modes) -> None:
    assert len(full.neutral) == 2 and not full.unstable
    names = [full.name(mode) for mode in full.modes]
    assert names.count("neutral") == 2
    assert names.count("integrator/angle") == 6  # the servo's six
    assert names.count("winches/integral") == 8
    assert names.count("load_cells/tension") == 8
    assert sum(name.startswith("platform/") for name in names) == 6
    assert sum(name in ("winches/angle", "winches/rate") for name in names) == 8
    sways = [m for m, name in zip(full.modes, names, strict=True) if name.startswith("platform")]
    assert all(2.0 < mode.frequency < 13.0 for mode in sways)
    assert all(np.isclose(mode.participation.sum(), 1.0) for mode in full.modes)


def test_coordinate_and_velocity_count_together(full: Modes) -> None:
    sway = next(m for m in full.modes if full.name(m) == "platform/z")
    (name, share), *_ = full.participants(sway)
    i = full.states.index("robot/platform/z")
    j = full.states.index("robot/platform/v_z")
    assert name == "robot/platform/z"
    assert share == pytest.approx(sway.participation[[i, j]].sum())


def test_the_table_fits_a_terminal_and_a_notebook(full: Modes) -> None:
    lines = str(full).splitlines()
    assert len(lines) == 1 + len(full)
    assert max(len(line) for line in lines) <= 79
    assert lines[1].split()[0] == "0" and "neutral" in lines[1]
    html = full._repr_html_()
    assert html.count("<tr") == 1 + len(full) and "robot/platform/z" in html
    assert "#b00" not in html
    grows = modes(oscillator(1.0, -0.01))
    assert "#b00" in grows._repr_html_()


def test_modes_as_plain_data(full: Modes) -> None:
    import json

    data = named(full)
    assert len(data) == len(full)
    assert json.loads(json.dumps(data))[0]["name"] == "neutral"


def test_a_sampled_loop_s_table_names_its_holds(cogiro: CableRobot) -> None:
    loop = make_vision_based_control(cogiro)
    found = modes(one_period_map(loop, equilibrium(loop, POSE)))
    assert len(found.neutral) == 2 and not found.unstable
    names = [found.name(mode) for mode in found.modes]
    assert "held_rates" in names
    assert max(len(line) for line in str(found).splitlines()) <= 79


# --- of the platform


def eigenvalues(found: Modes) -> np.ndarray:
    return np.sort_complex([m.eigenvalue for m in found.modes])


def test_the_platform_on_locked_winches(cogiro: CableRobot) -> None:
    """The same as the plant's linear model with the winches' states held."""
    diagram = make_cable_robot(cogiro)
    A = linearize(diagram, equilibrium(diagram, POSE), [], []).A[:12, :12]
    found = platform_modes(cogiro, POSE)
    expected = np.linalg.eigvals(A)
    np.testing.assert_allclose(
        eigenvalues(found), np.sort_complex(expected[expected.imag > 0.0]), rtol=1e-9
    )
    assert len(found) == 6 and all(mode.is_stable for mode in found.modes)


def test_the_platform_on_controlled_winches(cogiro: CableRobot) -> None:
    diagram = make_cable_robot(cogiro)
    values = np.linalg.eigvals(linearize(diagram, equilibrium(diagram, POSE), [], []).A)
    found = platform_modes(cogiro, POSE, "controlled")
    both = [*eigenvalues(found), *eigenvalues(found).conj()]
    for value in values:
        assert np.abs(np.array(both) - value).min() < 1e-8
    locked = platform_modes(cogiro, POSE)
    sways = [m for m in found.modes if found.name(m).startswith("platform")]
    assert sways[0].frequency < locked[0].frequency  # winches give way


def test_without_damping_locked_modes_are_those_of_stiffness_and_mass(cogiro: CableRobot) -> None:
    robot = cogiro.replace(cable=cogiro.cable.replace(damping_time=0.0)).with_payload(110.0)
    found = platform_modes(robot, POSE)
    assert max(abs(mode.eigenvalue.real) for mode in found.modes) < 1e-9
    light = platform_modes(robot.with_payload(0.0), POSE)
    lowest = min(m.frequency for m in found.modes)
    assert 1.0 < min(m.frequency for m in light.modes) / lowest < math.sqrt(2.2)


def test_winches_are_locked_or_controlled(cogiro: CableRobot) -> None:
    with pytest.raises(ValueError, match='"locked" or "controlled", not "free"'):
        platform_modes(cogiro, POSE, "free")


# --- what is neutral


def test_neutral_directions_are_internal_tensions(cogiro: CableRobot) -> None:
    found = neutral_directions(cogiro, POSE)
    assert found.names == ("internal tension 1", "internal tension 2")
    assert found.tensions.shape == found.lengths.shape == (2, 8)
    np.testing.assert_allclose(found.tensions.max(axis=1), 1.0)
    # They hold no weight, up to the angle between cables and chords.
    from cdpr_drake.model.kinematics import cable_geometry

    wrench = wrench_matrix(cable_geometry(cogiro, POSE)) @ found.tensions.T
    assert np.abs(wrench).max() < 0.02
    rest = rest_state(cogiro, POSE)
    from cdpr_drake.model.equilibrium import forward_kinematics

    change = 20.0 * found.lengths[0]
    moved = forward_kinematics(cogiro, rest.unstrained_length + change, rest.X_WP)
    assert np.linalg.norm(moved.X_WP.translation() - POSE[3:]) < 2e-5
    np.testing.assert_allclose(
        moved.tension_at_drawing_point - rest.tension_at_drawing_point,
        20.0 * found.tensions[0],
        atol=0.5,
    )


def test_internal_tension_is_what_holds_no_weight(cogiro: CableRobot) -> None:
    rest = rest_state(cogiro, POSE)
    pulls = np.tile(rest.chord_tension, (2, 1))
    extra = neutral_directions(cogiro, POSE).tensions[0]
    pulls[1] += 50.0 * extra
    found = internal_tension(cogiro, np.tile(POSE, (2, 1)), pulls)
    assert np.abs(found[0]).max() < 1e-6  # minimum norm: none
    np.testing.assert_allclose(found[1], 50.0 * extra, atol=0.7)


def test_the_loop_s_neutral_modes_are_these(cogiro: CableRobot) -> None:
    """The right eigenvectors at zero change no pose, and the tensions as the directions say."""
    loop: Any = make_vision_based_control(cogiro, "ECM", sample_time=None)
    model = linearize(loop, equilibrium(loop, POSE), [], ["pose", "tension_at_drawing_point"])
    shapes = np.column_stack([mode.shape.real for mode in modes(model).neutral])
    assert shapes.shape == (52, 2)
    change = model.C @ shapes
    assert np.abs(change[:6]).max() < 1e-7 * np.abs(change[6:]).max()
    directions = neutral_directions(cogiro, POSE).tensions.T
    fit = np.linalg.lstsq(directions, change[6:], rcond=None)[0]
    np.testing.assert_allclose(directions @ fit, change[6:], atol=1e-6 * np.abs(change).max())
