"""The pose from targets: projection, means of rotations, estimates without and with noise."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from oracle import ORACLE
from pydrake.math import RigidTransform, RotationMatrix
from samples import jacobian, random_pose

from cdpr_drake.errors import RobotFileError
from cdpr_drake.model.kernels import vision as kernel
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.rotations import exp_rotation, log_rotation, skew
from cdpr_drake.model.vision.pose import PoseEstimate, PoseEstimator
from cdpr_drake.model.vision.rotation_means import (
    chordal_mean,
    chordal_mean_svd,
    karcher_mean,
    mean_pose,
)
from cdpr_drake.model.vision.targets import (
    MOST_OBLIQUE,
    Sightings,
    TargetGeometry,
    TargetImages,
    pack_camera,
)
from cdpr_drake.runs.paper_tests import paper_test

BOTH = pytest.mark.parametrize("estimator", ["joint", "mean"])
CENTRE = RigidTransform([0.3, -0.2, 1.0])


def unbiased(robot: CableRobot) -> CableRobot:
    """The robot with white pixel noise only."""
    return robot.replace(cameras=robot.cameras.replace(pixel_bias=0.0))


@cache
def setup(estimator: str = "joint") -> tuple[TargetImages, PoseEstimator]:
    """Images of CoGiRo without fixed biases, and an estimator that expects none."""
    robot = unbiased(load_robot("cogiro"))
    return TargetImages(robot), PoseEstimator(robot, estimator)


def motion(X: RigidTransform, Y: RigidTransform) -> np.ndarray:
    """The small motion [rotation vector; translation] in W that takes X to Y."""
    turn = log_rotation((Y.rotation() @ X.rotation().inverse()).matrix())
    return np.concatenate([turn, Y.translation() - X.translation()])


def only(seen: Sightings, camera: int, pattern: int) -> Sightings:
    """What one camera sees of one pattern of five points."""
    visible = np.zeros_like(seen.visible)
    part = slice(5 * pattern, 5 * pattern + 5)
    visible[camera, part] = seen.visible[camera, part]
    return Sightings(pixels=seen.pixels, visible=visible)


def estimated(
    estimator: str,
    X_WP: RigidTransform,
    noise: np.ndarray | None = None,
    prior: RigidTransform | None = None,
) -> PoseEstimate:
    images, estimate = setup(estimator)
    result = estimate(images(X_WP, noise), prior)
    assert result is not None
    return result


# --- projection


def test_projection_is_opencv_s(cogiro: CableRobot) -> None:
    import cv2

    generator = np.random.default_rng(1)
    base = cogiro.cameras.pose_cameras[1].intrinsics
    K = np.array([[1100.0, 0.0, 640.0], [0.0, 1050.0, 500.0], [0.0, 0.0, 1.0]])
    intrinsics = base.replace(camera_matrix=K, distortion=[-0.1, 0.05, 2e-3, -1e-3, 0.02])
    X_WC = random_pose(generator)
    X_CW = X_WC.inverse()
    p_CQ = generator.uniform([-0.5, -0.4, 0.9], [0.5, 0.4, 1.1], (50, 3)) * 4.0
    p_WQ = np.array([X_WC @ p for p in p_CQ])
    pixels = np.empty((50, 2))
    camera = pack_camera(X_WC, intrinsics)
    kernel.project_all(camera[None], np.zeros(50, int), p_WQ, pixels)
    turn = cv2.Rodrigues(X_CW.rotation().matrix())[0]
    expected = cv2.projectPoints(p_WQ, turn, X_CW.translation(), K, intrinsics.distortion)[0]
    np.testing.assert_allclose(pixels, expected[:, 0], atol=1e-9)
    straight = np.empty((50, 2))
    kernel.undistorted(camera, pixels, straight)
    np.testing.assert_allclose(straight, p_CQ[:, :2] / p_CQ[:, 2:], atol=1e-13)


def test_the_jacobian_of_the_projection(cogiro: CableRobot) -> None:
    camera = TargetGeometry(cogiro).cameras[0]
    p = np.array([0.5, -0.4, 1.3])

    def pixel(p: np.ndarray) -> np.ndarray:
        out = np.empty(2)
        assert kernel.project(camera, p, out, np.empty((2, 3)))
        return out

    J = np.empty((2, 3))
    kernel.project(camera, p, np.empty(2), J)
    np.testing.assert_allclose(J, jacobian(pixel, p), rtol=1e-8, atol=1e-8)
    behind = cogiro.cameras.X_WF @ np.array([0.0, 0.0, -1.0])
    assert not kernel.project(camera, behind, np.empty(2), J)


def test_the_information_is_that_of_the_projection_s_jacobian(cogiro: CableRobot) -> None:
    images, _ = setup()
    geometry = TargetGeometry(cogiro)
    seen = images(CENTRE)
    which, index = (np.ascontiguousarray(i) for i in np.nonzero(seen.visible))

    def pixels(d: np.ndarray) -> np.ndarray:
        X = RigidTransform(
            RotationMatrix(exp_rotation(d[:3])) @ CENTRE.rotation(), CENTRE.translation() + d[3:]
        )
        out = np.empty((which.size, 2))
        p = np.array([X @ p for p in geometry.points[index]])
        kernel.project_all(geometry.cameras, which, p, out)
        return out.ravel()

    J = jacobian(pixels, np.zeros(6), 1e-5)
    X = np.vstack([CENTRE.rotation().matrix(), CENTRE.translation()])
    G, g = np.empty((6, 6)), np.empty(6)
    moved = seen.pixels[seen.visible] + 0.3
    cost = kernel.normal_equations(geometry.points[index], which, moved, geometry.cameras, X, G, g)
    np.testing.assert_allclose(G, J.T @ J, rtol=1e-7, atol=1e-7 * np.abs(G).max())
    np.testing.assert_allclose(g, J.T @ np.full(len(J), 0.3), rtol=1e-6)
    assert cost == pytest.approx(len(J) * 0.3**2, rel=1e-9)


# --- what is seen


def test_each_camera_sees_the_faces_turned_to_it() -> None:
    images, _ = setup()
    seen = images(RigidTransform([0.0, 0.0, 1.0])).visible.reshape(3, 4, 5)  # faces +x, +y, -x, -y
    assert np.all(seen.all(axis=2) == seen.any(axis=2))
    expected = [[0, 0, 1, 1], [1, 1, 0, 0], [1, 0, 0, 1]]  # cameras at (-, -), (+, +), (+, -)
    np.testing.assert_array_equal(seen[:, :, 0], expected)


def test_a_pattern_is_lost_when_too_oblique(cogiro: CableRobot) -> None:
    images, _ = setup()
    camera = cogiro.cameras.X_WF.translation()
    for angle, visible in ((MOST_OBLIQUE - 0.02, True), (MOST_OBLIQUE + 0.02, False)):
        # Turn the platform about z until the face -x is at this angle to the line of sight.
        centre, found = np.array([0.0, 0.0, 1.5]), []
        for yaw in np.linspace(-1.2, 0.4, 4001):
            R = exp_rotation([0.0, 0.0, yaw])
            face, normal = centre + R @ [-0.5, 0.0, 0.0], R @ [-1.0, 0.0, 0.0]
            sight = (camera - face) / np.linalg.norm(camera - face)
            found.append((abs(np.arccos(normal @ sight) - angle), yaw))
        yaw = min(found)[1]
        X = RigidTransform(RotationMatrix(exp_rotation([0.0, 0.0, yaw])), centre - [0, 0, 0.5])
        assert images(X).visible[0, 10:15].all() == visible


def test_a_point_outside_of_the_image_is_not_seen(cogiro: CableRobot) -> None:
    images, _ = setup()
    for shift in np.linspace(0.0, 12.0, 49):
        seen = images(RigidTransform([shift - 6.0, 0.0, 1.0]))
        kept = seen.pixels[seen.visible]
        assert np.all((kept >= 0.0) & (kept <= [1279.0, 1023.0]))
    assert not images(RigidTransform([0.0, 0.0, 8.0])).visible.any()  # above all cameras
    far_aside = images(RigidTransform([-7.0, 30.0, 1.0]))
    assert not far_aside.visible.any()


def test_the_bias_is_fixed_by_the_robot_file(cogiro: CableRobot) -> None:
    first, again = TargetImages(cogiro), TargetImages(cogiro)
    np.testing.assert_array_equal(first.bias, again.bias)
    assert first.bias.shape == (3, 20, 2)
    assert np.sqrt(np.mean(first.bias**2)) == pytest.approx(0.25, rel=0.2)
    other = cogiro.replace(cameras=cogiro.cameras.replace(pixel_bias_seed=2))
    assert np.abs(TargetImages(other).bias - first.bias).min() > 0.0
    plain, _ = setup()
    noise = np.random.default_rng(0).standard_normal(first.noise_size)
    shift = first(CENTRE, noise).pixels - plain(CENTRE).pixels
    expected = first.bias + 0.2 * noise.reshape(3, 20, 2)
    np.testing.assert_allclose(shift, expected, atol=1e-9)


def test_a_robot_without_cameras_or_patterns_is_refused(cogiro: CableRobot) -> None:
    for field in ("pose_cameras", "patterns"):
        blind = cogiro.replace(cameras=cogiro.cameras.replace(**{field: ()}))
        with pytest.raises(RobotFileError, match=rf"cameras\.{field}: there are none"):
            TargetImages(blind)
        with pytest.raises(RobotFileError, match=rf"cameras\.{field}: there are none"):
            PoseEstimator(blind)
    with pytest.raises(ValueError, match="unknown estimator"):
        PoseEstimator(cogiro, "median")


# --- means of rotations


def test_means_of_rotations_are_the_oracle_s() -> None:
    row = ORACLE["rotation_mean"]
    rotations = [exp_rotation(v) for v in row["theta_u"]]
    for mean, name in (
        (chordal_mean, "chordal"),
        (chordal_mean_svd, "chordal_svd"),
        (karcher_mean, "Karcher"),
    ):
        got = log_rotation(mean(rotations, row["weights"]))
        np.testing.assert_allclose(got, row[name], rtol=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_the_two_forms_of_the_chordal_mean_agree(seed: int) -> None:
    generator = np.random.default_rng(seed)
    spread = 10.0 ** generator.uniform(-6, 0)
    about = exp_rotation(generator.uniform(-3, 3, 3))
    rotations = [about @ exp_rotation(v) for v in spread * generator.standard_normal((7, 3))]
    weights = generator.uniform(0.1, 2.0, 7)
    first, second = chordal_mean(rotations, weights), chordal_mean_svd(rotations, weights)
    np.testing.assert_allclose(first, second, atol=1e-12)
    np.testing.assert_allclose(first @ first.T, np.eye(3), atol=1e-14)


def test_means_need_something_to_average() -> None:
    for mean in (chordal_mean, chordal_mean_svd, karcher_mean):
        with pytest.raises(ValueError, match="rotations must have shape"):
            mean([])
        with pytest.raises(ValueError, match="weights must be 1 numbers"):
            mean([np.eye(3)], [-1.0])
    half = mean_pose([RigidTransform([0.0, 0, 0]), RigidTransform([1.0, 0, 0])], [1.0, 3.0])
    np.testing.assert_allclose(half.translation(), [0.75, 0, 0])


# --- without noise


@BOTH
@pytest.mark.parametrize("seed", range(10))
def test_without_noise_the_pose_is_exact(estimator: str, seed: int) -> None:
    X = random_pose(np.random.default_rng(seed))
    got = estimated(estimator, X)
    error = np.abs(motion(X, got.X_WP))
    assert error[:3].max() < 1e-8 and error[3:].max() < 1e-8
    assert got.pixel_error < 1e-6
    near = RigidTransform(
        X.rotation() @ RotationMatrix(exp_rotation([0.01, -0.02, 0.01])),
        X.translation() + np.array([0.02, 0.01, -0.03]),
    )
    error = np.abs(motion(X, estimated(estimator, X, prior=near).X_WP))
    assert error.max() < 1e-8


@pytest.mark.parametrize("name", ["cogiro-22m", "cogiro-98m"])
@BOTH
def test_without_noise_the_pose_is_exact_on_large_robots(name: str, estimator: str) -> None:
    robot = unbiased(load_robot(name))
    images, estimate = TargetImages(robot), PoseEstimator(robot, estimator)
    X = RigidTransform(RotationMatrix(exp_rotation([0.05, 0.1, -0.1])), [0.5, 1.0, 2.0])
    got = estimate(images(X))
    assert got is not None and np.abs(motion(X, got.X_WP)).max() < 1e-8
    assert got.num_cameras == 3


def test_a_prior_that_is_far_off_does_no_harm() -> None:
    noise = np.random.default_rng(3).standard_normal(setup()[0].noise_size)
    expected = estimated("joint", CENTRE, noise).X_WP
    for turn, shift in (
        ([0.0, 0.0, 3.0], [0, 0, 0]),
        ([1.5, 1.0, 0], [3, 1, 2]),
        ([0] * 3, [99] * 3),
    ):
        wrong = RigidTransform(
            RotationMatrix(exp_rotation(turn)), CENTRE.translation() + np.array(shift, float)
        )
        got = estimated("joint", CENTRE, noise, wrong).X_WP
        assert np.abs(motion(expected, got)).max() < 1e-8


@BOTH
def test_one_pattern_in_one_camera_gives_a_pose(estimator: str) -> None:
    images, estimate = setup(estimator)
    X = RigidTransform(RotationMatrix(exp_rotation([0.1, -0.1, 0.3])), [-2.0, -1.0, 1.0])
    got = estimate(only(images(X), 0, 2))
    assert got is not None and np.abs(motion(X, got.X_WP)).max() < 1e-8
    assert (got.num_cameras, got.num_targets) == (1, 5)


def test_the_ambiguity_of_a_plane_pattern_is_resolved_by_the_prior() -> None:
    """Far away and noisy, both poses of a pattern explain it; with a prior, the right one wins."""
    robot = unbiased(load_robot("cogiro-98m"))
    images, estimate = TargetImages(robot), PoseEstimator(robot)
    X = RigidTransform([0.0, 0.0, 2.0])
    generator = np.random.default_rng(0)
    worst = {True: 0.0, False: 0.0}
    for _ in range(20):
        one = only(images(X, generator.standard_normal(images.noise_size)), 0, 3)
        for has_prior in worst:
            got = estimate(one, X if has_prior else None)
            assert got is not None and got.num_targets == 5
            turn = np.linalg.norm(motion(X, got.X_WP)[:3])
            worst[has_prior] = max(worst[has_prior], turn)
    assert worst[False] > 0.5 > worst[True]


@BOTH
def test_too_little_to_see_gives_no_pose(estimator: str) -> None:
    images, estimate = setup(estimator)
    seen = images(CENTRE)
    assert estimate(seen.without([0, 1, 2])) is None
    three = seen.visible.copy()
    three[:, [0, 1, 5, 6, 10, 11, 15, 16]] = False  # three points left of each pattern
    assert estimate(Sightings(pixels=seen.pixels, visible=three)) is None
    four = seen.visible.copy()
    four[:, [2, 7, 12, 17]] = False  # three corners and the centre: three on a line
    assert estimated("joint", CENTRE).num_targets == 20
    for prior in (None, CENTRE):
        got = PoseEstimator(unbiased(load_robot("cogiro")))(
            Sightings(pixels=seen.pixels, visible=four), prior
        )
        assert prior is None or got is not None
        assert got is None or np.abs(motion(CENTRE, got.X_WP)).max() < 1e-8


def test_losing_a_camera_is_counted() -> None:
    images, estimate = setup()
    for camera, points in ((0, 15), (1, 15), (2, 20)):
        got = estimate(images(CENTRE).without([camera]))
        assert got is not None
        assert (got.num_cameras, got.num_targets) == (2, points)
        assert np.abs(motion(CENTRE, got.X_WP)).max() < 1e-8


# --- with noise


def workspace() -> list[RigidTransform]:
    """Level poses over the workspace, and the ten poses of the paper's tests."""
    grid = np.stack(
        np.meshgrid([-2.5, -1.0, 1.0, 2.5], [-1.5, 0.0, 1.5], [0.3, 1.4, 2.5]), -1
    ).reshape(-1, 3)
    robot = load_robot("cogiro")
    tests = [X for number in range(1, 6) for X in paper_test(number).poses(robot)]
    return [RigidTransform(p) for p in grid] + tests


def target_covariance(estimate: PoseEstimate) -> np.ndarray:
    """The covariance of the motion of M, whose pose the paper's cameras measure."""
    to_M = np.eye(6)
    to_M[3:, :3] = -skew(estimate.X_WP.rotation() @ np.array([0.0, 0.0, 0.5]))
    return to_M @ estimate.covariance @ to_M.T


def test_the_joint_estimate_is_good_to_1_mm_and_a_tenth_of_a_degree() -> None:
    for X in workspace():
        got = estimated("joint", X)
        for covariance in (got.covariance, target_covariance(got)):
            sigma = np.sqrt(np.diag(covariance))
            assert np.degrees(sigma[:3]).max() <= 0.1, X.translation()
            assert sigma[3:].max() <= 1.0e-3, X.translation()


ASIDE = RigidTransform(RotationMatrix(exp_rotation([0.15, -0.1, 0.2])), [-2.0, 1.2, 1.8])


@pytest.mark.parametrize(
    "X",
    [CENTRE, pytest.param(ASIDE, marks=pytest.mark.needs("numba"))],
    ids=["centre", "aside"],
)
def test_the_joint_estimate_scatters_as_predicted(X: RigidTransform) -> None:
    images, _ = setup()
    errors, predicted = [], estimated("joint", X).covariance
    for seed in range(500):
        noise = np.random.default_rng(seed).standard_normal(images.noise_size)
        errors.append(motion(X, estimated("joint", X, noise, X).X_WP))
    E = np.array(errors)
    # The sum of 500 squared distances is chi-square with 3000 degrees of freedom.
    squares = np.einsum("ni,ij,nj->n", E, np.linalg.inv(predicted), E)
    assert abs(squares.sum() - 3000.0) < 4.0 * np.sqrt(2.0 * 3000.0)
    # So is each axis with 500.
    ratios = (E**2).sum(axis=0) / np.diag(predicted)
    assert np.abs(ratios - 500.0).max() < 4.0 * np.sqrt(2.0 * 500.0)
    assert np.abs(E.mean(axis=0) / np.sqrt(np.diag(predicted) / 500.0)).max() < 4.0
    assert np.sqrt(squares.mean() / 6.0) == pytest.approx(1.0, abs=0.06)


def test_the_paper_s_mean_scatters_by_5_to_9_mm() -> None:
    images, _ = setup()
    generator = np.random.default_rng(0)
    E, predicted = [], estimated("mean", CENTRE).covariance
    for _ in range(150):
        noise = generator.standard_normal(images.noise_size)
        E.append(motion(CENTRE, estimated("mean", CENTRE, noise).X_WP))
    sigma = np.std(E, axis=0)
    # 150 draws give a sigma to 6 %; the poses of single patterns are not quite linear in the noise
    np.testing.assert_allclose(sigma, np.sqrt(np.diag(predicted)), rtol=0.25)
    assert sigma[3:].min() > 3e-3 and 5e-3 < sigma[3:].max() < 9e-3
    joint = np.sqrt(np.diag(estimated("joint", CENTRE).covariance))
    assert np.all(sigma[3:] > 5.0 * joint[3:])


def test_the_fixed_bias_shifts_the_pose_within_its_covariance(cogiro: CableRobot) -> None:
    """Over biases drawn anew, the pose scatters as the covariance says, with white noise too."""
    squares = []
    for seed in range(60):
        robot = cogiro.replace(cameras=cogiro.cameras.replace(pixel_bias_seed=seed))
        images, estimate = TargetImages(robot), PoseEstimator(robot)
        noise = np.random.default_rng([9, seed]).standard_normal(images.noise_size)
        got = estimate(images(CENTRE, noise), CENTRE)
        assert got is not None
        error = motion(CENTRE, got.X_WP)
        squares.append(error @ np.linalg.solve(got.covariance, error))
    assert abs(sum(squares) - 360.0) < 4.0 * np.sqrt(720.0)


@pytest.mark.parametrize("estimator", ["joint", "mean"])
def test_one_part_of_the_covariance_averages_out_and_the_other_does_not(
    cogiro: CableRobot, estimator: str
) -> None:
    """Over noise with one fixed bias the one part; over biases without noise the other."""
    frames = 200 if estimator == "joint" else 60

    def poses(bias_seed: int, noise: np.random.Generator | None, count: int) -> list[PoseEstimate]:
        cameras = cogiro.cameras.replace(pixel_bias_seed=bias_seed)
        robot = cogiro.replace(cameras=cameras)
        images, estimate = TargetImages(robot), PoseEstimator(robot, estimator)
        found = []
        for _ in range(count):
            draw = None if noise is None else noise.standard_normal(images.noise_size)
            found.append(estimate(images(CENTRE, draw), CENTRE))
        assert all(f is not None for f in found)
        return found

    noisy = poses(1, np.random.default_rng(3), frames)
    E = np.array([motion(CENTRE, e.X_WP) for e in noisy])
    scatter = E - E.mean(axis=0)
    spread = np.einsum("ni,ij,nj->n", scatter, np.linalg.inv(noisy[0].noise_covariance), scatter)
    freedom = 6.0 * (frames - 1)
    assert abs(spread.sum() / freedom - 1.0) < (0.1 if estimator == "joint" else 0.3)
    # The mean of all frames keeps the bias: more than noise explains, no more than bias does.
    left = E.mean(axis=0)
    assert left @ np.linalg.solve(noisy[0].noise_covariance / frames, left) > 60.0
    assert left @ np.linalg.solve(noisy[0].fixed_covariance, left) < 25.0

    still = [poses(seed, None, 1)[0] for seed in range(frames)]
    E = np.array([motion(CENTRE, e.X_WP) for e in still])
    spread = np.einsum("ni,ij,nj->n", E, np.linalg.inv(still[0].fixed_covariance), E)
    assert abs(spread.sum() / (6.0 * frames) - 1.0) < (0.1 if estimator == "joint" else 0.3)
    both = still[0].noise_covariance + still[0].fixed_covariance
    np.testing.assert_array_equal(still[0].covariance, both)
