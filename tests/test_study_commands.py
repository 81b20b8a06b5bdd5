"""linearize, stability and coupling on the command line, and the warning about a run's gain."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cdpr_drake.__main__ import main
from cdpr_drake.analysis import StabilityWarning, comparable_pose, gain_limit, gain_matrix
from cdpr_drake.commands.terminal import counted
from cdpr_drake.diagrams import JointSpaceLoop, make_vision_based_control
from cdpr_drake.model.robot import load_robot
from cdpr_drake.runs import Setup, prepare, setup_of_test
from cdpr_drake.runs.running import doubt_about_gain
from cdpr_drake.study import equilibrium, linearize

MAP = ("--map", "--gains", "0.3,9,4", "--latencies", "0,0.1,3")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory and a screen of 80 columns for each test."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    return tmp_path


def answer(capsys: pytest.CaptureFixture[str], *argv: str) -> dict[str, Any]:
    """Return the summary that a command prints as JSON."""
    assert main([*argv, "--json"]) == 0
    summary: dict[str, Any] = json.loads(capsys.readouterr().out)
    return summary


# --- linearize


def test_linearize_tells_the_modes_of_a_continuous_loop(
    capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    argv = ("--continuous", "--gain", "0.05", "--cable-model", "ecm")
    summary = answer(capsys, "linearize", *argv)
    test = setup_of_test(4)
    loop = make_vision_based_control(test.robot, "ECM", gain=0.05, sample_time=None)
    model = linearize(loop, equilibrium(loop, test.goal), [], ["pose_error"])
    told = [complex(m["real"], m["imag"]) for m in summary["modes"]]
    # A mode that swings stands for a conjugate pair. Which of two nearly equal real eigenvalues
    # come as such a pair is a matter of the last digit.
    told += [value.conjugate() for value in told if value.imag > 0.0]
    assert len(told) == model.eigenvalues.size
    expected = np.sort(np.abs(model.eigenvalues))
    assert np.sort(np.abs(told)) == pytest.approx(expected, rel=1e-6, abs=1e-6)
    assert summary["is_stable"] and summary["neutral"] == 2 and summary["sample_time_s"] is None
    written = {path.name for path in (here / "out" / "linearize-cogiro").iterdir()}
    assert written == set(summary["files"]) == {"summary.json", "poles.png", "mode_shape.png"}


def test_linearize_names_what_grows(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["linearize", "--gain", "2", "--no-figures"]) == 0
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    assert "states that take part" in text and "that end within a period of 0.05 s" in text
    assert "UNSTABLE: platform/z" in text
    assert main(["linearize", "--no-figures"]) == 0
    assert "\nStable; 2 neutral" in capsys.readouterr().out


# --- stability


def test_stability_tells_the_limit_and_the_mode(capsys: pytest.CaptureFixture[str]) -> None:
    argv = ("--test", "1", "--payload", "60", "--damping-time", "0.002", "--latency", "0.05")
    summary = answer(capsys, "stability", *argv)
    test = setup_of_test(1)
    robot = test.robot.with_payload(60.0)
    robot = robot.replace(cable=robot.cable.replace(damping_time=0.002))
    limit = gain_limit(robot, test.goal, latency=0.05)
    assert summary["gain_limit_per_s"] == pytest.approx(limit.gain)
    assert summary["critical_mode"] == limit.mode
    assert summary["mass_kg"] == robot.mass and summary["latency_s"] == 0.05
    assert summary["files"] == ["summary.json"]


def test_stability_maps_gain_and_latency(capsys: pytest.CaptureFixture[str], here: Path) -> None:
    assert main(["stability", *MAP]) == 0
    told = capsys.readouterr()
    assert "3 of 3 latencies in " in told.err
    assert max(map(len, told.out.splitlines())) <= 80
    summary = json.loads((here / "out" / "stability-cogiro" / "summary.json").read_text())
    found = summary["map"]
    assert found["latencies_s"] == [0.0, 0.05, 0.1]
    assert np.allclose(found["gains_per_s"], np.geomspace(0.3, 9.0, 4))
    growth = np.array(found["growth_per_s"])
    for i, limit in enumerate(found["limits"]):
        below = np.array(found["gains_per_s"]) < limit["gain_limit_per_s"]
        assert (growth[i][below] < 0.0).all() and growth[i][-1] > 0.0
        assert f"{limit['gain_limit_per_s']:.3g}  {limit['critical_mode']}" in told.out
    assert (here / "out" / "stability-cogiro" / "stability.png").stat().st_size > 10_000


# --- coupling


def test_coupling_compares_models_on_robots(capsys: pytest.CaptureFixture[str], here: Path) -> None:
    argv = ("--robot", "cogiro,cogiro-98m", "--cable-model", "scmwe,SLSM", "--output", "there")
    summary = answer(capsys, "coupling", *argv)
    rows = {(row["robot"], row["cable_model"]): row for row in summary["rows"]}
    assert len(rows) == 4
    robot = load_robot("cogiro-98m")
    expected = gain_matrix(robot, None, comparable_pose(robot), "SLSM")
    row = rows["cogiro-98m", "SLSM"]
    assert np.allclose(row["gamma"], expected.matrix)
    assert np.allclose(np.array(row["eigenvalues"])[:, 0], expected.eigenvalues.real)
    across = [np.delete(expected.matrix[3:, 3 + i], i) for i in range(3)]
    assert row["pushed_aside_mm_per_m"] == pytest.approx(1e3 * np.linalg.norm(across, axis=1).max())
    assert {path.name for path in (here / "there").iterdir()} == set(summary["files"])


def test_the_table_of_coupling_fits(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for columns in (80, 50):
        monkeypatch.setenv("COLUMNS", str(columns))
        assert main(["coupling", "--robot", "cogiro", "--pose", "1,1,1", "--no-figures"]) == 0
        told = capsys.readouterr().out.splitlines()
        assert max(map(len, told[:-1])) <= columns
        assert sum(line.startswith("cogiro ") for line in told) == 4


# --- all of them


@pytest.mark.parametrize("command", ["linearize", "stability", "coupling"])
def test_help_has_an_example(capsys: pytest.CaptureFixture[str], command: str) -> None:
    with pytest.raises(SystemExit) as ended:
        main([command, "--help"])
    assert ended.value.code == 0
    assert f"Example: cdpr-drake {command} --" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["linearize", "--gain", "30"], "must be below 1"),
        (["linearize", "--cable-model", "x"], 'unknown cable model "X"'),
        (["linearize", "--continuous", "--latency", "0.1"], "neither --sample-time nor --latency"),
        (["linearize", "--robot", "none"], "built-in robots"),
        (["stability", "--pose", "100,0,1"], "outside the wrench-feasible workspace"),
        (["stability", "--latency", "-1"], "latency must not be negative"),
        (["stability", "--sample-time", "0"], "sample time must be positive"),
        (["stability", "--damping-time", "-1"], "damping_time"),
        (["stability", "--gains", "1"], "FROM,TO,N"),
        (["stability", "--gains", "1,2,1"], "N is from 2"),
        (["stability", "--map", "--gains", "0,2,3"], "lowest must be positive"),
        (["stability", "--payload", "nan"], "payload"),
        (["stability", "--test", "9"], "no test 9"),
        (["coupling", "--test", "4"], "are for one robot"),
        (["coupling", "--gain", "0"], "must be positive"),
        (["coupling", "--robot", "cogiro", "--output", "file"], "not a directory"),
    ],
)
def test_bad_input_costs_one_line(
    capsys: pytest.CaptureFixture[str], here: Path, argv: list[str], message: str
) -> None:
    (here / "file").write_text("mine")
    assert main([*argv, "--no-figures"]) == 2
    told = capsys.readouterr()
    errors = [line for line in told.err.splitlines() if "error:" in line]
    assert told.out == "" and len(errors) == 1 and message in errors[0]
    assert [path.name for path in here.iterdir()] == ["file"]


def test_a_count_on_a_terminal_is_rewritten(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    assert list(counted([5, 7], "things")) == [5, 7]
    told = capsys.readouterr().err
    assert told.startswith("\r0 of 2 things") and "\r2 of 2 things in " in told


# --- the gain of a run


def high_gain(**changes: Any) -> Setup:
    return setup_of_test(4, noise=False, until=1.0, **changes)


def test_a_run_above_the_predicted_limit_warns() -> None:
    test = high_gain()
    timing = test.loop.timing
    limit = gain_limit(test.robot, test.goal, timing.latency, timing.sample_time or 0.0)
    assert doubt_about_gain(high_gain(gain=0.98 * limit.gain)) == ""
    above = high_gain(gain=1.02 * limit.gain)
    with pytest.warns(StabilityWarning, match=f"{limit.gain:.3g}/s, where {limit.mode} goes"):
        prepare(above)


def test_a_continuous_run_has_its_own_limit() -> None:
    def growth(gain: float) -> float:
        test = high_gain()
        loop = make_vision_based_control(test.robot, gain=gain, sample_time=None)
        model = linearize(loop, equilibrium(loop, test.goal), [], ["pose_error"])
        swings = model.eigenvalues[np.abs(model.eigenvalues.imag) > 1.0]
        return float(swings.real.max())

    message = doubt_about_gain(high_gain(sample_time=None, gain=1.0))
    limit = float(message.split("at the goal, ")[1].split("/s")[0])
    assert growth(0.98 * limit) < 0.0 < growth(1.02 * limit)


def test_what_cannot_be_predicted_is_told() -> None:
    assert "above 10 frames" in doubt_about_gain(high_gain(latency=0.7))
    test = high_gain()
    nowhere = test.replace(goal=[0.0, 0.0, 0.0, 50.0, 0.0, 1.0])
    assert "not predicted" in doubt_about_gain(nowhere)


def test_joint_space_control_is_not_in_doubt() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert doubt_about_gain(high_gain(loop=JointSpaceLoop(), gain=3.0)) == ""


def test_the_command_line_warns_on_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["run", "--gain", "3", "--until", "0.1", "--no-figures", "--no-replay", "--json"]
    assert main([*argv, "--cable-model", "SCMWE", "--controller", "vbc"]) == 0
    told = capsys.readouterr()
    warned = [line for line in told.err.splitlines() if "warning:" in line]
    assert len(warned) == 1 and "above the limit predicted at the goal" in warned[0]
    assert json.loads(told.out)["gain_per_s"] == 3.0
