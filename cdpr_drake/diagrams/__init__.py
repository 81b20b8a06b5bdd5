"""Robot and control loops as Drake diagrams, their rest contexts, and their simulation."""

from cdpr_drake.diagrams.blocks import (
    Block,
    blocks,
    continuous_state_names,
    discrete_state_names,
    hand_over,
)
from cdpr_drake.diagrams.joint_space import JointSpaceLoop, make_joint_space_control
from cdpr_drake.diagrams.rendering import make_pose_camera_images, rendering_available
from cdpr_drake.diagrams.rest import rest_context, robot_of, set_at_rest
from cdpr_drake.diagrams.robot import make_cable_robot, make_plant, make_platform, platform_pose
from cdpr_drake.diagrams.sensing import (
    GaussianSensing,
    ImageSensing,
    Measurements,
    ModelledSensing,
    PlantToMeasure,
    TargetSensing,
)
from cdpr_drake.diagrams.simulation import Record, make_simulator, simulate
from cdpr_drake.diagrams.timing import Timing
from cdpr_drake.diagrams.vision_loop import VisionLoop, make_vision_based_control

__all__ = [
    "Block",
    "GaussianSensing",
    "ImageSensing",
    "JointSpaceLoop",
    "Measurements",
    "ModelledSensing",
    "PlantToMeasure",
    "Record",
    "TargetSensing",
    "Timing",
    "VisionLoop",
    "blocks",
    "continuous_state_names",
    "discrete_state_names",
    "hand_over",
    "make_cable_robot",
    "make_joint_space_control",
    "make_plant",
    "make_platform",
    "make_pose_camera_images",
    "make_simulator",
    "make_vision_based_control",
    "platform_pose",
    "rendering_available",
    "rest_context",
    "robot_of",
    "set_at_rest",
    "simulate",
]
