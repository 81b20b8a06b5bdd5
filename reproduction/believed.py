"""What a realistic calibration (section 4.3) leaves at the goal of a vision-based run.

The paper's errors are those of a laser tracker in F_b. Where a goal is missed by nothing counts but
how wrong the cameras see the platform there. The transforms ^fT_b and ^mT_e are not known each by
itself to so many millimetres: they are found together from a few poses of the platform that tracker
and cameras see, so that their errors compensate each other near these poses. What remains is what
the fixed errors of the images leave, in the calibration and at the goal.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake import CableRobot
from cdpr_drake.model.calibration import CalibrationSetup, calibrate, platform_poses
from cdpr_drake.model.calibration.hand_eye import robot_world_hand_eye
from cdpr_drake.model.calibration.motions import difference
from cdpr_drake.model.rotations import Array, exp_rotation
from cdpr_drake.model.vision.pose import PoseEstimator
from cdpr_drake.model.vision.rotation_means import mean_pose
from cdpr_drake.model.vision.targets import TargetImages


class Eyes:
    """The pose cameras of a robot that was calibrated once: what they see, and take it for.

    The images of each point are off by a fixed fraction of a pixel; their noise is averaged out.

    Args:
        robot: the true robot; its `pixel_bias_seed` gives way to the seed.
        seed: of images and calibration.
        setup: how it is calibrated.
        estimator: of the pose, "joint", calibrated by all pixels and reflectors together; or
            "mean", the paper's mean of the patterns' poses, calibrated with such means (exact
            intrinsics, and the points' errors of the other).
    """

    def __init__(
        self,
        robot: CableRobot,
        seed: int,
        setup: CalibrationSetup | None = None,
        estimator: str = "joint",
    ) -> None:
        setup = setup if setup is not None else CalibrationSetup()
        cameras = robot.cameras.replace(pixel_bias_seed=seed, stereo_pairs=())
        self.true = robot.replace(cameras=robot.cameras.replace(pixel_bias_seed=seed))
        self._images = TargetImages(self.true)
        if estimator == "mean":
            self.believed = self._calibrated_by_means(setup, seed)
        else:  # the pairs see tangents, which no end depends on
            found = calibrate(robot.replace(cameras=cameras), setup, seed).robot
            pairs = robot.cameras.stereo_pairs
            self.believed = found.replace(cameras=found.cameras.replace(stereo_pairs=pairs))
        self._estimate = PoseEstimator(self.believed, estimator)

    def seen(self, X_WP: RigidTransform) -> RigidTransform:
        """Return the pose that the platform at `X_WP` is taken for."""
        return _found(self._estimate, self._images, X_WP)

    def rest_pose(self, desired: RigidTransform) -> RigidTransform:
        """Return the true X_WP at which the platform is seen at the pose `desired`."""
        X = desired
        for _ in range(20):
            missing = difference(desired, self.seen(X))
            turn = RotationMatrix(exp_rotation(missing[:3]))
            X = RigidTransform(turn @ X.rotation(), X.translation() + missing[3:])
            if np.abs(missing).max() < 1e-8:
                return X
        raise ArithmeticError("the cameras' errors change too much from pose to pose")

    def believed_at(self, goal: RigidTransform) -> CableRobot:
        """Return a robot with whose X_WF cameras without fixed errors see as these do at a `goal`.

        For runs with Gaussian sensors, which know neither lenses nor points.
        """
        X = self.rest_pose(goal)
        true = self.true.cameras
        return self.believed.replace(
            cameras=true.replace(X_WF=goal @ X.inverse() @ true.X_WF),
        )

    def _calibrated_by_means(self, setup: CalibrationSetup, seed: int) -> CableRobot:
        """Return the robot with transforms from the poses that the paper's estimator gives."""
        cameras = self.true.cameras
        estimate = PoseEstimator(self.true, "mean")
        draw = np.random.default_rng(seed).standard_normal
        poses = platform_poses(self.true, setup.poses, setup.turn)
        X_FM = [
            cameras.X_WF.inverse() @ _found(estimate, self._images, X) @ cameras.X_PM for X in poses
        ]
        tracked = [_touched(X, setup.tracker_noise * draw(6)) for X in poses]
        X_PM = robot_world_hand_eye(tracked, X_FM)
        X_WF = mean_pose([X @ X_PM @ Y.inverse() for X, Y in zip(tracked, X_FM, strict=True)])
        return self.true.replace(cameras=cameras.replace(X_WF=X_WF, X_PM=X_PM))


def _found(estimate: PoseEstimator, images: TargetImages, X_WP: RigidTransform) -> RigidTransform:
    found = estimate(images(X_WP), X_WP)
    if found is None:
        raise ValueError(f"no camera sees the platform at {X_WP.translation()} m")
    return found.X_WP


def _touched(X: RigidTransform, error: Array) -> RigidTransform:
    """Return a pose off by [rotation; translation] as reflectors half a metre away see it."""
    turn = RotationMatrix(exp_rotation(error[:3] / 0.5))
    return RigidTransform(turn @ X.rotation(), X.translation() + error[3:])


def setup_from(values: dict[str, Any], **changes: Any) -> CalibrationSetup:
    """Return how a robot is calibrated, from the data file's values.

    Args:
        values: "calibration_poses" and "calibration_turn" [deg].
        changes: of other fields.
    """
    return CalibrationSetup(
        poses=int(values["calibration_poses"]),
        turn=float(np.radians(values["calibration_turn"])),
        **changes,
    )
