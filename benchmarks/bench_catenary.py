"""Reliability and speed of the elastic catenary.

Solves random cables of the classes a solver finds easy or hard, with and without a run from the
drum and a stiffness that follows the tension; counts failures, which should be 0: no convergence,
H not positive, a residual above 1e-10 L, or above 1e-8 Bx in Bx. Then times the eight cables of
CoGiRo, taut, with its run, law and damping, compiled and not.

    python -m benchmarks catenary [--count 1000000] [--rounds 7]
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks.harness import ROOT, Contestant, Report, Spread, interleave, positive, run
from cdpr_drake.model.kernels import is_compiled, jit
from cdpr_drake.model.kernels.catenary import (
    AFRESH,
    _linearise,
    _solve,
    cable_forces,
    cable_forces_jacobian,
)
from cdpr_drake.model.robot import load_robot

sys.path.append(str(ROOT / "tests"))

from cable_classes import CLASSES, random_cables

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
        H, V_B, l0, iterations, failed, _near, _linear = _solve(
            Bx, Bz, L, length, run, w, EA, soft, offset, AFRESH
        )
        at = _linearise(H, V_B, l0, length, run, w, EA, soft, offset)
        found[i, 0] = 1.0 if failed or not H > 0.0 else 0.0
        found[i, 1] = iterations
        found[i, 2] = abs(at[0] - Bx) / L
        found[i, 3] = abs(at[1] - Bz) / L
        found[i, 4] = abs(at[0] - Bx) / Bx
        found[i, 5] = abs(at[2]) / length


def reliability(report: Report, count: int, seed: int) -> None:
    """Solve cables of all classes and kinds."""
    each = max(1, count // (len(CLASSES) * len(KINDS)))
    generator = np.random.default_rng(seed)
    failures, rows = 0, []
    for kind, (length, softening, offset) in KINDS.items():
        for name in CLASSES:
            cables = random_cables(name, each, generator)
            strains = generator.uniform(0, 0.003, each)
            found = np.zeros((each, 6))
            solve_all(cables[:1], strains[:1], length, softening, offset, found[:1])  # compiles
            start = time.process_time()
            solve_all(cables, strains, length, softening, offset, found)
            took = time.process_time() - start
            within = (found[:, 2:4].max(1) <= 1e-10) & (found[:, 4] <= 1e-8)
            failed = int(((found[:, 0] != 0) | ~within).sum())
            failures += failed
            steps, worst = found[:, 1], found[:, 2:].max(0)
            rows.append(
                {
                    "class": name,
                    "kind": kind,
                    "failures": failed,
                    "steps": float(steps.mean()),
                    "99 %": float(np.percentile(steps, 99)),
                    "most": float(steps.max()),
                    "rx/L": float(worst[0]),
                    "rz/L": float(worst[1]),
                    "rx/Bx": float(worst[2]),
                    "us": 1e6 * took / each,
                }
            )
    title = f"{each} cables of each class and kind; iterations, largest residuals, time each"
    report.table(title, rows)
    report.figure("cables", each * len(rows))
    report.figure("not solved", failures, at_most=0)


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


def calls(n: int) -> dict[str, Callable[[], Any]]:
    """Return calls that evaluate the robot's eight cables n times."""
    robot = load_robot("cogiro")
    cable = robot.cable
    p_WA = np.array(robot.drawing_points)
    p_WB = robot.attachment_points + np.array([0.5, -0.5, 1.0])
    law, drum_run = cable.stiffness.as_array(), np.array(cable.drum_run)
    length = (np.linalg.norm(p_WB - p_WA, axis=1) + drum_run) / (1 + 400 / cable.stiffness(400.0))
    v_WB, rate = np.full((8, 3), 0.1), np.full(8, 0.05)
    out, jacobian = np.zeros((8, 14)), np.zeros((8, 14, 8))
    w, damping = robot.weight_per_metre, cable.damping_time
    inputs = (p_WA, p_WB, v_WB, length, rate, w, law, drum_run, damping)

    def forces() -> None:
        for _ in range(n):
            cable_forces(*inputs, out)

    def both() -> None:
        for _ in range(n):
            cable_forces_jacobian(*inputs, out, jacobian)

    found: dict[str, Callable[[], Any]] = {"forces": forces, "forces and Jacobian": both}
    if is_compiled():
        found["forces, from compiled code"] = lambda: repeat_forces(n, *inputs, out)
        found["forces and Jacobian, from compiled code"] = lambda: repeat_jacobian(
            n, *inputs, out, jacobian
        )
    return found


def speed(report: Report, rounds: int) -> None:
    """Time the eight cables."""
    n = 1000 if is_compiled() else 20
    contestants = [Contestant(name=name, call=call, units=n) for name, call in calls(n).items()]
    times = interleave(contestants, rounds)
    how = "compiled" if is_compiled() else "not compiled"
    rows = [{"eight cables": n, "us": Spread.of(t).scaled(1e6)} for n, t in times.items()]
    report.table(f"eight cables, {how}", rows)


def measure(report: Report, options: argparse.Namespace) -> None:
    """Fill the report."""
    if not options.only_speed:
        reliability(report, options.count, options.seed)
    speed(report, options.rounds)
    if is_compiled() and not options.only_speed:
        sys.stdout.flush()
        command = [sys.executable, "-m", "benchmarks.bench_catenary", "--only-speed"]
        command += ["--rounds", str(options.rounds), "--folder", str(options.folder / "plain")]
        off = {**os.environ, "CDPR_DRAKE_NUMBA": "0"}
        subprocess.run(command, check=True, cwd=ROOT, env=off, stdout=subprocess.DEVNULL)
        plain = json.loads((options.folder / "plain" / "catenary.json").read_text())["tables"][0]
        rows = [{**row, "us": Spread(**row["us"])} for row in plain["rows"]]
        report.table(plain["title"], rows)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add this benchmark's options."""
    parser.add_argument("--count", type=positive, default=1_000_000, help="random cables")
    parser.add_argument("--rounds", type=positive, default=7)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only-speed", action="store_true", help="no random cables")


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; the exit status says whether a cable was not solved."""
    report = run("catenary", __doc__, measure, add_options, arguments)
    return 0 if report.is_right() else 1


if __name__ == "__main__":
    sys.exit(main())
