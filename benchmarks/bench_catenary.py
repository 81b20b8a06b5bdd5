"""Reliability and speed of the elastic catenary.

Solves random cables of the classes a solver finds easy or hard, with and without a run from the
drum and a stiffness that follows the tension; counts failures, which should be 0, and prints the
worst residuals. Then times the eight cables of CoGiRo, compiled and not.

    python benchmarks/bench_catenary.py [--count 1000000] [--repeats 20]
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from cable_classes import CLASSES, random_cables  # noqa: E402

from cdpr_drake.model.kernels import is_compiled, jit  # noqa: E402
from cdpr_drake.model.kernels.catenary import (  # noqa: E402
    _linearise,
    _solve,
    cable_forces,
    cable_forces_jacobian,
)
from cdpr_drake.model.robot import load_robot  # noqa: E402

# Drum run [m]; softening as a part of asymptote times offset; offset [N].
KINDS = {
    "plain": (0.0, 0.0, 1.0),
    "run": (5.4, 0.0, 1.0),
    "run, softening": (5.4, 0.8, 300.0),
    "softening x20": (0.0, 0.95, 3.0),
}


@jit
def solve_all(rows, strains, run, softening, offset, found):
    """Solve each row (Bx, Bz, l0, w, EA); write (failed, iterations, residuals) to `found`."""
    for i in range(len(rows)):
        Bx = rows[i, 0]
        Bz = rows[i, 1]
        w = rows[i, 3]
        EA = rows[i, 4]
        length = rows[i, 2] + run / (1.0 + strains[i])
        L = math.sqrt(Bx * Bx + Bz * Bz)
        soft = softening * EA * offset
        H, V_B, l0, iterations, failed = _solve(Bx, Bz, L, length, run, w, EA, soft, offset)
        at = _linearise(H, V_B, l0, length, run, w, EA, soft, offset)
        found[i, 0] = 1.0 if failed or not H > 0.0 else 0.0
        found[i, 1] = iterations
        found[i, 2] = abs(at[0] - Bx) / L
        found[i, 3] = abs(at[1] - Bz) / L
        found[i, 4] = abs(at[0] - Bx) / Bx
        found[i, 5] = abs(at[2]) / length


def reliability(count: int, seed: int) -> int:
    """Print a table over classes and kinds of cables; return the number of failures.

    A failure: no convergence, H <= 0, a residual above 1e-10 L, or above 1e-8 Bx in Bx.
    """
    each = max(1, count // (len(CLASSES) * len(KINDS)))
    generator = np.random.default_rng(seed)
    failures = 0
    print(f"{each} cables of each class and kind; residuals of Bx, Bz over L, of Bx, of the run")
    print(f"{'class':29}{'kind':15}{'failures':>8}  iterations mean/p99/max"
          f"{'rx/L':>9}{'rz/L':>9}{'rx/Bx':>9}{'run':>9}{'us each':>9}")  # fmt: skip
    for kind, (run, softening, offset) in KINDS.items():
        for name in CLASSES:
            rows = random_cables(name, each, generator)
            strains = generator.uniform(0, 0.003, each)
            found = np.zeros((each, 6))
            solve_all(rows[:1], strains[:1], run, softening, offset, found[:1])  # compiles
            start = time.perf_counter()
            solve_all(rows, strains, run, softening, offset, found)
            each_us = (time.perf_counter() - start) / each * 1e6
            within = (found[:, 2:4].max(1) <= 1e-10) & (found[:, 4] <= 1e-8)
            failed = int(((found[:, 0] != 0) | ~within).sum())
            failures += failed
            steps, worst = found[:, 1], found[:, 2:].max(0)
            counts = f"{steps.mean():14.1f} {np.percentile(steps, 99):4.0f} {steps.max():4.0f}"
            print(f"{name:29}{kind:15}{failed:8d}  {counts:23}"
                  + "".join(f"{r:9.0e}" for r in worst) + f"{each_us:9.2f}")  # fmt: skip
    print(f"failures: {failures} of {each * len(CLASSES) * len(KINDS)}")
    return failures


@jit
def repeat_forces(n, p_WA, p_WB, v_WB, length, rate, w, law, run, damping_time, out):
    """Call the kernel n times from compiled code."""
    for _ in range(n):
        cable_forces(p_WA, p_WB, v_WB, length, rate, w, law, run, damping_time, out)


@jit
def repeat_jacobian(n, p_WA, p_WB, v_WB, length, rate, w, law, run, damping_time, out, jacobian):
    """Call the kernel n times from compiled code."""
    for _ in range(n):
        cable_forces_jacobian(
            p_WA, p_WB, v_WB, length, rate, w, law, run, damping_time, out, jacobian
        )


def fastest(call: Callable[[], object], repeats: int, n: int) -> float:
    """Return the shortest of some means over n calls [us]."""
    call()
    means = []
    for _ in range(repeats):
        start = time.perf_counter()
        for _ in range(n):
            call()
        means.append((time.perf_counter() - start) / n)
    return min(means) * 1e6


def speed(repeats: int) -> None:
    """Print the times of CoGiRo's eight cables, taut, with its run, law and damping."""
    robot = load_robot("cogiro")
    cable = robot.cable
    p_WA = np.array(robot.drawing_points)
    p_WB = robot.attachment_points + np.array([0.5, -0.5, 1.0])
    law, run = cable.stiffness.as_array(), np.array(cable.drum_run)
    length = (np.linalg.norm(p_WB - p_WA, axis=1) + run) / (1 + 400 / cable.stiffness(400.0))
    v_WB, rate = np.full((8, 3), 0.1), np.full(8, 0.05)
    out, jacobian = np.zeros((8, 14)), np.zeros((8, 14, 8))
    inputs = (
        p_WA, p_WB, v_WB, length, rate, robot.weight_per_metre, law, run, cable.damping_time
    )  # fmt: skip
    n = 1000 if is_compiled() else 20
    times = {
        "forces, called from Python": fastest(lambda: cable_forces(*inputs, out), repeats, n),
        "forces and Jacobian, called from Python": fastest(
            lambda: cable_forces_jacobian(*inputs, out, jacobian), repeats, n
        ),
    }
    if is_compiled():
        times["forces, inside compiled code"] = (
            fastest(lambda: repeat_forces(n, *inputs, out), repeats, 1) / n
        )
        times["forces and Jacobian, inside compiled code"] = (
            fastest(lambda: repeat_jacobian(n, *inputs, out, jacobian), repeats, 1) / n
        )
    for name, value in times.items():
        print(f"  {name:45}{value:9.1f} us")


def main() -> int:
    """Run both parts; the exit status says whether a cable failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1_000_000, help="number of random cables")
    parser.add_argument("--repeats", type=int, default=20, help="timings, the shortest counts")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only-speed", action="store_true", help="no random cables")
    options = parser.parse_args()
    failures = 0 if options.only_speed else reliability(options.count, options.seed)
    print(f"eight cables, {'compiled' if is_compiled() else 'not compiled'}:", flush=True)
    speed(options.repeats)
    if is_compiled():
        command = [sys.executable, __file__, "--only-speed", "--repeats", str(options.repeats)]
        subprocess.run(command, check=True, env={**os.environ, "CDPR_DRAKE_NUMBA": "0"})
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
