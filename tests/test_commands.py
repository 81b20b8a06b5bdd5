"""What commands are made of: the list, the help, commands of other packages, what options mean."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cdpr_drake.__main__ import main
from cdpr_drake.commands.parsing import parse
from cdpr_drake.commands.registry import BUILT_IN, GROUP, built_in_commands
from cdpr_drake.commands.resolve import resolve_move, resolve_place
from cdpr_drake.model.robot import load_robot
from cdpr_drake.runs import paper_test

WEIGH = '''
"""A command of another package, a file of its own."""

from cdpr_drake.commands import Command, UsageError
from cdpr_drake.commands import arguments as common


def add_arguments(parser):
    parser.add_argument("--robot", **common.ROBOT)
    parser.add_argument("--tonnes", action="store_true", help="in tonnes")


def work(options):
    from cdpr_drake.commands.resolve import resolve_robot

    if options.robot == "none":
        raise UsageError("--robot: none weighs nothing")
    print(resolve_robot(options.robot).mass / (1000.0 if options.tonnes else 1.0))
    return 3


COMMAND = Command(
    summary="tell what a robot weighs",
    description="Tell what a robot weighs, with what it carries.",
    example="--tonnes",
    add_arguments=add_arguments,
    work=work,
)
'''


class Elsewhere:
    """A folder on the path of other processes, where packages can be made."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def add(self, package: str, entry_points: str, **modules: str) -> None:
        """Make a package as an installer leaves it."""
        info = self.folder / f"{package.replace('-', '_')}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[{GROUP}]\n{entry_points}\n")
        for name, text in modules.items():
            (self.folder / f"{name}.py").write_text(text)

    def call(self, *argv: str) -> subprocess.CompletedProcess[str]:
        """Run the command line where the packages are."""
        path = os.pathsep.join((str(self.folder), *filter(None, sys.path)))
        environment = {**os.environ, "PYTHONPATH": path, "COLUMNS": "80"}
        command = [sys.executable, "-m", "cdpr_drake", *argv]
        return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300)


@pytest.fixture
def elsewhere(tmp_path: Path) -> Elsewhere:
    """A folder for packages."""
    return Elsewhere(tmp_path)


# --- commands of other packages


def test_a_package_adds_a_command_by_one_file(elsewhere: Elsewhere) -> None:
    elsewhere.add("weighing", "weigh = weighing:COMMAND", weighing=WEIGH)
    listed = elsewhere.call("--help")
    assert (listed.returncode, listed.stderr) == (0, "")
    assert "commands of other packages:\n  weigh      tell what a robot weighs (weighing)\n" in (
        listed.stdout
    )
    told = elsewhere.call("weigh", "--help")
    assert (told.returncode, told.stderr) == (0, "")
    assert told.stdout.startswith("usage: cdpr-drake weigh [-h] [--robot NAME|FILE] [--tonnes]\n")
    assert "\nExample:\n  cdpr-drake weigh --tonnes\n" in told.stdout
    done = elsewhere.call("weigh", "--tonnes", "--robot", "cogiro")
    assert (done.returncode, done.stderr) == (3, "")
    assert float(done.stdout) == pytest.approx(load_robot("cogiro").mass / 1000.0)


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["--robot", "none"], "--robot: none weighs nothing"),
        (["--stones"], "unrecognized arguments: --stones (try cdpr-drake weigh --help)"),
    ],
)
def test_its_errors_cost_one_line(elsewhere: Elsewhere, argv: list[str], message: str) -> None:
    elsewhere.add("weighing", "weigh = weighing:COMMAND", weighing=WEIGH)
    refused = elsewhere.call("weigh", *argv)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr == f"cdpr-drake: error: {message}\n"


@pytest.mark.parametrize(
    ("entry_point", "reason"),
    [
        ("bad = not_there:COMMAND", "ModuleNotFoundError: No module named 'not_there'"),
        ("bad = bad:COMMAND", "ZeroDivisionError"),
        ("bad = leaves:COMMAND", "SystemExit"),
        ("bad = good:work", "good:work is no Command"),
        ("run = good:COMMAND", "there is another of this name"),
        ("good = good:COMMAND", "command good of bad-luck, weighing: there is another of this"),
    ],
)
def test_one_that_cannot_be_used_is_one_line_and_leaves_the_others(
    elsewhere: Elsewhere, entry_point: str, reason: str
) -> None:
    elsewhere.add("weighing", "good = good:COMMAND\nfine = good:COMMAND", good=WEIGH)
    modules = {"bad": "1 / 0", "leaves": "raise SystemExit(4)"}
    elsewhere.add("bad-luck", entry_point, **modules)
    listed = elsewhere.call("--help")
    (line,) = listed.stderr.splitlines()
    assert listed.returncode == 0
    assert line.startswith("cdpr-drake: warning: command ")
    assert "bad-luck" in line and reason in line
    assert all(f"\n  {name} " in listed.stdout for name in (*BUILT_IN, "fine"))
    other = elsewhere.call("fine", "--robot", "cogiro")
    assert (other.returncode, other.stderr) == (3, "")
    name = entry_point.partition(" ")[0]
    if name not in BUILT_IN:
        refused = elsewhere.call(name)
        assert (refused.returncode, refused.stdout) == (2, "")
        assert refused.stderr == line.replace("warning:", "error:") + "\n"


# --- the list and the help

HELP_OF_ALL = """
import sys
from cdpr_drake.__main__ import main
from cdpr_drake.commands.registry import BUILT_IN
for argv in [["--help"], *([name, "--help"] for name in BUILT_IN)]:
    try:
        main(argv)
    except SystemExit as ended:
        assert ended.code == 0
heavy = ("numpy", "pydrake", "cv2", "scipy", "matplotlib", "numba", "cdpr_drake.model.robot")
print([name for name in heavy if name in sys.modules])
"""


def test_no_help_imports_what_takes_its_time() -> None:
    result = subprocess.run([sys.executable, "-c", HELP_OF_ALL], capture_output=True, text=True)
    assert result.stdout.splitlines()[-1:] == ["[]"], result.stderr


@pytest.mark.parametrize("argv", [[], *([name] for name in BUILT_IN)])
def test_every_help_fits_the_screen_and_has_an_example(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, argv: list[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit) as ended:
        main([*argv, "--help"])
    assert ended.value.code == 0
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    assert "\nExit status: 0, done" in text
    if argv:
        assert f"\nExample:\n  cdpr-drake {argv[0]}" in text


@pytest.mark.parametrize("name", BUILT_IN)
def test_an_example_can_be_typed_and_an_unknown_option_points_to_the_help(
    capsys: pytest.CaptureFixture[str], name: str
) -> None:
    command = built_in_commands()[name]
    assert parse([name, *shlex.split(command.example)]).command is command
    assert main([name, "--bogus"]) == 2
    assert capsys.readouterr().err == (
        f"cdpr-drake: error: unrecognized arguments: --bogus (try cdpr-drake {name} --help)\n"
    )


def test_an_option_is_not_a_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--bogus"]) == 2
    message = "unrecognized arguments: --bogus (try cdpr-drake --help)"
    assert capsys.readouterr().err == f"cdpr-drake: error: {message}\n"


# --- what options mean


@pytest.mark.parametrize("name", ["linearize", "stability", "explore", "sweep"])
def test_cable_models_may_be_in_lower_case(name: str) -> None:
    assert parse([name, "--cable-model", "slsm"]).options.cable_model == "SLSM"


@pytest.mark.parametrize("name", ["run", "coupling"])
def test_several_cable_models_may_be_in_lower_case(name: str) -> None:
    options = parse([name, "--cable-model", "ecm, Cmwe", "--cable-model", "SLSM"]).options
    assert options.cable_model == ["ECM", "CMWE", "SLSM"]


@pytest.mark.parametrize(
    ("argv", "payload"),
    [
        ([], paper_test(4).payload),
        (["--test", "1"], paper_test(1).payload),
        (["--test", "1", "--payload", "7"], 7.0),
        (["--robot", "cogiro-22m"], load_robot("cogiro-22m").payload.mass),
        (["--robot", "cogiro-22m", "--payload", "7"], 7.0),
    ],
)
def test_a_move_and_a_place_are_of_one_robot(argv: list[str], payload: float) -> None:
    place = resolve_place(parse(["linearize", *argv]).options)
    move = resolve_move(parse(["run", *argv]).options)
    assert place.robot == move.robot and move.robot.payload.mass == payload
    assert place.tensions == move.tensions
    assert (place.tensions == "minimum norm") == (move.test is not None)
    if move.test is not None:
        assert place.pose.IsExactlyEqualTo(move.goal)
        assert place.where == f"at the goal of Test {move.number}"


def test_tensions_within_limits_reach_the_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    lowest = {}
    for rule in ("minimum-norm", "within-limits"):
        argv = ["run", "--tensions", rule, "--controller", "vbc", "--cable-model", "ecm"]
        assert main([*argv, "--until", "0.1", "--no-figures", "--no-replay", "--json"]) == 0
        summary = json.loads(capsys.readouterr().out)
        assert summary["tensions"] == rule.replace("-", " ")
        lowest[rule] = summary["runs"]["VBC ECM"]["lowest_tension_N"]
    assert abs(lowest["within-limits"] - lowest["minimum-norm"]) > 10.0
    names = {path.name for path in Path("out").iterdir()}
    assert names == {"test-4-minimum-norm", "test-4-within-limits"}
    assert main(["coupling", "--robot", "cogiro", "--tensions", "within-limits", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert main(["coupling", "--robot", "cogiro", "--json"]) == 0
    others = json.loads(capsys.readouterr().out)["rows"]
    assert not np.allclose(rows[0]["gamma"], others[0]["gamma"], atol=1e-6)


def test_an_unknown_rule_costs_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["stability", "--tensions", "greatest"]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if "error:" in line]
    assert (
        len(lines) == 1
        and 'unknown rule "greatest"; known are minimum norm within limits' in lines[0]
    )
