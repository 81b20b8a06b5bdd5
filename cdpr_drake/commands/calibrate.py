"""`cdpr-drake calibrate`: a robot calibrated on simulated measurements, and how wrong it is."""

from __future__ import annotations

import argparse
import math
import sys
from typing import Any

import numpy as np

from cdpr_drake.commands.answer import counted, leave, wrapped
from cdpr_drake.commands.arguments import UsageError
from cdpr_drake.commands.kernels import compilation_announced
from cdpr_drake.commands.place import as_file_name
from cdpr_drake.commands.terminal import Column, fitting, table, width_of
from cdpr_drake.errors import CdprError
from cdpr_drake.experiments.paper_tests import paper_tests
from cdpr_drake.model.calibration import Calibration, CalibrationSetup, calibrate
from cdpr_drake.model.robot import load_robot


def calibrate_command(options: argparse.Namespace) -> int:
    """Carry out `cdpr-drake calibrate` and return the exit status.

    Args:
        options: the parsed arguments.

    Raises:
        UsageError: the input cannot be used; nothing was written.
    """
    if not (math.isfinite(options.noise) and options.noise >= 0.0):
        raise UsageError(f"--noise: must be finite and not negative, got {options.noise:g}")
    if options.seed < 0:
        raise UsageError(f"--seed: must not be negative, got {options.seed}")
    try:
        robot = load_robot(options.robot if options.robot is not None else paper_tests().robot)
        setup = CalibrationSetup(scale=0.0 if options.no_noise else options.noise)
        with compilation_announced():
            found = calibrate(robot, setup, options.seed, counted=counted)
        pose_errors = found.pose_errors()
    except (CdprError, ValueError) as error:
        raise UsageError(str(error)) from error
    file = f"{as_file_name(robot.name)}-calibrated.yaml"
    columns = fitting(_columns(found), width_of(sys.stdout))
    lines = [table(columns), "", *wrapped(_meaning(found)), "", *wrapped(_at_platform(pose_errors))]

    def figures() -> dict[str, Any]:
        from cdpr_drake.show import calibration_figure

        return {"calibration": calibration_figure(found)}

    name = f"calibrate-{as_file_name(robot.name)}"
    texts = {file: found.robot.to_yaml()}
    return leave(options, name, _summary(found, pose_errors), lines, figures, texts)


def _columns(found: Calibration) -> list[Column]:
    groups = found.groups
    return [
        Column(heading=("", "parameters"), cells=[g.name for g in groups], to_the_left=True),
        Column(heading=("", "unit"), cells=[g.unit for g in groups], to_the_left=True),
        Column(heading=("rms error", "per axis"), cells=[_digits(g.rms_error) for g in groups]),
        Column(heading=("predicted", "1 sigma"), cells=[_digits(g.rms_sigma) for g in groups]),
        Column(
            heading=("of it", "noise"), cells=[_digits(g.rms_noise_sigma) for g in groups], rank=1
        ),
        Column(
            heading=("of it", "fixed"), cells=[_digits(g.rms_fixed_sigma) for g in groups], rank=1
        ),
        Column(
            heading=("largest", "error"),
            cells=[_digits(abs(g.errors[g.largest])) for g in groups],
            rank=1,
        ),
        Column(
            heading=("", "of"),
            cells=[g.labels[g.largest] for g in groups],
            rank=2,
            to_the_left=True,
        ),
    ]


def _digits(value: float) -> str:
    """Return a value with three digits, and what is only round-off as 0."""
    return "0" if value < 1e-7 else f"{value:#.3g}".rstrip(".")


def _meaning(found: Calibration) -> str:
    scale = found.setup.scale
    noise = {0.0: "no noise", 1.0: "the usual noise"}.get(scale, f"{scale:g} times the usual noise")
    return (
        f"{found.true.name} calibrated with {noise}, seed {found.seed}: calibrated less true, and "
        "the standard deviation that the measurements predict: of noise, which calibrating again "
        "would average out, and of what stays fixed, which are the bends of the cables and the "
        "bias of each point of the patterns. A_i and B_i are known as well as "
        "one can say where the cable bends; X_WF and X_PM as well as poses that turn by "
        f"{np.degrees(found.setup.turn):g} deg tell the one from the other, so their errors go "
        "together."
    )


def _at_platform(errors: np.ndarray) -> str:
    turn, way = _rms(errors)
    largest = 1e3 * np.linalg.norm(errors[:, 3:], axis=1).max()
    return (
        f"At the platform: with this calibration exact images give its pose in W wrong by "
        f"{_digits(1e3 * way)} mm and {_digits(np.degrees(turn))} deg, root mean square over the "
        f"{len(errors)} poses used, at most {_digits(largest)} mm. A goal given in W is missed by "
        "that; one that the cameras themselves have measured is not."
    )


def _rms(errors: np.ndarray) -> tuple[float, float]:
    """Return the root mean squares of the norms of rotations [rad] and translations [m]."""
    squares = (errors**2).reshape(-1, 2, 3).sum(axis=2).mean(axis=0)
    return float(np.sqrt(squares[0])), float(np.sqrt(squares[1]))


def _summary(found: Calibration, errors: np.ndarray) -> dict[str, Any]:
    turn, way = _rms(errors)
    return {
        "robot": found.true.name,
        "noise_scale": found.setup.scale,
        "seed": found.seed,
        "groups": {
            g.name: {
                "unit": g.unit,
                "rms_error": g.rms_error,
                "rms_sigma": g.rms_sigma,
                "rms_noise_sigma": g.rms_noise_sigma,
                "rms_fixed_sigma": g.rms_fixed_sigma,
                "labels": list(g.labels),
                "errors": g.errors.tolist(),
                "sigmas": g.sigmas.tolist(),
                "noise_sigmas": g.noise_sigmas.tolist(),
                "fixed_sigmas": g.fixed_sigmas.tolist(),
            }
            for g in found.groups
        },
        "pose_error_rms_mm": 1e3 * way,
        "pose_error_rms_deg": math.degrees(turn),
        "pose_errors_rotation_rad_translation_m": errors.tolist(),
    }
