"""`cdpr-drake sweep`: one move many times, with random noise, calibration, payload and gain."""

from __future__ import annotations

import contextlib
import math
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cdpr_drake import __version__
from cdpr_drake.commands import Command, UsageError
from cdpr_drake.commands import arguments as common
from cdpr_drake.commands.files import as_file_name, write_answer
from cdpr_drake.commands.resolve import gain_in_words, input_refused
from cdpr_drake.commands.results import UNITS
from cdpr_drake.commands.terminal import CaseProgress, Column, fitted_table, print_message, wrapped
from cdpr_drake.model.digits import significant

if TYPE_CHECKING:
    import numpy as np

    from cdpr_drake.analysis.default_gain import DefaultGain
    from cdpr_drake.batch.sweeps import Sweep
    from cdpr_drake.diagrams.step import Step

CASES = "cases"
"""Folder in the output's with the results as they arrived."""

QUANTILES = (0.05, 0.5, 0.95)


def _add_arguments(parser: ArgumentParser) -> None:
    what = parser.add_argument_group("what moves, and where")
    what.add_argument("--test", type=int, metavar="N",
                      help="one of the paper's Tests 1 to 5 (default: 4 for CoGiRo, a short move "
                      "near its middle for another robot)")  # fmt: skip
    what.add_argument("--robot", **common.ROBOT)
    what.add_argument("--tensions", **common.TENSIONS)
    what.add_argument("--cable-model", **common.CABLE_MODEL)
    what.add_argument("--sensors", default="gaussian", metavar="KIND",
                      help="gaussian, or targets, as `run` has them (default: "
                      "gaussian)")  # fmt: skip
    what.add_argument("--until", type=float, metavar="S",
                      help="time to run (default: as `run` has it)")  # fmt: skip

    drawn = parser.add_argument_group("what is drawn")
    drawn.add_argument("--cases", type=common.parse_count, default=50, metavar="N",
                       help="how many moves (default: 50)")  # fmt: skip
    drawn.add_argument("--seed", **common.SEED)
    drawn.add_argument("--no-noise", **common.NO_NOISE)
    drawn.add_argument("--calibration", type=float, default=1.0, metavar="SCALE",
                       help="size of calibration errors; 1: A 2 mm, B 1.5 mm, X_WF 3 mm and 0.1 "
                       "deg, X_PM 2 mm and 0.1 deg, one sigma; 0: none (default: 1)")  # fmt: skip
    drawn.add_argument("--payload", type=common.parse_range, metavar="KG[,KG]",
                       help="mass carried, or from and to (default: the test's; else the "
                       "robot's)")  # fmt: skip
    drawn.add_argument("--gain", type=common.parse_range, metavar="PER_S[,PER_S]",
                       help="lambda, or from and to [1/s] (default: that of --test; else the "
                       "robot file's; else 0.1, or half the limit there if less)")  # fmt: skip

    where = parser.add_argument_group("where it runs")
    where.add_argument("--max-step", **common.MAX_STEP)
    where.add_argument("--jobs", **common.JOBS)
    where.add_argument("--dask", metavar="ADDRESS",
                       help="scheduler of a Dask cluster (the `cluster` extra)")  # fmt: skip
    where.add_argument("--resume", action="store_true",
                       help="take what an interrupted sweep left in DIR")  # fmt: skip
    common.add_output(parser)


def _sweep(options: Namespace) -> int:
    from cdpr_drake.batch.monte_carlo import draw
    from cdpr_drake.batch.sweeps import case_seed
    from cdpr_drake.errors import SweepError
    from cdpr_drake.runs import prepare

    with input_refused():
        base, spread, chosen = _plan(options)
        setup, _ = draw(base, case_seed(options.seed, 0), **spread)
        first = prepare(setup)
    name = as_file_name(f"sweep-{setup.robot.name}")
    options.output = options.output or Path("out") / name
    progress = CaseProgress()
    try:
        found = _run_cases(options, {"base": base, **spread}, progress)
    except KeyboardInterrupt:
        progress.done()
        done = f"interrupted; what is done is in {options.output}"
        print_message(f"{done}, and --resume goes on from there")
        return 130
    except OSError as error:
        raise UsageError(f"--output {options.output}: {error.strerror or error}") from error
    except ValueError as error:
        raise UsageError(f"{error} (--resume, or --output DIR)") from error
    except SweepError as error:
        print_message(f"error: {error}")
        return 1
    progress.done()

    def figures(show: Any) -> dict[str, Any]:
        from cdpr_drake.show.sweep_plots import sweep_figure

        return {"sweep": lambda: sweep_figure(found)} if len(found.errors) < len(found) else {}

    summary = _summary(options, base, spread, found) | {"step": _steps(found, first.step)}
    if chosen is not None:
        summary |= chosen.to_dict()
    write_answer(options, name, summary, list(_lines(found, chosen)), figures)
    return 1 if found.errors else 0


COMMAND = Command(
    summary="make one move many times, with random noise, calibration, payload and gain",
    description="Make one move under vision-based control many times. Noise and calibration errors "
    "are drawn anew each time, payload and gain too where a range is given. Tell the spread of "
    "errors, settling, excursions and tensions. Results do not depend on how many processes there "
    "are, nor on where they run, and are kept as they arrive.",
    example="--test 3 --cases 200 --payload 0,150",
    add_arguments=_add_arguments,
    work=_sweep,
    exit_status="0, done; 1, a case failed; 2, the input cannot be used; 130, interrupted: the "
    "same command with --resume goes on from there.",
)


def _run_cases(options: Namespace, case: dict[str, Any], progress: CaseProgress) -> Sweep:
    """Return what came of the cases, all alike but for their seeds."""
    from cdpr_drake.batch.monte_carlo import run_case
    from cdpr_drake.batch.sweeps import sweep

    with _executor(options.dask) as executor:
        return sweep(
            run_case,
            [case] * options.cases,
            executor=executor,
            jobs=options.jobs,
            seed=options.seed,
            folder=options.output / CASES,
            resume=options.resume,
            version=__version__,
            progress=progress,
        )


def _plan(options: Namespace) -> tuple[dict[str, Any], dict[str, Any], DefaultGain | None]:
    """Return what all cases have in common, what is drawn for each, and why their gain is so."""
    from cdpr_drake.batch.monte_carlo import base_case, chosen_gain
    from cdpr_drake.runs.moves import time_for

    if not (math.isfinite(options.calibration) and options.calibration >= 0.0):
        raise ValueError(f"--calibration: must be >= 0 and finite, got {options.calibration:g}")
    changes: dict[str, Any] = {
        "cable_model": options.cable_model,
        "noise": not options.no_noise,
        "sensors": options.sensors,
    }
    if options.tensions is not None:
        changes["tensions"] = options.tensions
    if options.until is not None:
        changes["until"] = options.until
    if options.max_step is not None:
        changes["max_step"] = options.max_step
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
    import numpy as np

    from cdpr_drake.batch.monte_carlo import METRICS

    columns = {name: found.column(name) for name in METRICS}
    return {name: column[np.isfinite(column)] for name, column in columns.items()}


def _lines(found: Sweep, chosen: DefaultGain | None) -> Iterator[str]:
    """Yield the lines of the answer."""
    import numpy as np

    from cdpr_drake.diagrams.step import MAX_STEP

    if chosen is not None and chosen.reason():
        yield from wrapped(f"At {gain_in_words(chosen.gain, chosen)}.")
    if len(found.errors) < len(found):
        yield fitted_table(_table(_columns(found)))
        late = sum(map(math.isnan, found.column("settled_after"))) - len(found.errors)
        if late:
            yield f"{late} of {len(found)} did not settle to 2 % in time."
        smallest = np.nanmin(found.column("step"))
        if smallest != MAX_STEP:
            yield f"The integrator's step is {1e3 * smallest:.3g} ms at its smallest."
    for case, (kind, message) in found.errors.items():
        yield from wrapped(f"case {case}: {kind}: {message}")
    yield ""
    yield from wrapped(_cost(found))


def _table(metrics: dict[str, np.ndarray]) -> list[Column]:
    """Return the quantiles of each metric."""
    import numpy as np

    statistics = {
        name: [*np.quantile(values, QUANTILES), values.max()] if values.size else []
        for name, values in metrics.items()
    }
    numbers = [
        Column(
            ("", heading),
            [significant(values[i]) if values else "-" for values in statistics.values()],
            rank=rank,
        )
        for i, (heading, rank) in enumerate((("5 %", 1), ("50 %", 0), ("95 %", 0), ("highest", 2)))
    ]
    names = [name.replace("_", " ") for name in metrics]
    return [
        Column(("", "share of cases"), names, to_the_left=True),
        Column(("", ""), [UNITS[name] for name in metrics], to_the_left=True),
        *numbers,
    ]


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
    options: Namespace, base: dict[str, Any], spread: dict[str, Any], found: Sweep
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


def _steps(found: Sweep, first: Step) -> dict[str, Any]:
    """Return the integrator's steps [s] of the cases, and what the `first` is to say of them."""
    import numpy as np

    steps = np.zeros(0) if len(found.errors) == len(found) else found.column("step")
    return {
        "lowest_s": float(np.nanmin(steps)) if len(steps) else None,
        "highest_s": float(np.nanmax(steps)) if len(steps) else None,
        "decided_by": first.decided_by,
        "mode": first.mode,
        "warning": first.doubt or None,
    }


def _statistics(values: np.ndarray) -> dict[str, float | int]:
    import numpy as np

    if not values.size:
        return {"count": 0}
    quantiles = {f"quantile_{q:g}": float(np.quantile(values, q)) for q in QUANTILES}
    ends = {"lowest": float(values.min()), "highest": float(values.max())}
    return {"count": int(values.size), "mean": float(values.mean()), **quantiles, **ends}
