"""Carrying out a command: its exit status, and what went wrong in one line."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence

from cdpr_drake.commands import Command, UsageError
from cdpr_drake.commands.parsing import Call, parse_for
from cdpr_drake.commands.terminal import print_message, warnings_on_one_line


def run_command(command: Command, program: str, argv: Sequence[str] | None = None) -> int:
    """Carry out an application that is one command, and return its exit status.

    Args:
        command: the command.
        program: what users type to call it.
        argv: its arguments; those of the process if None.

    Raises:
        SystemExit: after --help.
    """
    given = sys.argv[1:] if argv is None else argv
    return carry_out(lambda: parse_for(command, program, given))


def carry_out(parsed: Callable[[], Call]) -> int:
    """Carry out a command and return its exit status, what went wrong in one line on stderr.

    Args:
        parsed: returns the command and its options.
    """
    try:
        command, options = parsed()
        with warnings_on_one_line():
            status = command.work(options)
        sys.stdout.flush()
        return status
    except UsageError as error:
        print_message(f"error: {error}")
        return 2
    except KeyboardInterrupt:
        print_message("interrupted, nothing written")
        return 130
    except BrokenPipeError:  # whoever read the output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
