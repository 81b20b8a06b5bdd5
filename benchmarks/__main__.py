"""Run the benchmarks of this folder one after the other.

    python -m benchmarks [NAME ...] [--quick]

A benchmark is a script bench_NAME.py with options of its own; with --quick each takes its shortest.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parent

QUICK = {
    "catenary": ["--count", "100000"],
    "loop": ["--repeats", "1"],
    "study": ["--duration", "10", "--robots", "3"],
    "vision": ["--repeats", "30"],
}


def main() -> int:
    """Run those asked for, all by default; the exit status is the worst of theirs."""
    scripts = {path.stem.removeprefix("bench_"): path for path in sorted(FOLDER.glob("bench_*.py"))}
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks", description=__doc__.split("\n")[0]
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(scripts))
    parser.add_argument("--quick", action="store_true", help="shortest options of each")
    options = parser.parse_args()
    unknown = [name for name in options.names if name not in scripts]
    if unknown:
        parser.error(f"no benchmark {unknown[0]}; there are {', '.join(scripts)}")
    worst = 0
    for name in options.names or scripts:
        print(f"== {name}", flush=True)
        command = [
            sys.executable,
            str(scripts[name]),
            *(QUICK.get(name, []) if options.quick else []),
        ]
        worst = max(worst, subprocess.run(command, check=False).returncode)
    return worst


if __name__ == "__main__":
    sys.exit(main())
