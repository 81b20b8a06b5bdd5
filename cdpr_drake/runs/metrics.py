"""What a run is judged by: final errors, settling, excursions, tensions."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from cdpr_drake.diagrams.simulation import Record
from cdpr_drake.model.rotations import Array
from cdpr_drake.study.response import excursion

FINAL_WINDOW = 1.0
"""Final errors are means over the last second of a run, as long as a run lasts that long [s]."""

SETTLED_FRACTION = 0.02
"""A run has settled when the position error stays below this part of its first value."""

TOLERANCE = (0.010, np.radians(0.5))
"""The accuracy the paper claims in its section 1: 10 mm [m] and 0.5 degrees [rad]."""


@dataclass(frozen=True, kw_only=True)
class Summary:
    """What a run is judged by. The error s is that of the target frame M (eq. 18), norms of s.

    The true error is that of the robot's actual pose, the seen one what the controller took for it.

    Attributes:
        position_error: true, final: mean over the last second [mm].
        orientation_error: true, final [deg].
        offset: final position of M, true minus desired, (x, y, z) in W [mm].
        position_error_seen: seen, final [mm]; None under joint space control, which sees no pose.
        orientation_error_seen: seen, final [deg]; None likewise.
        settled_after: when the true position error has come below 2 % of its first value to stay
            [s]; None if it has not.
        within_tolerance_after: when the true errors have come below 10 mm and 0.5 deg to stay [s];
            None if they have not.
        position_excursion: largest distance of s_t from the segment between s_t(0) and 0 [mm]. The
            ideal law keeps to it, s(t) = c(t) s(0) with c falling from 1 to 0 (eq. 18); motion to
            the side, beyond the goal (overshoot) and backwards at the start all count, and no
            component of s overshoots by more.
        orientation_excursion: the same of s_w [deg].
        lowest_tension: over all cables and the whole run, at the drawing points [N].
        lowest_tension_cable: the cable it is in, counting from 1.
        highest_tension: over all cables and the whole run, at the drawing points [N].
        highest_tension_cable: the cable it is in, counting from 1.
        slack_cables: for each cable (counting from 1) that went slack, the first time [s].
        pose_frames_lost: frames without a pose, so that the last was held; None if cameras deliver
            the truth with noise, or under joint space control.
        pose_images_lost: images of single pose cameras that were of no use; None likewise.
        tangent_frames_lost: for each cable the frames without a tangent; None likewise.
        step: the integrator's, at its smallest [s].
        step_decided_by: "usual", "modes" or "given", see `diagrams.step.Step`.
        step_mode: the mode that allows the smallest step, in words.
        step_warning: why a step given is too coarse for it; None if it is not.
        simulated_time: [s].
        wall_time: how long the run took [s].
        real_time_factor: simulated time over the time it took.
    """

    position_error: float
    orientation_error: float
    offset: tuple[float, float, float]
    position_error_seen: float | None
    orientation_error_seen: float | None
    settled_after: float | None
    within_tolerance_after: float | None
    position_excursion: float
    orientation_excursion: float
    lowest_tension: float
    lowest_tension_cable: int
    highest_tension: float
    highest_tension_cable: int
    slack_cables: dict[int, float]
    pose_frames_lost: int | None
    pose_images_lost: int | None
    tangent_frames_lost: tuple[int, ...] | None
    step: float
    step_decided_by: str
    step_mode: str
    step_warning: str | None
    simulated_time: float
    wall_time: float
    real_time_factor: float

    def to_dict(self) -> dict[str, Any]:
        """Return the summary as plain values, as JSON takes them, each unit in its key."""
        return {
            f"{name}_{_UNITS[name]}" if name in _UNITS else name: value
            for name, value in dataclasses.asdict(self).items()
        }


_UNITS = {
    "position_error": "mm",
    "orientation_error": "deg",
    "offset": "mm",
    "position_error_seen": "mm",
    "orientation_error_seen": "deg",
    "settled_after": "s",
    "within_tolerance_after": "s",
    "position_excursion": "mm",
    "orientation_excursion": "deg",
    "lowest_tension": "N",
    "highest_tension": "N",
    "slack_cables": "s",
    "step": "s",
    "simulated_time": "s",
    "wall_time": "s",
}


def final_errors(time: Array, error: Array) -> tuple[float, float]:
    """Return the mean size of the last second's position error [mm] and orientation error [deg].

    Args:
        time: (n,) [s].
        error: (n, 6) s = [s_w; s_t] (rad, m).
    """
    last = error[time >= time[-1] - FINAL_WINDOW]
    orientation, position = np.linalg.norm(last.reshape(-1, 2, 3), axis=2).mean(axis=0)
    return 1e3 * float(position), float(np.degrees(orientation))


def settling_time(time: Array, is_settled: Array) -> float | None:
    """Return the first time [s] after which a condition holds to the end, None if there is none.

    Args:
        time: (n,) [s].
        is_settled: (n,) whether the condition holds.
    """
    broken = np.flatnonzero(np.logical_not(is_settled))
    first = broken[-1] + 1 if broken.size else 0
    return float(time[first]) if first < time.size else None


def summarize(record: Record, offset: Array) -> Summary:
    """Return the summary of a run.

    Args:
        record: with "pose_error" to the goal, "pose_error_seen" if the controller sees the pose,
            and "tension_at_drawing_point".
        offset: (n, 3) position of M, true minus desired, in W [m].
    """
    time, error = record.time, record["pose_error"]
    size = np.linalg.norm(error.reshape(-1, 2, 3), axis=2)
    position, orientation = final_errors(time, error)
    seen: tuple[float | None, float | None] = (None, None)
    if "pose_error_seen" in record.signals:
        seen = final_errors(time, record["pose_error_seen"])
    straying = excursion(error)
    x, y, z = (1e3 * offset[time >= time[-1] - FINAL_WINDOW].mean(axis=0)).tolist()
    tension = record["tension_at_drawing_point"]
    low, high = tension.min(axis=0), tension.max(axis=0)
    lost = {
        name: tuple(int(count) for count in record[name][-1])
        for name in ("frames_lost", "images_lost", "tangent_frames_lost")
        if name in record.signals
    }
    return Summary(
        position_error=position,
        orientation_error=orientation,
        offset=(x, y, z),
        position_error_seen=seen[0],
        orientation_error_seen=seen[1],
        settled_after=settling_time(time, size[:, 1] < SETTLED_FRACTION * size[0, 1]),
        within_tolerance_after=settling_time(
            time, (size[:, 1] < TOLERANCE[0]) & (size[:, 0] < TOLERANCE[1])
        ),
        position_excursion=1e3 * straying[0],
        orientation_excursion=float(np.degrees(straying[1])),
        lowest_tension=float(low.min()),
        lowest_tension_cable=int(low.argmin()) + 1,
        highest_tension=float(high.max()),
        highest_tension_cable=int(high.argmax()) + 1,
        slack_cables=dict(record.slack_cables),
        pose_frames_lost=sum(lost["frames_lost"]) if "frames_lost" in lost else None,
        pose_images_lost=sum(lost["images_lost"]) if "images_lost" in lost else None,
        tangent_frames_lost=lost.get("tangent_frames_lost"),
        step=record.step.size,
        step_decided_by=record.step.decided_by,
        step_mode=record.step.mode,
        step_warning=record.step.doubt or None,
        simulated_time=float(time[-1] - time[0]),
        wall_time=record.wall_time,
        real_time_factor=record.real_time_factor,
    )
