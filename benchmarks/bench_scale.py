"""How time grows with cables, and shrinks with processes.

Robots of 8 to 64 cables carry load in proportion, so that the cables are as taut in all of them.
Timed are the kernel that all cables share, with the platform's state and the lengths changing from
call to call, and the derivatives of the robot's whole diagram. Then runs of Test 4 that differ in
their noise, in one process and in two, by the clock on the wall; the workers are warm.

    python -m benchmarks scale [--rounds 7] [--calls 300] [--work 60] [--until 80]
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from benchmarks.harness import Contestant, Report, Spread, interleave, positive, ratio, run
from cdpr_drake.diagrams import make_cable_robot, rest_context
from cdpr_drake.model.arrays import RobotArrays
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.platform import platform_cable_forces
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.rotations import pose_to_vector
from cdpr_drake.runs.running import run as run_setup
from cdpr_drake.runs.setup import setup_of_test

CABLES = (8, 16, 32, 64)
POSE = np.array([0.02, -0.03, 0.05, -0.6, 0.4, 1.5])
SPREAD = 0.3  # m, within which the copies of a cable end
LINEAR = 8.5  # from 8 to 64 cables
SPEEDUP = 1.7  # of two processes
HALF = 0.5  # of the benchmark's work is too little to speak of


def robot_of(num_cables: int) -> CableRobot:
    """Return CoGiRo with each cable several times, ends apart, and the load in proportion."""
    robot, copies = load_robot("cogiro"), num_cables // 8
    generator = np.random.default_rng(num_cables)

    def repeated(points: np.ndarray) -> np.ndarray:
        off = generator.uniform(-SPREAD, SPREAD, (num_cables, 3))
        off[:8] = 0.0
        return np.tile(points, (copies, 1)) + off

    def rated(values: np.ndarray) -> np.ndarray:
        return np.tile(values, copies)

    body, winch, cells, cable = robot.platform, robot.winch, robot.load_cells, robot.cable
    return robot.replace(
        name=f"{num_cables} cables",
        drawing_points=repeated(robot.drawing_points),
        attachment_points=repeated(robot.attachment_points),
        platform=body.replace(mass=body.mass * copies, inertia=body.inertia * copies),
        cable=cable.replace(drum_run=rated(cable.drum_run)),
        winch=winch.replace(encoder_zero_length=rated(winch.encoder_zero_length)),
        load_cells=cells.replace(bias=rated(cells.bias), gain=rated(cells.gain)),
        cameras=robot.cameras.replace(stereo_pairs=()),
    )


@jit
def at_all(states, lengths, rate, points, constants, packed):
    """Evaluate the cables at each state from compiled code, so that no call from Python counts."""
    for i in range(len(states)):
        platform_cable_forces(states[i], lengths[i], rate, points, constants, packed)


def kernel_calls(robot: CableRobot, calls: int) -> Callable[[], None]:
    """Return what calls the cables' kernel so many times at places a little apart."""
    rest, k = rest_state(robot, POSE), robot.num_cables
    state = np.concatenate([pose_to_vector(rest.X_WP), np.zeros(6)])
    generator = np.random.default_rng(0)
    states = state + generator.normal(0.0, 1e-4, (calls, 12))
    lengths = rest.unstrained_length + generator.normal(0.0, 1e-4, (calls, k))
    arrays = RobotArrays(robot)
    points, constants = arrays.points, arrays.constants
    rate, packed = np.zeros(k), np.zeros(6 + 9 * k)
    return lambda: at_all(states, lengths, rate, points, constants, packed)


def diagram_calls(robot: CableRobot, calls: int) -> Callable[[], None]:
    """Return what evaluates the robot's derivatives so many times at states a little apart."""
    diagram = make_cable_robot(robot)
    context = rest_context(diagram, POSE)
    x = context.get_continuous_state_vector().CopyToVector()
    states = x + np.random.default_rng(0).normal(0.0, 1e-4, (calls, x.size))

    def call() -> None:
        for state in states:
            context.SetContinuousState(state)
            diagram.EvalTimeDerivatives(context)

    return call


def cables(report: Report, options: argparse.Namespace) -> None:
    """Time robots of several numbers of cables."""
    robots = {k: robot_of(k) for k in CABLES}
    for what, make in (("cables' kernel", kernel_calls), ("robot's diagram", diagram_calls)):
        contestants = [
            Contestant(name=str(k), call=make(robot, options.calls), units=options.calls)
            for k, robot in robots.items()
        ]
        times = interleave(contestants, options.rounds)
        rows = [
            {
                "cables": name,
                "us": Spread.of(seconds).scaled(1e6),
                "us per cable": Spread.of(seconds).scaled(1e6 / int(name)),
            }
            for name, seconds in times.items()
        ]
        report.table(f"{what}, one evaluation", rows)
        growth = ratio(times["64"], times["8"])
        report.ratio(f"{what}, 64 cables / 8", growth, at_most=LINEAR)


def one_run(seed: int, until: float) -> float:
    """Run Test 4 with its own noise; return the time on the wall [s]."""
    begun = time.perf_counter()
    run_setup(setup_of_test(4, gain=0.1, until=until, seed=seed))
    return time.perf_counter() - begun


def timed(workers: int, count: int, until: float) -> float:
    """Return how long so many runs take in some processes [s], those already warm."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        list(pool.map(one_run, range(2 * workers), [1.0] * 2 * workers))
        begun = time.perf_counter()
        list(pool.map(one_run, range(count), [until] * count))
        return time.perf_counter() - begun


def processes(report: Report, options: argparse.Namespace) -> None:
    """Time the same runs in one process and in two."""
    one_run(0, 1.0)
    each = one_run(0, options.until)
    count = 2 * math.ceil(0.5 * options.work / each)
    alone, together = timed(1, count, options.until), timed(2, count, options.until)
    report.table(
        f"{count} runs of Test 4, {options.until:g} s each",
        [
            {"processes": "1", "s": alone, "runs per minute": 60.0 * count / alone},
            {"processes": "2", "s": together, "runs per minute": 60.0 * count / together},
        ],
    )
    enough = alone >= HALF * options.work and options.work >= 60.0
    report.figure("one process / two", alone / together, at_least=SPEEDUP if enough else None)


def measure(report: Report, options: argparse.Namespace) -> None:
    """Fill the report."""
    cables(report, options)
    if options.work > 0.0:
        processes(report, options)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add this benchmark's options."""
    parser.add_argument("--rounds", type=positive, default=7)
    parser.add_argument("--calls", type=positive, default=300, help="evaluations in a round")
    parser.add_argument("--work", type=float, default=60.0, help="time of one process [s]; 0: none")
    parser.add_argument("--until", type=float, default=80.0, help="simulated time of a run [s]")


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; times are told, not judged."""
    run("scale", __doc__, measure, add_options, arguments)
    return 0


if __name__ == "__main__":
    sys.exit(main())
