"""What a run leaves on disk: all of it, or nothing."""

from __future__ import annotations

import contextlib
import csv
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cdpr_drake.commands.terminal import print_message

if TYPE_CHECKING:
    from cdpr_drake.diagrams import Record

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


def write_summary(path: Path, summary: dict[str, Any]) -> None:
    """Write a summary as JSON.

    Args:
        path: of the file.
        summary: plain values.
    """
    path.write_text(to_json(summary) + "\n", encoding="utf-8")


def to_json(summary: dict[str, Any]) -> str:
    """Return a `summary` as JSON text."""
    return json.dumps(summary, indent=2, allow_nan=False)
