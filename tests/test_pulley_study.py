"""What wrong beliefs about pulleys cost: the beliefs, the encoders, the study, the command."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform

from cdpr_drake.__main__ import main
from cdpr_drake.diagrams import make_joint_space_control, rest_context
from cdpr_drake.errors import RobotFileError
from cdpr_drake.model.encoders import zeroed_at
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.inverse_kinematics import InverseKinematics
from cdpr_drake.model.kinematics import cable_ends
from cdpr_drake.model.pulley_beliefs import BELIEFS, LARGER, TILT
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.statics import MINIMUM_NORM
from cdpr_drake.runs import paper_test
from cdpr_drake.runs.moves import move_near_the_middle
from cdpr_drake.runs.pulley_study import PulleyStudy, pulley_study
from cdpr_drake.show import pulley_figure

ROBOTS = ("cogiro-2015-pulleys", "caroca", "cuhk-cablerobot")


@pytest.fixture(scope="module")
def caroca() -> CableRobot:
    return load_robot("caroca")


@pytest.fixture(scope="module")
def start(caroca: CableRobot) -> RigidTransform:
    return move_near_the_middle(caroca)[0]


@pytest.fixture(scope="module")
def study(caroca: CableRobot) -> PulleyStudy:
    """A fast move, to within e^-3 of the goal."""
    counts: list[tuple[int, int]] = []
    found = pulley_study(
        caroca, gain=0.5, until=6.0, progress=lambda done, total: counts.append((done, total))
    )
    assert counts == [(i, 10) for i in range(11)]
    return found


# --- the beliefs


def test_each_belief_is_wrong_in_what_its_name_says(
    caroca: CableRobot, start: RigidTransform
) -> None:
    known = {name: belief(caroca, start) for name, belief in BELIEFS.items()}
    assert known["true"] is caroca
    entry = known["entry point"]
    assert not entry.pulley_radii.any()
    np.testing.assert_array_equal(entry.drawing_points, caroca.drawing_points)
    larger = known["radius +10 %"]
    np.testing.assert_allclose(larger.pulley_radii, LARGER * caroca.pulley_radii)
    tilted = known["axis 5 deg off"]
    cosine = np.sum(tilted.pulley_axes * caroca.pulley_axes, axis=1)
    np.testing.assert_allclose(np.arccos(cosine), TILT, rtol=1e-9)
    assert np.ptp(tilted.pulley_axes[:, 0]) > 0.05  # not all the same way
    for robot in (larger, tilted):
        np.testing.assert_array_equal(robot.drawing_points, caroca.drawing_points)
        np.testing.assert_array_equal(robot.cable.drum_run, caroca.cable.drum_run)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_point_at_the_start_has_the_same_cables_there(name: str) -> None:
    robot = load_robot(name)
    start, goal = move_near_the_middle(robot)
    fixed = BELIEFS["point at the start"](robot, start)
    assert not fixed.pulley_radii.any()
    for pose, same in ((start, True), (goal, False)):
        ends, ours = cable_ends(robot, pose), cable_ends(fixed, pose)
        assert ends.contact is not None
        spans = (np.linalg.norm(e.chord, axis=1) for e in (ends, ours))
        arcs = robot.pulley_radii * ends.contact.theta
        lengths, believed = (s + r for s, r in zip(
            spans, (robot.cable.drum_run + arcs, fixed.cable.drum_run), strict=True
        ))  # fmt: skip
        assert np.allclose(lengths, believed, rtol=0.0, atol=1e-12) is same


# --- encoders


@pytest.mark.parametrize("name", ["cogiro-2015-pulleys", "cuhk-cablerobot"])
@pytest.mark.parametrize("belief", BELIEFS)
def test_joint_space_control_starts_at_rest_however_wrong_its_belief(
    name: str, belief: str
) -> None:
    robot = load_robot(name)
    start, _ = move_near_the_middle(robot)
    wrong = BELIEFS[belief](robot, start)
    believed = zeroed_at(wrong, robot, start, "ECM")
    rest = rest_state(robot, start)
    np.testing.assert_allclose(
        InverseKinematics(believed, "ECM").motor_angles(start), rest.motor_angles, rtol=1e-12
    )
    loop = make_joint_space_control(robot, cable_model="ECM", believed=believed)
    context = rest_context(loop, start)
    pose = loop.GetOutputPort("pose_error").Eval(context)
    np.testing.assert_allclose(pose, 0.0, atol=1e-9)
    tension = loop.GetOutputPort("tension_at_drawing_point").Eval(context)
    np.testing.assert_allclose(tension, rest.tension_at_drawing_point, rtol=1e-7)


def test_encoders_zeroed_elsewhere_do_not_start_at_rest(
    caroca: CableRobot, start: RigidTransform
) -> None:
    wrong = BELIEFS["entry point"](caroca, start)
    _, goal = move_near_the_middle(caroca)
    off = []
    for robot in (wrong, zeroed_at(wrong, caroca, goal, "ECM")):
        angles = InverseKinematics(robot, "ECM").motor_angles(start)
        off.append(np.abs(angles - rest_state(caroca, start).motor_angles).max())
    assert off[0] > off[1] > 0.1  # rad, 2 mm of cable


# --- the study


def test_eyelets_at_the_entry_cost_most_and_vision_takes_the_error_away(
    study: PulleyStudy,
) -> None:
    jsc, vbc = study.of("JSC"), study.of("VBC")
    assert list(jsc) == list(vbc) == list(BELIEFS)
    assert study.robot == "caroca" and study.radius == 0.045 and study.gain == 0.5
    assert jsc["true"].apart == jsc["true"].tension_change == 0.0
    for rows in (jsc, vbc):
        apart = {name: row.apart or 0.0 for name, row in rows.items() if name != "true"}
        assert max(apart, key=lambda name: apart[name]) == "entry point"
        assert apart["entry point"] > 5.0 * apart["radius +10 %"] > 0.0
    for name in list(BELIEFS)[1:]:
        ours, theirs = vbc[name], jsc[name]
        assert ours.apart is not None and theirs.apart is not None
        assert 0.0 < ours.apart < theirs.apart
        assert ours.led_aside is not None and 0.0 < ours.led_aside <= ours.apart * (1.0 + 1e-9)
        assert theirs.led_aside is theirs.slowest is theirs.fastest is None
    assert vbc["true"].slowest is not None and vbc["entry point"].slowest is not None
    assert vbc["entry point"].slowest < vbc["true"].slowest < 1.0


@pytest.mark.slow
def test_what_test_4_costs() -> None:
    """26 mm for the entry point and 0.7 mm for the contact at the start, under JSC."""
    robot, test = load_robot("cogiro-2015-pulleys"), paper_test(4)
    names = ("true", "entry point", "point at the start")
    found = pulley_study(
        robot,
        *test.poses(robot),
        gain=test.gain,
        tensions=MINIMUM_NORM,
        beliefs={name: BELIEFS[name] for name in names},
    )
    jsc, vbc = found.of("JSC"), found.of("VBC")
    assert jsc["entry point"].apart == pytest.approx(26.0, abs=0.5)
    assert jsc["point at the start"].apart == pytest.approx(0.7, abs=0.05)
    for row in vbc.values():
        assert row.position_error is not None and row.position_error < 0.05


def test_a_user_adds_a_belief_and_one_that_fails_is_told(
    caroca: CableRobot, start: RigidTransform
) -> None:
    def half_as_far(robot: CableRobot, start: RigidTransform) -> CableRobot:
        """All points close together hold nothing."""
        return robot.replace(drawing_points=robot.drawing_points[0] + np.zeros((8, 3)))

    beliefs = {"true": BELIEFS["true"], "one point": half_as_far}
    found = pulley_study(caroca, gain=0.5, until=0.2, beliefs=beliefs)
    lost = found.of("JSC")["one point"]
    assert lost.failure and lost.position_error is None
    pulley_figure([found])


@pytest.mark.parametrize("name", ["cogiro", "ipanema-2"])
def test_a_robot_without_pulleys_is_refused_by_name(name: str) -> None:
    with pytest.raises(RobotFileError, match=rf"'{name}'.*pulleys.radius: no cable leaves over"):
        pulley_study(load_robot(name))


# --- the figure and the command


def test_the_figure_has_a_row_for_each_study(study: PulleyStudy) -> None:
    figure = pulley_figure([study, study])
    assert len(figure.axes) == 8
    labels = [axes.get_xlabel() for axes in figure.axes if axes.get_xlabel()]
    assert all("[" in label for label in labels) and len(labels) == 4
    with pytest.raises(ValueError, match="no studies"):
        pulley_figure([])


def test_the_command_tells_and_writes_it(
    study: PulleyStudy,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    monkeypatch.setattr("cdpr_drake.runs.pulley_study.pulley_study", lambda *a, **k: study)
    monkeypatch.setenv("COLUMNS", "60")
    assert main(["pulleys", "--robot", "caroca", "--output", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines()[:-1])) <= 60
    assert "JSC (ECM, encoders zeroed at the start)" in text and "VBC (SCMWE)" in text
    assert sum(line.startswith("entry point") for line in text.splitlines()) == 2
    with (tmp_path / "pulleys.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["belief"] for row in rows] == 2 * list(BELIEFS)
    apart = study.of("JSC")["entry point"].apart
    assert float(rows[1]["apart_from_true_belief_mm"]) == pytest.approx(apart, rel=1e-5)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["files"] == ["summary.json", "pulleys.csv", "pulleys.png"]
    assert summary["cable_models"] == {"VBC": "SCMWE", "JSC": "ECM"}


def test_the_command_refuses_a_robot_without_pulleys(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["pulleys", "--robot", "cogiro", "--output", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("robot 'cogiro': pulleys.radius: no cable leaves over a pulley")
    assert not (tmp_path / "out").exists()
