"""The checks of `make lint` that are our own."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).resolve().parents[1] / ".ci" / "check_types.py"


@pytest.fixture(scope="module")
def checker() -> ModuleType:
    spec = importlib.util.spec_from_file_location("check_types", SCRIPT)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("code", "name"),
    [
        ("def f(context: Any) -> None: ...", "context"),
        ("def f(x: int, *, diagram: Any = None) -> None: ...", "diagram"),
        ("def f(system: Any, /) -> None: ...", "system"),
        ("async def f(loop: Any) -> None: ...", "loop"),
        ("class A:\n    def calc(self, context: Context, output: Any) -> None: ...", "output"),
        ("class A:\n    robot: Any", "robot"),
        ("class A:\n    def __init__(self, x):\n        self.own: Any = x", "own"),
        ("def f():\n    def g(leaf: Any): ...", "leaf"),
        ("def f(plant: typing.Any): ...", "plant"),
        ("def f(plant: 'Any'): ...", "plant"),
        ("def f(plant: Any | None): ...", "plant"),
        ("def f(plant: None | Any): ...", "plant"),
        ("def f(plant: Optional[Any]): ...", "plant"),
        ("def f(plant: typing.Union[Any, None]): ...", "plant"),
        ("def f(root_context: Any): ...", "root_context"),
        ("class A:\n    _simulator: Any = None", "_simulator"),
        ("builder: Any = make()", "builder"),
    ],
)
def test_any_for_something_of_drake_s_is_found(checker: ModuleType, code: str, name: str) -> None:
    assert [found for _, found in checker.untyped(code)] == [name]


@pytest.mark.parametrize(
    "code",
    [
        "def f(context: Context, output: BasicVector, value: Any) -> Any: ...",
        "def f(robot: CableRobot | None, system: 'System') -> None: ...",
        "def f(loop: Callable[[Any], None]) -> None: ...",
        "def f(systems: dict[str, Any]) -> None: ...",
        "def f(context, diagram=None): ...",
        "class A:\n    ecosystem: Any\n    robotics: Any",
        "pairs[0]: Any = 1",
    ],
)
def test_any_elsewhere_is_not_its_business(checker: ModuleType, code: str) -> None:
    assert checker.untyped(code) == []


def run(*folders: Path | str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, SCRIPT, *folders]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_script_names_file_line_and_name(tmp_path: Path) -> None:
    (tmp_path / "room").mkdir()
    bad = tmp_path / "room" / "bad.py"
    bad.write_text("from typing import Any\n\ndef f(own: Any, loop: Any) -> None: ...\n")
    found = run(tmp_path)
    assert found.returncode == 1
    first, second, last = found.stdout.splitlines()
    assert first.startswith(f'{bad}:3: "loop: Any"') and second.startswith(f'{bad}:3: "own: Any"')
    assert last.startswith("2 ")
    bad.write_text("def f(x: int) -> None: ...\n")
    assert run(tmp_path).returncode == 0


def test_the_script_that_looks_at_nothing_does_not_pass(tmp_path: Path) -> None:
    assert run().returncode == 2
    assert run(tmp_path).returncode == 2
