"""The benchmarks run, at their smallest, and say what peers they leave out. No time is judged."""

from __future__ import annotations

import argparse
import importlib.util
import json
import platform
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))  # behind what is installed

from benchmarks import (
    bench_catenary,
    bench_distribution,
    bench_integrators,
    bench_peers_cable,
    bench_peers_equilibrium,
    bench_peers_linearize,
    bench_peers_loop,
    bench_pulleys,
    bench_scale,
    bench_study,
    bench_sweep,
    bench_vision,
    harness,
)

ROOT = Path(__file__).resolve().parents[1]

SMALLEST: dict[str, tuple[Any, str]] = {
    "catenary": (bench_catenary, "--count 140 --rounds 1"),
    "distribution": (bench_distribution, "--poses 3 --rounds 1"),
    "integrators": (bench_integrators, "--until 0.1 --rounds 1"),
    "pulleys": (bench_pulleys, "--rounds 1 --until 0.5"),
    "peers_cable": (bench_peers_cable, "--count 600 --peer-count 6 --rounds 1"),
    "peers_equilibrium": (bench_peers_equilibrium, "--count 20 --poses 1 --rounds 1"),
    "peers_linearize": (bench_peers_linearize, "--rounds 1"),
    "peers_loop": (bench_peers_loop, "--until 0.3 --rounds 1"),
    "scale": (bench_scale, "--rounds 1 --calls 5 --work 0"),
    "study": (bench_study, "--only theory --robots 1"),
    "sweep": (bench_sweep, "--cases 2 --workers 1 --until 1"),
    "vision": (bench_vision, "--rounds 1"),
}


WITH = [(name, True) for name in SMALLEST]
WITHOUT = [(name, False) for name in ("peers_cable", "peers_equilibrium", "peers_loop")]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "with_peers"), WITH + WITHOUT)
def test_a_benchmark_runs(
    name: str, with_peers: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module, options = SMALLEST[name]
    if not with_peers:
        monkeypatch.setattr(harness, "is_installed", lambda package: False)
    assert module.main([*options.split(), "--folder", str(tmp_path)]) == 0
    written = json.loads((tmp_path / f"{name}.json").read_text())
    assert written["command"] == f"python -m benchmarks {name} {options}"
    assert (written["tables"] or written["figures"]) and all(
        table["rows"] for table in written["tables"]
    )
    assert all(row["low"] <= row["median"] <= row["high"] for row in written["ratios"])
    assert with_peers or any("not installed" in why for why in written["skipped"])


def test_contestants_take_turns() -> None:
    calls: list[str] = []

    def note(name: str) -> Callable[[], None]:
        return lambda: calls.append(name)

    contestants = [harness.Contestant(name=n, call=note(n), units=2) for n in "ab"]
    times = harness.interleave(contestants, rounds=3)
    assert calls == list("ab" * 4)  # one round is not counted
    assert {n: len(t) for n, t in times.items()} == {"a": 3, "b": 3}


def test_what_a_call_needs_is_made_off_the_clock() -> None:
    made, used = iter(range(9)), []
    contestant = harness.Contestant(name="a", call=used.append, before=lambda: next(made))
    harness.interleave([contestant], rounds=2, warm=0)
    assert used == [0, 1]


def test_a_ratio_is_formed_round_by_round() -> None:
    spread = harness.ratio([2.0, 8.0, 30.0], [1.0, 2.0, 3.0])
    assert (spread.low, spread.median, spread.high) == (2.0, 4.0, 10.0)


def test_a_report_says_what_is_missed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def measure(report: harness.Report, _: argparse.Namespace) -> None:
        report.ratio("a / b", harness.Spread(median=3.0, low=1.0, high=4.0), at_least=2.0)
        report.figure("error", 2e-9, "m", at_most=1e-9)

    report = harness.run(
        "x", "Title.\n\nMore.", measure, lambda _: None, ["--folder", str(tmp_path)]
    )
    printed = capsys.readouterr().out
    assert "a / b: 3 (1 to 4), wanted >= 2: met" in printed
    assert "error: 2.0e-09 m, wanted <= 1.0e-09: MISSED" in printed
    assert [row["met"] for row in (*report.ratios, *report.figures)] == [True, False]
    assert not report.is_right()


def test_times_do_not_make_a_report_wrong(tmp_path: Path) -> None:
    def measure(report: harness.Report, _: argparse.Namespace) -> None:
        report.ratio("a / b", harness.Spread(median=1.0, low=1.0, high=4.0), at_least=2.0)
        report.figure("a frame", 4.0, "ms", at_most=3.0)

    report = harness.run("x", "Title.", measure, lambda _: None, ["--folder", str(tmp_path)])
    assert report.is_right()


def test_the_page_says_what_the_reports_say(tmp_path: Path) -> None:
    def measure(report: harness.Report, _: argparse.Namespace) -> None:
        spread = harness.Spread(median=12.5, low=11.25, high=13.75)
        report.table("one, two", [{"Test 4": "ours", "x real time": spread, "error": 1.25e-7}])
        report.ratio("peer / ours", spread, at_least=20.0)
        report.skip("nobody is not installed")

    for name in ("peers_loop", "another"):
        about = "What it is: ours, theirs.\n\nHow it is done.\n\n    python -m this"
        harness.run(name, about, measure, lambda _: None, ["--folder", str(tmp_path)])
    spec = importlib.util.spec_from_file_location("page", ROOT / "docs" / "make_performance.py")
    assert spec is not None and spec.loader is not None
    maker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(maker)
    reports = maker.read(tmp_path)
    assert list(reports) == ["peers_loop", "another"]
    text = maker.page(reports)
    assert "| peers_loop | peer / ours | 12.5 (11.2 to 13.8) | >= 20 | **missed** |" in text
    assert "## What it is: ours, theirs\n\nHow it is done.\n\n`python -m benchmarks another" in text
    assert "| ours | 12.5 (11.2 to 13.8) | 1.2e-07 |" in text
    assert "* left out: nobody is not installed" in text
    assert f"numpy {harness.machine()['numpy']}" in text.replace("\n", " ")
    maker.draw(reports, tmp_path / "x.png")
    assert (tmp_path / "x.png").stat().st_size > 5000


def test_the_machine_is_described_without_its_name() -> None:
    described = harness.machine()
    assert described["cores"] >= 1 and described["python"] and described["drake"]
    assert platform.node() not in json.dumps(described).split()


def test_the_command_passes_options_on() -> None:
    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "benchmarks", *arguments]
        return subprocess.run(command, capture_output=True, text=True, cwd=ROOT)

    passed_on = run("peers_cable", "--quick", "--nonsense", "3")
    assert passed_on.returncode == 2
    assert "peers_cable: error: unrecognized arguments: --nonsense 3" in passed_on.stderr
    assert "no benchmark nothing" in run("nothing").stderr
    assert "the name of one benchmark" in run("peers_cable", "scale", "--rounds", "3").stderr
