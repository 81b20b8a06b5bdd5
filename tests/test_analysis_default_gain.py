"""The gain of a loop where nobody asks for one: the file's, the customary, or half the limit."""

from __future__ import annotations

import json
import shutil
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RotationMatrix
from samples import LOOPS

from cdpr_drake.__main__ import main
from cdpr_drake.analysis import default_gain, gain_limit, lowest_gain
from cdpr_drake.analysis.default_gain import _rounded_down
from cdpr_drake.analysis.stability import SampledServo, StabilityWarning
from cdpr_drake.commands.parsing import parse
from cdpr_drake.commands.run import Plan, describe, plan
from cdpr_drake.diagrams import make_vision_based_control
from cdpr_drake.model.robot import CableRobot, load_robot, save_robot
from cdpr_drake.model.servo import CUSTOMARY_GAIN
from cdpr_drake.runs import Setup, make_setup, paper_test, prepare
from cdpr_drake.runs.moves import move_near_the_middle
from cdpr_drake.runs.running import doubt_about_gain
from cdpr_drake.show.explorer import Explorer

SIZES = ("cogiro", "cogiro-22m", "cogiro-37m", "cogiro-98m")


def damped(robot: CableRobot, factor: float) -> CableRobot:
    """Return a robot whose cables are damped so many times as much."""
    cable = robot.cable
    return robot.replace(cable=cable.replace(damping_time=factor * cable.damping_time))


@pytest.fixture
def large() -> CableRobot:
    """Return a robot on which the limit decides, whatever the large one's damping is."""
    return damped(load_robot("cogiro-98m"), 0.1)


@pytest.mark.parametrize("model", ["SCMWE", "SLSM"])
@pytest.mark.parametrize("factor", [1.0, 0.1])
@pytest.mark.parametrize("name", SIZES)
def test_the_gain_is_the_customary_one_or_half_the_limit(
    name: str, factor: float, model: str
) -> None:
    robot = damped(load_robot(name), factor)
    _, goal = move_near_the_middle(robot)
    limit = gain_limit(robot, goal, cable_model=model).gain
    found = default_gain(robot, goal, model)
    if limit == 0.0:  # or below where the search of gain_limit begins
        assert found.gain < 0.5e-3 and found.decided_by == "limit"
        return
    assert found.gain <= 0.5 * limit * (1.0 + 1e-6)
    assert found.gain == CUSTOMARY_GAIN or found.gain > 0.5 * limit / 1.11
    assert found.decided_by == ("custom" if limit >= 2.0 * CUSTOMARY_GAIN else "limit")
    if found.decided_by == "limit":
        assert found.limit is not None and found.limit.gain == pytest.approx(limit, rel=1e-5)
        assert (
            found.reason()
            == f"half the limit of {limit:.2g} 1/s at the goal, with the damping assumed"
        )
        assert found.to_dict()["gain_limit_per_s"] == pytest.approx(limit, rel=1e-5)
    else:
        assert found.reason() == ""


def test_the_gain_follows_its_limit_down_to_hardly_any_damping(large: CableRobot) -> None:
    """A large robot may have a limit below where `gain_limit` begins to look."""
    gains = []
    for factor in (1.0, 0.1, 1e-2, 0.0):
        robot = damped(large, factor)
        goal = RigidTransform([3.6, 0.1, 15.5])  # higher up, no gain is stable without damping
        found = default_gain(robot, goal)
        servo = SampledServo(robot, goal)
        assert found.limit is not None and found.decided_by == "limit"
        assert servo.growth(0.999 * found.limit.gain, 0.04).real < 0.0
        assert servo.growth(1.001 * found.limit.gain, 0.04).real > 0.0
        assert servo.growth(found.gain, 0.04).real < 0.0
        assert found.limit.unstable[0][0] == found.limit.gain and found.limit.mode
        gains.append(found.gain)
    assert gains == sorted(gains, reverse=True) and 0.0 < gains[-1] < 0.5e-3


def test_on_cogiro_the_customary_gain_stands_at_every_goal(cogiro: CableRobot) -> None:
    for number in range(1, 6):
        test = paper_test(number)
        found = default_gain(test.carried_by(cogiro), test.poses(cogiro)[1])
        assert (found.gain, found.decided_by) == (0.1, "custom")


def test_a_file_s_gain_wins(large: CableRobot) -> None:
    start, goal = move_near_the_middle(large)
    for gain in (0.02, 0.7):
        found = default_gain(large.replace(gain=gain), goal)
        assert (found.gain, found.decided_by, found.limit) == (gain, "robot file", None)
        assert found.reason() == "as the robot file says"
    for loop in LOOPS.values():
        named = large.replace(gain=0.7)
        assert Setup(robot=named, start=start, goal=goal, loop=loop).gain == 0.7


def test_timing_and_law_are_heeded(large: CableRobot) -> None:
    _, goal = move_near_the_middle(large)
    late = default_gain(large, goal, latency=0.0)
    assert late.gain <= 0.5 * gain_limit(large, goal, latency=0.0).gain * (1.0 + 1e-6)
    continuous = default_gain(large, goal, sample_time=None)
    assert {late.gain, continuous.gain}.isdisjoint({default_gain(large, goal).gain})
    assert default_gain(large, goal, latency=0.7).decided_by == "custom"  # no prediction
    share = default_gain(large, goal, customary=0.3, share=0.6)
    assert share.limit is not None and share.gain == _rounded_down(0.6 * share.limit.gain)
    assert (
        share.reason("here")
        == f"0.6 of the limit of {share.limit.gain:.2g} 1/s here, with the damping assumed"
    )
    with pytest.raises(ValueError, match="latency"):
        default_gain(large, goal, latency=-0.1)
    with pytest.raises(ValueError, match="cables in the robot believed"):
        default_gain(large, goal, believed=_with_seven_cables(large))


def test_where_a_robot_cannot_rest_the_customary_gain_stands(cogiro: CableRobot) -> None:
    for place in ([50.0, 0.0, 1.0], cogiro.drawing_points[0]):
        found = default_gain(cogiro, [0.0, 0.0, 0.0, *place])
        assert (found.gain, found.decided_by, found.limit) == (CUSTOMARY_GAIN, "custom", None)


def test_where_no_gain_is_stable_the_customary_one_stands_and_is_warned_of(
    cogiro: CableRobot,
) -> None:
    _, goal = move_near_the_middle(cogiro)
    # A camera believed to stand at the other side of the goal: the law turns away from it.
    X_WG = RigidTransform(goal.translation())
    turn = X_WG @ RigidTransform(RotationMatrix.MakeZRotation(np.pi), np.zeros(3)) @ X_WG.inverse()
    cameras = cogiro.cameras.replace(X_WF=turn @ cogiro.cameras.X_WF)
    believed = cogiro.replace(cameras=cameras)
    seen = turn @ goal
    found = default_gain(cogiro, seen, believed=believed)
    assert found.gain == CUSTOMARY_GAIN and found.decided_by == "custom"
    assert found.limit is not None and found.limit.gain == 0.0
    setup = make_setup(robot=cogiro, start=goal, goal=seen, believed=believed)
    assert "above the limit predicted at the goal, 0/s" in doubt_about_gain(setup)


def test_of_several_the_lowest_is_good_for_all(large: CableRobot) -> None:
    _, goal = move_near_the_middle(large)
    found = [default_gain(large, goal, model) for model in ("SLSM", "SCMWE", "ECM")]
    assert lowest_gain(found).gain == min(one.gain for one in found)


def test_a_setup_without_a_gain_chooses_one(large: CableRobot) -> None:
    start, goal = move_near_the_middle(large)
    setup = Setup(robot=large, start=start, goal=goal, noise=False)
    assert setup.chosen is not None and setup.chosen.decided_by == "limit"
    assert setup.gain == setup.chosen.gain == default_gain(large, goal).gain
    assert setup.replace(until=3.0).gain == setup.gain
    assert setup.replace(until=3.0).chosen is None  # the copy was told its gain
    assert setup.replace(robot=large.replace(gain=0.01), gain=None).gain == 0.01
    given = make_setup(robot=large, start=start, goal=goal, gain=0.1)
    assert given.chosen is None and "above the limit" in doubt_about_gain(given)
    with warnings.catch_warnings():
        warnings.simplefilter("error", StabilityWarning)
        prepare(setup)


def test_a_setup_looks_for_its_limit_once(large: CableRobot, monkeypatch: Any) -> None:
    from cdpr_drake.runs import running as runs

    start, goal = move_near_the_middle(large)
    setup = Setup(robot=large, start=start, goal=goal)
    monkeypatch.setattr(runs, "predicted_limit", None)
    assert doubt_about_gain(setup) == ""


def test_a_loop_takes_the_robot_s_gain_or_the_customary_one(cogiro: CableRobot) -> None:
    def gain(robot: CableRobot, **given: float) -> float:
        loop = make_vision_based_control(robot, **given)  # type: ignore[arg-type]
        settings: Any = loop.GetSubsystemByName("servo")
        return float(settings.settings.gain)

    assert gain(cogiro) == CUSTOMARY_GAIN
    assert gain(cogiro.replace(gain=0.03)) == 0.03
    assert gain(cogiro.replace(gain=0.03), gain=0.2) == 0.2


@given(st.floats(1e-6, 1e3))
def test_rounding_never_rounds_up(value: float) -> None:
    rounded = _rounded_down(value)
    assert 0.9 * value < rounded <= value
    assert np.isclose(float(f"{rounded:.2g}"), rounded, rtol=1e-15)


def _with_seven_cables(robot: CableRobot) -> CableRobot:
    return robot.replace(
        drawing_points=robot.drawing_points[:7],
        attachment_points=robot.attachment_points[:7],
        cable=robot.cable.replace(drum_run=1.0),
        winch=robot.winch.replace(encoder_zero_length=0.0),
        load_cells=robot.load_cells.replace(bias=0.0, gain=1.0),
    )


# --- on the command line


@pytest.fixture
def robot_file(tmp_path: Path, large: CableRobot, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Write the robot on which the limit decides, changed or not, and return the file's name."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "400")

    def write(**changes: Any) -> str:
        save_robot(large.replace(**changes), tmp_path / "mine.yaml")
        return "mine.yaml"

    return write


RUN = ("run", "--until", "0.1", "--no-figures", "--no-replay")


def told(capsys: pytest.CaptureFixture[str], *argv: str) -> tuple[str, dict[str, Any]]:
    """Return what a command prints on stdout, and its summary."""
    assert main([*argv, "--output", "out"]) == 0
    return capsys.readouterr().out, json.loads(Path("out/summary.json").read_text())


@pytest.mark.parametrize("models", ["SCMWE,SLSM", "SLSM", "ECM"])
def test_a_run_tells_that_the_limit_decided(
    capsys: pytest.CaptureFixture[str], robot_file: Any, large: CableRobot, models: str
) -> None:
    text, summary = told(capsys, *RUN, "--robot", robot_file(), "--cable-model", models)
    _, goal = move_near_the_middle(large)
    limit = min(gain_limit(large, goal, cable_model=m).gain for m in models.split(","))
    gain = summary["gain_per_s"]
    assert 0.45 * limit < gain <= 0.5 * limit * (1.0 + 1e-6)
    assert summary["gain_decided_by"] == "limit"
    assert summary["gain_limit_per_s"] == pytest.approx(limit, rel=1e-5)
    reason = f"half the limit of {limit:.2g} 1/s at the goal, with the damping assumed"
    assert f"lambda = {gain:g} 1/s ({reason})" in text


def test_a_run_tells_that_the_file_decided(
    capsys: pytest.CaptureFixture[str], robot_file: Any
) -> None:
    text, summary = told(capsys, *RUN, "--robot", robot_file(gain=0.01))
    assert (summary["gain_per_s"], summary["gain_decided_by"]) == (0.01, "robot file")
    assert "lambda = 0.01 1/s (as the robot file says)" in text
    # Too high a gain of the file is taken, and warned of, as one that was asked for.
    assert main([*RUN, "--robot", robot_file(gain=0.4)]) == 0
    streams = capsys.readouterr()
    assert "lambda = 0.4 1/s" in streams.out and "above the limit predicted" in streams.err


def test_a_gain_asked_for_is_taken_as_it_is(
    capsys: pytest.CaptureFixture[str], robot_file: Any
) -> None:
    text, summary = told(capsys, *RUN, "--robot", robot_file(gain=0.01), "--gain", "0.3")
    assert (summary["gain_per_s"], summary["gain_decided_by"]) == (0.3, "option")
    assert "lambda = 0.3 1/s, " in text and summary["gain_limit_per_s"] is None


def test_a_bad_gain_in_a_file_is_refused_by_name(
    capsys: pytest.CaptureFixture[str], robot_file: Any
) -> None:
    file = Path(robot_file())
    for gain in ("0", "-1", ".nan", ".inf", "fast"):
        robot_file()
        file.write_text(f"{file.read_text()}gain: {gain}\n")
        assert main([*RUN, "--robot", "mine.yaml"]) == 2
        assert "mine.yaml: gain: must be a" in capsys.readouterr().err.replace("positive", "a")


def test_the_demo_heeds_the_rule_and_a_test_asked_for_keeps_its_own(
    cogiro: CableRobot,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    save_robot(damped(cogiro, 0.0).replace(gain=0.07), "mine.yaml")
    argv = (*RUN, "--robot", "mine.yaml", "--controller", "vbc")
    _, demo = told(capsys, *argv)
    assert (demo["name"], demo["gain_per_s"]) == ("test-4", 0.07)
    _, test = told(capsys, *argv, "--test", "4")
    assert (test["gain_per_s"], test["gain_decided_by"]) == (0.1, "test")
    assert paper_test(4).gain == CUSTOMARY_GAIN  # else the demo were another
    _, cogiros = told(capsys, *RUN, "--controller", "vbc")
    assert (cogiros["gain_per_s"], cogiros["gain_decided_by"]) == (0.1, "custom")


def test_a_slow_gain_has_the_time_it_needs(robot_file: Any) -> None:
    def planned(*argv: str) -> Plan:
        return plan(parse(["run", *argv]).options)

    def until(**changes: Any) -> float:
        return planned("--robot", robot_file(**changes)).setups[0].until

    assert until(gain=0.05) == 160.0
    assert until(gain=0.003) == 400.0
    found = planned("--robot", robot_file(gain=0.003))
    assert "It ends after 1.2 of the gain's time constants" in describe(
        found.name, found.setups[0], found.chosen
    )
    assert planned("--robot", "cogiro-22m", "--gain", "0.05").setups[0].until == 80.0
    found = planned("--robot", "cogiro-22m", "--until", "400")
    assert "It ends" not in describe(found.name, found.setups[0], found.chosen)


@pytest.mark.parametrize("command", ["linearize", "coupling", "sweep"])
def test_other_commands_tell_it_too(
    command: str, capsys: pytest.CaptureFixture[str], robot_file: Any
) -> None:
    more = {
        "sweep": ["--cases", "1", "--jobs", "1", "--until", "0.1", "--payload", "0,50"],
        "coupling": ["--cable-model", "ECM,SLSM"],
    }
    argv = [command, *more.get(command, []), "--no-figures"]
    text, summary = told(capsys, *argv, "--robot", robot_file())
    gain, limit = summary["gain_per_s"], summary["gain_limit_per_s"]
    assert summary["gain_decided_by"] == "limit" and 0.45 * limit < gain <= 0.5 * limit
    assert f"lambda = {gain:g} 1/s (half the limit of {limit:.2g} 1/s " in text
    shutil.rmtree("out")
    text, summary = told(capsys, *argv, "--robot", robot_file(gain=0.01))
    assert (summary["gain_per_s"], summary["gain_decided_by"]) == (0.01, "robot file")
    assert "lambda = 0.01 1/s (as the robot file says)" in text


def test_the_explorer_begins_with_it(large: CableRobot) -> None:
    for gain in (0.0031, 0.031, 0.1, 0.7):
        explorer = Explorer(large, move_near_the_middle(large)[1], gain=gain)
        try:
            assert explorer.snapshot.gain == pytest.approx(gain, rel=1e-9)
        finally:
            explorer.close()
