"""What `cdpr-drake run` is asked to do: options to setups of runs, and a word on them."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from cdpr_drake.commands.gain import gain_in_words
from cdpr_drake.commands.terminal import say
from cdpr_drake.experiments import Prepared, Setup, paper_test
from cdpr_drake.experiments.moves import DECAYS, LONGEST, move_near_the_middle, time_for
from cdpr_drake.experiments.paper_tests import paper_tests
from cdpr_drake.model.cable_models import CABLE_MODELS
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.servo import pose_error
from cdpr_drake.study import DefaultGain, lowest_gain

DEFAULT_TEST = 4
DEFAULT_MODELS = ("SCMWE", "SLSM")


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


def plan(options: argparse.Namespace) -> Plan:
    """Return a name for what the options ask for, and the setups of its runs.

    The runs have one gain: that of --gain, or of the test asked for by --test. Else it is the
    robot's: of its file, or `default_gain` at the goal, the lowest of the laws compared.

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
        "sensors": options.sensors,
        "estimator": options.estimator,
    }
    if number is not None:
        test = paper_test(number)
        robot = test.carried_by(robot) if options.payload is None else robot
        values["start"], values["goal"] = test.poses(robot)
        values["until"] = test.duration
        if options.test is not None:
            values["gain"] = test.gain
    else:
        values["start"], values["goal"] = move_near_the_middle(robot)
    if options.payload is not None:
        if not (math.isfinite(options.payload) and options.payload >= 0.0):
            raise ValueError(f"the payload must be >= 0 and finite, got {options.payload:g} kg")
        robot = robot.with_payload(options.payload)
    for field in ("start", "goal", "gain", "latency", "sample_time", "until"):
        given = getattr(options, field)
        if given is not None:
            values[field] = given
    if values["sample_time"] == 0.0:
        values["sample_time"] = None

    if options.calibrated is not None:
        values["calibrated"] = _believed(options.calibrated, robot)
    setups = []
    if options.controller in ("vbc", "both"):
        models = dict.fromkeys(options.cable_model or DEFAULT_MODELS)
        setups += [Setup(robot=robot, cable_model=m, **values) for m in models]
    elif options.cable_model:
        known = ", ".join(CABLE_MODELS)
        raise ValueError(f"--cable-model ({known}) is VBC's; it has no meaning with JSC alone")
    if options.controller in ("jsc", "both"):
        setups.append(Setup(robot=robot, controller="JSC", **values))
    chosen = lowest_gain(s.chosen for s in setups if s.chosen) if "gain" not in values else None
    if chosen is not None:
        setups = [_at_gain(s, chosen, options.until) for s in setups]
    is_test = number is not None and options.start is None and options.goal is None
    name = f"test-{number}" if is_test else re.sub(r"[^\w.-]+", "-", robot.name).strip(".-")
    # Runs that see or believe otherwise do not replace the plain one's results.
    seen = "" if options.sensors == Setup.sensors else f"-{options.sensors}"
    believed = "" if options.calibrated is None else "-calibrated"
    return Plan(f"{name or 'run'}{seen}{believed}", setups, chosen)


def _at_gain(setup: Setup, chosen: DefaultGain, until: float | None) -> Setup:
    """Return a setup with the gain of all, and the time that it takes unless that was asked for."""
    if chosen.decided_by == "custom":
        return setup
    return setup.replace(gain=chosen.gain, until=time_for(chosen.gain) if until is None else until)


def _believed(name: str, robot: CableRobot) -> CableRobot:
    """Return the robot as the controllers believe it, with what the true robot carries."""
    believed = load_robot(name)
    if believed.num_cables != robot.num_cables:
        cables = f"{believed.num_cables} cables, the true robot {robot.num_cables}"
        raise ValueError(f"--calibrated {name}: has {cables}")
    return believed.replace(payload=robot.payload)


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


def describe(name: str, setup: Setup, chosen: DefaultGain | None = None) -> str:
    """Return in words what the runs have in common.

    Args:
        name: of what is run.
        setup: of one of the runs.
        chosen: why their gain is what it is, if nobody asked for one.
    """
    s = pose_error(setup.start, setup.goal, setup.robot.cameras.X_PM)
    turn, way = np.degrees(np.linalg.norm(s[:3])), np.linalg.norm(s[3:])
    test = re.match(r"test-(\d+)", name)
    what = f"Test {test[1]} of the paper" if test else "A move"
    loop = "a continuous loop"
    if setup.sample_time is not None:
        loop = f"{1.0 / setup.sample_time:g} Hz with {1e3 * setup.latency:g} ms of latency"
    noise = f"noise with seed {setup.seed}" if setup.noise else "no noise"
    if setup.sensors != "gaussian":
        noise = f"sensors: {setup.sensors} ({setup.estimator} estimate), {noise}"
    if setup.calibrated is not None:
        noise = f"a calibrated robot believed, {noise}"
    gain, rest = gain_in_words(setup.gain, chosen), ""
    decays = setup.gain * setup.until
    if chosen is not None and setup.until == LONGEST and decays < DECAYS:
        rest = f" It ends after {decays:.2g} of the gain's time constants; --until lets it go on."
    return (
        f"{what} on {setup.robot.name}, {setup.robot.mass:g} kg: {way:.2f} m and {turn:.1f} deg in "
        f"{setup.until:g} s, {gain}, {loop}, {noise}.{rest}"
    )
