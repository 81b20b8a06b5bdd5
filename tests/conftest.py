"""What tests share: probes of the machine, and `@pytest.mark.needs(name)` to skip by them."""

from __future__ import annotations

import importlib.util
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from pathlib import Path

import hypothesis
import pytest

from cdpr_drake.diagrams.rendering import rendering_available
from cdpr_drake.model.robot import CableRobot, load_robot

os.environ.setdefault("MPLBACKEND", "Agg")  # figures open no window

# For `reproduction` and `benchmarks`; behind what is installed.
sys.path.append(str(Path(__file__).resolve().parents[1]))

# No deadline: a test must not fail because the machine is busy or numba compiles.
hypothesis.settings.register_profile("cdpr_drake", hypothesis.settings.default, deadline=None)
hypothesis.settings.load_profile("cdpr_drake")


def _runs(*command: str) -> bool:
    try:
        return subprocess.run(command, capture_output=True, timeout=60).returncode == 0
    except (OSError, subprocess.TimeoutExpired):
        return False


def heed_interrupts() -> None:
    """Make a child process end at Ctrl-C, for one that a background job starts ignores it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@cache
def has_numba() -> bool:
    """Whether numba is installed."""
    return importlib.util.find_spec("numba") is not None


@cache
def find_chromium() -> str | None:
    """Return the path of a Chromium or Chrome that starts, or None."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        path = shutil.which(name)
        if path and _runs(path, "--version"):
            return path
    return None


def has_chromium() -> bool:
    """Whether there is a Chromium or Chrome that starts."""
    return find_chromium() is not None


@cache
def has_graphviz() -> bool:
    """Whether graphviz' `dot` runs."""
    return _runs("dot", "-V")


@cache
def has_jupyter() -> bool:
    """Whether notebooks can be run."""
    return all(importlib.util.find_spec(name) for name in ("nbformat", "nbclient", "ipykernel"))


@cache
def has_distributed() -> bool:
    """Whether there is Dask for a cluster."""
    return importlib.util.find_spec("distributed") is not None


# For `@pytest.mark.needs(name)`: the probe, run only when a test asks, and the reason to skip.
NEEDS: dict[str, tuple[Callable[[], bool], str]] = {
    "numba": (has_numba, "numba is not installed (the `fast` extra)"),
    "chromium": (has_chromium, "no Chromium or Chrome that starts"),
    "egl": (rendering_available, "no EGL driver, so Drake cannot render without a display"),
    "graphviz": (has_graphviz, "graphviz' `dot` is not installed"),
    "distributed": (has_distributed, "distributed is not installed (the `cluster` extra)"),
    "jupyter": (has_jupyter, "nbclient or ipykernel is not installed (the `notebook` extra)"),
}


def pytest_report_header() -> str:
    """Name the versions the results depend on."""
    numba = f"numba {version('numba')}" if has_numba() else "no numba"
    return f"drake {version('drake')}, numpy {version('numpy')}, {numba}"


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip a test when something it needs is not here."""
    for mark in item.iter_markers("needs"):
        for name in mark.args:
            is_here, reason = NEEDS[name]
            if not is_here():
                pytest.skip(reason)


@pytest.fixture(scope="session")
def cogiro() -> CableRobot:
    """Return the default robot."""
    return load_robot("cogiro")
