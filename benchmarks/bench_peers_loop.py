"""The sampled, noisy vision-based loop of Test 4: ours, a solve_ivp script, MuJoCo, and the bound.

All run the same robot, start, goal, gain, holds, latency and noise samples. The script is NumPy and
SciPy alone, started anew at each change of the rates, at the loosest tolerance that leaves less
than 1e-3 mm; MuJoCo has straight cables, no winches, and steps of 1 ms; the bound is our arithmetic
fused in one compiled function. The error is that of the final position against steps of 0.5 ms, for
MuJoCo against its own steps of 0.5 ms: how well the step is chosen, not how true the model.

    python -m benchmarks peers_loop [--until 80] [--rounds 3]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks.harness import Contestant, Report, Spread, interleave, positive, ratio, run
from benchmarks.loop_case import noise_of, numbers_of
from benchmarks.solve_ivp_loop import Noise, Simulation, Start
from cdpr_drake.diagrams import simulate
from cdpr_drake.diagrams.simulation import MAX_STEP
from cdpr_drake.model.kernels import is_compiled
from cdpr_drake.runs.running import Prepared, prepare
from cdpr_drake.runs.setup import Setup, setup_of_test

REFERENCE_STEP = 5e-4
MUJOCO_STEP = 1e-3
MAX_ERROR = 1e-3  # mm, of the final position
SETTLED = 60.0  # s, after which the platform is close to the goal
AGREE = 1e-6  # m, in every frame
OURS, SCRIPT, MUJOCO, BOUND = "ours", "solve_ivp script", "MuJoCo, RK4 1 ms", "bound"


def ours(setup: Setup, record: tuple[str, ...] | None) -> Callable[[Prepared], np.ndarray]:
    """Return our way: the diagram in Drake's simulator, in its default steps."""

    def simulated(ready: Prepared) -> np.ndarray:
        every = setup.loop.timing.sample_time
        done = simulate(ready.loop, ready.context, setup.until, record=record, every=every)
        return done["pose"]

    return simulated


def script(setup: Setup, start: Start, noise: Noise) -> Callable[[Any], np.ndarray]:
    """Return the script's way: positions only."""

    def simulated(simulation: Simulation) -> np.ndarray:
        return simulation.run(start, noise, setup.until, "RK45", rtol=1e-2, atol=1e-3)[0]

    return simulated


def keep(name: str, call: Callable[[Any], np.ndarray], results: dict[str, np.ndarray]) -> Any:
    """Return a call that leaves its positions (n, 3) behind."""

    def kept(given: Any) -> None:
        found = call(given)
        results[name] = found[:, -3:]

    return kept


def measure(report: Report, options: argparse.Namespace) -> None:
    """Fill the report."""
    setup = setup_of_test(4, gain=0.1, until=options.until)
    first = prepare(setup)
    noise = noise_of(first.loop, first.context, setup.until, first.setup.loop.timing.sample_time)
    loop, start = numbers_of(setup)
    results: dict[str, np.ndarray] = {}

    def entry(name: str, call: Any, before: Callable[[], Any]) -> Contestant:
        return Contestant(
            name=name, call=keep(name, call, results), before=before, units=setup.until
        )

    everything = f"{OURS}, all signals kept"
    contestants = [
        entry(OURS, ours(setup, ("pose",)), lambda: prepare(setup)),
        entry(everything, ours(setup, None), lambda: prepare(setup)),
        entry(SCRIPT, script(setup, start, noise), lambda: Simulation(setup.robot, loop)),
    ]
    own_reference: dict[str, np.ndarray] = {}
    if report.has("mujoco"):
        from benchmarks.mujoco_loop import MujocoLoop

        contestants.append(
            entry(
                MUJOCO,
                lambda m: m.run(noise, setup.until),
                lambda: MujocoLoop(setup.robot, loop, start, MUJOCO_STEP),
            )
        )
        finer = MujocoLoop(setup.robot, loop, start, REFERENCE_STEP)
        own_reference[MUJOCO] = finer.run(noise, setup.until)[:, 3:]
    if is_compiled():
        from benchmarks.fused_loop import FusedLoop

        bound = FusedLoop(setup.robot, loop, MAX_STEP)
        contestants.append(entry(BOUND, lambda b: b.run(start, noise, setup.until), lambda: bound))
        bound.run(start, noise, 2 * setup.loop.timing.sample_time)
        finest = FusedLoop(setup.robot, loop, REFERENCE_STEP)
        reference = finest.run(start, noise, setup.until)[:, 3:]
    else:
        report.skip("the bound: numba is not installed or off")
        fine = simulate(
            first.loop, first.context, setup.until, record=("pose",), max_step=REFERENCE_STEP
        )
        reference = fine["pose"][:, 3:]
    # What has to be compiled is by now; a round that does not count would take long.
    times = interleave(contestants, options.rounds, warm=0)
    tell(report, setup.until, times, results, reference, own_reference)


def tell(
    report: Report,
    until: float,
    times: dict[str, list[float]],
    results: dict[str, np.ndarray],
    reference: np.ndarray,
    own_reference: dict[str, np.ndarray],
) -> None:
    """Print and keep what came of it."""
    errors, rows = {}, []
    for name, seconds in times.items():
        against = own_reference.get(name, reference)
        errors[name] = 1e3 * float(np.linalg.norm(results[name][-1] - against[-1]))
        rows.append(
            {
                "Test 4": name,
                "x real time": Spread.of([1.0 / s for s in seconds]),
                "error [mm]": errors[name],
                "off ours [mm]": 1e3 * float(np.linalg.norm((results[name] - reference)[-1])),
            }
        )
    report.table("simulated time over CPU time, final position", rows)
    mine = times[OURS]
    report.ratio(f"{SCRIPT} / ours", ratio(times[SCRIPT], mine), at_least=3.0)
    if MUJOCO in times:
        report.ratio(f"{MUJOCO} / ours", ratio(times[MUJOCO], mine), at_least=1.0)
    if BOUND in times:
        report.ratio("ours / bound", ratio(mine, times[BOUND]), at_most=10.0)
        off = float(np.abs(results[BOUND] - results[OURS]).max())
        report.figure("bound off ours in the same steps [m]", off, at_most=AGREE)
    off = float(np.abs(results[SCRIPT] - reference).max())
    report.figure(f"{SCRIPT} off ours in steps of 0.5 ms, any frame [m]", off, at_most=AGREE)
    # On the way, before the platform has come to rest at the goal, errors are larger.
    limit = MAX_ERROR if until >= SETTLED else None
    report.figure("error of ours [mm]", errors[OURS], at_most=limit)
    report.figure(f"error of the {SCRIPT} [mm]", errors[SCRIPT], at_most=limit)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add this benchmark's options."""
    parser.add_argument("--until", type=float, default=80.0, help="simulated time [s]")
    parser.add_argument("--rounds", type=positive, default=3)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; the exit status says whether a figure other than a ratio of times misses."""
    report = run("peers_loop", __doc__, measure, add_options, arguments)
    return 0 if report.is_right() else 1


if __name__ == "__main__":
    sys.exit(main())
