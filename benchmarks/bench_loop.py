"""Speed of the sampled, noisy vision-based loop of Test 4, with its error beside it.

The reference for the error is the same loop, with the same noise, in steps of 0.5 ms. Also times
the import of the package on top of the pydrake modules it needs.

    python benchmarks/bench_loop.py [--until 80] [--repeats 3]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from cdpr_drake.diagrams.simulation import MAX_STEP  # noqa: E402
from cdpr_drake.experiments.runs import run, setup_of_test  # noqa: E402
from cdpr_drake.model.kernels import is_compiled  # noqa: E402

REFERENCE_STEP = 0.0005

PYDRAKE = (
    "import pydrake.systems.framework, pydrake.multibody.plant, pydrake.systems.primitives, "
    "pydrake.systems.analysis, pydrake.math, pydrake.autodiffutils, pydrake.common.yaml"
)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--until", type=float, default=80.0, help="simulated time [s]")
    parser.add_argument("--repeats", type=int, default=3, help="timed runs, the median counts")
    parser.add_argument("--only-speed", action="store_true", help="neither reference nor import")
    options = parser.parse_args()
    setup = setup_of_test(4, gain=0.1, until=options.until)
    run(setup.replace(until=1.0))  # compile
    kind = "compiled" if is_compiled() else "not compiled"
    runs = [run(setup) for _ in range(options.repeats)]
    factors = [r.record.real_time_factor for r in runs]
    line = (
        f"{kind}: {np.median(factors):.1f} x real time ({min(factors):.1f} to {max(factors):.1f})"
    )
    print(f"{line}, RK3 in steps of {MAX_STEP * 1e3:g} ms", flush=True)
    if options.only_speed:
        return
    reference = run(setup.replace(max_step=REFERENCE_STEP))
    miss = runs[0].record["pose"][-1] - reference.record["pose"][-1]
    print(
        f"final pose against steps of {REFERENCE_STEP * 1e3:g} ms: "
        f"{np.linalg.norm(miss[3:]) * 1e3:.1e} mm, {np.degrees(np.linalg.norm(miss[:3])):.1e} deg",
        flush=True,
    )
    if is_compiled():
        command = [sys.executable, __file__, "--only-speed", "--until", str(options.until)]
        command += ["--repeats", str(options.repeats)]
        subprocess.run(command, check=True, env={**os.environ, "CDPR_DRAKE_NUMBA": "0"})
    base, both = import_time(PYDRAKE), import_time(f"{PYDRAKE}; import cdpr_drake")
    print(f"import cdpr_drake: {both - base:.2f} s on top of {base:.2f} s of pydrake")


def import_time(code: str, repeats: int = 5) -> float:
    """Return the shortest time [s] that a fresh interpreter takes for `code`, of some `repeats`."""
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)
        times.append(time.perf_counter() - begun)
    return min(times)


if __name__ == "__main__":
    main()
