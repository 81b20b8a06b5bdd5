"""Stereo cameras and cables that leave over pulleys: where a cable starts, and its tangent."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from pydrake.math import RigidTransform
from samples import random_pose
from test_vision_systems import closed_loop, final_errors, unbiased
from test_vision_tangents import CENTRE, angles

from cdpr_drake.diagrams import simulate
from cdpr_drake.model.equilibrium import platform_balance, rest_state
from cdpr_drake.model.kinematics import cable_ends
from cdpr_drake.model.pulleys import contact
from cdpr_drake.model.robot import CableRobot, Pulleys, load_robot
from cdpr_drake.model.rotations import pose_to_vector
from cdpr_drake.model.vision.cable_drawing import CableDrawing
from cdpr_drake.model.vision.lines import CableLines
from cdpr_drake.model.vision.tangents import CableImages, StereoGeometry, TangentEstimator
from cdpr_drake.systems import StereoImageCameras

AXES = ("upright", "tilted", "down")


@cache
def with_pulleys(axes: str, radius: float = 0.05) -> CableRobot:
    """CoGiRo of 2015, whose axes are upright; tilted ones lean by some 20 degrees, all ways."""
    robot = load_robot("cogiro-2015-pulleys")
    up = np.tile([0.0, 0.0, 1.0], (8, 1))
    lean = 0.3 * np.random.default_rng(0).standard_normal((8, 3))
    axis = {"upright": up, "tilted": up + lean, "down": -up}[axes]
    return robot.replace(pulleys=Pulleys(radius=np.array(radius), axis=axis))


@cache
def eyelets() -> CableRobot:
    """The same robot as one who knows nothing of its pulleys believes it."""
    return load_robot("cogiro-2015-pulleys").replace(pulleys=Pulleys())


@cache
def cables(axes: str, seed: int | None = None) -> tuple[RigidTransform, np.ndarray, np.ndarray]:
    """A pose, and true tangents (k, 3) and tensions (k,) of the robot at rest there."""
    robot = with_pulleys(axes)
    X = CENTRE if seed is None else random_pose(np.random.default_rng(seed))
    out = platform_balance(robot, X, rest_state(robot, X).unstrained_length)[2]
    return X, out[:, 5:8].copy(), out[:, 3].copy()


# --- where a cable leaves


@pytest.mark.parametrize("axes", AXES)
def test_where_a_cable_leaves_follows_from_its_tangent_alone(axes: str) -> None:
    robot = with_pulleys(axes)
    for seed in range(4):
        X, u, _ = cables(axes, seed)
        p_WA = StereoGeometry(robot).leaving(u)
        exact = cable_ends(robot, X, u)
        np.testing.assert_allclose(p_WA, exact.p_WA, rtol=0.0, atol=1e-14)
        away = np.linalg.norm(p_WA - robot.drawing_points, axis=1)
        half = 0.5 * exact.contact.theta  # type: ignore[union-attr]
        np.testing.assert_allclose(away, 2.0 * 0.05 * np.sin(half), rtol=1e-12)


def test_without_a_pulley_it_leaves_at_the_drawing_point() -> None:
    _, u, _ = cables("upright")
    robot = eyelets()
    np.testing.assert_array_equal(StereoGeometry(robot).leaving(u), robot.drawing_points)
    some = robot.replace(pulleys=Pulleys(radius=0.05 * (np.arange(8) % 2), axis=[0, 0, 1]))
    shift = np.linalg.norm(StereoGeometry(some).leaving(u) - robot.drawing_points, axis=1)
    assert not shift[::2].any() and shift[1::2].min() > 0.05


def test_a_cable_must_wrap_its_pulley_by_less_than_half_a_turn() -> None:
    """Farther round, the tangent alone puts the pulley on the wrong side, as documented."""
    robot, geometry = with_pulleys("upright"), StereoGeometry(with_pulleys("upright"))
    below = robot.drawing_points - [0.0, 0.0, 2.0]
    for reach, is_right in ((0.5, True), (0.101, True), (0.099, False)):
        found = contact(robot, below + reach * np.array([1.0, 0.0, 0.0]))
        assert np.all((found.theta < np.pi) == is_right)
        off = np.linalg.norm(geometry.leaving(found.tangent) - found.p_WA, axis=1)
        assert np.all(off < 1e-9) if is_right else np.all(off > 0.19)
    straight_down = np.tile([0.0, 0.0, -1.0], (8, 1))
    np.testing.assert_array_equal(geometry.leaving(straight_down), robot.drawing_points)


# --- tangents


@pytest.mark.parametrize("axes", ["upright", "tilted"])
def test_without_noise_the_tangents_are_exact(axes: str) -> None:
    robot = with_pulleys(axes)
    images, estimate = CableImages(robot), TangentEstimator(robot)
    ignorant = TangentEstimator(eyelets())
    wrong = []
    for seed in range(8):
        X, u, T = cables(axes, seed)
        pixels = images(u, T)
        got = estimate(pixels, T, X)
        assert np.all(np.isfinite(pixels)) and got.valid.all()
        # 1e-6 rad is what an eyelet robot is held to; the steps of the estimate leave much less.
        assert angles(got.tangents, u).max() < 1e-10
        wrong.append(angles(ignorant(pixels, T, X).tangents, u).max())
    # The two planes give the cable's line wherever it starts; ignoring the pulley only takes the
    # sag of a piece some 10 cm farther along for that of the piece seen.
    assert 5e-7 < max(wrong) < 1e-5


@pytest.mark.parametrize("axes", ["upright", "tilted"])
def test_images_show_the_cables_where_they_are(axes: str) -> None:
    """One who ignores the pulleys expects them 30 to 45 px aside, and searches in each frame."""
    robot, everything = with_pulleys(axes), np.ones(8, bool)
    estimate, lines, ignorant = TangentEstimator(robot), CableLines(robot), CableLines(eyelets())
    tracked = []
    for seed in range(3):
        X, u, T = cables(axes, seed)
        images = CableDrawing(robot)(u, T, seed)
        edges, found = lines.track(images, u, T, everything)
        assert found.all() and np.isfinite(edges).all()
        for seen in (edges, lines(images, T, X)):
            got = estimate(seen, T, X)
            assert got.valid.all() and angles(got.tangents, u).max() < 2.5e-4
        tracked.append(ignorant.track(images, u, T, everything)[1].sum())
        # The search finds most of them again, with a tenth of their edges missing.
        missing = np.isnan(ignorant(images, T, X, u)[..., 0]).mean()
        assert 0.05 < missing < 0.2
    assert max(tracked) <= 1  # of 8


def test_a_millimetre_of_the_radius_is_hardly_seen() -> None:
    """Edges move by 2 px at most, the line that they give by nothing."""
    robot, believed = with_pulleys("upright"), with_pulleys("upright", 0.051)
    X, u, T = cables("upright")
    shift = np.abs(CableImages(robot)(u, T) - CableImages(believed)(u, T))
    assert 1.0 < shift.max() < 2.0
    got = TangentEstimator(believed)(CableImages(robot)(u, T), T, X)
    assert got.valid.all() and angles(got.tangents, u).max() < 1e-7
    for last in (u, None):
        edges = CableLines(believed)(CableDrawing(robot)(u, T, 0), T, X, last)
        got = TangentEstimator(believed)(edges, T, X)
        assert got.valid.all() and angles(got.tangents, u).max() < 2.5e-4


@pytest.mark.parametrize("axes", AXES)
def test_a_direction_out_of_the_cable_s_plane_is_rejected(axes: str) -> None:
    robot = with_pulleys(axes)
    X, u, T = cables(axes)
    estimate, images = TangentEstimator(robot), CableImages(robot)
    aside = np.cross(u[2], [0.0, 0.0, 1.0])
    aside /= np.linalg.norm(aside)
    for turn, is_valid in ((0.09, True), (0.11, False)):
        v = u.copy()
        v[2] = np.sqrt(1.0 - turn**2) * u[2] + turn * aside
        valid = estimate(images(v, T), T, X).valid
        assert valid[2] == is_valid and np.delete(valid, 2).all()


# --- systems and loops


def test_image_cameras_hold_the_true_tangents_at_rest() -> None:
    X, u, T = cables("tilted")
    system = StereoImageCameras(with_pulleys("tilted"))
    context = system.CreateDefaultContext()
    for name, value in {
        "tangents": u.ravel(),
        "tension_at_drawing_point": T,
        "measured_pose": pose_to_vector(X),
        "measured_tension": T,
    }.items():
        system.GetInputPort(name).FixValue(context, value)
    system.settle(context)
    assert system.GetOutputPort("valid_tangents").Eval(context).all()
    measured = system.GetOutputPort("measured_tangents").Eval(context).reshape(-1, 3)
    assert angles(measured, u).max() < 2e-4


@pytest.mark.needs("numba")
@pytest.mark.parametrize("axes", ["upright", "tilted"])
def test_a_loop_closed_by_stereo_cameras_arrives(axes: str) -> None:
    """Test 4 on targets, the tangents seen those of the plant within the noise at all times."""
    loop, context = closed_loop(unbiased(with_pulleys(axes)), noise=False)
    names = ["pose_error", "valid_tangents", "measured_tangents", "tangents_at_drawing_point"]
    record = simulate(loop, context, 25.0, record=names)
    s = record["pose_error"]
    assert np.linalg.norm(s[0, 3:]) > 1.7 and record["valid_tangents"].all()
    position, orientation = final_errors(s)
    assert position < 2e-3 and orientation < 0.05
    seen, true = (record[n][-1].reshape(-1, 3) for n in names[2:])
    assert angles(seen, true).max() < 1e-4
