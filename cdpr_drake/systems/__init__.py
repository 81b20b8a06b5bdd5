"""The pieces of the robot and its control: each a Drake LeafSystem.

Those with a template here, `Name_`, are for float and AutoDiffXd, as `scalar_convertible` makes
them. The sampled cameras, which OpenCV works for, what stands in for sensors, and `FusedPlant`,
which is several of them in one, for speed, are for float.
"""

from cdpr_drake.systems._template import scalar_convertible, template_of
from cdpr_drake.systems.cable_force import CatenaryCableForce
from cdpr_drake.systems.camera import CableTangentCameras, CameraMeasurement
from cdpr_drake.systems.fused_plant import FusedPlant
from cdpr_drake.systems.image_targets import ImageTargets
from cdpr_drake.systems.joint_space import ExponentialApproach, InverseKinematicsAngles
from cdpr_drake.systems.lens import LensDistortion
from cdpr_drake.systems.load_cell import LoadCellFilter
from cdpr_drake.systems.modelled import ModelledTangents, ModelledTension
from cdpr_drake.systems.plausible_tension import PlausibleTension
from cdpr_drake.systems.servo import MotorAngleIntegrator, PoseError, PositionBasedVisualServo
from cdpr_drake.systems.stereo import StereoTangentCameras
from cdpr_drake.systems.stereo_images import StereoImageCameras
from cdpr_drake.systems.targets import TargetCameras
from cdpr_drake.systems.trajectory import TrajectoryReference
from cdpr_drake.systems.winch import WinchDynamics
from cdpr_drake.systems.zero_when_open import ZeroWhenOpen

CableTangentCameras_ = template_of(CableTangentCameras)
CameraMeasurement_ = template_of(CameraMeasurement)
CatenaryCableForce_ = template_of(CatenaryCableForce)
ExponentialApproach_ = template_of(ExponentialApproach)
InverseKinematicsAngles_ = template_of(InverseKinematicsAngles)
LoadCellFilter_ = template_of(LoadCellFilter)
MotorAngleIntegrator_ = template_of(MotorAngleIntegrator)
PlausibleTension_ = template_of(PlausibleTension)
PoseError_ = template_of(PoseError)
PositionBasedVisualServo_ = template_of(PositionBasedVisualServo)
WinchDynamics_ = template_of(WinchDynamics)
ZeroWhenOpen_ = template_of(ZeroWhenOpen)

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
    "TrajectoryReference",
    "WinchDynamics",
    "WinchDynamics_",
    "ZeroWhenOpen",
    "ZeroWhenOpen_",
    "scalar_convertible",
    "template_of",
]
