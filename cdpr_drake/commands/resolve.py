"""What options are about: a robot and what it carries, a pose or a move, a rule for tensions."""

from __future__ import annotations

import contextlib
import math
from argparse import Namespace
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from cdpr_drake.commands import UsageError
from cdpr_drake.commands.kernels import compilation_announced

if TYPE_CHECKING:
    from pydrake.math import RigidTransform

    from cdpr_drake.analysis import DefaultGain
    from cdpr_drake.model.robot import CableRobot
    from cdpr_drake.runs import PaperTest

DEFAULT_TEST = 4


class Place(NamedTuple):
    """A robot where a question is asked of it.

    Attributes:
        robot: with what it carries.
        pose: X_WP.
        where: the pose in words.
        tensions: the rule for its tensions.
        asked: whether somebody asked for that rule.
    """

    robot: CableRobot
    pose: RigidTransform
    where: str
    tensions: str
    asked: bool

    def __str__(self) -> str:
        """Robot, mass and place as part of a sentence."""
        x, y, z = self.pose.translation().round(2) + 0.0  # never "-0.00"
        rule = f", tensions {self.tensions}" if self.asked else ""
        where = f"{self.where}, ({x:.2f}, {y:.2f}, {z:.2f}) m"
        return f"{self.robot.name}, {self.robot.mass:g} kg, {where}{rule}"

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values, for a summary."""
        return {
            "robot": self.robot.name,
            "mass_kg": self.robot.mass,
            "pose_x_y_z_m_roll_pitch_yaw_deg": pose_values(self.pose),
            "tensions": self.tensions,
        }


class Move(NamedTuple):
    """A robot that goes somewhere.

    Attributes:
        robot: with what it carries.
        start: X_WP.
        goal: X_WP.
        number: of the paper's test it is, None if it is none.
        test: that test.
        tensions: the rule for its tensions at the start.
    """

    robot: CableRobot
    start: RigidTransform
    goal: RigidTransform
    number: int | None
    test: PaperTest | None
    tensions: str


def resolve_place(
    options: Namespace,
    robot: str | None = None,
    default_test: int | None = DEFAULT_TEST,
    elsewhere: Callable[[CableRobot], RigidTransform] | None = None,
) -> Place:
    """Return where a question is asked: at a pose, a test's goal, or the middle of the workspace.

    Args:
        options: with payload, test, pose and tensions.
        robot: name or file; that of the options if None.
        default_test: at whose goal CoGiRo is without test and pose, if at any.
        elsewhere: where other robots are then; in the middle of their workspace if None.
    """
    from cdpr_drake.analysis import middle_of_workspace
    from cdpr_drake.model.rotations import as_pose

    default_test = default_test if options.pose is None else None
    found, number, test = _robot_and_test(options, robot or options.robot, default_test)
    if options.pose is not None:
        pose, where = as_pose(options.pose), "at the pose asked for"
    elif test is not None:
        pose, where = test.poses(found)[1], f"at the goal of Test {number}"
    elif elsewhere is not None:
        pose, where = elsewhere(found), "where such robots are compared"
    else:
        pose, where = middle_of_workspace(found), "in the middle of its workspace"
    return Place(
        found, pose, where, resolve_rule(options, test is not None), options.tensions is not None
    )


def resolve_move(options: Namespace) -> Move:
    """Return the move that is asked for: from and to poses, those of a test, or a short one.

    Args:
        options: with robot, payload, test, start, goal and tensions.
    """
    from cdpr_drake.runs.moves import move_near_the_middle

    robot, number, test = _robot_and_test(options, options.robot, DEFAULT_TEST)
    start, goal = move_near_the_middle(robot) if test is None else test.poses(robot)
    ends = options.start or start, options.goal or goal
    return Move(robot, *ends, number, test, resolve_rule(options, test is not None))


def resolve_rule(options: Namespace, in_test: bool) -> str:
    """Return the rule for tensions: that of `options`, the paper's in its tests, or the default.

    Whether it is for a test of the paper, `in_test` says.
    """
    from cdpr_drake.model.statics import DEFAULT_RULE, MINIMUM_NORM

    if options.tensions is not None:
        return str(options.tensions)
    return MINIMUM_NORM if in_test else DEFAULT_RULE


def resolve_robot(name: str | None) -> CableRobot:
    """Return the robot of a `name` or file, that of the paper if None."""
    from cdpr_drake.model.robot import load_robot
    from cdpr_drake.runs.paper_tests import paper_tests

    return load_robot(name if name is not None else paper_tests().robot)


def resolve_timing(options: Namespace, robot: CableRobot) -> tuple[float, float]:
    """Return sample time and latency [s] of `options`, a `robot`'s where they do not say."""
    cameras = robot.cameras
    sample_time = cameras.sample_time if options.sample_time is None else options.sample_time
    return sample_time, cameras.latency if options.latency is None else options.latency


def resolve_gain(
    options: Namespace, place: Place, sample_time: float | None, latency: float
) -> tuple[float, DefaultGain | None]:
    """Return lambda [1/s] of a loop, and why it is that if the `options` do not say it.

    The loop is at a `place`, with a `sample_time`, None if continuous, and a `latency` [s].
    """
    from cdpr_drake.analysis import default_gain

    if options.gain is not None:
        return options.gain, None
    where = place.robot, place.pose, options.cable_model
    chosen = default_gain(*where, sample_time, latency, tensions=place.tensions)
    return chosen.gain, chosen


def gain_in_words(gain: float, chosen: DefaultGain | None, where: str = "at the goal") -> str:
    """Return a `gain` [1/s] as part of a sentence, with why it was `chosen`, a limit `where`."""
    reason = "" if chosen is None else chosen.reason(where)
    return f"lambda = {gain:g} 1/s" + (f" ({reason})" if reason else "")


def gain_values(gain: float, chosen: DefaultGain | None, asked: str = "option") -> dict[str, Any]:
    """Return a `gain` [1/s] for a summary, and why it was `chosen`, or what `asked` for it."""
    if chosen is not None:
        return chosen.to_dict()
    return {"gain_per_s": gain, "gain_decided_by": asked, "gain_limit_per_s": None}


@contextlib.contextmanager
def input_refused() -> Iterator[None]:
    """Make a UsageError of what goes wrong inside, before anything is run; announce compilation."""
    from cdpr_drake.errors import CdprError

    try:
        with compilation_announced():
            yield
    except (CdprError, ValueError) as error:
        raise UsageError(str(error)) from error


def pose_values(pose: RigidTransform) -> list[float]:
    """Return x, y, z [m], roll, pitch, yaw [deg] of a `pose` X_WP, for a summary."""
    import numpy as np

    angles = np.degrees(pose.rotation().ToRollPitchYaw().vector())
    return [*pose.translation().tolist(), *angles.tolist()]


def _robot_and_test(
    options: Namespace, name: str | None, default_test: int | None
) -> tuple[CableRobot, int | None, PaperTest | None]:
    """Return the robot with what it carries, and the test that is meant."""
    from cdpr_drake.runs.paper_tests import paper_test, paper_tests

    robot = resolve_robot(name)
    number = options.test
    if number is None and robot.name == paper_tests().robot:
        number = default_test
    test = None if number is None else paper_test(number)
    payload = options.payload
    if payload is None:
        return test.carried_by(robot) if test is not None else robot, number, test
    if not (math.isfinite(payload) and payload >= 0.0):
        raise ValueError(f"the payload must be >= 0 and finite, got {payload:g} kg")
    return robot.with_payload(payload), number, test
