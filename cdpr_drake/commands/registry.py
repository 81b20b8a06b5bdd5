"""The commands there are: those of this package, and those that installed packages add.

A package adds a command by one file that makes a `Command`, and an entry point that names it:

    [project.entry-points."cdpr_drake.commands"]
    weigh = "my_package.weigh:COMMAND"
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import EntryPoint, entry_points

from cdpr_drake.commands import Command, UsageError
from cdpr_drake.commands.terminal import PROGRAM

GROUP = "cdpr_drake.commands"
"""Group of the entry points, and where the commands of this package are."""

BUILT_IN = (
    "run",
    "linearize",
    "stability",
    "coupling",
    "explore",
    "calibrate",
    "sweep",
    "ablate",
    "pulleys",
    "robots",
)
"""Each a module here, in the order of the list of commands."""

ELSEWHERE = {
    "reproduce": "the reproduction is an application of the source checkout: make reproduce",
}
"""What is no command, though its name may be looked for among them, and where it is."""


def find_command(name: str) -> Command:
    """Return a command, and import no other.

    Args:
        name: as on the command line.

    Raises:
        UsageError: there is none, or it cannot be imported.
    """
    if name in BUILT_IN:
        return _built_in(name)
    others = _added()
    if name not in others:
        message = f"argument COMMAND: invalid choice: {name!r}"
        if name in ELSEWHERE:
            raise UsageError(f"{message}; {ELSEWHERE[name]}")
        known = ", ".join((*BUILT_IN, *others))
        raise UsageError(f"{message}; commands are {known} (try {PROGRAM} --help)")
    return _load(others[name])


def built_in_commands() -> dict[str, Command]:
    """Return the commands of this package by their names."""
    return {name: _built_in(name) for name in BUILT_IN}


def added_commands() -> Iterator[tuple[str, str, Command | UsageError]]:
    """Yield name, package and command of what other packages add, or why one cannot be used."""
    for name, entries in _added().items():
        try:
            yield name, _package(entries[0]), _load(entries)
        except UsageError as error:
            yield name, _package(entries[0]), error


def _built_in(name: str) -> Command:
    command: Command = EntryPoint(name, f"{GROUP}.{name}:COMMAND", GROUP).load()
    return command


def _added() -> dict[str, list[EntryPoint]]:
    """Return the entry points of other packages by their names; a name may be there twice."""
    found: dict[str, list[EntryPoint]] = {}
    for entry in sorted(entry_points(group=GROUP), key=lambda e: (e.name, _package(e))):
        found.setdefault(entry.name, []).append(entry)
    return found


def _package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else "a package without a name"


def _load(entries: list[EntryPoint]) -> Command:
    """Return the command of a name's entry points, which have to be one."""
    entry, packages = entries[0], ", ".join(map(_package, entries))
    what = f"command {entry.name} of {packages}"
    if len(entries) > 1 or entry.name in BUILT_IN:
        raise UsageError(f"{what}: there is another of this name")
    try:
        command = entry.load()
    except (Exception, SystemExit) as error:  # whatever a file may raise while it is imported
        reason = f"{type(error).__name__}: {error}"
        raise UsageError(f"{what}: {entry.value} cannot be imported ({reason})") from error
    if not isinstance(command, Command):
        raise UsageError(f"{what}: {entry.value} is no Command")
    return command
