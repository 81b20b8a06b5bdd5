"""`cdpr-drake calibrate`: a robot calibrated on simulated measurements, and how wrong it is."""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING, Any

from cdpr_drake.commands import Command, UsageError
from cdpr_drake.commands import arguments as common
from cdpr_drake.commands.files import as_file_name, write_answer
from cdpr_drake.commands.resolve import input_refused, resolve_robot
from cdpr_drake.commands.terminal import Column, counted, fitted_table, wrapped

if TYPE_CHECKING:
    import numpy as np

    from cdpr_drake.model.calibration import Calibration

SIZES = ("unit", "rms_error", "rms_sigma", "rms_noise_sigma", "rms_fixed_sigma")
ERRORS = ("errors", "sigmas", "noise_sigmas", "fixed_sigmas")


def _add_arguments(parser: ArgumentParser) -> None:
    what = parser.add_argument_group("what is calibrated, and how well is measured")
    what.add_argument("--robot", **common.ROBOT)
    what.add_argument("--seed", **common.SEED)
    noise = what.add_mutually_exclusive_group()
    noise.add_argument("--noise", type=float, default=1.0, metavar="SCALE",
                       help="of all measurements, times the usual (default: 1)")  # fmt: skip
    noise.add_argument("--no-noise", action="store_true", help="exact measurements")
    common.add_output(parser)


def _calibrate(options: Namespace) -> int:
    from cdpr_drake.model.calibration import CalibrationSetup, calibrate

    if not (math.isfinite(options.noise) and options.noise >= 0.0):
        raise UsageError(f"--noise: must be finite and not negative, got {options.noise:g}")
    if options.seed < 0:
        raise UsageError(f"--seed: must not be negative, got {options.seed}")
    with input_refused():
        robot = resolve_robot(options.robot)
        setup = CalibrationSetup(scale=0.0 if options.no_noise else options.noise)
        found = calibrate(robot, setup, options.seed, counted=counted)
        pose_errors = found.pose_errors()
    meaning = [*wrapped(_meaning(found)), "", *wrapped(_at_platform(pose_errors))]
    return write_answer(
        options,
        f"calibrate-{robot.name}",
        _summary(found, pose_errors),
        [fitted_table(_columns(found)), "", *meaning],
        lambda show: {"calibration": lambda: show.calibration_figure(found)},
        {f"{as_file_name(robot.name)}-calibrated.yaml": found.robot.to_yaml()},
    )


COMMAND = Command(
    summary="calibrate a robot on simulated measurements",
    description="Calibrate cameras, drawing and attachment points, X_WF and X_PM as section 4.3 of "
    "the paper does, on simulated measurements: 25 views of a checkerboard for each camera, points "
    "of a laser tracker, and a few poses of the platform. Tell the errors against truth and their "
    "standard deviations, and write the calibrated robot as a robot file, for `run --calibrated`.",
    example="--seed 3 --output out/believed",
    add_arguments=_add_arguments,
    work=_calibrate,
)


def _columns(found: Calibration) -> list[Column]:
    groups = found.groups
    return [
        Column(("", "parameters"), [g.name for g in groups], to_the_left=True),
        Column(("", "unit"), [g.unit for g in groups], to_the_left=True),
        Column(("rms error", "per axis"), [_digits(g.rms_error) for g in groups]),
        Column(("predicted", "1 sigma"), [_digits(g.rms_sigma) for g in groups]),
        Column(("of it", "noise"), [_digits(g.rms_noise_sigma) for g in groups], rank=1),
        Column(("of it", "fixed"), [_digits(g.rms_fixed_sigma) for g in groups], rank=1),
        Column(("largest", "error"), [_digits(abs(g.errors[g.largest])) for g in groups], rank=1),
        Column(("", "of"), [g.labels[g.largest] for g in groups], rank=2, to_the_left=True),
    ]


def _digits(value: float) -> str:
    """Return a value with three digits, and what is only round-off as 0."""
    return "0" if value < 1e-7 else f"{value:#.3g}".rstrip(".")


def _meaning(found: Calibration) -> str:
    from cdpr_drake.model.pulleys import has_pulleys

    scale = found.setup.scale
    noise = {0.0: "no noise", 1.0: "the usual noise"}.get(scale, f"{scale:g} times the usual noise")
    pulleys = (
        " A_i is where a cable enters its pulley, the point that stays as the pulley swivels. "
        "Radius and axis of the pulleys are not measured but taken from the robot file: where a "
        "cable leaves is wrong by up to twice what the radius is."
    )
    return (
        f"{found.true.name} calibrated with {noise}, seed {found.seed}: calibrated less true, and "
        "the standard deviation that the measurements predict: of noise, which calibrating again "
        "would average out, and of what stays fixed, which are the bends of the cables and the "
        "bias of each point of the patterns. A_i and B_i are known as well as "
        "one can say where the cable bends; X_WF and X_PM as well as poses that turn by "
        f"{math.degrees(found.setup.turn):g} deg tell the one from the other, so their errors go "
        "together."
    ) + (pulleys if has_pulleys(found.true) else "")


def _at_platform(errors: np.ndarray) -> str:
    turn, way = _rms(errors)
    largest = 1e3 * math.sqrt((errors[:, 3:] ** 2).sum(axis=1).max())
    return (
        f"At the platform: with this calibration exact images give its pose in W wrong by "
        f"{_digits(1e3 * way)} mm and {_digits(math.degrees(turn))} deg, root mean square over the "
        f"{len(errors)} poses used, at most {_digits(largest)} mm. A goal given in W is missed by "
        "that; one that the cameras themselves have measured is not."
    )


def _rms(errors: np.ndarray) -> tuple[float, float]:
    """Return the root mean squares of the norms of rotations [rad] and translations [m]."""
    squares = (errors**2).reshape(-1, 2, 3).sum(axis=2).mean(axis=0)
    return math.sqrt(squares[0]), math.sqrt(squares[1])


def _summary(found: Calibration, errors: np.ndarray) -> dict[str, Any]:
    turn, way = _rms(errors)
    return {
        "robot": found.true.name,
        "noise_scale": found.setup.scale,
        "seed": found.seed,
        "groups": {
            g.name: {
                **{name: getattr(g, name) for name in SIZES},
                "labels": list(g.labels),
                **{name: getattr(g, name).tolist() for name in ERRORS},
            }
            for g in found.groups
        },
        "pose_error_rms_mm": 1e3 * way,
        "pose_error_rms_deg": math.degrees(turn),
        "pose_errors_rotation_rad_translation_m": errors.tolist(),
    }
