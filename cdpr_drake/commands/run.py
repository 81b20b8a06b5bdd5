"""`cdpr-drake run`: one move under several controllers, compared and written down."""

from __future__ import annotations

import contextlib
import logging
import math
import re
from argparse import ArgumentParser, Namespace
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from cdpr_drake.commands import Command, UsageError
from cdpr_drake.commands import arguments as common
from cdpr_drake.commands.files import (
    Drawing,
    as_drawings,
    as_file_name,
    staged,
    to_json,
    write_log,
    write_summary,
)
from cdpr_drake.commands.resolve import (
    Move,
    gain_in_words,
    gain_values,
    input_refused,
    resolve_move,
)
from cdpr_drake.commands.results import print_results, summarize
from cdpr_drake.commands.terminal import Progress, print_message, print_wrapped
from cdpr_drake.model.digits import significant

if TYPE_CHECKING:
    from cdpr_drake.analysis import DefaultGain
    from cdpr_drake.diagrams import Timing
    from cdpr_drake.diagrams.step import Step
    from cdpr_drake.model.robot import CableRobot
    from cdpr_drake.runs import Prepared, Run, Setup

DEFAULT_MODELS = ("SCMWE", "SLSM")


def _add_arguments(parser: ArgumentParser) -> None:
    what = parser.add_argument_group("what moves, and where")
    what.add_argument("--test", type=int, metavar="N",
                      help="one of the paper's Tests 1 to 5: poses, payload, gain, time (default: "
                      "4 for CoGiRo, a short move near its middle for another robot)")  # fmt: skip
    what.add_argument("--robot", **common.ROBOT)
    what.add_argument("--payload", **common.PAYLOAD)
    common.add_ends(what)
    what.add_argument("--tensions", **common.TENSIONS)
    what.add_argument("--until", type=float, metavar="S",
                      help="time to run (default: the test's, or 80; eight time constants of a "
                      "gain that robot file or limit decide, at most 400)")  # fmt: skip
    how = parser.add_argument_group("how it is controlled")
    how.add_argument("--controller", choices=("vbc", "jsc", "both"), default="both",
                     help="vision-based, joint space control, or both (default: both); the latter "
                     "knows that cables stretch (ECM), but for the paper's tests")  # fmt: skip
    how.add_argument("--cable-model", **common.CABLE_MODELS,
                     help=f"of VBC: {common.MODELS}; one run each (default: "
                     f"{','.join(DEFAULT_MODELS)})")  # fmt: skip
    how.add_argument("--gain", type=float, metavar="PER_S",
                     help="lambda [1/s] (default: that of --test; else the robot file's; else 0.1, "
                     "or half the limit at the goal if that is less)")  # fmt: skip
    how.add_argument("--sample-time", type=float, metavar="S",
                     help="of the vision loop; 0: all continuous, no latency (default: the "
                     "robot's)")  # fmt: skip
    how.add_argument("--latency", **common.LATENCY)
    how.add_argument("--max-step", **common.MAX_STEP)
    _add_sensing(parser.add_argument_group("what the controllers see and believe"))
    out = common.add_output(parser)
    out.add_argument("--no-replay", action="store_true", help="write no replay")


def _add_sensing(what: Any) -> None:
    what.add_argument("--sensors", default="gaussian", metavar="KIND",
                      help="what VBC's cameras deliver: gaussian, the truth with noise; targets, a "
                      "pose from the patterns' points and tangents from the cables' edges; images, "
                      "the same detected in rendered images, which is slow (default: "
                      "gaussian)")  # fmt: skip
    what.add_argument("--estimator", metavar="KIND",
                      help="of the pose from targets or images: joint, over all images; mean, the "
                      "paper's (default: joint)")  # fmt: skip
    what.add_argument("--calibrated", metavar="NAME|FILE",
                      help="the robot as the controllers believe it, as `calibrate` writes it; "
                      "start and goal are the true robot's, in W (default: the true "
                      "robot)")  # fmt: skip
    what.add_argument("--no-noise", **common.NO_NOISE)
    what.add_argument("--seed", **common.SEED)


def _run(options: Namespace) -> int:
    from cdpr_drake.errors import CdprError
    from cdpr_drake.runs import prepare

    with input_refused():
        name, setups, chosen = plan(options)
        ready = [prepare(setup) for setup in setups]
    _warn_of_low_tensions(ready)
    directory = options.output or Path("out") / name
    if not options.json:
        print_wrapped(describe(name, setups[0], chosen) + steps_in_words(p.step for p in ready))
    try:
        with contextlib.ExitStack() as stack:
            try:
                folder = stack.enter_context(staged(directory))
            except OSError as error:
                raise UsageError(f"--output {directory}: {error.strerror or error}") from error
            runs = _carry_out(ready)
            summary = summarize(name, setups[0], runs)
            asked = "option" if options.gain is not None else "test"
            summary |= gain_values(setups[0].gain, chosen, asked)
            _write_all(folder, summary, runs, options)
    except CdprError as error:
        print_message(f"error: {error}; nothing written")
        return 1
    except OSError as error:
        print_message(f"error: {directory}: {error.strerror or error}")
        return 1
    if options.json:
        print(to_json(summary))
    else:
        print_results(runs)
        print_wrapped(f"In {directory}: {', '.join(summary['files'])}", indent="    ")
    return 0


COMMAND = Command(
    summary="move a robot from one pose to another under one or more controllers",
    description="Move a robot from one pose to another under vision-based control (VBC) with one "
    "or more cable models, and under joint space control (JSC); compare the runs, and write logs, "
    "a summary, figures and a replay. Without options: Test 4 of Dallej et al. 2019 on CoGiRo, "
    "with VBC on sagging (SCMWE) and on straight cables (SLSM), and with JSC.",
    example="--robot cogiro-22m --payload 50 --cable-model ECM,SLSM",
    add_arguments=_add_arguments,
    work=_run,
)


class Plan(NamedTuple):
    """What the options ask for.

    Attributes:
        name: of it.
        setups: of its runs.
        chosen: why their gain is what it is, if neither --gain nor --test says it; else None.
    """

    name: str
    setups: list[Setup]
    chosen: DefaultGain | None


def plan(options: Namespace) -> Plan:
    """Return a name for what the options ask for, and the setups of its runs.

    The runs have one gain: that of --gain, or of the test asked for by --test. Else it is the
    robot's: of its file, or `default_gain` at the goal, the lowest of the laws compared.

    Args:
        options: the parsed arguments.

    Raises:
        CdprError, ValueError: they cannot be used.
    """
    from cdpr_drake.analysis import lowest_gain
    from cdpr_drake.diagrams import JointSpaceLoop, VisionLoop
    from cdpr_drake.diagrams.sensing import SENSORS, sensing_called
    from cdpr_drake.model.cable_models import CABLE_MODELS
    from cdpr_drake.runs import make_setup

    move = resolve_move(options)
    values = _values(options, move)
    believed = None
    if options.calibrated is not None:
        believed = _believed(options.calibrated, move.robot)
    setups = []
    if options.controller in ("vbc", "both"):
        models = dict.fromkeys(options.cable_model or DEFAULT_MODELS)
        vision = VisionLoop(
            sensing=sensing_called(options.sensors, options.estimator),
            timing=_timing(options, move.robot),
            believed=believed,
        )
        setups += [make_setup(loop=vision, cable_model=m, **values) for m in models]
    elif options.cable_model:
        names = ", ".join(CABLE_MODELS)
        raise ValueError(f"--cable-model ({names}) is VBC's; it has no meaning with JSC alone")
    if options.controller in ("jsc", "both"):
        # The paper's does not know that cables stretch; elsewhere that would lose the pretension.
        joint = JointSpaceLoop(
            believed=believed, cable_model="ECM" if move.test is None else "SCMWE"
        )
        setups.append(make_setup(loop=joint, **values))
    chosen = lowest_gain(s.chosen for s in setups if s.chosen) if "gain" not in values else None
    if chosen is not None:
        setups = [_at_gain(s, chosen, options.until) for s in setups]
    is_test = move.number is not None and options.start is None and options.goal is None
    name = f"test-{move.number}" if is_test else as_file_name(move.robot.name)
    # Runs that see, believe or pull otherwise do not replace the plain one's results.
    seen = "" if options.sensors == SENSORS[0] else f"-{options.sensors}"
    known = "" if options.calibrated is None else "-calibrated"
    pulled = "" if options.tensions is None else f"-{as_file_name(options.tensions)}"
    return Plan(f"{name}{seen}{known}{pulled}", setups, chosen)


def _values(options: Namespace, move: Move) -> dict[str, Any]:
    """Return what the setups of all runs have in common."""
    values: dict[str, Any] = {
        "robot": move.robot,
        "start": move.start,
        "goal": move.goal,
        "tensions": move.tensions,
        "noise": not options.no_noise,
        "seed": options.seed,
        "max_step": options.max_step,
    }
    if move.test is not None:
        values["until"] = move.test.duration
        if options.test is not None:
            values["gain"] = move.test.gain
    for field in ("gain", "until"):
        given = getattr(options, field)
        if given is not None:
            values[field] = given
    return values


def _timing(options: Namespace, robot: CableRobot) -> Timing:
    """Return when the vision loop looks and acts."""
    from cdpr_drake.diagrams import Timing

    given = {name: getattr(options, name) for name in ("sample_time", "latency")}
    times = {name: getattr(robot.cameras, name) if t is None else t for name, t in given.items()}
    if times["sample_time"] == 0.0:
        times["sample_time"] = None
    return Timing(**times)


def _at_gain(setup: Setup, chosen: DefaultGain, until: float | None) -> Setup:
    """Return a setup with the gain of all, and the time that it takes unless that was asked for."""
    from cdpr_drake.runs.moves import time_for

    if chosen.decided_by == "custom":
        return setup
    return setup.replace(gain=chosen.gain, until=time_for(chosen.gain) if until is None else until)


def _believed(name: str, robot: CableRobot) -> CableRobot:
    """Return the robot as the controllers believe it, with what the true robot carries."""
    from cdpr_drake.model.robot import load_robot

    believed = load_robot(name)
    if believed.num_cables != robot.num_cables:
        cables = f"{believed.num_cables} cables, the true robot {robot.num_cables}"
        raise ValueError(f"--calibrated {name}: has {cables}")
    return believed.replace(payload=robot.payload)


def _warn_of_low_tensions(ready: Sequence[Prepared]) -> None:
    """Warn on stderr of runs that start with a cable below the robot's lower tension limit."""
    said: dict[str, list[str]] = {}
    for prepared in ready:
        tension = prepared.tension_at_drawing_point()
        cable = int(tension.argmin())
        limit = prepared.setup.robot.cable.min_tension
        # Tensions at the limit itself differ from it by what the cable weighs.
        if tension[cable] < 0.99 * limit:
            least = significant(tension[cable])
            text = f"with cable {cable + 1} at {least} N, below the robot's {limit:g} N"
            said.setdefault(text, []).append(prepared.setup.label)
    for text, labels in said.items():
        print_message(f"warning: {', '.join(labels)}: starts {text}")


def describe(name: str, setup: Setup, chosen: DefaultGain | None = None) -> str:
    """Return in words what the runs have in common.

    Args:
        name: of what is run.
        setup: of one of the runs.
        chosen: why their gain is what it is, if nobody asked for one.
    """
    from cdpr_drake.diagrams import TargetSensing, VisionLoop
    from cdpr_drake.model.servo import pose_error
    from cdpr_drake.model.statics import DEFAULT_RULE, MINIMUM_NORM
    from cdpr_drake.runs.moves import DECAYS, LONGEST

    s = pose_error(setup.start, setup.goal, setup.robot.cameras.X_PM)
    turn, way = math.degrees(math.hypot(*s[:3])), math.hypot(*s[3:])
    test = re.match(r"test-(\d+)", name)
    what = f"Test {test[1]} of the paper" if test else "A move"
    loop, noise = "", f"noise with seed {setup.seed}" if setup.noise else "no noise"
    if isinstance(setup.loop, VisionLoop):
        timing, sensing = setup.loop.timing, setup.loop.sensing
        loop = "a continuous loop, "
        if timing.sample_time is not None:
            loop = f"{1.0 / timing.sample_time:g} Hz with {1e3 * timing.latency:g} ms of latency, "
        if isinstance(sensing, TargetSensing):
            noise = f"sensors: {sensing.name} ({sensing.estimator} estimate), {noise}"
    if setup.tensions not in (DEFAULT_RULE, MINIMUM_NORM):
        noise = f"tensions {setup.tensions}, {noise}"
    if setup.loop.believed is not None:
        noise = f"a calibrated robot believed, {noise}"
    gain, rest = gain_in_words(setup.gain, chosen), ""
    decays = setup.gain * setup.until
    if chosen is not None and setup.until == LONGEST and decays < DECAYS:
        rest = f" It ends after {decays:.2g} of the gain's time constants; --until lets it go on."
    return (
        f"{what} on {setup.robot.name}, {setup.robot.mass:g} kg: {way:.2f} m and {turn:.1f} deg in "
        f"{setup.until:g} s, {gain}, {loop}{noise}.{rest}"
    )


def steps_in_words(steps: Iterable[Step]) -> str:
    """Return the smallest of the integrator's steps as a sentence, "" where all are usual ones.

    Args:
        steps: of the runs.
    """
    step = min(steps, key=lambda step: step.size)
    if step.decided_by == "usual":
        return ""
    why = f", for {step.mode}" if step.decided_by == "modes" else ""
    return f" The integrator's step is {1e3 * step.size:.3g} ms{why}."


def _carry_out(ready: Sequence[Prepared]) -> list[Run]:
    """Return the runs, with their progress on stderr."""
    from cdpr_drake.runs import run

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


def _write_all(
    folder: Path, summary: dict[str, Any], runs: Sequence[Run], options: Namespace
) -> None:
    """Write logs and summary, then figures and replay."""
    for r in runs:
        write_log(folder / f"{r.setup.label.lower().replace(' ', '-')}.csv", r.record)
    write_summary(folder, summary, _drawings(runs, options))


def _drawings(runs: Sequence[Run], options: Namespace) -> dict[str, Drawing]:
    """Return what draws figures and replay, by the names of their files."""
    first = runs[0].setup
    records = {r.setup.label: r.record for r in runs}
    drawings: dict[str, Drawing] = {}
    if not options.no_figures:
        from cdpr_drake.show.plots import run_figures

        drawings |= as_drawings(
            lambda _: run_figures(records, first.robot, gain=first.gain, goal=first.goal)
        )
    if not options.no_replay:
        logging.getLogger("drake").setLevel(logging.WARNING)  # Meshcat tells its address
        from cdpr_drake.show.replay import write_replay

        label, *others = records
        ghosts = {other: records[other] for other in others}
        run = first.robot, records[label], first.goal
        drawings["replay.html"] = lambda path: write_replay(path, *run, others=ghosts, title=label)
    return drawings
