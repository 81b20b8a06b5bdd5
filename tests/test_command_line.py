"""The command line: what it prints and writes, and that bad input costs one line and no run."""

from __future__ import annotations

import csv
import importlib.util
import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from conftest import heed_interrupts

from cdpr_drake.__main__ import main
from cdpr_drake.commands import kernels
from cdpr_drake.commands.arguments import parse_pose
from cdpr_drake.commands.files import staged
from cdpr_drake.commands.parsing import parse
from cdpr_drake.commands.terminal import Column, Progress, fitting, table
from cdpr_drake.model.robot import load_robot, robot_names

SHORT = ("--until", "0.3")
BARE = (*SHORT, "--no-figures", "--no-replay")
LABELS = ("VBC SCMWE", "VBC SLSM", "JSC")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory and a screen of 80 columns for each test."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    return tmp_path


@pytest.fixture
def robot_file(here: Path) -> Callable[..., str]:
    """Write CoGiRo as a robot file with values changed by path, and return its name."""

    def write(**changes: Any) -> str:
        data = yaml.safe_load(load_robot("cogiro").to_yaml())
        for path, value in changes.items():
            *groups, name = path.split("__")
            place = data
            for group in groups:
                place = place[group]
            place[name] = value
        (here / "robot.yaml").write_text(yaml.safe_dump(data))
        return "robot.yaml"

    return write


def call(*argv: str, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run the command line in a process of its own."""
    command = [sys.executable, "-m", "cdpr_drake", *argv]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, **options)


# --- a whole run


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """A run as the demo makes it, but short."""
    folder = tmp_path_factory.mktemp("demo")
    environment = {**os.environ, "COLUMNS": "80"}
    result = call("run", "--until", "2", cwd=folder, env=environment)
    return SimpleNamespace(result=result, folder=folder, out=folder / "out" / "test-4")


def test_the_demo_tells_what_it_runs_how_it_went_and_where_it_put_it(demo: SimpleNamespace) -> None:
    assert demo.result.returncode == 0, demo.result.stderr
    text = demo.result.stdout
    assert text.startswith("Test 4 of the paper on cogiro, 100 kg: 1.77 m and 17.0 deg in 2 s")
    for label in LABELS:
        assert f"\n{label} " in text
    assert "In out/test-4: summary.json" in text
    assert max(map(len, text.splitlines())) <= 80


def test_without_a_terminal_progress_is_one_line_for_each_run(demo: SimpleNamespace) -> None:
    lines = demo.result.stderr.splitlines()
    lines = [line for line in lines if not line.startswith("cdpr-drake: ")]  # on compilation
    assert [line[:9].strip() for line in lines] == list(LABELS)
    assert all(" 2 s in " in line and "x real time" in line for line in lines)


def test_the_demo_writes_logs_figures_a_replay_and_a_summary_of_them(
    demo: SimpleNamespace,
) -> None:
    written = {path.name for path in demo.out.iterdir()}
    summary = json.loads((demo.out / "summary.json").read_text())
    assert written == set(summary["files"])
    assert {"vbc-scmwe.csv", "vbc-slsm.csv", "jsc.csv", "replay.html", "summary.json"} < written
    assert any(name.endswith(".png") for name in written)
    assert {path.name for path in demo.folder.iterdir()} == {"out"}
    assert [path.name for path in (demo.folder / "out").iterdir()] == ["test-4"]


def test_the_summary_has_what_was_run_and_what_came_of_it(demo: SimpleNamespace) -> None:
    summary = json.loads((demo.out / "summary.json").read_text())
    assert summary["robot"] == "cogiro" and summary["mass_kg"] == 100.0
    assert (summary["gain_per_s"], summary["seed"], summary["noise"]) == (0.1, 0, True)
    assert (summary["sample_time_s"], summary["latency_s"]) == (0.05, 0.04)
    assert tuple(summary["runs"]) == LABELS
    vision, joint = summary["runs"]["VBC SCMWE"], summary["runs"]["JSC"]
    assert vision["position_error_seen_mm"] > 0.0
    assert joint["position_error_seen_mm"] is joint["orientation_error_seen_deg"] is None
    assert vision["simulated_time_s"] == pytest.approx(2.0)
    assert vision["position_error_mm"] == pytest.approx(
        np.linalg.norm(vision["offset_mm"]), rel=1e-3
    )


def test_a_log_names_each_column_and_its_unit(demo: SimpleNamespace) -> None:
    with (demo.out / "vbc-scmwe.csv").open() as file:
        head, *rows = csv.reader(file)
    assert head[:4] == ["time [s]", "pose roll [rad]", "pose pitch [rad]", "pose yaw [rad]"]
    assert all(name.endswith("]") for name in head) and len(set(head)) == len(head)
    for column in ("pose_error s_tz [m]", "tension_at_drawing_point 8 [N]", "dbeta 1 [rad]"):
        assert column in head
    assert {len(row) for row in rows} == {len(head)}
    values = np.array(rows, float)
    assert values[:, 0] == pytest.approx(np.arange(41) * 0.05)
    assert np.linalg.norm(values[0, [head.index(f"pose_error s_t{i} [m]") for i in "xyz"]]) == (
        pytest.approx(1.773, abs=1e-3)
    )


def test_joint_space_control_logs_its_reference_and_nothing_seen(demo: SimpleNamespace) -> None:
    head = (demo.out / "jsc.csv").read_text().partition("\n")[0]
    assert "reference_error s_tx [m]" in head and "desired_pose x [m]" in head
    assert "seen" not in head and "measured" not in head


# --- options


def summary_of(capsys: pytest.CaptureFixture[str], *argv: str) -> dict[str, Any]:
    """Return the JSON that a short run prints, and nothing else."""
    assert main(["run", *BARE, "--json", *argv]) == 0
    return json.loads(capsys.readouterr().out)


def test_json_is_all_there_is_on_stdout(capsys: pytest.CaptureFixture[str], here: Path) -> None:
    summary = summary_of(capsys, "--controller", "vbc", "--cable-model", "slsm")
    assert summary == json.loads((here / "out" / "test-4" / "summary.json").read_text())
    assert summary["files"] == ["summary.json", "vbc-slsm.csv"]


@pytest.mark.parametrize(
    ("argv", "labels"),
    [
        (["--controller", "jsc"], ["JSC"]),
        (["--controller", "vbc"], ["VBC SCMWE", "VBC SLSM"]),
        (["--cable-model", "ecm,CMWE", "--cable-model", "ECM"], ["VBC ECM", "VBC CMWE", "JSC"]),
    ],
)
def test_runs_are_those_asked_for(
    capsys: pytest.CaptureFixture[str], argv: list[str], labels: list[str]
) -> None:
    assert list(summary_of(capsys, *argv)["runs"]) == labels


def test_options_reach_the_run(capsys: pytest.CaptureFixture[str], here: Path) -> None:
    summary = summary_of(
        capsys, "--controller", "vbc", "--test", "2", "--payload", "50", "--gain", "0.2",
        "--latency", "0.1", "--sample-time", "0.1", "--seed", "7", "--output", "a/b",
        "--to", "-0.5,0,1.5,1,-2,3",
    )  # fmt: skip
    assert (summary["mass_kg"], summary["payload_kg"]) == (150.0, 50.0)
    assert (summary["gain_per_s"], summary["latency_s"]) == (0.2, 0.1)
    assert (summary["sample_time_s"], summary["seed"]) == (0.1, 7)
    goal = summary["goal_x_y_z_m_roll_pitch_yaw_deg"]
    assert goal == pytest.approx([-0.5, 0.0, 1.5, 1.0, -2.0, 3.0])
    assert summary["start_x_y_z_m_roll_pitch_yaw_deg"][:3] == pytest.approx(
        [-0.75, -0.22, 0.71], abs=6e-3
    )
    assert (here / "a" / "b" / "summary.json").exists()


def test_a_continuous_loop_without_noise(capsys: pytest.CaptureFixture[str]) -> None:
    summary = summary_of(capsys, "--controller", "vbc", "--sample-time", "0", "--no-noise")
    assert summary["sample_time_s"] is None and summary["noise"] is False


@pytest.mark.parametrize("argv", [["--test", "1"], []])
def test_a_test_brings_its_payload(capsys: pytest.CaptureFixture[str], argv: list[str]) -> None:
    summary = summary_of(capsys, "--controller", "jsc", *argv)
    assert summary["mass_kg"] == (210.0 if argv else 100.0)
    assert summary["gain_per_s"] == (0.03 if argv else 0.1)


def test_another_robot_makes_a_short_move(capsys: pytest.CaptureFixture[str]) -> None:
    summary = summary_of(capsys, "--robot", "cogiro-98m", "--controller", "vbc")
    assert summary["name"] == summary["robot"] == "cogiro-98m"


def test_a_robot_file_keeps_its_own_payload_and_timing(
    capsys: pytest.CaptureFixture[str], robot_file: Callable[..., str]
) -> None:
    name = robot_file(name="mine!/../", payload__mass=20.0, cameras__latency=0.02)
    summary = summary_of(capsys, "--robot", name, "--controller", "vbc")
    assert summary["payload_kg"] == 20.0 and summary["latency_s"] == 0.02
    assert [path.name for path in Path("out").iterdir()] == ["mine"]


@pytest.mark.parametrize(
    ("text", "pose"),
    [
        ("1,2,3", [0, 0, 0, 1, 2, 3]),
        ("-1.5, 2e0 ,3,180,0,-90", [np.pi, 0, -np.pi / 2, -1.5, 2, 3]),
    ],
)
def test_poses(text: str, pose: list[float]) -> None:
    assert parse_pose(text) == pytest.approx(pose)


def test_a_pose_may_start_with_a_minus() -> None:
    options = parse(["run", "--from", "-1,0,2", "--to=-.5,0,2", "--seed", "3"]).options
    assert options.start[3:] == [-1.0, 0.0, 2.0] and options.goal[3:] == [-0.5, 0.0, 2.0]


def test_robots_lists_the_built_in_ones(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["robots"]) == 0
    text = capsys.readouterr().out
    for name, description in robot_names().items():
        robot = load_robot(name)
        row = next(line for line in text.splitlines() if line.startswith(f"{name} "))
        assert f"{robot.mass:.3g}" in row.split() and str(robot.num_cables) in row.split()
        assert description in " ".join(text.split())
    assert "14.6 x 10.6 x 5.5" in text


@pytest.mark.parametrize("argv", [["--version"], ["--help"], ["run", "--help"], []])
def test_help_and_version(capsys: pytest.CaptureFixture[str], argv: list[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(argv)
    assert stop.value.code == 0
    assert "cdpr-drake" in capsys.readouterr().out


def test_help_names_every_option_and_status(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["run", "--help"])
    text = capsys.readouterr().out
    assert "Exit status: 0, done" in text and "130" in text
    assert max(map(len, text.splitlines())) <= 80


# --- screens


@pytest.mark.parametrize("columns", [60, 50, 40])
def test_nothing_is_wider_than_the_screen(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, columns: int
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    assert main(["run", *BARE, "--output", "o"]) == 0
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= columns
    assert all(f"\n{label} " in text for label in LABELS)
    assert "Final error: " in " ".join(text.split())


def test_a_table_leaves_out_the_least_important_column_first() -> None:
    columns = [
        Column(heading=("", "run"), cells=["a", "bcd"], to_the_left=True),
        Column(heading=("x", "mm"), cells=["1.0", "22.0"], rank=2),
        Column(heading=("y", "N"), cells=["7", "8"], rank=1),
    ]
    assert table(columns) == "        x  y\nrun    mm  N\na     1.0  7\nbcd  22.0  8"
    assert fitting(columns, 12) == columns
    assert fitting(columns, 11) == [columns[0], columns[2]]
    assert fitting(columns, 1) == columns[:1]


class Terminal(io.StringIO):
    """A text stream that says it is a terminal."""

    def isatty(self) -> bool:
        """It is."""
        return True


def test_a_terminal_gets_a_bar_that_the_last_line_replaces(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setattr("cdpr_drake.commands.terminal.REDRAW_PERIOD", 0.0)
    progress = Progress("VBC", 80.0)
    for now in (0.0, 40.0, 80.0):
        progress(now)
    progress.done(25.0)
    *bars, last = sys.stderr.getvalue().split("\r")[1:]
    assert [bar.count("#") / (bar.count("#") + bar.count(".")) for bar in bars] == (
        pytest.approx([0.0, 0.5, 1.0], abs=0.02)
    )
    assert last.startswith("VBC  80 s in 0.0 s, 25.0 x real time ") and last.endswith("\n")
    assert {len(line.rstrip("\n")) for line in (*bars, last)} == {79}


# --- errors


def refusal(capsys: pytest.CaptureFixture[str], argv: list[str], status: int = 2) -> str:
    """Return the one line that a refused command prints, after seeing that it left nothing."""
    before = sorted(Path().rglob("*"))
    assert main(argv) == status
    out, err = capsys.readouterr()
    assert out == "" or status == 1
    assert sorted(Path().rglob("*")) == before
    *earlier, line = err.splitlines()
    assert status == 1 or not [text for text in earlier if "compiling" not in text]
    assert line.startswith("cdpr-drake: error: ")
    return line.removeprefix("cdpr-drake: error: ")


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["fly"], "argument COMMAND: invalid choice: 'fly'"),
        (
            ["reproduce"],
            "argument COMMAND: invalid choice: 'reproduce'; the reproduction is an application of "
            "the source checkout: make reproduce",
        ),
        (["run", "--bogus"], "unrecognized arguments: --bogus (try cdpr-drake run --help)"),
        (["run", "--test", "6"], "no test 6; the paper's tests are 1, 2, 3, 4, 5"),
        (["run", "--test", "x"], "argument --test: invalid int value: 'x' (try cdpr-drake run"),
        (["run", "--robot", "nope"], "nope: No such file or directory; built-in robots: acrobot,"),
        (["run", "--robot", ""], "no file: the name is empty; built-in robots: acrobot,"),
        (["run", "--robot", "."], ".: Is a directory"),
        (["run", "--payload", "-1"], "the payload must be >= 0 and finite, got -1 kg"),
        (["run", "--payload", "nan"], "the payload must be >= 0 and finite, got nan kg"),
        (["run", "--payload", "3000"], "the start at (x, y, z) = (-1.38, -0.93, 0.17) m is outs"),
        (["run", "--from", "1,2"], "argument --from: '1,2' is neither x,y,z [m] nor x,y,z,roll"),
        (["run", "--to", "1,2,nan"], "argument --to: '1,2,nan' is neither"),
        (["run", "--to", "0,0,9"], "the goal cannot be reached: platform position (0.00, 0.00, 9"),
        (["run", "--to", "9,0,2"], "the goal cannot be reached: platform position"),
        (["run", "--to", "0,0,2,0,90,0"], "the goal cannot be reached: platform pitch 90.0 deg"),
        (["run", "--from", "-6.5,-4,5"], "the start at (x, y, z) = (-6.50, -4.00, 5.00) m is out"),
        (["run", "--to", "-6.5,-4,5"], "the goal at (x, y, z) = (-6.50, -4.00, 5.00) m is outside"),
        (["run", "--cable-model", "ABC"], 'unknown cable model "ABC"; known are ECM, CMWE, SCMWE'),
        (["run", "--controller", "pid"], "argument --controller: invalid choice: 'pid'"),
        (["run", "--controller", "jsc", "--cable-model", "ECM"], "--cable-model (ECM, CMWE, SCMWE"),
        (["run", "--gain", "0"], "the gain must be positive and finite, got 0.0"),
        (["run", "--gain", "inf"], "the gain must be positive and finite, got inf"),
        (["run", "--gain", "20"], "gain * sample time = 20/s * 0.05 s = 1 must be below 1"),
        (["run", "--sample-time", "-1"], "the sample time must be positive, got -1.0 s"),
        (["run", "--sample-time", "nan"], "the sample time must be positive, got nan s"),
        (["run", "--latency", "-1"], "the latency must not be negative, got -1.0 s"),
        (["run", "--until", "0"], "the time to run until must be positive and finite, got 0.0"),
        (["run", "--seed", "-1"], "the seed must be from 0 to 2^32 - 1, got -1"),
    ],
)
def test_bad_arguments_cost_one_line(
    capsys: pytest.CaptureFixture[str], argv: list[str], message: str
) -> None:
    line = refusal(capsys, argv)
    assert line.startswith(message), line


POINTS = [[-7.0, -5.0, 5.0], [7.0, -5.0, 5.0], [7.0, 5.0, 5.0], [-7.0, 5.0, 5.0]]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"platform__mass": 0.0}, "platform.mass: must be positive and finite, got 0.0"),
        ({"platform__mass": float("nan")}, "platform.mass: must be positive and finite, got nan"),
        ({"cable__linear_density": -0.1}, "cable.linear_density: must be positive and finite"),
        ({"cable__stiffness": 0.0}, "cable.stiffness.asymptote: must be positive and finite"),
        ({"cable__stiffness": float("inf")}, "cable.stiffness.asymptote: must be positive and fin"),
        ({"cable__stifness": 1.0}, "cable.stifness: unknown field; did you mean stiffness?"),
        ({"platform__inertia": [[1, 0, 0], [0, 1, 0], [0, 0, 9]]}, "platform.inertia: no body has"),
        ({"platform__center_of_mass": [0.0, 0.0]}, "platform.center_of_mass: must have shape (3,)"),
        ({"attachment_points": POINTS}, "attachment_points: must have the shape of drawing_points"),
        ({"drawing_points": [[1.0, 2.0]]}, "drawing_points: must have shape (k, 3)"),
    ],
)
def test_a_bad_robot_file_costs_one_line_with_its_field(
    capsys: pytest.CaptureFixture[str],
    robot_file: Callable[..., str],
    changes: dict[str, Any],
    message: str,
) -> None:
    line = refusal(capsys, ["run", "--robot", robot_file(**changes)])
    assert message in line


@pytest.mark.parametrize("controller", ["vbc", "jsc", "both"])
@pytest.mark.parametrize("cables", ["four", "in one plane"])
def test_a_robot_that_cannot_be_controlled_is_refused(
    capsys: pytest.CaptureFixture[str],
    robot_file: Callable[..., str],
    controller: str,
    cables: str,
) -> None:
    if cables == "four":
        drawing, attachment = POINTS, [[0.1 * x, 0.1 * y, 0.5] for x, y, _ in POINTS]
    else:
        drawing = [[x + 0.1 * j, 0.0, 5.0] for x in (-7.0, 7.0) for j in range(4)]
        attachment = [[x + 0.1 * j, 0.0, 0.1 * j] for x in (-0.5, 0.5) for j in range(4)]
    changes = {"drawing_points": drawing, "attachment_points": attachment}
    k = len(drawing)
    per_cable = {
        "cable__drum_run": [5.4] * k,
        "winch__encoder_zero_length": [0.0] * k,
        "load_cells__bias": [0.0] * k,
        "load_cells__gain": [1.0] * k,
    }
    name = robot_file(name="mine", **changes, **per_cable)
    line = refusal(capsys, ["run", "--robot", name, "--controller", controller])
    assert "has rank below 6" in line


def test_an_output_that_is_a_file_is_refused_before_the_runs(
    capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    (here / "taken").write_text("mine")
    assert main(["run", "--output", "taken"]) == 2
    assert "--output taken: " in capsys.readouterr().err
    assert (here / "taken").read_text() == "mine"
    assert [path.name for path in here.iterdir()] == ["taken"]


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["--gain", "8", "--latency", "0.2"], r"cable \d at t = .* above the breaking load"),
        (["--gain", "3", "--latency", "0.5"], r"platform position at t = .* outside the hull"),
    ],
)
def test_a_run_that_leaves_the_model_costs_one_line_and_leaves_nothing(
    capsys: pytest.CaptureFixture[str], argv: list[str], message: str
) -> None:
    """Gains far above what the latency allows."""
    line = refusal(capsys, ["run", *argv, "--controller", "vbc", "--until", "20"], status=1)
    assert re.match(message, line)
    assert line.endswith("; nothing written")


def test_a_failure_to_write_keeps_what_was_there(here: Path) -> None:
    with staged(here / "out") as folder:
        (folder / "a.csv").write_text("1")
        (folder / "summary.json").write_text(json.dumps({"files": ["a.csv", "../x.csv"]}))
    (here / "out" / "notes.txt").write_text("mine")
    (here / "x.csv").write_text("mine")
    with pytest.raises(OSError, match="full"), staged(here / "out") as folder:
        (folder / "b.csv").write_text("2")
        raise OSError("full")
    assert sorted(p.name for p in (here / "out").iterdir()) == [
        "a.csv",
        "notes.txt",
        "summary.json",
    ]
    with staged(here / "out") as folder:
        (folder / "b.csv").write_text("2")
    assert sorted(p.name for p in (here / "out").iterdir()) == [
        "b.csv",
        "notes.txt",
        "summary.json",
    ]
    assert (here / "x.csv").exists()


# --- warnings


def test_an_unusual_robot_is_warned_of_once_on_one_line(
    capsys: pytest.CaptureFixture[str], robot_file: Callable[..., str]
) -> None:
    name = robot_file(cable__linear_density=0.1)
    assert main(["run", *BARE, "--robot", name, "--controller", "vbc", "--json"]) == 0
    out, err = capsys.readouterr()
    json.loads(out)
    warned = [line for line in err.splitlines() if "warning" in line]
    assert len(warned) == 1
    assert warned[0].startswith("cdpr-drake: warning: robot 'cogiro': cable.linear_density: over")


def test_a_start_below_the_lowest_tension_is_warned_of(
    capsys: pytest.CaptureFixture[str], robot_file: Callable[..., str]
) -> None:
    name = robot_file(cable__min_tension=200.0)
    assert main(["run", *BARE, "--robot", name]) == 0
    err = capsys.readouterr().err
    warned = [line for line in err.splitlines() if "warning" in line]
    assert warned == [
        f"cdpr-drake: warning: {', '.join(LABELS)}: starts with cable 5 at 196 N, "
        "below the robot's 200 N"
    ]


# --- compiling


@pytest.mark.parametrize("misses", [0, 1])
def test_compiling_is_announced_if_it_happens(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, misses: int
) -> None:
    stats = SimpleNamespace(cache_misses={"compiled before": 1})
    kernel = SimpleNamespace(py_func=None, stats=stats)
    monkeypatch.setattr(kernels, "is_compiled", lambda: True)
    monkeypatch.setattr(kernels, "_kernels", lambda: [kernel])
    with kernels.compilation_announced():
        stats.cache_misses["a signature"] = misses
        time.sleep(0.35)
    err = capsys.readouterr().err
    assert err.count("compiling kernels on their first use") == misses


@pytest.mark.needs("numba")
def test_numba_counts_what_it_compiles_and_not_what_it_loads(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the announcement rests on, and that it finds the kernels."""
    monkeypatch.setenv("CDPR_DRAKE_NUMBA", "1")
    (here / "doubling.py").write_text(
        "from cdpr_drake.model.kernels import jit\n\n@jit\ndef double(x):\n    return 2.0 * x\n"
    )
    for expected in (1, 0):
        name = f"{kernels._PREFIX}doubling"
        spec = importlib.util.spec_from_file_location(name, here / "doubling.py")
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, name, module)
        spec.loader.exec_module(module)
        assert module.double(1.0) == 2.0
        assert module.double in list(kernels._kernels())
        assert sum(module.double.stats.cache_misses.values()) == expected


def test_without_numba_it_says_so(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CDPR_DRAKE_NUMBA", "0")
    with kernels.compilation_announced():
        pass
    assert "numba is not installed or off" in capsys.readouterr().err


# --- processes


def test_the_status_of_the_process(here: Path) -> None:
    result = call("run", "--gain", "-1")
    assert result.returncode == 2 and result.stdout == ""
    assert result.stderr == (
        "cdpr-drake: error: the gain must be positive and finite, got -1.0 1/s\n"
    )
    assert not list(here.iterdir())


def test_help_needs_neither_drake_systems_nor_plots() -> None:
    code = (
        "import sys\nfrom cdpr_drake.__main__ import main\n"
        "try: main(['run', '--help'])\nexcept SystemExit: pass\n"
        "heavy = ('pydrake.systems.analysis', 'matplotlib', 'numba')\n"
        "print([name for name in heavy if name in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert result.stdout.endswith("\n[]\n")


def test_a_reader_that_stops_reading_is_no_error() -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "cdpr_drake", "robots"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None and process.stderr is not None
    process.stdout.close()
    assert process.stderr.read() == ""
    process.stderr.close()
    assert process.wait(timeout=60) == 0


RUN_AFTER_COMPILING = """
from cdpr_drake.__main__ import main
from cdpr_drake.commands.kernels import _kernels, compile_ahead
compile_ahead()
count = lambda: sum(len(kernel.signatures) for kernel in _kernels())
before = count()
assert before and not main(["run", "--until", "0.1", "--no-figures", "--no-replay"])
print(count() - before, "more")
"""


@pytest.mark.needs("numba")
def test_what_is_compiled_ahead_is_all_that_a_run_needs(here: Path) -> None:
    result = subprocess.run(
        [sys.executable, "-c", RUN_AFTER_COMPILING], capture_output=True, text=True, timeout=300
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout.splitlines()[-1] == "0 more"


@pytest.mark.skipif(os.name != "posix", reason="signals of other systems differ")
def test_an_interrupt_ends_it_cleanly(here: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "cdpr_drake", "run", "--until", "100000"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=heed_interrupts,
    )  # fmt: skip
    assert process.stdout is not None
    try:
        assert process.stdout.readline().startswith("Test 4")  # all is prepared
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 130
    assert err.splitlines()[-1] == "cdpr-drake: interrupted, nothing written"
    assert "Traceback" not in err + out
    assert not list(here.iterdir())
