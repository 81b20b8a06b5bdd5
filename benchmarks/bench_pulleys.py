"""Pulleys: what forces, laws, inverse kinematics and a whole run cost with them and without.

Three robots with pulleys, and the same with eyelets at the drawing points; numbers in and out. The
run is the move of the paper's Test 4, on the CoGiRo that has pulleys.

    python -m benchmarks pulleys [--rounds 9] [--until 20]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.harness import Contestant, Report, Spread, interleave, positive, ratio, run
from cdpr_drake.model.arrays import RobotArrays
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.inverse_kinematics import InverseKinematics
from cdpr_drake.model.kernels import geometry, pulley
from cdpr_drake.model.robot import CableRobot, Pulleys, load_robot
from cdpr_drake.model.rotations import pose_to_vector
from cdpr_drake.model.servo import MotorRateLaw, ServoSettings
from cdpr_drake.runs.moves import move_near_the_middle
from cdpr_drake.runs.running import prepare
from cdpr_drake.runs.running import run as make_run
from cdpr_drake.runs.setup import setup_of_test

ROBOTS = ("cogiro-2015-pulleys", "caroca", "cuhk-cablerobot")
REPEATS = 300
WANTED = {"forces": 4.0, "forces and Jacobian": 2.5}
"""How many times what they cost without pulleys they may, at most."""


def repeated(call: Callable[[], object]) -> Callable[[], None]:
    """Return what makes a call many times."""

    def many() -> None:
        for _ in range(REPEATS):
            call()

    return many


def calls(robot: CableRobot) -> dict[str, Callable[[], object]]:
    """Return what is timed, for a robot at rest in the middle of its workspace."""
    goal = move_near_the_middle(robot)[1]
    rest, arrays, k = rest_state(robot, goal), RobotArrays(robot), robot.num_cables
    pose, still = pose_to_vector(goal), np.zeros(3)
    p_WB, v_WB, rates = np.zeros((k, 3)), np.zeros((k, 3)), np.zeros(k)
    R, p = goal.rotation().matrix(), goal.translation()
    geometry.attachment_motion(R, p, still, still, arrays.points[1], p_WB, v_WB)
    out, jacobian = np.zeros((k, 14)), np.zeros((k, 14, 8))
    cables = (arrays.points, p_WB, v_WB, rest.unstrained_length, rates, arrays.constants)
    pulley.robot_forces(*cables, False, out, jacobian)
    law, inverse = MotorRateLaw(robot, ServoSettings()), InverseKinematics(robot)
    z = np.concatenate([pose, pose + 0.01, np.zeros(6), out[:, 3], out[:, 5:8].ravel()])
    return {
        "forces": lambda: pulley.robot_forces(*cables, False, out, jacobian),
        "forces and Jacobian": lambda: pulley.robot_forces(*cables, True, out, jacobian),
        "law": lambda: law(z, 0.1),
        "inverse kinematics": lambda: inverse.lengths_and_jacobian(pose, False),
    }


def measure(report: Report, options: argparse.Namespace) -> None:
    """Fill a report."""
    for name in ROBOTS:
        robot = load_robot(name)
        with_pulleys, without = calls(robot), calls(robot.replace(pulleys=Pulleys()))
        contestants = [
            Contestant(name=f"{what}, {kind}", call=repeated(made[what]), units=REPEATS)
            for what in with_pulleys
            for kind, made in (("pulleys", with_pulleys), ("eyelets", without))
        ]
        times = interleave(contestants, options.rounds)
        rows: list[dict[str, Any]] = [
            {
                f"{name} [us]": what,
                **{
                    kind: Spread.of(times[f"{what}, {kind}"]).scaled(1e6)
                    for kind in ("pulleys", "eyelets")
                },
            }
            for what in with_pulleys
        ]
        report.table(f"{name}: CPU time with pulleys and without", rows)
        for what in with_pulleys:
            found = ratio(times[f"{what}, pulleys"], times[f"{what}, eyelets"])
            report.ratio(f"{name}: {what}, over that without", found, at_most=WANTED.get(what))
    robot = load_robot(ROBOTS[0])
    setups = {
        kind: setup_of_test(4, robot=made, until=options.until)
        for kind, made in (("pulleys", robot), ("eyelets", robot.replace(pulleys=Pulleys())))
    }
    runs = [
        Contestant(name=kind, before=lambda s=s: prepare(s), call=make_run)  # type: ignore[misc]
        for kind, s in setups.items()
    ]
    times = interleave(runs, max(3, options.rounds // 3))
    speed = ratio(times["eyelets"], times["pulleys"])
    report.ratio("Test 4: speed of the run, over that without", speed, at_least=0.5)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this benchmark."""
    parser.add_argument("--rounds", type=positive, default=9, help="of everything in turn")
    parser.add_argument("--until", type=float, default=20.0, help="length of the run [s]")


def main(arguments: list[str] | None = None) -> int:
    """Measure; the exit status tells whether what is not a time is as it should be."""
    return 0 if run("pulleys", __doc__, measure, add_options, arguments).is_right() else 1


if __name__ == "__main__":
    sys.exit(main())
