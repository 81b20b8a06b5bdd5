"""What a command leaves on disk: all of it, or nothing."""

from __future__ import annotations

import argparse
import contextlib
import csv
import json
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from cdpr_drake import __version__
from cdpr_drake.commands import UsageError
from cdpr_drake.commands.terminal import print_message, print_wrapped

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from cdpr_drake.diagrams import Record

Figures = Callable[[ModuleType], Mapping[str, Callable[[], "Figure"]]]

DOTS_PER_INCH = 100
SUMMARY = "summary.json"
SUFFIXES = (".csv", ".html", ".json", ".pdf", ".png", ".svg", ".yaml")

_POSE = ("roll [rad]", "pitch [rad]", "yaw [rad]", "x [m]", "y [m]", "z [m]")
_ERROR = ("s_wx [rad]", "s_wy [rad]", "s_wz [rad]", "s_tx [m]", "s_ty [m]", "s_tz [m]")

COLUMNS: dict[str, tuple[str, ...] | str] = {
    "pose": _POSE,
    "desired_pose": _POSE,
    "pose_error": _ERROR,
    "pose_error_seen": _ERROR,
    "reference_error": _ERROR,
    "tension_at_winch": "N",
    "tension_at_drawing_point": "N",
    "tension_at_attachment_point": "N",
    "measured_tension": "N",
    "dbeta": "rad",
    "unstrained_length": "m",
    "motor_angles": "rad",
    "motor_rates": "rad/s",
    "motor_torques": "N m",
}
"""The recorded signals in a log: names of their columns, or the unit of one for each cable."""


@contextlib.contextmanager
def staged(directory: Path) -> Iterator[Path]:
    """Give a folder to write to, and move what is in it to a directory if all goes well.

    A file of an earlier run there is replaced, or removed if the new run has none of that name;
    other files stay. If an exception leaves the block, the directory is as it was before.

    Args:
        directory: where the files shall be; made if need be, with the directories above it.

    Raises:
        OSError: it cannot be written.
    """
    if directory.exists() and not directory.is_dir():
        raise NotADirectoryError(f"{directory}: exists and is not a directory")
    near = directory
    while not near.exists():
        near = near.parent
    folder = Path(tempfile.mkdtemp(prefix=".cdpr-drake-", dir=near))
    try:
        yield folder
        stale = _files_of_earlier_run(directory)
        if stale:
            print_message(
                f"note: {directory} held an earlier run, now replaced; --output DIR keeps both"
            )
        directory.mkdir(parents=True, exist_ok=True)
        for file in sorted(folder.iterdir()):
            os.replace(file, directory / file.name)
            stale.discard(file.name)
        for name in stale:
            (directory / name).unlink(missing_ok=True)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _files_of_earlier_run(directory: Path) -> set[str]:
    """Return the names that a summary in a directory lists, plain files of that directory only."""
    try:
        names = json.loads((directory / SUMMARY).read_text(encoding="utf-8"))["files"]
        return {n for n in names if n == os.path.basename(n) and Path(n).suffix in SUFFIXES}
    except (OSError, ValueError, KeyError, TypeError):
        return set()


def write_answer(
    options: argparse.Namespace,
    name: str,
    summary: dict[str, Any],
    lines: Iterable[str],
    figures: Figures,
    texts: Mapping[str, str] | None = None,
) -> int:
    """Write summary and figures, print the answer or its JSON, and return the exit status.

    Args:
        options: with output, json and no_figures.
        name: of the directory, if the options do not say.
        summary: plain values; gains "cdpr_drake", "drake" and "files".
        lines: of the answer.
        figures: what makes each with `cdpr_drake.show`, by the names of their files without ".png".
        texts: other files, by their names.

    Raises:
        UsageError: the directory cannot be used.
    """
    directory = options.output or Path("out") / as_file_name(name)
    summary = {**summary, "cdpr_drake": __version__, "drake": version("drake"), "files": [SUMMARY]}
    try:
        with staged(directory) as folder:
            for file, text in (texts or {}).items():
                (folder / file).write_text(text, encoding="utf-8")
            drawings = {} if options.no_figures else as_drawings(figures)
            write_summary(folder, summary, drawings)
    except OSError as error:
        raise UsageError(f"--output {directory}: {error.strerror or error}") from error
    if options.json:
        print(to_json(summary))
        return 0
    for line in lines:
        print(line)
    print_wrapped(f"In {directory}: {', '.join(summary['files'])}", indent="    ")
    return 0


Drawing = Callable[[Path], object]
"""Draws something into the file at a path."""


def as_drawings(figures: Figures) -> dict[str, Drawing]:
    """Return what draws `figures`, by the names of their files."""
    from cdpr_drake import show

    def drawing(make: Callable[[], Figure]) -> Drawing:
        return lambda path: make().savefig(path, dpi=DOTS_PER_INCH)

    return {f"{name}.png": drawing(make) for name, make in figures(show).items()}


def write_summary(folder: Path, summary: dict[str, Any], drawings: Mapping[str, Drawing]) -> None:
    """Write the summary beside the results in a folder, then what is drawn of them.

    No drawing costs a result: one that fails leaves no file, but a warning on stderr and its reason
    in the summary.

    Args:
        folder: with the results.
        summary: plain values; gains "files", their names, and "not_drawn", reasons by name.
        drawings: by the names of their files.
    """
    results = sorted(file.name for file in folder.iterdir())
    drawn: list[str] = []
    summary |= {"files": [SUMMARY, *results], "not_drawn": {}}
    (folder / SUMMARY).write_text(f"{to_json(summary)}\n", encoding="utf-8")
    for name, draw in drawings.items():
        try:
            draw(folder / name)
            drawn.append(name)
        except Exception as error:
            (folder / name).unlink(missing_ok=True)
            reason = " ".join(str(error).split()) or type(error).__name__
            print_message(f"warning: {name} is not drawn: {reason}")
            summary["not_drawn"][name] = reason
    summary["files"] = [SUMMARY, *sorted([*results, *drawn])]
    (folder / SUMMARY).write_text(f"{to_json(summary)}\n", encoding="utf-8")


def as_file_name(text: str) -> str:
    """Return a `text` as the name of a file or directory."""
    return re.sub(r"[^\w.-]+", "-", text).strip(".-") or "robot"


def write_log(path: Path, record: Record) -> None:
    """Write a record as CSV: a line for each time, a heading that names each column and its unit.

    Args:
        path: of the file.
        record: the record.
    """
    import numpy as np

    headings, values = ["time [s]"], [record.time]
    for name, columns in COLUMNS.items():
        if name not in record.signals:
            continue
        signal = record[name]
        if isinstance(columns, str):
            columns = tuple(f"{i + 1} [{columns}]" for i in range(signal.shape[1]))
        headings += [f"{name} {column}" for column in columns]
        values += list(signal.T)
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerow(headings)
        np.savetxt(file, np.column_stack(values), fmt="%.9g", delimiter=",")


def to_json(summary: dict[str, Any]) -> str:
    """Return a `summary` as JSON text."""
    return json.dumps(summary, indent=2, allow_nan=False)
