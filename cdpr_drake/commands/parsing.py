"""From a command line to a command and its options, and what --help says."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from typing import NamedTuple, NoReturn

from cdpr_drake import __version__
from cdpr_drake.commands import EXIT_STATUS, Command, UsageError
from cdpr_drake.commands.registry import added_commands, built_in_commands, find_command
from cdpr_drake.commands.terminal import PROGRAM, paragraph, print_message


class Call(NamedTuple):
    """A command and what is asked of it.

    Attributes:
        command: the command.
        options: its parsed arguments.
    """

    command: Command
    options: argparse.Namespace


class _Parser(argparse.ArgumentParser):
    """A parser that raises, so that an error is one line wherever it comes from."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message} (try {self.prog} --help)")


def parse(argv: Sequence[str]) -> Call:
    """Return the command that a command line names, and its options.

    Args:
        argv: the arguments, without the program's name.

    Raises:
        UsageError: they do not make sense.
        SystemExit: after --help and --version, and after the list of commands if none is named.
    """
    name, *rest = argv or ["--help"]
    if name.startswith("-"):
        _program_parser(with_list=name in ("-h", "--help")).parse_args(argv or ["--help"])
        raise UsageError(f"no command (try {PROGRAM} --help)")
    return parse_for(find_command(name), f"{PROGRAM} {name}", rest)


def parse_for(command: Command, program: str, argv: Sequence[str]) -> Call:
    """Return a command and its options.

    Args:
        command: the command.
        program: what users type to call it.
        argv: its arguments.

    Raises:
        UsageError: they do not make sense.
        SystemExit: after --help.
    """
    parser = _parser(
        program,
        command.description,
        [f"Example:\n  {program} {command.example}".rstrip()],
        command.exit_status,
    )
    command.add_arguments(parser)
    return Call(command, parser.parse_args(_attach_negative_values(argv)))


def _program_parser(with_list: bool) -> _Parser:
    """Return the parser of what comes before a command."""
    parser = _parser(
        PROGRAM,
        "Vision-based control of cable-driven parallel robots with sagging cables.",
        [
            *([_list_of_commands()] if with_list else []),
            paragraph(f"{PROGRAM} COMMAND --help tells a command's arguments, with an example."),
        ],
        EXIT_STATUS,
    )
    parser.usage = f"{PROGRAM} [-h] [--version] COMMAND ..."
    parser.add_argument("--version", action="version", version=f"{PROGRAM} {__version__}")
    return parser


def _parser(program: str, description: str, paragraphs: list[str], exit_status: str) -> _Parser:
    """Return a parser whose help ends with some paragraphs, their lines broken as they are."""
    return _Parser(
        prog=program,
        description=paragraph(description),
        epilog="\n\n".join((*paragraphs, paragraph(f"Exit status: {exit_status}"))),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )


def _list_of_commands() -> str:
    """Return the list of commands; say on stderr which of them cannot be used."""
    summaries = {name: command.summary for name, command in built_in_commands().items()}
    added = {}
    for name, package, command in added_commands():
        if isinstance(command, Command):
            added[name] = f"{command.summary} ({package})"
        else:
            print_message(f"warning: {command}")
    width = max(map(len, (*summaries, *added)))

    def lines(rows: dict[str, str]) -> str:
        return "\n".join(paragraph(f"  {n:{width}}  {rows[n]}", " " * (width + 4)) for n in rows)

    listed = f"commands:\n{lines(summaries)}"
    return f"{listed}\n\ncommands of other packages:\n{lines(added)}" if added else listed


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
