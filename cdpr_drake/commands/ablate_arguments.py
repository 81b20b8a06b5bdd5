"""The arguments of `cdpr-drake ablate`. Importing this imports no robot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cdpr_drake.commands.arguments import EPILOG


def add_ablate(commands: Any) -> None:
    """Add ablate to the command line.

    Args:
        commands: the subparsers.
    """
    parser = commands.add_parser(
        "ablate",
        help="tell what each sensor is worth",
        description="Make one move with all sensors, without load cells, without tangent cameras "
        "(the law then takes tensions and tangents from the model), and with fewer pose cameras; "
        "the pose comes from the patterns' points in noisy, biased images. Tell final error, "
        "convergence and tensions, and what differs by more than noise explains. CoGiRo makes Test "
        "4, other robots a short move near their middle.",
        epilog=f"Example: cdpr-drake ablate --robot cogiro --seeds 3. {EPILOG}",
        allow_abbrev=False,
    )
    what = parser.add_argument_group("what is compared")
    what.add_argument(
        "--robot", type=_names, action="extend", metavar="NAME|FILE,...",
        help="built-in robots, or robot files, with cameras (default: cogiro,cogiro-98m)",
    )  # fmt: skip
    what.add_argument(
        "--seeds", type=int, default=4, metavar="N",
        help="runs of each set of sensors, each with noise and bias of its own (default: 4)",
    )  # fmt: skip
    what.add_argument(
        "--gain", type=float, metavar="PER_S",
        help="lambda [1/s] (default: the robot file's; else 0.3, or 0.6 of the limit at the goal "
        "if that is less)",
    )  # fmt: skip
    what.add_argument(
        "--unknown-payload", type=float, default=0.0, metavar="KG",
        help="carried, and not known to the controller (default: 0)",
    )  # fmt: skip
    what.add_argument("--jobs", type=int, metavar="N",
                      help="runs at a time (default: as many as cores)")  # fmt: skip
    out = parser.add_argument_group("what comes out")
    out.add_argument("--output", type=Path, metavar="DIR",
                     help="(default: a directory in ./out, which it names)")  # fmt: skip
    out.add_argument("--json", action="store_true", help="print the summary as JSON, nothing else")
    out.add_argument("--no-figures", action="store_true", help="write no figures")


def _names(text: str) -> list[str]:
    return [part.strip() for part in text.split(",") if part.strip()]
