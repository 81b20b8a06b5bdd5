"""Refuse `Any` where a type is known: usage `check_types.py FOLDER...`, exit status 1 if any is.

The type checker lets pydrake's classes through unchecked, so that it is the reader who is helped by
`context: Context`. What has a name of `NAMES`, or one that ends with it, must not be `Any`:
parameters, attributes and annotated variables.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

NAMES = (
    "builder",
    "context",
    "diagram",
    "leaf",
    "loop",
    "output",
    "own",
    "plant",
    "robot",
    "simulator",
    "system",
)


def annotated(tree: ast.AST) -> Iterator[tuple[int, str, ast.expr]]:
    """Yield (line, name, annotation) of each parameter, attribute and variable that has one."""
    for node in ast.walk(tree):
        if isinstance(node, ast.arg) and node.annotation is not None:
            yield node.lineno, node.arg, node.annotation
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name | ast.Attribute):
            target = node.target
            name = target.id if isinstance(target, ast.Name) else target.attr
            yield node.lineno, name, node.annotation


def is_any(annotation: ast.expr) -> bool:
    """Whether an annotation is Any, or Any or something else: then it is Any as well."""
    if isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
        return is_any(ast.parse(annotation.value, mode="eval").body)
    if isinstance(annotation, ast.BinOp):
        return is_any(annotation.left) or is_any(annotation.right)
    if isinstance(annotation, ast.Subscript):
        inner = annotation.slice
        parts = inner.elts if isinstance(inner, ast.Tuple) else [inner]
        outer = ast.unparse(annotation.value).rpartition(".")[2]
        return outer in ("Optional", "Union", "Annotated") and any(map(is_any, parts))
    return ast.unparse(annotation).rpartition(".")[2] == "Any"


def untyped(text: str) -> list[tuple[int, str]]:
    """Return (line, name) of what the source `text` says is Any and is something of Drake's."""
    return [
        (line, name)
        for line, name, annotation in annotated(ast.parse(text))
        if name.rpartition("_")[2] in NAMES and is_any(annotation)
    ]


def main(folders: list[str]) -> int:
    """Print what is untyped in the Python files of some folders, and return the exit status."""
    files = [path for folder in folders for path in sorted(Path(folder).rglob("*.py"))]
    if not files:
        print(f"no Python files in {', '.join(folders) or 'no folder'}")
        return 2
    found = 0
    for path in files:
        for line, name in sorted(untyped(path.read_text(encoding="utf-8"))):
            print(f'{path}:{line}: "{name}: Any": say what it is')
            found += 1
    print(
        f"{found} names of things of Drake's are Any" if found else "All that is Drake's is typed"
    )
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
