"""What the package takes to start, and the loop of Test 4 with and without compiled kernels.

The import of pydrake's modules in a fresh interpreter, and of the package on top of them; then the
sampled, noisy vision-based loop with all signals kept, compiled and not. Each in a process of its
own, in its CPU time.

    python -m benchmarks loop [--until 20] [--rounds 3]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Sequence

from benchmarks.harness import ROOT, Report, Spread, positive, ratio, run

PYDRAKE = (
    "import pydrake.systems.framework, pydrake.multibody.plant, pydrake.systems.primitives, "
    "pydrake.systems.analysis, pydrake.math, pydrake.autodiffutils, pydrake.common.yaml"
)
TOLD = "; import time; print(time.process_time())"
LOOP = """
import sys, time
from cdpr_drake.runs.running import run
from cdpr_drake.runs.setup import setup_of_test
setup = setup_of_test(4, gain=0.1, until=float(sys.argv[1]))
run(setup.replace(until=1.0))
begun = time.process_time()
run(setup)
print((time.process_time() - begun) / setup.until)
"""


def fresh(code: str, *arguments: str, **environment: str) -> float:
    """Return the time [s] that some code prints in a fresh interpreter."""
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        check=True, cwd=ROOT, env={**os.environ, **environment}, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    return float(done.stdout)


def measure(report: Report, options: argparse.Namespace) -> None:
    """Fill the report."""
    base, both, compiled, plain = [], [], [], []
    for _ in range(options.rounds):
        base.append(fresh(PYDRAKE + TOLD))
        both.append(fresh(f"{PYDRAKE}; import cdpr_drake{TOLD}"))
        until = str(options.until)
        compiled.append(fresh(LOOP, until))
        plain.append(fresh(LOOP, until, CDPR_DRAKE_NUMBA="0"))
    added = [b - a for a, b in zip(base, both, strict=True)]
    report.table(
        "imports in a fresh interpreter",
        [
            {"import": "pydrake's modules", "s": Spread.of(base)},
            {"import": "cdpr_drake on top", "s": Spread.of(added)},
        ],
    )
    report.table(
        f"loop of Test 4, {options.until:g} s, whole runs",
        [
            {"kernels": name, "x real time": Spread.of([1.0 / t for t in times])}
            for name, times in (("compiled", compiled), ("not compiled", plain))
        ],
    )
    report.ratio("not compiled / compiled", ratio(plain, compiled))


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add this benchmark's options."""
    parser.add_argument("--until", type=float, default=20.0, help="simulated time [s]")
    parser.add_argument("--rounds", type=positive, default=3)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; times are told, not judged."""
    run("loop", __doc__, measure, add_options, arguments)
    return 0


if __name__ == "__main__":
    sys.exit(main())
