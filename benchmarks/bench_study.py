"""The study against its budgets, its theory and its simulations.

Speed of linearisations, one-period maps, gain matrices and stability maps; memory that 1000
linearisations of a diagram keep; eigenvalues against theory for exact models, against the gain
matrix for all models and robots, against simulated decay; gain limits against the growth or decay
of the critical mode in simulations 5 % below and above.

    python -m benchmarks study [--duration 100] [--robots 25] [--only PART ...]
"""

from __future__ import annotations

import argparse
import gc
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.harness import ROOT, Report, positive, run
from cdpr_drake.analysis import (
    comparable_pose,
    gain_limit,
    gain_matrix,
    map_gain_matrix,
    stability_map,
)
from cdpr_drake.analysis.compare import ROBOTS
from cdpr_drake.diagrams import make_vision_based_control
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.runs.paper_tests import paper_test
from cdpr_drake.study import (
    equilibrium,
    linearize,
    one_period_map,
    simulate_modes,
    simulated_period_map,
)

sys.path.append(str(ROOT / "tests"))

from study_samples import MODELS, robot_of_a_class

MAX_STEP = 2.5e-3  # coarser steps damp a platform mode by themselves [s]


def fastest(call: Callable[[], Any], repeats: int) -> float:
    """Return the shortest time of some calls [s]."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return min(times)


def goal_of_test_4(robot: CableRobot) -> Any:
    return paper_test(4).poses(robot)[1]


def speed(report: Report, _: argparse.Namespace) -> None:
    """Time what is asked most."""
    robot = load_robot("cogiro")
    pose = goal_of_test_4(robot)
    loop = make_vision_based_control(robot, "ECM", sample_time=None)
    context = equilibrium(loop, pose)
    ports = ["desired_pose"], ["pose_error"]
    first = fastest(lambda: linearize(loop, context, *ports), 1)
    report.figure("first linearisation, conversion included", 1e3 * first, "ms")
    found = 1e3 * fastest(lambda: linearize(loop, context, *ports), 30)
    report.figure("linearising the full loop, pose error over goal", found, "ms", at_most=10.0)
    found = 1e3 * fastest(lambda: linearize(loop, context), 30)
    report.figure("linearising with all outputs", found, "ms")
    for latency in (0.04, 0.13):
        sampled = make_vision_based_control(robot, "ECM", latency=latency)
        rest = equilibrium(sampled, pose)
        one_period_map(sampled, rest)
        found = 1e3 * fastest(lambda d=sampled, c=rest: one_period_map(d, c), 10)  # type: ignore[misc]
        report.figure(f"one-period map, latency {1e3 * latency:g} ms", found, "ms", at_most=200.0)
    poses = random_poses(1000)
    map_gain_matrix(robot, None, poses[:2])
    found = fastest(lambda: map_gain_matrix(robot, None, poses), 1)
    report.figure("gain matrices at 1000 poses", found, "s", at_most=5.0)
    found = fastest(lambda: gain_limit(robot, pose), 1)
    report.figure("a gain limit", found, "s")
    gains, latencies = np.geomspace(0.1, 10.0, 40), np.linspace(0.0, 0.15, 16)
    found = fastest(lambda: stability_map(robot, pose, gains, latencies), 1)
    report.figure("a stability map of 40 gains and 16 latencies with its limits", found, "s")


def random_poses(count: int) -> np.ndarray:
    generator = np.random.default_rng(0)
    turn = generator.uniform(-0.1, 0.1, (count, 3))
    place = generator.uniform([-4.0, -3.0, 0.5], [4.0, 3.0, 2.5], (count, 3))
    return np.hstack([turn, place])


def memory(report: Report, _: argparse.Namespace) -> None:
    """Linearise one diagram 1000 times and look at what the process keeps."""
    statm = Path("/proc/self/statm")
    if not statm.exists():
        report.skip("memory: no /proc here")
        return

    def megabytes() -> float:
        gc.collect()
        return int(statm.read_text().split()[1]) * 4096 / 1e6

    robot = load_robot("cogiro")
    loop = make_vision_based_control(robot, "ECM", sample_time=None)
    context = equilibrium(loop, goal_of_test_4(robot))
    for _ in range(50):
        linearize(loop, context)
    before = megabytes()
    for _ in range(1000):
        linearize(loop, context)
    report.figure(
        "growth of memory over 1000 linearisations", megabytes() - before, "MB", at_most=20.0
    )


def theory(report: Report, options: argparse.Namespace) -> None:
    """Exact models: six eigenvalues at -lambda, k - 6 at zero, the others to the left."""
    worst: dict[str, float] = {}
    neutral, others = 0.0, -np.inf
    cases = [("CoGiRo", load_robot("cogiro"), goal_of_test_4(load_robot("cogiro")), False)]
    for cables, length in ((7, 0.0), (7, 5.4), (10, 0.0), (10, 5.4)):
        for seed in range(options.robots):
            robot, pose = robot_of_a_class(load_robot("cogiro"), cables, length, seed)
            cases.append((f"random, {cables} cables, run {length:g} m", robot, pose, length > 0.0))
    for name, robot, pose, model_run in cases:
        loop = make_vision_based_control(
            robot, "ECM", gain=0.1, sample_time=None, model_drum_run=model_run
        )
        values = linearize(loop, equilibrium(loop, pose), [], []).eigenvalues
        values = values[np.argsort(np.abs(values))]
        k = robot.num_cables
        neutral = max(neutral, float(np.abs(values[: k - 6]).max()))
        others = max(others, float(values[k:].real.max()))
        off = float(np.abs(values[k - 6 : k] / -0.1 - 1.0).max())
        worst[name] = max(worst.get(name, 0.0), off)
    for name, off in worst.items():
        report.figure(f"six at -lambda, {name}", 100.0 * off, "%", at_most=1.0)
    report.figure("neutral eigenvalues", neutral, "1/s", at_most=1e-6)
    report.figure("real part of all others", others, "1/s", at_most=0.0)


def gamma(report: Report, _: argparse.Namespace) -> None:
    """Eigenvalues of the gain matrix times lambda against those of the linearised loop."""
    for gain in (0.1, 0.01):
        for name in ROBOTS:
            robot, off = load_robot(name), 0.0
            pose = comparable_pose(robot)
            for model in MODELS:
                loop = make_vision_based_control(robot, model, gain=gain, sample_time=None)
                values = linearize(loop, equilibrium(loop, pose), [], []).eigenvalues
                values = values[np.argsort(np.abs(values))]
                slow = np.sort(values[2:8].real / -gain)
                expected = gain_matrix(robot, None, pose, model).eigenvalues.real
                off = max(off, float(np.abs(slow / expected - 1.0).max()))
            report.figure(
                f"Gamma against the loop, {name}, lambda {gain:g}/s", 100.0 * off, "%", at_most=1.0
            )


def decay(report: Report, _: argparse.Namespace) -> None:
    """The servo's six modes of the one-period map, by both routes and in simulation."""
    robot = load_robot("cogiro")
    for model, latency in (("ECM", 0.0), ("SLSM", 0.04), ("SLSM", 0.13)):
        loop = make_vision_based_control(robot, model, gain=0.1, latency=latency)
        context = equilibrium(loop, goal_of_test_4(robot))
        exact = one_period_map(loop, context).matrix
        simulated = simulated_period_map(loop, context)
        off = np.abs(exact - simulated).max() / np.abs(exact).max()
        report.figure(f"two routes to the map, {model}, {1e3 * latency:g} ms", off, at_most=1e-6)
        followed = simulate_modes(loop, context, 20.0, which=range(6))
        off = max(abs(m.growth / m.predicted.real - 1.0) for m in followed)
        report.figure(
            f"six rates simulated, {model}, {1e3 * latency:g} ms", 100.0 * off, "%", at_most=1.0
        )


def limits(report: Report, options: argparse.Namespace) -> None:
    """Gain limits bracketed by simulations 5 % below and above."""
    robot = load_robot("cogiro")
    large = load_robot("cogiro-98m")

    def at(test: int, end: int, payload: float, latency: float) -> tuple[Any, ...]:
        loaded = robot.with_payload(payload)
        name = f"Test {test} {('start', 'goal')[end]}, {loaded.mass:g} kg"
        return name, loaded, paper_test(test).poses(robot)[end], latency

    cases = [
        at(4, 1, 0.0, 0.04),
        at(1, 0, 110.0, 0.04),
        at(1, 1, 110.0, 0.02),
        at(5, 1, 0.0, 0.0),
        at(4, 0, 0.0, 0.09),
        at(3, 1, 200.0, 0.1),
        ("98 m robot, 100 kg", large, comparable_pose(large), 0.04),
    ]
    rows, missed = [], 0
    for name, loaded, pose, latency in cases:
        limit = gain_limit(loaded, pose, latency)
        rates = []
        for factor in (0.95, 1.05):
            loop = make_vision_based_control(loaded, gain=factor * limit.gain, latency=latency)
            context = equilibrium(loop, pose)
            (mode,) = simulate_modes(loop, context, options.duration, max_step=MAX_STEP)
            rates.append((mode.predicted.real, mode.growth))
        good = rates[0][1] < 0.0 < rates[1][1]
        (below, below_simulated), (above, above_simulated) = rates
        rows.append(
            {
                "critical mode": name,
                "ms": 1e3 * latency,
                "limit": limit.gain,
                "mode": f"{limit.mode} {limit.frequency:.2f} Hz",
                "5 % below": f"{below:+.4f}",
                "simulated, below": f"{below_simulated:+.4f}",
                "5 % above": f"{above:+.4f}",
                "simulated, above": f"{above_simulated:+.4f}",
            }
        )
        missed += not good
    report.table(f"growth [1/s] about gain limits, simulated {options.duration:g} s", rows)
    report.figure("limits not between decay and growth", missed, at_most=0)


PARTS = {
    "speed": speed,
    "memory": memory,
    "theory": theory,
    "gamma": gamma,
    "decay": decay,
    "limits": limits,
}


def measure(report: Report, options: argparse.Namespace) -> None:
    """Fill the report."""
    warnings.simplefilter("ignore")  # random robots are unusual
    for name in options.only or PARTS:
        print(f"-- {name}", flush=True)
        PARTS[name](report, options)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add this benchmark's options."""
    parser.add_argument("--duration", type=float, default=100.0, help="of limits' simulations [s]")
    parser.add_argument("--robots", type=positive, default=25, help="random robots of each class")
    parser.add_argument("--only", nargs="+", choices=PARTS, metavar="PART", help=", ".join(PARTS))


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; the exit status says whether a figure missed."""
    report = run("study", __doc__, measure, add_options, arguments)
    return 0 if report.is_right() else 1


if __name__ == "__main__":
    sys.exit(main())
