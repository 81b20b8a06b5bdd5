"""Tension distributions: what each rule costs, and what a general solver takes for the same.

At random poses in the workspaces of three robots, numbers in and out: the wrench matrix is given.
Least norm within the limits and closest to preferred tensions are quadratic programmes; Drake's
solvers for these are timed on the same ones, with a programme made once and its numbers changed.
The error is the largest distance of a peer's tensions to ours over the upper limit.

    python -m benchmarks distribution [--poses 50] [--rounds 5]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from pydrake.solvers import ClarabelSolver, MathematicalProgram, OsqpSolver

from benchmarks.harness import Contestant, Report, Spread, interleave, positive, ratio, run
from cdpr_drake.analysis import level_workspace
from cdpr_drake.model.distribution import (
    barycentre,
    bounded_distribution,
    feasibility_margin,
    minimum_norm_within,
)
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.robot import load_robot
from cdpr_drake.model.statics import weight_wrench, wrench_matrix

WITHIN = "least norm within limits"
ROBOTS = ("cogiro", "ipanema-2", "segesta-10")
PEERS = {"OSQP": OsqpSolver, "Clarabel": ClarabelSolver}
JUDGE = "Clarabel"
"""By default the more accurate of the peers, whose distance to ours is judged."""

Problem = tuple[np.ndarray, np.ndarray, float, float]


def problems(name: str, count: int) -> list[Problem]:
    """Return wrench matrix, wrench and limits at random feasible poses of a robot."""
    robot = load_robot(name)
    places = level_workspace(robot)
    found = []
    for i in np.random.default_rng(0).integers(len(places), size=count):
        geometry = cable_geometry(robot, RigidTransform(places[i]))
        wrench = weight_wrench(robot, geometry)
        found.append((wrench_matrix(geometry), wrench, *robot.cable.limits))
    return found


class Programme:
    """The tensions of least norm within the limits, by a solver of Drake's.

    Args:
        cables: k.
        solver: of the quadratic programme.
    """

    def __init__(self, cables: int, solver: Any) -> None:
        self._programme, self._solver = MathematicalProgram(), solver
        self._t = self._programme.NewContinuousVariables(cables)
        self._balance = self._programme.AddLinearEqualityConstraint(
            np.zeros((6, cables)), np.zeros(6), self._t
        )
        self._bounds = self._programme.AddBoundingBoxConstraint(0.0, 1.0, self._t)
        self._programme.AddQuadraticCost(2.0 * np.eye(cables), np.zeros(cables), self._t)

    def __call__(self, A: np.ndarray, w: np.ndarray, low: float, high: float) -> np.ndarray:
        """Return the tensions (k,) [N], in units of the upper limit on the way."""
        self._balance.evaluator().UpdateCoefficients(A, w / high)
        bounds = self._bounds.evaluator()
        bounds.set_bounds(np.full(len(self._t), low / high), np.ones(len(self._t)))
        found = self._solver.Solve(self._programme)
        if not found.is_success():
            raise RuntimeError(f"the solver gave up: {found.get_solution_result()}")
        return np.asarray(high * found.GetSolution(self._t))


def _all(call: Callable[..., object], work: Sequence[Problem]) -> None:
    for A, w, low, high in work:
        call(A, w, low, high)


def _in_the_middle(A: np.ndarray, w: np.ndarray, low: float, high: float) -> np.ndarray:
    return bounded_distribution(A, w, low, high, 0.5 * (low + high))


def _ours(cables: int) -> dict[str, Callable[..., object]]:
    rules: dict[str, Callable[..., object]] = {
        "least norm": lambda A, w, low, high: np.linalg.lstsq(A, w, rcond=None)[0],
        WITHIN: minimum_norm_within,
        "closest to the middle": _in_the_middle,
        "feasibility margin": feasibility_margin,
    }
    return {**rules, "barycentre": barycentre} if cables <= 8 else rules


def measure(report: Report, options: argparse.Namespace) -> None:
    """Fill a report."""
    for name in ROBOTS:
        work = problems(name, options.poses)
        cables = work[0][0].shape[1]
        peers = {label: Programme(cables, solver()) for label, solver in PEERS.items()}
        contestants = [
            Contestant(name=label, call=partial(_all, call, work), units=len(work))
            for label, call in {**_ours(cables), **peers}.items()
        ]
        times = interleave(contestants, options.rounds)
        rows = [{"rule": n, "ms": Spread.of(t).scaled(1e3)} for n, t in times.items()]
        report.table(f"{name}, {cables} cables", rows)
        for label, peer in peers.items():
            report.ratio(f"{name}: {label} / ours", ratio(times[label], times[WITHIN]))
            error = max(np.abs(peer(*p) - minimum_norm_within(*p)).max() / p[3] for p in work)
            within = 1e-4 if label == JUDGE else None
            report.figure(f"{name}: {label}, distance to ours", error, at_most=within)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add this benchmark's options."""
    parser.add_argument("--poses", type=positive, default=50)
    parser.add_argument("--rounds", type=positive, default=5)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; times are told, not judged."""
    report = run("distribution", __doc__, measure, add_options, arguments)
    return 0 if report.is_right() else 1


if __name__ == "__main__":
    sys.exit(main())
