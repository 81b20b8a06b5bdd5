"""What wrong calibrations do: where the platform rests, how it is led aside, what cables feel."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from pydrake.math import RigidTransform

from cdpr_drake.analysis import gain_matrix
from cdpr_drake.analysis.calibration_study import (
    GROUPS,
    calibration_effect,
    errors_of,
    follow,
    groups_of,
    led_aside,
    stability_factor,
    steady_state_error,
)
from cdpr_drake.model.calibration_errors import CalibrationErrors, misjudged
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.runs import paper_test, run, setup_of_test
from cdpr_drake.show import calibration_study_figure

Poses = tuple[RigidTransform, RigidTransform]


@pytest.fixture(scope="module")
def test_4(cogiro: CableRobot) -> Poses:
    return paper_test(4).poses(cogiro)


def test_the_groups_are_the_errors_apart() -> None:
    names = [field.name for field in dataclasses.fields(CalibrationErrors)]
    parts = [name for group in GROUPS if group != "all" for name in GROUPS[group]]
    assert sorted(parts) == sorted(names) == sorted(GROUPS["all"])
    only = errors_of("^fT_b", CalibrationErrors(camera_angle=0.5))
    assert only.camera_angle == 0.5 and only.camera_position == 3e-3
    assert only.drawing_points == only.attachment_points == only.target_angle == 0.0
    with pytest.raises(KeyError):
        errors_of("C_i")


def test_where_it_rests_follows_from_the_two_transforms(cogiro: CableRobot, test_4: Poses) -> None:
    """A shift of F by 3 mm moves the rest by 3 mm; a turn by its lever from the camera."""
    goal = test_4[1]
    for group in ("A_i", "B_i"):
        believed = misjudged(cogiro, errors_of(group), 3)
        assert np.abs(steady_state_error(cogiro, believed, goal)).max() < 1e-12
    X_WF, X_PM = cogiro.cameras.X_WF, cogiro.cameras.X_PM
    shifted = RigidTransform([0.0, 3e-3, 0.0]) @ X_WF
    believed = cogiro.replace(cameras=cogiro.cameras.replace(X_WF=shifted))
    s = steady_state_error(cogiro, believed, goal)
    assert np.linalg.norm(s[3:]) == pytest.approx(3e-3) and np.abs(s[:3]).max() < 1e-12
    turn = errors_of("^fT_b", CalibrationErrors(camera_position=0.0))
    for seed in range(3):
        believed = misjudged(cogiro, turn, seed)
        s = steady_state_error(cogiro, believed, goal)
        moved = believed.cameras.X_WF @ X_WF.inverse() @ (goal @ X_PM).translation()
        assert np.linalg.norm(s[3:]) == pytest.approx(
            np.linalg.norm(moved - (goal @ X_PM).translation()), rel=1e-2
        )


def test_being_led_aside_is_measured_across_the_way() -> None:
    t = np.exp(-np.linspace(0.0, 5.0, 51))[:, None]
    straight = t * [[0.1, 0.0, 0.0, 1.0, 0.0, 0.0]]
    lag = t**1.1 * [[0.1, 0.0, 0.0, 1.0, 0.0, 0.0]]
    assert led_aside(lag, straight) == (0.0, 0.0)
    bent = straight.copy()
    bent[20, [1, 4]] = 0.01, 0.2
    assert led_aside(bent, straight) == pytest.approx((0.01, 0.2))


@pytest.mark.needs("numba")
def test_simulations_do_the_same(cogiro: CableRobot, test_4: Poses) -> None:
    """Whole loops, with winches, sampling and latency, against ways without dynamics."""
    believed = misjudged(cogiro, CalibrationErrors(), 0)
    setup = setup_of_test(4, noise=False, gain=0.4, until=18.0)
    exact, wrong = (run(setup.replace(believed=c)) for c in (None, believed))
    ways = [follow(cogiro, c, *test_4) for c in (cogiro, believed)]

    seen = [r.record["pose_error_seen"] for r in (wrong, exact)]
    assert led_aside(*seen) == pytest.approx(led_aside(ways[1].error, ways[0].error), rel=0.12)

    tension = [r.record["tension_at_drawing_point"][-1] for r in (wrong, exact)]
    change = ways[1].tension[-1] - ways[0].tension[-1]
    assert np.abs(change).max() > 5.0
    np.testing.assert_allclose(tension[0] - tension[1], change, atol=0.05 * np.abs(change).max())

    rotation, position = np.linalg.norm(
        steady_state_error(cogiro, believed, test_4[1]).reshape(2, 3), axis=1
    )
    assert wrong.summary.position_error == pytest.approx(1e3 * position, abs=1.5)
    assert wrong.summary.orientation_error == pytest.approx(np.degrees(rotation), abs=0.02)


@pytest.mark.needs("numba")
def test_effects_are_those_of_the_calibrations_asked_for(cogiro: CableRobot, test_4: Poses) -> None:
    points = calibration_effect(cogiro, *test_4, "B_i", seeds=[4, 5])
    assert np.all(points.position_error < 1e-9) and np.all(points.tension_change > 1.0)
    larger = calibration_effect(cogiro, *test_4, "B_i", 2.0, seeds=[4, 5])
    np.testing.assert_allclose(larger.tension_change, 2.0 * points.tension_change, rtol=0.1)
    np.testing.assert_allclose(larger.position_excursion, 2.0 * points.position_excursion, rtol=0.1)
    assert points.quantiles("tension_change", [0.0, 1.0]) == sorted(points.tension_change)
    figure = calibration_study_figure([points, larger])
    assert [t.get_text() for t in figure.axes[0].get_yticklabels()] == ["$B_i$", "$B_i$ × 2"]
    with pytest.raises(ValueError, match="no effects"):
        calibration_study_figure([])


def test_a_pulley_s_radius_is_of_robots_that_have_pulleys(cogiro: CableRobot) -> None:
    assert groups_of(load_robot("cogiro-2015-pulleys")) == tuple(GROUPS)
    assert set(GROUPS) - set(groups_of(cogiro)) == {"pulley radius"}


@pytest.mark.needs("numba")
def test_a_wrong_radius_of_the_pulleys_leads_a_little_aside() -> None:
    """0.1 mm for each millimetre, up to a law that ignores the pulleys; none of it is left."""
    test = paper_test(4)
    robot = test.carried_by(load_robot("cogiro-2015-pulleys"))
    move = test.poses(robot)
    exact = follow(robot, robot, *move)
    for radius in (0.049, 0.0):
        believed = robot.replace(pulleys=robot.pulleys.replace(radius=np.array(radius)))
        assert np.abs(steady_state_error(robot, believed, move[1])).max() < 1e-12
        way = follow(robot, believed, *move)
        turned, away = led_aside(way.error, exact.error)
        assert away == pytest.approx(0.099 * (0.05 - radius), rel=0.02)
        assert np.degrees(turned) == pytest.approx(0.333 * (0.05 - radius), rel=0.02)
        change = np.abs(way.tension - exact.tension).max()
        assert change == pytest.approx(45.6 * (0.05 - radius), rel=0.05)
    assert gain_matrix(robot, believed, move[1]).is_stable
    effect = calibration_effect(robot, *move, "pulley radius", seeds=[0, 1])
    assert effect.position_error.max() < 1e-9 and 0.02 < effect.position_excursion.max() < 0.3
    figure = calibration_study_figure([effect])
    assert [t.get_text() for t in figure.axes[0].get_yticklabels()] == ["pulley radius"]


@pytest.mark.needs("numba")
def test_a_move_that_fails_is_told(cogiro: CableRobot, test_4: Poses) -> None:
    effect = calibration_effect(cogiro, *test_4, "all", 150.0, seeds=range(3))
    assert effect.failures
    for seed in effect.failures:
        assert np.isnan(effect.tension_change[seed]) and effect.position_error[seed] > 100.0


@pytest.mark.needs("numba")
def test_only_gross_errors_make_the_loop_diverge(cogiro: CableRobot, test_4: Poses) -> None:
    """Section 6.3 calls the law robust to significant calibration errors."""
    factor = stability_factor(cogiro, test_4[1], "all", 0)
    assert 20.0 < factor < 200.0
    tenth = CalibrationErrors().scaled(10.0)
    assert stability_factor(cogiro, test_4[1], "all", 0, errors=tenth) == pytest.approx(
        factor / 10.0, rel=0.02
    )
