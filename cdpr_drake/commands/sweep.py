"""`cdpr-drake sweep`: one move many times, with random noise, calibration, payload and gain."""

from __future__ import annotations

import argparse
import contextlib
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cdpr_drake import __version__
from cdpr_drake.commands.answer import leave, wrapped
from cdpr_drake.commands.arguments import UsageError
from cdpr_drake.commands.gain import gain_in_words
from cdpr_drake.commands.kernels import compilation_announced
from cdpr_drake.commands.place import as_file_name
from cdpr_drake.commands.terminal import CaseProgress, Column, fitting, say, table, width_of
from cdpr_drake.errors import CdprError, SweepError
from cdpr_drake.experiments import prepare
from cdpr_drake.experiments.monte_carlo import METRICS, base_case, chosen_gain, draw, run_case
from cdpr_drake.experiments.moves import time_for
from cdpr_drake.study.default_gain import DefaultGain
from cdpr_drake.study.sweep import Sweep, case_seed, sweep

CASES = "cases"
"""Folder in the output's with the results as they arrived."""

UNITS = {
    "position_error": "mm",
    "orientation_error": "deg",
    "settled_after": "s",
    "position_excursion": "mm",
    "orientation_excursion": "deg",
    "lowest_tension": "N",
    "highest_tension": "N",
}
QUANTILES = (0.05, 0.5, 0.95)


def sweep_command(options: argparse.Namespace) -> int:
    """Carry out `cdpr-drake sweep` and return the exit status.

    Args:
        options: the parsed arguments.

    Raises:
        UsageError: the input cannot be used; nothing was run.
    """
    try:
        with compilation_announced():
            base, spread, chosen = _plan(options)
            setup, _ = draw(base, case_seed(options.seed, 0), **spread)
            prepare(setup)
    except (CdprError, ValueError) as error:
        raise UsageError(str(error)) from error
    name = f"sweep-{as_file_name(setup.robot.name)}"
    options.output = options.output or Path("out") / name
    progress = CaseProgress()
    try:
        with _executor(options.dask) as executor:
            found = sweep(
                run_case,
                [{"base": base, **spread}] * options.cases,
                executor=executor,
                jobs=options.jobs,
                seed=options.seed,
                folder=options.output / CASES,
                resume=options.resume,
                version=__version__,
                progress=progress,
            )
    except KeyboardInterrupt:
        progress.done()
        say(f"interrupted; what is done is in {options.output}, and --resume goes on from there")
        return 130
    except OSError as error:
        raise UsageError(f"--output {options.output}: {error.strerror or error}") from error
    except ValueError as error:
        raise UsageError(f"{error} (--resume, or --output DIR)") from error
    except SweepError as error:
        say(f"error: {error}")
        return 1
    progress.done()

    def figures() -> dict[str, Any]:
        from cdpr_drake.show.sweep_plots import sweep_figure

        return {"sweep": sweep_figure(found)} if len(found.errors) < len(found) else {}

    summary = _summary(options, base, spread, found)
    if chosen is not None:
        summary |= chosen.to_dict()
    leave(options, name, summary, list(_lines(found, chosen)), figures)
    return 1 if found.errors else 0


def _plan(
    options: argparse.Namespace,
) -> tuple[dict[str, Any], dict[str, Any], DefaultGain | None]:
    """Return what all cases have in common, what is drawn for each, and why their gain is so."""
    for name, value in (("--cases", options.cases), ("--jobs", options.jobs)):
        if value is not None and value < 1:
            raise ValueError(f"{name}: must be at least 1, got {value}")
    if not (math.isfinite(options.calibration) and options.calibration >= 0.0):
        raise ValueError(f"--calibration: must be >= 0 and finite, got {options.calibration:g}")
    changes: dict[str, Any] = {
        "cable_model": options.cable_model,
        "noise": not options.no_noise,
        "sensors": options.sensors,
    }
    spread: dict[str, Any] = {"calibration": options.calibration}
    for name, given, lowest in (
        ("payload", options.payload, 0.0),
        ("gain", options.gain, math.ulp(0.0)),
    ):
        if given is None:
            continue
        if given[0] < lowest:
            raise ValueError(f"--{name}: must not be below {lowest:.0f}, got {given[0]:g}")
        if given[0] == given[1]:
            changes[name] = given[0]
        else:
            spread[f"{name}s"] = list(given)
    if options.until is not None:
        changes["until"] = options.until
    base = base_case(options.robot, options.test, **changes)
    if options.gain is not None or options.test is not None:
        return base, spread, None
    chosen = chosen_gain(base, spread.get("payloads"))
    base["gain"] = chosen.gain
    if chosen.decided_by != "custom" and options.until is None:
        base["until"] = time_for(chosen.gain)
    return base, spread, chosen


@contextlib.contextmanager
def _executor(address: str | None) -> Iterator[Any]:
    """Give the executor of a Dask cluster, or None."""
    if address is None:
        yield None
        return
    try:
        from distributed import Client
    except ImportError:
        hint = "pip install 'cdpr_drake[cluster]'"
        raise UsageError(f"--dask: distributed is not installed ({hint})") from None
    try:
        client = Client(address, timeout="10s")
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise UsageError(f"--dask {address}: {reason}") from error
    with client:
        yield client.get_executor()


def _columns(found: Sweep) -> dict[str, np.ndarray]:
    """Return the metrics of the cases that have them, finite ones only."""
    columns = {name: found.column(name) for name in METRICS}
    return {name: column[np.isfinite(column)] for name, column in columns.items()}


def _lines(found: Sweep, chosen: DefaultGain | None) -> Iterator[str]:
    """Yield the lines of the answer."""
    if chosen is not None and chosen.reason():
        yield from wrapped(f"At {gain_in_words(chosen.gain, chosen)}.")
    if len(found.errors) < len(found):
        yield table(fitting(_table(_columns(found)), width_of(sys.stdout)))
        late = int(np.isnan(found.column("settled_after")).sum()) - len(found.errors)
        if late:
            yield f"{late} of {len(found)} did not settle to 2 % in time."
    for case, (kind, message) in found.errors.items():
        yield from wrapped(f"case {case}: {kind}: {message}")
    yield ""
    yield from wrapped(_cost(found))


def _table(metrics: dict[str, np.ndarray]) -> list[Column]:
    """Return the quantiles of each metric."""
    statistics = {
        name: [*np.quantile(values, QUANTILES), values.max()] if values.size else []
        for name, values in metrics.items()
    }
    numbers = [
        Column(
            heading=("", heading),
            cells=[_digits(values[i]) if values else "-" for values in statistics.values()],
            rank=rank,
        )
        for i, (heading, rank) in enumerate((("5 %", 1), ("50 %", 0), ("95 %", 0), ("highest", 2)))
    ]
    names = [name.replace("_", " ") for name in metrics]
    return [
        Column(heading=("", "share of cases"), cells=names, to_the_left=True),
        Column(heading=("", ""), cells=[UNITS[name] for name in metrics], to_the_left=True),
        *numbers,
    ]


def _digits(value: float) -> str:
    return f"{value:.3g}" if abs(value) < 1000.0 else f"{value:.0f}"


def _cost(found: Sweep) -> str:
    """Return in words what a case costs, and what a million would."""
    each = found.cpu_time / len(found)
    earlier = f", {found.resumed} of them earlier" if found.resumed else ""
    return (
        f"{len(found)} cases{earlier} in {found.wall_time:.0f} s; "
        f"{each:.2g} s of processor time each. A million would take {each * 1e6 / 3600:,.0f} core "
        f"hours: {each * 1e6 / 3600 / 1000:.2g} h on a thousand cores."
    )


def _summary(
    options: argparse.Namespace, base: dict[str, Any], spread: dict[str, Any], found: Sweep
) -> dict[str, Any]:
    metrics = {}
    if len(found.errors) < len(found):
        for name, values in _columns(found).items():
            metrics[f"{name}_{UNITS[name]}"] = _statistics(values)
    return {
        "cases": len(found),
        "seed": options.seed,
        "base": base,
        "spread": spread,
        "metrics": metrics,
        "failures": {str(case): list(error) for case, error in found.errors.items()},
        "cpu_time_s": found.cpu_time,
        "wall_time_s": found.wall_time,
    }


def _statistics(values: np.ndarray) -> dict[str, float | int]:
    if not values.size:
        return {"count": 0}
    quantiles = {f"quantile_{q:g}": float(np.quantile(values, q)) for q in QUANTILES}
    ends = {"lowest": float(values.min()), "highest": float(values.max())}
    return {"count": int(values.size), "mean": float(values.mean()), **quantiles, **ends}
