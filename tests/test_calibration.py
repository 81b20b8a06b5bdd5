"""Calibration from simulated measurements: truth without noise, scatter with it, bad input."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.math import RigidTransform
from samples import derivative, rotation

from cdpr_drake.__main__ import main
from cdpr_drake.diagrams import TargetSensing, make_vision_based_control
from cdpr_drake.errors import CalibrationError, RobotFileError
from cdpr_drake.model.calibration import (
    Board,
    Calibration,
    CalibrationSetup,
    PlatformViews,
    TrackedBoard,
    calibrate,
    calibrate_camera,
    calibrate_pair,
    calibrate_transforms,
    platform_poses,
)
from cdpr_drake.model.calibration.boards import crossing, hold, see
from cdpr_drake.model.calibration.hand_eye import robot_world_hand_eye
from cdpr_drake.model.calibration.least_squares import minimise
from cdpr_drake.model.calibration.motions import (
    UncertainPose,
    between,
    difference,
    inverse_jacobian,
    moved,
    product_jacobians,
)
from cdpr_drake.model.calibration.projection import as_vector, project
from cdpr_drake.model.calibration.site import Site, corners
from cdpr_drake.model.calibration.tracker import at, locate, register
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.vision.cameras import StereoPair
from cdpr_drake.model.vision.targets import TargetImages

QUICK = CalibrationSetup(views=5, tracked_views=3, poses=5)
SIZE = (1280, 1024)


@pytest.fixture(scope="module")
def robot() -> CableRobot:
    """CoGiRo, its cameras different from each other."""
    robot = load_robot("cogiro")
    cameras = robot.cameras
    varied = []
    for i, camera in enumerate(cameras.pose_cameras):
        K = camera.intrinsics.camera_matrix + np.diag([10.0 * i, 12.0 * i, 0.0])
        varied.append(camera.replace(intrinsics=camera.intrinsics.replace(camera_matrix=K)))
    return robot.replace(cameras=cameras.replace(pose_cameras=tuple(varied)))


@pytest.fixture(scope="module")
def exact(robot: CableRobot) -> Calibration:
    """The whole calibration, without noise."""
    return calibrate(robot, CalibrationSetup(scale=0.0))


@pytest.fixture(scope="module")
def noisy(robot: CableRobot) -> Calibration:
    """A quick calibration with noise and one stereo pair."""
    return calibrate(with_pairs(robot, 1), QUICK, seed=3)


def with_pairs(robot: CableRobot, count: int) -> CableRobot:
    """Return a robot with its first stereo pairs only."""
    pairs = robot.cameras.stereo_pairs[:count]
    return robot.replace(cameras=robot.cameras.replace(stereo_pairs=pairs))


def site(robot: CableRobot, setup: CalibrationSetup, seed: int) -> Site:
    """Return where a robot is calibrated, the biases of its targets drawn anew for each seed."""
    drawn = robot.replace(cameras=robot.cameras.replace(pixel_bias_seed=seed))
    return Site(drawn, setup, TargetImages(drawn), np.random.default_rng(seed))


def random_pose(generator: np.random.Generator, turn: float = 1.0) -> RigidTransform:
    """Return a pose some way off."""
    return RigidTransform(
        rotation(turn * generator.standard_normal(3)), generator.standard_normal(3)
    )


def distance(pose: UncertainPose, true: RigidTransform) -> float:
    """Return the squared error of a pose in its standard deviations (Mahalanobis)."""
    d = difference(pose.X, true)
    return float(d @ np.linalg.solve(pose.covariance, d))


def is_chi_square(values: list[float], freedom: int) -> bool:
    """Whether the mean of draws is within four standard deviations of a chi-square variable's."""
    n = len(values)
    return abs(np.mean(values) - freedom) < 4.0 * math.sqrt(2.0 * freedom / n)


# --- small motions and projection


def test_motions_of_products_and_inverses_are_differentiated() -> None:
    generator = np.random.default_rng(1)
    X, Y = random_pose(generator), random_pose(generator)
    of_X, of_Y = product_jacobians(X, Y)
    for i in range(6):
        d = np.eye(6)[i]

        def along(t: float, change: Any, d: np.ndarray = d) -> np.ndarray:
            return difference(change(t * d), change(0.0 * d))

        for change, J in (
            (lambda d: moved(X, d) @ Y, of_X),
            (lambda d: X @ moved(Y, d), of_Y),
            (lambda d: moved(X, d).inverse(), inverse_jacobian(X)),
        ):
            got = derivative(lambda t, change=change: along(t, change))
            np.testing.assert_allclose(got, J[:, i], atol=1e-9)


def test_covariances_of_poses_are_those_of_samples() -> None:
    generator = np.random.default_rng(2)
    X, Y = random_pose(generator), random_pose(generator)
    roots = [1e-3 * generator.standard_normal((6, 6)) for _ in range(2)]
    A, B = (UncertainPose(X=P, covariance=L @ L.T) for P, L in zip((X, Y), roots, strict=True))
    joint = 1e-3 * generator.standard_normal((12, 12))
    fixed = 0.25 * joint @ joint.T
    relative = between(X, Y, joint @ joint.T, fixed)
    np.testing.assert_allclose(relative.fixed_covariance, 0.25 * relative.covariance, rtol=1e-9)
    product, inverse = A @ B, A.inverse()
    draws: dict[str, list[np.ndarray]] = {"product": [], "inverse": [], "between": []}
    for _ in range(900):
        dX, dY = (L @ generator.standard_normal(6) for L in roots)
        draws["product"].append(difference(moved(X, dX) @ moved(Y, dY), product.X))
        draws["inverse"].append(difference(moved(X, dX).inverse(), inverse.X))
        d = joint @ generator.standard_normal(12)
        draws["between"].append(difference(moved(X, d[:6]).inverse() @ moved(Y, d[6:]), relative.X))
    for name, pose in (("product", product), ("inverse", inverse), ("between", relative)):
        got = np.cov(np.array(draws[name]).T)
        scale = np.sqrt(np.diag(pose.covariance))
        np.testing.assert_allclose(
            got / np.outer(scale, scale), pose.covariance / np.outer(scale, scale), atol=0.25
        )


def test_projection_is_opencv_s_with_its_derivatives() -> None:
    import cv2

    generator = np.random.default_rng(3)
    camera = np.array([1100.0, 1050.0, 640.0, 500.0, -0.1, 0.05, 2e-4, -1e-4, 0.03])
    points = np.column_stack([generator.uniform(-0.5, 0.5, (20, 2)), generator.uniform(1, 2, 20)])
    pixels, by_point, by_camera = project(camera, points)
    K = np.array([[camera[0], 0, camera[2]], [0, camera[1], camera[3]], [0, 0, 1]])
    expected: Any = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, camera[4:])[0]
    np.testing.assert_allclose(pixels, expected.reshape(-1, 2), rtol=1e-12)
    for i in range(9):
        unit = np.eye(9)[i]
        got = derivative(lambda t, u=unit: project(camera + t * u, points)[0])
        np.testing.assert_allclose(got, by_camera[:, :, i], atol=1e-6)
    for i in range(3):
        unit = np.eye(3)[i]
        got = derivative(lambda t, u=unit: project(camera, points + t * u)[0], step=1e-4)
        np.testing.assert_allclose(got, by_point[:, :, i], rtol=1e-6, atol=1e-6)
    behind = project(camera, np.array([[0.0, 0.0, -1.0]]))[0]
    assert np.all(np.isnan(behind))


# --- truth without noise


def test_without_noise_the_truth_is_found(exact: Calibration) -> None:
    true, found = exact.true, exact.robot
    tolerance: dict[str, Any] = {"rtol": 1e-5, "atol": 1e-9}
    np.testing.assert_allclose(found.drawing_points, true.drawing_points, **tolerance)
    np.testing.assert_allclose(found.attachment_points, true.attachment_points, **tolerance)
    poses = [
        (getattr(found.cameras, name), getattr(true.cameras, name)) for name in ("X_WF", "X_PM")
    ]
    intrinsics = []
    for got, want in zip(found.cameras.pose_cameras, true.cameras.pose_cameras, strict=True):
        poses.append((got.X_FC, want.X_FC))
        intrinsics.append((got.intrinsics, want.intrinsics))
    for pair, wanted in zip(found.cameras.stereo_pairs, true.cameras.stereo_pairs, strict=True):
        poses += [(pair.X_FL, wanted.X_FL), (pair.X_LR, wanted.X_LR)]
        intrinsics += [(pair.left, wanted.left), (pair.right, wanted.right)]
    for X, Y in poses:
        np.testing.assert_allclose(X.GetAsMatrix34(), Y.GetAsMatrix34(), **tolerance)
    for camera, other in intrinsics:
        np.testing.assert_allclose(as_vector(camera), as_vector(other), **tolerance)
    assert len(intrinsics) == 11 and exact.setup.views == 25
    assert all(np.all(group.sigmas == 0.0) for group in exact.groups)
    assert np.abs(exact.pose_errors()).max() < 1e-9
    assert np.abs(exact.camera_frame_error(np.ones(3))).max() < 1e-9


def test_the_groups_tell_all_errors(noisy: Calibration) -> None:
    true, found = noisy.true.cameras, noisy.robot.cameras
    group = noisy.group("X_WF translation")
    np.testing.assert_allclose(
        group.errors, 1e3 * (found.X_WF.translation() - true.X_WF.translation()), rtol=1e-9
    )
    group = noisy.group("A_i")
    errors = 1e3 * (noisy.robot.drawing_points - noisy.true.drawing_points).ravel()
    np.testing.assert_allclose(group.errors, errors)
    assert group.labels[4] == "2 y" and group.largest == int(np.argmax(np.abs(errors)))
    assert group.rms_error == pytest.approx(np.sqrt(np.mean(errors**2)))
    group = noisy.group("focal length")
    K, K0 = (c.pose_cameras[1].intrinsics.camera_matrix for c in (found, true))
    assert group.labels[3] == "C2 fy" and group.errors[3] == pytest.approx(K[1, 1] - K0[1, 1])
    assert len(noisy.group("X_FC rotation").errors) == 6  # the first camera defines F
    assert found.pose_cameras[0].X_FC.IsExactlyEqualTo(true.pose_cameras[0].X_FC)
    with pytest.raises(KeyError, match="no group 'X_AB' among A_i"):
        noisy.group("X_AB")


def test_errors_of_X_WF_and_X_PM_cancel_where_the_platform_was(noisy: Calibration) -> None:
    where = noisy.poses[0].translation()
    shift = 1e3 * np.linalg.norm(noisy.camera_frame_error(where))
    missed = 1e3 * np.linalg.norm(noisy.pose_errors()[:, 3:], axis=1)
    assert missed.max() < 4.0 and np.median(missed) < 0.7 * shift


def test_a_seed_gives_one_calibration(robot: CableRobot) -> None:
    small = with_pairs(robot, 0)
    many = QUICK.replace(views=25)  # enough for OpenCV to share them among threads
    assert calibrate(small, many, 5).robot == calibrate(small, many, 5).robot
    one, other = (calibrate(small, QUICK, seed) for seed in (5, 6))
    assert one.robot != other.robot
    twice = calibrate(small, QUICK.replace(scale=2.0), 5)
    for a, b in zip(one.groups, twice.groups, strict=True):
        np.testing.assert_allclose(b.sigmas, 2.0 * a.sigmas, rtol=0.1)
    assert not any(g.name.startswith("X_FL") for g in one.groups)


def test_with_pulleys_the_entry_points_are_found_and_the_radius_is_taken_as_known(
    capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    robot = with_pairs(load_robot("cogiro-2015-pulleys"), 0)
    found = calibrate(robot, QUICK.replace(scale=0.0))
    np.testing.assert_allclose(found.robot.drawing_points, robot.drawing_points, atol=1e-9)
    assert found.robot.pulleys == robot.pulleys
    assert "where the cable enters its pulley" in found.robot.sources["drawing_points"]
    for name, is_said in (("cogiro-2015-pulleys", True), ("cogiro", False)):
        (here / "robot.yaml").write_text(with_pairs(load_robot(name), 0).to_yaml())
        assert main(["calibrate", "--robot", "robot.yaml", "--no-noise", "--no-figures"]) == 0
        told = " ".join(capsys.readouterr().out.split())
        assert ("A_i is where a cable enters its pulley" in told) == is_said


@pytest.mark.parametrize("name", ["cogiro", "cogiro-2015-pulleys", "cogiro-98m"])
def test_the_platform_can_take_the_poses(name: str) -> None:
    robot = load_robot(name)
    for pose in platform_poses(robot, 12, CalibrationSetup().turn):
        assert rest_state(robot, pose).chord_tension.min() > robot.cable.min_tension


# --- scatter with noise


def test_pairs_scatter_as_predicted(robot: CableRobot) -> None:
    pair = robot.cameras.stereo_pairs[2]
    X_WL = robot.cameras.X_WF @ pair.X_FL
    distances: dict[str, list[float]] = {"X_LR": [], "X_SL": []}
    for seed in range(20):
        place = site(robot, QUICK, seed)
        found = place.see_pair(pair)
        X_SW = place.tracker.X_WS.inverse()
        for name, true in (("X_LR", pair.X_LR), ("X_SL", X_SW @ X_WL)):
            distances[name].append(distance(getattr(found, name), true))
    assert is_chi_square(distances["X_LR"], 6) and is_chi_square(distances["X_SL"], 6)


def test_cameras_and_transforms_scatter_as_predicted(robot: CableRobot) -> None:
    known, poses = robot.cameras.pose_cameras, platform_poses(robot, QUICK.poses, QUICK.turn)
    found: dict[str, list[float]] = {"cameras": [], "X_SF": [], "X_PM": [], "X_FC": []}
    improved, costs, of_platform = [], [], []
    for seed in range(20):
        place = site(robot, QUICK, seed)
        cameras = [place.see_camera(camera) for camera in known]
        transforms = place.see_platform(cameras, poses)
        for c, camera in enumerate(cameras):
            for vector, covariance, into in (
                (as_vector(camera.intrinsics), camera.covariance, found["cameras"]),
                (as_vector(transforms.intrinsics[c]), transforms.covariances[c], improved),
            ):
                error = vector - as_vector(known[c].intrinsics)
                into.append(float(error @ np.linalg.solve(covariance, error)))
            costs.append(camera.cost)
        X_SF = place.tracker.X_WS.inverse() @ robot.cameras.X_WF
        found["X_SF"].append(distance(transforms.X_SF, X_SF))
        found["X_PM"].append(distance(transforms.X_PM, robot.cameras.X_PM))
        found["X_FC"].append(distance(transforms.X_FC[2], known[2].X_FC))
        of_platform.append(transforms.cost)
    assert is_chi_square(found.pop("cameras"), 9) and is_chi_square(improved, 9)
    assert all(is_chi_square(distances, 6) for distances in found.values())
    assert is_chi_square(costs, cameras[0].freedom)
    assert is_chi_square(of_platform, transforms.freedom)


class Silent(np.random.Generator):
    """A generator of noise that draws zeros only."""

    def standard_normal(self, size: Any = None, *_: Any, **__: Any) -> Any:
        return np.zeros(size)


def test_the_fixed_part_of_the_transforms_is_that_of_the_biases(robot: CableRobot) -> None:
    """Over biases without noise the fixed part; over noise with the same bias the other."""
    poses = platform_poses(robot, QUICK.poses, QUICK.turn)
    squares: dict[str, list[float]] = {"bias": [], "noise": []}
    for kind, found in squares.items():
        results = []
        for seed in range(24):
            fixed = robot.cameras.replace(pixel_bias_seed=seed if kind == "bias" else 1)
            drawn = robot.replace(cameras=fixed)
            bits = np.random.PCG64(seed)
            draw = Silent(bits) if kind == "bias" else np.random.Generator(bits)
            place = Site(drawn, QUICK, TargetImages(drawn), draw)
            cameras = [place.see_camera(camera) for camera in drawn.cameras.pose_cameras]
            results.append(place.see_platform(cameras, poses).X_PM)
        errors = np.array([difference(X.X, robot.cameras.X_PM) for X in results])
        if kind == "bias":
            covariance = results[0].fixed_covariance
        else:  # what all have in common is the bias
            covariance = results[0].noise_covariance
            errors = (errors - errors.mean(axis=0)) * np.sqrt(24.0 / 23.0)
        found += np.einsum("ni,ij,nj->n", errors, np.linalg.inv(covariance), errors).tolist()
    assert is_chi_square(squares["bias"], 6) and is_chi_square(squares["noise"], 6)


def test_the_parts_of_the_points_errors(robot: CableRobot) -> None:
    """Where the cables bend is fixed; without it the noise alone scatters."""
    sure = QUICK.replace(drawing_point=0.0, attachment_point=0.0)
    scores = []
    for seed in range(40):
        _, A, B = site(robot, sure, seed).measure_points()
        assert np.all(A.fixed_sigmas == 0.0) and np.all(B.fixed_sigmas == 0.0)
        scores.append(((A.points - robot.drawing_points) / A.noise_sigmas).ravel())
        scores.append(((B.points - robot.attachment_points) / B.noise_sigmas).ravel())
    assert np.std(scores) == pytest.approx(1.0, abs=0.07)
    _, A, B = site(robot, QUICK, 0).measure_points()
    np.testing.assert_array_equal(A.fixed_sigmas, QUICK.drawing_point)
    np.testing.assert_array_equal(B.fixed_sigmas, QUICK.attachment_point)
    assert A.noise_sigmas.max() < QUICK.drawing_point


def test_points_scatter_as_predicted(robot: CableRobot) -> None:
    scores = []
    for seed in range(40):
        _, A, B = site(robot, QUICK, seed).measure_points()
        scores.append(((A.points - robot.drawing_points) / A.sigmas).ravel())
        scores.append(((B.points - robot.attachment_points) / B.sigmas).ravel())
    z = np.array(scores)
    assert abs(np.mean(z**2) - 1.0) < 4.0 * math.sqrt(2.0 / z.size)


def test_small_turns_leave_the_target_frame_uncertain(robot: CableRobot) -> None:
    small, sigmas = with_pairs(robot, 0), []
    for degrees in (0.5, 1.0):
        setup = QUICK.replace(turn=math.radians(degrees))
        sigmas.append(calibrate(small, setup).group("X_PM translation").rms_sigma)
    assert sigmas[0] / sigmas[1] == pytest.approx(2.0, rel=0.1)


def test_the_pair_agrees_with_opencv(robot: CableRobot) -> None:
    import cv2

    board, pair, left, right = views_of_a_pair(robot, 8, noise=0.1)
    ours = calibrate_pair(board, left, right, [SIZE, SIZE], 0.1)
    points = [board.points.astype(np.float32)] * len(left)
    K, k = pair.left.camera_matrix, pair.left.distortion
    theirs: Any = cv2.stereoCalibrate(
        points, list(left.astype(np.float32)), list(right.astype(np.float32)),
        K.copy(), k.copy(), K.copy(), k.copy(), SIZE, flags=cv2.CALIB_USE_INTRINSIC_GUESS,
        criteria=(cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-12),
    )  # fmt: skip
    X_RL = ours.X_LR.inverse()
    sigma = np.sqrt(np.diag(X_RL.covariance))
    R, t = theirs[5], theirs[6].ravel()
    turn = difference(X_RL.X, RigidTransform(rotation(cv2.Rodrigues(R)[0].ravel()), t))
    assert np.all(np.abs(turn) < 0.05 * sigma)
    assert ours.X_SL is None
    assert ours.left.camera_matrix[0, 0] == pytest.approx(theirs[1][0, 0], abs=0.02)


# --- what is refused


def views_of_a_pair(
    robot: CableRobot, count: int, noise: float = 0.0
) -> tuple[Board, StereoPair, np.ndarray, np.ndarray]:
    """Return a board, a pair, and what its two cameras see."""
    board, pair = Board(), robot.cameras.stereo_pairs[0]
    cameras = [(RigidTransform(), pair.left), (pair.X_LR, pair.right)]
    generator = np.random.default_rng(0)
    held = hold(board, cameras, 1.2, count, generator)
    left, right = (np.array([see(c, at(X, board.points)) for X in held]) for c in cameras)
    shake = noise * generator.standard_normal((2, *left.shape))
    return board, pair, left + shake[0], right + shake[1]


def test_views_that_tell_no_camera_are_refused(robot: CableRobot) -> None:
    board, pair, left, right = views_of_a_pair(robot, 4)

    def refused(images: np.ndarray, message: str) -> None:
        with pytest.raises(CalibrationError, match=message):
            calibrate_camera(board, images, *SIZE, 0.1)

    refused(left[:2], "at least 3 views of the board, got 2")
    refused(left[:, :-1], r"of shape \(views, 63, 2\), got shape \(4, 62, 2\)")
    refused(np.where(left > 700.0, np.nan, left), "must be finite")
    flat = np.concatenate([left[:, :1]] * 63, axis=1)
    refused(flat, "the corners of a view lie on one line")
    facing = [
        RigidTransform(rotation([0.0, 0.0, 0.2 * i]), [0.05 * i, -0.04 * i, 1.0 + 0.2 * i])
        for i in range(5)
    ]
    camera = (RigidTransform(), pair.left)
    parallel = np.array([see(camera, at(X, board.points)) for X in facing])
    refused(parallel, "all views of the board are parallel")
    tilted = rotation([0.4, 0.2, 0.0])
    parallel = np.array(
        [see(camera, at(RigidTransform(tilted, X.translation()), board.points)) for X in facing]
    )
    refused(parallel, "all views of the board are parallel")
    with pytest.raises(CalibrationError, match="4 left views, but 3 right ones"):
        calibrate_pair(board, left, right[:3], [SIZE, SIZE], 0.1)


def test_a_pair_that_shares_no_view_is_refused(robot: CableRobot) -> None:
    pair = robot.cameras.stereo_pairs[0]
    away = RigidTransform(rotation([0.0, 3.0, 0.0]), [0.4, 0.0, 0.0])
    cameras = [(RigidTransform(), pair.left), (away, pair.right)]
    with pytest.raises(CalibrationError, match="in view in only 0 of 120 places"):
        hold(Board(), cameras, 1.0, 3, np.random.default_rng(0))


def test_the_axes_of_a_pair_cross_where_it_looks(robot: CableRobot) -> None:
    assert crossing(robot.cameras.stereo_pairs[0].X_LR) == pytest.approx(1.2167, abs=1e-3)
    assert crossing(RigidTransform([0.4, 0.0, 0.0])) == pytest.approx(1.2)


def test_frames_need_three_points_off_a_line() -> None:
    generator = np.random.default_rng(4)
    known, X = generator.standard_normal((3, 3)), random_pose(generator)
    found = register(known, at(X, known), 1e-3)
    assert np.abs(difference(found.X, X)).max() < 1e-12
    back = locate(found, at(X, known), 1e-6, 4e-6)
    np.testing.assert_allclose(back.points, known, atol=1e-12)
    assert np.all(back.noise_sigmas > 1e-3) and np.all(back.fixed_sigmas == 2e-3)
    assert np.all(back.sigmas > np.sqrt(5.0) * 1e-3)
    for points, message in (
        (known[:2], "at least 3 reference points, got 2"),
        (np.outer([0.0, 1.0, 3.0], [1.0, 2.0, 3.0]), "lie on one line"),
        (np.zeros((4, 2)), r"must be \(n, 3\) twice"),
    ):
        with pytest.raises(CalibrationError, match=message):
            register(points, points, 1e-3)


def test_motions_that_tell_nothing_are_refused(robot: CableRobot) -> None:
    small = with_pairs(robot, 0)
    still = [RigidTransform([0.1 * i, 0.2 * i, 1.0 + 0.1 * i**2]) for i in range(5)]
    nodding = [RigidTransform(rotation([0.1 * i, 0.0, 0.0]), [0.2 * i, 0.0, 1.0]) for i in range(5)]
    hidden = [RigidTransform(X.rotation(), [0.0, 0.0, 40.0]) for X in platform_poses(small, 5, 0.1)]
    for poses, message in (
        (still, "do not turn: where the target frame is on it cannot be told"),
        (nodding, "all turn about one axis"),
        (nodding[:2], "at least 3 poses of the platform are needed, got 2"),
        (hidden, "pose camera 1 sees no pattern in any of the 5 poses"),
    ):
        with pytest.raises(CalibrationError, match=message):
            calibrate(small, QUICK, poses=poses)


def test_measurements_of_different_poses_are_refused(robot: CableRobot) -> None:
    views = PlatformViews(
        sightings=[], known=np.eye(3), measured=np.zeros((2, 3, 3)), sigma=1e-4,
        pixel_noise=0.1, pixel_bias=0.1,
    )  # fmt: skip
    with pytest.raises(CalibrationError, match="0 poses seen by cameras, but 2 by the tracker"):
        calibrate_transforms(robot, views, [])


def test_what_nothing_depends_on_is_named() -> None:
    def blocks(J: np.ndarray) -> Any:
        def of(x: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
            yield J @ x - 1.0, J, np.arange(2)

        return of

    def move(x: np.ndarray, d: np.ndarray) -> np.ndarray:
        return x + d

    names = ["a", "b"]
    fit = minimise(np.zeros(2), blocks(np.diag([1.0, 2.0])), move, names, 2)
    np.testing.assert_allclose(fit.state, [1.0, 0.5])
    np.testing.assert_allclose(fit.covariance, np.diag([1.0, 0.25]))
    for J, message in (
        (np.array([[1.0, 0.0], [2.0, 0.0]]), "nothing depends on b"),
        (np.array([[1.0, 1.0], [2.0, 2.0]]), "do not determine [ab]"),
        (np.full((2, 2), np.nan), "a point is behind a camera"),
    ):
        with pytest.raises(CalibrationError, match=message):
            minimise(np.zeros(2), blocks(J), move, names, 2)


def test_contradictions_do_not_go_on_for_ever() -> None:
    def blocks(x: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        yield np.exp(-x), -np.exp(-x)[:, None] * np.ones((1, 1)), np.arange(1)

    with pytest.raises(CalibrationError, match="no convergence in 100 steps"):
        minimise(np.zeros(1), blocks, lambda x, d: x + np.clip(d, -1e-3, 1e-3), ["x"], 1)


@pytest.mark.parametrize(
    ("field", "value"),
    [("views", 0), ("poses", 0), ("turn", -0.1), ("scale", math.nan), ("corner_noise", 0.0)],
)
def test_setups_are_checked(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=field):
        CalibrationSetup(**{field: value})  # type: ignore[arg-type]


def test_a_robot_without_cameras_is_refused(robot: CableRobot) -> None:
    blind = robot.replace(cameras=robot.cameras.replace(pose_cameras=()))
    with pytest.raises(RobotFileError, match=r"cameras\.pose_cameras: there are none"):
        calibrate(blind, QUICK)


@pytest.mark.parametrize("small", [True, False], ids=["small turns", "turns alone"])
def test_the_closed_form_starts_at_the_truth(small: bool) -> None:
    generator = np.random.default_rng(7)
    X_SC, X_PM = random_pose(generator), RigidTransform(rotation([0.1, 0.2, 0.3]), [0, 0, 0.5])
    X_SP = [random_pose(generator, 0.05 if small else 1.0) for _ in range(8)]
    if not small:
        X_SP = [RigidTransform(X.rotation(), [1.0, 2.0, 3.0]) for X in X_SP]
    X_CM = [X_SC.inverse() @ X @ X_PM for X in X_SP]
    found = robot_world_hand_eye(X_SP, X_CM)
    assert np.abs(difference(found, X_PM)).max() < (0.05 if small else 1e-9)


# --- the calibrated robot


def test_the_calibrated_robot_keeps_what_is_not_calibrated(noisy: Calibration) -> None:
    true, found = noisy.true, noisy.robot
    for field in ("name", "platform", "payload", "cable", "winch", "load_cells", "assumptions"):
        assert getattr(found, field) == getattr(true, field)
    assert found.cameras.patterns == true.cameras.patterns
    calibrated = {"drawing_points", "attachment_points", "cameras.X_WF", "cameras.X_PM"}
    calibrated |= {"cameras.pose_cameras", "cameras.stereo_pairs"}
    for field, source in found.sources.items():
        if field in calibrated:
            assert source.startswith("calibrated with ") and "seed 3" in source
            assert source.endswith(true.sources.get(field, "see the assumptions"))
        else:
            assert source == true.sources[field]
    assert calibrated <= set(found.sources)


def test_importing_it_loads_neither_opencv_nor_scipy_s_optimisers() -> None:
    code = (
        "import sys, cdpr_drake.model.calibration as c; "
        "print([m for m in ('cv2', 'scipy.optimize', 'numba') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_boxes_have_eight_corners() -> None:
    box = corners(np.array([[0.0, 0.0, 1.0], [2.0, 3.0, 4.0]]), floor=0.0)
    assert {tuple(p) for p in box} == {(x, y, z) for x in (0, 2) for y in (0, 3) for z in (0, 4)}


# --- the command


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory and a screen of 80 columns."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    return tmp_path


def test_calibrate_leaves_a_robot_for_the_loop(
    capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    assert main(["calibrate", "--seed", "1", "--output", "there"]) == 0
    told = capsys.readouterr()
    assert max(map(len, told.out.splitlines())) <= 80
    assert "1 sigma" in told.out and "At the platform: " in told.out
    assert "7 of 7 cameras and pairs" in told.err
    written = {path.name for path in (here / "there").iterdir()}
    assert written == {"summary.json", "calibration.png", "cogiro-calibrated.yaml"}
    summary = json.loads((here / "there" / "summary.json").read_text())
    assert set(summary["files"]) == written and summary["seed"] == 1
    robot, believed = load_robot("cogiro"), load_robot(here / "there" / "cogiro-calibrated.yaml")
    errors = 1e3 * (believed.drawing_points - robot.drawing_points).ravel()
    np.testing.assert_allclose(summary["groups"]["A_i"]["errors"], errors)

    loop = make_vision_based_control(robot, believed=believed, sensing=TargetSensing())
    assert loop.GetSubsystemByName("servo") is not None
    argv = ["run", "--calibrated", "there/cogiro-calibrated.yaml", "--sensors", "targets"]
    argv += ["--controller", "vbc", "--cable-model", "SCMWE", "--until", "0.2", "--no-noise"]
    assert main([*argv, "--no-figures", "--no-replay", "--json"]) == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["calibrated"] is True


def test_the_table_fits_a_narrow_screen(
    capsys: pytest.CaptureFixture[str], here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "50")
    (here / "robot.yaml").write_text(with_pairs(load_robot("cogiro"), 0).to_yaml())
    assert main(["calibrate", "--robot", "robot.yaml", "--no-noise", "--no-figures"]) == 0
    told = capsys.readouterr().out.splitlines()
    assert max(map(len, told)) <= 50
    row = next(line for line in told if line.startswith("X_PM rotation"))
    assert row.split()[2:5] == ["deg", "0", "0"]


def test_bad_input_costs_one_line(capsys: pytest.CaptureFixture[str], here: Path) -> None:
    robot = load_robot("cogiro")
    blind = robot.replace(cameras=robot.cameras.replace(patterns=()))
    (here / "blind.yaml").write_text(blind.to_yaml())
    for argv, message in (
        (["calibrate", "--noise", "-1"], "--noise: must be finite and not negative"),
        (["calibrate", "--seed", "-1"], "--seed: must not be negative"),
        (["calibrate", "--noise", "2", "--no-noise"], "not allowed with argument"),
        (["calibrate", "--robot", "none"], "built-in robots"),
        (["calibrate", "--robot", "blind.yaml"], "cameras.patterns: there are none"),
        (["run", "--calibrated", "none.yaml"], "none.yaml: No such file"),
        (["run", "--calibrated", "fewer.yaml"], "has 7 cables, the true robot 8"),
    ):
        if argv[-1] == "fewer.yaml":
            cut = {"drawing_points": robot.drawing_points[:7]}
            cut["attachment_points"] = robot.attachment_points[:7]
            cells = robot.load_cells.replace(bias=0.0, gain=1.0)
            fewer = robot.replace(
                **cut,
                cable=robot.cable.replace(drum_run=5.4),
                winch=robot.winch.replace(encoder_zero_length=0.0),
                load_cells=cells,
            )
            (here / "fewer.yaml").write_text(fewer.to_yaml())
        assert main([*argv, "--no-figures"]) == 2
        told = capsys.readouterr()
        errors = [line for line in told.err.splitlines() if "error:" in line]
        assert told.out == "" and len(errors) == 1 and message in errors[0]
    assert {path.name for path in here.iterdir()} == {"blind.yaml", "fewer.yaml"}


def test_help_has_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["calibrate", "--help"])
    assert ended.value.code == 0
    assert "Example: cdpr-drake calibrate --" in " ".join(capsys.readouterr().out.split())


def test_a_tracked_board_places_the_pair(robot: CableRobot) -> None:
    board, pair, left, right = views_of_a_pair(robot, 5)
    generator = np.random.default_rng(8)
    X_SL = random_pose(generator)
    cameras = [(RigidTransform(), pair.left), (pair.X_LR, pair.right)]
    held = hold(board, cameras, 1.2, 5, np.random.default_rng(0))
    measured = np.array([at(X_SL @ X, board.reflectors) for X in held[:1]])
    tracked = TrackedBoard(known=board.reflectors, measured=measured, sigma=5e-5)
    found = calibrate_pair(board, left, right, [SIZE, SIZE], 0.1, tracked)
    assert found.X_SL is not None and np.abs(difference(found.X_SL.X, X_SL)).max() < 1e-9
