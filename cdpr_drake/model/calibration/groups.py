"""Errors and standard deviations of all calibrated parameters, by kind."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.model.calibration.cameras import CalibratedPair
from cdpr_drake.model.calibration.motions import UncertainPose, difference
from cdpr_drake.model.calibration.projection import PARAMETERS, as_vector
from cdpr_drake.model.calibration.result import ParameterGroup
from cdpr_drake.model.calibration.tracker import LocatedPoints
from cdpr_drake.model.calibration.transforms import CalibratedTransforms
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.vision.cameras import Intrinsics

INTRINSICS = (
    ("focal length", "px", slice(0, 2), 1.0),
    ("principal point", "px", slice(2, 4), 1.0),
    ("distortion", "1e-3", slice(4, 9), 1e3),
)
"""Kinds of intrinsics: name, unit, which of the nine, and what one is in that unit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Believed:
    """A calibrated robot and how well its parameters are known, at full noise.

    Attributes:
        robot: the robot.
        A: the drawing points; with pulleys where the cables enter them.
        B: the attachment points.
        X_WF: the fixed camera frame.
        transforms: the other results of the poses of the platform.
        pairs: the stereo pairs.
    """

    robot: CableRobot
    A: LocatedPoints
    B: LocatedPoints
    X_WF: UncertainPose
    transforms: CalibratedTransforms
    pairs: Sequence[CalibratedPair]


Named = tuple[str, UncertainPose, RigidTransform]
Seen = tuple[str, Intrinsics, Array, Array, Intrinsics]


def parameter_groups(true: CableRobot, found: Believed, scale: float) -> tuple[ParameterGroup, ...]:
    """Return the groups of parameters.

    Args:
        true: the true robot.
        found: what was calibrated.
        scale: of all noise, and so of all standard deviations.
    """
    X_FS = found.transforms.X_SF.inverse()
    pairs = list(zip(found.pairs, true.cameras.stereo_pairs, strict=True))
    cameras = list(zip(found.transforms.X_FC, true.cameras.pose_cameras, strict=True))
    groups = [
        _points("A_i", found.A, true.drawing_points),
        _points("B_i", found.B, true.attachment_points),
        *_poses("X_WF", [("", found.X_WF, true.cameras.X_WF)]),
        *_poses("X_PM", [("", found.transforms.X_PM, true.cameras.X_PM)]),
        *_poses("X_FC", [(f"{i + 1}", X, c.X_FC) for i, (X, c) in enumerate(cameras) if i > 0]),
        *_poses(
            "X_FL",
            [
                (f"{i + 1}", X_FS @ pair.X_SL, t.X_FL)
                for i, (pair, t) in enumerate(pairs)
                if pair.X_SL is not None
            ],
        ),
        *_poses("X_LR", [(f"{i + 1}", pair.X_LR, t.X_LR) for i, (pair, t) in enumerate(pairs)]),
        *_intrinsics(list(_all_cameras(true, found))),
    ]
    return tuple(
        ParameterGroup(
            name=g.name,
            unit=g.unit,
            labels=g.labels,
            errors=g.errors,
            noise_sigmas=scale * g.noise_sigmas,
            fixed_sigmas=scale * g.fixed_sigmas,
        )
        for g in groups
    )


def _points(name: str, found: LocatedPoints, true: Array) -> ParameterGroup:
    labels = tuple(f"{i + 1} {axis}" for i in range(len(true)) for axis in "xyz")
    return ParameterGroup(
        name=name,
        unit="mm",
        labels=labels,
        errors=1e3 * (found.points - true).ravel(),
        noise_sigmas=1e3 * found.noise_sigmas.ravel(),
        fixed_sigmas=1e3 * found.fixed_sigmas.ravel(),
    )


def _parts(covariances: Sequence[Array], fixed: Sequence[Array]) -> tuple[Array, Array]:
    """Return the standard deviations (n, q) of noise and of what is fixed, of n covariances."""
    total = np.array([np.diag(C) for C in covariances])
    part = np.array([np.diag(C) for C in fixed])
    return np.sqrt(np.maximum(total - part, 0.0)), np.sqrt(np.maximum(part, 0.0))


def _poses(name: str, poses: Sequence[Named]) -> Iterator[ParameterGroup]:
    """Yield the translations [mm] and the rotations [deg], if there are any."""
    if not poses:
        return
    errors = np.array([difference(pose.X, true) for _, pose, true in poses])
    noise, fixed = _parts(
        [pose.covariance for _, pose, _ in poses], [pose.fixed_covariance for _, pose, _ in poses]
    )
    labels = tuple(f"{which} {axis}".strip() for which, _, _ in poses for axis in "xyz")
    for what, unit, part, factor in (
        ("translation", "mm", slice(3, 6), 1e3),
        ("rotation", "deg", slice(0, 3), np.degrees(1.0)),
    ):
        yield ParameterGroup(
            name=f"{name} {what}",
            unit=unit,
            labels=labels,
            errors=factor * errors[:, part].ravel(),
            noise_sigmas=factor * noise[:, part].ravel(),
            fixed_sigmas=factor * fixed[:, part].ravel(),
        )


def _all_cameras(true: CableRobot, found: Believed) -> Iterator[Seen]:
    """Yield a name, the camera found, its covariance, the fixed part of that, the true camera."""
    t, none = found.transforms, np.zeros((9, 9))
    for i, camera in enumerate(true.cameras.pose_cameras):
        yield (
            f"C{i + 1}",
            t.intrinsics[i],
            t.covariances[i],
            t.fixed_covariances[i],
            camera.intrinsics,
        )
    for i, (pair, known) in enumerate(zip(found.pairs, true.cameras.stereo_pairs, strict=True)):
        yield f"L{i + 1}", pair.left, pair.covariances[0], none, known.left
        yield f"R{i + 1}", pair.right, pair.covariances[1], none, known.right


def _intrinsics(cameras: Sequence[Seen]) -> Iterator[ParameterGroup]:
    errors = np.array([as_vector(seen) - as_vector(true) for _, seen, _, _, true in cameras])
    noise, fixed = _parts([C for _, _, C, _, _ in cameras], [D for _, _, _, D, _ in cameras])
    for name, unit, part, factor in INTRINSICS:
        yield ParameterGroup(
            name=name,
            unit=unit,
            labels=tuple(f"{camera} {p}" for camera, *_ in cameras for p in PARAMETERS[part]),
            errors=factor * errors[:, part].ravel(),
            noise_sigmas=factor * noise[:, part].ravel(),
            fixed_sigmas=factor * fixed[:, part].ravel(),
        )
