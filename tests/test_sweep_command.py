"""`cdpr-drake sweep`: what is drawn, that it does not depend on who runs it, and its answer."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cdpr_drake.__main__ import main
from cdpr_drake.batch.monte_carlo import METRICS, base_case, draw, run_case
from cdpr_drake.batch.sweeps import case_seed, sweep
from cdpr_drake.model.robot import load_robot
from cdpr_drake.runs import run
from cdpr_drake.show.sweep_plots import sweep_figure

SHORT = ("--until", "0.5", "--cases", "3", "--jobs", "1")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory and a screen of 80 columns for each test."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    return tmp_path


def test_each_case_is_drawn_from_its_seed() -> None:
    base = base_case(test=3, until=1.0)
    spread: dict[str, Any] = {"payloads": (10.0, 90.0), "gains": (0.05, 0.4)}
    drawn = [draw(base, seed, **spread) for seed in range(200)]
    payloads = np.array([values["payload"] for _, values in drawn])
    gains = np.array([values["gain"] for _, values in drawn])
    # Even between the ends: the mean of 200 is known to the range over sqrt(12 200).
    assert payloads.min() >= 10.0 and payloads.max() <= 90.0
    assert payloads.mean() == pytest.approx(50.0, abs=4.0 * 80.0 / np.sqrt(12 * 200))
    middle, range_ = np.log(0.05 * 0.4) / 2.0, np.log(0.4 / 0.05)
    assert np.log(gains).mean() == pytest.approx(middle, abs=4.0 * range_ / np.sqrt(12 * 200))
    setup, values = drawn[7]
    assert setup.robot.payload.mass == values["payload"] and setup.gain == values["gain"]
    again, _ = draw(base, 7, **spread)
    assert again.seed == setup.seed and again.loop.believed == setup.loop.believed
    assert len({s.seed for s, _ in drawn}) == 200


def test_drawing_one_thing_more_leaves_the_others_as_they_are() -> None:
    base = base_case(test=4)
    plain, nothing = draw(base, 5)
    heavier, drawn = draw(base, 5, payloads=(10.0, 20.0))
    assert nothing == {} and set(drawn) == {"payload"}
    assert heavier.seed == plain.seed and plain.loop.believed is not None
    assert heavier.loop.believed is not None
    np.testing.assert_array_equal(
        heavier.loop.believed.drawing_points, plain.loop.believed.drawing_points
    )
    exact, _ = draw(base, 5, calibration=0.0)
    assert exact.loop.believed is None
    twice, _ = draw(base, 5, calibration=2.0)
    assert twice.loop.believed is not None
    shift = plain.loop.believed.drawing_points - plain.robot.drawing_points
    double = twice.loop.believed.drawing_points - plain.robot.drawing_points
    np.testing.assert_allclose(double, 2.0 * shift, atol=1e-14)


def test_a_case_is_the_run_it_stands_for() -> None:
    base = base_case(test=4, until=0.5)
    result = run_case(11, base, calibration=1.0, payloads=(20.0, 30.0))
    setup, drawn = draw(base, 11, calibration=1.0, payloads=(20.0, 30.0))
    summary = run(setup).summary
    assert result["payload"] == drawn["payload"] and result["simulated_time"] == 0.5
    for name in METRICS:
        expected = getattr(summary, name)
        missing = np.nan if expected is None else expected
        assert result[name] == pytest.approx(missing, nan_ok=True)
    assert np.isnan(result["settled_after"])


def test_the_base_is_a_test_or_a_move_near_the_middle() -> None:
    assert base_case()["until"] == base_case(test=4)["until"]
    assert base_case(test=1)["payload"] == 110.0
    small = base_case("cogiro-22m")
    assert "until" not in small and small["start"] != base_case()["start"]
    assert [base_case(test=n)["gain"] for n in (1, 4)] == [0.03, 0.1]
    assert base_case(test=1, gain=0.2)["gain"] == 0.2


def test_the_command_tells_the_spread(capsys: pytest.CaptureFixture[str], here: Path) -> None:
    assert main(["sweep", *SHORT, "--payload", "5,15"]) == 0
    told = capsys.readouterr()
    assert max(map(len, told.out.splitlines())) <= 80
    assert "position error" in told.out and "A million would take" in told.out
    assert "3 of 3 cases" in told.err
    folder = here / "out" / "sweep-cogiro"
    summary = json.loads((folder / "summary.json").read_text())
    assert (folder / "sweep.png").stat().st_size > 10_000
    seeds = [case_seed(0, i) for i in range(3)]
    base = base_case(until=0.5, cable_model="SCMWE", noise=True, sensors="gaussian")
    expected = [run_case(s, base, calibration=1.0, payloads=[5.0, 15.0]) for s in seeds]
    highest = max(r["highest_tension"] for r in expected)
    assert summary["metrics"]["highest_tension_N"]["highest"] == pytest.approx(highest)
    assert summary["metrics"]["settled_after_s"] == {"count": 0}

    # The folder has results: a new sweep must not mix with them, and --resume takes them.
    assert main(["sweep", *SHORT, "--payload", "5,15"]) == 2
    assert "--resume" in capsys.readouterr().err
    assert main(["sweep", *SHORT, "--payload", "5,15", "--resume", "--json"]) == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["metrics"] == summary["metrics"]
    assert "3 of them earlier" in told.err


def test_a_failed_case_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    # Gains far above the stable ones tear a cable soon; the low ones of the range do not.
    argv = ["sweep", "--until", "4", "--cases", "3", "--jobs", "1", "--gain", "0.1,19"]
    assert main([*argv, "--no-figures"]) == 1
    assert "CableError" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["--cases", "0"], "--cases"),
        (["--jobs", "0"], "--jobs"),
        (["--payload", "-1"], "--payload"),
        (["--gain", "0"], "--gain"),
        (["--gain", "0.3,0.1"], "neither a number"),
        (["--payload", "a"], "neither a number"),
        (["--calibration", "-1"], "--calibration"),
        (["--robot", "nowhere"], "nowhere"),
        (["--test", "9"], "test"),
        (["--cable-model", "FEM"], "FEM"),
        (["--sensors", "radar"], "radar"),
    ],
)
def test_input_that_cannot_be_used(
    argv: list[str], message: str, capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    assert main(["sweep", *argv]) == 2
    told = capsys.readouterr()
    # Other tests of this process may have compiled, which is announced.
    (said,) = [line for line in told.err.splitlines() if "compiling" not in line]
    assert message in said and not told.out
    assert not any(here.iterdir())


@pytest.mark.needs("distributed")
def test_a_dask_cluster_that_is_not_there(capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["sweep", *SHORT, "--dask", "tcp://127.0.0.1:9", "--no-figures"]
    assert main(argv) == 2
    assert "--dask tcp://127.0.0.1:9" in capsys.readouterr().err


def test_the_figure_shows_every_metric() -> None:
    base = base_case(test=4, until=0.3)
    fixed = sweep(run_case, [{"base": base}] * 2, jobs=1)
    over = sweep(run_case, [{"base": base, "payloads": [0.0, 9.0]}] * 2, jobs=1)
    labels = [axes.get_xlabel() for axes in sweep_figure(fixed).axes]
    assert len(set(labels)) == 6
    assert {axes.get_xlabel() for axes in sweep_figure(over).axes} == {"payload [kg]"}


def test_payloads_are_those_of_the_robot() -> None:
    setup, _ = draw(base_case(test=1), 0)
    assert setup.robot == load_robot("cogiro").with_payload(110.0)
