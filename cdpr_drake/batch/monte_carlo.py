"""One move many times, with what is not known of it drawn anew each time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from cdpr_drake.analysis.default_gain import DefaultGain, lowest_gain
from cdpr_drake.diagrams.sensing import sensing_called
from cdpr_drake.diagrams.step import StepWarning
from cdpr_drake.model.calibration_errors import CalibrationErrors, misjudged
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.rotations import pose_to_vector
from cdpr_drake.model.statics import MINIMUM_NORM
from cdpr_drake.runs.moves import move_near_the_middle
from cdpr_drake.runs.paper_tests import paper_test, paper_tests
from cdpr_drake.runs.running import run
from cdpr_drake.runs.setup import Setup, make_setup

METRICS = (
    "position_error",
    "orientation_error",
    "settled_after",
    "position_excursion",
    "orientation_excursion",
    "lowest_tension",
    "highest_tension",
)
"""Entries of `Summary` that a case gives, in mm, degrees, s and N; NaN where there is none."""


def base_case(
    robot_name: str | None = None, test: int | None = None, **changes: Any
) -> dict[str, Any]:
    """Return what all cases of a sweep have in common, as plain values.

    The gain is that of the changes, or of a test asked for; else that of `chosen_gain`.

    Args:
        robot_name: a built-in robot's, or a robot file; CoGiRo if None.
        test: one of the paper's; if None, Test 4 on CoGiRo, a short move near the middle of others.
        changes: entries to take another value: payload [kg], and those of `Setup` that are numbers
            or names.

    Raises:
        RobotFileError: the robot cannot be read, or cannot carry the payload.
        ValueError: there is no such test.
    """
    name = robot_name if robot_name is not None else paper_tests().robot
    robot = load_robot(name)
    if test is not None and "gain" not in changes:
        changes["gain"] = paper_test(test).gain
    if test is None and robot.name == paper_tests().robot:
        test = 4
    case: dict[str, Any] = {
        "robot": name,
        "payload": robot.payload.mass,
        "sample_time": robot.cameras.sample_time,
        "latency": robot.cameras.latency,
    }
    if test is None:
        start, goal = move_near_the_middle(robot)
    else:
        found = paper_test(test)
        robot = found.carried_by(robot)
        start, goal = found.poses(robot)
        case |= {
            "payload": robot.payload.mass,
            "until": found.duration,
            "tensions": MINIMUM_NORM,
        }
    case |= {"start": pose_to_vector(start).tolist(), "goal": pose_to_vector(goal).tolist()}
    case |= changes
    return case if "gain" in case else {**case, "gain": chosen_gain(case).gain}


def chosen_gain(
    base: Mapping[str, Any], payloads: tuple[float, float] | None = None
) -> DefaultGain:
    """Return the gain for the cases of a base if nobody asks for one; the lower of two payloads.

    Args:
        base: from `base_case`; its gain is not heeded.
        payloads: from which the mass carried is drawn [kg]; that of the base if None.

    Raises:
        RobotFileError: the robot cannot be read, or cannot carry the payload.
        ValueError: a value is out of range.
    """
    case = {name: value for name, value in base.items() if name != "gain"}
    masses = payloads if payloads is not None else (base["payload"],)
    found = [draw({**case, "payload": mass}, 0, calibration=0.0)[0].chosen for mass in masses]
    return lowest_gain(one for one in found if one is not None)


def draw(
    base: Mapping[str, Any],
    seed: int,
    *,
    calibration: float = 1.0,
    payloads: tuple[float, float] | None = None,
    gains: tuple[float, float] | None = None,
) -> tuple[Setup, dict[str, float]]:
    """Return the setup of one case, and what was drawn for it.

    Args:
        base: from `base_case`.
        seed: of all that is drawn: noise, calibration, payload and gain, each for itself, so that
            drawing one more does not change the others.
        calibration: size of the calibration errors, in those of `CalibrationErrors`.
        payloads: from which the mass carried is drawn, evenly [kg]; that of the base if None. The
            controller knows it.
        gains: from which lambda is drawn, evenly in its logarithm [1/s]; that of the base if None.

    Raises:
        RobotFileError: the robot cannot be read, or cannot carry the payload.
        ValueError: a value is out of range.
    """
    noise, knowledge, load, speed = np.random.SeedSequence(seed).generate_state(4)
    case, drawn = dict(base), {}
    if payloads is not None:
        case["payload"] = drawn["payload"] = float(np.random.default_rng(load).uniform(*payloads))
    if gains is not None:
        low, high = np.log(gains)
        gain = math.exp(np.random.default_rng(speed).uniform(low, high))
        case["gain"] = drawn["gain"] = gain
    robot = _carrying(load_robot(case.pop("robot")), case.pop("payload"))
    believed = misjudged(robot, CalibrationErrors().scaled(calibration), int(knowledge))
    setup = make_setup(
        robot=robot,
        believed=believed if calibration > 0.0 else None,
        seed=int(noise),
        sensing=sensing_called(case.pop("sensors", "gaussian")),
        **case,
    )
    return setup, drawn


def run_case(seed: int, base: Mapping[str, Any], **spread: Any) -> dict[str, Any]:
    """Run one case and return what came of it: `METRICS`, what was drawn, the steps.

    Args:
        seed: of all that is drawn.
        base: from `base_case`.
        spread: of `draw`.

    Raises:
        CdprError, ValueError: as `run` does.
    """
    import warnings

    from cdpr_drake.analysis import StabilityWarning

    setup, drawn = draw(base, seed, **spread)
    with warnings.catch_warnings():
        # The same for all cases: said once, of the base.
        warnings.simplefilter("ignore", StabilityWarning)
        warnings.simplefilter("ignore", StepWarning)
        summary = run(setup).summary
    values = {name: getattr(summary, name) for name in METRICS}
    result = {name: math.nan if value is None else float(value) for name, value in values.items()}
    steps = {"step": summary.step, "simulated_time": summary.simulated_time}
    return {**drawn, **result, **steps}


def _carrying(robot: CableRobot, payload: float) -> CableRobot:
    return robot if payload == robot.payload.mass else robot.with_payload(payload)
