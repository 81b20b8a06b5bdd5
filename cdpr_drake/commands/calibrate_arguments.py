"""The arguments of `cdpr-drake calibrate`. Importing this imports no robot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cdpr_drake.commands.arguments import EPILOG


def add_calibrate(commands: Any) -> None:
    """Add calibrate to the command line.

    Args:
        commands: the subparsers.
    """
    parser = commands.add_parser(
        "calibrate",
        help="calibrate a robot on simulated measurements",
        description="Calibrate cameras, drawing and attachment points, X_WF and X_PM as section "
        "4.3 of the paper does, on simulated measurements: 25 views of a checkerboard for each "
        "camera, points of a laser tracker, and a few poses of the platform. Tell the errors "
        "against truth and their standard deviations, and write the calibrated robot as a robot "
        "file, for `run --calibrated`.",
        epilog=f"Example: cdpr-drake calibrate --seed 3 --output out/believed. {EPILOG}",
        allow_abbrev=False,
    )
    what = parser.add_argument_group("what is calibrated, and how well is measured")
    what.add_argument("--robot", metavar="NAME|FILE",
                      help="a built-in robot, or a robot file (default: cogiro)")  # fmt: skip
    what.add_argument("--seed", type=int, default=0, metavar="N", help="of the noise (default: 0)")
    noise = what.add_mutually_exclusive_group()
    noise.add_argument("--noise", type=float, default=1.0, metavar="SCALE",
                       help="of all measurements, times the usual (default: 1)")  # fmt: skip
    noise.add_argument("--no-noise", action="store_true", help="exact measurements")
    out = parser.add_argument_group("what comes out")
    out.add_argument("--output", type=Path, metavar="DIR",
                     help="(default: a directory in ./out, which it names)")  # fmt: skip
    out.add_argument("--json", action="store_true", help="print the summary as JSON, nothing else")
    out.add_argument("--no-figures", action="store_true", help="write no figures")
