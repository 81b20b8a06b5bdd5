"""What a worker does: runs a batch of cases. It loads no more than that, so that it starts soon."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

ARRAY = "__array__"
"""Stands in the JSON text for an array, which is stored beside it."""


def plain(value: Any) -> Any:
    """Return a value as it comes back from a file, arrays as arrays.

    As in JSON, tuples become lists and names become texts; NumPy's numbers become Python's.

    Args:
        value: numbers, texts, None, lists and mappings of these, and arrays of numbers or texts.

    Raises:
        TypeError: it is something else.
    """
    if isinstance(value, np.generic):  # first, for some are Python's numbers too
        value = value.item()
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in "biufcSU":
            raise TypeError(f"an array of {value.dtype} cannot be stored")
        return value
    if isinstance(value, Mapping):
        if ARRAY in value:
            raise TypeError(f'the name "{ARRAY}" is taken')
        return {str(name): plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    raise TypeError(f"a {type(value).__name__} cannot be stored")


def run_batch(
    function: Callable[..., Mapping[str, Any]], arguments: Sequence[Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """Return the records of a batch; in a worker.

    Args:
        function: what to call.
        arguments: of each call.
    """
    return [_run_case(function, case) for case in arguments]


def _run_case(
    function: Callable[..., Mapping[str, Any]], arguments: Mapping[str, Any]
) -> dict[str, Any]:
    wall, cpu = time.perf_counter(), time.thread_time()
    result, error = None, None
    try:
        value = function(**arguments)
        if not isinstance(value, Mapping):
            raise TypeError(f"the result is no mapping but a {type(value).__name__}")
        result = plain(value)
    except Exception as reason:
        error = error_text(reason)
    return {
        "result": result,
        "error": error,
        "cpu_time": time.thread_time() - cpu,
        "wall_time": time.perf_counter() - wall,
    }


def error_text(error: BaseException) -> list[str]:
    """Return class and message of an `error`, without line breaks."""
    return [type(error).__name__, " ".join(str(error).split())]


def nothing() -> None:
    """Return, which shows that the process runs."""


def obey_parent() -> None:
    """Leave Ctrl-C to the process that started this one, and end when it is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_after_parent, daemon=True).start()


def _end_after_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
