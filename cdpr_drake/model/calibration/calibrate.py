"""The calibration of section 4.3 on simulated measurements, from checkerboard to robot."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.model.calibration.cameras import CalibratedCamera, CalibratedPair
from cdpr_drake.model.calibration.groups import Believed, parameter_groups
from cdpr_drake.model.calibration.motions import UncertainPose
from cdpr_drake.model.calibration.result import Calibration
from cdpr_drake.model.calibration.setup import CalibrationSetup
from cdpr_drake.model.calibration.site import Site, platform_poses
from cdpr_drake.model.calibration.transforms import CalibratedTransforms
from cdpr_drake.model.pulleys import has_pulleys
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.vision.cameras import PoseCamera
from cdpr_drake.model.vision.targets import TargetImages

Counted = Callable[[Sequence[Any], str], Iterable[Any]]


def calibrate(
    robot: CableRobot,
    setup: CalibrationSetup | None = None,
    seed: int = 0,
    poses: Sequence[RigidTransform] | None = None,
    counted: Counted | None = None,
) -> Calibration:
    """Return a calibration of a robot from simulated measurements.

    The cameras see a checkerboard (OpenCV's model, 25 views); those of a pair together, and in some
    views the tracker measures the board too, which places the pair. The tracker measures reference
    points of F_b, and clouds of points around each A_i and each B_i. Then tracker and pose cameras
    see the platform in a few poses that turn little. Poses of pose cameras and pairs are found in
    the tracker's frame S.

    With pulleys A_i is found where the cable enters its pulley, not where it leaves, which no
    tracker can measure once for all: it moves with the platform. Radius and axis of the pulleys are
    not measured: the calibrated robot has the true ones. `CalibrationErrors.pulley_radius` is for
    asking what a wrong radius does.

    Args:
        robot: the true robot.
        setup: how it is calibrated.
        seed: of all noise but the fixed bias of the patterns' points, which is the robot's.
        poses: X_WP to take; by default amid the robot.
        counted: wraps lists of things that take their time, and their name, to show the count.

    Raises:
        CalibrationError: the measurements do not determine the robot.
        RobotFileError: the robot has no pose cameras, or no patterns.
    """
    setup = setup if setup is not None else CalibrationSetup()
    images = TargetImages(_with_noise(robot, setup.scale))
    generator = np.random.default_rng(seed)
    site = Site(robot, setup, images, generator)
    if poses is None:
        poses = platform_poses(robot, setup.poses, setup.turn)
    each = counted if counted is not None else lambda items, _: items
    cameras, pairs = robot.cameras.pose_cameras, robot.cameras.stereo_pairs
    done = [site.see(eyes) for eyes in each([*cameras, *pairs], "cameras and pairs")]
    seen = [found for found in done if isinstance(found, CalibratedCamera)]
    seen_pairs = [found for found in done if isinstance(found, CalibratedPair)]
    X_WS, A, B = site.measure_points()
    transforms = site.see_platform(seen, poses)
    believed = _believed(robot, X_WS, A.points, B.points, transforms, seen_pairs, setup, seed)
    found = Believed(
        robot=believed,
        A=A,
        B=B,
        X_WF=X_WS @ transforms.X_SF,
        transforms=transforms,
        pairs=seen_pairs,
    )
    return Calibration(
        true=robot,
        robot=believed,
        groups=parameter_groups(robot, found, setup.scale),
        poses=tuple(poses),
        setup=setup,
        seed=seed,
    )


def _with_noise(robot: CableRobot, scale: float) -> CableRobot:
    cameras = robot.cameras
    return robot.replace(
        cameras=cameras.replace(
            pixel_noise=scale * cameras.pixel_noise, pixel_bias=scale * cameras.pixel_bias
        )
    )


def _believed(
    robot: CableRobot,
    X_WS: UncertainPose,
    A: Array,
    B: Array,
    transforms: CalibratedTransforms,
    pairs: Sequence[CalibratedPair],
    setup: CalibrationSetup,
    seed: int,
) -> CableRobot:
    """Return the true robot with what was calibrated in place, and named as such."""
    X_FS = transforms.X_SF.X.inverse()
    cameras = robot.cameras.replace(
        X_WF=X_WS.X @ transforms.X_SF.X,
        X_PM=transforms.X_PM.X,
        pose_cameras=tuple(
            PoseCamera(X_FC=X.X, intrinsics=intrinsics)
            for X, intrinsics in zip(transforms.X_FC, transforms.intrinsics, strict=True)
        ),
        stereo_pairs=tuple(
            pair.replace(
                X_FL=X_FS @ found.X_SL.X,  # type: ignore[union-attr]
                X_LR=found.X_LR.X,
                left=found.left,
                right=found.right,
            )
            for pair, found in zip(robot.cameras.stereo_pairs, pairs, strict=True)
        ),
    )
    noise = f"noise of {setup.scale:g} times the usual, seed {seed}" if setup.scale else "no noise"
    views = f"{setup.views} simulated views of a checkerboard"
    tracker = f"a simulated laser tracker, {setup.cloud} points around each"
    entry = ", where the cable enters its pulley" if has_pulleys(robot) else ""
    how = {
        "drawing_points": f"{tracker}{entry}",
        "attachment_points": tracker,
        "cameras.X_WF": "simulated poses of the platform, seen by tracker and cameras",
        "cameras.X_PM": "simulated poses of the platform, seen by tracker and cameras",
        "cameras.pose_cameras": f"{views}, and poses of the platform",
        "cameras.stereo_pairs": f"{views}, some of them measured by the tracker",
    }
    marks = {
        field: f"calibrated with {means} ({noise}); true value: "
        f"{robot.sources.get(field, 'see the assumptions')}"
        for field, means in how.items()
        if field != "cameras.stereo_pairs" or pairs
    }
    return robot.replace(
        drawing_points=A,
        attachment_points=B,
        cameras=cameras,
        sources={**robot.sources, **marks},
    )
