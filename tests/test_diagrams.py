"""Diagrams of robot and control: ports, rest, latency, noise, derivatives, limits."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from samples import moved, random_pose, random_robot, relative_error, rotation
from system_checks import (
    check_derivatives,
    documented_ports,
    feedthrough,
    input_sizes,
    output_sizes,
)
from test_servo import few_cables
from test_systems import misplaced

from cdpr_drake import diagrams
from cdpr_drake.diagrams import (
    make_cable_robot,
    make_joint_space_control,
    make_platform,
    make_simulator,
    make_vision_based_control,
    platform_pose,
    rest_context,
    robot_of,
    set_at_rest,
    simulate,
)
from cdpr_drake.diagrams.timing import Timing
from cdpr_drake.diagrams.watch import LimitWatch
from cdpr_drake.errors import CableError, CdprError, GeometryError, SimulationError
from cdpr_drake.model.equilibrium import forward_kinematics, rest_state
from cdpr_drake.model.inverse_kinematics import InverseKinematics
from cdpr_drake.model.kernels import is_compiled
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import pose_to_vector
from cdpr_drake.model.servo import ServoSettings, pose_error
from cdpr_drake.systems import ExponentialApproach, PositionBasedVisualServo

T = 0.05
LATENCIES = [0.0, 0.04, 0.05, 0.06, 0.1, 0.13]
X_REST = RigidTransform(rotation([0.05, -0.03, 0.1]), [0.4, -0.3, 1.0])
REST_TIME = 5.0 if is_compiled() else 1.0  # uncompiled runs take ten times as long

LOOPS: dict[str, Callable[[CableRobot], Diagram]] = {
    "cable_robot": lambda r: make_cable_robot(r),
    "joint_space": lambda r: make_joint_space_control(r),
    "continuous": lambda r: make_vision_based_control(r, sample_time=None),
    **{
        f"latency {1000 * latency:g} ms": lambda r, latency=latency: make_vision_based_control(
            r, sample_time=T, latency=latency
        )
        for latency in LATENCIES
    },
}
EACH_LOOP = pytest.mark.parametrize("loop", LOOPS)


def output(diagram: Diagram, context: Context, name: str) -> np.ndarray:
    return np.array(diagram.GetOutputPort(name).Eval(context))


def block_named(diagram: Diagram, name: str) -> Any:
    """Return a block, wherever it is."""
    return next(system for path, system in diagrams.blocks(diagram) if path[-1] == name)


def block_output(diagram: Diagram, context: Context, block: str, port: str) -> np.ndarray:
    """Return an output of a block of a diagram."""
    system = block_named(diagram, block)
    return np.array(system.GetOutputPort(port).Eval(system.GetMyContextFromRoot(context)))


def unrest(diagram: Diagram, context: Context) -> float:
    """Return the largest acceleration: of the platform over g, of the winches over what holds them.

    Filters and integrators by the change in a second over their largest value. The winches'
    integral counts only where it has a gain.
    """
    worst = 0.0
    robot = robot_of(diagram)
    derivatives = diagram.EvalTimeDerivatives(context)
    for path, system in diagrams.blocks(diagram):
        size = system.GetMyContextFromRoot(context).num_continuous_states()
        if not size:
            continue
        own = diagram_derivatives(system, context)
        if path[-1] == "platform":
            worst = max(worst, np.abs(own).max() / robot.gravity)
        elif path[-1] == "winches":
            hold = robot.winch.transmission * output(diagram, context, "tension_at_drawing_point")
            own = own if robot.winch.integral_gain > 0.0 else own[: 2 * robot.num_cables]
            worst = max(worst, np.abs(own).max() / (hold.max() / robot.winch.inertia))
        else:
            state = system.GetMyContextFromRoot(context).get_continuous_state_vector()
            worst = max(worst, np.abs(own).max() / np.abs(state.CopyToVector()).max())
    assert np.all(np.isfinite(derivatives.CopyToVector()))
    return float(worst)


def diagram_derivatives(system: Any, context: Context) -> np.ndarray:
    return system.EvalTimeDerivatives(system.GetMyContextFromRoot(context)).CopyToVector()


# --- ports

ROBOT_SIZES = {
    "pose": 6,
    "platform_state": 12,
    "tension_at_winch": 8,
    "tension_at_drawing_point": 8,
    "tension_at_attachment_point": 8,
    "tangents_at_drawing_point": 24,
    "tangents_at_attachment_point": 24,
    "dbeta": 8,
    "unstrained_length": 8,
    "motor_angles": 8,
    "motor_rates": 8,
    "motor_torques": 8,
    "platform_acceleration": 6,
}
VBC_SIZES = {
    "pose_error_seen": 6,
    "pose_error": 6,
    "measured_pose": 6,
    "measured_tangents": 24,
    "measured_tension": 8,
    "cell_health": 8,
    "commanded_motor_rates": 8,
    "desired_motor_angles": 8,
} | ROBOT_SIZES
FACTORIES = {
    "make_cable_robot": (
        LOOPS["cable_robot"],
        {"desired_motor_angles": 8, "external_wrench": 6},
        ROBOT_SIZES,
        {"external_wrench"},
    ),
    "make_joint_space_control": (
        LOOPS["joint_space"],
        {"desired_pose": 6, "external_wrench": 6},
        {"pose_error": 6, "desired_motor_angles": 8} | ROBOT_SIZES,
        {"external_wrench"},
    ),
    "make_vision_based_control": (
        LOOPS["latency 40 ms"],
        {
            "desired_pose": 6,
            "desired_twist": 6,
            "external_wrench": 6,
            "pose_noise": 6,
            "tangent_noise": 24,
            "tension_noise": 8,
        },
        VBC_SIZES,
        {"desired_twist", "external_wrench", "pose_noise", "tangent_noise", "tension_noise"},
    ),
}


@pytest.mark.parametrize("name", FACTORIES)
def test_ports_are_those_documented(cogiro: CableRobot, name: str) -> None:
    make, inputs, outputs, optional = FACTORIES[name]
    diagram = make(cogiro)
    assert input_sizes(diagram) == inputs
    assert output_sizes(diagram) == outputs
    expand = {"those of make_cable_robot": list(ROBOT_SIZES)}
    documented, documented_inputs, documented_outputs = documented_ports(
        getattr(diagrams, name), expand
    )
    assert documented == diagram.get_name() == name.removeprefix("make_")
    assert set(documented_inputs) == set(inputs)
    assert set(documented_outputs) == set(outputs)
    # The remark may follow the last name of a line.
    open_lines = [p for p, remark in documented_inputs.items() if "may stay open" in remark]
    assert set(open_lines) <= optional
    # Those that may stay open do, the others do not.
    context = rest_context(diagram, X_REST)
    for port in outputs:
        assert np.all(np.isfinite(output(diagram, context, port)))
    (needed,) = set(inputs) - optional
    assert needed in ("desired_motor_angles", "desired_pose")
    bare = diagram.CreateDefaultContext()
    bare.SetTimeStateAndParametersFrom(context)
    port = "motor_torques" if needed == "desired_motor_angles" else "pose_error"
    with pytest.raises((RuntimeError, ValueError), match="not connected"):
        output(diagram, bare, port)


@pytest.mark.parametrize(
    ("loop", "blocks"),
    [
        ("cable_robot", {"platform", "cables", "winches", "transmission"}),
        ("joint_space", {"robot", "inverse_kinematics", "true_error"}),
        (
            "continuous",
            {
                "robot",
                "camera",
                "tangent_cameras",
                "servo",
                "plausible_tension",
                "true_error",
            },
        ),
        (
            "latency 40 ms",
            {"sampled_pose", "sampled_tangents", "sampled_tension", "held_rates", "servo"},
        ),
    ],
)
def test_blocks_have_the_documented_names(cogiro: CableRobot, loop: str, blocks: set[str]) -> None:
    assert all(LOOPS[loop](cogiro).HasSubsystemNamed(block) for block in blocks)


def test_the_feedthrough_of_the_diagrams(cogiro: CableRobot) -> None:
    pushed = {("external_wrench", "platform_acceleration")}
    assert feedthrough(LOOPS["cable_robot"](cogiro)) == pushed | {
        ("desired_motor_angles", "motor_torques")
    }
    assert feedthrough(LOOPS["joint_space"](cogiro)) == pushed | {
        ("desired_pose", "pose_error"),
        ("desired_pose", "desired_motor_angles"),
        ("desired_pose", "motor_torques"),
    }
    sampled = pushed | {
        ("desired_pose", "pose_error"),
        ("desired_pose", "pose_error_seen"),
    }
    assert feedthrough(LOOPS["latency 40 ms"](cogiro)) == sampled
    seen = {
        ("pose_noise", "measured_pose"),
        ("pose_noise", "pose_error_seen"),
        ("pose_noise", "cell_health"),
        ("tangent_noise", "measured_tangents"),
    }
    assert feedthrough(LOOPS["latency 0 ms"](cogiro)) == sampled | seen
    rates = {
        (port, "commanded_motor_rates")
        for port in ("desired_pose", "desired_twist", "pose_noise", "tangent_noise")
    }
    assert feedthrough(LOOPS["continuous"](cogiro)) == sampled | seen | rates


def test_capstan_friction_separates_the_winch_s_tension(cogiro: CableRobot) -> None:
    rough = cogiro.replace(winch=cogiro.winch.replace(capstan_exponent=0.2))
    diagram = make_cable_robot(rough)
    context = rest_context(diagram, X_REST)
    winches = diagram.GetSubsystemByName("winches")
    own = winches.GetMyMutableContextFromRoot(context)
    state = own.get_continuous_state_vector().CopyToVector()
    T_A = output(diagram, context, "tension_at_drawing_point")
    np.testing.assert_array_equal(output(diagram, context, "tension_at_winch"), T_A)
    state[8:16] = -1.0  # reeling in
    own.SetContinuousState(state)
    T_A = output(diagram, context, "tension_at_drawing_point")
    np.testing.assert_allclose(
        output(diagram, context, "tension_at_winch"), T_A * np.exp(0.2), rtol=1e-6
    )


# --- the platform


def test_the_plant_has_the_robot_s_inertia(cogiro: CableRobot) -> None:
    robot = cogiro.with_payload(110.0, center_of_mass=[0.1, -0.2, 0.3])
    plant = make_platform(robot)
    context = plant.CreateDefaultContext()
    state = np.concatenate([pose_to_vector(X_REST), [0.1, -0.2, 0.3, 0.4, 0.5, -0.6]])
    plant.SetPositionsAndVelocities(context, state)
    body = plant.GetBodyByName("platform")
    assert plant.EvalBodyPoseInWorld(context, body).IsNearlyEqualTo(X_REST, 1e-14)
    inertia = body.CalcSpatialInertiaInBodyFrame(context)
    assert inertia.get_mass() == pytest.approx(210.0)
    np.testing.assert_allclose(inertia.get_com(), robot.center_of_mass, atol=1e-14)
    central = inertia.Shift(robot.center_of_mass).CalcRotationalInertia().CopyToFullMatrix3()
    np.testing.assert_allclose(central, robot.inertia, rtol=1e-12)
    # Newton and Euler at the centre of mass, for a wrench [torque; force] at P's origin in W.
    wrench = np.array([30.0, -20.0, 10.0, 100.0, -200.0, 300.0])
    plant.get_applied_generalized_force_input_port().FixValue(context, wrench)
    acceleration = plant.get_generalized_acceleration_output_port().Eval(context)
    R, omega, alpha = X_REST.rotation().matrix(), state[6:9], acceleration[:3]
    G = R @ robot.center_of_mass
    a_G = acceleration[3:] + np.cross(alpha, G) + np.cross(omega, np.cross(omega, G))
    weight = np.array([0.0, 0.0, -210.0 * 9.81])
    np.testing.assert_allclose(robot.mass * a_G, wrench[3:] + weight, rtol=1e-10)
    inertia_W = R @ robot.inertia @ R.T
    torque = inertia_W @ alpha + np.cross(omega, inertia_W @ omega)
    np.testing.assert_allclose(torque, wrench[:3] - np.cross(G, wrench[3:]), rtol=1e-10)


# --- rest


@EACH_LOOP
def test_rest_stays_put(cogiro: CableRobot, loop: str) -> None:
    robot = cogiro.with_payload(50.0)
    diagram = LOOPS[loop](robot)
    context = rest_context(diagram, X_REST)
    start = platform_pose(diagram, context)
    if loop != "joint_space":
        assert start.IsNearlyEqualTo(X_REST, 1e-14)
    assert unrest(diagram, context) < 1e-9
    run = simulate(diagram, context, REST_TIME, record=["pose"], every=REST_TIME / 4)
    assert np.abs(run["pose"] - run["pose"][0]).max() < 1e-9
    assert not run.slack_cables


@pytest.mark.parametrize("tensions", ["minimum norm", "within limits"])
@pytest.mark.parametrize("seed", range(2))
def test_rest_holds_the_robot_s_rest_state(cogiro: CableRobot, seed: int, tensions: str) -> None:
    X = random_pose(np.random.default_rng(seed))
    diagram = LOOPS["latency 40 ms"](cogiro)
    context = rest_context(diagram, X, tensions)
    rest = rest_state(cogiro, X, tensions)
    T_A = rest.tension_at_drawing_point
    np.testing.assert_allclose(output(diagram, context, "tension_at_drawing_point"), T_A, rtol=1e-9)
    np.testing.assert_allclose(output(diagram, context, "measured_tension"), T_A, rtol=1e-9)
    np.testing.assert_allclose(output(diagram, context, "measured_pose"), pose_to_vector(X))
    length = output(diagram, context, "unstrained_length")
    np.testing.assert_allclose(length, rest.unstrained_length, rtol=1e-14)
    np.testing.assert_allclose(output(diagram, context, "motor_torques"), -0.0225 * T_A, rtol=1e-9)
    np.testing.assert_array_equal(output(diagram, context, "commanded_motor_rates"), 0.0)
    assert unrest(diagram, context) < 1e-9


@pytest.mark.parametrize(
    "fields",
    [
        {"integral_gain": 0.0},
        {"encoder_zero_length": np.arange(8.0)},
        {"capstan_exponent": 0.2, "coulomb_torque": 0.5, "damping": 0.3},
    ],
    ids=["no integral", "encoder zero", "friction"],
)
def test_rest_with_other_winches(cogiro: CableRobot, fields: dict[str, Any]) -> None:
    robot = cogiro.replace(winch=cogiro.winch.replace(**fields))
    diagram = LOOPS["latency 40 ms"](robot)
    context = rest_context(diagram, X_REST)
    assert unrest(diagram, context) < 1e-9


def test_rest_with_a_wrong_calibration(cogiro: CableRobot) -> None:
    """The robot rests where it is; what is measured is off, but steady."""
    believed = misplaced(cogiro)
    diagram = make_vision_based_control(cogiro, latency=0.1, believed=believed)
    context = rest_context(diagram, X_REST)
    assert platform_pose(diagram, context).IsNearlyEqualTo(X_REST, 1e-14)
    now = block_output(diagram, context, "load_cells", "measured_tension")
    cells = believed.load_cells
    T_A = output(diagram, context, "tension_at_drawing_point")
    np.testing.assert_allclose(now, (T_A - cells.bias) / cells.gain, rtol=1e-9)
    for signal, block in (("pose", "camera"), ("tension", "load_cells")):
        held = output(diagram, context, f"measured_{signal}")
        np.testing.assert_array_equal(
            held, block_output(diagram, context, block, f"measured_{signal}")
        )
    assert unrest(diagram, context) < 1e-9


def test_joint_space_control_rests_where_its_lengths_put_it(cogiro: CableRobot) -> None:
    """Not where it believes: its unstretched lengths leave the platform low."""
    diagram = LOOPS["joint_space"](cogiro)
    context = rest_context(diagram, X_REST)
    lengths = InverseKinematics(cogiro).lengths(X_REST)
    np.testing.assert_allclose(output(diagram, context, "unstrained_length"), lengths, rtol=1e-12)
    expected = forward_kinematics(cogiro, lengths, X_REST).X_WP
    assert platform_pose(diagram, context).IsNearlyEqualTo(expected, 1e-12)
    low = X_REST.translation()[2] - expected.translation()[2]
    assert 0.02 < low < 0.06
    s = output(diagram, context, "pose_error")
    np.testing.assert_allclose(s, pose_error(expected, X_REST, cogiro.cameras.X_PM), atol=1e-12)


def test_an_external_wrench_counts_like_a_payload(cogiro: CableRobot) -> None:
    """The rest state of a robot with a point load is one of the bare robot with its weight."""
    arm = np.array([0.2, -0.3, 0.4])
    loaded = cogiro.replace(
        payload=cogiro.payload.replace(mass=30.0, center_of_mass=arm, inertia=np.zeros((3, 3)))
    )
    weight = np.array([0.0, 0.0, -30.0 * cogiro.gravity])
    wrench = np.concatenate([np.cross(X_REST.rotation() @ arm, weight), weight])
    rest = rest_state(loaded, X_REST)
    for loop in ("cable_robot", "joint_space", "continuous", "latency 40 ms"):
        diagram = LOOPS[loop](cogiro)
        context = rest_context(diagram, X_REST)
        set_at_rest(diagram, context, rest)
        platform = next(s for p, s in diagrams.blocks(diagram) if p[-1] == "platform")
        acceleration = diagram_derivatives(platform, context)[6:]
        assert np.abs(acceleration).max() > 1.0
        diagram.GetInputPort("external_wrench").FixValue(context, wrench)
        assert np.abs(diagram_derivatives(platform, context)).max() < 1e-9 * cogiro.gravity


def test_an_external_wrench_moves_the_platform_to_the_loaded_equilibrium(
    cogiro: CableRobot,
) -> None:
    """Under a step of weight the platform settles where forward kinematics says."""
    # Winches that hold still, so that the lengths stay.
    stiff = cogiro.winch.replace(proportional_gain=5e3, integral_gain=5e4, derivative_gain=20.0)
    damped = cogiro.replace(winch=stiff, cable=cogiro.cable.replace(damping_time=0.02))
    diagram = make_cable_robot(damped)
    context = rest_context(diagram, X_REST)
    lengths = output(diagram, context, "unstrained_length")
    diagram.GetInputPort("external_wrench").FixValue(context, [0, 0, 0, 0, 0, -300.0])
    run = simulate(diagram, context, 2.0, record=["pose"], max_step=0.002)
    load = cogiro.payload.replace(mass=300.0 / cogiro.gravity, center_of_mass=np.zeros(3))
    expected = forward_kinematics(damped.replace(payload=load), lengths, X_REST).X_WP
    moved_by = expected.translation()[2] - X_REST.translation()[2]
    assert -0.05 < moved_by < -0.003
    np.testing.assert_allclose(run["pose"][-1], pose_to_vector(expected), atol=1e-5)


# --- sampling


def frames_of(latency: float) -> tuple[int, float]:
    return Timing(sample_time=T, latency=latency).split()


@pytest.mark.parametrize("latency", LATENCIES)
def test_an_image_changes_the_rates_after_the_latency(cogiro: CableRobot, latency: float) -> None:
    """The platform is displaced between two frames, and from then on every image counts once.

    The rates that are commanded from k T + latency to (k + 1) T + latency are, bit by bit, those of
    the law for what was measured at k T.
    """
    diagram = make_vision_based_control(
        cogiro, gain=0.5, sample_time=T, latency=latency, ramp_time=0.0
    )
    context = rest_context(diagram, X_REST)
    servo = PositionBasedVisualServo(cogiro, diagram.GetSubsystemByName("servo").settings)
    law = servo.CreateDefaultContext()
    servo.GetInputPort("desired_pose").FixValue(law, pose_to_vector(X_REST))
    blocks = {"pose": "camera", "tangents": "tangent_cameras", "tension": "load_cells"}

    def rates_of_now() -> np.ndarray:
        for name, block in blocks.items():
            value = block_output(diagram, context, block, f"measured_{name}")
            servo.GetInputPort(f"measured_{name}").FixValue(law, value)
        return np.array(servo.GetOutputPort("motor_rates").Eval(law))

    simulator = make_simulator(diagram, context, max_step=0.005)
    at_rest = rates_of_now()
    assert np.abs(at_rest).max() < 1e-9
    push, last, instant = 0.12, 12, 1e-6
    frame_times = {k: k * T for k in range(last)}
    looks = [(k, k * T + latency + sign * instant) for k in range(-3, last - 1) for sign in (-1, 1)]
    stops = sorted({push, *frame_times.values(), *(t for _, t in looks if 0.0 < t < last * T)})
    expected: dict[int, np.ndarray] = {}
    commanded: dict[float, np.ndarray] = {}
    for t in stops:
        simulator.AdvanceTo(t)
        for k, frame in frame_times.items():
            if frame == t:
                expected[k] = rates_of_now()
        commanded[t] = output(diagram, context, "commanded_motor_rates")
        if t == push:
            plant = diagram.GetSubsystemByName("robot").GetSubsystemByName("platform")
            own = plant.GetMyMutableContextFromRoot(context)
            shift = np.array([0, 0, 0, 0.01, -0.01, 0.01])
            plant.SetPositions(own, plant.GetPositions(own) + shift)
    first = math.ceil(push / T)
    assert np.abs(expected[first]).max() > 0.1
    checked = 0
    for k, t in looks:
        if t not in commanded:
            continue
        before = t < k * T + latency
        image = k - 1 if before else k
        if image >= 0:
            message = f"image {image} at {t} s"
            np.testing.assert_array_equal(commanded[t], expected[image], err_msg=message)
        checked += image >= first
        if image < first:
            assert np.abs(commanded[t]).max() < 1e-9
    assert checked >= 6


@pytest.mark.parametrize(
    ("sample_time", "latency", "expected"),
    [
        (0.05, 0.0, (0, 0.0)),
        (0.05, 0.04, (0, 0.04)),
        (0.05, 0.05, (1, 0.0)),
        (0.05, 0.15, (3, 0.0)),  # 0.15 / 0.05 is 2.9999999999999996
        (0.1, 0.3, (3, 0.0)),  # and 0.3 / 0.1 too
        (0.05, 0.13, (2, 0.03)),
        (0.02, 0.05, (2, 0.01)),
    ],
)
def test_latencies_split_into_frames_and_a_rest(
    sample_time: float, latency: float, expected: tuple[int, float]
) -> None:
    frames, phase = Timing(sample_time=sample_time, latency=latency).split()
    assert frames == expected[0]
    assert phase == pytest.approx(expected[1], abs=1e-12)
    assert 0.0 <= phase < sample_time


@pytest.mark.parametrize(
    ("gain", "sample_time", "latency", "message"),
    [
        (0.1, 0.0, 0.04, "sample time must be positive"),
        (0.1, -0.05, 0.04, "sample time must be positive"),
        (0.1, math.nan, 0.04, "sample time must be positive"),
        (0.1, math.inf, 0.04, "sample time must be positive"),
        (0.1, 0.05, -0.01, "latency must not be negative"),
        (0.1, 0.05, math.nan, "latency must not be negative"),
        (20.0, 0.05, 0.04, "must be below 1"),
    ],
)
def test_sampling_that_cannot_work_is_refused(
    cogiro: CableRobot, gain: float, sample_time: float, latency: float, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        make_vision_based_control(cogiro, gain=gain, sample_time=sample_time, latency=latency)
    assert make_vision_based_control(cogiro, gain=gain, sample_time=None)


def test_settings_come_from_the_keywords_or_the_law(cogiro: CableRobot) -> None:
    settings = ServoSettings(cable_model="CMWE", gain=0.3, ramp_time=4.0, model_drum_run=True)
    diagram = make_vision_based_control(cogiro, law=settings)
    assert diagram.GetSubsystemByName("servo").settings == settings
    diagram = make_vision_based_control(cogiro, "CMWE", 0.3, ramp_time=4.0, model_drum_run=True)
    assert diagram.GetSubsystemByName("servo").settings == settings
    with pytest.raises(ValueError, match="gain: the law says that"):
        make_vision_based_control(cogiro, gain=0.5, law=settings)
    with pytest.raises(TypeError):
        make_vision_based_control(cogiro, colour="red")
    with pytest.raises(
        ValueError, match="7 cables in the robot as it is believed, 8 in the true one"
    ):
        make_vision_based_control(cogiro, believed=few_cables(cogiro, 7))


# --- noise


def noisy_run(robot: CableRobot, seed: int | None, sample_time: float | None) -> dict:
    diagram = make_vision_based_control(robot, sample_time=sample_time, noise=True)
    context = rest_context(diagram, X_REST, seed=seed)
    names = ["pose", "measured_pose", "measured_tension", "commanded_motor_rates"]
    return simulate(diagram, context, 0.4, record=names).signals


@pytest.mark.parametrize("sample_time", [0.05, None])
def test_the_same_seed_gives_the_same_bits(cogiro: CableRobot, sample_time: float | None) -> None:
    first, again, other = (noisy_run(cogiro, seed, sample_time) for seed in (7, 7, 8))
    for name, value in first.items():
        np.testing.assert_array_equal(again[name], value)
        assert np.abs(other[name] - value).max() > 0.0
    spread = first["measured_pose"] - first["pose"]
    assert 1e-4 < spread[:, 3:].std() < 1e-2  # 1 mm asked for


def test_without_a_seed_noise_differs_from_run_to_run(cogiro: CableRobot) -> None:
    first, second = (noisy_run(cogiro, None, 0.05)["measured_pose"] for _ in range(2))
    assert np.abs(first - second).max() > 1e-4


def test_noise_has_the_robot_s_size_and_enters_by_the_exported_ports(cogiro: CableRobot) -> None:
    diagram = LOOPS["continuous"](cogiro)
    context = rest_context(diagram, X_REST)
    n = np.random.default_rng(0).normal(size=6)
    diagram.GetInputPort("pose_noise").FixValue(context, n)
    diagram.GetInputPort("tension_noise").FixValue(context, np.ones(8))
    diagram.GetInputPort("tangent_noise").FixValue(context, np.zeros(24))
    shift = output(diagram, context, "measured_pose")[3:] - X_REST.translation()
    # Noise is of M, half a metre above P: a turn shifts P too.
    R = X_REST.rotation().matrix()
    expected = R @ (1e-3 * n[3:] - np.cross(8.726646e-4 * n[:3], [0.0, 0.0, 0.5]))
    np.testing.assert_allclose(shift, expected, atol=2e-6)
    cells = diagram_derivatives(block_named(diagram, "load_cells"), context)
    np.testing.assert_allclose(cells, 2.0 * math.pi * 2.0 * 10.0, rtol=1e-6)


# --- references


def test_a_reference_feeds_what_it_has_and_the_rest_is_exported(cogiro: CableRobot) -> None:
    reference = ExponentialApproach(cogiro, X_REST, RigidTransform([0.0, 0.0, 1.5]))
    loop = make_vision_based_control(cogiro, reference=reference)
    expected = set(FACTORIES["make_vision_based_control"][1]) - {"desired_pose", "desired_twist"}
    assert set(input_sizes(loop)) == expected
    assert output_sizes(loop) == VBC_SIZES | {"desired_pose": 6}
    joint = make_joint_space_control(cogiro, reference=reference_like)
    assert set(input_sizes(joint)) == {"external_wrench"}
    context = rest_context(joint, X_REST)
    assert robot_of(joint) is cogiro
    np.testing.assert_allclose(output(joint, context, "desired_pose"), pose_to_vector(X_REST))


def reference_like(robot: CableRobot) -> ExponentialApproach:
    return ExponentialApproach(robot, X_REST, RigidTransform([0.0, 0.0, 1.5]))


def test_feed_forward_takes_the_lag_away(cogiro: CableRobot) -> None:
    """A law that follows a moving goal lags by its speed over the gain, unless told the speed."""
    goal = moved(X_REST, np.array([0.05, 0.0, 0.1, 0.6, 0.3, 0.5]), 1.0)

    def lag(feed_forward: bool) -> float:
        loop = make_vision_based_control(
            cogiro, "ECM", 0.5, model_drum_run=True, ramp_time=0.0, latency=0.0
        )
        reference = ExponentialApproach(cogiro, X_REST, goal, gain=0.4, ramp_time=1.0)
        builder = DiagramBuilder()
        builder.AddNamedSystem("loop", loop)
        builder.AddNamedSystem("reference", reference)
        names = ["desired_pose", "desired_twist"] if feed_forward else ["desired_pose"]
        for name in names:
            builder.Connect(reference.GetOutputPort(name), loop.GetInputPort(name))
        for name in ("pose", "pose_error", "tension_at_drawing_point"):
            builder.ExportOutput(loop.GetOutputPort(name), name)
        diagram = builder.Build()
        context = rest_context(diagram, X_REST)
        errors = simulate(diagram, context, 2.5, record=["pose_error"], every=0.25)["pose_error"]
        return float(np.linalg.norm(errors[:, 3:], axis=1).max())

    without, with_it = lag(False), lag(True)
    assert without > 0.15
    assert with_it < 0.1 * without


# --- derivatives of a whole loop


def all_inputs(diagram: Diagram, robot: CableRobot) -> dict[str, np.ndarray]:
    generator = np.random.default_rng(0)
    k = robot.num_cables
    values = {
        "desired_pose": pose_to_vector(moved(X_REST, np.array([0.1, 0, 0.2, 0.3, 0.2, 0.4]), 1.0)),
        "desired_twist": np.array([0.01, 0.02, -0.03, 0.1, -0.2, 0.05]),
        "external_wrench": np.array([5.0, -4.0, 3.0, 20.0, 30.0, -40.0]),
        "pose_noise": generator.normal(size=6),
        "tangent_noise": generator.normal(size=3 * k),
        "tension_noise": generator.normal(size=k),
    }
    names = input_sizes(diagram)
    return {name: value for name, value in values.items() if name in names}


@pytest.mark.parametrize("loop", ["cable_robot", "joint_space", "continuous"])
def test_derivatives_of_the_whole_loop(cogiro: CableRobot, loop: str) -> None:
    """Derivatives and outputs with respect to all states and inputs, off equilibrium."""
    make = {
        "continuous": lambda r: make_vision_based_control(
            r, "ECM", 0.5, sample_time=None, ramp_time=0.0, believed=misplaced(r)
        )
    }.get(loop, LOOPS[loop])
    diagram = make(cogiro)
    inputs = all_inputs(diagram, cogiro)
    context = rest_context(diagram, X_REST)
    if loop == "cable_robot":
        winches = diagram.GetSubsystemByName("winches")
        own = winches.GetMyContextFromRoot(context).get_continuous_state_vector()
        inputs["desired_motor_angles"] = own.CopyToVector()[:8] + 0.01
    state = context.get_continuous_state_vector().CopyToVector()
    generator = np.random.default_rng(1)
    state = state + 1e-3 * generator.uniform(-1.0, 1.0, state.size)
    check_derivatives(diagram, inputs, state, steps={"state": 1e-4})


def test_conversion_keeps_a_loop_at_rest(cogiro: CableRobot) -> None:
    diagram = LOOPS["continuous"](cogiro)
    back = diagram.ToAutoDiffXd().ToScalarType[float]()
    assert input_sizes(back) == input_sizes(diagram)
    assert output_sizes(back) == output_sizes(diagram)
    assert unrest(back, rest_context(back, X_REST)) < 1e-9


# --- any number of cables


@pytest.mark.parametrize("k", [6, 7, 10])
def test_any_number_of_cables(cogiro: CableRobot, k: int) -> None:
    robot, pose = random_robot(cogiro, k, seed=0)
    for diagram in (
        make_cable_robot(robot),
        make_joint_space_control(robot, cable_model="ECM"),
        make_vision_based_control(robot),
        make_vision_based_control(robot, sample_time=None),
    ):
        assert output_sizes(diagram)["tension_at_winch"] == k
        context = rest_context(diagram, pose)
        assert unrest(diagram, context) < 1e-9
    loop = make_vision_based_control(robot, "ECM", 1.0, ramp_time=0.0)
    context = rest_context(loop, pose)
    goal = pose + np.array([0.01, 0.0, 0.02, 0.02, -0.03, 0.03])
    loop.GetInputPort("desired_pose").FixValue(context, goal)
    errors = np.abs(simulate(loop, context, 2.0, record=["pose_error"])["pose_error"]).sum(axis=1)
    assert errors[-1] < 0.3 * errors[0]


def test_three_cables_hang_but_cannot_be_controlled(cogiro: CableRobot) -> None:
    three = few_cables(cogiro, [0, 2, 5])
    length = np.array([9.0, 9.0, 9.5]) + three.cable.drum_run
    rest = forward_kinematics(three, length, RigidTransform([-2.0, 0.0, 1.0]))
    diagram = make_cable_robot(three)
    context = diagram.CreateDefaultContext()
    set_at_rest(diagram, context, rest)
    assert unrest(diagram, context) < 1e-9
    run = simulate(diagram, context, 1.0, record=["pose"])
    assert np.abs(run["pose"] - run["pose"][0]).max() < 1e-6
    with pytest.raises(GeometryError, match="rank below 6"):
        make_vision_based_control(three)
    with pytest.raises(GeometryError, match="rank below 6"):
        rest_context(diagram, RigidTransform([0, 0, 1.0]))


# --- simulation and its limits


def test_a_record_has_what_was_asked_for(cogiro: CableRobot) -> None:
    diagram = LOOPS["latency 40 ms"](cogiro)
    context = rest_context(diagram, X_REST)
    seen: list[float] = []
    run = simulate(
        diagram, context, 0.53, record=["pose", "dbeta"], every=0.1, progress=seen.append
    )
    np.testing.assert_allclose(run.time, [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.53], atol=1e-12)
    assert seen == list(run.time)
    assert {name: value.shape for name, value in run.signals.items()} == {
        "pose": (7, 6),
        "dbeta": (7, 8),
    }
    assert run.context is context and context.get_time() == pytest.approx(0.53)
    assert run.real_time_factor > 0.0
    more = simulate(diagram, context, 0.6)
    assert more.time[0] == pytest.approx(0.53)
    assert "pose_error" in more.signals and "desired_pose" not in more.signals
    for until, every in ((math.nan, 0.1), (math.inf, 0.1), (1.0, 0.0), (1.0, math.nan)):
        with pytest.raises(ValueError, match="finite end and a positive period"):
            simulate(diagram, context, until, every=every)


def test_error_control_and_fixed_steps_agree(cogiro: CableRobot) -> None:
    ends = []
    for options in ({"max_step": 0.002}, {"accuracy": 1e-6}):
        diagram = LOOPS["latency 40 ms"](cogiro)
        context = rest_context(diagram, X_REST)
        diagram.GetInputPort("external_wrench").FixValue(context, [0, 0, 0, 50.0, 0, -100.0])
        ends.append(simulate(diagram, context, 0.15, record=["pose"], **options)["pose"][-1])
    assert np.abs(ends[0] - pose_to_vector(X_REST)).max() > 1e-3
    np.testing.assert_allclose(*ends, atol=2e-6)


def test_leaving_the_workspace_ends_the_run(cogiro: CableRobot) -> None:
    diagram = make_cable_robot(cogiro.replace(cable=cogiro.cable.replace(breaking_load=1e6)))
    context = rest_context(diagram, X_REST)
    diagram.GetInputPort("external_wrench").FixValue(context, [0, 0, 0, 0, 0, 2e4])
    with pytest.raises(SimulationError, match="outside the hull of the drawing points") as caught:
        simulate(diagram, context, 5.0)
    assert 0.0 < caught.value.time < 5.0


def test_a_breaking_cable_ends_the_run(cogiro: CableRobot) -> None:
    diagram = make_cable_robot(cogiro)
    context = rest_context(diagram, X_REST)
    diagram.GetInputPort("external_wrench").FixValue(context, [0, 0, 0, 0, 0, -3e4])
    with pytest.raises(CableError, match=r"cable \d at t = .* breaking load") as caught:
        simulate(diagram, context, 5.0)
    assert 0.0 < caught.value.time < 1.0


def test_slack_is_noted_with_cable_and_time(cogiro: CableRobot) -> None:
    diagram = make_cable_robot(cogiro)
    context = rest_context(diagram, X_REST)
    port = diagram.GetInputPort("desired_motor_angles")
    wanted = np.array(port.Eval(context))
    wanted[2] += 0.3 / 0.0225
    port.FixValue(context, wanted)
    run = simulate(diagram, context, 1.0, record=["tension_at_drawing_point"], every=0.05)
    assert 3 in run.slack_cables
    index = round(run.slack_cables[3] / 0.05)
    T_A = run["tension_at_drawing_point"][:, 2]
    weight = cogiro.weight_per_metre * 14.639  # of a cable as long as the frame
    assert T_A[index] < weight < T_A[index - 1]
    assert T_A[index:].min() > 1.0  # it bears itself


@pytest.mark.parametrize("loop", ["cable_robot", "joint_space", "continuous", "latency 40 ms"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")  # uncompiled, of infinities
def test_no_nan_enters_a_run(cogiro: CableRobot, loop: str, bad: float) -> None:
    diagram = LOOPS[loop](cogiro)
    for name, size in input_sizes(diagram).items():
        context = rest_context(diagram, X_REST)
        value = np.zeros(size)
        value[size // 2] = bad
        diagram.GetInputPort(name).FixValue(context, value)
        with pytest.raises((CableError, SimulationError), match="at t = "):
            simulate(diagram, context, 0.2)
        state = context.get_continuous_state_vector().CopyToVector()
        assert np.all(np.isfinite(state)), name


# --- the watch


@pytest.fixture(scope="module")
def watch(cogiro: CableRobot) -> LimitWatch:
    return LimitWatch(cogiro)


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        ([0, 1.5, 0, 0, 0, 1], r"platform pitch at t = 2 s: 85\.9 deg is within 5 deg of 90"),
        ([0, -1.6, 0, 0, 0, 1], "platform pitch"),
        ([0, 1.5 + 2.0 * math.pi, 0, 0, 0, 1], "platform pitch"),
        ([0, 0, 0, 7.5, 0, 1], r"\(7\.50, 0\.00, 1\.00\) m is outside"),
        ([0, 0, 0, 0, -5.4, 1], "outside the hull"),
        ([0, 0, 0, 7.26, 5.3, 1], "outside the hull"),
        ([0, 0, 0, 0, 0, 5.6], "outside the hull"),
        ([0, 0, 0, 0, math.nan, 1], "platform pose at t = 2 s: a value is not finite"),
        ([math.inf, 0, 0, 0, 0, 1], "not finite"),
    ],
)
def test_the_watch_stops_a_run_that_left(
    watch: LimitWatch, pose: list[float], message: str
) -> None:
    with pytest.raises(SimulationError, match=message):
        watch.check_pose(2.0, np.array(pose, float))


def test_the_watch_lets_a_run_be(watch: LimitWatch, cogiro: CableRobot) -> None:
    for pose in ([3.0, 1.4, 3.0, 0, 0, 1], [0, math.pi, 0, 7.0, 5.0, 5.4], [0, 0, 0, 0, 0, -1.0]):
        watch.check_pose(2.0, np.array(pose, float))
    few = LimitWatch(few_cables(cogiro, 2))  # on a line: no hull to stay within
    few.check_pose(2.0, np.array([0, 0, 0, 50.0, 50.0, 50.0]))


def test_the_watch_on_tensions(cogiro: CableRobot) -> None:
    watch = LimitWatch(cogiro)
    tension = np.full(8, 300.0)
    watch.check_tensions(1.0, tension)
    assert watch.slack == {}
    tension[3] = 9.1
    tension[4] = 9.3
    watch.check_tensions(2.0, tension)
    watch.check_tensions(3.0, tension)
    assert watch.slack == {4: 2.0}
    tension[5] = math.nan
    with pytest.raises(SimulationError, match="drawing point of cable 6 at t = 4 s"):
        watch.check_tensions(4.0, tension)


def test_errors_are_of_one_family() -> None:
    assert issubclass(SimulationError, CdprError) and issubclass(CableError, CdprError)


def test_attitudes_pass_through_the_diagram_unchanged(cogiro: CableRobot) -> None:
    X = RigidTransform(RollPitchYaw([0.2, -0.3, 0.4]), [0.1, 0.2, 1.0])
    diagram = make_cable_robot(cogiro)
    context = rest_context(diagram, X)
    np.testing.assert_allclose(output(diagram, context, "pose"), [0.2, -0.3, 0.4, 0.1, 0.2, 1.0])
    error = relative_error(output(diagram, context, "platform_state")[:6], pose_to_vector(X))
    assert error < 1e-14
