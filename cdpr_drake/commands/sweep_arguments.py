"""The arguments of `cdpr-drake sweep`. Importing this imports no robot."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

EPILOG = (
    "Example: cdpr-drake sweep --test 3 --cases 200 --payload 0,150. Exit status: 0, done; 1, a "
    "case failed; 2, the input cannot be used; 130, interrupted: the same command with --resume "
    "goes on from there."
)


def add_sweep(commands: Any) -> None:
    """Add sweep to the command line.

    Args:
        commands: the subparsers.
    """
    parser = commands.add_parser(
        "sweep",
        help="make one move many times, with random noise, calibration, payload and gain",
        description=(
            "Make one move under vision-based control many times. Noise and calibration errors "
            "are drawn anew each time, payload and gain too where a range is given. Tell the "
            "spread of errors, settling, excursions and tensions. Results do not depend on how "
            "many processes there are, nor on where they run, and are kept as they arrive."
        ),
        epilog=EPILOG,
        allow_abbrev=False,
    )
    what = parser.add_argument_group("what moves, and where")
    what.add_argument("--test", type=int, metavar="N",
                      help="one of the paper's Tests 1 to 5 (default: 4 for CoGiRo, a short move "
                      "near its middle for another robot)")  # fmt: skip
    what.add_argument("--robot", metavar="NAME|FILE",
                      help="a built-in robot, or a robot file (default: cogiro)")  # fmt: skip
    what.add_argument("--cable-model", type=str.upper, default="SCMWE", metavar="MODEL",
                      help="of the law: ECM, CMWE, SCMWE, SLSM (default: SCMWE)")  # fmt: skip
    what.add_argument("--sensors", default="gaussian", metavar="NAME",
                      help="gaussian, or targets (default: gaussian)")  # fmt: skip
    what.add_argument("--until", type=float, metavar="S", help="time to run")

    drawn = parser.add_argument_group("what is drawn")
    drawn.add_argument("--cases", type=int, default=50, metavar="N", help="(default: 50)")
    drawn.add_argument("--seed", type=int, default=0, metavar="N", help="of all (default: 0)")
    drawn.add_argument("--no-noise", action="store_true", help="perfect cameras and load cells")
    drawn.add_argument("--calibration", type=float, default=1.0, metavar="SCALE",
                       help="size of calibration errors; 1: A 2 mm, B 1.5 mm, ^fT_b 3 mm and 0.1 "
                       "deg, ^mT_e 2 mm and 0.1 deg, one sigma; 0: none (default: 1)")  # fmt: skip
    drawn.add_argument("--payload", type=_range, metavar="KG[,KG]",
                       help="mass carried, or from and to (default: the test's)")  # fmt: skip
    drawn.add_argument("--gain", type=_range, metavar="PER_S[,PER_S]",
                       help="lambda, or from and to [1/s] (default: that of --test; else the "
                       "robot file's; else 0.1, or half the limit there if less)")  # fmt: skip

    where = parser.add_argument_group("where it runs")
    where.add_argument("--jobs", type=int, metavar="N",
                       help="processes (default: as many as cores)")  # fmt: skip
    where.add_argument("--dask", metavar="ADDRESS",
                       help="scheduler of a Dask cluster (the `cluster` extra)")  # fmt: skip
    where.add_argument("--resume", action="store_true",
                       help="take what an interrupted sweep left in DIR")  # fmt: skip

    out = parser.add_argument_group("what comes out")
    out.add_argument("--output", type=Path, metavar="DIR",
                     help="(default: a directory in ./out, which it names)")  # fmt: skip
    out.add_argument("--json", action="store_true", help="print the summary as JSON, nothing else")
    out.add_argument("--no-figures", action="store_true", help="write no figures")


def _range(text: str) -> tuple[float, float]:
    """Return (from, to) of "value" or "from,to"."""
    import math

    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in (1, 2) or not all(map(math.isfinite, values)) or values[0] > values[-1]:
        raise argparse.ArgumentTypeError(f"{text!r} is neither a number nor FROM,TO")
    return values[0], values[-1]
