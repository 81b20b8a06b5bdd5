"""Where a question is asked: robot, payload and pose of the options of a command."""

from __future__ import annotations

import argparse
import math
import re

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.experiments import paper_test
from cdpr_drake.experiments.paper_tests import paper_tests
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.rotations import as_pose
from cdpr_drake.study import comparable_pose

DEFAULT_TEST = 4


def place(options: argparse.Namespace) -> tuple[CableRobot, RigidTransform, str]:
    """Return the robot with what it carries, X_WP, and the pose in words.

    Args:
        options: with robot (a name or file), payload, test and pose.

    Raises:
        RobotFileError: the robot cannot be read.
        ValueError: the options do not make sense.
    """
    robot = load_robot(options.robot if options.robot is not None else paper_tests().robot)
    number = options.test
    if number is None and options.pose is None and robot.name == paper_tests().robot:
        number = DEFAULT_TEST
    pose, where = comparable_pose(robot), "on the way to the drawing point of cable 1"
    if number is not None:
        test = paper_test(number)
        robot = test.carried_by(robot)
        pose, where = test.poses(robot)[1], f"at the goal of Test {number}"
    if options.pose is not None:
        pose, where = as_pose(options.pose), "at the pose asked for"
    return with_payload(robot, options.payload), pose, where


def with_payload(robot: CableRobot, payload: float | None) -> CableRobot:
    """Return a robot with a mass to carry in place of its own.

    Args:
        robot: the robot.
        payload: [kg]; its own if None.

    Raises:
        ValueError: it is negative or not finite.
    """
    if payload is None:
        return robot
    if not (math.isfinite(payload) and payload >= 0.0):
        raise ValueError(f"the payload must be >= 0 and finite, got {payload:g} kg")
    return robot.with_payload(payload)


def pose_values(pose: RigidTransform) -> list[float]:
    """Return x, y, z [m], roll, pitch, yaw [deg] of a pose, for a summary.

    Args:
        pose: X_WP.
    """
    angles = np.degrees(pose.rotation().ToRollPitchYaw().vector())
    return [*pose.translation().tolist(), *angles.tolist()]


def in_words(robot: CableRobot, pose: RigidTransform, where: str) -> str:
    """Return robot, mass and place as part of a sentence.

    Args:
        robot: the robot.
        pose: X_WP.
        where: the pose in words.
    """
    x, y, z = pose.translation()
    return f"{robot.name}, {robot.mass:g} kg, {where}, ({x:.2f}, {y:.2f}, {z:.2f}) m"


def as_file_name(text: str) -> str:
    """Return a `text` as the name of a directory."""
    return re.sub(r"[^\w.-]+", "-", text).strip(".-") or "robot"
