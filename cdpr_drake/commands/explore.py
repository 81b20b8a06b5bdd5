"""`cdpr-drake explore`: a robot at rest in a browser, with sliders for pose, payload and gain."""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from cdpr_drake.commands import Command, UsageError
from cdpr_drake.commands import arguments as common
from cdpr_drake.commands.resolve import (
    Place,
    gain_in_words,
    input_refused,
    resolve_gain,
    resolve_place,
    resolve_robot,
)
from cdpr_drake.commands.terminal import print_wrapped

if TYPE_CHECKING:
    from cdpr_drake.analysis import DefaultGain

COMMON_GAIN = 0.1
"""lambda [1/s] to begin with where the robot cannot rest."""

PORTS = (1024, 65534)
"""From the first to the last that may be asked for: the next one has to be there too."""


def _add_arguments(parser: ArgumentParser) -> None:
    common.add_place(parser).add_argument("--tensions", **common.SAME_TENSIONS)
    how = parser.add_argument_group("how it is controlled")
    how.add_argument("--cable-model", **common.CABLE_MODEL)
    how.add_argument("--gain", **common.GAIN)
    page = parser.add_argument_group("the page")
    page.add_argument("--port", type=int, default=0, metavar="N",
                      help="of the page, 1024 to 65534; Meshcat takes the next one (default: any "
                      "two that are free)")  # fmt: skip
    page.add_argument("--idle", type=float, default=60.0, metavar="S",
                      help="time without a browser after which to end; 0: never "
                      "(default: 60)")  # fmt: skip


def _explore(options: Namespace) -> int:
    from cdpr_drake.show.explorer import Explorer

    first, last = PORTS
    if options.port and not first <= options.port <= last:
        raise UsageError(f"--port: from {first} to {last}, or 0 for any, got {options.port}")
    if not (math.isfinite(options.idle) and options.idle >= 0.0):
        raise UsageError(f"--idle: must be 0 or more and finite, got {options.idle:g} s")
    try:
        with input_refused():
            place = _place(options)
            gain, chosen = _gain(options, place)
            explorer = Explorer(
                place.robot, place.pose, options.cable_model, gain, options.port, place.tensions
            )
    except (OSError, RuntimeError) as error:
        raise UsageError(f"--port {options.port}: {error}") from error
    try:
        why = gain_in_words(gain, chosen, "there") if chosen and chosen.reason() else ""
        print_wrapped(f"{place}{f'; {why}' if why else ''}.")
        print(
            f"Open {explorer.address} in a browser; Stop there or Ctrl-C here ends it.", flush=True
        )
        reason = explorer.run(options.idle)
    except KeyboardInterrupt:
        reason = "interrupted"
    finally:
        explorer.close()
    print(f"Ended: {reason}.")
    return 0


def _place(options: Namespace) -> Place:
    """Return the robot where `resolve_place` has it, or in the middle of its room."""
    from cdpr_drake.errors import GeometryError, TensionError
    from cdpr_drake.model.room import home_position
    from cdpr_drake.model.statics import DEFAULT_RULE

    rule = options.tensions or DEFAULT_RULE  # in tests of the paper too: one drags away from there
    try:
        return resolve_place(options)._replace(tensions=rule)
    except (GeometryError, TensionError):  # it can nowhere be held: the page tells why
        x, y, z = home_position(resolve_robot(options.robot)).tolist()
        options.pose = [0.0, 0.0, 0.0, x, y, z]
        return resolve_place(options)._replace(where="in the middle of its room")


def _gain(options: Namespace, place: Place) -> tuple[float, DefaultGain | None]:
    """Return the gain to begin with, and why; a common one where the robot cannot rest."""
    from cdpr_drake.errors import CdprError

    cameras = place.robot.cameras
    try:
        return resolve_gain(options, place, cameras.sample_time, cameras.latency)
    except CdprError:
        return COMMON_GAIN, None


COMMAND = Command(
    summary="drag the pose and the payload in a browser, and see what changes",
    description="Show a robot at rest in a browser, with sliders for pose, payload and gain: its "
    "sagging cables with their tensions, the slowest oscillations, and how the control loop "
    "converges, from the gain matrix. Serves this machine only. Ends by Ctrl-C, by Stop in the "
    "browser, or when no browser is there.",
    example="--robot cogiro --payload 100",
    add_arguments=_add_arguments,
    work=_explore,
)
