"""The robot of Table 7 as we assume it, its 20 m move, and what is read off a run of it."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake import CableRobot, load_robot
from cdpr_drake.model.robot import AxialStiffness
from cdpr_drake.model.rotations import Array, exp_rotation
from cdpr_drake.model.servo import ServoSettings
from cdpr_drake.runs import Setup, make_setup
from reproduction.assumptions import printed
from reproduction.table7.quasi_static import QuasiStaticRun, run_quasi_static

MODELS = ("ECM", "CMWE", "SCMWE", "SLSM")

START, GOAL = RigidTransform(), RigidTransform([20.0, 0.0, 0.0])
"""Poses of E, as printed."""

DURATION = 105.0
"""When the paper's simulation was stopped [s]."""

ORDER = 4
"""Of the ECM's series, as printed."""


def true_robot(values: Mapping[str, Any]) -> CableRobot:
    """Return the large robot with its assumed platform and cable.

    A heavier cable is a thicker one of the same kind: section, stiffness and breaking load go with
    its mass. A scaled platform keeps its shape.

    Args:
        values: linear_density [kg/m], platform_scale [-], mass [kg], modulus [GPa], drum_run [m],
            damping_time [s].
    """
    robot = _robot_of_the_file()
    scale, cable, platform = values["platform_scale"], robot.cable, robot.platform
    thicker = values["linear_density"] / cable.linear_density
    section = cable.section * thicker
    X_PM = robot.cameras.X_PM
    return robot.replace(
        attachment_points=scale * robot.attachment_points,
        platform=platform.replace(
            mass=values["mass"],
            center_of_mass=scale * platform.center_of_mass,
            inertia=platform.inertia * scale**2 * values["mass"] / platform.mass,
        ),
        cameras=robot.cameras.replace(
            X_PM=RigidTransform(X_PM.rotation(), scale * X_PM.translation())
        ),
        cable=cable.replace(
            linear_density=values["linear_density"],
            diameter=cable.diameter * np.sqrt(thicker),
            section=section,
            stiffness=AxialStiffness(asymptote=1e9 * values["modulus"] * section),
            breaking_load=cable.breaking_load * thicker,
            drum_run=np.full(robot.num_cables, values["drum_run"]),
            damping_time=values["damping_time"],
        ),
    )


@functools.cache
def _robot_of_the_file() -> CableRobot:
    return load_robot("cogiro-98m")


def believed_robot(robot: CableRobot, values: Mapping[str, Any]) -> CableRobot:
    """Return the robot with a target frame that is turned: the platform ends up as far off.

    Args:
        robot: the true robot.
        values: target_angle [deg] and target_signs (3,): the orientation error that is left about
            the axes of M.
    """
    error = np.radians(values["target_angle"]) * np.array(values["target_signs"], float)
    turn = RotationMatrix(exp_rotation(-error))
    X_PM = robot.cameras.X_PM @ RigidTransform(turn, np.zeros(3))
    return robot.replace(cameras=robot.cameras.replace(X_PM=X_PM))


def setup_of_move(values: Mapping[str, Any], cable_model: str) -> Setup:
    """Return the setup of the full simulation: perfect measurements at 20 Hz, 40 ms late.

    Args:
        values: as for `slow_run`.
        cable_model: the controller's.
    """
    robot = true_robot(values)
    return make_setup(
        robot=robot,
        believed=believed_robot(robot, values),
        start=START,
        goal=GOAL,
        cable_model=cable_model,
        gain=values["gain"],
        ramp_time=values["ramp_time"],
        sample_time=robot.cameras.sample_time,
        latency=robot.cameras.latency,
        noise=False,
        until=DURATION,
    )


def slow_run(
    values: Mapping[str, Any],
    cable_model: str,
    believed: CableRobot | None = None,
    tensions: str = "minimum norm",
) -> QuasiStaticRun:
    """Return the move without dynamics.

    Args:
        values: as for `true_robot` and `believed_robot`, and gain [1/s], ramp_time [s].
        cable_model: the controller's.
        believed: the robot as the controller knows it; that with the target frame turned if None.
        tensions: at the start.
    """
    robot = true_robot(values)
    settings = ServoSettings(
        cable_model=cable_model, order=ORDER, gain=values["gain"], ramp_time=values["ramp_time"]
    )
    if believed is None:
        believed = believed_robot(robot, values)
    return run_quasi_static(robot, believed, START, GOAL, settings, DURATION, tensions=tensions)


def printed_errors() -> Array:
    """Return the printed final errors [mm, deg] (4, 2), rows as in `MODELS`."""
    numbers = printed("table7")
    return np.array([numbers["position"].value, numbers["orientation"].value]).T


def final_errors(position_error: Array, rotation_error: Array) -> tuple[float, float]:
    """Return the means over the three axes of the last errors, [mm] and [deg], as in Table 7.

    Args:
        position_error: (n, 3) [m].
        rotation_error: (n, 3) [rad].
    """
    millimetres = 1e3 * np.abs(position_error[-1]).mean()
    return float(millimetres), float(np.degrees(np.abs(rotation_error[-1]).mean()))


def time_to(time: Array, position_error: Array, fraction: float) -> float:
    """Return when the distance to the goal comes below a fraction of the first, to stay [s].

    Args:
        time: (n,) [s].
        position_error: (n, 3) [m].
        fraction: of the first distance; NaN is returned if it stays above.
    """
    distance = np.linalg.norm(position_error, axis=1)
    level = fraction * distance[0]
    last = int(np.flatnonzero(distance > level)[-1])
    if last == len(time) - 1:
        return float("nan")
    share = np.log(distance[last] / level) / np.log(distance[last] / distance[last + 1])
    return float(time[last] + share * (time[last + 1] - time[last]))
