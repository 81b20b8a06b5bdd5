"""Calibration as in section 4.3: checkerboard, laser tracker, and a few poses of the platform."""

from cdpr_drake.model.calibration.boards import Board
from cdpr_drake.model.calibration.calibrate import calibrate
from cdpr_drake.model.calibration.cameras import TrackedBoard, calibrate_camera, calibrate_pair
from cdpr_drake.model.calibration.result import Calibration, ParameterGroup, seen_wrongly
from cdpr_drake.model.calibration.setup import CalibrationSetup
from cdpr_drake.model.calibration.site import platform_poses
from cdpr_drake.model.calibration.transforms import PlatformViews, calibrate_transforms

__all__ = [
    "Board",
    "Calibration",
    "CalibrationSetup",
    "ParameterGroup",
    "PlatformViews",
    "TrackedBoard",
    "calibrate",
    "calibrate_camera",
    "calibrate_pair",
    "calibrate_transforms",
    "platform_poses",
    "seen_wrongly",
]
