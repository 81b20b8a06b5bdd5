"""Arguments that several commands have, and what argparse makes of their texts.

A constant holds what `add_argument` takes after the name: `group.add_argument("--robot", **ROBOT)`.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from cdpr_drake.commands import UsageError

FEWEST, MOST = 2, 400
"""Of the values in a span."""


def parse_pose(text: str) -> list[float]:
    """Return [roll, pitch, yaw, x, y, z] (rad, m) of "x,y,z" or "x,y,z,roll,pitch,yaw".

    Args:
        text: x, y, z in metres; roll, pitch, yaw in degrees, 0 if left out.

    Raises:
        argparse.ArgumentTypeError: it is no such text, or an angle is beyond a full turn.
    """
    values = _numbers(text)
    if len(values) not in (3, 6):
        raise argparse.ArgumentTypeError(
            f"{text!r} is neither x,y,z [m] nor x,y,z,roll,pitch,yaw [m, deg]"
        )
    if any(abs(angle) > 360.0 for angle in values[3:]):
        raise argparse.ArgumentTypeError(
            f"{text!r}: roll, pitch, yaw [deg] come last, none beyond a full turn"
        )
    angles = [math.radians(a) for a in values[3:]] or [0.0, 0.0, 0.0]
    return [*angles, *values[:3]]


def parse_range(text: str) -> tuple[float, float]:
    """Return (from, to) of a `text` "value" or "from,to"."""
    values = _numbers(text)
    if len(values) not in (1, 2) or values[0] > values[-1]:
        raise argparse.ArgumentTypeError(f"{text!r} is neither a number nor FROM,TO")
    return values[0], values[-1]


def parse_span(text: str) -> tuple[float, float, int]:
    """Return (from, to, how many) of a `text` "from,to,n"."""
    values = _numbers(text)
    if len(values) != 3 or not 0.0 <= values[0] < values[1] or values[2] % 1.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not FROM,TO,N with 0 <= FROM < TO")
    if not FEWEST <= values[2] <= MOST:
        raise argparse.ArgumentTypeError(f"{text!r}: N is from {FEWEST} to {MOST}")
    return values[0], values[1], int(values[2])


def parse_count(text: str) -> int:
    """Return the integer, at least 1, of a `text`."""
    try:
        count = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be an integer, got {text!r}") from None
    if count < 1:
        raise argparse.ArgumentTypeError(f"must be at least 1, got {text}")
    return count


def parse_names(text: str) -> list[str]:
    """Return the names in a `text`, separated by commas."""
    return [part.strip() for part in text.split(",") if part.strip()]


def parse_model(text: str) -> str:
    """Return the name of a cable model, spelt as Python takes it too.

    Args:
        text: as it was typed.

    Raises:
        UsageError: there is no such model.
    """
    from cdpr_drake.model.cable_models import cable_model_name

    try:
        return cable_model_name(text)
    except ValueError as error:
        raise UsageError(str(error)) from None


def parse_models(text: str) -> list[str]:
    """Return the names of cable models in a `text`, separated by commas."""
    return [parse_model(name) for name in parse_names(text)]


def parse_rule(text: str) -> str:
    """Return a rule for tensions of a `text` that may have hyphens, to need no quotes.

    A number is the tension [N] to stay close to, within the limits.
    """
    values = _numbers(text)
    if len(values) == 1 and values[0] >= 0.0:
        return f"within limits, close to {values[0]:g} N"
    return text.strip().lower().replace("-", " ")


def positive(unit: str, or_zero: bool = False) -> Callable[[str], float]:
    """Return what makes a positive, finite number of a text.

    Args:
        unit: of the number, for messages.
        or_zero: whether it may be 0.
    """

    def parse(text: str) -> float:
        values = _numbers(text)
        if len(values) != 1 or values[0] < 0.0 or (values[0] == 0.0 and not or_zero):
            least = ">= 0" if or_zero else "positive"
            raise argparse.ArgumentTypeError(f"must be {least} and finite, got {text}{unit}")
        return values[0]

    return parse


def _numbers(text: str) -> Sequence[float]:
    """Return the finite numbers in a text, separated by commas; none if one of them is not."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        return []
    return values if all(map(math.isfinite, values)) else []


def _taking(metavar: str, help: str | None = None, **settings: Any) -> dict[str, Any]:
    return {"metavar": metavar, **({"help": help} if help else {}), **settings}


MODELS = "ECM, CMWE, SCMWE, SLSM"

ROBOT = _taking("NAME|FILE", "a built-in robot, or a robot file (default: cogiro)")
ROBOTS = _taking("NAME|FILE,...", type=parse_names, action="extend")
PAYLOAD = _taking("KG", "mass carried (default: the test's; else the robot's)", type=float)
POSE = _taking("X,Y,Z[,R,P,Y]", type=parse_pose)
TENSIONS = _taking("RULE", "of those that balance the platform: minimum-norm-within-limits; "
                   "minimum-norm, whatever the limits; within-limits, closest to the robot's "
                   "preferred tension, or the middle; a number, closest to that tension [N] "
                   "(default: the first, and for the paper's tests its own rule, the "
                   "second)", type=parse_rule)  # fmt: skip
SAME_TENSIONS = _taking("RULE", "as `run` has them (default: minimum-norm-within-limits)",
                        type=parse_rule)  # fmt: skip
CABLE_MODEL = _taking("MODEL", f"of the law: {MODELS} (default: SCMWE)",
                      type=parse_model, default="SCMWE")  # fmt: skip
CABLE_MODELS = _taking("MODEL,...", type=parse_models, action="extend")
GAIN = _taking("PER_S", "lambda [1/s] (default: the robot file's; else 0.1, or half the limit at "
               "the pose if that is less)", type=float)  # fmt: skip
SAMPLE_TIME = _taking("S", "of the vision loop (default: the robot's)", type=float)
LATENCY = _taking("S", "from image to motors (default: the robot's)", type=float)
SPAN = _taking("FROM,TO,N", type=parse_span)
SEED = _taking("N", "of all that is drawn at random (default: 0)", type=int, default=0)
MAX_STEP = _taking("S", "step of the integrator (default: 0.01, or less where the robot's modes "
                   "need it)", type=positive(" s"))  # fmt: skip
JOBS = _taking("N", "processes (default: as many as cores)", type=parse_count)
NO_NOISE: dict[str, Any] = {"action": "store_true", "help": "perfect cameras and load cells"}


def add_place(
    parser: argparse.ArgumentParser,
    robot: dict[str, Any] = ROBOT,
    default: str = "for CoGiRo Test 4's, else the middle of the workspace",
) -> Any:
    """Add what `resolve_place` heeds and return its group; --tensions can be added to that.

    Args:
        parser: the parser.
        robot: settings of --robot.
        default: the pose if nobody asks for one, in words.
    """
    parser.set_defaults(tensions=None)
    group = parser.add_argument_group("which robot, and where")
    group.add_argument("--robot", **robot)
    group.add_argument("--payload", **PAYLOAD)
    group.add_argument("--test", type=int, metavar="N",
                       help="at the goal of one of the paper's Tests 1 to 5, with its "
                       "payload")  # fmt: skip
    group.add_argument("--pose", **POSE,
                       help="position [m]; roll, pitch, yaw [deg] (default: "
                       f"{default})")  # fmt: skip
    return group


def add_ends(group: Any) -> None:
    """Add --from and --to, the ends of a move that --test or the robot has otherwise.

    Args:
        group: of arguments.
    """
    for name, text in (("from", "start"), ("to", "goal")):
        group.add_argument(f"--{name}", dest=text, **POSE,
                           help=f"the platform's {text}: position [m]; roll, pitch, yaw [deg], "
                           "level if left out (default: the test's, or of the short "
                           "move)")  # fmt: skip


def add_output(parser: argparse.ArgumentParser) -> Any:
    """Add what `write_answer` heeds, --output, --json, --no-figures, and return its group.

    Args:
        parser: the parser.
    """
    group = parser.add_argument_group("what comes out")
    group.add_argument("--output", type=Path, metavar="DIR",
                       help="where files go (default: a directory in ./out, which it "
                       "names)")  # fmt: skip
    group.add_argument("--json", action="store_true",
                       help="print the summary as JSON, nothing else")  # fmt: skip
    group.add_argument("--no-figures", action="store_true", help="write no figures")
    return group
