"""Which gain a vision-based loop has where nobody asks for one.

The robot file's, if it names one; else the customary one, or half the gain limit at the goal where
that is less: a loop at half its limit still swings little, and on CoGiRo the customary gain is far
below.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.analysis.stability import LOWEST_GAIN, GainLimit, SampledServo, find_gain_limit
from cdpr_drake.diagrams.timing import Timing
from cdpr_drake.diagrams.watch import LimitWatch
from cdpr_drake.errors import CdprError, PredictionError
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import as_pose, pose_to_vector
from cdpr_drake.model.servo import CUSTOMARY_GAIN
from cdpr_drake.model.statics import DEFAULT_RULE

SHARE_OF_LIMIT = 0.5
"""The most that a gain is of its limit unless somebody asks for more."""

NEARLY_CONTINUOUS = 1e-3
"""A loop sampled so often [s] has the gain limit of the continuous one to within a per cent."""

MOST_FRAMES_LATE = 10
"""Up to this latency, in frames, the gain limit is found in a fraction of a second."""

SMALLEST_GAIN = 1e-6
"""Below this gain [1/s] no limit is looked for: a loop unstable there is so at any gain."""

POINTS = 40
"""Number of gains to scan for a limit."""


@dataclass(frozen=True, kw_only=True)
class DefaultGain:
    """A gain that nobody asked for, and why it is this one.

    Attributes:
        gain: lambda [1/s].
        decided_by: "robot file", "custom" or "limit".
        limit: up to the gain from which on the customary one stands; None if it was not asked for,
            because the robot file names a gain, or could not be predicted.
        share: the most that the gain may be of its limit.
    """

    gain: float
    decided_by: str
    limit: GainLimit | None = None
    share: float = SHARE_OF_LIMIT

    def reason(self, where: str = "at the goal") -> str:
        """Return in words why it is this gain, "" if it is the customary one.

        Args:
            where: the limit holds.
        """
        if self.decided_by == "robot file":
            return "as the robot file says"
        if self.decided_by == "limit" and self.limit is not None:
            part = "half" if self.share == 0.5 else f"{self.share:g} of"
            limit = f"the limit of {self.limit.gain:.2g} 1/s {where}"
            return f"{part} {limit}, with the damping assumed"
        return ""

    def to_dict(self) -> dict[str, Any]:
        """Return gain, what decided, and the limit where that is known, as plain values."""
        limit = math.inf if self.limit is None else float(self.limit.gain)
        return {
            "gain_per_s": self.gain,
            "gain_decided_by": self.decided_by,
            "gain_limit_per_s": limit if math.isfinite(limit) else None,
        }


def default_gain(
    robot: CableRobot,
    goal: RigidTransform | ArrayLike,
    cable_model: str = "SCMWE",
    sample_time: float | None = 0.05,
    latency: float = 0.04,
    *,
    believed: CableRobot | None = None,
    tensions: str = DEFAULT_RULE,
    customary: float = CUSTOMARY_GAIN,
    share: float = SHARE_OF_LIMIT,
) -> DefaultGain:
    """Return the gain of a vision-based loop for which nobody asks for one.

    It is the robot's own if its file names one. Else it is the customary gain, or half the smallest
    gain at which the loop is unstable at the goal, rounded down to two digits, if that is less. The
    customary gain stands too where the limit is not predicted, and where no gain is stable: what
    starts a run warns of both. Takes some 15 ms.

    Args:
        robot: the true robot, with its payload.
        goal: where the controller sees it, X_WP or [roll, pitch, yaw, x, y, z] (rad, m).
        cable_model: the law's "ECM", "CMWE", "SCMWE" or "SLSM".
        sample_time: of the vision loop [s]; None for an all-continuous loop.
        latency: from image to change of the motor rates [s].
        believed: the robot as the controller knows it; the true one if None.
        tensions: one of `model.statics.RULES`.
        customary: [1/s], the gain where the limit does not matter.
        share: the most that the gain may be of its limit.

    Raises:
        ValueError: a time out of range, an unknown cable model or rule.
    """
    if robot.gain is not None:
        return DefaultGain(gain=robot.gain, decided_by="robot file", share=share)
    try:
        LimitWatch(robot).check_pose(0.0, pose_to_vector(as_pose(goal)))
        limit = predicted_limit(
            robot,
            goal,
            cable_model,
            sample_time,
            latency,
            believed=believed,
            tensions=tensions,
            highest=customary / share,
        )
    except CdprError:
        return DefaultGain(gain=customary, decided_by="custom", share=share)
    if 0.0 < limit.gain < customary / share:
        gain = _rounded_down(share * limit.gain)
        return DefaultGain(gain=gain, decided_by="limit", limit=limit, share=share)
    return DefaultGain(gain=customary, decided_by="custom", limit=limit, share=share)


def lowest_gain(gains: Iterable[DefaultGain]) -> DefaultGain:
    """Return the one of several gains, of loops that are compared, that is good for all of them.

    Args:
        gains: at least one.
    """
    return min(gains, key=lambda found: found.gain)


def predicted_limit(
    robot: CableRobot,
    goal: RigidTransform | ArrayLike,
    cable_model: str = "SCMWE",
    sample_time: float | None = 0.05,
    latency: float = 0.04,
    *,
    believed: CableRobot | None = None,
    tensions: str = DEFAULT_RULE,
    highest: float,
) -> GainLimit:
    """Return the gain limit of a loop up to some gain, of a continuous one too.

    Looks below where `gain_limit` begins, too, if the loop is unstable there.

    Args:
        robot: the true robot, with its payload.
        goal: where the controller sees it, X_WP or [roll, pitch, yaw, x, y, z] (rad, m).
        cable_model: the law's "ECM", "CMWE", "SCMWE" or "SLSM".
        sample_time: of the vision loop [s]; None for an all-continuous loop.
        latency: from image to change of the motor rates [s].
        believed: the robot as the controller knows it; the true one if None.
        tensions: one of `model.statics.RULES`.
        highest: gain [1/s] to search up to.

    Raises:
        GeometryError, TensionError, EquilibriumError: the robot cannot rest there.
        PredictionError: the loop is too late for a prediction.
        ValueError: a time out of range, an unknown cable model or rule.
    """
    if believed is not None and believed.num_cables != robot.num_cables:
        k = robot.num_cables
        raise ValueError(f"{believed.num_cables} cables in the robot believed, {k} in the true one")
    period = NEARLY_CONTINUOUS if sample_time is None else sample_time
    delay = 0.0 if sample_time is None else latency
    Timing(sample_time=period, latency=delay)  # refuses what is out of range
    if delay > MOST_FRAMES_LATE * period:
        raise PredictionError(f"the latency is above {MOST_FRAMES_LATE} frames")
    servo = SampledServo(
        robot, goal, period, believed=believed, cable_model=cable_model, tensions=tensions
    )
    limit = find_gain_limit(servo, delay, highest=highest, points=POINTS)
    if limit.gain > 0.0:
        return limit
    lower = find_gain_limit(servo, delay, lowest=SMALLEST_GAIN, highest=LOWEST_GAIN, points=POINTS)
    if lower.gain == 0.0 or not lower.unstable:
        return limit
    first = (lower.unstable[-1][0], limit.unstable[0][1])
    return dataclasses.replace(
        limit,
        gain=lower.gain,
        mode=lower.mode,
        frequency=lower.frequency,
        unstable=(*lower.unstable[:-1], first, *limit.unstable[1:]),
    )


def _rounded_down(value: float) -> float:
    """Return a positive value with two digits, never more than it is."""
    rounded = float(f"{value:.2g}")
    if rounded <= value:
        return rounded
    return float(f"{value - 10.0 ** (math.floor(math.log10(value)) - 1):.2g}")
