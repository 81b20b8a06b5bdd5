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
        self.slack: dict[int, float] = {}
        points = robot.drawing_points
        corners = convex_hull(points[:, :2])
        edges = np.roll(corners, -1, axis=0) - corners
        self._normals = np.column_stack([edges[:, 1], -edges[:, 0]])
        self._offsets = np.sum(self._normals * corners, axis=1)
        # Fewer than three corners: the drawing points enclose no area to stay within.
        self._encloses = len(corners) >= 3
        self._top = float(points[:, 2].max())
        # A slack cable still bears its own weight at the drawing point, so tension never comes near
        # zero there: slack is less than the weight of a cable as long as the frame.
        self._slack_tension = robot.weight_per_metre * float(np.ptp(points, axis=0).max())

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
        outside = (self._normals @ pose[3:5] > self._offsets).any() or z > self._top
        if self._encloses and outside:
            raise SimulationError(
                "platform position",
                time,
                f"({x:.2f}, {y:.2f}, {z:.2f}) m is outside the hull of the drawing points",
            )

    def check_tensions(self, time: float, tension: np.ndarray) -> None:
        """Note the cables whose `tension` (k,) [N] at the drawing point says slack, and the `time`.

        Slack is a tension below the weight of a cable as long as the frame: a sag of an eighth.

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


def convex_hull(points: np.ndarray) -> np.ndarray:
    """Return the corners (m, 2), counterclockwise, of the convex hull of `points` (n, 2).

    Andrew's monotone chain: worth having here, where importing a library for it takes longer.
    """
    ordered = [tuple(p) for p in np.unique(points, axis=0)]
    corners: list[tuple[float, ...]] = []
    for chain in (ordered, ordered[::-1]):
        start = len(corners)
        for p in chain:
            while len(corners) >= start + 2 and not _turns_left(corners[-2], corners[-1], p):
                corners.pop()
            corners.append(p)
        corners.pop()
    return np.array(corners).reshape(-1, 2)


def _turns_left(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> bool:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0
