"""The cameras of the vision-based loop, by what they deliver: truth with noise, points, images."""

from __future__ import annotations

from pydrake.systems.framework import DiagramBuilder, InputPort, LeafSystem, OutputPort

from cdpr_drake.diagrams.rendering import make_pose_camera_images
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.vision.outages import Outage
from cdpr_drake.systems import (
    CableTangentCameras,
    CameraMeasurement,
    ImageTargets,
    StereoImageCameras,
    StereoTangentCameras,
    TargetCameras,
)

SENSORS = ("gaussian", "targets", "images")
"""What cameras deliver: the truth with Gaussian noise, what follows from what they see of points
and edges, or what is detected in rendered and drawn images."""


def check_sensors(sensors: str, sample_time: float | None, latency: float) -> bool:
    """Return whether the cameras see by themselves, and so sample; else they deliver the truth.

    Args:
        sensors: one of `SENSORS`.
        sample_time: period of the vision loop [s], or None.
        latency: [s].

    Raises:
        ValueError: unknown sensors, or sensors that see without sampling or without latency.
    """
    if sensors not in SENSORS:
        raise ValueError(f'unknown sensors "{sensors}"; known are {", ".join(SENSORS)}')
    if sensors == "gaussian":
        return False
    if sample_time is None:
        raise ValueError(f"cameras that see {sensors} take images: give a sample time")
    if latency <= 0.0:
        raise ValueError(f"cameras that see {sensors} take time: the latency must be above 0")
    return True


def add_pose_cameras(
    builder: DiagramBuilder,
    pose: OutputPort,
    robot: CableRobot,
    believed: CableRobot,
    sensors: str,
    sample_time: float | None,
    estimator: str,
    outages: tuple[Outage, ...],
) -> tuple[LeafSystem, dict[str, InputPort]]:
    """Add the block "camera" and what it needs; return it and the inputs for noise by name.

    Args:
        builder: of the loop.
        pose: the robot's true pose.
        robot: the true robot.
        believed: the robot as the controller believes it.
        sensors: one of `SENSORS`.
        sample_time: period of the vision loop [s].
        estimator: "joint" or "mean".
        outages: when cameras see nothing.

    Raises:
        RenderingError: images cannot be rendered on this machine.
        RobotFileError: the robot lacks the cameras or patterns needed.
        ValueError: an unknown estimator, or an outage of a camera that is not there.
    """
    if sensors == "images":
        camera = ImageTargets(believed, sample_time, estimator, outages)
        builder.AddNamedSystem("camera", camera)
        images = builder.AddNamedSystem("pose_camera_images", make_pose_camera_images(robot))
        builder.Connect(pose, images.GetInputPort("pose"))
        numbers = range(1, camera.num_cameras + 1)
        for n in numbers:
            builder.Connect(images.GetOutputPort(f"image_{n}"), camera.GetInputPort(f"image_{n}"))
        return camera, {f"pose_noise_{n}": images.GetInputPort(f"noise_{n}") for n in numbers}
    seeing = CameraMeasurement(robot, believed)
    if sensors == "targets":
        seeing = TargetCameras(robot, believed, sample_time, estimator, outages)
    builder.AddNamedSystem("camera", seeing)
    builder.Connect(pose, seeing.GetInputPort("pose"))
    return seeing, {"pose_noise": seeing.GetInputPort("noise")}


def add_tangent_cameras(
    builder: DiagramBuilder,
    robot: CableRobot,
    believed: CableRobot,
    sensors: str,
    sample_time: float | None,
    outages: tuple[Outage, ...],
) -> LeafSystem:
    """Add the block "tangent_cameras" and return it.

    Args:
        builder: of the loop.
        robot: the true robot.
        believed: the robot as the controller believes it.
        sensors: one of `SENSORS`.
        sample_time: period of the vision loop [s].
        outages: when cameras see nothing.

    Raises:
        RobotFileError: a cable is seen by no stereo pair, or by two.
        ValueError: an outage of a pair that is not there.
    """
    if sensors == "gaussian":
        pairs = CableTangentCameras(robot)
    elif sensors == "targets":
        pairs = StereoTangentCameras(robot, believed, sample_time, outages)
    else:
        pairs = StereoImageCameras(robot, believed, sample_time, outages)
    return builder.AddNamedSystem("tangent_cameras", pairs)
