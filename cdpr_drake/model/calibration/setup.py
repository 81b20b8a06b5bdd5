"""How a robot is calibrated: what is measured how often, and how well."""

from __future__ import annotations

import dataclasses
import math

from cdpr_drake.model.calibration_errors import CalibrationErrors


@dataclasses.dataclass(frozen=True, kw_only=True)
class CalibrationSetup:
    """What is measured, and with what standard deviations.

    The paper takes 25 images of a checkerboard, a laser tracker, and a few poses with small turns
    (section 4.3); the numbers it does not print are judged here. A tracker errs by 15 um + 6 um/m
    at most, of which a typical error is half (specification of the Leica Absolute Trackers):
    0.05 mm at 15 m. What the tracker cannot tell is where in the eyelet or shackle the cable bends:
    that is the largest part of the errors of A_i and B_i. With a pulley A_i is where the cable
    enters it, the point that stays as the pulley swivels; radius and axis are taken as known.

    Args:
        views: of the checkerboard, of each camera or pair.
        tracked_views: of these, with the board measured by the tracker, of each pair.
        poses: of the platform.
        turn: of the platform about each axis, root mean square [rad].
        cloud: points measured around each A_i and B_i.
        corner_noise: of a checkerboard's corner in an image [px].
        tracker_noise: of each coordinate of a point [m].
        cloud_noise: of each coordinate of a point of a cloud, as it is touched [m].
        drawing_point: how far the cable's bend, or its entry into the pulley, is from the middle of
            the cloud, each axis [m].
        attachment_point: the same at the platform [m].
        scale: of all noise, that of the robot's images too; 0 for exact measurements.

    Raises:
        ValueError: a number is negative, or not finite, or a count is below 1.
    """

    views: int = 25
    tracked_views: int = 8
    poses: int = 12
    turn: float = math.radians(4.0)
    cloud: int = 9
    corner_noise: float = 0.1
    tracker_noise: float = 5.0e-5
    cloud_noise: float = 1.0e-3
    drawing_point: float = CalibrationErrors.drawing_points
    attachment_point: float = CalibrationErrors.attachment_points
    scale: float = 1.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if isinstance(value, int) and value < 1 and name != "scale":
                raise ValueError(f"{name}: must be at least 1, got {value}")
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name}: must be finite and not negative, got {value}")
        for name in ("corner_noise", "tracker_noise", "cloud_noise"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name}: must be positive (scale = 0 makes measurements exact)")

    def replace(self, **fields: float) -> CalibrationSetup:
        """Return a copy with some `fields` changed, checked like a new one."""
        return dataclasses.replace(self, **fields)  # type: ignore[arg-type]
