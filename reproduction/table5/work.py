"""The work behind Table 5: paired runs of Tests 4 and 5 with SCMWE and SLSM."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from cdpr_drake.analysis import gain_matrix
from cdpr_drake.model.calibration_errors import CalibrationErrors, misjudged
from cdpr_drake.model.robot import AxialStiffness
from cdpr_drake.model.rotations import Array
from cdpr_drake.runs import Run, Setup, run, setup_of_test
from reproduction.assumptions import assumed
from reproduction.believed import Eyes, setup_from
from reproduction.section import Result
from reproduction.table5.convergence import crossing_time, noiseless_error

TESTS = (4, 5)
MODELS = ("SCMWE", "SLSM")

MAX_STEP = 0.0134
"""Of the integrator [s]: four steps to a frame; convergence times are those of five to 0.1 ms."""

LAST = 5.0
"""Final errors are means over the last seconds of a run [s]."""

LEVELS = (0.1, 0.05, 0.02, 0.01, 0.005)
"""Parts of the first error at which a run may be said to have converged."""

CHANGES = (
    "none", "points", "calibration", "friction", "load_cells", "modulus", "tensions", "cables",
    "gain",
)  # fmt: skip
"""What is otherwise in runs that show what the difference hangs on."""


def pair(seed: int) -> Result:
    """Return runs of both tests with both models, alike in noise and calibration.

    Args:
        seed: of both.

    Returns:
        What `measured` gives, by "<test> <model>".
    """
    values = assumed("table5")
    eyes = Eyes(setup_of_test(4).robot, seed, setup_from(values))
    result: dict[str, Any] = {}
    for number in TESTS:
        goal = setup_of_test(number).goal
        for model in MODELS:
            setup = setup_of_test(number, cable_model=model, max_step=MAX_STEP, seed=seed)
            done = run(setup.replace(believed=eyes.believed_at(goal)))
            result[f"{number} {model}"] = measured(done)
    return result


def ideal(number: int) -> Result:
    """Return runs with perfect measurements and calibration, as in the paper's simulator.

    Args:
        number: of the test.

    Returns:
        What `measured` gives, by "<test> <model>", with "rates": the slowest and the fastest rate
        of convergence over lambda at start and goal, the least and largest of the gain matrices.
    """
    result = changed(number, CHANGES[0])
    nominal = setup_of_test(number)
    for model in MODELS:
        rates = [
            gain_matrix(nominal.robot, None, pose, model).eigenvalues.real
            for pose in (nominal.start, nominal.goal)
        ]
        result[f"{number} {model}"]["rates"] = np.array([np.min(rates), np.max(rates)])
    return result


def changed(number: int, change: str) -> dict[str, Any]:
    """Return ideal runs with one thing otherwise.

    Args:
        number: of the test.
        change: one of `CHANGES`.
    """
    result: dict[str, Any] = {}
    for model in MODELS:
        setup = setup_of_test(number, cable_model=model, max_step=MAX_STEP, noise=False)
        result[f"{number} {model}"] = measured(run(_otherwise(setup, change)))
    return result


def measured(done: Run) -> dict[str, Any]:
    """Return what a run is compared by.

    Args:
        done: the run.

    Returns:
        "seen" and "true": (2,) final errors, mean norms [mm, deg]; "converged" (2, levels) when
        the noiseless position error, and its z, is at each of `LEVELS` of the first [s];
        "noisy" (levels,) the same of the position error seen, noise and all.
    """
    time = done.record.time
    error = noiseless_error(done)
    seen = done.record["pose_error_seen"]
    sizes = (np.linalg.norm(error[:, 3:], axis=1), np.abs(error[:, 5]))
    noisy = np.linalg.norm(seen[:, 3:], axis=1)
    return {
        "seen": _final(time, seen),
        "true": _final(time, done.record["pose_error"]),
        "converged": np.array([[crossing_time(time, s, p * s[0]) for p in LEVELS] for s in sizes]),
        "noisy": np.array([crossing_time(time, noisy, p * noisy[0]) for p in LEVELS]),
    }


def _final(time: Array, error: Array) -> Array:
    last = error[time > time[-1] - LAST].reshape(-1, 2, 3)
    orientation, position = np.linalg.norm(last, axis=2).mean(axis=0)
    return np.array([1e3 * position, np.degrees(orientation)])


def _otherwise(setup: Setup, change: str) -> Setup:
    """Return a setup with one of `CHANGES`."""
    robot, values = setup.robot, assumed("table5")
    cable, errors = robot.cable, CalibrationErrors().scaled(10.0)
    points = replace(
        errors, camera_position=0.0, camera_angle=0.0, target_position=0.0, target_angle=0.0
    )
    rough = robot.winch.replace(
        capstan_exponent=values["friction"], capstan_speed=1e-3 * values["friction_speed"]
    )
    wrong = robot.load_cells.replace(bias=100.0)
    soft = cable.replace(stiffness=AxialStiffness(asymptote=17e9 * cable.section))
    thick = cable.replace(
        linear_density=3.0 * cable.linear_density,
        section=3.0 * cable.section,
        diameter=np.sqrt(3.0) * cable.diameter,
        stiffness=AxialStiffness(asymptote=3.0 * cable.stiffness.asymptote),
    )
    fields: dict[str, dict[str, Any]] = {
        "none": {},
        "points": {"believed": misjudged(robot, points, 1)},
        "calibration": {"believed": misjudged(robot, errors, 1)},
        "friction": {"robot": robot.replace(winch=rough), "believed": robot},
        "load_cells": {"robot": robot.replace(load_cells=wrong), "believed": robot},
        "modulus": {"robot": robot.replace(cable=soft)},
        "tensions": {"tensions": "within limits"},
        "cables": {"robot": robot.replace(cable=thick)},
        "gain": {"gain": 0.03, "until": setup.until * setup.gain / 0.03},
    }
    if change not in fields:
        raise ValueError(f'unknown change "{change}"')
    return setup.replace(**fields[change])
