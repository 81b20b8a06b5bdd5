"""The command line, `cdpr-drake` or `python -m cdpr_drake`: arguments, dispatch, exit status."""

from __future__ import annotations

import os
import sys
from argparse import Namespace
from collections.abc import Sequence

from cdpr_drake.commands.arguments import UsageError, parse


def main(argv: Sequence[str] | None = None) -> int:
    """Carry out a command line and return its exit status, 0 if all went well.

    Args:
        argv: the arguments, without the program's name; those of the process if None.

    Raises:
        SystemExit: after --help and --version.
    """
    try:
        status = dispatch(parse(sys.argv[1:] if argv is None else argv))
        sys.stdout.flush()
        return status
    except UsageError as error:
        print(f"cdpr-drake: error: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("cdpr-drake: interrupted, nothing written", file=sys.stderr)
        return 130
    except BrokenPipeError:  # whoever read the output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def dispatch(options: Namespace) -> int:
    """Carry out the command that was asked for and return its exit status.

    Args:
        options: the parsed arguments.

    Raises:
        UsageError: the input cannot be used; nothing was run or written.
        SystemExit: after the help, if no command was given.
    """
    # Each command is imported only when it is asked for: Drake takes its time.
    if options.command is None:
        parse(["--help"])
    from cdpr_drake.commands.terminal import warnings_on_one_line

    with warnings_on_one_line():
        if options.command == "robots":
            from cdpr_drake.commands.robots import list_robots

            return list_robots()
        if options.command == "linearize":
            from cdpr_drake.commands.linearize import linearize_command

            return linearize_command(options)
        if options.command == "stability":
            from cdpr_drake.commands.stability import stability_command

            return stability_command(options)
        if options.command == "coupling":
            from cdpr_drake.commands.coupling import coupling_command

            return coupling_command(options)
        if options.command == "explore":
            from cdpr_drake.commands.explore import explore_command

            return explore_command(options)
        if options.command == "ablate":
            from cdpr_drake.commands.ablate import ablate_command

            return ablate_command(options)
        if options.command == "calibrate":
            from cdpr_drake.commands.calibrate import calibrate_command

            return calibrate_command(options)
        if options.command == "reproduce":
            from cdpr_drake.commands.reproduce import reproduce_command

            return reproduce_command(options)
        if options.command == "sweep":
            from cdpr_drake.commands.sweep import sweep_command

            return sweep_command(options)
        from cdpr_drake.commands.run import run_command

        return run_command(options)


if __name__ == "__main__":
    sys.exit(main())
