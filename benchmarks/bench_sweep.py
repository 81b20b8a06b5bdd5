"""How the time of a sweep grows with cases and shrinks with workers, and what a million would take.

The cases are runs of Test 4 with noise, calibration and payload of their own, as `cdpr-drake sweep`
makes them, results kept on disk as they arrive. Times are by the clock on the wall and include the
start of the processes; the cost of a million is reckoned from the processor time of a case alone,
as they do not depend on each other.

    python -m benchmarks sweep [--cases 12 24 48] [--workers 1 2] [--until 40]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.harness import Report, positive, run
from cdpr_drake.batch.monte_carlo import base_case, run_case
from cdpr_drake.batch.sweeps import Sweep, sweep

MILLION = 1_000_000
CLUSTER = 1000  # cores


def timed(count: int, workers: int, until: float) -> Sweep:
    """Return a sweep of so many cases in so many processes."""
    case = {"base": base_case(test=4, until=until), "payloads": [0.0, 110.0]}
    with tempfile.TemporaryDirectory() as folder:
        return sweep(run_case, [case] * count, jobs=workers, folder=Path(folder))


def measure(report: Report, options: argparse.Namespace) -> None:
    """Fill the report."""
    run_case(0, base_case(test=4, until=1.0))  # compile
    rows, cost = [], 0.0
    for count in options.cases:
        for workers in options.workers:
            found = timed(count, workers, options.until)
            if found.errors:
                raise RuntimeError(f"cases failed: {found.errors}")
            cost = found.cpu_time / count
            rows.append(
                {
                    "cases": f"{count}",
                    "workers": workers,
                    "s": found.wall_time,
                    "s per case": found.wall_time / count,
                    "processor s per case": cost,
                    "busy [%]": 100.0 * found.cpu_time / (found.wall_time * workers),
                }
            )
    report.table("a sweep, start of its processes included", rows)
    hours = cost * MILLION / 3600.0
    report.figure("a million cases", hours, "core hours")
    report.figure(f"a million cases on {CLUSTER} cores", hours / CLUSTER, "h")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add this benchmark's options."""
    parser.add_argument("--cases", type=int, nargs="+", default=[12, 24, 48])
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--until", type=positive, default=40, help="simulated time of a case [s]")


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; the exit status is 0."""
    run("sweep", __doc__, measure, add_options, arguments)
    return 0


if __name__ == "__main__":
    sys.exit(main())
