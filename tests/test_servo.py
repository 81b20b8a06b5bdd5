"""The control law: pose error, interaction matrix, length rates, motor rates and their Jacobian."""

from __future__ import annotations

import math

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
    relative_error,
    rotation,
    swap_halves,
)
from scipy.integrate import solve_ivp

from cdpr_drake.errors import GeometryError
from cdpr_drake.model import cable_models, kinematics, servo, statics
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.kernels import servo as kernel
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import exp_rotation, log_rotation, pose_to_vector, skew

SEEDS = pytest.mark.parametrize("seed", range(4))
MODELS = pytest.mark.parametrize("cable_model", cable_models.CABLE_MODELS)
TEN_DIGITS = 1e-9
"""Of each entry: the oracle table has ten significant digits."""

# Start and goal of Test 1 (paper, 6.1): rotation vector of R_FM [rad] and p_FM [m].
TEST_1_START = ([2.14, -1.03, 0.48], [-0.09, -2.08, 9.22])
TEST_1_GOAL = ([2.15, -0.97, 0.65], [-0.23, -5.56, 11.83])


# --- pose error


def test_the_error_is_the_goal_seen_from_the_target_frame() -> None:
    X_PM = RigidTransform([0.0, 0.0, 0.5])
    quarter = rotation([0.0, 0.0, math.pi / 2])
    now = RigidTransform(quarter, [1.0, 2.0, 3.0])
    goal = RigidTransform([4.0, 2.0, 3.0])
    # 3 m along x of the world is 3 m along -y of a frame turned by 90 degrees about z.
    expected = [0.0, 0.0, -math.pi / 2, 0.0, -3.0, 0.0]
    np.testing.assert_allclose(servo.pose_error(now, goal, X_PM), expected, atol=1e-15)


def test_the_error_at_the_start_of_test_1() -> None:
    start, goal = (RigidTransform(rotation(r), p) for r, p in (TEST_1_START, TEST_1_GOAL))
    s = servo.pose_error(start, goal, RigidTransform())
    row = ORACLE["PBVS"]
    np.testing.assert_allclose(swap_halves(s), row["test_1_s_0"], rtol=TEN_DIGITS)
    assert math.degrees(np.linalg.norm(s[:3])) == pytest.approx(row["test_1_theta_deg"], rel=1e-9)


@SEEDS
def test_the_error_does_not_depend_on_the_frame_it_is_taken_in(seed: int) -> None:
    generator = np.random.default_rng(seed)
    now, goal, X_PM, X_FW = (random_pose(generator) for _ in range(4))
    s = servo.pose_error(now, goal, X_PM)
    np.testing.assert_allclose(servo.pose_error(X_FW @ now, X_FW @ goal, X_PM), s, atol=2e-14)
    vectors = pose_to_vector(now), pose_to_vector(goal)
    np.testing.assert_allclose(servo.pose_error(*vectors, X_PM), s, atol=2e-14)


# --- interaction matrix and law (eq. 18)


@SEEDS
@pytest.mark.parametrize("angle", [1e-6, 0.3, 1.5, 2.9])
def test_the_interaction_matrix_against_differences(seed: int, angle: float) -> None:
    generator = np.random.default_rng(seed)
    X_WM = random_pose(generator)
    axis = generator.normal(size=3)
    turn = rotation(angle * axis / np.linalg.norm(axis))
    goal = X_WM @ RigidTransform(turn, generator.uniform(-2.0, 2.0, 3))

    def error(t: float, twist: np.ndarray) -> np.ndarray:
        step = RigidTransform(rotation(t * twist[:3]), t * twist[3:])
        return servo.pose_error(X_WM @ step, goal, RigidTransform())

    L = np.column_stack([derivative(lambda t, e=e: error(t, e), 1e-3) for e in np.eye(6)])
    got = servo.interaction_matrix(error(0.0, np.zeros(6)))
    assert relative_error(got, L) < 1e-9


@SEEDS
def test_the_law_is_the_inverse_of_the_interaction_matrix(seed: int) -> None:
    s = np.random.default_rng(seed).uniform(-1.5, 1.5, 6)
    expected = -0.3 * np.linalg.solve(servo.interaction_matrix(s), s)
    np.testing.assert_allclose(servo.servo_twist(s, 0.3), expected, rtol=1e-12, atol=1e-14)


def test_the_law_of_the_table() -> None:
    row = ORACLE["PBVS"]
    tau = servo.servo_twist(swap_halves(np.array(row["s"])), row["gain"])
    np.testing.assert_allclose(swap_halves(tau), row["tau"], rtol=TEN_DIGITS)


def integrated_error(
    X_WM: RigidTransform, goal: RigidTransform, gain: float, times: np.ndarray, moving: np.ndarray
) -> np.ndarray:
    """Return s (n, 6) along the motion of M under the law, the goal at a constant twist in W."""

    def frames(t: float, y: np.ndarray) -> tuple[RigidTransform, RigidTransform]:
        now = RigidTransform(rotation(log_rotation(y[:9].reshape(3, 3))), y[9:])
        return now, moved(goal, moving, t)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        now, target = frames(t, y)
        s = servo.pose_error(now, target, RigidTransform())
        tau = servo.servo_twist(s, gain)
        R = now.rotation().matrix()
        # The goal's twist, carried rigidly to where M is, is fed forward.
        along = moving[3:] + np.cross(moving[:3], now.translation() - target.translation())
        omega, v = R @ tau[:3] + moving[:3], R @ tau[3:] + along
        return np.concatenate([(skew(omega) @ R).ravel(), v])

    y0 = np.concatenate([X_WM.rotation().matrix().ravel(), X_WM.translation()])
    run = solve_ivp(
        rate, (0.0, times[-1]), y0, "DOP853", times, rtol=1e-12, atol=1e-13, max_step=0.5
    )
    pairs = (frames(t, y) for t, y in zip(run.t, run.y.T, strict=True))
    return np.array([servo.pose_error(*pair, RigidTransform()) for pair in pairs])


@pytest.mark.parametrize("moving", [np.zeros(6), np.array([0.02, -0.03, 0.05, 0.1, 0.2, -0.1])])
def test_the_error_decays_exponentially_on_the_group_of_motions(moving: np.ndarray) -> None:
    start = RigidTransform(rotation([1.0, -1.5, 2.0]), [1.0, 2.0, 3.0])  # 154 degrees
    goal = RigidTransform([-1.0, 0.5, 1.0])
    gain, times = 0.4, np.linspace(0.0, 10.0, 6)
    s = integrated_error(start, goal, gain, times, moving)
    assert math.degrees(np.linalg.norm(s[0, :3])) == pytest.approx(154.3, abs=0.1)
    np.testing.assert_allclose(s, np.exp(-gain * times)[:, None] * s[0], rtol=0.0, atol=2e-10)


# --- rates of the lengths (eq. 14)


@pytest.mark.parametrize(("name", "i"), [("cable_1", 0), ("cable_6", 5)])
@MODELS
def test_length_rates_of_the_table(cogiro: CableRobot, cable_model: str, name: str, i: int) -> None:
    row = ORACLE["robot"]
    robot = oracle_robot(cogiro)
    X = RigidTransform(rotation(row["theta_u_WE"]), row["p_WE"])
    H = statics.minimum_norm_horizontal_tensions(robot, X)
    R_FW = exp_rotation(row["theta_u_FW"])
    D = servo.D_a(robot, X, H, cable_model, order=4, R_FW=R_FW)
    expected = row[name][f"D_a_{cable_model.lower()}"]
    np.testing.assert_allclose(swap_halves(D[i]), expected, rtol=TEN_DIGITS)


@SEEDS
@pytest.mark.parametrize(
    ("cable_model", "order", "run"),
    [
        ("ECM", 4, False),
        ("ECM", 1, False),
        ("ECM", 3, True),
        ("CMWE", 4, True),
        ("SCMWE", 4, False),
        ("SLSM", 4, False),
    ],
)
def test_length_rates_against_differences(
    cogiro: CableRobot, seed: int, cable_model: str, order: int, run: bool
) -> None:
    """Along (tau, D_s tau), with G away from E and twists in a frame turned at random."""
    generator = np.random.default_rng(seed)
    robot = cogiro.with_payload(60.0, center_of_mass=generator.uniform(-0.2, 0.2, 3))
    X, R_FW = random_pose(generator), exp_rotation(generator.uniform(-2.0, 2.0, 3))
    H = generator.uniform(80.0, 900.0, robot.num_cables)
    w, EA = robot.weight_per_metre, robot.cable.stiffness.asymptote
    D_s = statics.D_s(robot, X, H, R_FW)

    def lengths(t: float, twist: np.ndarray) -> np.ndarray:
        g = kinematics.cable_geometry(robot, moved(X, twist, t, R_FW))
        now = H + t * (D_s @ twist)
        length = cable_models.unstrained_length(cable_model, g.Bx, g.Bz, now, w, EA, order)
        if run:
            ends = cable_models.cable_angles(g.Bx, g.Bz, now, w)
            length = length + robot.cable.drum_run / (1.0 + ends.T_A / EA)
        return length

    got = servo.D_a(robot, X, H, cable_model, order, model_drum_run=run, R_FW=R_FW)
    expected = [derivative(lambda t, e=e: lengths(t, e)) for e in np.eye(6)]
    assert relative_error(got, np.array(expected).T) < 1e-10


def test_only_the_straight_line_needs_no_tensions(cogiro: CableRobot) -> None:
    three = few_cables(cogiro, 3)
    X = RigidTransform([0.0, 0.0, 1.0])
    g = kinematics.cable_geometry(three, X)
    rows = np.hstack([np.cross(g.EB, g.u), g.u])
    np.testing.assert_allclose(servo.D_a(three, X, np.ones(3), "SLSM"), rows, atol=1e-15)
    with pytest.raises(GeometryError, match="rank below 6"):
        servo.D_a(three, X, np.ones(3), "SCMWE")


# --- the whole law


def few_cables(robot: CableRobot, cables: int | list[int]) -> CableRobot:
    """Return the robot with only its first cables, or those of given indices."""
    chosen = list(range(cables)) if isinstance(cables, int) else cables
    cells, cable, winch = robot.load_cells, robot.cable, robot.winch
    return robot.replace(
        drawing_points=robot.drawing_points[chosen],
        attachment_points=robot.attachment_points[chosen],
        cable=cable.replace(drum_run=cable.drum_run[chosen]),
        winch=winch.replace(encoder_zero_length=winch.encoder_zero_length[chosen]),
        load_cells=cells.replace(bias=cells.bias[chosen], gain=cells.gain[chosen]),
    )


def law_input(
    robot: CableRobot,
    X: RigidTransform,
    goal: RigidTransform,
    H: np.ndarray,
    alpha: np.ndarray,
    twist: np.ndarray | None = None,
) -> np.ndarray:
    """Return the law's input for horizontal tensions H and slopes alpha at the drawing points."""
    gamma = kinematics.cable_geometry(robot, X).gamma
    tangents = np.column_stack(
        [np.cos(alpha) * np.cos(gamma), np.cos(alpha) * np.sin(gamma), np.sin(alpha)]
    )
    twist = np.zeros(6) if twist is None else twist
    poses = pose_to_vector(X), pose_to_vector(goal)
    return np.concatenate([*poses, twist, H / np.cos(alpha), tangents.ravel()])


def random_case(
    robot: CableRobot, seed: int, angle: float = 0.3
) -> tuple[RigidTransform, RigidTransform, np.ndarray, np.ndarray]:
    """Return a pose, a goal turned by an angle [rad], horizontal tensions and slopes at A."""
    generator = np.random.default_rng(seed)
    X, goal = random_pose(generator), random_pose(generator)
    axis = generator.normal(size=3)
    turn = X.rotation() @ rotation(angle * axis / np.linalg.norm(axis))
    goal = RigidTransform(turn, goal.translation())
    k = robot.num_cables
    return X, goal, generator.uniform(80.0, 700.0, k), generator.uniform(-0.7, -0.2, k)


def tilted_target(robot: CableRobot) -> CableRobot:
    """Return the robot with its target frame turned and off the platform's axis."""
    X_PM = RigidTransform(rotation([0.3, -0.5, 0.8]), [0.1, -0.2, 0.4])
    return robot.replace(cameras=robot.cameras.replace(X_PM=X_PM))


@SEEDS
@MODELS
def test_the_law_is_the_product_of_its_parts(
    cogiro: CableRobot, seed: int, cable_model: str
) -> None:
    robot = tilted_target(cogiro)
    X, goal, H, alpha = random_case(robot, seed)
    law = servo.MotorRateLaw(robot, servo.ServoSettings(cable_model=cable_model))
    out = law(law_input(robot, X, goal, H, alpha), 0.2)
    s = servo.pose_error(X, goal, robot.cameras.X_PM)
    np.testing.assert_allclose(out[-6:], s, atol=1e-13)
    rates = servo.D_m(robot, X, H, cable_model) @ servo.servo_twist(s, 0.2)
    np.testing.assert_allclose(out[:-6], rates, rtol=1e-11, atol=1e-12)


def test_motor_rates_are_length_rates_over_the_transmission(cogiro: CableRobot) -> None:
    X, _, H, _ = random_case(cogiro, 1)
    R, p = X.rotation().matrix(), cogiro.cameras.X_PM.translation()
    D = servo.D_a(cogiro, X, H) @ kinematics.D_t(R, p)
    np.testing.assert_allclose(servo.D_m(cogiro, X, H), D / 0.0225, rtol=1e-12)


def test_no_error_no_motion_and_a_length_of_tangent_does_not_matter(cogiro: CableRobot) -> None:
    X, goal, H, alpha = random_case(cogiro, 2)
    law = servo.MotorRateLaw(cogiro, servo.ServoSettings())
    at_rest = law(law_input(cogiro, X, X, H, alpha), 0.2)
    np.testing.assert_allclose(at_rest, 0.0, atol=1e-12)
    z = law_input(cogiro, X, goal, H, alpha)
    longer = z.copy()
    longer[-24:] *= 1.7
    np.testing.assert_allclose(law(longer, 0.2), law(z, 0.2), rtol=1e-12)


def test_horizontal_tension_comes_from_load_cell_and_tangent(cogiro: CableRobot) -> None:
    """H = T_A cos(alpha) (eq. 16), with a floor of a twentieth of w Bx for a slack cable."""
    X, goal, H, alpha = random_case(cogiro, 3)
    law = servo.MotorRateLaw(cogiro, servo.ServoSettings())
    z = law_input(cogiro, X, goal, H, alpha)
    other = law_input(cogiro, X, goal, H, alpha + 0.1)
    np.testing.assert_allclose(law(other, 0.2), law(z, 0.2), rtol=1e-12)
    floor = cogiro.weight_per_metre * kinematics.cable_geometry(cogiro, X).Bx / 20.0
    slack = H.copy()
    slack[2] = floor[2]
    expected = law(law_input(cogiro, X, goal, slack, alpha), 0.2)
    for T_A in (-50.0, 0.0, 0.5 * floor[2]):
        z[18 + 2] = T_A
        np.testing.assert_allclose(law(z, 0.2), expected, rtol=1e-12)


@SEEDS
def test_the_law_uses_the_stiffness_at_the_measured_tension(cogiro: CableRobot, seed: int) -> None:
    """A cable that stiffens: EA(T_A), as a constant-EA robot has it when all T_A are equal."""
    stiffness = cogiro.cable.stiffness.replace(softening=4e7, offset=100.0)
    soft = cogiro.replace(cable=cogiro.cable.replace(stiffness=stiffness))
    constant = cogiro.replace(cable=cogiro.cable.replace(stiffness=stiffness(300.0)))
    X, goal, _, alpha = random_case(cogiro, seed)
    z = law_input(cogiro, X, goal, 300.0 * np.cos(alpha), alpha)
    settings = servo.ServoSettings(cable_model="ECM", model_drum_run=True)
    expected = servo.MotorRateLaw(constant, settings)(z, 0.2)
    np.testing.assert_allclose(servo.MotorRateLaw(soft, settings)(z, 0.2), expected, rtol=1e-12)


# --- feed-forward, limits, ramp


def target_twist(robot: CableRobot, X: RigidTransform, rates: np.ndarray) -> np.ndarray:
    """Return [omega; v] of M in W that motor rates of the straight-line law stand for."""
    D = servo.D_a(robot, X, np.ones(robot.num_cables), "SLSM")
    twist = np.linalg.lstsq(D, rates * robot.winch.transmission, rcond=None)[0]
    EM = X.rotation() @ robot.cameras.X_PM.translation()
    return np.concatenate([twist[:3], twist[3:] + np.cross(twist[:3], EM)])


def test_the_feed_forward_moves_the_platform_with_the_goal(cogiro: CableRobot) -> None:
    robot = tilted_target(cogiro)
    X, goal, H, alpha = random_case(robot, 4)
    wanted = np.array([0.1, -0.2, 0.15, 0.3, 0.1, -0.2])  # of the desired platform, in W
    law = servo.MotorRateLaw(robot, servo.ServoSettings(cable_model="SLSM"))
    # At the goal M moves as a point of the desired platform.
    rates = law(law_input(robot, goal, goal, H, alpha, wanted), 0.2)[:-6]
    got = target_twist(robot, goal, rates)
    EM = goal.rotation() @ robot.cameras.X_PM.translation()
    expected = np.concatenate([wanted[:3], wanted[3:] + np.cross(wanted[:3], EM)])
    np.testing.assert_allclose(got, expected, atol=1e-12)
    # Away from it the relative motion is the law's own: as if the goal stood still.
    rates = law(law_input(robot, X, goal, H, alpha, wanted), 0.2)[:-6]
    still = law(law_input(robot, X, goal, H, alpha), 0.2)[:-6]
    extra = target_twist(robot, X, rates) - target_twist(robot, X, still)
    M = (X @ robot.cameras.X_PM).translation()
    carried = wanted[3:] + np.cross(wanted[:3], M - goal.translation())
    np.testing.assert_allclose(extra, np.concatenate([wanted[:3], carried]), atol=1e-12)


@pytest.mark.parametrize(
    ("max_speed", "max_angular_speed", "bound"),
    [(0.05, np.inf, "speed"), (np.inf, 0.02, "angular"), (0.05, 0.02, "either"), (9.0, 9.0, "no")],
)
def test_speed_limits_scale_the_whole_twist(
    cogiro: CableRobot, max_speed: float, max_angular_speed: float, bound: str
) -> None:
    robot = tilted_target(cogiro)
    X, goal, H, alpha = random_case(robot, 5, angle=0.8)
    z = law_input(robot, X, goal, H, alpha)
    settings = servo.ServoSettings(cable_model="SLSM")
    free = servo.MotorRateLaw(robot, settings)(z, 0.3)[:-6]
    limited = servo.ServoSettings(
        cable_model="SLSM", max_speed=max_speed, max_angular_speed=max_angular_speed
    )
    rates = servo.MotorRateLaw(robot, limited)(z, 0.3)[:-6]
    twist = target_twist(robot, X, free)
    over = (
        np.linalg.norm(twist[3:]) / max_speed,
        np.linalg.norm(twist[:3]) / max_angular_speed,
    )
    assert (max(over) > 1.0) == (bound != "no")
    np.testing.assert_allclose(rates, free / max(1.0, *over), rtol=1e-12)


def test_the_gain_rises_linearly_over_the_ramp() -> None:
    settings = servo.ServoSettings(gain=0.4, ramp_time=2.0)
    times = [-1.0, 0.0, 0.5, 1.0, 2.0, 50.0]
    assert [settings.gain_at(t) for t in times] == [0.0, 0.0, 0.1, 0.2, 0.4, 0.4]
    assert servo.ServoSettings(gain=0.4, ramp_time=0.0).gain_at(0.0) == 0.4


@pytest.mark.parametrize(
    "field",
    [
        {"cable_model": "XYZ"},
        {"gain": 0.0},
        {"gain": -0.1},
        {"gain": math.nan},
        {"gain": math.inf},
        {"ramp_time": -1.0},
        {"ramp_time": math.nan},
        {"max_speed": 0.0},
        {"max_speed": math.nan},
        {"max_angular_speed": -1.0},
        {"order": 0},
    ],
)
def test_settings_that_cannot_work_are_refused(field: dict) -> None:
    with pytest.raises(ValueError, match=r"unknown cable model|must"):
        servo.ServoSettings(**field)


# --- the Jacobian, by complex steps, against central differences


BLOCKS = {
    "pose": slice(0, 6),
    "desired pose": slice(6, 12),
    "desired twist": slice(12, 18),
    "tension": slice(18, 26),
    "tangents": slice(26, 50),
}


def check_law_jacobian(law: servo.MotorRateLaw, z: np.ndarray, gain: float) -> None:
    """Compare the Jacobian of the rates and of s with differences, block of inputs by block."""
    out, got = law.with_jacobian(z, gain)
    np.testing.assert_allclose(out, law(z, gain), rtol=1e-12, atol=1e-13)
    expected = jacobian(lambda z: law(z, gain), z)
    for name, columns in BLOCKS.items():
        for rows in (slice(0, 8), slice(8, 14)):
            largest = np.abs(expected[rows, columns]).max()
            difference = np.abs(got[rows, columns] - expected[rows, columns]).max()
            rounding = 1e-11 * np.abs(out[rows]).max()
            assert difference <= 1e-7 * largest + rounding, (name, rows, difference, largest)


@pytest.mark.parametrize(
    "options",
    [
        {"cable_model": "ECM"},
        {"cable_model": "ECM", "order": 3, "model_drum_run": True},
        {"cable_model": "CMWE"},
        {"cable_model": "SCMWE"},
        {"cable_model": "SCMWE", "model_drum_run": True},
        {"cable_model": "SLSM"},
        {"cable_model": "SLSM", "model_drum_run": True},
        {"cable_model": "SCMWE", "max_speed": 0.03},
        {"cable_model": "SCMWE", "max_angular_speed": 0.03},
        {"cable_model": "SCMWE", "max_speed": 50.0, "max_angular_speed": 50.0},
    ],
    ids=lambda options: "-".join(str(value) for value in options.values()),
)
def test_the_jacobian_for_all_settings(cogiro: CableRobot, options: dict) -> None:
    robot = tilted_target(cogiro)
    X, goal, H, alpha = random_case(robot, 6)
    twist = np.array([0.1, -0.2, 0.15, 0.3, 0.1, -0.2])
    law = servo.MotorRateLaw(robot, servo.ServoSettings(**options))
    check_law_jacobian(law, law_input(robot, X, goal, H, alpha, twist), 0.25)


@pytest.mark.parametrize("degrees", [0.0, 1e-4, 0.02, 1.2, 60.0, 120.0, 170.0])
@pytest.mark.parametrize("seed", range(3))
def test_the_jacobian_for_all_rotation_errors(
    cogiro: CableRobot, seed: int, degrees: float
) -> None:
    X, goal, H, alpha = random_case(cogiro, seed, math.radians(degrees))
    law = servo.MotorRateLaw(cogiro, servo.ServoSettings(cable_model="SLSM"))
    check_law_jacobian(law, law_input(cogiro, X, goal, H, alpha), 0.25)


def test_the_jacobian_with_a_stiffness_that_depends_on_tension(cogiro: CableRobot) -> None:
    stiffness = cogiro.cable.stiffness.replace(softening=4e7, offset=100.0)
    soft = cogiro.replace(cable=cogiro.cable.replace(stiffness=stiffness))
    X, goal, H, alpha = random_case(soft, 7)
    settings = servo.ServoSettings(cable_model="ECM", model_drum_run=True)
    law = servo.MotorRateLaw(soft, settings)
    check_law_jacobian(law, law_input(soft, X, goal, H, alpha), 0.25)


def test_the_logarithm_of_the_law_is_exact_in_all_its_branches() -> None:
    generator = np.random.default_rng(0)
    branches = set()
    for angle in (0.0, 1e-9, 1e-5, 1e-3, 0.5, 2.0, 2.6, 3.0, math.pi - 1e-7):
        for axis in [*np.eye(3), *-np.eye(3), *generator.normal(size=(4, 3))]:
            phi = angle * axis / np.linalg.norm(axis)
            out = np.zeros(3)
            R = exp_rotation(phi)
            kernel.rotation_log(R, out)
            np.testing.assert_allclose(out, phi, atol=1e-14 if angle < 3.1 else 1e-8)
            np.testing.assert_allclose(out, log_rotation(R), atol=1e-14)
            branches.add("trace" if np.trace(R) > 0 else int(np.argmax(np.diag(R))))
    assert branches == {"trace", 0, 1, 2}


@SEEDS
def test_the_pose_error_of_the_law_and_its_jacobian(cogiro: CableRobot, seed: int) -> None:
    robot = tilted_target(cogiro)
    X, goal, _, _ = random_case(robot, seed, 2.0)
    error = servo.PoseErrorMap(robot)
    z = np.concatenate([pose_to_vector(X), pose_to_vector(goal)])
    s, got = error.with_jacobian(z)
    expected = servo.pose_error(X, goal, robot.cameras.X_PM)
    np.testing.assert_allclose(s, expected, atol=1e-13)
    np.testing.assert_allclose(error(z), expected, atol=1e-13)
    assert relative_error(got, jacobian(error, z)) < 1e-10


def test_the_solver_for_symmetric_matrices() -> None:
    generator = np.random.default_rng(1)
    A = generator.normal(size=(6, 8))
    G, b = A @ A.T, generator.normal(size=6)
    x = b.copy()
    assert kernel.solve_symmetric(G.copy(), x)
    np.testing.assert_allclose(x, np.linalg.solve(G, b), rtol=1e-11)
    singular = A.copy()
    singular[5] = singular[0] - 2.0 * singular[3]
    assert not kernel.solve_symmetric(singular @ singular.T, b.copy())


# --- robots that cannot be controlled


def test_the_law_refuses_robots_it_cannot_control(cogiro: CableRobot) -> None:
    one_point = cogiro.replace(attachment_points=np.tile([0.0, 0.0, 1.0], (8, 1)))
    for robot in (few_cables(cogiro, 3), few_cables(cogiro, 5), one_point):
        with pytest.raises(GeometryError, match="rank below 6"):
            servo.MotorRateLaw(robot, servo.ServoSettings())
    servo.check_controllable(cogiro)
    servo.check_controllable(few_cables(cogiro, 6))


def test_a_rank_deficient_pose_is_refused_when_it_is_met(cogiro: CableRobot) -> None:
    """All cables in vertical planes through one line: no torque about it at that pose only."""
    around = 2.0 * np.pi * np.arange(8) / 8.0
    ring = np.column_stack([np.cos(around), np.sin(around), np.zeros(8)])
    upper = [0.0, 0.0, 5.0] + 6.0 * ring
    lower = 0.5 * ring + np.outer(np.arange(8) % 2, [0.0, 0.0, 1.0])
    robot = cogiro.replace(drawing_points=upper, attachment_points=lower)
    law = servo.MotorRateLaw(robot, servo.ServoSettings())
    X = RigidTransform([0.0, 0.0, 1.0])
    z = law_input(robot, X, RigidTransform([0.1, 0.0, 1.0]), np.full(8, 300.0), np.full(8, -0.5))
    with pytest.raises(GeometryError, match="measured pose"):
        law(z, 0.1)
    with pytest.raises(GeometryError, match="measured pose"):
        law.with_jacobian(z, 0.1)


def test_lengths_of_the_law_follow_the_exact_cable(cogiro: CableRobot) -> None:
    """The ECM's rates, the run's stretch in them, are those of the robot's own lengths at rest."""
    X = RigidTransform([0.3, -0.2, 1.0])
    rest = rest_state(cogiro, X)
    g = kinematics.cable_geometry(cogiro, X)
    H = rest.chord_tension * g.Bx / g.L
    twist = np.array([0.02, -0.03, 0.05, 0.1, 0.2, 0.3])

    def lengths(t: float) -> np.ndarray:
        Y = moved(X, twist, t)
        there = kinematics.cable_geometry(cogiro, Y)
        now = H + t * (statics.D_s(cogiro, X, H) @ twist)
        w, EA = cogiro.weight_per_metre, cogiro.cable.stiffness.asymptote
        from cdpr_drake.model.kernels.catenary import irvine_from_horizontal

        spans = np.zeros(8)
        for i in range(8):
            V_B, l0, status = irvine_from_horizontal(there.Bx[i], there.Bz[i], now[i], w, EA)
            assert status == 0
            T_A = np.hypot(now[i], V_B - w * l0)
            spans[i] = l0 + cogiro.cable.drum_run[i] / (1.0 + T_A / EA)
        return spans

    rates = servo.D_a(cogiro, X, H, "ECM", model_drum_run=True) @ twist
    assert relative_error(rates, derivative(lengths)) < 1e-6
