"""What the pose cameras see of the platform, rendered, with what is detected drawn over it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.diagrams.rendering import make_pose_camera_images
from cdpr_drake.errors import GeometryError
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, as_pose, pose_to_vector
from cdpr_drake.model.vision.discs import DiscImages
from cdpr_drake.model.vision.image_pose import MARGIN, ImagePoseEstimator
from cdpr_drake.show.style import CABLE_COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PATTERN_COLOURS = (CABLE_COLOURS[1], CABLE_COLOURS[6], CABLE_COLOURS[4], CABLE_COLOURS[5])

_FRAME = "white"


def camera_view_figure(
    robot: CableRobot, pose: RigidTransform | ArrayLike, seed: int | None = 0
) -> Figure:
    """Return what each pose camera sees, and the points found in it without knowing the pose.

    Above are the whole images, below the platform in them magnified: the points in the colour of
    their pattern, and the windows in which they are tracked in the next frame.

    Args:
        robot: the robot, true and as believed.
        pose: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        seed: of the images' noise; none if None.

    Raises:
        RenderingError: images cannot be rendered on this machine.
        RobotFileError: the robot has no pose cameras or no patterns.
        GeometryError: the platform is found in no image.
    """
    from matplotlib.figure import Figure

    images = _rendered(robot, as_pose(pose), seed)
    estimator = ImagePoseEstimator(robot)
    estimate = estimator(images)
    if estimate is None:
        raise GeometryError("the platform is found in no camera's image")
    found = estimator.track(images, estimate.X_WP)
    views = DiscImages(robot)(estimate.X_WP)
    pattern = np.repeat(
        np.arange(len(robot.cameras.patterns)), [len(p.points) for p in robot.cameras.patterns]
    )

    figure = Figure(figsize=(3.7 * len(images), 6.3), dpi=100, layout="constrained")
    panels = figure.subplots(2, len(images), squeeze=False)
    for camera, image in enumerate(images):
        whole, close = panels[:, camera]
        seen = views.camera == camera
        expected = np.column_stack([views.centroid, views.half_size])[seen]
        visible = found.visible[camera]
        for axes in (whole, close):
            axes.imshow(image[:, :, :3], interpolation="antialiased")
            axes.set(xticks=[], yticks=[])
        whole.set_title(f"pose camera {camera + 1}", fontsize=11)
        if not visible.any():
            close.set_axis_off()
            continue
        _draw_points(close, found.pixels[camera, visible], pattern[visible], expected)
        _look_at(close, image, expected[:, :2].mean(axis=0), _height_of_part(expected))
        whole.indicate_inset_zoom(close, edgecolor=_FRAME, linewidth=1.4, alpha=1.0)
        error = np.linalg.norm(
            (found.pixels[camera] - _pixels(views, camera, visible))[visible], axis=1
        )
        close.set_xlabel(
            f"{np.count_nonzero(visible)} points, {np.sqrt(np.mean(error**2)):.2f} px from "
            "where the pose puts them",
            fontsize=9,
        )
    return figure


def _rendered(robot: CableRobot, X_WP: RigidTransform, seed: int | None) -> list[Any]:
    """Return the images (height, width, 4) of all pose cameras."""
    diagram = make_pose_camera_images(robot)
    context = diagram.CreateDefaultContext()
    diagram.GetInputPort("pose").FixValue(context, pose_to_vector(X_WP))
    numbers = range(1, len(robot.cameras.pose_cameras) + 1)
    if seed is not None:
        noise = np.random.default_rng(seed).standard_normal(len(numbers))
        for n in numbers:
            diagram.GetInputPort(f"noise_{n}").FixValue(context, noise[n - 1 : n])
    return [diagram.GetOutputPort(f"image_{n}").Eval(context).data.copy() for n in numbers]


def _height_of_part(expected: Array) -> float:
    """Return how much of an image shows the platform [px]."""
    return float(np.ptp(expected[:, :2], axis=0).max()) + 4.5 * MARGIN


def _look_at(axes: Axes, image: Any, middle: Array, size: float) -> None:
    """Show a part of an image, as high as `size` [px], of the same proportions."""
    (u, v), (height, width) = middle, image.shape[:2]
    across = 0.5 * size * width / height
    axes.set(xlim=(u - across, u + across), ylim=(v + 0.5 * size, v - 0.5 * size))


def _pixels(views: Any, camera: int, visible: Any) -> Array:
    """Return (n, 2): where the pose puts each point in an image."""
    pixels = np.full((len(visible), 2), np.nan)
    seen = views.camera == camera
    pixels[views.point[seen]] = views.pixel[seen]
    return pixels


def _draw_points(axes: Axes, pixels: Array, pattern: Any, expected: Array) -> None:
    """Draw crosses at points, in their patterns' colours, and the windows to track them in."""
    from matplotlib.patches import Rectangle

    for u, v, across, down in expected:
        corner = (u - across - MARGIN, v - down - MARGIN)
        sides = (2.0 * (across + MARGIN), 2.0 * (down + MARGIN))
        axes.add_patch(
            Rectangle(corner, *sides, fill=False, edgecolor=_FRAME, linewidth=0.6, alpha=0.7)
        )
    for index in np.unique(pattern):
        colour = PATTERN_COLOURS[index % len(PATTERN_COLOURS)]
        points = pixels[pattern == index]
        axes.plot(
            *points.T,
            "+",
            color=colour,
            markersize=13,
            markeredgewidth=1.2,
            label=f"pattern {index + 1}",
        )
    axes.legend(loc="lower left", fontsize=8, framealpha=0.85, handlelength=1.0)
