"""What ends a run: leaving the workspace, a singular attitude, numbers that are none."""

from __future__ import annotations

import math

import numpy as np

from cdpr_drake.errors import SimulationError
from cdpr_drake.model.robot import CableRobot

PITCH_MARGIN = math.radians(5.0)

WATCH_PERIOD = 0.05
"""Time between two looks at the pose [s]; the cables' own state is checked at every evaluation."""


class LimitWatch:
    """Checks on a running robot. Slack is physical and only noted; the rest ends the run.

    Args:
        robot: the robot.
    """

    def __init__(self, robot: CableRobot) -> None:
        from scipy.spatial import ConvexHull, QhullError

        self.slack: dict[int, float] = {}
        points = robot.drawing_points
        self._normals, self._offsets = np.zeros((0, 2)), np.zeros(0)
        self._top = float(points[:, 2].max())
        try:
            equations = ConvexHull(points[:, :2]).equations
            self._normals, self._offsets = equations[:, :2], equations[:, 2]
        except QhullError:
            # Fewer than three drawing points, or all on a line: no area to stay within.
            self._top = math.inf
        self._slack_tension = robot.weight_per_metre * float(np.ptp(points, axis=0).max()) / 20.0

    def check_pose(self, time: float, pose: np.ndarray) -> None:
        """Raise SimulationError where a `pose` (6,) at a `time` [s] leaves what the model covers.

        The platform's origin must stay under the drawing points, within the hull of their plan.
        """
        pitch, x, y, z = pose[1], pose[3], pose[4], pose[5]
        if not math.isfinite(pose.sum()):
            raise SimulationError("platform pose", time, "a value is not finite")
        if abs(abs((pitch + math.pi) % (2.0 * math.pi) - math.pi) - 0.5 * math.pi) < PITCH_MARGIN:
            raise SimulationError(
                "platform pitch", time, f"{math.degrees(pitch):.1f} deg is within 5 deg of 90"
            )
        outside = self._offsets.size and (self._normals @ pose[3:5] + self._offsets).max() > 0.0
        if outside or z > self._top:
            raise SimulationError(
                "platform position",
                time,
                f"({x:.2f}, {y:.2f}, {z:.2f}) m is outside the hull of the drawing points",
            )

    def check_tensions(self, time: float, tension: np.ndarray) -> None:
        """Note the cables whose `tension` (k,) [N] at the drawing point says slack, and the `time`.

        Raises:
            SimulationError: a tension is not finite.
        """
        if not math.isfinite(tension.sum()):
            worst = int(np.argmin(np.isfinite(tension))) + 1
            raise SimulationError(
                f"tension at the drawing point of cable {worst}", time, "not finite"
            )
        for cable in np.flatnonzero(tension < self._slack_tension):
            self.slack.setdefault(int(cable) + 1, time)
