"""`python -m reproduction`: the paper's tables and figures made again, in a report."""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cdpr_drake.commands import (
    DOTS_PER_INCH,
    CaseProgress,
    Command,
    UsageError,
    print_message,
    print_wrapped,
    run_command,
    staged,
    to_json,
)

if TYPE_CHECKING:
    from reproduction.reproduce import Reproduced
    from reproduction.section import Reproduction

CASES = "cases"
"""Folder in the output's with what has been computed."""

INDENT = " " * len("  agrees  ")


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("--only", nargs="+", action="extend", metavar="NAME",
                        help="some of it, e.g. table4 figure13; an unknown name lists all "
                        "(default: all)")  # fmt: skip
    parser.add_argument("--jobs", type=_count, metavar="N",
                        help="processes (default: as many as cores)")  # fmt: skip
    parser.add_argument("--output", type=Path, metavar="DIR",
                        help="where report.html, report.json and figures go (default: "
                        "out/reproduction)")  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print report.json, nothing else")


def _reproduce(options: Namespace) -> int:
    from cdpr_drake.errors import SweepError
    from reproduction.registry import reproductions
    from reproduction.reproduce import report_of, reproduce

    wanted = _wanted(options.only, reproductions())
    directory = options.output or Path("out") / "reproduction"
    progress = CaseProgress()
    try:
        (directory / CASES).mkdir(parents=True, exist_ok=True)
        found, cpu_time = reproduce(wanted, directory / CASES, jobs=options.jobs, progress=progress)
    except KeyboardInterrupt:
        progress.done()
        print_message(
            f"interrupted; what is done is in {directory}, and the same command goes on from there"
        )
        return 130
    except OSError as error:
        raise UsageError(f"--output {directory}: {error.strerror or error}") from error
    except SweepError as error:
        print_message(f"error: {error}")
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


COMMAND = Command(
    summary="make the paper's tables and figures again, with what it prints beside",
    description="Run the experiments and simulations of Dallej et al. 2019, Tables 4 to 7 and "
    "Figures 10 to 16, and write a report: each of the paper's numbers and claims beside ours. "
    "What an earlier, even an interrupted, run of the same source has computed is not computed "
    "again.",
    example="--only table4 figure13",
    add_arguments=_add_arguments,
    work=_reproduce,
    exit_status="0, done, whether or not all claims agree; 1, a case failed; 2, the input cannot "
    "be used; 130, interrupted: the same command goes on from there.",
)


def _count(text: str) -> int:
    try:
        number = int(text)
    except ValueError:
        number = 0
    if number < 1:
        raise ArgumentTypeError(f"{text!r} is no number of processes")
    return number


def _wanted(
    names: Sequence[str] | None, known: Mapping[str, Reproduction]
) -> dict[str, Reproduction]:
    unknown = [name for name in names or () if name not in known]
    if unknown:
        raise UsageError(f'--only: no "{unknown[0]}"; there are {", ".join(known)}')
    return {name: part for name, part in known.items() if not names or name in names}


def _write(folder: Path, report: dict[str, Any], found: Sequence[Reproduced]) -> list[str]:
    """Write the report and the figures, and return the names of the files."""
    from reproduction.report.page import report_html
    from reproduction.report.pictures import paper_figure

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
    from reproduction.report.words import count_of_claims, verdict, what_else

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


def main(argv: Sequence[str] | None = None) -> int:
    """Carry out a command line and return its exit status.

    Args:
        argv: the arguments; those of the process if None.

    Raises:
        SystemExit: after --help.
    """
    return run_command(COMMAND, "python -m reproduction", argv)


if __name__ == "__main__":
    sys.exit(main())
