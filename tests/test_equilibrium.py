"""Tension distributions, rest states, forward and inverse kinematics."""

from __future__ import annotations

import re

import numpy as np
import pytest
from oracle import ORACLE
from pydrake.math import RigidTransform
from samples import (
    derivative,
    jacobian,
    moved,
    oracle_robot,
    random_pose,
    random_robot,
    relative_error,
    rotation,
)
from scipy.optimize import linprog, lsq_linear
from test_servo import few_cables

from cdpr_drake.errors import EquilibriumError, GeometryError, TensionError
from cdpr_drake.model import cable_models, equilibrium, kinematics, statics
from cdpr_drake.model.catenary import elastic_catenary
from cdpr_drake.model.equilibrium import forward_kinematics, rest_state
from cdpr_drake.model.inverse_kinematics import InverseKinematics, motor_angles
from cdpr_drake.model.robot import CableRobot, Pulleys, load_robot
from cdpr_drake.model.rotations import pose_to_vector

SEEDS = pytest.mark.parametrize("seed", range(4))
RULES = pytest.mark.parametrize("rule", ["minimum norm", "within limits"])
LOW, HIGH = 100.0, 5000.0


# --- tension distributions


def random_wrench_matrix(generator: np.random.Generator, k: int) -> np.ndarray:
    """Return a wrench matrix (6, k) of unit forces at random points."""
    u = generator.normal(size=(k, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return np.hstack([np.cross(generator.uniform(-0.6, 0.6, (k, 3)), u), u]).T


def unexplained(W: np.ndarray, t: np.ndarray, preferred: float) -> float:
    """Return what is left of t - preferred after W^T y and pushes off the bounds t is at [N].

    Zero, with t feasible, if and only if t is the closest to what is preferred (the conditions of
    Karush, Kuhn and Tucker of a convex problem).
    """
    k = len(t)
    pushes = np.hstack([np.eye(k)[:, t < LOW + 1e-7], -np.eye(k)[:, t > HIGH - 1e-7]])
    columns = np.hstack([W.T, pushes])
    lower = np.concatenate([np.full(6, -np.inf), np.zeros(pushes.shape[1])])
    fit = lsq_linear(columns, t - preferred, (lower, np.inf), method="bvls", tol=1e-15)
    return float(np.abs(columns @ fit.x - (t - preferred)).max())


def margin(W: np.ndarray, wrench: np.ndarray) -> float:
    """Return how far inside the limits all tensions can be at once, as a share of the limits."""
    k = W.shape[1]
    cost = np.concatenate([np.zeros(k), [-1.0]])
    inside = np.vstack(
        [np.hstack([-np.eye(k), np.ones((k, 1))]), np.hstack([np.eye(k), np.ones((k, 1))])]
    )
    span = HIGH - LOW
    run = linprog(
        cost, inside, np.concatenate([np.full(k, -LOW / span), np.full(k, HIGH / span)]),
        np.hstack([W, np.zeros((6, 1))]), wrench / span, [(None, None)] * (k + 1),
    )  # fmt: skip
    assert run.status == 0
    return float(run.x[-1])


@pytest.mark.parametrize("k", [7, 8, 10])
def test_bounded_distributions_are_the_closest_or_do_not_exist(k: int) -> None:
    generator = np.random.default_rng(k)
    found = {"inside": 0, "at a bound": 0, "none": 0}
    for case in range(60):
        W = random_wrench_matrix(generator, k)
        spread = generator.uniform(0.3, 1.6)
        middle = 0.5 * (LOW + HIGH)
        wrench = W @ (middle + spread * middle * generator.uniform(-1.0, 1.0, k))
        preferred = generator.uniform(LOW, HIGH) if case % 2 else middle
        room = margin(W, wrench)
        if room < 0.0:
            with pytest.raises(TensionError, match="no tensions between 100 and 5000 N"):
                statics.bounded_distribution(W, wrench, LOW, HIGH, preferred)
            found["none"] += 1
            continue
        t = statics.bounded_distribution(W, wrench, LOW, HIGH, preferred)
        assert t.min() >= LOW and t.max() <= HIGH
        assert np.abs(W @ t - wrench).max() < 1e-8 * np.abs(wrench).max()
        at_bound = np.any((t < LOW + 1e-7) | (t > HIGH - 1e-7))
        found["at a bound" if at_bound else "inside"] += 1
        assert unexplained(W, t, preferred) < 1e-6
    assert min(found.values()) >= 3, found


def test_six_cables_have_one_distribution(cogiro: CableRobot) -> None:
    W = random_wrench_matrix(np.random.default_rng(0), 6)
    t = np.array([200.0, 300.0, 400.0, 4000.0, 600.0, 700.0])
    np.testing.assert_allclose(statics.bounded_distribution(W, W @ t, LOW, HIGH, 1e3), t)
    with pytest.raises(TensionError, match="only tensions"):
        statics.bounded_distribution(W, W @ t, LOW, 3900.0, 1e3)


def test_a_wrench_no_cable_can_take_is_refused() -> None:
    W = random_wrench_matrix(np.random.default_rng(0), 8)
    W[2] = 0.0  # no torque about z
    wrench = W @ np.full(8, 1000.0)
    t = statics.bounded_distribution(W, wrench, LOW, HIGH, 1000.0)
    np.testing.assert_allclose(W @ t, wrench)
    wrench[2] = 50.0
    with pytest.raises(TensionError, match="does not span it"):
        statics.bounded_distribution(W, wrench, LOW, HIGH, 1000.0)


@SEEDS
@RULES
def test_tension_distributions_balance_the_weight(cogiro: CableRobot, seed: int, rule: str) -> None:
    X = random_pose(np.random.default_rng(seed))
    T = statics.tension_distribution(cogiro, X, rule)
    g = kinematics.cable_geometry(cogiro, X)
    W = statics.wrench_matrix(g)
    np.testing.assert_allclose(W @ T, statics.weight_wrench(cogiro, g), atol=1e-8)
    if rule == "minimum norm":
        np.testing.assert_allclose(np.linalg.svd(W)[2][6:] @ T, 0.0, atol=1e-9)
    else:
        assert T.min() >= LOW and T.max() <= HIGH
        assert unexplained(W, T, 0.5 * (LOW + HIGH)) < 1e-6


def test_where_no_tensions_hold_the_platform(cogiro: CableRobot) -> None:
    outside = RigidTransform([6.5, 4.5, 1.0])
    with pytest.raises(TensionError, match=r"\(6\.50, 4\.50, 1\.00\) m.*cable 2 would bear -"):
        statics.tension_distribution(cogiro, outside)
    with pytest.raises(TensionError, match=r"at \(x, y, z\) = \(6\.50, 4\.50, 1\.00\)"):
        statics.tension_distribution(cogiro, outside, "within limits")
    with pytest.raises(ValueError, match='unknown rule "least"'):
        statics.tension_distribution(cogiro, RigidTransform([0, 0, 1.0]), "least")
    with pytest.raises(GeometryError, match="rank below 6"):
        rest_state(few_cables(cogiro, 5), RigidTransform([0, 0, 1.0]))


# --- rest states


def unbalanced(robot: CableRobot, X: RigidTransform, length: np.ndarray) -> float:
    """Return the largest component of the wrench on the platform over the weight."""
    EB = robot.attachment_points @ X.rotation().matrix().T
    cables = elastic_catenary(
        EB + X.translation() - robot.drawing_points,
        length,
        robot.weight_per_metre,
        robot.cable.stiffness,
        robot.cable.drum_run,
    )
    force = cables.force_on_platform
    weight = np.array([0.0, 0.0, -robot.mass * robot.gravity])
    torque = np.cross(EB, force).sum(0) + np.cross(X.rotation() @ robot.center_of_mass, weight)
    wrench = np.concatenate([torque, force.sum(0) + weight])
    return float(np.abs(wrench).max() / -weight[2])


def check_rest(robot: CableRobot, X: RigidTransform, rule: str = "minimum norm") -> None:
    rest = rest_state(robot, X, rule)
    assert rest.residual < 1e-9
    assert unbalanced(robot, X, rest.unstrained_length) < 1e-9
    g = kinematics.cable_geometry(robot, X)
    T = rest.chord_tension
    if rule == "minimum norm":
        # Of least norm among chord tensions with the cables' sag as it is.
        null = np.linalg.svd(statics.wrench_matrix(g))[2][6:]
        assert np.abs(null @ T).max(initial=0.0) < 1e-9 * T.max()
    else:
        assert T.min() >= robot.cable.min_tension - 1e-6
        assert T.max() <= robot.cable.max_tension + 1e-6
    assert T.min() > 0.0
    # The cable pulls harder where it is higher.
    higher = g.Bz < 0.0
    assert np.all((rest.tension_at_drawing_point > rest.tension_at_attachment_point)[higher])


@SEEDS
@RULES
def test_the_robot_rests_in_exact_balance(cogiro: CableRobot, seed: int, rule: str) -> None:
    check_rest(cogiro, random_pose(np.random.default_rng(seed)), rule)


@pytest.mark.parametrize("name", ["cogiro-2015-pulleys", "cogiro-22m", "cogiro-37m", "cogiro-98m"])
def test_the_other_robots_rest_in_exact_balance(name: str) -> None:
    robot = load_robot(name).replace(pulleys=Pulleys())
    centre = robot.drawing_points.mean(axis=0) * [1.0, 1.0, 0.3]
    check_rest(robot, RigidTransform(centre))


@pytest.mark.parametrize("k", [6, 7, 10])
def test_any_number_of_cables_rests_in_exact_balance(cogiro: CableRobot, k: int) -> None:
    robot, pose = random_robot(cogiro, k, seed=0)
    check_rest(robot, equilibrium.as_pose(pose))


def test_a_cable_that_stiffens_rests_in_exact_balance(cogiro: CableRobot) -> None:
    stiffness = cogiro.cable.stiffness.replace(softening=4e7, offset=100.0)
    soft = cogiro.replace(cable=cogiro.cable.replace(stiffness=stiffness))
    X = RigidTransform(rotation([0.05, 0.02, -0.04]), [0.8, -0.4, 1.1])
    check_rest(soft, X)
    longer = rest_state(cogiro, X).unstrained_length - rest_state(soft, X).unstrained_length
    assert longer.min() > 1e-3  # the softer cable stretches more, so less of it is paid out


def test_the_least_norm_is_one_along_the_balanced_tensions(cogiro: CableRobot) -> None:
    """Along tensions that keep the exact balance the norm of the chord tensions hardly changes.

    The rule holds the sag while it takes the least norm, so the first-order change of the norm is
    that of the sag with the tension, not zero.
    """
    X = RigidTransform([0.5, 0.3, 1.2])
    rest = rest_state(cogiro, X)
    g = kinematics.cable_geometry(cogiro, X)
    T = rest.chord_tension
    from cdpr_drake.model.kernels.catenary import irvine_from_horizontal

    def wrench(T: np.ndarray) -> np.ndarray:
        H = T * g.Bx / g.L
        EA = cogiro.cable.stiffness.asymptote
        V = [
            irvine_from_horizontal(g.Bx[i], g.Bz[i], H[i], cogiro.weight_per_metre, EA)[0]
            for i in range(8)
        ]
        force = H[:, None] * g.x_A + np.array(V)[:, None] * g.z
        return np.concatenate([np.cross(g.EB, force).sum(0), force.sum(0)])

    change = np.column_stack([derivative(lambda t, e=e: wrench(T + t * e), 1.0) for e in np.eye(8)])
    null = np.linalg.svd(change)[2][6:]
    slope = np.abs(null @ T) / np.linalg.norm(T)
    assert slope.max() < 1e-5


# --- forward kinematics


@SEEDS
def test_forward_kinematics_finds_the_pose_again(cogiro: CableRobot, seed: int) -> None:
    generator = np.random.default_rng(seed)
    X = random_pose(generator)
    rest = rest_state(cogiro, X)
    for _ in range(3):
        twist = np.concatenate([generator.uniform(-0.2, 0.2, 3), generator.uniform(-0.4, 0.4, 3)])
        found = forward_kinematics(cogiro, rest.unstrained_length, moved(X, twist, 1.0))
        assert found.residual < 1e-9
        # Within what residuals of 1e-9 of the weight leave to the softest direction.
        assert X.IsNearlyEqualTo(found.X_WP, 1e-9)
        np.testing.assert_allclose(found.chord_tension, rest.chord_tension, rtol=1e-6)


@pytest.mark.parametrize("k", [6, 7, 10])
def test_forward_kinematics_for_any_number_of_cables(cogiro: CableRobot, k: int) -> None:
    robot, pose = random_robot(cogiro, k, seed=0)
    X = equilibrium.as_pose(pose)
    twist = np.array([0.05, -0.04, 0.03, 0.1, -0.2, 0.1])
    lengths = rest_state(robot, X).unstrained_length
    found = forward_kinematics(robot, lengths, moved(X, twist, 1.0))
    assert X.IsNearlyEqualTo(found.X_WP, 1e-8)


def test_forward_kinematics_with_slack_cables(cogiro: CableRobot) -> None:
    X = RigidTransform([0.2, -0.1, 1.0])
    length = rest_state(cogiro, X).unstrained_length.copy()
    length[[1, 6]] += 1.5
    found = forward_kinematics(cogiro, length, X)
    assert found.residual < 1e-9
    assert unbalanced(cogiro, found.X_WP, length) < 1e-9
    T_A = found.tension_at_drawing_point
    weight = cogiro.weight_per_metre * length
    assert np.all(T_A[[1, 6]] < 2.0 * weight[[1, 6]])
    assert T_A[[0, 2, 3, 4, 5, 7]].max() > 300.0
    # It is stable: the stiffness is positive in all directions.
    stiffness = equilibrium.platform_balance(cogiro, found.X_WP, length)[1]
    assert np.linalg.eigvalsh(-0.5 * (stiffness + stiffness.T)).min() > 0.0


def test_forward_kinematics_anywhere_with_slack_cables(cogiro: CableRobot) -> None:
    generator = np.random.default_rng(0)
    slack = 0
    for _ in range(40):
        turn = generator.uniform([-0.15, -0.15, -0.4], [0.15, 0.15, 0.4])
        pose = np.concatenate([turn, generator.uniform([-4.5, -3.0, 0.2], [4.5, 3.0, 3.5])])
        chords = kinematics.cable_geometry(cogiro, pose).L
        tension = generator.uniform(50.0, 1500.0, 8)
        length = (chords + cogiro.cable.drum_run) / (1.0 + tension / cogiro.cable.stiffness(0.0))
        loose = generator.choice(8, generator.integers(0, 4), replace=False)
        length[loose] += chords[loose] * generator.uniform(0.02, 0.08, loose.size)
        found = forward_kinematics(cogiro, length, pose)
        assert found.residual < 1e-9
        assert unbalanced(cogiro, found.X_WP, length) < 1e-9
        R = found.X_WP.rotation().matrix()
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
        stiffness = equilibrium.platform_balance(cogiro, found.X_WP, length)[1]
        assert np.linalg.eigvalsh(-0.5 * (stiffness + stiffness.T)).min() > 0.0
        slack += int(np.sum(found.tension_at_drawing_point < 10.0))
    assert slack > 20


def test_three_cables_hang_somewhere(cogiro: CableRobot) -> None:
    three = few_cables(cogiro, [0, 2, 5])
    length = np.array([9.0, 9.0, 9.5]) + three.cable.drum_run
    found = forward_kinematics(three, length, RigidTransform([-2.0, 0.0, 1.0]))
    assert found.residual < 1e-9
    assert unbalanced(three, found.X_WP, length) < 1e-9


def test_no_equilibrium_names_the_limiting_cable(cogiro: CableRobot) -> None:
    X = RigidTransform([0.2, -0.1, 1.0])
    length = rest_state(cogiro, X).unstrained_length
    with pytest.raises(EquilibriumError, match=r"residual .* limiting\s+cable \d \("):
        forward_kinematics(cogiro, length, RigidTransform([1.5, 1.0, 1.5]), max_iterations=2)
    short = length.copy()
    short[3] = 0.5 * cogiro.cable.drum_run[3]
    with pytest.raises(EquilibriumError, match="cable 4: no catenary of unstrained length"):
        forward_kinematics(cogiro, short, X)


@pytest.mark.parametrize("bad", [np.ones(7), np.full(8, -1.0), np.full(8, np.nan)])
def test_lengths_that_are_none_are_refused(cogiro: CableRobot, bad: np.ndarray) -> None:
    with pytest.raises(ValueError, match="8 positive numbers"):
        forward_kinematics(cogiro, bad, RigidTransform([0, 0, 1.0]))


@SEEDS
def test_the_stiffness_of_the_platform_against_differences(cogiro: CableRobot, seed: int) -> None:
    X = random_pose(np.random.default_rng(seed))
    length = rest_state(cogiro, X).unstrained_length

    def wrench(t: float, twist: np.ndarray) -> np.ndarray:
        return equilibrium.platform_balance(cogiro, moved(X, twist, t), length)[0]

    expected = [derivative(lambda t, e=e: wrench(t, e), 1e-4) for e in np.eye(6)]
    got = equilibrium.platform_balance(cogiro, X, length)[1]
    assert relative_error(got, np.array(expected).T) < 1e-8


def test_the_weight_acts_at_the_centre_of_mass(cogiro: CableRobot) -> None:
    robot = cogiro.with_payload(110.0, center_of_mass=[0.1, 0.2, 0.3])
    G = robot.center_of_mass
    wrench = equilibrium.gravity_wrench(robot, RigidTransform(rotation([0.0, 0.0, np.pi / 2])))
    mg = 210.0 * 9.81
    np.testing.assert_allclose(wrench, [-G[0] * mg, -G[1] * mg, 0, 0, 0, -mg], atol=1e-12)


# --- inverse kinematics


def test_lengths_of_the_table(cogiro: CableRobot) -> None:
    row = ORACLE["robot"]
    robot = oracle_robot(cogiro)
    X = RigidTransform(rotation(row["theta_u_WE"]), row["p_WE"])
    for cable_model, key in (("SCMWE", "lengths_scmwe"), ("ECM", "lengths_ecm4")):
        lengths = InverseKinematics(robot, cable_model, order=4).lengths(X)
        np.testing.assert_allclose(lengths, row[key], rtol=1e-9)


@SEEDS
@pytest.mark.parametrize("cable_model", cable_models.CABLE_MODELS)
def test_lengths_and_their_jacobian(cogiro: CableRobot, seed: int, cable_model: str) -> None:
    X = random_pose(np.random.default_rng(seed))
    H = statics.minimum_norm_horizontal_tensions(cogiro, X)
    g = kinematics.cable_geometry(cogiro, X)
    w, EA = cogiro.weight_per_metre, cogiro.cable.stiffness.asymptote
    span = cable_models.unstrained_length(cable_model, g.Bx, g.Bz, H, w, EA)
    inverse = InverseKinematics(cogiro, cable_model)
    lengths, got = inverse.lengths_and_jacobian(pose_to_vector(X))
    np.testing.assert_allclose(lengths, span + cogiro.cable.drum_run, rtol=1e-12)
    np.testing.assert_allclose(inverse.lengths(X), lengths, rtol=1e-14)
    expected = jacobian(
        lambda pose: inverse.lengths_and_jacobian(pose, False)[0], pose_to_vector(X)
    )
    assert relative_error(got, expected) < 1e-9
    assert not inverse.lengths_and_jacobian(pose_to_vector(X), False)[1].any()


def test_lengths_with_a_stiffness_that_depends_on_tension(cogiro: CableRobot) -> None:
    stiffness = cogiro.cable.stiffness.replace(softening=4e7, offset=100.0)
    soft = cogiro.replace(cable=cogiro.cable.replace(stiffness=stiffness))
    pose = np.array([0.02, -0.05, 0.1, 0.4, -0.3, 1.0])
    inverse = InverseKinematics(soft, "ECM")
    got = inverse.lengths_and_jacobian(pose)[1]
    expected = jacobian(lambda pose: inverse.lengths_and_jacobian(pose, False)[0], pose)
    assert relative_error(got, expected) < 1e-9


def test_the_paper_s_elastic_cable_is_nearly_the_exact_one(cogiro: CableRobot) -> None:
    """At the same tensions the ECM's spans differ from the robot's own by less than a micron."""
    X = RigidTransform([0.3, -0.2, 1.0])
    rest = rest_state(cogiro, X)
    g = kinematics.cable_geometry(cogiro, X)
    H, EA = rest.chord_tension * g.Bx / g.L, cogiro.cable.stiffness.asymptote
    stretched = cogiro.cable.drum_run / (1.0 + rest.tension_at_drawing_point / EA)
    w = cogiro.weight_per_metre
    spans = cable_models.unstrained_length("ECM", g.Bx, g.Bz, H, w, EA, 4)
    np.testing.assert_allclose(spans, rest.unstrained_length - stretched, atol=1e-6, rtol=0.0)


def test_angles_from_lengths(cogiro: CableRobot) -> None:
    winch = cogiro.winch.replace(encoder_zero_length=np.arange(8.0))
    robot = cogiro.replace(winch=winch)
    angles = motor_angles(robot, np.arange(8.0) + 2.25)
    np.testing.assert_allclose(angles, 100.0)
    X = RigidTransform([0.3, -0.2, 1.0])
    inverse = InverseKinematics(robot)
    np.testing.assert_allclose(
        inverse.motor_angles(X), (inverse.lengths(X) - np.arange(8.0)) / 0.0225
    )


def test_inverse_kinematics_says_where_and_why_it_cannot(cogiro: CableRobot) -> None:
    with pytest.raises(ValueError, match=re.escape('unknown cable model "XYZ"')):
        InverseKinematics(cogiro, "XYZ")
    outside = RigidTransform([6.5, 4.5, 1.0])
    with pytest.raises(TensionError, match=r"6\.5.*outside the wrench-feasible workspace"):
        InverseKinematics(cogiro).lengths(outside)
    with pytest.raises(TensionError, match="least norm would need cable 4 to push"):
        InverseKinematics(cogiro, rule="minimum norm").lengths_and_jacobian(pose_to_vector(outside))
    with pytest.raises(GeometryError, match="rank below 6"):
        InverseKinematics(few_cables(cogiro, 5)).lengths(RigidTransform([0, 0, 1.0]))
