"""`cdpr-drake reproduce`: the paper's tables and figures made again, in a report."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cdpr_drake.commands.answer import DOTS_PER_INCH
from cdpr_drake.commands.arguments import UsageError
from cdpr_drake.commands.files import staged, to_json
from cdpr_drake.commands.terminal import CaseProgress, print_wrapped, say
from cdpr_drake.errors import SweepError
from cdpr_drake.experiments.reproduction.registry import reproductions
from cdpr_drake.experiments.reproduction.reproduce import Reproduced, report_of, reproduce
from cdpr_drake.experiments.reproduction.section import Reproduction
from cdpr_drake.experiments.reproduction.words import count_of_claims, verdict, what_else

CASES = "cases"
"""Folder in the output's with what has been computed."""

INDENT = " " * len("  agrees  ")


def reproduce_command(
    options: argparse.Namespace, known: Mapping[str, Reproduction] | None = None
) -> int:
    """Carry out `cdpr-drake reproduce` and return the exit status.

    Args:
        options: the parsed arguments.
        known: what can be made again, by name; the paper's tables and figures if None.

    Raises:
        UsageError: the input cannot be used; nothing was run or written.
    """
    wanted = _wanted(options.only, reproductions() if known is None else known)
    directory = options.output or Path("out") / "reproduction"
    progress = CaseProgress()
    try:
        (directory / CASES).mkdir(parents=True, exist_ok=True)
        found, cpu_time = reproduce(wanted, directory / CASES, jobs=options.jobs, progress=progress)
    except KeyboardInterrupt:
        progress.done()
        say(f"interrupted; what is done is in {directory}, and the same command goes on from there")
        return 130
    except OSError as error:
        raise UsageError(f"--output {directory}: {error.strerror or error}") from error
    except SweepError as error:
        say(f"error: {error}")
        return 1
    progress.done()
    report = report_of(found, cpu_time)
    try:
        with staged(directory) as folder:
            files = _write(folder, report, found)
    except OSError as error:
        raise UsageError(f"--output {directory}: {error.strerror or error}") from error
    if options.json:
        print(to_json(report))
    else:
        _print(report)
        print_wrapped(f"In {directory}: {', '.join(files)}", indent="    ")
    return 1 if any(part.errors for part in found) else 0


def _wanted(
    names: Sequence[str] | None, known: Mapping[str, Reproduction]
) -> dict[str, Reproduction]:
    unknown = [name for name in names or () if name not in known]
    if unknown:
        raise UsageError(f'--only: no "{unknown[0]}"; there are {", ".join(known)}')
    return {name: part for name, part in known.items() if not names or name in names}


def _write(folder: Path, report: dict[str, Any], found: Sequence[Reproduced]) -> list[str]:
    """Write the report and the figures, and return the names of the files."""
    from cdpr_drake.show.paper_figures import paper_figure
    from cdpr_drake.show.report import report_html

    figures = {part.name: part.section.figures for part in found if part.section is not None}
    (folder / "report.html").write_text(report_html(report, figures), encoding="utf-8")
    text = json.dumps(report, indent=1, allow_nan=False, ensure_ascii=False)
    (folder / "report.json").write_text(text + "\n", encoding="utf-8")
    for name, drawn in figures.items():
        for number, figure in enumerate(drawn):
            file = f"{name}.png" if number == 0 else f"{name}-{number + 1}.png"
            paper_figure(figure).savefig(folder / file, dpi=DOTS_PER_INCH)
    first = ["report.html", "report.json"]
    return first + sorted(file.name for file in folder.iterdir() if file.name not in first)


def _print(report: Mapping[str, Any]) -> None:
    """Print a summary: each claim, the paper's number and ours, and what it could have been."""
    for section in report["sections"]:
        print()
        print_wrapped(section["title"])
        for key, (kind, message) in section["errors"].items():
            print_wrapped(f"  failed  {key}: {kind}: {message}", indent=INDENT)
        for claim in section["claims"]:
            print_wrapped(f"  {verdict(claim)}  {claim['text']}", indent=INDENT)
            numbers = f"paper: {claim['printed']}; here: {claim['ours']}"
            print_wrapped(f"{INDENT}{numbers}", indent=INDENT)
            print_wrapped(f"{INDENT}{claim['kind']}; {what_else(claim)}", indent=INDENT)
    print()
    minutes = report["cpu_time_s"] / 60.0
    print_wrapped(f"{count_of_claims(report)} {minutes:.1f} minutes of processor time.")
    sys.stdout.flush()
