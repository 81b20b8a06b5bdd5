"""Kinematics and statics of A.1 and A.2 against the oracle table and numerical differences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracle import ORACLE
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from samples import (
    derivative,
    moved,
    oracle_robot,
    random_pose,
    relative_error,
    rotation,
    swap_halves,
)

from cdpr_drake.errors import GeometryError, TensionError
from cdpr_drake.model import equilibrium, kinematics, statics
from cdpr_drake.model.cables import CableSet
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.rotations import (
    as_pose,
    exp_rotation,
    log_rotation,
    pose_to_vector,
    rotation_interaction_matrix,
    rpy_rate_matrix,
    skew,
    vector_to_pose,
)

ROW = ORACLE["robot"]
R_FW = exp_rotation(ROW["theta_u_FW"])
X_WP = RigidTransform(rotation(ROW["theta_u_WE"]), ROW["p_WE"])
CABLES = pytest.mark.parametrize(("name", "i"), [("cable_1", 0), ("cable_6", 5)])
SEEDS = pytest.mark.parametrize("seed", range(4))
TEN_DIGITS = 1e-9
"""Of each entry: the table has ten significant digits."""


@pytest.fixture(scope="module")
def robot(cogiro: CableRobot) -> CableRobot:
    return oracle_robot(cogiro)


@pytest.fixture(scope="module")
def geometry(robot: CableRobot) -> kinematics.CableGeometry:
    return kinematics.cable_geometry(robot, X_WP, R_FW)


@pytest.fixture(scope="module")
def H(robot: CableRobot) -> np.ndarray:
    return statics.minimum_norm_horizontal_tensions(robot, X_WP)


def agree(got: object, expected: object) -> None:
    np.testing.assert_allclose(got, expected, rtol=TEN_DIGITS, atol=0.0)


# --- the oracle table: its twists are (v, omega), its wrenches (f, tau)


def test_the_frame_of_the_table(geometry: kinematics.CableGeometry) -> None:
    agree(R_FW @ X_WP.translation() + ROW["p_FW"], ROW["fE"])
    np.testing.assert_allclose(geometry.z, R_FW[:, 2])
    np.testing.assert_allclose(geometry.R_FP, R_FW @ X_WP.rotation().matrix())


@CABLES
def test_chords_of_the_table(geometry: kinematics.CableGeometry, name: str, i: int) -> None:
    row = ROW[name]
    agree([geometry.Bx[i], geometry.Bz[i], geometry.gamma[i]], [row["Bx"], row["Bz"], row["gamma"]])


@CABLES
def test_motion_of_the_attachment_points(
    geometry: kinematics.CableGeometry, name: str, i: int
) -> None:
    row, D = ROW[name], swap_halves(kinematics.D_B(geometry)[i])
    agree(D[0], row["D_B_row_1"])
    agree(D[2], row["D_B_row_3"])
    np.testing.assert_array_equal(D[1], 0.0)
    agree(swap_halves(kinematics.gamma_row(geometry)[i]), row["gamma_row"])


def test_minimum_norm_tensions_of_the_table(H: np.ndarray) -> None:
    agree(H, ROW["H_min_norm"])


@CABLES
def test_statics_of_the_table(
    robot: CableRobot, geometry: kinematics.CableGeometry, H: np.ndarray, name: str, i: int
) -> None:
    row = ROW[name]
    agree(statics.attachment_forces(robot, geometry, H)[i], row["theta_B"])
    agree(swap_halves(statics.D_theta(geometry)[:, i]), row["D_theta_col"])
    D_tau = statics.D_tau(robot, geometry, H)[i]
    D_tau = swap_halves(swap_halves(D_tau.T).T)  # rows from [tau; f], columns from [omega; v]
    agree(D_tau[0], row["D_tau_row_1"])
    agree(D_tau[4], row["D_tau_row_5"])
    agree(swap_halves(statics.D_s(robot, X_WP, H, R_FW)[i]), row["D_s_row"])


def test_twist_of_the_platform_from_that_of_the_target() -> None:
    row = ROW["D_t"]
    D = kinematics.D_t(exp_rotation(row["theta_u_FM"]), row["p_EM_M"])
    agree(swap_halves(D @ swap_halves(np.array(row["twist"]))), row["result"])


# --- the order: [omega; v] and [tau; f]


def test_a_twist_is_angular_velocity_first(cogiro: CableRobot) -> None:
    geometry = kinematics.cable_geometry(cogiro, RigidTransform([0.1, 0.2, 0.9]))
    D = kinematics.D_Bf(geometry)
    np.testing.assert_allclose(D @ np.array([0, 0, 0, 1.0, 0, 0]), np.tile([1.0, 0, 0], (8, 1)))
    about_z = D @ np.array([0, 0, 1.0, 0, 0, 0])
    B = cogiro.attachment_points
    np.testing.assert_allclose(about_z, np.column_stack([-B[:, 1], B[:, 0], np.zeros(8)]))
    np.testing.assert_allclose(
        kinematics.D_t(np.eye(3), [0.0, 0.0, 2.0])[3:, :3] @ [1.0, 0, 0], [0.0, 2.0, 0.0]
    )


def test_a_wrench_is_torque_first(cogiro: CableRobot) -> None:
    geometry = kinematics.cable_geometry(cogiro, RigidTransform([0.1, 0.2, 0.9]))
    W = statics.wrench_matrix(geometry)
    np.testing.assert_allclose(W[3:], geometry.u.T)
    np.testing.assert_allclose(W[:3].T, np.cross(geometry.EB, geometry.u))
    wrench = statics.weight_wrench(cogiro, geometry)
    half_cables = 0.5 * cogiro.weight_per_metre * geometry.L.sum()
    assert wrench[5] == pytest.approx(-cogiro.mass * cogiro.gravity - half_cables)
    np.testing.assert_allclose(wrench[3:5], 0.0)


def test_the_wrong_order_does_not_pass_for_the_right_one(
    geometry: kinematics.CableGeometry, robot: CableRobot, H: np.ndarray
) -> None:
    row = ROW["cable_1"]
    assert relative_error(kinematics.D_B(geometry)[0, 0], row["D_B_row_1"]) > 0.1
    assert relative_error(statics.D_theta(geometry)[:, 0], row["D_theta_col"]) > 0.1
    assert relative_error(statics.D_s(robot, X_WP, H, R_FW)[0], row["D_s_row"]) > 0.1


# --- derivatives against differences: random poses, F turned at random, G away from E


@pytest.fixture
def case(
    cogiro: CableRobot, seed: int
) -> tuple[CableRobot, RigidTransform, np.ndarray, np.ndarray]:
    """Return a robot whose G is not E, a pose, R_FW and horizontal tensions, all by a seed."""
    generator = np.random.default_rng(seed)
    payload = generator.uniform(20.0, 110.0)
    robot = cogiro.with_payload(payload, center_of_mass=generator.uniform(-0.2, 0.2, 3))
    X, R = random_pose(generator), exp_rotation(generator.uniform(-2.0, 2.0, 3))
    return robot, X, R, generator.uniform(50.0, 900.0, robot.num_cables)


def differences(f, case, step: float = 1e-3) -> np.ndarray:
    """Return the derivative of f(geometry) along each unit twist in F, as the last axis."""
    robot, X, R, _ = case

    def along(twist: np.ndarray) -> np.ndarray:
        return derivative(
            lambda t: f(kinematics.cable_geometry(robot, moved(X, twist, t, R), R)), step
        )

    return np.stack([along(twist) for twist in np.eye(6)], axis=-1)


def balance(robot: CableRobot, g: kinematics.CableGeometry, H: np.ndarray) -> np.ndarray:
    """Return [torque; force] of all theta_B less that of the weight: zero in equilibrium."""
    force = statics.attachment_forces(robot, g, H)
    weight = -robot.mass * robot.gravity * g.z
    torque = np.cross(g.EB, force).sum(0) - np.cross(g.R_FP @ robot.center_of_mass, weight)
    return np.concatenate([torque, force.sum(0) - weight])


@SEEDS
def test_the_chords_move_as_their_derivatives_say(case) -> None:
    g = kinematics.cable_geometry(case[0], case[1], case[2])
    assert relative_error(kinematics.D_Bf(g), differences(lambda g: g.AB, case)) < 1e-10
    assert relative_error(kinematics.D_u(g), differences(lambda g: g.u, case)) < 1e-10
    assert relative_error(kinematics.gamma_row(g), differences(lambda g: g.gamma, case)) < 1e-10
    D_B = kinematics.D_B(g)
    assert relative_error(D_B[:, 0], differences(lambda g: g.Bx, case)) < 1e-10
    assert relative_error(D_B[:, 2], differences(lambda g: g.Bz, case)) < 1e-10
    np.testing.assert_array_equal(D_B[:, 1], 0.0)


@SEEDS
def test_the_plane_of_a_cable_turns_about_the_vertical(case) -> None:
    g = kinematics.cable_geometry(case[0], case[1], case[2])
    turn = kinematics.D_gamma(g)
    x_A = np.cross(turn, g.x_A[:, :, None], axis=1)
    assert relative_error(x_A, differences(lambda g: g.x_A, case)) < 1e-10
    y_A = np.cross(turn, g.y_A[:, :, None], axis=1)
    assert relative_error(y_A, differences(lambda g: g.y_A, case)) < 1e-10
    # A.1 as the paper writes it: D_B = fR_A^T ([AB]x D_gamma + D_Bf).
    fR_A = np.stack([g.x_A, g.y_A, np.broadcast_to(g.z, g.x_A.shape)], axis=2)
    printed = fR_A.transpose(0, 2, 1) @ (skew(g.AB) @ turn + kinematics.D_Bf(g))
    assert relative_error(kinematics.D_B(g), printed) < 1e-13


@SEEDS
def test_the_wrench_changes_as_its_derivatives_say(case) -> None:
    robot, X, R, H = case
    g = kinematics.cable_geometry(robot, X, R)
    by_twist = statics.D_tau(robot, g, H).sum(0) - statics.D_ext(robot, g)
    assert relative_error(by_twist, differences(lambda g: balance(robot, g, H), case)) < 1e-10
    by_H = np.array(
        [derivative(lambda t, e=e: balance(robot, g, H + t * e), 10.0) for e in np.eye(8)]
    ).T
    assert relative_error(statics.D_theta(g), by_H) < 1e-10


@SEEDS
def test_each_cables_wrench_changes_as_D_tau_says(case) -> None:
    robot, X, R, H = case

    def wrenches(g: kinematics.CableGeometry) -> np.ndarray:
        force = statics.attachment_forces(robot, g, H)
        return np.concatenate([np.cross(g.EB, force), force], axis=1)

    got = statics.D_tau(robot, kinematics.cable_geometry(robot, X, R), H)
    assert relative_error(got, differences(wrenches, case)) < 1e-10


@SEEDS
def test_D_s_keeps_the_balance_with_the_least_rates(case) -> None:
    robot, X, R, H = case
    D_s = statics.D_s(robot, X, H, R)
    for j, twist in enumerate(np.eye(6)):

        def unbalanced(t: float, twist: np.ndarray = twist, j: int = j) -> np.ndarray:
            g = kinematics.cable_geometry(robot, moved(X, twist, t, R), R)
            return balance(robot, g, H + t * D_s[:, j])

        held = np.abs(statics.D_tau(robot, kinematics.cable_geometry(robot, X, R), H)[:, :, j])
        assert np.abs(derivative(unbalanced)).max() < 1e-10 * held.sum(0).max()
    # Of least norm: no part in the null space of D_theta.
    D_theta = statics.D_theta(kinematics.cable_geometry(robot, X, R))
    null = np.linalg.svd(D_theta)[2][6:]
    assert np.abs(null @ D_s).max() < 1e-12 * np.abs(D_s).max()


def test_the_balance_holds_along_a_path(cogiro: CableRobot) -> None:
    """H integrated with D_s over 1 m and 8 degrees keeps the platform in balance."""
    X = RigidTransform([0.2, -0.3, 1.0])
    twist = np.array([0.05, -0.08, 0.1, 0.6, -0.5, 0.62])
    twist[:3] *= math.radians(8.0) / np.linalg.norm(twist[:3])
    twist[3:] /= np.linalg.norm(twist[3:])
    H = statics.minimum_norm_horizontal_tensions(cogiro, X)

    def rate(t: float, H: np.ndarray) -> np.ndarray:
        return statics.D_s(cogiro, moved(X, twist, t), H) @ twist

    n = 50
    h = 1.0 / n
    for step in range(n):
        t = step * h
        a = rate(t, H)
        b = rate(t + 0.5 * h, H + 0.5 * h * a)
        c = rate(t + 0.5 * h, H + 0.5 * h * b)
        d = rate(t + h, H + h * c)
        H = H + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    end = moved(X, twist, 1.0)
    unbalanced = balance(cogiro, kinematics.cable_geometry(cogiro, end), H)
    assert np.abs(unbalanced).max() < 1e-9 * cogiro.mass * cogiro.gravity
    # It is not the minimum-norm solution at the end: D_s integrates rates, not that solution.
    there = statics.minimum_norm_horizontal_tensions(cogiro, end)
    assert 1.0 < np.abs(H - there).max() < 100.0


@SEEDS
def test_D_t_against_the_motion_of_the_platform(seed: int) -> None:
    generator = np.random.default_rng(seed)
    X_WM = random_pose(generator)
    p_EM = generator.uniform(-0.5, 0.5, 3)  # from E to M, in M
    R_EM = rotation(generator.uniform(-2.0, 2.0, 3))
    R_FM = X_WM.rotation().matrix()
    X_ME = RigidTransform(R_EM.inverse(), -p_EM)
    D = kinematics.D_t(R_FM, p_EM)
    for j, twist in enumerate(np.eye(6)):  # of M, in M

        def platform(t: float, twist: np.ndarray = twist) -> RigidTransform:
            turned = X_WM.rotation() @ rotation(t * twist[:3])
            step = X_WM.rotation() @ (t * twist[3:])
            return RigidTransform(turned, X_WM.translation() + step) @ X_ME

        R = platform(0.0).rotation().matrix()
        spin = derivative(lambda t, platform=platform: platform(t).rotation().matrix()) @ R.T
        velocity = derivative(lambda t, platform=platform: platform(t).translation())
        np.testing.assert_allclose(skew(D[:3, j]), spin, atol=1e-11)
        np.testing.assert_allclose(D[3:, j], velocity, atol=1e-11)


def test_D_ext_is_zero_with_the_centre_of_mass_at_the_origin(
    robot: CableRobot, cogiro: CableRobot, geometry: kinematics.CableGeometry
) -> None:
    np.testing.assert_array_equal(statics.D_ext(robot, geometry), 0.0)
    assert np.abs(statics.D_ext(cogiro, geometry)).max() > 10.0


# --- cases at the edge


def test_a_vertical_cable_keeps_finite_geometry(cogiro: CableRobot) -> None:
    above = cogiro.drawing_points.copy()
    above[0, :2] = cogiro.attachment_points[0, :2]
    g = kinematics.cable_geometry(cogiro.replace(drawing_points=above), RigidTransform())
    assert g.Bx[0] == kinematics.MIN_HORIZONTAL_SPAN * g.L[0]
    for value in (g.u, g.gamma, kinematics.gamma_row(g), kinematics.D_B(g), statics.D_theta(g)):
        assert np.all(np.isfinite(value))


def test_a_rank_deficient_wrench_matrix_is_refused(cogiro: CableRobot) -> None:
    # All cables meet in one point of the platform: nothing holds its orientation.
    point = cogiro.replace(attachment_points=np.tile([0.0, 0.0, 1.0], (8, 1)))
    X = RigidTransform([0.0, 0.0, 1.0])
    with pytest.raises(GeometryError, match="rank below 6"):
        statics.check_rank(statics.wrench_matrix(kinematics.cable_geometry(point, X)))
    with pytest.raises(GeometryError):
        statics.D_s(point, X, np.ones(8))
    with pytest.raises(GeometryError):
        statics.minimum_norm_horizontal_tensions(point, X)


def test_minimum_norm_tensions_that_would_push_are_refused(cogiro: CableRobot) -> None:
    with pytest.raises(TensionError, match=r"\(6\.50, 4\.50, 1\.00\) m.*cable 4 to push"):
        statics.minimum_norm_horizontal_tensions(cogiro, RigidTransform([6.5, 4.5, 1.0]))


# --- rotations and pose vectors


@SEEDS
@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 1e-7, 1e-3, 1.0, 3.0, math.pi - 1e-9])
def test_logarithm_and_exponential_are_inverse(seed: int, angle: float) -> None:
    axis = np.random.default_rng(seed).normal(size=3)
    phi = angle * axis / np.linalg.norm(axis)
    R = exp_rotation(phi)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=2e-15)
    np.testing.assert_allclose(log_rotation(R), phi, atol=4e-15, rtol=1e-9 if angle < 1e-3 else 0)


def test_the_exponential_is_that_of_drake() -> None:
    from pydrake.common.eigen_geometry import AngleAxis

    phi = np.array([0.3, -1.2, 2.0])
    angle = float(np.linalg.norm(phi))
    expected = RotationMatrix(AngleAxis(angle=angle, axis=phi / angle)).matrix()
    np.testing.assert_allclose(exp_rotation(phi), expected, atol=1e-15)


@SEEDS
def test_angles_to_angular_velocity(seed: int) -> None:
    rpy = np.random.default_rng(seed).uniform(-1.2, 1.2, 3)
    E = rpy_rate_matrix(rpy)
    R = RollPitchYaw(rpy).ToRotationMatrix().matrix()
    for j, rate in enumerate(np.eye(3)):
        spin = derivative(
            lambda t, rate=rate: RollPitchYaw(rpy + t * rate).ToRotationMatrix().matrix()
        )
        np.testing.assert_allclose(skew(E[:, j]), spin @ R.T, atol=1e-11)


@pytest.mark.parametrize("angle", [1e-6, 5e-3, 0.0099, 0.0101, 0.5, 2.5, 3.1])
def test_the_rotation_interaction_matrix_against_differences(angle: float) -> None:
    phi = angle * np.array([2.0, -1.0, 2.0]) / 3.0
    R = exp_rotation(phi)  # R_MM*; M turns by omega in M: R_MM* <- exp(-omega t) R_MM*
    L = np.column_stack(
        [
            derivative(lambda t, e=e: -log_rotation(exp_rotation(-t * e) @ R), 1e-4)
            for e in np.eye(3)
        ]
    )
    assert relative_error(rotation_interaction_matrix(phi), L) < 1e-9


def test_the_rotation_interaction_matrix_of_the_table() -> None:
    row = ORACLE["PBVS"]
    s_w = row["s"][3:]
    agree(rotation_interaction_matrix(s_w).ravel(), row["L_w"])
    agree(exp_rotation(s_w).ravel(), row["exp_theta_u"])


@SEEDS
def test_pose_vectors_and_poses_are_inverse(seed: int) -> None:
    X = random_pose(np.random.default_rng(seed))
    vector = pose_to_vector(X)
    assert X.IsNearlyEqualTo(vector_to_pose(vector), 1e-15)
    assert as_pose(X) is X
    expected = RollPitchYaw(vector[:3]).ToRotationMatrix().matrix()
    np.testing.assert_allclose(X.rotation().matrix(), expected, atol=1e-15)
    np.testing.assert_array_equal(vector[3:], X.translation())


@pytest.mark.parametrize("bad", [[0.0] * 5, [0.0] * 7, [0, 0, 0, np.nan, 0, 0], np.zeros((6, 1))])
def test_what_is_no_pose_is_refused(bad: object) -> None:
    with pytest.raises(ValueError, match="six finite numbers"):
        as_pose(bad)


# --- AutoDiffXd


def small_robot() -> CableRobot:
    """Return CoGiRo at a tenth of its size."""
    robot = load_robot("cogiro")
    return robot.replace(
        drawing_points=0.1 * robot.drawing_points, attachment_points=0.1 * robot.attachment_points
    )


ROBOTS = {
    "cogiro": load_robot("cogiro"),
    "cogiro-98m": load_robot("cogiro-98m"),
    "small": small_robot(),
}


def geometric(robot: CableRobot, pose: object) -> np.ndarray:
    """Return what laws are built from at a pose, one after another; lengths over their size."""
    g = kinematics.cable_geometry(robot, pose)
    H = np.full(robot.num_cables, 300.0)
    size = np.linalg.norm(robot.drawing_points[0])
    parts = [g.EB / size, g.AB / size, g.L / size, g.u, g.Bx / size, g.Bz / size, g.gamma, g.x_A]
    parts += [g.y_A, g.R_FP, kinematics.D_Bf(g) / size, kinematics.D_u(g), kinematics.D_gamma(g)]
    parts += [kinematics.D_B(g) / size, statics.wrench_matrix(g) / size, statics.D_theta(g) / size]
    parts += [statics.weight_wrench(robot, g) / 1e4, statics.attachment_forces(robot, g, H) / 1e3]
    parts += [statics.D_tau(robot, g, H) / 1e4, statics.D_ext(robot, g) / 1e4]
    return np.concatenate([part.ravel() for part in parts])


@pytest.mark.parametrize("name", ROBOTS)
@settings(max_examples=15, deadline=None)
@given(
    turn=st.tuples(*[st.floats(-0.3, 0.3)] * 3),
    place=st.tuples(*[st.floats(-0.25, 0.25)] * 2, st.floats(0.2, 0.6)),
)
def test_autodiff_through_the_geometry_is_its_derivative(
    name: str, turn: tuple[float, ...], place: tuple[float, ...]
) -> None:
    robot = ROBOTS[name]
    extent = np.ptp(robot.drawing_points, axis=0)
    extent[2] = robot.drawing_points[:, 2].max()
    pose = np.concatenate([turn, place * extent])
    y = geometric(robot, InitializeAutoDiff(pose).ravel())
    np.testing.assert_allclose(ExtractValue(y).ravel(), geometric(robot, pose), atol=1e-13)
    steps = np.concatenate([np.full(3, 1e-5), np.full(3, 1e-5 * extent.min())])
    by_differences = [
        (geometric(robot, pose + h) - geometric(robot, pose - h)) / (2.0 * step)
        for h, step in zip(np.diag(steps), steps, strict=True)
    ]
    np.testing.assert_allclose(ExtractGradient(y), np.transpose(by_differences), atol=1e-6)


def test_the_geometry_takes_a_pose_of_autodiff(cogiro: CableRobot) -> None:
    vector = InitializeAutoDiff(pose_to_vector(X_WP)).ravel()
    u = kinematics.cable_geometry(cogiro, vector_to_pose(vector)).u
    expected = kinematics.cable_geometry(cogiro, vector).u
    np.testing.assert_array_equal(ExtractGradient(u.ravel()), ExtractGradient(expected.ravel()))


def test_a_cable_pulls_the_platform_and_the_wrench_matrix_is_of_the_cables(
    cogiro: CableRobot,
) -> None:
    rest = equilibrium.rest_state(cogiro, X_WP)
    k = cogiro.num_cables
    state = np.concatenate([pose_to_vector(rest.X_WP), np.zeros(6)])
    packed, _ = CableSet(cogiro)(state, rest.unstrained_length, np.zeros(k))
    assert packed[5] == pytest.approx(cogiro.mass * cogiro.gravity)  # up: they carry the weight
    W = statics.wrench_matrix(kinematics.cable_geometry(cogiro, X_WP))
    assert (W @ rest.chord_tension)[5] < 0.0
