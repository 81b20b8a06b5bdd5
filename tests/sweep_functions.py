"""What the tests of sweeps run; it loads little, so that a process that runs it starts soon."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

import numpy as np


def noisy(x: float, seed: int) -> dict[str, Any]:
    """Return numbers, texts and arrays of a case, and where it ran."""
    draw = np.random.default_rng(seed).normal(size=3)
    return {
        "y": x * x,
        "seed": seed,
        "text": f"x = {x}",
        "nested": {"list": [1, 2.5, None, True], "empty": {}},
        "draw": draw,
        "matrices": [np.eye(2) * x, np.array([1, 2])],
        "process": os.getpid(),
        "threads": os.environ.get("OMP_NUM_THREADS"),
    }


def picky(x: float, log: str) -> dict[str, Any]:
    """Note the call, and refuse 3."""
    with open(log, "a") as file:
        file.write(f"{x:g}\n")
    if x == 3.0:
        raise ValueError("not\nthree")
    return {"y": x, "vector": [x, x], "text": "a", "flag": True}


def deadly(x: int, folder: str) -> dict[str, Any]:
    """End the process: always for 4, the first time for 1."""
    with open(Path(folder) / f"runs-of-{x}", "a") as file:
        file.write("x")
    if x == 4 or (x == 1 and (Path(folder) / "runs-of-1").stat().st_size == 1):
        os._exit(9)
    return {"y": 10 * x}


def slow(x: int, folder: str, seed: int) -> dict[str, Any]:
    """Take a while, and note the process at start and end."""
    (Path(folder) / f"process-{os.getpid()}").touch()
    time.sleep(0.15)
    with open(Path(folder) / f"runs-of-{x}", "a") as file:
        file.write("x")
    return {"y": x, "seed": seed}


def nothing(x: float) -> None:
    """Return what is no mapping."""
