"""The pose cameras' images, rendered by Drake: a scene, a sensor per camera, and its lens."""

from __future__ import annotations

import functools
import subprocess
import sys

from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    RenderCameraCore,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.sensors import CameraInfo, RgbdSensor

from cdpr_drake.diagrams.camera_scene import RENDERER, make_camera_scene
from cdpr_drake.errors import RenderingError
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.room import room_of
from cdpr_drake.model.vision.lens import Pinhole
from cdpr_drake.systems.lens import LensDistortion
from cdpr_drake.systems.pose_in_scene import PoseInScene

NEAREST, FARTHEST = 0.5, 500.0
"""Limits of what is rendered [m]; a small robot has a nearer one, a large robot a farther one."""

# What draws without a display ends the process with a segmentation fault where it has no driver.
_RENDER_ONE_IMAGE = """
from pydrake.geometry import (
    ClippingRange, ColorRenderCamera, MakeRenderEngineVtk, RenderCameraCore, RenderEngineVtkParams
)
from pydrake.math import RigidTransform
from pydrake.systems.sensors import CameraInfo, ImageRgba8U
camera = CameraInfo(width=8, height=8, fov_y=1.0)
core = RenderCameraCore("probe", camera, ClippingRange(0.1, 10.0), RigidTransform())
engine = MakeRenderEngineVtk(RenderEngineVtkParams())
engine.RenderColorImage(ColorRenderCamera(core), ImageRgba8U(8, 8))
"""


@functools.cache
def rendering_available() -> bool:
    """Return whether Drake can render without a display, tried once, in another process."""
    command = (sys.executable, "-c", _RENDER_ONE_IMAGE)
    try:
        return subprocess.run(command, capture_output=True, timeout=60).returncode == 0
    except (OSError, subprocess.TimeoutExpired):
        return False


def make_pose_camera_images(robot: CableRobot) -> Diagram:
    """Return a diagram of what the pose cameras see, one image port each.

    .. pydrake_system::

        name: pose_camera_images
        input_ports:
        - pose
        - noise_1, ... (optional), one per pose camera
        output_ports:
        - image_1, ..., one per pose camera

    pose is [roll, pitch, yaw, x, y, z] (rad, m) of X_WP; an image is an ImageRgba8U of the camera's
    size, with its distortion; noise_1 is that of `LensDistortion`. Blocks: "scene_graph",
    "pose_in_scene", and for each camera "camera_1", Drake's RgbdSensor as a pinhole, and "lens_1".
    An image is rendered when asked for.

    Args:
        robot: the robot, for its pose cameras, patterns and drawing points.

    Raises:
        RenderingError: Drake cannot render on this machine.
        RobotFileError: a camera's distortion cannot be drawn.
    """
    if not rendering_available():
        raise RenderingError("Drake cannot render without a display here: EGL finds no driver")
    builder = DiagramBuilder()
    size = room_of(robot).size
    scene, source, frame = make_camera_scene(robot)
    builder.AddNamedSystem("scene_graph", scene)
    poses = builder.AddNamedSystem("pose_in_scene", PoseInScene(frame))
    builder.Connect(poses.get_output_port(), scene.get_source_pose_port(source))
    builder.ExportInput(poses.get_input_port(), "pose")
    for number, camera in enumerate(robot.cameras.pose_cameras, 1):
        lens = builder.AddNamedSystem(f"lens_{number}", LensDistortion(camera.intrinsics))
        X_WC = robot.cameras.X_WF @ camera.X_FC
        sensor = builder.AddNamedSystem(f"camera_{number}", _sensor(X_WC, lens.lens.pinhole, size))
        builder.Connect(scene.get_query_output_port(), sensor.query_object_input_port())
        builder.Connect(sensor.color_image_output_port(), lens.GetInputPort("pinhole_image"))
        builder.ExportInput(lens.GetInputPort("noise"), f"noise_{number}")
        builder.ExportOutput(lens.get_output_port(), f"image_{number}")
    diagram = builder.Build()
    diagram.set_name("pose_camera_images")
    return diagram


def _sensor(X_WC: RigidTransform, pinhole: Pinhole, size: float) -> RgbdSensor:
    """Return Drake's sensor for a pinhole, at a robot of a size [m].

    OpenCV counts from the centre of the first pixel, RenderEngineVtk from its corner: half a pixel.
    """
    x, y = pinhole.centre
    info = CameraInfo(
        width=pinhole.width,
        height=pinhole.height,
        focal_x=pinhole.focal_length,
        focal_y=pinhole.focal_length,
        center_x=x + 0.5,
        center_y=y + 0.5,
    )
    nearest, farthest = min(NEAREST, 0.05 * size), max(FARTHEST, 10.0 * size)
    core = RenderCameraCore(RENDERER, info, ClippingRange(nearest, farthest), RigidTransform())
    depth = DepthRenderCamera(core, DepthRange(nearest, 60.0))  # never asked for
    world = SceneGraph.world_frame_id()
    return RgbdSensor(world, X_WC, color_camera=ColorRenderCamera(core), depth_camera=depth)
