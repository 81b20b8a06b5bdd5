"""Run the benchmarks of this folder one after the other.

    python -m benchmarks [NAME ...] [--quick] [options of the benchmark]

A benchmark is a script bench_NAME.py with options of its own, which are passed on where one name
is given; with --quick each takes its shortest.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parent

QUICK = {
    "catenary": ["--count", "100000", "--rounds", "2"],
    "distribution": ["--poses", "10", "--rounds", "2"],
    "images": ["--frames", "3", "--repeats", "3"],
    "integrators": ["--until", "4", "--rounds", "1"],
    "loop": ["--rounds", "1", "--until", "5"],
    "peers_cable": ["--peer-count", "50", "--rounds", "3"],
    "peers_equilibrium": ["--count", "1000", "--poses", "2", "--rounds", "2"],
    "peers_linearize": ["--rounds", "5"],
    "peers_loop": ["--until", "5", "--rounds", "2"],
    "pulleys": ["--rounds", "3", "--until", "5"],
    "rendered_loop": ["--gain", "0.8", "--until", "8"],
    "scale": ["--rounds", "3", "--work", "8", "--until", "10"],
    "study": ["--duration", "10", "--robots", "3"],
    "sweep": ["--cases", "4", "--until", "10"],
    "vision": ["--rounds", "30"],
}

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""What keeps linear algebra to one thread: the matrices here are too small for more."""


def main() -> int:
    """Run those asked for, all by default; the exit status is the worst of theirs."""
    scripts = {path.stem.removeprefix("bench_"): path for path in sorted(FOLDER.glob("bench_*.py"))}
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks", description=__doc__.split("\n")[0], allow_abbrev=False
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(scripts))
    parser.add_argument("--quick", action="store_true", help="shortest options of each")
    options, others = parser.parse_known_args()
    names = options.names or list(scripts)
    unknown = [name for name in names if name not in scripts]
    if unknown:
        parser.error(f"no benchmark {unknown[0]}; there are {', '.join(scripts)}")
    if others and len(names) > 1:
        parser.error(f"{others[0]} goes with the name of one benchmark")
    environment = {**dict.fromkeys(ONE_THREAD, "1"), **os.environ}
    worst = 0
    for name in names:
        print(f"== {name}", flush=True)
        quick = QUICK.get(name, []) if options.quick else []
        command = [sys.executable, "-m", f"benchmarks.{scripts[name].stem}", *quick, *others]
        done = subprocess.run(command, check=False, cwd=FOLDER.parent, env=environment)
        worst = max(worst, done.returncode)
    return worst


if __name__ == "__main__":
    sys.exit(main())
