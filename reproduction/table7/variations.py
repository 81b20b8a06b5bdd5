"""What Table 7's final errors hang on: one value at a time is changed, without dynamics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cdpr_drake import CableRobot
from cdpr_drake.errors import CdprError
from cdpr_drake.model.calibration_errors import CalibrationErrors, misjudged
from cdpr_drake.model.rotations import Array
from reproduction.assumptions import assumed, assumptions
from reproduction.section import Result
from reproduction.table7.large_robot import (
    MODELS,
    believed_robot,
    final_errors,
    slow_run,
    true_robot,
)

WITHOUT_PART = ("damping_time", "drag", "target_signs")
"""Values that play no part in slow motion, or are no matter of size."""

SOFT = 2.0
"""A modulus far below that of steel ropes [GPa]."""

LIGHTER = 0.9
"""What the controller takes for the cable's mass, over the true one."""

POINTS = CalibrationErrors(
    camera_position=0.0, camera_angle=0.0, target_position=0.0, target_angle=0.0
)
FRAMES = CalibrationErrors(drawing_points=0.0, attachment_points=0.0)


def variations() -> dict[str, dict[str, Any]]:
    """Return the values that change, by the key of what is varied.

    Each value of the file of assumptions goes to either end of its range; the rest is other than
    these. A calibration error is one random draw, in place of the target frame's.
    """
    varied: dict[str, dict[str, Any]] = {"none": {}}
    for name, entry in assumptions("table7").items():
        if name in WITHOUT_PART:
            continue
        for end, value in (("low", entry.low), ("high", entry.high)):
            if value != entry.value:
                varied[f"{name}_{end}"] = {name: value}
    return varied | {
        "soft": {"modulus": SOFT},
        "light": {"lighter": LIGHTER},
        "points": {"calibration": POINTS},
        "frames": {"calibration": FRAMES},
        "centred": {"tensions": "within limits"},
    }


def vary(key: str) -> Result:
    """Return the final errors of the four models after one change, without dynamics.

    The result holds errors [mm, deg] (4, 2), NaN where the robot cannot move so, and then why.

    Args:
        key: of `variations`.
    """
    try:
        return {"errors": slow_errors(assumed("table7") | variations()[key]), "failed": ""}
    except CdprError as error:
        return {"errors": np.full((len(MODELS), 2), np.nan), "failed": str(error)}


def slow_errors(values: Mapping[str, Any]) -> Array:
    """Return final errors [mm, deg] (4, 2), rows as in `MODELS`, of moves without dynamics.

    Args:
        values: as for `slow_run`, and perhaps tensions, calibration, lighter.
    """
    believed, tensions = _believed(values), values.get("tensions", "minimum norm")
    runs = [slow_run(values, model, believed, tensions) for model in MODELS]
    return np.array([final_errors(r.position_error, r.rotation_error) for r in runs])


def _believed(values: Mapping[str, Any]) -> CableRobot:
    robot = true_robot(values)
    if "calibration" in values:
        return misjudged(robot, values["calibration"], seed=1)
    robot = believed_robot(robot, values)
    if "lighter" in values:
        cable, share = robot.cable, values["lighter"]
        density, section = share * cable.linear_density, share * cable.section
        robot = robot.replace(cable=cable.replace(linear_density=density, section=section))
    return robot
