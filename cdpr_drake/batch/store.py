"""What a sweep keeps on disk: one file for each batch of cases, complete or not there."""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cdpr_drake.batch.job import ARRAY, plain
from cdpr_drake.errors import SweepError


def name_of(function: Callable[..., Any]) -> str:
    """Return the module and name of a function, by which another process finds it.

    Args:
        function: at the top level of a module.

    Raises:
        ValueError: it is not at the top level of a module.
    """
    name = getattr(function, "__qualname__", "")
    if not name.isidentifier():
        raise ValueError(f"{name or function}: needed is a function at the top level of a module")
    return f"{function.__module__}.{name}"


def fingerprint(value: Any) -> str:
    """Return a text that changes with a value, as a file's name takes it.

    Args:
        value: as `plain` takes it; a function counts by its name, an array by what is in it.

    Raises:
        TypeError: it is something else.
        ValueError: a function is not at the top level of a module.
    """
    text = json.dumps(_without_functions(value), sort_keys=True, default=_of_array)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _without_functions(value: Any) -> Any:
    if callable(value):
        return {"function": name_of(value)}
    if isinstance(value, Mapping):
        return {str(name): _without_functions(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_without_functions(entry) for entry in value]
    return plain(value)


def _of_array(array: np.ndarray) -> Any:
    if array.dtype.kind in "cS":
        array = array.view(np.uint8)
    return {ARRAY: [str(array.dtype), array.tolist()]}


def write_part(folder: Path, records: Mapping[str, Mapping[str, Any]]) -> None:
    """Write a part file, under another name until it is complete.

    Args:
        folder: which is there.
        records: plain values, by the fingerprints of the cases they are of.

    Raises:
        OSError: it cannot be written.
    """
    arrays: dict[str, np.ndarray] = {}

    def put_aside(array: np.ndarray) -> dict[str, str]:
        name = f"array{len(arrays)}"
        arrays[name] = array
        return {ARRAY: name}

    text = json.dumps(records, default=put_aside)
    path = folder / f"part-{fingerprint(list(records))}.npz"
    unfinished = path.with_suffix(".unfinished")
    with unfinished.open("wb") as file:
        np.savez_compressed(file, json=np.array(text), **arrays)  # type: ignore[arg-type]
        file.flush()
        os.fsync(file.fileno())
    os.replace(unfinished, path)


def read_parts(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the records of all part files of a folder, by the fingerprints of their cases.

    Where a case failed once and succeeded later, the success counts.

    Args:
        folder: which may be missing.

    Raises:
        SweepError: a file is damaged.
    """
    records: dict[str, dict[str, Any]] = {}
    for path in part_files(folder):
        try:
            part = _read(path)
        except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
            raise SweepError(
                f"{path}: damaged ({error}); without it, its cases run again"
            ) from None
        for key, record in part.items():
            if key not in records or records[key]["error"] is not None:
                records[key] = record
    return records


def part_files(folder: Path) -> Iterable[Path]:
    """Return the part files of a `folder`, which may be missing."""
    return sorted(folder.glob("part-*.npz"))


def _read(path: Path) -> dict[str, dict[str, Any]]:
    def put_back(entry: dict[str, Any]) -> Any:
        return file[entry[ARRAY]] if ARRAY in entry else entry

    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
        records: dict[str, dict[str, Any]] = json.loads(str(file["json"]), object_hook=put_back)
    return records
