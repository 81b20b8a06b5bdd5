"""The pieces of the robot and its control: each a Drake LeafSystem.

All are for float and AutoDiffXd, but for the sampled cameras, which OpenCV works for, for what
stands in for sensors, and for `FusedPlant`, which is several of them in one, for speed.
"""

from cdpr_drake.systems.cable_force import CatenaryCableForce, CatenaryCableForce_
from cdpr_drake.systems.camera import (
    CableTangentCameras,
    CableTangentCameras_,
    CameraMeasurement,
    CameraMeasurement_,
)
from cdpr_drake.systems.fused_plant import FusedPlant
from cdpr_drake.systems.image_targets import ImageTargets
from cdpr_drake.systems.joint_space import (
    ExponentialApproach,
    ExponentialApproach_,
    InverseKinematicsAngles,
    InverseKinematicsAngles_,
)
from cdpr_drake.systems.lens import LensDistortion
from cdpr_drake.systems.load_cell import LoadCellFilter, LoadCellFilter_
from cdpr_drake.systems.modelled import ModelledTangents, ModelledTension
from cdpr_drake.systems.plausible_tension import PlausibleTension, PlausibleTension_
from cdpr_drake.systems.servo import (
    MotorAngleIntegrator,
    MotorAngleIntegrator_,
    PoseError,
    PoseError_,
    PositionBasedVisualServo,
    PositionBasedVisualServo_,
)
from cdpr_drake.systems.stereo import StereoTangentCameras
from cdpr_drake.systems.stereo_images import StereoImageCameras
from cdpr_drake.systems.targets import TargetCameras
from cdpr_drake.systems.winch import WinchDynamics, WinchDynamics_
from cdpr_drake.systems.zero_when_open import ZeroWhenOpen, ZeroWhenOpen_

__all__ = [
    "CableTangentCameras",
    "CableTangentCameras_",
    "CameraMeasurement",
    "CameraMeasurement_",
    "CatenaryCableForce",
    "CatenaryCableForce_",
    "ExponentialApproach",
    "ExponentialApproach_",
    "FusedPlant",
    "ImageTargets",
    "InverseKinematicsAngles",
    "InverseKinematicsAngles_",
    "LensDistortion",
    "LoadCellFilter",
    "LoadCellFilter_",
    "ModelledTangents",
    "ModelledTension",
    "MotorAngleIntegrator",
    "MotorAngleIntegrator_",
    "PlausibleTension",
    "PlausibleTension_",
    "PoseError",
    "PoseError_",
    "PositionBasedVisualServo",
    "PositionBasedVisualServo_",
    "StereoImageCameras",
    "StereoTangentCameras",
    "TargetCameras",
    "WinchDynamics",
    "WinchDynamics_",
    "ZeroWhenOpen",
    "ZeroWhenOpen_",
]
