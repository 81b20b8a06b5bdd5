"""`cdpr-drake run`: one move under several controllers, compared and written down."""

from __future__ import annotations

import argparse
import contextlib
import logging
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import cdpr_drake
from cdpr_drake.commands.arguments import UsageError
from cdpr_drake.commands.files import SUMMARY, staged, to_json, write_log, write_summary
from cdpr_drake.commands.kernels import compilation_announced
from cdpr_drake.commands.terminal import Column, Progress, print_wrapped, say, table, width_of
from cdpr_drake.errors import CdprError
from cdpr_drake.experiments import Prepared, Run, Setup, paper_test, prepare, run
from cdpr_drake.experiments.moves import move_near_the_middle
from cdpr_drake.experiments.paper_tests import paper_tests
from cdpr_drake.model.cable_models import CABLE_MODELS
from cdpr_drake.model.robot import load_robot
from cdpr_drake.model.servo import pose_error

DEFAULT_TEST = 4
DEFAULT_MODELS = ("SCMWE", "SLSM")

LEGEND = (
    "Final error: true pose against the goal, mean of the last second; seen: as the controller "
    "measures it. To 2 %: when the position error fell below 2 % of the first to stay. Strays: "
    "farthest from the straight way to the goal. Tension: lowest and highest at the drawing points."
)


def run_command(options: argparse.Namespace) -> int:
    """Carry out `cdpr-drake run` and return the exit status.

    Args:
        options: the parsed arguments.

    Raises:
        UsageError: the input cannot be used; nothing was run or written.
    """
    try:
        name, setups = plan(options)
        with compilation_announced():
            ready = [prepare(setup) for setup in setups]
    except (CdprError, ValueError) as error:
        raise UsageError(str(error)) from error
    warn_of_low_tensions(ready)
    directory = options.output or Path("out") / name
    if not options.json:
        print_wrapped(describe(name, setups[0]))
    try:
        with contextlib.ExitStack() as stack:
            try:
                folder = stack.enter_context(staged(directory))
            except OSError as error:
                raise UsageError(f"--output {directory}: {error.strerror or error}") from error
            runs = carry_out(ready)
            summary = summarize(name, setups[0], runs)
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


# --- before the runs


def plan(options: argparse.Namespace) -> tuple[str, list[Setup]]:
    """Return a name for what the options ask for, and the setups of its runs.

    Args:
        options: the parsed arguments.

    Raises:
        CdprError, ValueError: they cannot be used.
    """
    robot = load_robot(options.robot if options.robot is not None else paper_tests().robot)
    number = options.test
    if number is None and robot.name == paper_tests().robot:
        number = DEFAULT_TEST
    values: dict[str, Any] = {
        "sample_time": robot.cameras.sample_time,
        "latency": robot.cameras.latency,
        "noise": not options.no_noise,
        "seed": options.seed,
    }
    if number is not None:
        test = paper_test(number)
        robot = test.carried_by(robot) if options.payload is None else robot
        values["start"], values["goal"] = test.poses(robot)
        values["gain"], values["until"] = test.gain, test.duration
    else:
        values["start"], values["goal"] = move_near_the_middle(robot)
    if options.payload is not None:
        robot = robot.with_payload(options.payload)
    for field in ("start", "goal", "gain", "latency", "sample_time", "until"):
        given = getattr(options, field)
        if given is not None:
            values[field] = given
    if values["sample_time"] == 0.0:
        values["sample_time"] = None

    setups = []
    if options.controller in ("vbc", "both"):
        models = dict.fromkeys(options.cable_model or DEFAULT_MODELS)
        setups += [Setup(robot=robot, cable_model=m, **values) for m in models]
    elif options.cable_model:
        known = ", ".join(CABLE_MODELS)
        raise ValueError(f"--cable-model ({known}) is VBC's; it has no meaning with JSC alone")
    if options.controller in ("jsc", "both"):
        setups.append(Setup(robot=robot, controller="JSC", **values))
    is_test = number is not None and options.start is None and options.goal is None
    name = f"test-{number}" if is_test else re.sub(r"[^\w.-]+", "-", robot.name).strip(".-")
    return name or "run", setups


def warn_of_low_tensions(ready: Sequence[Prepared]) -> None:
    """Warn on stderr of runs that start with a cable below the robot's lower tension limit.

    Args:
        ready: the runs.
    """
    said: dict[str, list[str]] = {}
    for prepared in ready:
        tension = prepared.tension_at_drawing_point()
        cable = int(np.argmin(tension))
        limit = prepared.setup.robot.cable.min_tension
        if tension[cable] < limit:
            text = (
                f"with cable {cable + 1} at {tension[cable]:.0f} N, below the robot's {limit:g} N"
            )
            said.setdefault(text, []).append(prepared.setup.label)
    for text, labels in said.items():
        say(f"warning: {', '.join(labels)}: starts {text}")


def describe(name: str, setup: Setup) -> str:
    """Return in words what the runs have in common.

    Args:
        name: of what is run.
        setup: of one of the runs.
    """
    s = pose_error(setup.start, setup.goal, setup.robot.cameras.X_PM)
    turn, way = np.degrees(np.linalg.norm(s[:3])), np.linalg.norm(s[3:])
    what = f"Test {name[5:]} of the paper" if name.startswith("test-") else "A move"
    loop = "a continuous loop"
    if setup.sample_time is not None:
        loop = f"{1.0 / setup.sample_time:g} Hz with {1e3 * setup.latency:g} ms of latency"
    noise = f"noise with seed {setup.seed}" if setup.noise else "no noise"
    return (
        f"{what} on {setup.robot.name}, {setup.robot.mass:g} kg: {way:.2f} m and {turn:.1f} deg in "
        f"{setup.until:g} s, lambda = {setup.gain:g} 1/s, {loop}, {noise}."
    )


# --- the runs


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


# --- after the runs


def summarize(name: str, setup: Setup, runs: Sequence[Run]) -> dict[str, Any]:
    """Return what the runs had in common and what came of each, as plain values.

    Args:
        name: of what was run.
        setup: of one of the runs.
        runs: all of them.
    """
    from importlib.metadata import version

    def pose(X: Any) -> list[float]:
        angles = np.degrees(X.rotation().ToRollPitchYaw().vector())
        return [*X.translation().tolist(), *angles.tolist()]

    return {
        "name": name,
        "cdpr_drake": cdpr_drake.__version__,
        "drake": version("drake"),
        "robot": setup.robot.name,
        "mass_kg": setup.robot.mass,
        "payload_kg": setup.robot.payload.mass,
        "start_x_y_z_m_roll_pitch_yaw_deg": pose(setup.start),
        "goal_x_y_z_m_roll_pitch_yaw_deg": pose(setup.goal),
        "gain_per_s": setup.gain,
        "sample_time_s": setup.sample_time,
        "latency_s": setup.latency,
        "noise": setup.noise,
        "seed": setup.seed,
        "runs": {r.setup.label: _outcome(r) for r in runs},
    }


def _outcome(result: Run) -> dict[str, Any]:
    setup = result.setup
    head = {"controller": setup.controller, "cable_model": setup.cable_model}
    return {**head, **result.summary.to_dict()}


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


def print_results(runs: Sequence[Run]) -> None:
    """Print a table of the runs, and what needs a word besides, on stdout.

    Args:
        runs: the runs.
    """
    results = [r.summary for r in runs]

    def cells(attribute: str, digits: int) -> list[str]:
        values = [getattr(summary, attribute) for summary in results]
        return ["-" if value is None else f"{value:.{digits}f}" for value in values]

    tensions = [f"{s.lowest_tension:.0f}-{s.highest_tension:.0f}" for s in results]
    columns = [
        Column(heading=("", "run"), cells=[r.setup.label for r in runs], to_the_left=True),
        Column(heading=("final", "mm"), cells=cells("position_error", 1)),
        Column(heading=("error", "deg"), cells=cells("orientation_error", 3)),
        Column(heading=("seen", "mm"), cells=cells("position_error_seen", 1), rank=4),
        Column(heading=("", "deg"), cells=cells("orientation_error_seen", 3), rank=5),
        Column(heading=("to 2 %", "s"), cells=cells("settled_after", 1)),
        Column(heading=("strays", "mm"), cells=cells("position_excursion", 1), rank=1),
        Column(heading=("", "deg"), cells=cells("orientation_excursion", 2), rank=3),
        Column(heading=("tension", "N"), cells=tensions, rank=2),
    ]
    print()
    print(table(columns, width_of(sys.stdout)))
    print()
    print_wrapped(LEGEND)
    for r in runs:
        for cable, time in sorted(r.summary.slack_cables.items()):
            print_wrapped(f"{r.setup.label}: cable {cable} went slack at {time:.1f} s")
