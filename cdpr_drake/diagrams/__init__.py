"""Robot and control loops as Drake diagrams, their rest contexts, and their simulation."""

from cdpr_drake.diagrams.blocks import Block, blocks
from cdpr_drake.diagrams.control import (
    make_joint_space_control,
    make_vision_based_control,
    with_reference,
)
from cdpr_drake.diagrams.rendering import make_pose_camera_images, rendering_available
from cdpr_drake.diagrams.rest import rest_context, robot_of, set_at_rest
from cdpr_drake.diagrams.robot import make_cable_robot, make_platform, platform_pose
from cdpr_drake.diagrams.simulation import Record, make_simulator, simulate

__all__ = [
    "Block",
    "Record",
    "blocks",
    "make_cable_robot",
    "make_joint_space_control",
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
    "with_reference",
]
