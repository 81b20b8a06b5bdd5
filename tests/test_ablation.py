"""What each sensor is worth: sets of sensors, differences told from noise, the command."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cdpr_drake.__main__ import main
from cdpr_drake.analysis import gain_limit
from cdpr_drake.batch import Outcome, Sweep, ablation
from cdpr_drake.batch.ablation import (
    METRICS,
    Ablation,
    Statistic,
    ablate,
    ablation_case,
    ablation_setup,
    sensor_sets,
    suitable_gain,
)
from cdpr_drake.errors import RobotFileError
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.show import ablation_figure


def test_sensors_are_taken_away_one_kind_at_a_time(cogiro: CableRobot) -> None:
    sets = {s.label: (s.pose_cameras, s.modelled) for s in sensor_sets(cogiro)}
    assert sets == {
        "all sensors": (3, ()),
        "no load cells": (3, ("tensions",)),
        "no tangent cameras": (3, ("tangents",)),
        "neither of these": (3, ("tensions", "tangents")),
        "two pose cameras": (2, ()),
        "one pose camera": (1, ()),
    }
    for sensors in sensor_sets(cogiro):
        setup = ablation_setup(cogiro, sensors, 7, 0.3, 50.0)
        assert len(setup.robot.cameras.pose_cameras) == sensors.pose_cameras
        assert setup.loop.sensing.modelled == sensors.modelled
        assert setup.robot.cameras.pixel_bias_seed == setup.seed == 7
        assert setup.robot.mass == 150.0
        assert setup.loop.believed is not None and setup.loop.believed.mass == 100.0


@pytest.mark.parametrize("name", ["cogiro", "cogiro-98m"])
def test_the_gain_keeps_away_from_its_limit(name: str) -> None:
    robot = load_robot(name)
    found = suitable_gain(robot)
    gain = found.gain
    assert found.decided_by == ("custom" if gain == 0.3 else "limit")
    goal = ablation_setup(robot, sensor_sets(robot)[0], 0, gain).goal
    limit = gain_limit(robot, goal, robot.cameras.latency, robot.cameras.sample_time).gain
    assert gain <= 0.3 and gain < 0.65 * limit
    assert gain == 0.3 or gain > 0.55 * limit


@pytest.mark.parametrize(
    ("difference", "uncertainty", "told"),
    [
        (0.5, 0.1, True),
        (-0.5, 0.1, True),
        (0.5, 0.2, False),
        (0.01, 1e-9, False),
        (None, None, False),
    ],
)
def test_a_difference_is_told_from_noise_or_not(
    difference: float | None, uncertainty: float | None, told: bool
) -> None:
    value = Statistic(mean=2.0, deviation=0.1, difference=difference, uncertainty=uncertainty)
    assert value.is_told_apart is told


@pytest.mark.needs("numba")
def test_fewer_pose_cameras_are_felt_and_load_cells_are_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The last metres of Test 4, short of its end, with five draws of noise and bias."""
    monkeypatch.setattr(ablation, "DECAYS", 0.9)
    seeds = range(1, 6)
    of = {
        label: np.array(
            [[ablation_case("cogiro", label, 0.3, 0.0, seed)[m] for m in METRICS] for seed in seeds]
        )
        for label in ("all sensors", "neither of these", "one pose camera")
    }
    all_sensors, without, one = of.values()
    assert np.isnan(all_sensors[:, METRICS.index("settled_after")]).all()  # not in 3 s
    kept = np.array(METRICS) != "settled_after"
    np.testing.assert_allclose(without[:, kept], all_sensors[:, kept], rtol=5e-3)
    assert np.abs(without - all_sensors)[:, kept].max() > 0.0
    excursion = METRICS.index("position_excursion")
    felt, not_felt = (
        np.sqrt(np.mean((other - all_sensors)[:, excursion] ** 2)) for other in (one, without)
    )
    assert felt > 0.2 and felt > 50.0 * not_felt


def fake_sweep(result: Callable[..., dict[str, float]]) -> Callable[..., Sweep]:
    """A sweep that runs another function, here."""

    def sweep(function: Any, cases: Sequence[dict[str, Any]], **options: Any) -> Sweep:
        outcomes = []
        for case in cases:
            error, values = None, None
            try:
                values = result(**case)
            except ArithmeticError as problem:
                error = (type(problem).__name__, str(problem))
            outcomes.append(
                Outcome(arguments=case, result=values, error=error, cpu_time=0.0, wall_time=0.0)
            )
        return Sweep(outcomes=tuple(outcomes), resumed=0, wall_time=0.0)

    return sweep


@pytest.fixture
def canned(monkeypatch: pytest.MonkeyPatch) -> list[Ablation]:
    """Runs whose noise is the seed's, alike for all sets of sensors, and one that fails."""

    def result(robot: str, label: str, seed: int, **others: float) -> dict[str, float]:
        if label == "one pose camera" and seed == 2:
            raise ArithmeticError("too blind")
        worse = {"no load cells": 0.05, "two pose cameras": 0.5}.get(label, 0.0)
        noise = 10.0 * np.sin(seed) + (0.3 * np.cos(5.0 * seed) if worse < 0.1 else 0.0)
        return dict.fromkeys(
            METRICS, 30.0 + noise + worse + 0.01 * (label == "no load cells") * seed
        )

    monkeypatch.setattr(ablation, "sweep", fake_sweep(result))
    return ablate(["cogiro"], 4, gain=0.3)


def test_differences_are_taken_seed_by_seed(canned: list[Ablation]) -> None:
    (found,) = canned
    assert found.robot == "cogiro" and found.gain == 0.3
    assert found.distance == pytest.approx(1.77, abs=0.01)
    rows = {row.sensors.label: row for row in found.rows}
    reference = rows["all sensors"].statistics["position_error"]
    assert reference.difference is None and not reference.is_told_apart
    assert reference.deviation is not None and reference.deviation > 3.0
    same = rows["no tangent cameras"].statistics["position_error"]
    assert same.difference == 0.0 and not same.is_told_apart
    little = rows["no load cells"].statistics["position_error"]
    assert little.difference == pytest.approx(0.065) and not little.is_told_apart
    seen = rows["two pose cameras"].statistics["position_error"]
    expected = 0.5 - 0.3 * np.cos(5.0 * np.arange(4))
    assert seen.difference == pytest.approx(expected.mean())
    assert seen.uncertainty == pytest.approx(expected.std(ddof=1) / 2.0)
    lost = rows["one pose camera"]
    assert lost.failures == {2: "ArithmeticError: too blind"}
    assert lost.statistics["position_error"].mean is None


def test_the_figure_has_a_row_a_robot(canned: list[Ablation]) -> None:
    figure = ablation_figure(canned * 2)
    assert len(figure.axes) == 8
    assert figure.axes[0].get_yticklabels()[0].get_text() == "all sensors"
    assert any(t.get_text() == "not reached" for t in figure.axes[0].texts)
    with pytest.raises(ValueError, match="no ablations"):
        ablation_figure([])


def test_the_command_tells_it_and_writes_it_down(
    canned: list[Ablation],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("COLUMNS", "70")
    monkeypatch.setattr("cdpr_drake.batch.ablation.ablate", lambda *args, **options: canned)
    folder = tmp_path / "out"
    assert main(["ablate", "--robot", "cogiro", "--output", str(folder)]) == 0
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) <= 70
    assert "two pose cameras" in out and "one pose camera, seed 2: ArithmeticError" in out
    assert (folder / "sensors.png").stat().st_size > 10_000
    summary = json.loads((folder / "summary.json").read_text())
    row = summary["robots"]["cogiro"]["sensors"]["two pose cameras"]
    assert row["pose_cameras"] == 2 and row["position_error_mm"]["difference"] > 0.0


def test_a_gain_that_limit_or_file_decide_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(ablation, "sweep", fake_sweep(lambda **case: dict.fromkeys(METRICS, 1.0)))
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.chdir(tmp_path)
    large = load_robot("cogiro-98m")
    cable = large.cable.replace(damping_time=0.1 * large.cable.damping_time)
    for gain, by, reason in (
        (None, "limit", "0.6 of the limit of "),
        (0.01, "robot file", "as the robot file says"),
    ):
        Path("mine.yaml").write_text(large.replace(cable=cable, gain=gain).to_yaml())
        argv = ["ablate", "--robot", "mine.yaml", "--seeds", "1", "--no-figures"]
        assert main([*argv, "--output", "out"]) == 0
        summary = json.loads(Path("out/summary.json").read_text())["robots"]["cogiro-98m"]
        assert summary["gain_decided_by"] == by
        assert f"lambda = {summary['gain_per_s']:g} 1/s ({reason}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--seeds", "0"], "--seeds: must be at least 1"),
        (["--jobs", "0"], "--jobs: must be at least 1"),
        (["--gain", "-1"], "--gain: must be positive"),
        (["--unknown-payload", "nan"], "--unknown-payload: must be >= 0"),
        (["--robot", "nosuch"], "nosuch"),
        (["--robot", "cogiro", "--gain", "25"], "must be below 1"),
    ],
)
def test_what_cannot_be_used_is_refused(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["ablate", *arguments, "--output", str(tmp_path / "out")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_robot_without_cameras_is_refused(cogiro: CableRobot, tmp_path: Path) -> None:
    blind = cogiro.replace(cameras=cogiro.cameras.replace(pose_cameras=()))
    file = tmp_path / "blind.yaml"
    file.write_text(blind.to_yaml())
    with pytest.raises(RobotFileError, match="pose_cameras"):
        ablate([str(file)], 1)
