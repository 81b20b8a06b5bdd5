"""Linearising the whole continuous loop: ours, exact, beside central differences.

The model is that of the pose error over the goal, 52 states, at the goal of Test 4. Central
differences go through the same diagram in plain numbers, at the step that suits them best. Errors
are relative to the largest entry of each row, against differences extrapolated to step zero
(Ridders), which share nothing with ours but the plain numbers; and against Drake's own
linearisation with AutoDiffXd.

    python -m benchmarks peers_linearize [--rounds 15]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from pydrake.systems.primitives import FirstOrderTaylorApproximation

from benchmarks.harness import Contestant, Report, Spread, interleave, positive, ratio, run
from cdpr_drake.diagrams import make_vision_based_control
from cdpr_drake.model.robot import load_robot
from cdpr_drake.runs.paper_tests import paper_test
from cdpr_drake.study import equilibrium, linearize

PORTS = ("desired_pose",), ("pose_error",)
STEPS = (1e-4, 1e-5, 1e-6, 1e-7)
HIGHEST_STEP, HALVINGS = 4e-3, 8
EXACT = 1e-9

Array = np.ndarray


class PlainDiagram:
    """A continuous diagram as a function of [state; desired pose] in plain numbers."""

    def __init__(self, diagram: Any, context: Any) -> None:
        self.diagram = diagram
        self.context = diagram.CreateDefaultContext()
        self.context.SetTimeStateAndParametersFrom(context)
        diagram.FixInputPortsFrom(diagram, context, self.context)
        self.port = diagram.GetInputPort(PORTS[0][0])
        self.output = diagram.GetOutputPort(PORTS[1][0])
        x = context.get_continuous_state_vector().CopyToVector()
        self.n = x.size
        self.z = np.concatenate([x, self.port.Eval(context)])

    def __call__(self, z: Array) -> Array:
        """Return [derivatives; output]."""
        self.context.SetContinuousState(z[: self.n])
        self.port.FixValue(self.context, z[self.n :])
        xdot = self.diagram.EvalTimeDerivatives(self.context).CopyToVector()
        return np.concatenate([xdot, self.output.Eval(self.context)])


def central(f: Callable[[Array], Array], z: Array, step: float) -> Array:
    """Return df/dz by central differences, steps relative to |z| above 1."""
    columns = []
    for j, size in enumerate(step * np.maximum(np.abs(z), 1.0)):
        up, down = z.copy(), z.copy()
        up[j] += size
        down[j] -= size
        columns.append((f(up) - f(down)) / (up[j] - down[j]))
    return np.column_stack(columns)


def extrapolated(f: Callable[[Array], Array], z: Array) -> Array:
    """Return df/dz from central differences of halved steps, each entry where they agree best."""
    table = [central(f, z, HIGHEST_STEP)]
    best, doubt = table[0], np.full(table[0].shape, np.inf)
    for halving in range(1, HALVINGS + 1):
        row = [central(f, z, HIGHEST_STEP / 2.0**halving)]
        for order, before in enumerate(table, start=1):
            row.append(row[-1] + (row[-1] - before) / (4.0**order - 1.0))
            apart = np.maximum(np.abs(row[-1] - row[-2]), np.abs(row[-1] - before))
            best, doubt = np.where(apart < doubt, row[-1], best), np.minimum(apart, doubt)
        table = row
    return best


def error(found: Array, exact: Array) -> float:
    """Return the largest difference in a row over the row's largest entry."""
    size = np.abs(exact).max(axis=1)
    kept = size > 0.0
    return float((np.abs(found - exact).max(axis=1)[kept] / size[kept]).max())


def measure(report: Report, options: argparse.Namespace) -> None:
    """Fill the report."""
    robot = load_robot("cogiro")
    loop = make_vision_based_control(robot, sample_time=None)
    context = equilibrium(loop, paper_test(4).poses(robot)[1])
    f = PlainDiagram(loop, context)

    def stacked(model: Any) -> Array:
        return np.block([[model.A, model.B], [model.C, model.D]])

    def drakes() -> Any:
        return FirstOrderTaylorApproximation(
            loop, context, loop.GetInputPort(PORTS[0][0]).get_index(),
            loop.GetOutputPort(PORTS[1][0]).get_index(),
        )  # fmt: skip

    def tidy(model: Any) -> Array:
        A, B, C, D = (getattr(model, name)() for name in "ABCD")
        return np.block([[A, B], [C, D]])

    exact = extrapolated(f, f.z)
    found = stacked(linearize(loop, context, *PORTS))
    errors = {step: error(central(f, f.z, step), exact) for step in STEPS}
    step = min(STEPS, key=lambda s: errors[s])
    ours, plain, drake = "ours", f"central differences, {step:g}", "Drake, AutoDiffXd"
    contestants = [
        Contestant(name=ours, call=lambda: linearize(loop, context, *PORTS)),
        Contestant(name=plain, call=lambda: central(f, f.z, step)),
        Contestant(name=drake, call=drakes),
    ]
    times = interleave(contestants, options.rounds)
    drake_model = tidy(drakes())
    against = {ours: error(found, exact), plain: errors[step], drake: error(drake_model, exact)}
    rows = [
        {"one linear model": name, "ms": Spread.of(times[name]).scaled(1e3), "error": against[name]}
        for name in times
    ]
    report.table(f"{f.n} states, 6 inputs, 6 outputs", rows)
    report.ratio("central differences / ours", ratio(times[plain], times[ours]), at_least=2.0)
    report.ratio("Drake / ours", ratio(times[drake], times[ours]))
    report.figure("error of ours", against[ours], at_most=EXACT)
    report.figure("ours off Drake's AutoDiffXd", error(found, drake_model), at_most=EXACT)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add this benchmark's options."""
    parser.add_argument("--rounds", type=positive, default=15)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; the exit status says whether a figure other than a ratio of times misses."""
    report = run("peers_linearize", __doc__, measure, add_options, arguments)
    return 0 if report.is_right() else 1


if __name__ == "__main__":
    sys.exit(main())
