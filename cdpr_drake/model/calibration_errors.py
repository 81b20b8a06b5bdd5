"""How well a robot is known: random calibration errors of the sizes section 4.3 speaks of."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.model.pulleys import has_pulleys
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, exp_rotation


@dataclasses.dataclass(frozen=True, kw_only=True)
class CalibrationErrors:
    """Standard deviations of what a calibration leaves, per axis.

    The paper measures the points with a laser tracker and the two transforms with tracker and
    camera together (section 4.3), and prints no accuracies; these are a judgement of them.

    Args:
        drawing_points: of each A_i, with a pulley of where the cable enters it [m].
        attachment_points: of each B_i [m].
        camera_position: of ^fT_b, where the origin of F_b is in F_f [m].
        camera_angle: of ^fT_b, how F_b is turned about its origin [rad].
        target_position: of ^mT_e, where the origin of F_e is in F_m [m].
        target_angle: of ^mT_e, how F_e is turned about its origin [rad].
        pulley_radius: of the pulleys' radius to the cable's centre line, one error for all of them,
            as they are of one make [m]; nothing to a robot without pulleys.

    Raises:
        ValueError: one is negative or not finite.
    """

    drawing_points: float = 2.0e-3
    attachment_points: float = 1.5e-3
    camera_position: float = 3.0e-3
    camera_angle: float = math.radians(0.1)
    target_position: float = 2.0e-3
    target_angle: float = math.radians(0.1)
    pulley_radius: float = 1.0e-3

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name}: must be finite and not negative, got {value}")

    def scaled(self, factor: float) -> CalibrationErrors:
        """Return these errors, each times a `factor`."""
        return CalibrationErrors(**{name: factor * value for name, value in vars(self).items()})


def misjudged(robot: CableRobot, errors: CalibrationErrors, seed: int) -> CableRobot:
    """Return the robot as a controller believes it after one random calibration.

    Args:
        robot: the true robot.
        errors: how large the errors are.
        seed: which calibration; the same one gives the same errors, in the same proportion
            whatever their size. A radius that comes out below zero is believed to be zero, an
            eyelet.
    """
    draw = np.random.default_rng(seed).standard_normal
    A, B = draw((robot.num_cables, 3)), draw((robot.num_cables, 3))
    turn_f, shift_f, turn_m, shift_m = draw((4, 3))
    radius_error = errors.pulley_radius * float(draw())
    cameras = robot.cameras
    if has_pulleys(robot):
        rho = robot.pulleys.radius
        rho = np.where(rho > 0.0, np.maximum(rho + radius_error, 0.0), 0.0)
        robot = robot.replace(pulleys=robot.pulleys.replace(radius=rho))
    return robot.replace(
        drawing_points=robot.drawing_points + errors.drawing_points * A,
        attachment_points=robot.attachment_points + errors.attachment_points * B,
        cameras=cameras.replace(
            X_WF=_small_motion(-errors.camera_angle * turn_f, errors.camera_position * shift_f)
            @ cameras.X_WF,
            X_PM=_small_motion(-errors.target_angle * turn_m, errors.target_position * shift_m)
            @ cameras.X_PM,
        ),
    )


def _small_motion(turn: Array, shift: Array) -> RigidTransform:
    return RigidTransform(RotationMatrix(exp_rotation(turn)), shift)
