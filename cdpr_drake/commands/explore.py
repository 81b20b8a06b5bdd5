"""`cdpr-drake explore`: a robot at rest in a browser, with sliders for pose, payload and gain."""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace

from cdpr_drake.commands import Command, UsageError
from cdpr_drake.commands import arguments as common
from cdpr_drake.commands.resolve import gain_in_words, input_refused, resolve_gain, resolve_place
from cdpr_drake.commands.terminal import print_wrapped

PORTS = (1024, 65534)
"""From the first to the last that may be asked for: the next one has to be there too."""


def _add_arguments(parser: ArgumentParser) -> None:
    common.add_place(parser)
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
            place = resolve_place(options)
            cameras = place.robot.cameras
            gain, chosen = resolve_gain(options, place, cameras.sample_time, cameras.latency)
            explorer = Explorer(place.robot, place.pose, options.cable_model, gain, options.port)
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
