"""The arguments of `cdpr-drake reproduce`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

EPILOG = (
    "Exit status: 0, done, whether or not all claims agree; 1, a case failed; 2, the input cannot "
    "be used; 130, interrupted: the same command goes on from there."
)


def add_reproduce(commands: Any) -> None:
    """Add the command to a parser.

    Args:
        commands: what `add_subparsers` gave.
    """
    parser = commands.add_parser(
        "reproduce",
        help="make the paper's tables and figures again, with what it prints beside",
        description=(
            "Run the experiments and simulations of Dallej et al. 2019, Tables 4 to 7 and Figures "
            "10 to 16, and write a report: each of the paper's numbers and claims beside ours. "
            "What an earlier, even an interrupted, run of the same source has computed is not "
            "computed again."
        ),
        epilog=EPILOG,
        allow_abbrev=False,
    )
    parser.add_argument(
        "--only", nargs="+", action="extend", metavar="NAME",
        help="some of it, e.g. table4 figure13; an unknown name lists all",
    )  # fmt: skip
    parser.add_argument(
        "--jobs", type=_count, metavar="N", help="processes (default: as many as cores)"
    )
    parser.add_argument(
        "--output", type=Path, metavar="DIR",
        help="where report.html, report.json and figures go (default: out/reproduction)",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print report.json, nothing else")


def _count(text: str) -> int:
    try:
        number = int(text)
    except ValueError:
        number = 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of processes")
    return number
