"""Figures of gain matrices, modes and stability show the numbers they were given."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from cdpr_drake.analysis import (
    Comparison,
    GainMap,
    SampledServo,
    StabilityMap,
    comparable_pose,
    compare_cable_models,
    map_gain_matrix,
    platform_modes,
    stability_map,
)
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.show import (
    gain_map_figure,
    mode_shape_figure,
    pole_figure,
    rates_and_responses_figure,
    stability_figure,
)
from cdpr_drake.show.study_plots import sideways
from cdpr_drake.study import Modes, modes


@pytest.fixture(scope="module")
def cogiro() -> CableRobot:
    return load_robot("cogiro")


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return compare_cable_models(["cogiro", "cogiro-98m"], ["ECM", "SLSM"])


@pytest.fixture(scope="module")
def swings(cogiro: CableRobot) -> Modes:
    return platform_modes(cogiro, comparable_pose(cogiro))


@pytest.fixture(scope="module")
def found(cogiro: CableRobot) -> StabilityMap:
    return stability_map(cogiro, comparable_pose(cogiro), [0.3, 1.0, 3.0, 9.0], [0.0, 0.04, 0.1])


def level_grid(cogiro: CableRobot) -> list[list[float]]:
    return [[0.0, 0.0, 0.0, x, y, 1.0] for x in (-20.0, -2.0, 2.0) for y in (-1.0, 1.0)]


@pytest.fixture(scope="module")
def gain_map(cogiro: CableRobot) -> GainMap:
    return map_gain_matrix(cogiro, None, level_grid(cogiro), "SLSM")


def lines(axes: Any, label: str) -> Any:
    return next(line for line in axes.get_lines() if line.get_label() == label)


def words(axes: Any) -> list[str]:
    return [text.get_text() for text in axes.texts]


# --- rates and responses


def test_rates_are_gamma_s_eigenvalues_times_lambda(comparison: Comparison) -> None:
    panels = rates_and_responses_figure(comparison, gain=0.2).axes
    for column, robot in enumerate(("cogiro", "cogiro-98m")):
        dots = [line for line in panels[column].get_lines() if line.get_marker() == "o"]
        rows = [row for row in comparison.rows if row.robot == robot]
        for line, row in zip(dots, rows, strict=True):
            assert_allclose(line.get_xdata(), 0.2 * row.gamma.eigenvalues.real)
            assert f"{0.2 * row.slowest:.4f}" in words(panels[column])


def test_responses_are_of_gamma(comparison: Comparison) -> None:
    panels = rates_and_responses_figure(comparison, gain=0.1, until=40.0).axes
    row = next(r for r in comparison.rows if (r.robot, r.cable_model) == ("cogiro-98m", "SLSM"))
    turn = lines(panels[3], "SLSM")
    start = np.radians(10.0) / math.sqrt(3.0) * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    s = row.gamma.response(turn.get_xdata(), start, 0.1)
    assert_allclose(turn.get_ydata(), np.degrees(np.linalg.norm(s[:, :3], axis=1)))
    aside = lines(panels[5], "SLSM")
    assert aside.get_ydata()[0] == 0.0
    ways = [row.gamma.excursion(axis)[0] for axis in np.eye(6)[3:]]  # [m] of a metre
    assert aside.get_ydata().max() == pytest.approx(1e3 * max(ways), rel=1e-3)
    assert f"{aside.get_ydata().max():.2f} mm per m" in words(panels[5])


def test_every_panel_has_its_unit(comparison: Comparison) -> None:
    panels = rates_and_responses_figure(comparison).axes
    assert "[1/s]" in panels[0].get_xlabel()
    assert "[deg]" in panels[2].get_ylabel() and "[mm per m]" in panels[4].get_ylabel()
    assert all(axes.get_xlabel() == "time [s]" for axes in panels[2:])


def test_nothing_to_compare_is_refused() -> None:
    with pytest.raises(ValueError, match="no gain matrices"):
        rates_and_responses_figure(Comparison(rows=()))


# --- the map of Gamma


def test_a_map_shows_rates_and_coupling_and_hides_what_cannot_be(gain_map: GainMap) -> None:
    figure = gain_map_figure({"SLSM": gain_map})
    upper, lower = figure.axes[:2]
    shown = upper.collections[0].get_array()
    assert shown.shape == (2, 3) and shown.mask[:, 0].all() and not shown.mask[:, 1:].any()
    assert_allclose(shown[:, 1], gain_map.slowest[2:4])
    assert_allclose(lower.collections[0].get_array()[:, 2], sideways(gain_map)[4:])
    assert lower.get_xlabel() == "x [m]" and upper.get_ylabel() == "y [m]"


def test_sideways_is_motion_across_per_motion_asked_for(gain_map: GainMap) -> None:
    matrix = gain_map.matrices[2]
    asked = [np.linalg.norm(np.delete(matrix[3:, 3 + i], i)) for i in range(3)]
    assert sideways(gain_map)[2] == pytest.approx(1e3 * max(asked))
    assert np.isnan(sideways(gain_map)[0])


def test_poses_on_no_grid_are_refused(cogiro: CableRobot) -> None:
    line = map_gain_matrix(cogiro, None, level_grid(cogiro)[:2])
    with pytest.raises(ValueError, match="two of x, y, z"):
        gain_map_figure({"line": line})
    broken = map_gain_matrix(cogiro, None, level_grid(cogiro)[:3])
    with pytest.raises(ValueError, match="no grid"):
        gain_map_figure({"three of four": broken})
    with pytest.raises(ValueError, match="no maps"):
        gain_map_figure({})


# --- poles and shapes


def test_poles_are_rate_and_frequency(swings: Modes) -> None:
    axes = pole_figure(swings).axes[0]
    s = np.array([mode.eigenvalue for mode in swings.modes])
    points = lines(axes, "modes")
    assert_allclose(points.get_xdata(), s.real)
    assert_allclose(points.get_ydata(), s.imag / (2.0 * math.pi))
    slowest = swings.modes[0]
    frequency = slowest.eigenvalue.imag / (2.0 * math.pi)
    assert f"{swings.name(slowest)}, {frequency:.3g} Hz" in words(axes)


def test_a_sampled_loop_is_mapped_and_shown_in_the_circle(cogiro: CableRobot) -> None:
    servo = SampledServo(cogiro, comparable_pose(cogiro))
    sampled = modes(servo.map(6.0, 0.04))
    plane, circle = pole_figure({"late": sampled}).axes
    assert_allclose(lines(plane, "late").get_xdata(), [m.eigenvalue.real for m in sampled.modes])
    z = circle.get_lines()[-1]
    assert_allclose(
        np.hypot(z.get_xdata(), z.get_ydata())[: len(sampled)], [abs(m.z) for m in sampled.modes]
    )
    assert len(sampled.unstable) > 0
    assert any(text.startswith(sampled.name(sampled.unstable[0])) for text in words(plane))
    assert "10 Hz" in words(circle)  # half of 20 Hz, at z = -1


def test_neutral_poles_are_at_zero_and_counted() -> None:
    axes = pole_figure(modes(np.diag([0.0, 0.0, -0.2, -0.21]))).axes[0]
    assert "2 × neutral" in words(axes)
    assert_allclose(sorted(lines(axes, "modes").get_xdata()), [-0.21, -0.2, 0.0, 0.0])


def test_zeros_that_round_off_made_complex_are_counted_too() -> None:
    axes = pole_figure(modes([[0.0, 1e-8, 0.0], [-1e-8, 0.0, 0.0], [0.0, 0.0, -1.0]])).axes[0]
    assert "2 × neutral" in words(axes)


def test_no_modes_are_refused() -> None:
    with pytest.raises(ValueError, match="no modes"):
        pole_figure({})


def test_a_shape_moves_the_attachment_points_as_the_mode_does(
    cogiro: CableRobot, swings: Modes
) -> None:
    mode, pose = swings.modes[0], comparable_pose(cogiro)
    axes, bars = mode_shape_figure(swings, mode, cogiro, pose).axes
    ways = [np.array(line.get_data_3d()) for line in axes.get_lines()]
    way = next(w for w in ways if w.shape[1] == 61)  # of cable 1, through a cycle
    rest = pose @ cogiro.attachment_points[0]
    arm = rest - pose.translation()
    shape = mode.shape[:6]
    shape = shape * np.exp(-1j * np.angle(shape[np.argmax(np.abs(shape))]))
    velocity = shape[3:] + np.cross(shape[:3], arm)
    moved = way[:, 0] - rest
    direction = velocity.real / np.linalg.norm(velocity.real)
    assert_allclose(moved / np.linalg.norm(moved), direction, atol=0.05)  # rotations are finite
    widths = [100.0 * share for _, share in swings.participants(mode, 6)]
    assert_allclose([bar.get_width() for bar in bars.patches][::-1], widths)


def test_a_shape_needs_the_platform(cogiro: CableRobot) -> None:
    without = modes(np.diag([-1.0, -2.0]))
    with pytest.raises(ValueError, match="platform"):
        mode_shape_figure(without, without.modes[0], cogiro, comparable_pose(cogiro))


# --- stability


def test_a_stability_map_shows_growth_limits_and_names(found: StabilityMap) -> None:
    figure = stability_figure(found, at=(1.0, 0.04), title="here")
    axes = figure.axes[0]
    assert_allclose(axes.collections[0].get_array(), found.growth.T)
    limit = axes.get_lines()[0]
    unstable = [x.gain for x in found.limits if x.unstable]
    assert_allclose(limit.get_ydata(), unstable)
    assert axes.get_xlabel() == "latency [ms]" and "[1/s]" in axes.get_ylabel()
    labels = axes.get_legend_handles_labels()[1]
    for x in found.limits:
        assert any(label.startswith(x.mode) for label in labels)
    assert axes.get_title() == "here"


def test_a_map_without_a_limit_can_be_drawn(cogiro: CableRobot) -> None:
    calm = stability_map(cogiro, comparable_pose(cogiro), [0.05, 0.1], [0.0, 0.04])
    axes = stability_figure(calm).axes[0]
    assert calm.is_stable.all() and axes.get_lines()[0].get_xdata().size == 0
