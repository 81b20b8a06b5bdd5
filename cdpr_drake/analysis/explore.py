"""Everything that is told of a robot at one pose at once, fast enough to follow a slider."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.analysis.gain_matrix import GainMatrix
from cdpr_drake.analysis.platform_modes import rest_modes
from cdpr_drake.analysis.stability import SampledServo
from cdpr_drake.diagrams.watch import LimitWatch
from cdpr_drake.errors import CdprError, SimulationError
from cdpr_drake.model.cable_models import cable_model_name
from cdpr_drake.model.rest_model import RestModel
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import as_pose, pose_to_vector
from cdpr_drake.model.statics import DEFAULT_RULE
from cdpr_drake.study.modes import Mode, Modes
from cdpr_drake.study.state_space import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Answers:
    """What there is to tell of a robot at rest.

    Attributes:
        gamma: the gain matrix, with the robot's linear model at rest.
        modes: of platform and controlled winches, the servo's loop open.
        unstable: the mode with which the closed loop goes unstable at the gain, "" if it is stable.
    """

    gamma: GainMatrix
    modes: Modes
    unstable: str

    @property
    def rest(self) -> RestModel:
        """The robot's linear model at rest."""
        return self.gamma.rest

    @property
    def tension(self) -> Array:
        """Tensions at the drawing points (k,) [N]."""
        return self.rest.rest.tension_at_drawing_point

    @property
    def rates(self) -> tuple[float, float]:
        """Slowest and fastest rate of convergence over the gain."""
        values = self.gamma.eigenvalues.real
        return float(values.min()), float(values.max())

    @property
    def aside(self) -> float:
        """Largest motion across an axis of M per motion asked for along it [m/m]."""
        return float(np.linalg.norm(self.gamma.coupling[3:, 3:], axis=0).max())

    def lowest(self, count: int = 3) -> list[Mode]:
        """Return the oscillations of lowest frequency.

        Args:
            count: how many at most.
        """
        return sorted((m for m in self.modes.modes if m.frequency), key=lambda m: m.frequency)[
            :count
        ]

    def out_of_limits(self) -> list[int]:
        """Return the cables, counted from 1, with tensions outside of the robot's limits.

        Those are of tensions along the chord, from which that at the drawing point differs by up to
        half of the cable's weight.
        """
        cable, weight = self.rest.robot.cable, self.rest.robot.weight_per_metre
        half = 0.5 * weight * self.rest.rest.unstrained_length
        outside = self.tension < cable.min_tension - half
        outside |= self.tension > cable.max_tension + half
        return [int(i) + 1 for i in np.flatnonzero(outside)]


@dataclass(frozen=True, kw_only=True, eq=False)
class Snapshot:
    """A robot at a pose, and what is to be told of it there.

    Attributes:
        robot: the robot, with its payload.
        pose: X_WP.
        cable_model: of the law.
        gain: lambda [1/s].
        answers: None where the robot cannot rest.
        reason: why it cannot; "" where it can.
    """

    robot: CableRobot
    pose: RigidTransform
    cable_model: str
    gain: float
    answers: Answers | None
    reason: str = ""


def explore_pose(
    robot: CableRobot,
    pose: RigidTransform | ArrayLike,
    cable_model: str = "SCMWE",
    *,
    gain: float = 0.1,
    tensions: str = DEFAULT_RULE,
) -> Snapshot:
    """Return tensions, modes, gain matrix and stability of a robot at rest at a pose.

    Takes some 10 ms. A pose where the robot cannot rest is told of, not raised.

    Args:
        robot: the robot, known exactly to its controller.
        pose: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        cable_model: of the law, "ECM", "CMWE", "SCMWE" or "SLSM".
        gain: lambda [1/s] of the loop, sampled and late as the robot's cameras are.
        tensions: one of `model.statics.RULES`.

    Raises:
        ValueError: an unknown cable model or rule, or a gain that is not positive.
    """
    cable_model = cable_model_name(cable_model)
    if not (np.isfinite(gain) and gain > 0.0):
        raise ValueError(f"the gain must be positive and finite, got {gain}/s")
    X_WP = as_pose(pose)
    answers, reason = None, ""
    try:
        LimitWatch(robot).check_pose(0.0, pose_to_vector(X_WP))
        answers = _answers(robot, X_WP, cable_model, gain, tensions)
    except SimulationError as error:
        reason = f"{error.quantity} {error.message}"
    except CdprError as error:
        reason = str(error)
    except np.linalg.LinAlgError as error:
        reason = f"its linear model there has no modes: {error}"
    return Snapshot(
        robot=robot, pose=X_WP, cable_model=cable_model, gain=gain, answers=answers, reason=reason
    )


def _answers(
    robot: CableRobot, X_WP: RigidTransform, cable_model: str, gain: float, tensions: str
) -> Answers:
    cameras = robot.cameras
    servo = SampledServo(
        robot, X_WP, cameras.sample_time, cable_model=cable_model, tensions=tensions
    )
    unstable = ""
    if servo.growth(gain, cameras.latency).real > 0.0:
        found, mode = servo.critical(gain, cameras.latency)
        unstable = f"{found.name(mode)} at {mode.frequency:.2g} Hz"
    return Answers(
        gamma=servo.gamma, modes=rest_modes(servo.gamma.rest, "controlled"), unstable=unstable
    )
