"""`cdpr-drake run`: one move under several controllers, compared and written down."""

from __future__ import annotations

import argparse
import contextlib
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cdpr_drake.commands.arguments import UsageError
from cdpr_drake.commands.files import SUMMARY, staged, to_json, write_log, write_summary
from cdpr_drake.commands.gain import gain_values
from cdpr_drake.commands.kernels import compilation_announced
from cdpr_drake.commands.plan import describe, plan, warn_of_low_tensions
from cdpr_drake.commands.results import print_results, summarize
from cdpr_drake.commands.terminal import Progress, print_wrapped, say
from cdpr_drake.errors import CdprError
from cdpr_drake.experiments import Prepared, Run, prepare, run


def run_command(options: argparse.Namespace) -> int:
    """Carry out `cdpr-drake run` and return the exit status.

    Args:
        options: the parsed arguments.

    Raises:
        UsageError: the input cannot be used; nothing was run or written.
    """
    try:
        with compilation_announced():
            name, setups, chosen = plan(options)
            ready = [prepare(setup) for setup in setups]
    except (CdprError, ValueError) as error:
        raise UsageError(str(error)) from error
    warn_of_low_tensions(ready)
    directory = options.output or Path("out") / name
    if not options.json:
        print_wrapped(describe(name, setups[0], chosen))
    try:
        with contextlib.ExitStack() as stack:
            try:
                folder = stack.enter_context(staged(directory))
            except OSError as error:
                raise UsageError(f"--output {directory}: {error.strerror or error}") from error
            runs = carry_out(ready)
            summary = summarize(name, setups[0], runs)
            asked = "option" if options.gain is not None else "test"
            summary |= gain_values(setups[0].gain, chosen, asked)
            write_all(folder, summary, runs, options)
    except CdprError as error:
        say(f"error: {error}; nothing written")
        return 1
    except OSError as error:
        say(f"error: {directory}: {error.strerror or error}")
        return 1
    if options.json:
        print(to_json(summary))
    else:
        print_results(runs)
        print_wrapped(f"In {directory}: {', '.join(summary['files'])}", indent="    ")
    return 0


def carry_out(ready: Sequence[Prepared]) -> list[Run]:
    """Return the runs, with their progress on stderr.

    Args:
        ready: what `prepare` made.

    Raises:
        CableError, SimulationError: a run left what the model covers.
    """
    label_width = max(len(p.setup.label) for p in ready)
    runs = []
    for prepared in ready:
        progress = Progress(prepared.setup.label, prepared.setup.until, label_width)
        try:
            result = run(prepared, progress)
        except BaseException:
            progress.clear()
            raise
        progress.done(result.summary.real_time_factor)
        runs.append(result)
    return runs


def write_all(
    folder: Path, summary: dict[str, Any], runs: Sequence[Run], options: argparse.Namespace
) -> None:
    """Write logs, figures, replay and summary, and list the files in the summary.

    Args:
        folder: where to.
        summary: as `summarize` gives it; gains "files".
        runs: the runs.
        options: the parsed arguments.

    Raises:
        OSError: a file cannot be written.
    """
    first = runs[0].setup
    records = {r.setup.label: r.record for r in runs}
    for label, record in records.items():
        write_log(folder / f"{label.lower().replace(' ', '-')}.csv", record)
    if not options.no_figures:
        from cdpr_drake.show.plots import save_figures

        save_figures(records, first.robot, folder, gain=first.gain, goal=first.goal)
    if not options.no_replay:
        logging.getLogger("drake").setLevel(logging.WARNING)  # Meshcat tells its address
        from cdpr_drake.show.replay import write_replay

        label, *others = records
        write_replay(
            folder / "replay.html",
            first.robot,
            records[label],
            first.goal,
            others={other: records[other] for other in others},
            title=label,
        )
    summary["files"] = [SUMMARY, *sorted(file.name for file in folder.iterdir())]
    write_summary(folder / SUMMARY, summary)
