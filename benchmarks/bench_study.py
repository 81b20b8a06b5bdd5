"""The study against its budgets, its theory and its simulations.

Speed of linearisations, one-period maps, gain matrices and stability maps; memory that 1000
linearisations of a diagram keep; eigenvalues against theory for exact models, against the gain
matrix for all models and robots, against simulated decay; gain limits against the growth or decay
of the critical mode in simulations 5 % below and above. Ends with status 1 if a figure misses.

    python benchmarks/bench_study.py [--duration 100] [--robots 25] [--only PART ...]
"""

from __future__ import annotations

import argparse
import gc
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from study_samples import MODELS, robot_of_a_class  # noqa: E402

from cdpr_drake.diagrams import make_vision_based_control  # noqa: E402
from cdpr_drake.experiments.paper_tests import paper_test  # noqa: E402
from cdpr_drake.model.robot import CableRobot, load_robot  # noqa: E402
from cdpr_drake.study import (  # noqa: E402
    comparable_pose,
    equilibrium,
    gain_limit,
    gain_matrix,
    linearize,
    map_gain_matrix,
    one_period_map,
    simulate_modes,
    simulated_period_map,
    stability_map,
)
from cdpr_drake.study.compare import ROBOTS  # noqa: E402

MAX_STEP = 2.5e-3  # coarser steps damp a platform mode by themselves [s]

missed: list[str] = []


def report(what: str, found: float, limit: float, unit: str = "") -> None:
    """Print a figure beside what it must not exceed."""
    verdict = "" if found <= limit else "   MISSED"
    print(f"{what:<62}{found:10.3g} of {limit:g} {unit}{verdict}", flush=True)
    if verdict:
        missed.append(what)


def fastest(call: Callable[[], Any], repeats: int) -> float:
    """Return the shortest time of some calls [s]."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def goal_of_test_4(robot: CableRobot) -> Any:
    return paper_test(4).poses(robot)[1]


def speed(_: argparse.Namespace) -> None:
    """Time what is asked most."""
    robot = load_robot("cogiro")
    pose = goal_of_test_4(robot)
    loop = make_vision_based_control(robot, "ECM", sample_time=None)
    context = equilibrium(loop, pose)
    ports = ["desired_pose"], ["pose_error"]
    first = fastest(lambda: linearize(loop, context, *ports), 1)
    print(f"first linearisation, conversion included: {1e3 * first:.0f} ms")
    found = 1e3 * fastest(lambda: linearize(loop, context, *ports), 30)
    report("linearising the full loop, pose error over goal", found, 10.0, "ms")
    found = 1e3 * fastest(lambda: linearize(loop, context), 30)
    print(f"  with all 196 outputs: {found:.1f} ms")
    for latency in (0.04, 0.13):
        sampled = make_vision_based_control(robot, "ECM", latency=latency)
        rest = equilibrium(sampled, pose)
        one_period_map(sampled, rest)
        found = 1e3 * fastest(lambda d=sampled, c=rest: one_period_map(d, c), 10)  # type: ignore[misc]
        report(f"one-period map, latency {1e3 * latency:g} ms", found, 200.0, "ms")
    poses = random_poses(1000)
    map_gain_matrix(robot, None, poses[:2])
    report("gain matrices at 1000 poses", fastest(lambda: map_gain_matrix(robot, None, poses), 1),
           5.0, "s")  # fmt: skip
    found = fastest(lambda: gain_limit(robot, pose), 1)
    print(f"a gain limit: {found:.2f} s")
    gains, latencies = np.geomspace(0.1, 10.0, 40), np.linspace(0.0, 0.15, 16)
    found = fastest(lambda: stability_map(robot, pose, gains, latencies), 1)
    print(f"a stability map of 40 gains and 16 latencies with its limits: {found:.1f} s")


def random_poses(count: int) -> np.ndarray:
    generator = np.random.default_rng(0)
    turn = generator.uniform(-0.1, 0.1, (count, 3))
    place = generator.uniform([-4.0, -3.0, 0.5], [4.0, 3.0, 2.5], (count, 3))
    return np.hstack([turn, place])


def memory(_: argparse.Namespace) -> None:
    """Linearise one diagram 1000 times and look at what the process keeps."""
    statm = Path("/proc/self/statm")
    if not statm.exists():
        print("no /proc here: memory not measured")
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
    report("growth of memory over 1000 linearisations", megabytes() - before, 20.0, "MB")


def theory(options: argparse.Namespace) -> None:
    """Exact models: six eigenvalues at -lambda, k - 6 at zero, the others to the left."""
    worst: dict[str, float] = {}
    neutral, others = 0.0, -np.inf
    cases = [("CoGiRo", load_robot("cogiro"), goal_of_test_4(load_robot("cogiro")), False)]
    for cables, run in ((7, 0.0), (7, 5.4), (10, 0.0), (10, 5.4)):
        for seed in range(options.robots):
            robot, pose = robot_of_a_class(load_robot("cogiro"), cables, run, seed)
            cases.append((f"random, {cables} cables, run {run:g} m", robot, pose, run > 0.0))
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
        report(f"six at -lambda, {name}", 100.0 * off, 1.0, "%")
    report("neutral eigenvalues", neutral, 1e-6, "1/s")
    report("real part of all others", others, 0.0, "1/s")


def gamma(_: argparse.Namespace) -> None:
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
            report(f"Gamma against the loop, {name}, lambda {gain:g}/s", 100.0 * off, 1.0, "%")


def decay(_: argparse.Namespace) -> None:
    """The servo's six modes of the one-period map, by both routes and in simulation."""
    robot = load_robot("cogiro")
    for model, latency in (("ECM", 0.0), ("SLSM", 0.04), ("SLSM", 0.13)):
        loop = make_vision_based_control(robot, model, gain=0.1, latency=latency)
        context = equilibrium(loop, goal_of_test_4(robot))
        exact = one_period_map(loop, context).matrix
        simulated = simulated_period_map(loop, context)
        off = np.abs(exact - simulated).max() / np.abs(exact).max()
        report(f"two routes to the map, {model}, {1e3 * latency:g} ms", off, 1e-6)
        followed = simulate_modes(loop, context, 20.0, which=range(6))
        off = max(abs(m.growth / m.predicted.real - 1.0) for m in followed)
        report(f"six rates simulated, {model}, {1e3 * latency:g} ms", 100.0 * off, 1.0, "%")


def limits(options: argparse.Namespace) -> None:
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
    print(f"critical modes over {options.duration:g} s; rates in 1/s, limits in 1/s")
    print(f"{'':24}{'latency':>9}{'limit':>8}  {'mode':<20}{'x 0.95':>22}{'x 1.05':>22}")
    for name, loaded, pose, latency in cases:
        limit = gain_limit(loaded, pose, latency)
        rates = []
        for factor in (0.95, 1.05):
            loop = make_vision_based_control(loaded, gain=factor * limit.gain, latency=latency)
            context = equilibrium(loop, pose)
            (mode,) = simulate_modes(loop, context, options.duration, max_step=MAX_STEP)
            rates.append((mode.predicted.real, mode.growth))
        cells = "".join(f"{p:+11.4f}{s:+11.4f}" for p, s in rates)
        label = f"{limit.mode} {limit.frequency:.2f} Hz"
        good = rates[0][1] < 0.0 < rates[1][1]
        print(f"{name:24}{1e3 * latency:6.0f} ms{limit.gain:8.3f}  {label:<20}{cells}"
              f"{'' if good else '   MISSED'}", flush=True)  # fmt: skip
        if not good:
            missed.append(f"limit at {name}")


PARTS = {
    "speed": speed,
    "memory": memory,
    "theory": theory,
    "gamma": gamma,
    "decay": decay,
    "limits": limits,
}


def main() -> int:
    """Run the parts; the exit status says whether a figure missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--duration", type=float, default=100.0, help="of limits' simulations [s]")
    parser.add_argument("--robots", type=int, default=25, help="random robots of each class")
    parser.add_argument("--only", nargs="+", choices=PARTS, metavar="PART", help=", ".join(PARTS))
    options = parser.parse_args()
    warnings.simplefilter("ignore")  # random robots are unusual
    for name in options.only or PARTS:
        print(f"-- {name}", flush=True)
        PARTS[name](options)
    print(f"missed: {', '.join(missed) or 'none'}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
