"""The arguments of the commands that ask questions of a loop. Importing this imports no robot."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from cdpr_drake.commands.arguments import EPILOG, parse_models, parse_pose

FEWEST, MOST = 2, 400
"""Number of gains, or of latencies, in a map."""


def add_study_commands(commands: Any) -> None:
    """Add linearize, stability, coupling and explore to the command line.

    Args:
        commands: the subparsers.
    """
    linearize = _add(
        commands,
        "linearize",
        "tell the modes of the control loop at a pose",
        "Linearise the whole vision-based control loop at rest at a pose, continuous or sampled, "
        "and list its modes: eigenvalues, frequencies, damping, time constants, and the states "
        "that take part. Draw the pole map, and the shape of the least damped oscillation.",
        "cdpr-drake linearize --test 4 --gain 0.1 --continuous",
    )
    _add_place(linearize, "--robot")
    how = linearize.add_argument_group("how it is controlled")
    how.add_argument("--cable-model", default="SCMWE", metavar="MODEL", type=str.upper,
                     help="of the law: ECM, CMWE, SCMWE, SLSM (default: SCMWE)")  # fmt: skip
    _add_gain(how, "lambda [1/s]")
    how.add_argument("--continuous", action="store_true",
                     help="neither sampled nor late")  # fmt: skip
    _add_timing(how)
    _add_output(linearize)

    stability = _add(
        commands,
        "stability",
        "tell how far the gain can go at a pose",
        "Find the smallest gain at which the sampled vision-based control loop is unstable at a "
        "pose, and the mode that is; with --map over gain and latency.",
        "cdpr-drake stability --test 4 --payload 200 --map",
    )
    _add_place(stability, "--robot")
    stability.add_argument_group("the cables").add_argument(
        "--damping-time", type=float, metavar="S",
        help="damping of the cables over their stiffness (default: the robot's)",
    )  # fmt: skip
    how = stability.add_argument_group("how it is controlled")
    how.add_argument("--cable-model", default="SCMWE", metavar="MODEL", type=str.upper,
                     help="of the law: ECM, CMWE, SCMWE, SLSM (default: SCMWE)")  # fmt: skip
    _add_timing(how)
    over = stability.add_argument_group("the map")
    over.add_argument("--map", action="store_true", help="over gain and latency, with a figure")
    over.add_argument("--gains", type=_span, default=(0.1, 15.0, 24), metavar="FROM,TO,N",
                      help="of the map [1/s] (default: 0.1,15,24)")  # fmt: skip
    over.add_argument("--latencies", type=_span, default=(0.0, 0.24, 17), metavar="FROM,TO,N",
                      help="of the map [s] (default: 0,0.24,17)")  # fmt: skip
    _add_output(stability)

    coupling = _add(
        commands,
        "coupling",
        "compare the cable models by their gain matrices",
        "Compare cable models by the gain matrix Gamma, motion had per motion asked for, without "
        "simulation: rates of convergence over lambda, coupling, and how far moves stray from the "
        "straight way. Draws rates and responses.",
        "cdpr-drake coupling --robot cogiro,cogiro-98m",
    )
    _add_place(coupling, "--robot", several=True)
    how = coupling.add_argument_group("how it is controlled")
    how.add_argument("--cable-model", type=parse_models, action="extend", metavar="MODEL,...",
                     help="of the law (default: ECM,CMWE,SCMWE,SLSM)")  # fmt: skip
    _add_gain(how, "lambda of the figure [1/s]", "; the lowest of robots and models")
    _add_output(coupling)
    _add_explore(commands)


def _add_explore(commands: Any) -> None:
    explore = _add(
        commands,
        "explore",
        "drag the pose and the payload in a browser, and see what changes",
        "Show a robot at rest in a browser, with sliders for pose, payload and gain: its sagging "
        "cables with their tensions, the slowest oscillations, and how the control loop converges, "
        "from the gain matrix. Serves this machine only. Ends by Ctrl-C, by Stop in the browser, "
        "or when no browser is there.",
        "cdpr-drake explore --robot cogiro --payload 100",
    )
    _add_place(explore, "--robot")
    how = explore.add_argument_group("how it is controlled")
    how.add_argument("--cable-model", default="SCMWE", metavar="MODEL", type=str.upper,
                     help="of the law: ECM, CMWE, SCMWE, SLSM (default: SCMWE)")  # fmt: skip
    _add_gain(how, "lambda to begin with [1/s]")
    page = explore.add_argument_group("the page")
    page.add_argument("--port", type=int, default=0, metavar="N",
                      help="of the page, 1024 to 65534; Meshcat takes the next one "
                      "(default: any two that are free)")  # fmt: skip
    page.add_argument("--idle", type=float, default=60.0, metavar="S",
                      help="time without a browser after which to end; 0: never "
                      "(default: 60)")  # fmt: skip


def _add(commands: Any, name: str, title: str, description: str, example: str) -> Any:
    return commands.add_parser(
        name,
        help=title,
        description=description,
        epilog=f"Example: {example}. {EPILOG}",
        allow_abbrev=False,
    )


def _add_place(parser: Any, option: str, several: bool = False) -> None:
    """Add the robot, its payload and the pose: that of a test, or one given."""
    what = parser.add_argument_group("which robot, and where")
    if several:
        what.add_argument(
            option, type=_names, action="extend", metavar="NAME|FILE,...",
            help="built-in robots, or robot files (default: cogiro and its three larger versions)",
        )  # fmt: skip
    else:
        what.add_argument(option, metavar="NAME|FILE",
                          help="a built-in robot, or a robot file (default: cogiro)")  # fmt: skip
    what.add_argument("--payload", type=float, metavar="KG", help="mass carried")
    what.add_argument(
        "--test", type=int, metavar="N",
        help="at the goal of one of the paper's Tests 1 to 5, with its payload",
    )  # fmt: skip
    default = "for CoGiRo Test 4's, else part of the way to cable 1's drawing point"
    if several:
        default = "part of the way to cable 1's drawing point"
    what.add_argument(
        "--pose", type=parse_pose, metavar="X,Y,Z[,R,P,Y]",
        help=f"position [m]; roll, pitch, yaw [deg] (default: {default})",
    )  # fmt: skip


def _add_gain(group: Any, what: str, more: str = "") -> None:
    group.add_argument(
        "--gain", type=float, metavar="PER_S",
        help=f"{what} (default: the robot file's; else 0.1, or half the limit at the pose if that "
        f"is less{more})",
    )  # fmt: skip


def _add_timing(group: Any) -> None:
    group.add_argument("--sample-time", type=float, metavar="S", help="(default: the robot's)")
    group.add_argument("--latency", type=float, metavar="S",
                       help="from image to motors (default: the robot's)")  # fmt: skip


def _add_output(parser: Any) -> None:
    out = parser.add_argument_group("what comes out")
    out.add_argument("--output", type=Path, metavar="DIR",
                     help="(default: a directory in ./out, which it names)")  # fmt: skip
    out.add_argument("--json", action="store_true", help="print the summary as JSON, nothing else")
    out.add_argument("--no-figures", action="store_true", help="write no figures")


def _names(text: str) -> list[str]:
    return [part.strip() for part in text.split(",") if part.strip()]


def _span(text: str) -> tuple[float, float, int]:
    """Return (from, to, how many) of "from,to,n"."""
    import math

    try:
        low, high, count = text.split(",")
        span = float(low), float(high), int(count)
    except ValueError:
        span = (math.nan, math.nan, 0)
    if not (math.isfinite(span[0] + span[1]) and 0.0 <= span[0] < span[1]):
        raise argparse.ArgumentTypeError(f"{text!r} is not FROM,TO,N with 0 <= FROM < TO")
    if not FEWEST <= span[2] <= MOST:
        raise argparse.ArgumentTypeError(f"{text!r}: N is from {FEWEST} to {MOST}")
    return span
