"""What a command that answers a question leaves: a summary and figures, all of them or nothing."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from cdpr_drake import __version__
from cdpr_drake.commands.command import UsageError
from cdpr_drake.commands.files import SUMMARY, staged, to_json, write_summary
from cdpr_drake.commands.terminal import REDRAW_PERIOD, print_wrapped

if TYPE_CHECKING:
    from matplotlib.figure import Figure

T = TypeVar("T")
Figures = Callable[[], Mapping[str, "Figure"]]

DOTS_PER_INCH = 100


def counted(items: Sequence[T], what: str) -> Iterator[T]:
    """Yield items with their count on stderr: rewritten on a terminal, one line at the end else.

    Args:
        items: the items.
        what: they are, in the plural.
    """
    begun = drawn = time.monotonic()
    on_terminal = sys.stderr.isatty()
    for i, item in enumerate(items):
        now = time.monotonic()
        if on_terminal and (i == 0 or now - drawn >= REDRAW_PERIOD):
            drawn = now
            print(f"\r{i} of {len(items)} {what}", end="", file=sys.stderr, flush=True)
        yield item
    start = "\r" if on_terminal else ""
    took = time.monotonic() - begun
    print(
        f"{start}{len(items)} of {len(items)} {what} in {took:.1f} s", file=sys.stderr, flush=True
    )


def write_answer(
    options: argparse.Namespace,
    name: str,
    summary: dict[str, Any],
    lines: Iterable[str],
    figures: Figures,
    texts: Mapping[str, str] | None = None,
) -> int:
    """Write summary and figures, print the answer or its JSON, and return the exit status.

    Args:
        options: with output, json and no_figures.
        name: of the directory, if the options do not say.
        summary: plain values; gains "cdpr_drake", "drake" and "files".
        lines: of the answer.
        figures: makes the figures, by the names of their files without ".png".
        texts: other files, by their names.

    Raises:
        UsageError: the directory cannot be used.
    """
    directory = options.output or Path("out") / name
    summary = {**summary, "cdpr_drake": __version__, "drake": version("drake"), "files": [SUMMARY]}
    try:
        with staged(directory) as folder:
            if not options.no_figures:
                for file, figure in figures().items():
                    figure.savefig(folder / f"{file}.png", dpi=DOTS_PER_INCH)
                    summary["files"].append(f"{file}.png")
            for file, text in (texts or {}).items():
                (folder / file).write_text(text, encoding="utf-8")
                summary["files"].append(file)
            write_summary(folder / SUMMARY, summary)
    except OSError as error:
        raise UsageError(f"--output {directory}: {error.strerror or error}") from error
    if options.json:
        print(to_json(summary))
        return 0
    for line in lines:
        print(line)
    print_wrapped(f"In {directory}: {', '.join(summary['files'])}", indent="    ")
    return 0
