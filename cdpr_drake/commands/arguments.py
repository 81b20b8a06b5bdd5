"""The arguments of the command line. Importing this imports no robot: --help answers at once."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from cdpr_drake import __version__

EPILOG = (
    "Exit status: 0, done; 1, a run left what the model covers, or results could not be written; "
    "2, the input cannot be used, and nothing was run; 130, interrupted."
)


class UsageError(Exception):
    """The arguments do not make sense; the message is for the user."""


class _Parser(argparse.ArgumentParser):
    """A parser that raises, so that an error is one line wherever it comes from."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message} (try {self.prog} --help)")


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """Return the parsed arguments, `command` among them.

    Args:
        argv: the arguments, without the program's name.

    Raises:
        UsageError: they do not make sense.
        SystemExit: after --help and --version.
    """
    return _build_parser().parse_args(_attach_negative_values(argv))


def parse_pose(text: str) -> list[float]:
    """Return [roll, pitch, yaw, x, y, z] (rad, m) of "x,y,z" or "x,y,z,roll,pitch,yaw".

    Args:
        text: x, y, z in metres; roll, pitch, yaw in degrees, 0 if left out.

    Raises:
        argparse.ArgumentTypeError: it is no such text.
    """
    import math

    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in (3, 6) or not all(map(math.isfinite, values)):
        raise argparse.ArgumentTypeError(
            f"{text!r} is neither x,y,z [m] nor x,y,z,roll,pitch,yaw [m, deg]"
        )
    angles = [math.radians(a) for a in values[3:]] or [0.0, 0.0, 0.0]
    return [*angles, *values[:3]]


def parse_models(text: str) -> list[str]:
    """Return the names of cable models in a `text`, separated by commas."""
    return [part.strip().upper() for part in text.split(",") if part.strip()]


def _attach_negative_values(argv: Sequence[str]) -> list[str]:
    """Write "--from -1,0,2" as "--from=-1,0,2": argparse takes the former for two options."""
    attached: list[str] = []
    for argument in argv:
        previous = attached[-1] if attached else ""
        if previous.startswith("--") and "=" not in previous and re.match(r"-[\d.]", argument):
            attached[-1] = f"{previous}={argument}"
        else:
            attached.append(argument)
    return attached


def _build_parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="cdpr-drake",
        description="Vision-based control of cable-driven parallel robots with sagging cables.",
        epilog=EPILOG,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    _add_run(commands)
    from cdpr_drake.commands.study_arguments import add_study_commands  # imports this module

    add_study_commands(commands)
    from cdpr_drake.commands.calibrate_arguments import add_calibrate

    add_calibrate(commands)
    from cdpr_drake.commands.reproduce_arguments import add_reproduce

    add_reproduce(commands)
    from cdpr_drake.commands.sweep_arguments import add_sweep

    add_sweep(commands)
    from cdpr_drake.commands.ablate_arguments import add_ablate

    add_ablate(commands)
    commands.add_parser(
        "robots",
        help="list the built-in robots",
        description="List the built-in robots: size, mass, cables, description.",
        allow_abbrev=False,
    )
    return parser


def _add_run(commands: argparse._SubParsersAction[_Parser]) -> None:
    run = commands.add_parser(
        "run",
        help="move a robot from one pose to another under one or more controllers",
        description=(
            "Move a robot from one pose to another under vision-based control (VBC) with one or "
            "more cable models, and under joint space control (JSC); compare the runs, and write "
            "logs, a summary, figures and a replay. Without options: Test 4 of Dallej et al. 2019 "
            "on CoGiRo, with VBC on sagging (SCMWE) and on straight cables (SLSM), and with JSC."
        ),
        epilog=EPILOG,
        allow_abbrev=False,
    )
    what = run.add_argument_group("what moves, and where")
    what.add_argument(
        "--test", type=int, metavar="N",
        help="one of the paper's Tests 1 to 5: poses, payload, gain, time (default: 4 for CoGiRo, "
        "a short move near its middle for another robot)",
    )  # fmt: skip
    what.add_argument(
        "--robot", default=None, metavar="NAME|FILE",
        help="a built-in robot, or a robot file (default: cogiro)",
    )  # fmt: skip
    what.add_argument("--payload", type=float, metavar="KG", help="mass carried")
    for name, text in (("from", "start"), ("to", "goal")):
        what.add_argument(
            f"--{name}", dest=text, type=parse_pose, metavar="X,Y,Z[,R,P,Y]",
            help=f"the platform's {text}: position [m]; roll, pitch, yaw [deg], level if left out",
        )  # fmt: skip

    _add_control(run.add_argument_group("how it is controlled"))
    out = run.add_argument_group("what comes out")
    out.add_argument(
        "--output", type=Path, metavar="DIR", help="(default: a directory in ./out, which it names)"
    )
    out.add_argument("--json", action="store_true", help="print the summary as JSON, nothing else")
    out.add_argument("--no-figures", action="store_true", help="write no figures")
    out.add_argument("--no-replay", action="store_true", help="write no replay")


def _add_control(how: Any) -> None:
    how.add_argument(
        "--controller", choices=("vbc", "jsc", "both"), default="both", help="(default: both)"
    )
    how.add_argument(
        "--cable-model", type=parse_models, action="extend", metavar="MODEL,...",
        help="of VBC: ECM, CMWE, SCMWE, SLSM; one run each (default: SCMWE,SLSM)",
    )  # fmt: skip
    how.add_argument(
        "--gain", type=float, metavar="PER_S",
        help="lambda [1/s] (default: that of --test; else the robot file's; else 0.1, or half the "
        "limit at the goal if that is less)",
    )  # fmt: skip
    how.add_argument(
        "--sample-time", type=float, metavar="S",
        help="of the vision loop (default: the robot's); 0: all continuous, no latency",
    )  # fmt: skip
    how.add_argument(
        "--latency", type=float, metavar="S", help="from image to motors (default: the robot's)"
    )
    how.add_argument(
        "--sensors", default="gaussian", metavar="KIND",
        help="what VBC's cameras deliver: gaussian, the truth with noise; targets, a pose from the "
        "patterns' points and tangents from the cables' edges; images, the same detected in "
        "rendered images, which is slow (default: gaussian)",
    )  # fmt: skip
    how.add_argument(
        "--estimator", default="joint", metavar="KIND",
        help="of the pose from targets: joint, over all images; mean, the paper's (default: joint)",
    )  # fmt: skip
    how.add_argument(
        "--calibrated", metavar="NAME|FILE",
        help="the robot as the controllers believe it, as `calibrate` writes it; start and goal "
        "are the true robot's, in W (default: the true robot)",
    )  # fmt: skip
    how.add_argument("--no-noise", action="store_true", help="perfect cameras and load cells")
    how.add_argument("--seed", type=int, default=0, metavar="N", help="of the noise (default: 0)")
    how.add_argument(
        "--until", type=float, metavar="S",
        help="time to run (default: the test's, or 80; eight time constants of a gain that robot "
        "file or limit decide, at most 400)",
    )  # fmt: skip
