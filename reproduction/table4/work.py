"""The work behind Table 4: fits, calibrations and runs of Tests 1 to 3, each a case of its own."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.diagrams import JointSpaceLoop, TargetSensing
from cdpr_drake.model.calibration_errors import CalibrationErrors, misjudged
from cdpr_drake.model.camera import true_from_seen
from cdpr_drake.model.rotations import Array, as_pose
from cdpr_drake.runs import Run, Setup, run, setup_of_test
from reproduction.assumptions import assumed, assumptions
from reproduction.believed import Eyes, setup_from
from reproduction.section import Result
from reproduction.table4.explanations import (
    EXPLANATIONS,
    TESTS,
    data,
    ends,
    fit,
    fitted_structure,
    largest_of_tests_1_and_2,
    predictions,
)
from reproduction.table4.structure import EndError, Structure, end_error, joint_space_end

MAX_STEP = 0.0134
"""Of the integrator [s]: four steps to a frame; ends are those of five to 0.03 mm."""

REST = 300.0
"""By then a gain of 0.03 1/s has left 0.5 mm of Test 1's 4.35 m [s]."""

NOISY = 200.0
"""A run that shows what the noise does [s]; its first third is for the noise to come in."""

FAST_GAIN, FAST = 0.2, 60.0
"""Rest does not depend on the pace: runs that only verify it have this gain [1/s], and end [s]."""

LATE = 3.0
"""An end is the mean over the last seconds of a run [s]."""

NEAR = 0.02
"""A run that need not show the move starts so far from its end, along each axis [m]."""

KINDS = ("joint", "few", "mean", "independent")
"""Calibrations: of section 4.3; with few poses of the platform; with the paper's mean of the
patterns' poses, in the calibration and at the goal; or with errors of ^fT_b and ^mT_e that know
nothing of each other."""

FEW = 4
"""Poses of the platform in a calibration with few of them."""

PAYLOADS = (0.0, 110.0, 200.0)
"""At Test 2's goal, to tell explanations apart [kg]."""

MODULI = 21
"""Values across the range of the modulus, to see what holds whichever is true."""

SHIFT = 0.5
"""By which the poses are moved, as the camera's place is assumed [m]."""


def explain(index: int) -> Result:
    """Return how one of the `EXPLANATIONS` fits, and what it predicts.

    Args:
        index: of the explanation.
    """
    explanation = EXPLANATIONS[index]
    values, left = fit(explanation)
    structure = explanation.structure(values)
    result: dict[str, Any] = {
        "name": explanation.name,
        "values": dict(zip(explanation.free, values.tolist(), strict=True)),
        "left": left,
        "predictions": predictions(explanation),
        "beyond": _beyond(structure),
    }
    return result | _ends(structure)


def moduli() -> Result:
    """Return what `fitted_ends` has, for constant moduli all over their range, a row each."""
    entry = assumptions("table4")["modulus"]
    every = [
        Structure(modulus=float(value)) for value in np.linspace(entry.low, entry.high, MODULI)
    ]
    return {
        "modulus": np.array([structure.modulus for structure in every]),
        "position": np.array([_ends(structure)["position"] for structure in every]),
        "beyond": np.array([_beyond(structure) for structure in every]),
    }


def fitted_ends() -> Result:
    """Return the ends of Tests 1 to 3 with the one set of the data file, and their sensitivity."""
    structure = fitted_structure()
    nominal = ends(structure)
    changed = [["as fitted", *_two_numbers(nominal)]]
    for axis, name in enumerate("xyz"):
        for sign in (-1.0, 1.0):
            shift = sign * SHIFT * np.eye(3)[axis]
            moved = {n: joint_space_end(structure, n, shift=shift) for n in TESTS}
            changed.append(
                [f"goals moved by {sign * SHIFT:+.1f} m in {name}", *_two_numbers(moved)]
            )
    without_run = ends(Structure(**{**vars(structure), "drum_run": False}))
    changed.append(["no run from drum to eyelet", *_two_numbers(without_run)])
    return {
        "left": data(nominal),
        "beyond": _beyond(structure),
        "changed": changed,
        **_ends(structure),
    }


def calibration(kind: str, seeds: list[int]) -> Result:
    """Return the true errors at rest of Tests 1 to 3 under vision-based control, of some seeds.

    At rest the controller sees no error: the platform is where its cameras show it at the goal. So
    the end of a run is known but for the noise, without running it.

    Args:
        kind: of calibration, one of `KINDS`.
        seeds: of calibrations.

    Returns:
        "position" [mm] and "orientation" [deg] (seeds, tests, 3), true minus desired, in W.
    """
    goals = [setup_of_test(number).goal for number in TESTS]
    position, orientation = [], []
    for seed in seeds:
        true = _at_rest(kind, seed, goals)
        errors = [end_error(X, goal) for X, goal in zip(true, goals, strict=True)]
        position.append([e.position for e in errors])
        orientation.append([e.orientation for e in errors])
    return {"position": np.array(position), "orientation": np.array(orientation)}


def _at_rest(kind: str, seed: int, goals: list[RigidTransform]) -> list[RigidTransform]:
    """Return the true X_WP at which the platform is seen at each goal."""
    robot = setup_of_test(1).robot
    if kind == "independent":
        believed = misjudged(robot, CalibrationErrors(), seed)
        return [true_from_seen(robot, believed, goal) for goal in goals]
    return [_eyes(seed, kind).rest_pose(goal) for goal in goals]


@functools.lru_cache(maxsize=1)
def _eyes(seed: int, kind: str = "joint") -> Eyes:
    """Return the cameras of CoGiRo after one calibration."""
    few = {"poses": FEW} if kind == "few" else {}
    setup = setup_from(assumed("table4")).replace(**few)
    return Eyes(setup_of_test(1).robot, seed, setup, "mean" if kind == "mean" else "joint")


def vision_run(number: int) -> Result:
    """Return a whole run of a test under vision-based control with noise and one calibration.

    Args:
        number: of the test, and seed of noise and calibration.

    Returns:
        (6,) errors (x, y, z) [mm] and angles [deg] "then", "after" the test's duration [s], at
        "rest", and as statics have "predicted" the rest; cables that went slack.
    """
    setup = _setup(number, until=REST, seed=number)
    eyes = _eyes(number)
    done = run(setup.replace(believed=eyes.believed_at(setup.goal)))
    duration = setup_of_test(number).until
    return {
        "after": duration,
        "then": _error_of(done, duration),
        "rest": _error_of(done, REST),
        "predicted": end_error(eyes.rest_pose(setup.goal), setup.goal).flat,
        "slack_cables": sorted(done.summary.slack_cables),
    }


def noise_run(number: int) -> Result:
    """Return how much the noise alone moves the platform about its rest: deviations per axis.

    Args:
        number: of the test.
    """
    setup = _setup(number, until=NOISY, seed=number)
    done = run(setup.replace(start=setup.goal))
    settled = done.record.time >= NOISY / 3.0
    pose = done.record["pose"][settled]
    cameras, step = setup.robot.cameras, setup.gain * (setup.loop.timing.sample_time or 0.0)
    filtered = np.sqrt(step / (2.0 - step))  # of x <- x - step (x + n)
    return {
        "position": 1e3 * pose[:, 3:].std(axis=0),
        "orientation": np.degrees(pose[:, :3].std(axis=0)),
        "position_of_law": float(1e3 * cameras.position_noise * filtered),
        "orientation_of_law": float(np.degrees(cameras.orientation_noise * filtered)),
    }


def camera_run(number: int) -> Result:
    """Return the end of a run whose controller sees the patterns' points, beside that of statics.

    It starts near its end, and closes in at another pace, neither of which the end depends on.

    Args:
        number: of the test, and seed of noise and calibration.
    """
    eyes, setup = _eyes(number), _setup(number)
    predicted = eyes.rest_pose(setup.goal)
    start = RigidTransform(predicted.rotation(), predicted.translation() - NEAR)
    robot = setup.robot.replace(cameras=eyes.true.cameras)
    done = run(
        setup.replace(
            robot=robot, start=start, gain=FAST_GAIN, until=0.7 * FAST, seed=number,
            believed=eyes.believed, sensing=TargetSensing(),
        )
    )  # fmt: skip
    return {
        "rest": _error_of(done, done.setup.until),
        "predicted": end_error(predicted, setup.goal).flat,
    }


def joint_space_run(number: int) -> Result:
    """Return the end of a run of a test under joint space control, beside that of statics.

    Args:
        number: of the test.
    """
    setup = _setup(number, loop=JointSpaceLoop(), gain=FAST_GAIN, until=FAST)
    done = run(setup)
    return {
        "rest": _error_of(done, FAST),
        "predicted": joint_space_end(fitted_structure(), number).flat,
    }


def _setup(number: int, **changes: Any) -> Setup:
    """Return the setup of a test with the fitted cables."""
    robot = fitted_structure().robot(setup_of_test(number).robot)
    return setup_of_test(number, max_step=MAX_STEP, **changes).replace(robot=robot)


def _error_of(done: Run, time: float) -> Array:
    """Return (6,) the mean error over the seconds before a time: (x, y, z) [mm], angles [deg]."""
    t = done.record.time
    poses = done.record["pose"][(t <= time + 1e-9) & (t > time - LATE)]
    return np.mean([end_error(as_pose(p), done.setup.goal).flat for p in poses], axis=0)


def _beyond(structure: Structure) -> list[float]:
    """Return z at Test 2's goal with each of `PAYLOADS` [mm]."""
    return [float(joint_space_end(structure, 2, payload=m).position[2]) for m in PAYLOADS]


def _ends(structure: Structure) -> dict[str, Any]:
    """Return positions and orientations (3, 3) of Tests 1 to 3, a row each."""
    errors = ends(structure)
    return {
        "position": np.array([errors[n].position for n in TESTS]),
        "orientation": np.array([errors[n].orientation for n in TESTS]),
    }


def _two_numbers(errors: dict[int, EndError]) -> Iterator[float]:
    yield float(errors[3].position[2])
    yield largest_of_tests_1_and_2(errors)
