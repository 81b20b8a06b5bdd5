"""Tangents from stereo pairs: the curved cable, its images, interpretation planes, rejection."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from oracle import ORACLE
from pydrake.math import RigidTransform
from samples import random_pose

from cdpr_drake.errors import RobotFileError
from cdpr_drake.model.catenary import cable_shape, elastic_catenary
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.kernels import stereo as kernel
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.vision.tangents import CableImages, TangentEstimator
from cdpr_drake.runs.paper_tests import paper_test

CENTRE = RigidTransform([0.2, -0.3, 0.9])


def cables_at(robot: CableRobot, X_WP: RigidTransform) -> tuple[np.ndarray, np.ndarray]:
    """Tangents (k, 3) and tensions (k,) at the drawing points of a robot at rest."""
    rest = rest_state(robot, X_WP)
    ends = np.array([X_WP @ p for p in robot.attachment_points]) - robot.drawing_points
    cables = elastic_catenary(
        ends,
        rest.unstrained_length,
        robot.weight_per_metre,
        robot.cable.stiffness,
        robot.cable.drum_run,
    )
    return cables.tangent_at_drawing_point, cables.tension_at_drawing_point


@cache
def setup(name: str = "cogiro") -> tuple[CableRobot, CableImages, TangentEstimator]:
    robot = load_robot(name)
    return robot, CableImages(robot), TangentEstimator(robot)


def angles(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The angles between directions (k, 3) [rad]."""
    return np.arcsin(np.minimum(np.linalg.norm(np.cross(a, b), axis=1), 1.0))


# --- the cable


@pytest.mark.parametrize("V_A", [-300.0, -20.0, 0.0, 15.0])
def test_the_piece_near_the_drawing_point_is_the_exact_catenary_s(V_A: float) -> None:
    H, w, EA, A = 120.0, 0.65, 5e5, np.array([1.0, 2.0, 3.0])
    T, l0 = np.hypot(H, V_A), 5.0
    heading = np.array([0.6, -0.8, 0.0])
    u = (H * heading + [0.0, 0.0, V_A]) / T
    point, tangent, points, tangents = np.empty(3), np.empty(3), [], []
    for s in np.linspace(0.0, l0, 11):
        kernel.cable_point(A, u, T, w, EA, s, point, tangent)
        points.append(point.copy())
        tangents.append(tangent.copy())
    expected = cable_shape(A, points[-1], H, V_A + w * l0, l0, w, EA, 11)[0]
    np.testing.assert_allclose(points, expected, atol=1e-12)
    np.testing.assert_allclose(tangents[0], u, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(tangents, axis=1), 1.0)
    assert tangents[-1][2] == pytest.approx((V_A + w * l0) / np.hypot(H, V_A + w * l0))


def test_the_edges_are_where_the_line_of_sight_touches_the_cable() -> None:
    robot, images, _ = setup()
    camera = images._stereo.lefts[0]
    R, p = camera[:9].reshape(3, 3), camera[9:12]
    o = -R.T @ p
    A = robot.drawing_points[0]
    u = np.array([0.7, 0.5, -0.5]) / np.linalg.norm([0.7, 0.5, -0.5])
    radius, plane = 0.05, np.empty((2, 2, 2))
    kernel.edges(camera, A, u, 1e9, 1e-6, 1e15, radius, np.array([0.3, 1.0]), plane)
    for edge in range(2):
        for station in range(2):
            ray = R.T @ np.array([*plane[edge, station], 1.0])
            # distance between the line of sight and the axis of a straight cable
            normal = np.cross(ray, u)
            distance = abs((A - o) @ normal) / np.linalg.norm(normal)
            assert distance == pytest.approx(radius, rel=1e-6)


def test_the_oracle_s_stereo_row() -> None:
    """Two planes of given normals, seen as straight edges by two cameras at one orientation."""
    row = ORACLE["stereo"]

    def edge(n: list[float]) -> np.ndarray:
        """Both edges alike: the line n.(x, y, 1) = 0."""
        x = np.linspace(-0.2, 0.3, 7)
        line = np.column_stack([x, -(n[0] * x + n[2]) / n[1]])
        return np.array([line, line])

    camera = np.zeros(21)
    camera[:9] = np.eye(3).ravel()
    u = np.empty(3)
    left, right = edge(row["n_l"]), edge(row["n_r"])
    reference = np.array(row["reference"])
    sine = kernel.direction(camera, camera, left, right, reference, u)
    np.testing.assert_allclose(u, row["u"], rtol=1e-9)
    n, m = (np.array(row[k]) / np.linalg.norm(row[k]) for k in ("n_l", "n_r"))
    assert sine == pytest.approx(np.linalg.norm(np.cross(n, m)))
    kernel.direction(camera, camera, left, right, -reference, u)
    np.testing.assert_allclose(-u, row["u"], rtol=1e-9)


# --- without noise


@pytest.mark.parametrize("name", ["cogiro", "cogiro-22m", "cogiro-37m", "cogiro-98m"])
def test_without_noise_the_tangents_are_exact(name: str) -> None:
    robot, images, estimate = setup(name)
    generator = np.random.default_rng(0)
    scale = robot.drawing_points[:, 2].max() / 5.5
    poses = [random_pose(generator) for _ in range(8)]
    poses = [RigidTransform(X.rotation(), scale * X.translation()) for X in poses]
    if name == "cogiro":
        poses += [X for number in range(1, 6) for X in paper_test(number).poses(robot)]
    for X in poses:
        u, T = cables_at(robot, X)
        pixels = images(u, T)
        assert np.all(np.isfinite(pixels))
        got = estimate(pixels, T, X)
        assert got.valid.all()
        assert angles(got.tangents, u).max() < 1e-6
        np.testing.assert_allclose(np.linalg.norm(got.tangents, axis=1), 1.0)
        assert np.all(np.sum(got.tangents * u, axis=1) > 0.0)


def test_the_curvature_bias_is_that_of_the_profile() -> None:
    """The line lies along the middle of the piece: its tilt is w cos / H times 0.65 m, nearly."""
    robot, images, estimate = setup()
    u, T = cables_at(robot, CENTRE)
    got = estimate(images(u, T), T, CENTRE)
    cosine = np.hypot(u[:, 0], u[:, 1])
    expected = robot.weight_per_metre * cosine / T * 0.65  # d(slope angle) = w cos^2 / H ds
    np.testing.assert_allclose(got.curvature_bias, expected, rtol=0.15)
    assert 2e-4 < got.curvature_bias.max() < 5e-3
    uncorrected = estimate(images(u, T), np.full(8, 1e9), CENTRE)
    np.testing.assert_allclose(
        angles(uncorrected.tangents, u), got.curvature_bias, rtol=1e-3, atol=1e-9
    )
    assert uncorrected.curvature_bias.max() < 1e-8


def test_a_dead_load_cell_does_not_spoil_the_tangents() -> None:
    robot, images, estimate = setup()
    u, T = cables_at(robot, CENTRE)
    got = estimate(images(u, T), np.zeros(8), CENTRE)
    assert got.valid.all() and angles(got.tangents, u).max() < 0.05


def test_the_calibrated_robot_is_what_the_estimate_believes(cogiro: CableRobot) -> None:
    _, images, _ = setup()
    turn = RigidTransform(np.eye(4)).rotation().MakeZRotation(1e-3)
    believed = cogiro.replace(
        cameras=cogiro.cameras.replace(
            X_WF=cogiro.cameras.X_WF @ RigidTransform(turn, [0.0, 0.0, 0.0])
        )
    )
    u, T = cables_at(cogiro, CENTRE)
    got = TangentEstimator(believed)(images(u, T), T, CENTRE)
    R = believed.cameras.X_WF.rotation() @ cogiro.cameras.X_WF.rotation().inverse()
    assert got.valid.all()
    assert (
        angles(got.tangents, u @ R.matrix().T).max() < 1e-5 < 5e-4 < angles(got.tangents, u).max()
    )


# --- noise and rejection


def test_noise_of_the_edges_gives_tangents_to_a_milliradian() -> None:
    robot, images, estimate = setup()
    u, T = cables_at(robot, CENTRE)
    generator = np.random.default_rng(1)
    errors = []
    for _ in range(100):
        got = estimate(images(u, T, generator.standard_normal(images.noise_size)), T, CENTRE)
        assert got.valid.all()
        errors.append(got.tangents - u)
    E = np.array(errors)
    assert 2e-4 < np.sqrt(np.mean(np.sum(E**2, axis=2))) < 1e-3
    sigma = E.std(axis=0)
    assert np.abs(E.mean(axis=0)).max() < 4.0 * sigma.max() / np.sqrt(100.0)


def test_edge_points_are_moved_across_the_edge_by_the_line_noise(cogiro: CableRobot) -> None:
    _, images, _ = setup()
    u, T = cables_at(cogiro, CENTRE)
    noise = np.random.default_rng(2).standard_normal(images.noise_size)
    plain, moved = images(u, T), images(u, T, noise)
    shift = (moved - plain).reshape(-1, 20, 2)
    size = np.linalg.norm(shift, axis=2)
    np.testing.assert_allclose(size, 0.2 * np.abs(noise).reshape(-1, 20), atol=1e-9)
    along = (plain[..., -1, :] - plain[..., 0, :]).reshape(-1, 1, 2)
    assert np.abs(np.sum(shift * along, axis=2) / np.linalg.norm(along, axis=2)).max() < 1e-9


def test_a_cable_in_the_plane_of_the_cameras_is_rejected() -> None:
    robot, images, estimate = setup()
    stereo = images._stereo
    left, right = (c[0, :9].reshape(3, 3).T @ -c[0, 9:12] for c in (stereo.lefts, stereo.rights))
    A = robot.drawing_points[0]
    # A direction in the plane of both camera centres and A.
    into = 0.5 * (left + right) - A
    u, T = cables_at(robot, CENTRE)
    flat = (right - left) - into * (right - left)[2] / into[2] * 0.5
    flat = flat / np.linalg.norm(flat) * np.sign(flat @ u[0])
    u[0] = flat
    got = estimate(images(u, T), T, CENTRE)
    assert not got.valid[0] and got.valid[1:].all()


def test_a_direction_out_of_the_cable_s_plane_is_rejected() -> None:
    robot, images, estimate = setup()
    u, T = cables_at(robot, CENTRE)
    aside = np.cross(u[2], [0.0, 0.0, 1.0])
    u[2] = u[2] + 0.2 * aside / np.linalg.norm(aside)
    u[2] /= np.linalg.norm(u[2])
    got = estimate(images(u, T), T, CENTRE)
    assert not got.valid[2] and got.valid.sum() == 7


def test_a_cable_out_of_sight_is_rejected_and_half_of_it_is_enough() -> None:
    robot, images, estimate = setup()
    u, T = cables_at(robot, CENTRE)
    pixels = images(u, T)
    pixels[3, 1, 0] = np.nan
    pixels[4, :, :, :9] = np.nan
    pixels[5, :, :, :11] = np.nan
    got = estimate(pixels, T, CENTRE)
    np.testing.assert_array_equal(np.flatnonzero(~got.valid), [3, 5])
    assert angles(got.tangents, u)[got.valid].max() < 1e-6


def test_every_cable_must_be_seen_by_one_pair(cogiro: CableRobot) -> None:
    pairs = cogiro.cameras.stereo_pairs[:3]
    robot = cogiro.replace(cameras=cogiro.cameras.replace(stereo_pairs=pairs))
    for cls in (CableImages, TangentEstimator):
        with pytest.raises(RobotFileError, match="no pair sees cable 7"):
            cls(robot)
