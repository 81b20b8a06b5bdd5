"""The command line, a file each for its commands, and what a command is.

Importing this imports no robot.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from dataclasses import dataclass

EXIT_STATUS = (
    "0, done; 1, a run left what the model covers, or results could not be written; 2, the input "
    "cannot be used, and nothing was run; 130, interrupted."
)


class UsageError(Exception):
    """The input does not make sense; the message, of one line, is for the user."""


def _no_arguments(parser: ArgumentParser) -> None:
    """Add nothing to a `parser`."""


@dataclass(frozen=True, kw_only=True)
class Command:
    """A command, `cdpr-drake NAME`.

    The file that makes one imports at its top only what is quick to import, and the rest in the
    functions that work: --help imports the file, too, and shall answer at once.

    Attributes:
        summary: what it does, in the few words that the list of commands has room for.
        description: what it does, a paragraph.
        work: does what parsed arguments ask for and returns the exit status. Raises UsageError,
            before anything is written, for input that cannot be used.
        add_arguments: adds its arguments to the parser it is given; there are none without it.
        example: arguments worth trying.
        exit_status: what each status means.
    """

    summary: str
    description: str
    work: Callable[[Namespace], int]
    add_arguments: Callable[[ArgumentParser], None] = _no_arguments
    example: str = ""
    exit_status: str = EXIT_STATUS
