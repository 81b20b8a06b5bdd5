"""What holds the package in shape: import direction, lazy imports, documented arguments."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import importlib.util
import inspect
import io
import re
import shutil
import subprocess
import sys
import tokenize
import warnings
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "cdpr_drake"

# A module imports only from its own layer and from lower ones.
LAYERS = {
    "errors": 0,
    "model": 1,
    "systems": 2,
    "diagrams": 3,
    "study": 4,
    "analysis": 4,
    "runs": 5,
    "batch": 6,
    "show": 6,
    "commands": 7,
    "__main__": 8,
}
HEAVY = ("cv2", "scipy.optimize", "matplotlib", "numba")


def module_name(path: Path) -> str:
    """Return the dotted name of a source file of the package."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


SOURCES = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py"))}


def imports(name: str, path: Path) -> Iterator[tuple[int, str]]:
    """Yield (line, imported name) for each import of a module, those inside functions too.

    `from a import b` yields `a.b`, and a relative import the name it stands for.
    """
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
            target = node.args[0]
            if isinstance(target, ast.Constant):
                yield node.lineno, importlib.util.resolve_name(target.value, package)
            else:
                yield node.lineno, "a name computed at run time"


def misplaced_imports(name: str, path: Path) -> list[str]:
    """Return a line for each import of a module that its layer does not allow."""
    layer = name.split(".")[1]
    wrong = []
    for line, target in imports(name, path):
        where = f"{path.name}:{line}: {layer} imports {target}"
        if target == "a name computed at run time":
            wrong.append(where)
        if target.split(".")[0] != "cdpr_drake" or target == "cdpr_drake.__version__":
            continue
        target_layer = [*target.split("."), ""][1]
        if target_layer not in LAYERS:
            wrong.append(f"{where}, not from the module that defines it")
        elif LAYERS[target_layer] > LAYERS[layer]:
            wrong.append(f"{where}, a higher layer")
    return wrong


# --- imports


@pytest.mark.parametrize("name", [name for name in SOURCES if name != "cdpr_drake"])
def test_imports_flow_one_way(name: str) -> None:
    assert not misplaced_imports(name, SOURCES[name])


def test_batch_and_show_do_not_import_each_other_both_ways() -> None:
    leaning = {
        (name.split(".")[1], target.split(".")[1])
        for name, path in SOURCES.items()
        for _, target in imports(name, path)
        if name.count(".") and target.startswith("cdpr_drake.")
    }
    assert not {("batch", "show"), ("show", "batch")} <= leaning


@pytest.mark.parametrize(
    "code",
    [
        "import cdpr_drake.study.modes",
        "from cdpr_drake.study.modes import modes",
        "from cdpr_drake import study",
        "from cdpr_drake import load_robot",
        "import cdpr_drake",
        "from ..study import modes",
        "from .. import diagrams",
        "def f():\n    from cdpr_drake.diagrams import make_cable_robot",
        "import importlib\nimportlib.import_module('cdpr_drake.study')",
        "import importlib\nimportlib.import_module('..study', __package__)",
        "import importlib\ndef f(x):\n    importlib.import_module(x)",
    ],
)
def test_an_upward_import_is_found(code: str, tmp_path: Path) -> None:
    path = tmp_path / "winch.py"
    path.write_text(code)
    assert len(misplaced_imports("cdpr_drake.systems.winch", path)) == 1


def test_a_downward_import_is_allowed(tmp_path: Path) -> None:
    path = tmp_path / "winch.py"
    path.write_text("from cdpr_drake.model.robot import Winch\nfrom ..errors import CdprError\n")
    assert not misplaced_imports("cdpr_drake.systems.winch", path)


def test_importing_the_package_loads_nothing_heavy() -> None:
    code = f"import sys, cdpr_drake; print([m for m in {HEAVY} if m in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


@pytest.mark.parametrize("name", SOURCES)
def test_no_star_import_and_no_pydrake_all(name: str) -> None:
    targets = [target for _, target in imports(name, SOURCES[name])]
    assert not [t for t in targets if t.endswith(".*") or f"{t}.".startswith("pydrake.all.")]


# --- each piece of mathematics once

DRAWING_POINTS = {"p_WA", "drawing", "drawing_points", "_A"}
KERNELS = "cdpr_drake.model.kernels."
BATCHED = "reproduction.table6.sag_search"
"""Robots and poses by the thousand in one array; its tests hold it to the package's functions."""

ONCE = {
    "attachment points turned into W": (
        r"attachment_points @|@ [\w.]*attachment_points",
        ["cdpr_drake.model.kinematics"],
    ),
    "a robot's arrays": (
        r"array\(\[[\w.]*drawing_points, [\w.]*attachment_points",
        ["cdpr_drake.model.arrays"],
    ),
    "the wrench column of a cable": (r"cross\([\w.]*(EB|EG|arm)\b", ["cdpr_drake.model.statics"]),
    "what holds a winch at rest": (r"hold / ", ["cdpr_drake.model.winch"] * 2),
}


def code(path: Path) -> ast.Module:
    """Return a source file parsed, without its docstrings."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        is_scope = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        if is_scope and ast.get_docstring(node, clean=False) is not None:
            node.body[0] = ast.Pass()
    return tree


def less_drawing_points(tree: ast.AST) -> list[str]:
    """Return the differences of anything else and a drawing point."""
    points = rf"(float\()?([\w.]*\.)?({'|'.join(DRAWING_POINTS)})\b"
    operations = [node for node in ast.walk(tree) if isinstance(node, ast.BinOp)]
    less = [(ast.unparse(n), n) for n in operations if isinstance(n.op, ast.Sub)]
    return [
        text
        for text, node in less
        if re.match(points, ast.unparse(node.right)) and not re.match(points, text)
    ]


def test_a_cable_s_chord_is_spelled_once_for_python_and_once_for_the_kernels() -> None:
    found = {n: less_drawing_points(code(p)) for n, p in SOURCES.items() if n != BATCHED}
    assert {name: places for name, places in found.items() if places} == {
        "cdpr_drake.model.kinematics": ["self.p_WB - self.p_WA"],
        "cdpr_drake.model.pulleys": ["p_WB - robot.drawing_points"],  # from where cables enter
        f"{KERNELS}geometry": [f"b[{i}] - float(drawing[i, {i}])" for i in range(3)],
    }


@pytest.mark.parametrize("what", ONCE)
def test_each_piece_of_mathematics_is_written_once(what: str) -> None:
    pattern, where = ONCE[what]
    sources = {n: p for n, p in SOURCES.items() if not n.startswith(KERNELS) and n != BATCHED}
    found = [n for n, p in sources.items() for _ in re.findall(pattern, ast.unparse(code(p)))]
    assert found == where


def test_no_kernel_spells_the_arms_and_moments_of_the_cables_out() -> None:
    pattern = r"R\[0, 0\] \* \w+ \+|\be[xyz] \* \w+ - e[xyz] \*"
    sources = {n: p for n, p in SOURCES.items() if n.startswith(KERNELS)}
    assert not [n for n, p in sources.items() if re.search(pattern, ast.unparse(code(p)))]


def test_another_spelling_of_a_chord_is_found() -> None:
    for text in ("x = EB + p - robot.drawing_points", "x = p_WB[i, 0] - float(p_WA[i, 0])"):
        assert less_drawing_points(ast.parse(text))
    assert not less_drawing_points(ast.parse("x = drawing_points[1] - drawing_points[0]"))


# --- functions that fit on a screen

LONGEST = 60
"""Lines of code in a function, without docstrings, comments and blank lines."""

NO_CODE = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT)


def long_functions(text: str, longest: int = LONGEST) -> list[str]:
    """Return the functions of a source text with more lines of code than `longest`."""
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    lines = {n for t in tokens if t.type not in NO_CODE for n in range(t.start[0], t.end[0] + 1)}
    tree = ast.parse(text)
    for node in ast.walk(tree):
        is_scope = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        if is_scope and ast.get_docstring(node, clean=False) is not None:
            lines -= {*range(node.body[0].lineno, node.body[0].end_lineno + 1)}
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    return [
        f.name for f in functions if len(lines & {*range(f.lineno, f.end_lineno + 1)}) > longest
    ]


def test_no_function_is_long() -> None:
    sources = {n: p.read_text(encoding="utf-8") for n, p in SOURCES.items()}
    found = {n: long_functions(t) for n, t in sources.items() if not n.startswith(KERNELS)}
    assert not {name: functions for name, functions in found.items() if functions}


def test_a_long_function_is_found_by_its_code_alone() -> None:
    text = '''"""A module."""

class A:
    """A class."""

    def f(self, x):
        """Return x.

        In many lines.
        """
        # A comment.
        y = (
            x
        )

        return y  # four lines and the head
'''
    assert long_functions(text, 5) == []
    assert long_functions(text, 4) == ["f"]
    assert long_functions("def f():\n    def g():\n        return 1\n    return g\n", 3) == ["f"]


# --- documentation


def bound_names(name: str) -> list[str]:
    """Return the public names that a module defines at its top level: def, class, assignment."""
    names = []
    for node in ast.parse(SOURCES[name].read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.append(node.name)
        elif isinstance(node, ast.Assign):
            names += [target.id for target in node.targets if isinstance(target, ast.Name)]
    return [n for n in names if not n.startswith("_")]


def plain_function(thing: Any) -> Any:
    """Return the Python function below what numba compiled or functools wrapped."""
    return inspect.unwrap(getattr(thing, "py_func", thing))


def arguments(thing: Any) -> list[str]:
    """Return the names of a function's or class's arguments."""
    kinds = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    parameters = inspect.signature(thing).parameters.values()
    return [p.name for p in parameters if p.kind not in kinds and p.name not in ("self", "cls")]


def commented_fields(cls: type) -> str:
    """Return the lines of a dataclass's source that declare a field and say what it is."""
    lines = inspect.getsource(cls).splitlines()
    return "\n".join(line for line in lines if re.match(r" +\w+: .*  # .", line))


def undocumented(label: str, thing: Any, shared: str = "") -> list[str]:
    """Return what the docstring of a function, or of a class and its methods, leaves out.

    What all functions of a module have in common may be in `shared`.
    """
    text = thing.__doc__ or ""
    if not text or text.startswith(f"{thing.__name__}("):  # the second is the dataclass's own
        return [f"{label}: no docstring"]
    text += shared
    if inspect.isfunction(thing):
        return [f"{label}: {a}" for a in arguments(thing) if not re.search(rf"\b{a}\b", text)]
    if issubclass(thing, Exception | Enum):
        return []  # users catch the one and look up the other; they make neither
    text += getattr(vars(thing).get("__init__"), "__doc__", None) or ""
    if dataclasses.is_dataclass(thing):
        text += commented_fields(thing)
    wrong = [f"{label}: {a}" for a in arguments(thing) if not re.search(rf"\b{a}\b", text)]
    for name, member in vars(thing).items():
        if name.startswith("_") or any(hasattr(base, name) for base in thing.__mro__[1:]):
            continue  # private, or documented by the class it overrides
        method = getattr(member, "fget", None) or getattr(member, "__func__", member)
        if inspect.isfunction(method) and method.__module__ == thing.__module__:
            wrong += undocumented(f"{label}.{name}", method)
    return wrong


def is_ours(thing: Any) -> bool:
    """Whether a thing is a function or class that the package itself defines."""
    if not (inspect.isfunction(thing) or isinstance(thing, type)):
        return False
    return thing.__module__.partition(".")[0] == "cdpr_drake"


@pytest.mark.parametrize("name", [name for name in SOURCES if bound_names(name)])
def test_every_argument_is_documented(name: str) -> None:
    module = importlib.import_module(name)
    things = {n: plain_function(getattr(module, n)) for n in bound_names(name)}
    # Kernels share their arguments, so the module says once what they are.
    shared = module.__doc__ or "" if name.startswith("cdpr_drake.model.kernels.") else ""
    wrong = [w for n, t in things.items() if is_ours(t) for w in undocumented(n, t, shared)]
    assert not wrong


def test_what_is_not_documented_is_found() -> None:
    def silent(l0: float) -> None: ...

    def terse(l0: float, EA: float) -> None:
        """Return the force for l0."""

    @dataclasses.dataclass(frozen=True, kw_only=True)
    class Bare:
        mass: float

    @dataclasses.dataclass(frozen=True, kw_only=True)
    class Winch:
        """A winch."""

        inertia: float  # [kg m2]
        radius: float

        def scale(self, factor: float) -> None:
            """Change the size."""

        @property
        def ratio(self) -> float:
            return 1.0

    assert undocumented("f", silent) == ["f: no docstring"]
    assert undocumented("f", terse) == ["f: EA"]
    assert undocumented("f", terse, "EA [N]: axial stiffness") == []
    assert undocumented("B", Bare) == ["B: no docstring"]
    expected = ["W: radius", "W.scale: factor", "W.ratio: no docstring"]
    assert undocumented("W", Winch) == expected


@pytest.mark.parametrize("name", SOURCES)
def test_every_module_with_code_says_what_it_is(name: str) -> None:
    tree = ast.parse(SOURCES[name].read_text(encoding="utf-8"))
    assert not tree.body or ast.get_docstring(tree)


# --- the repository


def test_no_path_of_one_machine_in_any_file() -> None:
    if not (ROOT / ".git").exists() or not shutil.which("git"):
        pytest.skip("not a git checkout")
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True)
    pattern = re.compile(r"(?<![\w.~}])/(?:home|root|work)/\w")
    found = []
    for name in listing.stdout.decode().split("\0"):
        path = ROOT / name
        if not path.is_file() or b"\0" in path.read_bytes()[:8000]:
            continue
        text = path.read_text(encoding="utf-8", errors="replace")
        found += [f"{name}: {match.group()}" for match in pattern.finditer(text)]
    assert not found


def test_a_warning_raised_in_the_package_is_an_error() -> None:
    with pytest.raises(RuntimeWarning):
        warnings.warn_explicit("x", RuntimeWarning, "x.py", 1, module="cdpr_drake.model.robot")


def test_a_use_of_what_drake_deprecates_is_an_error() -> None:
    from pydrake.common.deprecation import DrakeDeprecationWarning

    with pytest.raises(DrakeDeprecationWarning):
        warnings.warn_explicit("x", DrakeDeprecationWarning, "x.py", 1, module="elsewhere")
