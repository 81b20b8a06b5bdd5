"""`cdpr-drake explore`: a robot at rest in a browser, with sliders for pose, payload and gain."""

from __future__ import annotations

import argparse
import math

from cdpr_drake.commands.arguments import UsageError
from cdpr_drake.commands.gain import gain_in_words
from cdpr_drake.commands.kernels import compilation_announced
from cdpr_drake.commands.place import in_words, place
from cdpr_drake.commands.terminal import print_wrapped
from cdpr_drake.errors import CdprError
from cdpr_drake.show.explorer import Explorer
from cdpr_drake.study import default_gain

PORTS = (1024, 65534)
"""From the first to the last that may be asked for: the next one has to be there too."""


def explore_command(options: argparse.Namespace) -> int:
    """Carry out `cdpr-drake explore` and return the exit status.

    Args:
        options: the parsed arguments.

    Raises:
        UsageError: the input cannot be used; nothing was served.
    """
    first, last = PORTS
    if options.port and not first <= options.port <= last:
        raise UsageError(f"--port: from {first} to {last}, or 0 for any, got {options.port}")
    if not (math.isfinite(options.idle) and options.idle >= 0.0):
        raise UsageError(f"--idle: must be 0 or more and finite, got {options.idle:g} s")
    try:
        robot, pose, where = place(options)
        with compilation_announced():
            gain, chosen = options.gain, None
            if gain is None:
                timing = robot.cameras.sample_time, robot.cameras.latency
                chosen = default_gain(robot, pose, options.cable_model, *timing)
                gain = chosen.gain
            explorer = Explorer(robot, pose, options.cable_model, gain, options.port)
    except (CdprError, ValueError) as error:
        raise UsageError(str(error)) from error
    except (OSError, RuntimeError) as error:
        raise UsageError(f"--port {options.port}: {error}") from error
    try:
        why = gain_in_words(gain, chosen, "there") if chosen and chosen.reason() else ""
        print_wrapped(f"{in_words(robot, pose, where)}{f'; {why}' if why else ''}.")
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
