"""The command line, a file each for its commands, and what a command is.

An application of one command makes its `Command` and calls `run_command`. Importing this imports no
robot: what else it offers is loaded when first asked for.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cdpr_drake.commands.execution import run_command
    from cdpr_drake.commands.files import DOTS_PER_INCH, staged, to_json
    from cdpr_drake.commands.terminal import CaseProgress, print_message, print_wrapped

__all__ = [
    "DOTS_PER_INCH",
    "EXIT_STATUS",
    "CaseProgress",
    "Command",
    "UsageError",
    "print_message",
    "print_wrapped",
    "run_command",
    "staged",
    "to_json",
]

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


def __getattr__(name: str) -> Any:
    """Import what this offers by `name` when first asked for."""
    if name in __all__:
        from cdpr_drake.commands import execution, files, terminal

        return next(
            vars(place)[name] for place in (execution, files, terminal) if name in vars(place)
        )
    raise AttributeError(f"module 'cdpr_drake.commands' has no attribute '{name}'")
