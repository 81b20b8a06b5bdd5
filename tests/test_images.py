"""From pixels to the pose: detection in cast and rendered images, and the loop closed on them."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.sensors import ImageRgba8U
from ray_caster import cast_images
from samples import rotation
from system_checks import documented_ports, feedthrough, output_sizes

from cdpr_drake.__main__ import main
from cdpr_drake.diagrams import (
    ImageSensing,
    make_vision_based_control,
    rendering,
    rest_context,
    simulate,
)
from cdpr_drake.errors import GeometryError, RenderingError, RobotFileError, SimulationError
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.rotations import pose_to_vector, vector_to_pose
from cdpr_drake.model.vision.blobs import find_all, find_near
from cdpr_drake.model.vision.discs import DiscImages
from cdpr_drake.model.vision.image_pose import ImagePoseEstimator
from cdpr_drake.model.vision.lens import Lens
from cdpr_drake.model.vision.outages import Outage
from cdpr_drake.model.vision.pattern_search import labellings
from cdpr_drake.model.vision.targets import TargetImages
from cdpr_drake.runs.paper_tests import paper_test
from cdpr_drake.show import camera_view_figure, camera_views
from cdpr_drake.systems import ImageTargets, LensDistortion

POSES = (
    RigidTransform([0.3, -0.2, 1.0]),
    RigidTransform(rotation([0.1, -0.15, 0.2]), [1.9, 1.1, 2.2]),
    RigidTransform(rotation([-0.1, 0.05, -0.3]), [-2.2, -0.9, 0.4]),
)
NEARBY = RigidTransform(rotation([0.003, -0.004, 0.005]), [0.02, -0.02, 0.015])


@functools.cache
def cast(index: int, noise: float = 0.0) -> list[np.ndarray]:
    """The images at a pose, by rays."""
    return cast_images(load_robot("cogiro"), POSES[index], noise, seed=index)


def exactly(robot: CableRobot, X_WP: RigidTransform) -> Any:
    """The sightings without noise and bias."""
    exact = robot.cameras.replace(pixel_noise=0.0, pixel_bias=0.0)
    return TargetImages(robot.replace(cameras=exact))(X_WP)


def pixel_errors(robot: CableRobot, got: Any, X_WP: RigidTransform) -> np.ndarray:
    """Errors [px] of all points that are found, each of which must be one that is visible."""
    expected = exactly(robot, X_WP)
    assert not np.any(got.visible & ~expected.visible)
    return (got.pixels - expected.pixels)[got.visible]


def pose_error(X: RigidTransform, Y: RigidTransform) -> tuple[float, float]:
    """Distance [m] and angle [deg] between two poses."""
    angle = (X.rotation().inverse() @ Y.rotation()).ToAngleAxis().angle()
    return float(np.linalg.norm(X.translation() - Y.translation())), float(np.degrees(angle))


def painted(image: np.ndarray, centre: Any, radius: float, level: int) -> np.ndarray:
    """A copy of an image with a disc of one level of grey painted over."""
    v, u = np.mgrid[: image.shape[0], : image.shape[1]]
    copy = image.copy()
    copy[np.hypot(u - centre[0], v - centre[1]) < radius, :3] = level
    return copy


# --- points


@pytest.mark.parametrize("index", range(len(POSES)))
@pytest.mark.parametrize(("noise", "rms", "most"), [(0.0, 0.03, 0.1), (2.0, 0.05, 0.2)])
def test_points_are_tracked_to_hundredths_of_a_pixel(
    cogiro: CableRobot, index: int, noise: float, rms: float, most: float
) -> None:
    got = ImagePoseEstimator(cogiro).track(cast(index, noise), POSES[index] @ NEARBY)
    errors = pixel_errors(cogiro, got, POSES[index])
    assert len(errors) >= 20
    assert np.sqrt(np.mean(errors**2)) < rms and np.abs(errors).max() < most
    assert np.abs(errors.mean(axis=0)).max() < 0.02  # half a pixel is the classic mistake


def test_a_disc_s_image_has_another_centre_than_the_disc(cogiro: CableRobot) -> None:
    """The offset at a few metres, against the moments of a dense set of the disc's points."""
    X_WC = cogiro.cameras.X_WF
    X_WP = X_WC @ RigidTransform([0.3, 0.2, 5.0]) @ RigidTransform(X_WC.rotation().inverse())
    views = DiscImages(cogiro)(X_WP @ RigidTransform(rotation([0.0, 0.0, 0.2]), [0, 0, 0]))
    seen = views.camera == 0
    assert seen.sum() >= 5
    offset = (views.centroid - views.pixel)[seen]
    assert np.linalg.norm(offset, axis=1).max() > 0.04
    image = cast_images(cogiro, X_WP @ RigidTransform(rotation([0.0, 0.0, 0.2]), [0, 0, 0]))[0]
    grey = image[:, :, 1].astype(float) - 26.0
    for (u, v), half, area in zip(
        views.centroid[seen], views.half_size[seen], views.area[seen], strict=True
    ):
        part = np.s_[
            int(v - half[1] - 1) : int(v + half[1] + 3), int(u - half[0] - 1) : int(u + half[0] + 3)
        ]
        weight = grey[part]
        rows, columns = np.mgrid[part]
        assert weight.sum() / 214.0 == pytest.approx(area, rel=0.02)
        assert np.sum(weight * columns) / weight.sum() == pytest.approx(u, abs=0.02)
        assert np.sum(weight * rows) / weight.sum() == pytest.approx(v, abs=0.02)


def test_what_is_not_a_point_is_not_taken_for_one(cogiro: CableRobot) -> None:
    estimator, expected = ImagePoseEstimator(cogiro), exactly(cogiro, POSES[0])
    images = cast(0)
    camera, covered, large, cut = 1, *np.flatnonzero(expected.visible[1])[:3]
    where = expected.pixels[camera]
    image = painted(images[camera], where[covered], 9.0, 26)  # hidden
    image = painted(image, where[large], 14.0, 240)  # of the wrong size
    image = painted(image, where[cut] + [4.0, 0.0], 6.0, 26)  # half of it hidden
    changed = [images[0], image, images[2]]
    got = estimator.track(changed, POSES[0])
    assert not got.visible[camera, [covered, large]].any()
    assert not got.visible[camera, cut] or np.linalg.norm(got.pixels[camera, cut] - where[cut]) < 4
    estimate = estimator(changed, POSES[0])
    assert estimate is not None and estimate.num_cameras == 3


def test_a_spot_at_the_border_of_the_image_is_not_measured() -> None:
    image = np.full((80, 100), 26, np.uint8)
    v, u = np.mgrid[:80, :100]
    image[np.hypot(u - 50, v - 40) < 6] = 240
    image[np.hypot(u - 97, v - 40) < 6] = 240
    area = np.pi * 36.0
    blob = find_near(image, 52.0, 41.0, (18.0, 18.0), area)
    assert blob is not None and (blob.u, blob.v) == pytest.approx((50.0, 40.0), abs=1e-9)
    assert find_near(image, 95.0, 40.0, (18.0, 18.0), area) is None
    assert find_near(image, 50.0, 40.0, (18.0, 18.0), 5.0 * area) is None
    assert find_near(image, 20.0, 20.0, (10.0, 10.0), area) is None
    assert find_near(image, 500.0, 400.0, (10.0, 10.0), area) is None
    assert [(round(b.u), round(b.v)) for b in find_all(image)] == [(50, 40)]


# --- the search


@pytest.mark.parametrize("index", range(len(POSES)))
def test_the_platform_is_found_without_a_prior(cogiro: CableRobot, index: int) -> None:
    estimator = ImagePoseEstimator(cogiro)
    rough = estimator.search(cast(index, 2.0))
    assert rough is not None and pose_error(rough, POSES[index])[0] < 0.02
    estimate = estimator(cast(index, 2.0))
    assert estimate is not None
    position, angle = pose_error(estimate.X_WP, POSES[index])
    assert position < 2e-3 and angle < 0.05
    tracked = estimator(cast(index, 2.0), POSES[index] @ NEARBY)
    assert tracked is not None and max(pose_error(tracked.X_WP, estimate.X_WP)) < 1e-3


def test_one_camera_is_enough_to_find_it(cogiro: CableRobot) -> None:
    for camera in range(3):
        images = [image if i == camera else None for i, image in enumerate(cast(0))]
        estimate = ImagePoseEstimator(cogiro)(images)
        assert estimate is not None and estimate.num_cameras == 1
        assert pose_error(estimate.X_WP, POSES[0])[0] < 0.01


def test_a_track_that_is_lost_is_searched_for(cogiro: CableRobot) -> None:
    far = RigidTransform(rotation([0.0, 0.0, 0.1]), [-0.5, 0.4, 0.3]) @ POSES[0]
    estimator = ImagePoseEstimator(cogiro)
    tracked = estimator._estimate(estimator.track(cast(0), far), far)
    assert tracked is None or pose_error(tracked.X_WP, POSES[0])[0] > 0.1
    estimate = estimator(cast(0), far)
    assert estimate is not None and pose_error(estimate.X_WP, POSES[0])[0] < 1e-3


def test_a_platform_turned_by_more_needs_a_prior(cogiro: CableRobot) -> None:
    """All four sides look the same: without a prior the turn is the smallest possible."""
    turned = POSES[0] @ RigidTransform(rotation([0.0, 0.0, np.radians(60.0)]), np.zeros(3))
    images = cast_images(cogiro, turned)
    estimator = ImagePoseEstimator(cogiro)
    prior = POSES[0] @ RigidTransform(rotation([0.0, 0.0, np.radians(40.0)]), np.zeros(3))
    found, other = estimator(images, prior), estimator(images)
    assert found is not None and max(pose_error(found.X_WP, turned)) < 0.02
    assert other is not None
    assert pose_error(other.X_WP, turned)[1] == pytest.approx(90.0, abs=0.1)


def test_other_spots_do_not_mislead_the_search(cogiro: CableRobot) -> None:
    generator = np.random.default_rng(4)
    images = []
    for image in cast(2, 2.0):
        for _ in range(8):
            centre = generator.uniform([100, 100], [1180, 924])
            if image[int(centre[1]), int(centre[0]), 1] > 80:  # beside the platform
                image = painted(image, centre, 20.0, 30)
                image = painted(image, centre, generator.uniform(4.0, 8.0), 230)
        images.append(image)
    assert sum(len(find_all(image)) for image in images) >= 40
    estimate = ImagePoseEstimator(cogiro)(images)
    assert estimate is not None and pose_error(estimate.X_WP, POSES[2])[0] < 2e-3


def test_where_there_is_no_platform_none_is_found(cogiro: CableRobot) -> None:
    estimator = ImagePoseEstimator(cogiro)
    black = np.zeros((1024, 1280, 4), np.uint8)
    noise = np.random.default_rng(0).integers(0, 256, (1024, 1280, 4), dtype=np.uint8)
    for images in ([black] * 3, [noise, black, black], [None] * 3):
        assert estimator(images) is None
        assert estimator(images, POSES[0]) is None


def test_a_pattern_is_labelled_from_its_front_only() -> None:
    generator = np.random.default_rng(1)
    points = np.array([[-0.4, -0.3], [0.5, -0.4], [0.3, 0.4], [-0.2, 0.3], [0.1, 0.0], [0.4, 0.1]])
    for _ in range(20):
        turn = generator.uniform(-np.pi, np.pi)
        R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        seen = points @ R.T * [1.0, -generator.uniform(0.4, 1.0)]  # image y points down
        depth = 1.0 + 0.05 * points @ generator.uniform(-1.0, 1.0, 2)
        pixels = 600.0 + 100.0 * seen / depth[:, None]
        others = generator.uniform(200.0, 1000.0, (5, 2))
        order = generator.permutation(11)
        spots = np.vstack([pixels, others])[order]
        expected = np.argsort(order)[:6]
        assert any(np.array_equal(found, expected) for found in labellings(points, spots))
        mirrored = np.vstack([pixels * [-1.0, 1.0], others])[order]
        assert not any(np.array_equal(found, expected) for found in labellings(points, mirrored))
    assert labellings(points, pixels[:5]) == []


# --- the system


def as_image(array: np.ndarray) -> Value:
    image = ImageRgba8U(array.shape[1], array.shape[0])
    image.mutable_data[:] = array
    return Value(image)


def show(system: ImageTargets, context: Any, images: list[np.ndarray]) -> None:
    for n, image in enumerate(images, 1):
        system.GetInputPort(f"image_{n}").FixValue(context, as_image(image))


def outputs(system: ImageTargets, context: Any) -> dict[str, np.ndarray]:
    return {name: system.GetOutputPort(name).Eval(context) for name in output_sizes(system)}


def test_ports_of_the_image_cameras(cogiro: CableRobot) -> None:
    system = ImageTargets(cogiro)
    inputs = [system.get_input_port(i).get_name() for i in range(system.num_input_ports())]
    assert inputs == ["image_1", "image_2", "image_3"]
    name, _, documented = documented_ports(ImageTargets, {})
    assert name == "ImageTargets" and set(documented) == set(output_sizes(system))
    assert output_sizes(system)["measured_pose"] == 6 and feedthrough(system) == set()


def test_the_pose_is_measured_held_while_black_and_found_again(cogiro: CableRobot) -> None:
    system = ImageTargets(cogiro, sample_time=0.1)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    show(system, context, cast(0))
    simulator.AdvanceTo(0.05)
    first = outputs(system, context)
    position, angle = pose_error(vector_to_pose(first["measured_pose"]), POSES[0])
    assert position < 1e-3 and angle < 0.02
    assert first["num_cameras"] == 3.0 and first["num_targets"] >= 15.0
    show(system, context, [np.zeros_like(image) for image in cast(0)])
    simulator.AdvanceTo(0.25)
    held = outputs(system, context)
    np.testing.assert_array_equal(held["measured_pose"], first["measured_pose"])
    assert held["age"] == pytest.approx(0.2) and held["frames_lost"] == 2.0
    assert held["num_cameras"] == 0.0 and held["images_lost"] == 6.0
    show(system, context, cast(1))  # half a room away
    simulator.AdvanceTo(0.35)
    again = outputs(system, context)
    assert pose_error(vector_to_pose(again["measured_pose"]), POSES[1])[0] < 1e-3
    assert again["age"] == 0.0 and again["frames_lost"] == 2.0


def test_a_camera_that_fails_delivers_no_image(cogiro: CableRobot) -> None:
    failing = Outage(sensor="pose camera", number=2)
    system = ImageTargets(cogiro, outages=(failing,))
    simulator = Simulator(system)
    show(system, simulator.get_mutable_context(), cast(0))
    simulator.AdvanceTo(0.01)
    got = outputs(system, simulator.get_context())
    assert got["num_cameras"] == 2.0 and got["images_lost"] == 1.0


def test_images_that_cannot_be_are_refused(cogiro: CableRobot) -> None:
    system = ImageTargets(cogiro)
    context = system.CreateDefaultContext()
    black = np.zeros_like(cast(0)[0])
    show(system, context, [black] * 3)
    with pytest.raises(GeometryError, match="no pose camera sees a whole pattern"):
        system.settle(context)
    with pytest.raises(SimulationError, match="measured pose at t = 0 s: no pose camera sees"):
        Simulator(system, context).AdvanceTo(0.01)
    system.GetInputPort("image_2").FixValue(context, as_image(black[:512, :640]))
    with pytest.raises(GeometryError, match=r"image 2 is of 640 x 512 pixels.* 1280 x 1024"):
        system.settle(context)


# --- the lens


def test_a_lens_puts_each_ray_where_its_camera_has_it(cogiro: CableRobot) -> None:
    """A smooth image of the rays' directions, against the camera's own undistortion."""
    import cv2

    plain = cogiro.cameras.pose_cameras[0].intrinsics
    matrix = np.array([[300.0, 0.0, 170.0], [0.0, 280.0, 110.0], [0.0, 0.0, 1.0]])
    camera = plain.replace(camera_matrix=matrix, width=320, height=256)
    lens = Lens(camera)
    x0, y0 = lens.pinhole.centre
    u, v = np.meshgrid(np.arange(lens.pinhole.width), np.arange(lens.pinhole.height))
    x, y = (u - x0) / lens.pinhole.focal_length, (v - y0) / lens.pinhole.focal_length
    levels = [128.0 + 160.0 * x, 128.0 + 160.0 * y]
    image = np.dstack([np.round(c).astype(np.uint8) for c in (*levels, *levels)])
    out = np.zeros((256, 320, 4), np.uint8)
    lens(image, out)
    pixels = np.stack(np.meshgrid(np.arange(320.0), np.arange(256.0)), axis=-1).reshape(-1, 1, 2)
    rays = cv2.undistortPoints(pixels, matrix, camera.distortion, criteria=(3, 50, 1e-10))
    expected = 128.0 + 160.0 * rays.reshape(256, 320, 2)
    assert np.abs(out[:, :, :2] - expected).max() < 1.1
    assert abs(np.mean(out[:, :, :2] - expected)) < 0.05


def test_noise_of_an_image_is_white_and_seeded(cogiro: CableRobot) -> None:
    lens = Lens(cogiro.cameras.pose_cameras[0].intrinsics, grey_noise=3.0)
    image = np.full((lens.pinhole.height, lens.pinhole.width, 4), 100, np.uint8)
    outs = []
    for seed in (7, 7, 8):
        out = np.zeros((1024, 1280, 4), np.uint8)
        lens(image, out, seed)
        outs.append(out.astype(float))
    np.testing.assert_array_equal(outs[0], outs[1])
    assert np.abs(outs[0] - outs[2]).max() > 5.0
    noise = outs[0][:, :, 1] - 100.0
    assert abs(noise.mean()) < 0.02 and noise.std() == pytest.approx(3.0, rel=0.02)
    assert abs(np.mean(noise[:, 1:] * noise[:, :-1])) < 0.05
    assert np.all(outs[0][:, :, 3] == 100.0)
    with pytest.raises(ValueError, match="noise must be >= 0"):
        Lens(cogiro.cameras.pose_cameras[0].intrinsics, grey_noise=-1.0)


def test_a_lens_that_no_pinhole_can_stand_for_is_refused(cogiro: CableRobot) -> None:
    camera = cogiro.cameras.pose_cameras[0].intrinsics
    fish = camera.replace(camera_matrix=np.diag([150.0, 150.0, 1.0]) + np.eye(3, k=2) * 640.0)
    with pytest.raises(RobotFileError, match="no pinhole sees"):
        Lens(fish.replace(distortion=[-0.3, 0.0, 0.0, 0.0, 0.0]))
    lens = LensDistortion(camera)
    context = lens.CreateDefaultContext()
    lens.GetInputPort("pinhole_image").FixValue(context, as_image(cast(0)[0]))
    with pytest.raises(GeometryError, match="an image of 1280 x 1024 pixels came"):
        lens.GetOutputPort("image").Eval(context)


# --- rendering


def test_without_a_driver_the_error_is_one_line(
    cogiro: CableRobot, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Any
) -> None:
    monkeypatch.setattr(rendering, "rendering_available", lambda: False)
    with pytest.raises(RenderingError, match="EGL") as caught:
        make_vision_based_control(cogiro, sensing=ImageSensing())
    assert "\n" not in str(caught.value)
    assert main(["run", "--sensors", "images", "--output", str(tmp_path / "out")]) == 2
    message = capsys.readouterr().err.strip()
    assert "EGL" in message and "\n" not in message and not (tmp_path / "out").exists()
    with pytest.raises(ValueError, match="give a sample time"):
        make_vision_based_control(cogiro, sensing=ImageSensing(), sample_time=None)


def rendered(robot: CableRobot, X_WP: RigidTransform) -> list[np.ndarray]:
    diagram = rendering.make_pose_camera_images(robot)
    context = diagram.CreateDefaultContext()
    diagram.GetInputPort("pose").FixValue(context, pose_to_vector(X_WP))
    count = len(robot.cameras.pose_cameras)
    return [diagram.GetOutputPort(f"image_{n + 1}").Eval(context).data for n in range(count)]


@pytest.mark.render
@pytest.mark.needs("egl")
def test_rendered_points_are_where_the_cameras_project_them(cogiro: CableRobot) -> None:
    images = rendered(cogiro, POSES[2])
    estimator = ImagePoseEstimator(cogiro)
    errors = pixel_errors(cogiro, estimator.track(images, POSES[2] @ NEARBY), POSES[2])
    assert len(errors) >= 25
    assert np.sqrt(np.mean(errors**2)) < 0.05 and np.abs(errors).max() < 0.2
    assert np.abs(errors.mean(axis=0)).max() < 0.02
    estimate = estimator(images)  # with no prior
    assert estimate is not None
    position, angle = pose_error(estimate.X_WP, POSES[2])
    assert position < 1e-3 and angle < 0.02


@pytest.mark.render
@pytest.mark.needs("egl")
def test_patterns_and_cameras_of_any_kind_are_rendered_true(cogiro: CableRobot) -> None:
    """Points without symmetry, one camera whose pixels are not square and whose axis is not
    centred: nothing is mirrored, turned or shifted."""
    setup = cogiro.cameras
    odd = [[-0.4, -0.35], [0.4, -0.4], [0.2, 0.4], [-0.3, 0.2], [0.05, -0.1]]
    camera = setup.pose_cameras[1]
    matrix = np.array([[1150.0, 0.0, 600.0], [0.0, 1000.0, 540.0], [0.0, 0.0, 1.0]])
    other = camera.replace(intrinsics=camera.intrinsics.replace(camera_matrix=matrix))
    changed = setup.replace(
        pose_cameras=(other,), patterns=tuple(p.replace(points=odd) for p in setup.patterns)
    )
    robot = cogiro.replace(cameras=changed)
    images = rendered(robot, POSES[0])
    got = ImagePoseEstimator(robot).track(images, POSES[0])
    errors = pixel_errors(robot, got, POSES[0])
    assert len(errors) == 10 and np.abs(errors).max() < 0.2


@pytest.mark.render
@pytest.mark.needs("egl")
def test_a_figure_shows_what_each_camera_sees(
    cogiro: CableRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = camera_view_figure(cogiro, POSES[0])
    whole, close = figure.axes[:3], figure.axes[3:6]
    assert [axes.get_title() for axes in whole] == [f"pose camera {n}" for n in (1, 2, 3)]
    expected = exactly(cogiro, POSES[0])
    for axes, pixels, visible in zip(close, expected.pixels, expected.visible, strict=True):
        drawn = np.vstack([line.get_xydata() for line in axes.lines])
        assert len(drawn) == np.count_nonzero(visible)
        gaps = np.linalg.norm(drawn[:, None] - pixels[visible], axis=2).min(axis=1)
        assert gaps.max() < 0.3
        assert axes.get_xlabel().startswith(f"{len(drawn)} points, 0.0")
    monkeypatch.setattr(camera_views, "_rendered", lambda *_: 3 * [np.zeros((1024, 1280, 4), "u1")])
    with pytest.raises(GeometryError, match="found in no camera's image"):
        camera_view_figure(cogiro, POSES[0])


@pytest.mark.render
@pytest.mark.needs("egl", "numba")
def test_the_loop_arrives_on_rendered_images(cogiro: CableRobot) -> None:
    """From 50 mm and 1 degree beside the goal of Test 4, on noisy pixels of eleven cameras."""
    _, goal = paper_test(4).poses(cogiro)
    aside = RigidTransform(rotation([0.0, np.radians(1.0), 0.0]), [0.03, -0.03, 0.0265])
    X_PM = cogiro.cameras.X_PM
    start = goal @ X_PM @ aside @ X_PM.inverse()
    loop = make_vision_based_control(
        cogiro, "SCMWE", 1.2, noise=True, sensing=ImageSensing(), ramp_time=0.1
    )
    context = rest_context(loop, start, seed=1)
    loop.GetInputPort("desired_pose").FixValue(context, pose_to_vector(goal))
    names = ["pose_error", "frames_lost", "images_lost", "tangent_frames_lost"]
    record = simulate(loop, context, 1.8, record=names)
    errors = np.linalg.norm(record["pose_error"].reshape(-1, 2, 3), axis=2)
    assert errors[0, 1] == pytest.approx(0.05, abs=1e-3)
    assert errors[-1, 1] <= 10e-3 and np.degrees(errors[-1, 0]) <= 0.5
    for name in names[1:]:
        assert not record[name].any()
