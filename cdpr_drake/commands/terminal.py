"""What goes to the terminal: one-line messages, a progress bar, tables no wider than the screen."""

from __future__ import annotations

import contextlib
import os
import sys
import textwrap
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any, TextIO, TypeVar

T = TypeVar("T")

PROGRAM = "cdpr-drake"

REDRAW_PERIOD = 0.1
"""Shortest time between two drawings of a progress bar [s]."""


def print_message(message: str) -> None:
    """Print a `message` on one line of stderr, after the name of the program."""
    print(f"{PROGRAM}: {' '.join(message.split())}", file=sys.stderr, flush=True)


def width_of(stream: TextIO) -> int:
    """Return how many columns a `stream` shows: COLUMNS, else the terminal's, else 80."""
    with contextlib.suppress(ValueError, KeyError):
        if (columns := int(os.environ["COLUMNS"])) > 0:
            return columns
    with contextlib.suppress(OSError, ValueError, AttributeError):
        return os.get_terminal_size(stream.fileno()).columns or 80
    return 80


def print_wrapped(text: str, indent: str = "") -> None:
    """Print a `text` on stdout, no wider than the screen, lines but the first after an `indent`."""
    print(paragraph(text, indent), flush=True)


def paragraph(text: str, indent: str = "") -> str:
    """Return a `text` in lines no wider than the screen, all but the first after an `indent`."""
    return "\n".join(wrapped(text, indent))


def wrapped(text: str, indent: str = "") -> list[str]:
    """Return the lines of `paragraph` for a `text` and an `indent`."""
    width = max(width_of(sys.stdout), 20)
    return textwrap.wrap(text, width, subsequent_indent=indent, break_on_hyphens=False)


def fitted_table(columns: Sequence[Column]) -> str:
    """Return a table of those of the `columns` that fit the screen, as text."""
    return table(fitting(columns, width_of(sys.stdout)))


@contextlib.contextmanager
def warnings_on_one_line() -> Iterator[None]:
    """Print this package's warnings on one line of stderr each, and each only once."""
    from cdpr_drake.analysis.stability import StabilityWarning
    from cdpr_drake.diagrams.step import StepWarning
    from cdpr_drake.model.robot import RobotFileWarning

    ours = (RobotFileWarning, StabilityWarning, StepWarning)
    seen: set[str] = set()
    with warnings.catch_warnings():
        others = warnings.showwarning

        def show(message: Any, category: Any, *args: Any, **kwargs: Any) -> None:
            if not issubclass(category, ours):
                others(message, category, *args, **kwargs)
            elif str(message) not in seen:
                seen.add(str(message))
                print_message(f"warning: {message}")

        for category in ours:
            warnings.simplefilter("always", category)
        warnings.showwarning = show
        yield


class Progress:
    """The progress of one run on stderr: a bar on a terminal, one line at the end elsewhere.

    Args:
        label: of the run.
        until: when the run ends [s].
        label_width: columns the labels of all runs take.
    """

    def __init__(self, label: str, until: float, label_width: int = 0) -> None:
        self._label, self._until = label.ljust(label_width), until
        self._drawn_at = -REDRAW_PERIOD
        self._begun = time.monotonic()

    def __call__(self, now: float) -> None:
        """Show that the run has come to the time `now` [s]."""
        clock = time.monotonic()
        if not sys.stderr.isatty() or clock - self._drawn_at < REDRAW_PERIOD:
            return
        self._drawn_at = clock
        end = f"{self._until:g}"
        counter = f"{now:{len(end)}.0f} of {end} s"
        bar = _bar(now / self._until, len(self._label) + len(counter) + 7)
        _draw(f"{self._label}  {bar}{counter}")

    def done(self, factor: float) -> None:
        """Replace the bar by a last line, with how many times real time the run went: `factor`."""
        took = time.monotonic() - self._begun
        _draw(f"{self._label}  {self._until:g} s in {took:.1f} s, {factor:.1f} x real time", "\n")

    def clear(self) -> None:
        """Take the bar away."""
        if sys.stderr.isatty():
            _draw("", "\r")


class CaseProgress:
    """The progress of a sweep on stderr: a bar on a terminal, one line at the end elsewhere."""

    def __init__(self) -> None:
        self._begun = time.monotonic()
        self._resumed: int | None = None
        self._counts = (0, 0)

    def __call__(self, done: int, total: int) -> None:
        """Show how many cases are done.

        Args:
            done: so many.
            total: of so many.
        """
        self._counts = (done, total)
        if self._resumed is None:
            self._resumed = done
        if sys.stderr.isatty():
            counter = f"{done:{len(str(total))}} of {total} cases  {self._took()}"
            _draw(f"{_bar(done / max(total, 1), len(counter) + 6)}{counter}")

    def done(self) -> None:
        """Replace the bar by a last line."""
        done, total = self._counts
        earlier = f", {self._resumed} of them earlier" if self._resumed else ""
        _draw(f"{done} of {total} cases{earlier}, in {self._took()}", "\n")

    def _took(self) -> str:
        return f"{time.monotonic() - self._begun:.0f} s"


def counted(items: Sequence[T], what: str) -> Iterator[T]:
    """Yield items with their count on stderr: rewritten on a terminal, one line at the end else.

    Args:
        items: the items.
        what: they are, in the plural.
    """
    begun, drawn = time.monotonic(), -REDRAW_PERIOD
    for i, item in enumerate(items):
        now = time.monotonic()
        if sys.stderr.isatty() and now - drawn >= REDRAW_PERIOD:
            drawn = now
            _draw(f"{i} of {len(items)} {what}")
        yield item
    took = time.monotonic() - begun
    _draw(f"{len(items)} of {len(items)} {what} in {took:.1f} s", "\n")


def _bar(share: float, taken: int) -> str:
    """Return a bar for what is left of the screen, "" if that is too little."""
    room = width_of(sys.stderr) - taken
    if room < 5:
        return ""
    done = min(int(room * share), room)
    return f"[{'#' * done}{'.' * (room - done)}]  "


def _draw(line: str, end: str = "") -> None:
    """Write a line on stderr, on a terminal over the one before."""
    if sys.stderr.isatty():
        width = width_of(sys.stderr) - 1
        line = f"\r{line[:width]:<{width}}"
    print(line, end=end, file=sys.stderr, flush=True)


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        heading: two lines, the second e.g. a unit.
        cells: one for each row.
        rank: the higher, the sooner the column is left out on a narrow screen; 0 stays.
        to_the_left: whether cells are aligned to the left.
        meaning: a sentence on it, for below the table.
    """

    heading: tuple[str, str]
    cells: Sequence[str]
    _: KW_ONLY
    rank: int = 0
    to_the_left: bool = False
    meaning: str = ""

    @property
    def width(self) -> int:
        """Columns of the screen it takes."""
        return max(map(len, (*self.heading, *self.cells)))


def fitting(columns: Sequence[Column], width: int) -> list[Column]:
    """Return the columns without those that a table no wider than the screen has to leave out.

    Args:
        columns: the columns.
        width: of the screen.
    """
    kept = list(columns)
    while sum(c.width + 2 for c in kept) - 2 > width:
        least = max(kept, key=lambda c: c.rank)
        if least.rank == 0:
            break
        kept.remove(least)
    return kept


def table(columns: Sequence[Column]) -> str:
    """Return a table as text.

    Args:
        columns: the columns.
    """
    rows = zip(*((*c.heading, *c.cells) for c in columns), strict=True)
    return "\n".join(
        "  ".join(
            f"{cell:{'<' if c.to_the_left else '>'}{c.width}}"
            for c, cell in zip(columns, row, strict=True)
        ).rstrip()
        for row in rows
    )
