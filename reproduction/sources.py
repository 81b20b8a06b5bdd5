"""Which of our code and data a case's result may depend on, and whether that has changed."""

from __future__ import annotations

import ast
import functools
import hashlib
import json
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import yaml  # type: ignore[import-untyped]

ROOT = Path(__file__).resolve().parents[1]
"""Where this application and the package are found, as folders."""

PACKAGES = ("cdpr_drake", "reproduction")

BY_SECTION = ("assumptions.yaml", "printed.yaml")
"""Data files of which a case depends only on the sections that its code names."""

TEXTS = "texts.yaml"
"""Data files that only sections depend on."""


def source_of(function: Callable[..., Any], root: Path = ROOT) -> str:
    """Return a text that changes with the code and data that a function may depend on.

    That is the code of its module and of all that this imports, directly or not, comments and
    layout aside; the robots and tests; the sections of the files of assumptions and printed numbers
    that this code names; and the versions of Drake and NumPy.

    Args:
        function: at the top level of a module of ours.
        root: the folder with the packages' folders.
    """
    return _source_of_module(function.__module__, root)


@functools.cache
def _source_of_module(module: str, root: Path) -> str:
    digest = hashlib.sha256(f"{version('drake')} {np.__version__}".encode())
    named: set[Any] = set()
    for name in sorted(imported_by(module, root)):
        tree = _tree(_file(name, root))
        digest.update(f"{name} {ast.dump(tree)}".encode())
        named |= {n.value for n in ast.walk(tree) if isinstance(n, ast.Constant)}
    for path in sorted(p for name in PACKAGES for p in (root / name).rglob("*.yaml")):
        if path.name == TEXTS:
            continue
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
        if path.name in BY_SECTION:
            content = {section: values for section, values in content.items() if section in named}
        digest.update(f"{path.name} {json.dumps(content)}".encode())
    return digest.hexdigest()[:16]


def imported_by(module: str, root: Path = ROOT) -> set[str]:
    """Return the names of a module and of our modules that come with it.

    Args:
        module: of ours, in full.
        root: the folder with the packages' folders.
    """
    found: set[str] = set()
    todo = [module]
    while todo:
        name = todo.pop()
        if name in found or not _file(name, root).exists():
            continue
        found.add(name)
        todo += _with_parents(name)
        for target in _targets(name, _tree(_file(name, root))):
            todo += _with_parents(target)
    return found


def _targets(name: str, tree: ast.AST) -> Iterator[str]:
    """Yield what a module imports; of `from a import b` both a and a.b, which may be modules."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _with_parents(name: str) -> Iterator[str]:
    parts = name.split(".")
    return (".".join(parts[: i + 1]) for i in range(len(parts)))


def _file(name: str, root: Path) -> Path:
    parts = name.split(".")
    if parts[0] not in PACKAGES:
        return root / "not ours"
    folder = root.joinpath(*parts)
    return folder / "__init__.py" if folder.is_dir() else folder.with_suffix(".py")


@functools.cache
def _tree(path: Path) -> ast.AST:
    return ast.parse(path.read_text(encoding="utf-8"))
