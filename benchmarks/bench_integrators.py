"""Work and precision of Drake's integrators on the sampled, noisy vision-based loop of Test 4.

All run the same noise. The error is that of the platform's position against steps of 0.5 ms, root
mean square over the last quarter of the run: at a single instant it may be small by chance. Drake's
Runge-Kutta 3 stops at each hold; with error control it finds its step anew after each.

    python -m benchmarks integrators [--until 40] [--rounds 2]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.harness import Contestant, Report, Spread, interleave, run
from cdpr_drake.diagrams import make_simulator
from cdpr_drake.diagrams.simulation import INTEGRATOR
from cdpr_drake.diagrams.step import MAX_STEP, Step
from cdpr_drake.runs.running import Prepared, prepare
from cdpr_drake.runs.setup import setup_of_test

REFERENCE_STEP = 5e-4


@dataclass(frozen=True, kw_only=True)
class Way:
    """An integrator and how it steps."""

    integrator: str
    max_step: float
    accuracy: float | None = None

    def __str__(self) -> str:
        how = f"{1e3 * self.max_step:g} ms" if self.accuracy is None else f"acc. {self.accuracy:g}"
        return f"{self.integrator}, {how}"


WAYS = (
    *(Way(integrator="runge_kutta3", max_step=1e-3 * h) for h in (2.5, 5.0, 10.0, 20.0)),
    *(Way(integrator="runge_kutta3", max_step=0.05, accuracy=a) for a in (1e-1, 1e-2, 1e-3)),
    *(Way(integrator="runge_kutta2", max_step=1e-3 * h) for h in (2.5, 5.0)),
    *(Way(integrator="bogacki_shampine3", max_step=1e-3 * h) for h in (5.0, 10.0)),
    *(Way(integrator="runge_kutta5", max_step=1e-3 * h) for h in (10.0, 20.0)),
)


def positions(way: Way, ready: Prepared, until: float) -> tuple[np.ndarray, int]:
    """Return the platform's positions (n, 3) [m], one a frame, and how many derivatives it took."""
    simulator = make_simulator(
        ready.loop,
        ready.context,
        max_step=Step(size=way.max_step, decided_by="given"),  # coarse ones too, without a word
        accuracy=way.accuracy,
        integrator=way.integrator,
    )
    simulator.Initialize()
    pose, frame, rows = ready.loop.GetOutputPort("pose"), ready.setup.loop.timing.sample_time, []
    for n in range(1, round(until / frame) + 1):
        simulator.AdvanceTo(n * frame)
        rows.append(pose.Eval(ready.context)[3:])
    return np.array(rows), simulator.get_integrator().get_num_derivative_evaluations()


def measure(report: Report, options: argparse.Namespace) -> None:
    """Fill the report."""
    setup = setup_of_test(4, gain=0.1, until=options.until)
    found: dict[str, tuple[np.ndarray, int]] = {}

    def contestant(way: Way) -> Contestant:
        def call(ready: Any) -> None:
            found[str(way)] = positions(way, ready, options.until)

        return Contestant(
            name=str(way), call=call, before=lambda: prepare(setup), units=options.until
        )

    fine = Way(integrator=INTEGRATOR, max_step=REFERENCE_STEP)
    reference, _ = positions(fine, prepare(setup), options.until)
    times = interleave([contestant(way) for way in WAYS], options.rounds, warm=0)
    rows, errors = [], {}
    for name, seconds in times.items():
        path, derivatives = found[name]
        last = (path - reference)[-max(1, len(path) // 4) :]
        errors[name] = 1e3 * float(np.sqrt(np.mean(np.sum(last**2, axis=1))))
        rows.append(
            {
                "integrator": name,
                "x real time": Spread.of([1.0 / s for s in seconds]),
                "derivatives / s": derivatives / options.until,
                "error [mm]": errors[name],
            }
        )
    report.table("simulated time over CPU time", rows)
    default = str(Way(integrator=INTEGRATOR, max_step=MAX_STEP))
    report.figure(f"error of the default, {default} [mm]", errors[default])


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add this benchmark's options."""
    parser.add_argument("--until", type=float, default=40.0, help="simulated time [s]")
    parser.add_argument("--rounds", type=int, default=2)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; the exit status is 0."""
    run("integrators", __doc__, measure, add_options, arguments)
    return 0


if __name__ == "__main__":
    sys.exit(main())
