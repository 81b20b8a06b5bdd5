"""One elastic cable: ours, in one call for all cables and one by one, MoorPy, SciPy.

Each finds the end forces of cables of one sort from the place of their ends and their unstrained
length: taut to 2000 N, just tight, and sagging. Ours and MoorPy give the stiffness matrices of the
ends too. The error is that of the force at the platform's end over its size, against a solution of
the textbook's equations in 40 digits.

    python -m benchmarks peers_cable [--count 20000] [--peer-count 200] [--rounds 7]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence

import mpmath
import numpy as np

from benchmarks.harness import Contestant, Report, Spread, interleave, positive, ratio, run
from cdpr_drake.model.catenary import elastic_catenary
from cdpr_drake.model.robot import load_robot

AT_LEAST = 200.0
MAX_ERROR = 1e-9

Force = np.ndarray  # [H, V_B]: of the tension at B, directed from A to B


class Cables:
    """Cables of the robot's sort without the run from the drum, which only ours knows."""

    def __init__(self, count: int, seed: int) -> None:
        robot = load_robot("cogiro")
        self.w, self.EA = robot.weight_per_metre, robot.cable.stiffness(0.0)
        generator = np.random.default_rng(seed)
        L = generator.uniform(5.0, 15.0, count)
        slope = generator.uniform(-1.2, 1.2, count)
        self.p_AB = np.column_stack([L * np.cos(slope), np.zeros(count), L * np.sin(slope)])
        taut = 1.0 / (1.0 + generator.uniform(100.0, 2000.0, count) / self.EA)
        tight = 1.0 + generator.uniform(-2e-4, 2e-4, count)
        sagging = generator.uniform(1.0, 1.05, count)
        self.length = L * np.choose(generator.integers(0, 3, count), [taut, tight, sagging])

    def ours(self) -> np.ndarray:
        """Solve all cables in one call."""
        state = elastic_catenary(self.p_AB, self.length, self.w, self.EA)
        return -state.force_on_platform[:, [0, 2]]

    def ours_alone(self, i: int) -> Force:
        """Solve one cable in a call."""
        state = elastic_catenary(self.p_AB[i], self.length[i], self.w, self.EA)
        return -state.force_on_platform[0, [0, 2]]

    def moorpy(self, i: int) -> Force:
        """Solve one cable with MoorPy's catenary, far above the sea bed."""
        from moorpy.Catenary import catenary

        (x, _, z), l = self.p_AB[i], self.length[i]
        found = catenary(x, z, l, self.EA, self.w, CB=-1000.0, Tol=1e-6)
        return -np.array(found[2:4])

    def scipy(self, i: int) -> Force:
        """Solve one cable with SciPy's `root` for (H, V_B), scaled, from the straight cable."""
        from scipy.optimize import root

        (x, _, z), l, w, EA = self.p_AB[i], self.length[i], self.w, self.EA
        L = np.hypot(x, z)
        T = max(EA * (L - l) / l, 0.5 * w * L)
        start = np.array([T * x / L, T * z / L + 0.5 * w * l])

        def misses(force: Force) -> np.ndarray:
            H, V_B = force
            V_A = V_B - w * l
            T_A, T_B = np.hypot(H, V_A), np.hypot(H, V_B)
            return np.array(
                [
                    H * l / EA + H / w * (np.arcsinh(V_B / H) - np.arcsinh(V_A / H)) - x,
                    l * (V_A + V_B) * (0.5 / EA + 1.0 / (T_A + T_B)) - z,
                ]
            )

        found = root(misses, start, method="hybr", options={"xtol": 1e-12})
        if np.abs(found.fun).max() > 1e-6:
            raise ArithmeticError(found.message)
        return found.x

    def exact(self, i: int, start: Force) -> Force:
        """Solve one cable in 40 digits from a solution to some digits."""
        mpmath.mp.dps = 40
        x, z, l, w, EA = (
            mpmath.mpf(float(a))
            for a in (self.p_AB[i, 0], self.p_AB[i, 2], self.length[i], self.w, self.EA)
        )

        def misses(H: mpmath.mpf, V_B: mpmath.mpf) -> tuple[mpmath.mpf, mpmath.mpf]:
            V_A = V_B - w * l
            T_A, T_B = mpmath.sqrt(H * H + V_A * V_A), mpmath.sqrt(H * H + V_B * V_B)
            along = H * l / EA + H / w * (mpmath.asinh(V_B / H) - mpmath.asinh(V_A / H))
            return along - x, (V_A * l + w * l * l / 2) / EA + (T_B - T_A) / w - z

        found = mpmath.findroot(misses, [mpmath.mpf(float(a)) for a in start], tol=1e-50)
        return np.array([float(a) for a in found])


def solve(one: Callable[[int], Force], count: int) -> np.ndarray:
    """Return the forces (count, 2) of the first cables, NaN where none is found."""
    forces = np.full((count, 2), np.nan)
    for i in range(count):
        try:
            forces[i] = one(i)
        except Exception:  # whatever a peer raises is its failure on this cable
            forces[i] = np.nan
    return forces


def measure(report: Report, options: argparse.Namespace) -> None:
    """Fill the report."""
    cables = Cables(options.count, options.seed)
    few = min(options.peer_count, options.count)
    ways = {"ours, all in one call": lambda i: all_forces[i], "ours, one by one": cables.ours_alone}
    if report.has("moorpy"):
        ways["MoorPy catenary, 1e-6"] = cables.moorpy
    ways["SciPy root"] = cables.scipy
    all_forces = cables.ours()
    exact = np.array([cables.exact(i, all_forces[i]) for i in range(few)])
    size = np.linalg.norm(exact, axis=1)

    contestants = [Contestant(name="ours, all in one call", call=cables.ours, units=options.count)]
    for name, way in list(ways.items())[1:]:
        call = lambda way=way: solve(way, few)  # noqa: E731
        contestants.append(Contestant(name=name, call=call, units=few))
    times = interleave(contestants, options.rounds)
    rows = []
    errors = {}
    for name, way in ways.items():
        error = np.linalg.norm(solve(way, few) - exact, axis=1) / size
        found = error[np.isfinite(error)]
        errors[name] = float(found.max())
        rows.append(
            {
                "one cable": name,
                "us": Spread.of(times[name]).scaled(1e6),
                "median error": float(np.median(found)),
                "largest": float(found.max()),
                "not found": f"{few - len(found)} of {few}",
            }
        )
    report.table(f"{options.count} cables in one call, {few} one by one", rows)
    batch = times["ours, all in one call"]
    for name in list(ways)[1:]:
        least = AT_LEAST if name.startswith("MoorPy") else None
        report.ratio(f"{name} / ours, all in one call", ratio(times[name], batch), at_least=least)
    report.figure("largest error of ours", errors["ours, all in one call"], at_most=MAX_ERROR)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add this benchmark's options."""
    parser.add_argument("--count", type=positive, default=20000, help="cables in one call")
    parser.add_argument(
        "--peer-count", type=positive, default=200, help="of them, solved one by one"
    )
    parser.add_argument("--rounds", type=positive, default=7)
    parser.add_argument("--seed", type=int, default=0)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; the exit status says whether a figure other than a time misses."""
    report = run("peers_cable", __doc__, measure, add_options, arguments)
    return 0 if report.is_right() else 1


if __name__ == "__main__":
    sys.exit(main())
