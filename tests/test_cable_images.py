"""Images of the cables, the edges detected in them, and the tangents that follow."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.analysis import Simulator
from scipy.ndimage import gaussian_filter
from system_checks import documented_ports, feedthrough, fixed_context, input_sizes, output_sizes
from test_vision_tangents import CENTRE, angles, cables_at

from cdpr_drake.model.kernels import cable_lines as kernel
from cdpr_drake.model.kernels import stereo, vision
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.rotations import pose_to_vector
from cdpr_drake.model.vision.cable_drawing import CABLE, PANEL, CableDrawing
from cdpr_drake.model.vision.lines import CableLines
from cdpr_drake.model.vision.outages import Outage
from cdpr_drake.model.vision.tangents import CableImages, StereoGeometry, TangentEstimator
from cdpr_drake.runs.paper_tests import paper_test
from cdpr_drake.show import stereo_view_figure
from cdpr_drake.systems import StereoImageCameras, StereoTangentCameras

Images = list[Any]


@cache
def scene(name: str = "cogiro") -> tuple[CableRobot, np.ndarray, np.ndarray, CableLines]:
    """A robot at rest in the middle: its cables' tangents and tensions, and what finds them."""
    robot = load_robot(name)
    return robot, *cables_at(robot, CENTRE), CableLines(robot)


@cache
def drawn(noise: int | None = None, blur: float = 0.5) -> Images:
    robot, u, T, _ = scene()
    return CableDrawing(robot, blur=blur)(u, T, noise)


def turned(u: np.ndarray, angle: float, seed: int = 0) -> np.ndarray:
    """Tangents turned by an angle in random directions."""
    v = np.cross(u, np.random.default_rng(seed).standard_normal(u.shape))
    v = np.cos(angle) * u + np.sin(angle) * v / np.linalg.norm(v, axis=1, keepdims=True)
    return v


def across(edges: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """How far points lie beside the exact edges (k, 2, 2, n) [px]."""
    along = np.gradient(exact, axis=-2)
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    d = edges - exact
    return np.abs(d[..., 0] * along[..., 1] - d[..., 1] * along[..., 0])


def images_like(images: Images, change: Any) -> Images:
    """The images with each changed."""
    return [tuple(change(image.copy()) for image in pair) for pair in images]


# --- drawing


def covered(robot: CableRobot, cable: int, station: float, shape: tuple[int, int], fine: int):
    """A patch of the left image, and which of its fine x fine sub-pixels a cable covers.

    By the definition: where the line of sight comes nearer to the cable's axis than its radius.
    """
    _, u, T, _ = scene(robot.name)
    geometry = StereoGeometry(robot)
    camera, point, tangent = geometry.lefts[cable], np.empty(3), np.empty(3)
    w, EA = robot.weight_per_metre, geometry.stiffness(T)[cable]
    A = geometry.leaving(u)[cable]
    stereo.cable_point(A, u[cable], T[cable], w, EA, station, point, tangent)
    middle, J = np.empty(2), np.empty((2, 3))
    vision.project(camera, point, middle, J)
    x0, y0 = np.round(middle).astype(int) - np.array(shape)[::-1] // 2
    step = (np.arange(fine) + 0.5) / fine - 0.5
    x = (x0 + np.arange(shape[1])[:, None] + step).ravel()
    y = (y0 + np.arange(shape[0])[:, None] + step).ravel()
    pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    lens = robot.cameras.stereo_pairs[geometry.pairs[cable]].left
    plane = cv2.undistortPoints(pixels[:, None], lens.camera_matrix, lens.distortion)[:, 0]
    R = camera[:9].reshape(3, 3)
    rays = np.column_stack([plane, np.ones(len(plane))]) @ R
    normals = np.cross(rays, tangent)
    centre = -R.T @ camera[9:12]
    distance = np.abs(normals @ (point - centre)) / np.linalg.norm(normals, axis=1)
    inside = (distance < 0.5 * robot.cable.diameter).reshape(len(y), len(x))
    return (slice(y0, y0 + shape[0]), slice(x0, x0 + shape[1])), inside.astype(float)


def binned(fine_image: np.ndarray, fine: int) -> np.ndarray:
    h, w = fine_image.shape
    return fine_image.reshape(h // fine, fine, w // fine, fine).mean(axis=(1, 3))


@pytest.mark.parametrize("cable", [0, 1, 2, 7])
def test_a_pixel_is_as_dark_as_the_part_that_the_cable_covers(cable: int) -> None:
    robot = scene()[0]
    patch, inside = covered(robot, cable, 0.6, (24, 24), 24)
    image = drawn(blur=0.0)[cable // 2][0][patch]
    part = (PANEL - image) / (PANEL - CABLE)
    difference = part - binned(inside, 24)
    assert 0.1 < part.mean() < 0.3
    assert np.abs(difference).max() < 0.02
    rows = difference.sum(axis=1)  # the width of the band, in each row, to the rounding
    assert np.abs(rows).max() < 0.03


@pytest.mark.parametrize("cable", [0, 7])
def test_the_blur_is_that_of_the_optics_before_the_pixels(cable: int) -> None:
    robot, fine = scene()[0], 16
    patch, inside = covered(robot, cable, 0.6, (40, 40), fine)
    image = drawn(blur=0.7)[cable // 2][0][patch]
    expected = binned(gaussian_filter(inside, 0.7 * fine), fine)
    difference = (PANEL - image) / (PANEL - CABLE) - expected
    assert np.abs(difference[8:-8, 8:-8]).max() < 0.02


def test_the_cable_goes_on_to_the_border_and_begins_at_the_drawing_point() -> None:
    robot, u, T, _ = scene()
    left = drawn()[0][0]
    assert left[-1].min() < 100 and left[0].min() < 100
    # With the camera turned up, the drawing points come into view, and nothing is above them.
    pairs = robot.cameras.stereo_pairs
    up = RigidTransform(RotationMatrix.MakeXRotation(0.35))
    pair = pairs[0].replace(X_FL=pairs[0].X_FL @ up)
    tilted = robot.replace(cameras=robot.cameras.replace(stereo_pairs=(pair, *pairs[1:])))
    geometry = StereoGeometry(tilted)
    start, J = np.empty(2), np.empty((2, 3))
    vision.project(geometry.lefts[0], robot.drawing_points[0].copy(), start, J)
    left = CableDrawing(tilted)(u, T)[0][0]
    x, y = np.round(start).astype(int)
    assert 100 < y < 900
    assert left[y + 3, x - 20 : x + 20].min() < 100 and left[: y - 2, x - 60 : x + 60].min() > 220


def test_noise_is_seeded_white_and_of_its_size() -> None:
    robot, u, T, _ = scene()
    draw = CableDrawing(robot, grey_noise=3.0)
    a, b, other = draw(u, T, 5), draw(u, T, 5), draw(u, T, 6)
    panels = np.array([image[200:800, 1100:] for image in (*a[0], *other[0])], float)
    for left, right in zip(a, b, strict=True):
        np.testing.assert_array_equal(left, right)
    np.testing.assert_allclose(panels.std(axis=(1, 2)), np.sqrt(9.0 + 1 / 12), rtol=0.02)
    np.testing.assert_allclose(panels.mean(axis=(1, 2)), PANEL, atol=0.05)
    flat = panels.reshape(4, -1)
    assert np.abs(np.corrcoef(flat) - np.eye(4)).max() < 0.02
    assert abs(np.corrcoef(flat[0, 1:], flat[0, :-1])[0, 1]) < 0.02
    with pytest.raises(ValueError, match="must be >= 0"):
        CableDrawing(robot, blur=-1.0)


# --- lines


def test_a_weighted_line_rejects_what_does_not_lie_on_it() -> None:
    generator = np.random.default_rng(0)
    x = np.linspace(0.0, 1.0, 20)
    for _ in range(20):
        slope, start = generator.standard_normal(2)
        y = start + slope * x + 1e-3 * generator.standard_normal(20)
        wrong = generator.choice(20, 5, replace=False)
        y[wrong] += 0.5 + generator.random(5)  # all to one side, as another cable's edge
        weight, line = np.ones(20), np.empty(2)
        assert kernel.weighted_line(x, y, weight, 1.0 / 600.0, line) >= 13
        assert not weight[wrong].any()
        assert abs(line[0] - start) < 2e-3 and abs(line[1] - slope) < 4e-3


def test_a_point_of_little_weight_moves_the_line_little() -> None:
    x = np.linspace(0.0, 1.0, 20)
    y = 0.1 * x + 0.02 * np.sin(1.0 + 40.0 * x)
    weight, line = np.full(20, 4.0), np.empty(2)
    weight[::2] = 1.0
    expected = np.polyfit(x, y, 1, w=np.sqrt(weight))[::-1]
    assert kernel.weighted_line(x, y, weight, 10.0, line) == 20
    np.testing.assert_allclose(line, expected, atol=2e-5)
    assert np.abs(np.polyfit(x, y, 1)[::-1] - expected).max() > 1e-3


@pytest.mark.parametrize("count", [1, 2, 7, 20])
def test_the_median_is_the_middle_one(count: int) -> None:
    values = np.random.default_rng(count).integers(0, 9, 20).astype(float)
    assert kernel.median(values.copy(), count) == np.sort(values[:count])[count // 2]


# --- edges without noise


@pytest.mark.parametrize("name", ["cogiro", "cogiro-22m", "cogiro-37m"])
@pytest.mark.parametrize("blur", [0.0, 0.5])
@pytest.mark.parametrize("expected", ["there", "aside", "searched"])
def test_the_edges_are_found_to_a_twentieth_of_a_pixel(
    name: str, blur: float, expected: str
) -> None:
    robot, u, T, lines = scene(name)
    images = CableDrawing(robot, blur=blur)(u, T)
    last = {"there": u, "aside": turned(u, 5e-3), "searched": None}[expected]
    edges = lines(images, T, CENTRE, last)
    assert np.all(np.isfinite(edges))
    assert across(edges, CableImages(robot)(u, T)).max() < 0.05
    got = TangentEstimator(robot)(edges, T, CENTRE)
    assert got.valid.all() and angles(got.tangents, u).max() < 2.5e-4


def test_the_edges_are_found_at_the_start_and_goal_of_each_of_the_paper_s_tests() -> None:
    robot, _, _, lines = scene()
    draw, estimate = CableDrawing(robot), TangentEstimator(robot)
    for X in paper_test(3).poses(robot) + paper_test(5).poses(robot):
        u, T = cables_at(robot, X)
        edges = lines(draw(u, T), T, X)
        assert across(edges, CableImages(robot)(u, T)).max() < 0.03
        assert angles(estimate(edges, T, X).tangents, u).max() < 1e-4


def test_a_blurred_band_thinner_than_two_pixels_gives_its_middle() -> None:
    robot, u, T, lines = scene("cogiro-98m")
    edges = lines(CableDrawing(robot)(u, T), T, CENTRE, u)
    exact = CableImages(robot)(u, T)
    assert np.linalg.norm(exact[:, :, 0] - exact[:, :, 1], axis=-1).max() < 2.0
    assert across(edges, exact).max() < 0.02
    assert angles(TangentEstimator(robot)(edges, T, CENTRE).tangents, u).max() < 1e-4


# --- noise


@pytest.mark.parametrize(
    ("name", "limit"), [("cogiro", 1.5e-4), ("cogiro-37m", 3e-4), ("cogiro-98m", 5e-4)]
)
def test_noise_of_the_pixels_gives_tangents_to_some_tenths_of_a_milliradian(
    name: str, limit: float
) -> None:
    robot, u, T, lines = scene(name)
    draw, estimate = CableDrawing(robot), TangentEstimator(robot)
    errors = []
    for seed in range(3):
        got = estimate(lines(draw(u, T, seed), T, CENTRE, turned(u, 1e-3, seed)), T, CENTRE)
        assert got.valid.all()
        errors.append(angles(got.tangents, u))
    assert 0.1 * limit < np.sqrt(np.mean(np.square(errors))) < limit


def test_a_wrong_tension_bends_the_expected_edge_but_not_the_line_seen() -> None:
    """The distances are fitted by a line, so what is expected of the sag cancels."""
    robot, u, T, lines = scene()
    edges = lines(drawn(), 3.0 * T, CENTRE, u)
    assert across(edges, CableImages(robot)(u, T)).max() < 0.3
    got = TangentEstimator(robot)(edges, T, CENTRE)
    assert angles(got.tangents, u).max() < 1e-4


# --- what disturbs


@pytest.mark.parametrize(("gap", "turn"), [(0.012, 0.0), (0.03, 0.0), (0.04, 0.0615), (0.05, 0.05)])
@pytest.mark.parametrize("expected", ["aside", "searched"])
def test_cables_near_each_other_or_crossing_are_told_apart(
    gap: float, turn: float, expected: str
) -> None:
    """Drawing points some millimetres apart; with a turn the cables cross in the images."""
    robot, u, T, _ = scene()
    side = np.cross(u[0], [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    points, v = np.array(robot.drawing_points), u.copy()
    points[1] = points[0] + gap * side
    v[1] = u[0] - turn * side
    v[1] /= np.linalg.norm(v[1])
    near = robot.replace(drawing_points=points)
    images = CableDrawing(near)(v, T, 1)
    edges = CableLines(near)(images, T, CENTRE, turned(v, 2e-3) if expected == "aside" else None)
    seen = np.isfinite(edges[:2, ..., 0])
    assert np.all(seen.mean(axis=-1) >= 0.5)
    exact = CableImages(near)(v, T)
    assert across(edges, exact)[:2][seen].max() < 0.06
    estimate = TangentEstimator(near)(edges, T, CENTRE)
    assert angles(estimate.tangents, v)[:2].max() < 3e-4
    # Where they cross or nearly touch some points are lost, but none of the others is wrong.
    assert seen.all() == (turn == 0.0)


def test_dirt_is_rejected() -> None:
    """Specks all over the panel, and a quarter of a cable hidden: the rest gives the line."""
    robot, u, T, lines = scene()
    exact = CableImages(robot)(u, T)
    generator = np.random.default_rng(3)

    def soil(image: np.ndarray) -> np.ndarray:
        for x, y in generator.integers(0, [1280, 1024], (300, 2)).tolist():
            cv2.circle(image, (x, y), 3, 30, -1)
        return image

    images = images_like(drawn(1), soil)
    corner = exact[0, 0, :, 5].min(axis=0), exact[0, 0, :, 9].max(axis=0)
    x0, y0 = np.min(corner, axis=0).astype(int) - 5
    x1, y1 = np.max(corner, axis=0).astype(int) + 5
    images[0][0][y0:y1, x0:x1] = 30
    for last in (u, turned(u, 3e-3), None):
        edges = lines(images, T, CENTRE, last)
        assert not np.isfinite(edges[0, 0, :, 5:10]).any()
        assert np.nanmax(across(edges, exact)) < 0.15
        assert angles(TangentEstimator(robot)(edges, T, CENTRE).tangents, u).max() < 1e-3


@pytest.mark.parametrize(
    "change",
    [
        lambda image: np.zeros_like(image),
        lambda image: np.full_like(image, 225),
        lambda image: np.random.default_rng(0).integers(100, 120, image.shape, np.uint8),
        lambda image: np.random.default_rng(0).integers(0, 256, image.shape, np.uint8),
        lambda image: 255 - image,
    ],
    ids=["black", "blank", "grey noise", "noise", "negative"],
)
def test_where_no_cable_is_none_is_found(change: Any) -> None:
    _, u, T, lines = scene()
    images = images_like(drawn(), change)
    for last in (u, None):
        assert not np.isfinite(lines(images, T, CENTRE, last)).any()


def test_a_cable_that_left_the_image_is_lost_and_its_neighbour_is_not_taken_for_it() -> None:
    robot, u, T, lines = scene()
    v = u.copy()
    v[0] = [-u[0, 0], -u[0, 1], u[0, 2]]  # away from the platform, out of the image
    assert not np.isfinite(CableImages(robot)(v, T)[0]).all(axis=(1, 2, 3)).any()
    images = CableDrawing(robot)(v, T, 1)
    for last in (u, v, None):
        edges = lines(images, T, CENTRE, last)
        assert not np.isfinite(edges[0]).any() and np.isfinite(edges[1:]).all()


def test_a_pair_without_images_loses_only_its_cables() -> None:
    _, u, T, lines = scene()
    images = [drawn()[0], None, *drawn()[2:]]
    seen = np.isfinite(lines(images, T, CENTRE, u)).all(axis=(1, 2, 3, 4))
    np.testing.assert_array_equal(seen, [1, 1, 0, 0, 1, 1, 1, 1])


def test_cables_are_searched_where_they_are_not_known_or_not_found() -> None:
    robot, u, T, lines = scene()
    exact = CableImages(robot)(u, T)
    known = np.array([True, True, False, False, True, True, True, True])
    last = u.copy()
    last[[2, 5]] = turned(u, 0.2)[[2, 5]]
    tracked, found = lines.track(drawn(), last, T, known)
    np.testing.assert_array_equal(np.flatnonzero(~found), [2, 3, 5])
    assert not np.isfinite(tracked[[2, 3, 5]]).any()
    assert across(lines(drawn(), T, CENTRE, last, known), exact).max() < 0.03
    coarse, there = lines.search(drawn(), CENTRE, ~known)
    np.testing.assert_array_equal(np.flatnonzero(there), [2, 3])
    assert 1e-5 < angles(coarse, u)[2:4].max() < 5e-3


def test_the_calibrated_robot_is_what_the_detection_believes() -> None:
    """Drawing points 2 mm off and the cameras turned by a milliradian: found all the same."""
    robot, u, T, _ = scene()
    turn = RigidTransform(RotationMatrix.MakeZRotation(1e-3))
    cameras = robot.cameras.replace(X_WF=robot.cameras.X_WF @ turn)
    points = robot.drawing_points + 2e-3 * np.random.default_rng(0).choice([-1, 1], (8, 3))
    believed = robot.replace(cameras=cameras, drawing_points=points)
    for last in (u, None):
        edges = CableLines(believed)(drawn(), T, CENTRE, last)
        got = TangentEstimator(believed)(edges, T, CENTRE)
        R = cameras.X_WF.rotation() @ robot.cameras.X_WF.rotation().inverse()
        assert got.valid.all()
        assert angles(got.tangents, u @ R.matrix().T).max() < 2e-4 < angles(got.tangents, u).max()


def test_without_compiler_the_same_is_found(tmp_path: Path) -> None:
    code = """if True:
        import numpy as np
        from test_cable_images import CENTRE, drawn, scene, turned
        from cdpr_drake.model.kernels import is_compiled
        assert not is_compiled()
        _, u, T, lines = scene()
        np.save({path!r}, lines(drawn(1)[:1] + [None] * 3, T, CENTRE, turned(u, 1e-3)))
    """
    _, u, T, lines = scene()
    path = str(tmp_path / "edges.npy")
    folders = [os.path.dirname(__file__), os.path.dirname(os.path.dirname(__file__))]
    environment = os.environ | {"CDPR_DRAKE_NUMBA": "0", "PYTHONPATH": os.pathsep.join(folders)}
    command = [sys.executable, "-c", code.format(path=path)]
    subprocess.run(command, check=True, env=environment)
    plain = np.load(path)
    compiled = lines([*drawn(1)[:1], None, None, None], T, CENTRE, turned(u, 1e-3))
    assert np.isfinite(plain[:2]).all()
    np.testing.assert_allclose(plain, compiled, atol=1e-9)


# --- what is shown


def test_the_figure_shows_both_images_and_magnifies_the_edges() -> None:
    _, _, T, lines = scene()
    images = drawn(1)
    edges = lines(images, T, CENTRE)
    figure = stereo_view_figure(images[0], {1: edges[0], 2: edges[1]})
    assert [axes.get_title() for axes in figure.axes] == ["left camera", "right camera"]
    for side, axes in enumerate(figure.axes):
        np.testing.assert_array_equal(axes.images[0].get_array(), images[0][side])
        circles = [line.get_xydata() for line in axes.lines]
        np.testing.assert_array_equal(circles, edges[:2, side].mean(axis=1))
        (inset,) = axes.child_axes
        cable = int(inset.get_title().split()[-1])
        np.testing.assert_array_equal(
            [line.get_xydata() for line in inset.lines], edges[cable - 1, side]
        )
        # The inset hides no cable.
        figure.draw_without_rendering()
        box = inset.get_window_extent()
        shown = axes.transData.transform(edges[:2, side].reshape(-1, 2))
        assert box.width > 100.0
        assert not any(box.contains(*point) for point in shown)


def test_the_figure_shows_images_without_cables() -> None:
    nothing = np.full((2, 2, 20, 2), np.nan)
    figure = stereo_view_figure(drawn()[0], {1: nothing, 2: nothing})
    assert not any(axes.lines or axes.child_axes for axes in figure.axes)


# --- the system


def stereo_inputs() -> dict[str, np.ndarray]:
    _, u, T, _ = scene()
    pose = pose_to_vector(CENTRE)
    return {
        "tangents": u.ravel(),
        "tension_at_drawing_point": T,
        "measured_pose": pose,
        "measured_tension": T,
    }


def outputs(system: Any, context: Any) -> dict[str, np.ndarray]:
    return {name: system.GetOutputPort(name).Eval(context) for name in output_sizes(system)}


def test_ports_are_those_of_the_stereo_tangent_cameras(cogiro: CableRobot) -> None:
    system, model = StereoImageCameras(cogiro), StereoTangentCameras(cogiro)
    assert output_sizes(system) == output_sizes(model)
    assert input_sizes(system) == input_sizes(model) | {"noise": 1}
    name, inputs, results = documented_ports(StereoImageCameras, {})
    assert name == "StereoImageCameras"
    assert set(inputs) == set(input_sizes(system)) and set(results) == set(output_sizes(system))
    assert feedthrough(system) == set()
    assert system.sample_time == 0.05
    with pytest.raises(ValueError, match="there is no stereo pair 5 among 4"):
        StereoImageCameras(cogiro, outages=(Outage(sensor="stereo pair", number=5),))


class Cuts:
    """A drawing whose images of some frames are blank, black or of other cables."""

    def __init__(self, robot: CableRobot, frames: dict[int, Any]) -> None:
        self._draw, self._frames, self.count = CableDrawing(robot), frames, 0

    def __call__(self, tangents: Any, tension: Any, seed: int | None = None) -> Images:
        images = self._draw(tangents, tension, seed)
        change = self._frames.get(self.count)
        self.count += 1
        return images_like(images, change) if change else images


def run_frames(system: Any, inputs: dict[str, np.ndarray], frames: int) -> list[Any]:
    """The outputs after each frame, the first at t = 0."""
    simulator = Simulator(system, fixed_context(system, inputs))
    simulator.Initialize()
    record = []
    for i in range(frames):
        simulator.AdvanceTo((i + 0.5) * system.sample_time)
        record.append(outputs(system, simulator.get_context()))
    return record


def test_blank_and_black_images_hold_the_last_tangents_which_are_found_again() -> None:
    robot, u, _, _ = scene()
    frames = {2: np.zeros_like, 3: lambda image: np.full_like(image, 225)}
    system = StereoImageCameras(robot, drawing=Cuts(robot, frames))  # type: ignore[arg-type]
    record = run_frames(system, stereo_inputs() | {"noise": np.array([0.3])}, 6)
    lost = [r["frames_lost"].tolist() for r in record]
    assert lost == [[0.0] * 8] * 2 + [[1.0] * 8] + [[2.0] * 8] * 3
    assert [r["valid_tangents"].all() for r in record] == [True, True, False, False, True, True]
    held = [r["measured_tangents"] for r in record]
    np.testing.assert_array_equal(held[1], held[3])
    np.testing.assert_array_equal(record[1]["curvature_bias"], record[3]["curvature_bias"])
    for r in record:
        assert angles(r["measured_tangents"].reshape(-1, 3), u).max() < 5e-4


def test_what_is_measured_comes_from_the_images_alone() -> None:
    """The images show other tangents than the system's inputs say."""
    robot, u, T, _ = scene()
    v = turned(u, 0.02)
    draw = CableDrawing(robot)
    system = StereoImageCameras(robot, drawing=lambda *_: draw(v, T))  # type: ignore[arg-type]
    got = run_frames(system, stereo_inputs(), 3)[-1]
    assert angles(got["measured_tangents"].reshape(-1, 3), v).max() < 1e-4


def test_an_outage_holds_the_pair_s_cables_and_a_moving_cable_is_followed() -> None:
    robot, u, _, _ = scene()
    lost = Outage(sensor="stereo pair", number=3, start=0.09, end=0.19)
    system = StereoImageCameras(robot, outages=(lost,))
    simulator = Simulator(system, fixed_context(system, stereo_inputs()))
    context = simulator.get_mutable_context()
    angle = 0.0
    for i in range(6):  # 0.1 rad/s, across
        angle = 5e-3 * i
        system.GetInputPort("tangents").FixValue(context, turned(u, angle).ravel())
        simulator.AdvanceTo((i + 0.5) * 0.05)
        got = outputs(system, context)
        error = angles(got["measured_tangents"].reshape(-1, 3), turned(u, angle))
        away = i in (2, 3)
        assert error[[0, 1, 2, 3, 6, 7]].max() < 1.5e-4
        np.testing.assert_allclose(error[4:6], 5e-3 * (i - 1) if away else 0.0, atol=2e-4)
        np.testing.assert_array_equal(got["valid_tangents"][4:6], 0.0 if away else 1.0)
    np.testing.assert_array_equal(got["frames_lost"], [0, 0, 0, 0, 2, 2, 0, 0])


def test_at_rest_the_tangents_held_are_those_seen_without_noise() -> None:
    robot, u, _, _ = scene()
    system = StereoImageCameras(robot)
    context = fixed_context(system, stereo_inputs() | {"noise": np.array([1.0])})
    system.settle(context)
    got = outputs(system, context)
    assert got["valid_tangents"].all() and not got["frames_lost"].any()
    assert angles(got["measured_tangents"].reshape(-1, 3), u).max() < 1e-4


def test_the_noise_s_number_seeds_the_images() -> None:
    robot, _, _, _ = scene()
    system = StereoImageCameras(robot)
    seen = []
    for noise in ([0.5], [0.5], [0.6]):
        inputs = stereo_inputs() | {"noise": np.array(noise)}
        context = fixed_context(system, inputs)
        images = system.see(context)
        assert images[0] is not None and images[0][0].shape == (1024, 1280)
        seen.append((images[0][0], run_frames(system, inputs, 1)[0]["measured_tangents"]))
    for one, same, other in zip(*seen, strict=True):
        np.testing.assert_array_equal(one, same)
        assert np.any(one != other)
