"""The sampled cameras as systems, outages, and loops closed on what cameras see."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, LeafSystem
from system_checks import (
    documented_ports,
    feedthrough,
    fixed_context,
    input_sizes,
    output_sizes,
)
from test_vision_tangents import angles, cables_at

from cdpr_drake.diagrams import TargetSensing, make_vision_based_control, rest_context, simulate
from cdpr_drake.diagrams.sensing import sensing_called
from cdpr_drake.errors import GeometryError, RobotFileError, SimulationError
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import pose_to_vector
from cdpr_drake.model.vision.outages import Outage
from cdpr_drake.runs.paper_tests import paper_test
from cdpr_drake.systems import (
    LoadCellFilter,
    StereoTangentCameras,
    TargetCameras,
)

X_WP = RigidTransform([0.3, -0.2, 1.0])
POSE = pose_to_vector(X_WP)


def unbiased(robot: CableRobot) -> CableRobot:
    return robot.replace(cameras=robot.cameras.replace(pixel_bias=0.0))


def outage(sensor: str, number: int | None = None, **times: Any) -> Outage:
    return Outage(sensor=sensor, number=number, **times)


def stereo_inputs(robot: CableRobot) -> dict[str, np.ndarray]:
    u, T = cables_at(robot, X_WP)
    return {
        "tangents": u.ravel(),
        "tension_at_drawing_point": T,
        "measured_pose": POSE,
        "measured_tension": T,
    }


def advance(system: LeafSystem, inputs: dict[str, np.ndarray], until: float) -> Any:
    """Simulate a system with fixed inputs, and return the context afterwards."""
    simulator = Simulator(system, fixed_context(system, inputs))
    simulator.Initialize()
    simulator.AdvanceTo(until)
    return simulator.get_context()


def outputs(system: LeafSystem, context: Any) -> dict[str, np.ndarray]:
    return {name: system.GetOutputPort(name).Eval(context) for name in output_sizes(system)}


# --- ports


def test_ports_and_documentation(cogiro: CableRobot) -> None:
    expected = {
        TargetCameras: (
            {"pose": 6, "noise": 120},
            {"measured_pose": 6, "noise_covariance": 36, "fixed_covariance": 36, "num_targets": 1}
            | {"num_cameras": 1, "age": 1, "frames_lost": 1, "images_lost": 1},
        ),
        StereoTangentCameras: (
            {"tangents": 24, "tension_at_drawing_point": 8, "measured_pose": 6}
            | {"measured_tension": 8, "noise": 640},
            {"measured_tangents": 24, "valid_tangents": 8, "curvature_bias": 8, "frames_lost": 8},
        ),
    }
    for cls, (inputs, results) in expected.items():
        system = cls(cogiro)
        assert (input_sizes(system), output_sizes(system)) == (inputs, results)
        name, documented_in, documented_out = documented_ports(cls, {})
        assert name == cls.__name__
        assert set(documented_in) == set(inputs) and set(documented_out) == set(results)
        assert [n for n, remark in documented_in.items() if remark == "optional"] == ["noise"]
        assert feedthrough(system) == set()


# --- the pose cameras


@pytest.mark.parametrize("estimator", ["joint", "mean"])
def test_the_pose_is_measured_at_each_sample(cogiro: CableRobot, estimator: str) -> None:
    system = TargetCameras(unbiased(cogiro), sample_time=0.1, estimator=estimator)
    for until, frames in ((0.0, 0), (0.05, 1), (0.35, 4)):
        got = outputs(system, advance(system, {"pose": POSE}, until))
        if frames:
            np.testing.assert_allclose(got["measured_pose"], POSE, atol=1e-8)
            assert got["num_targets"] == 20 and got["num_cameras"] == 3
        assert got["age"] == 0.0 and got["frames_lost"] == 0.0


def test_calibration_error_moves_the_measured_pose(cogiro: CableRobot) -> None:
    shift = RigidTransform([0.003, -0.002, 0.001])
    cameras = unbiased(cogiro).cameras
    believed = cogiro.replace(cameras=cameras.replace(X_WF=shift @ cameras.X_WF))
    system = TargetCameras(unbiased(cogiro), believed)
    got = outputs(system, advance(system, {"pose": POSE}, 0.01))
    expected = pose_to_vector(shift @ X_WP)
    np.testing.assert_allclose(got["measured_pose"], expected, atol=1e-8)


def test_noise_scatters_the_pose_by_its_covariance(cogiro: CableRobot) -> None:
    system = TargetCameras(unbiased(cogiro))
    generator = np.random.default_rng(0)
    squares = []
    for _ in range(50):
        inputs = {"pose": POSE, "noise": generator.standard_normal(120)}
        got = outputs(system, advance(system, inputs, 0.01))
        error = (got["measured_pose"] - POSE)[3:]
        covariance = got["noise_covariance"].reshape(6, 6)
        squares.append(error @ np.linalg.solve(covariance[3:, 3:], error))
    assert np.all(got["fixed_covariance"] == 0.0)
    assert abs(sum(squares) - 150.0) < 4.0 * np.sqrt(300.0)


def test_without_any_camera_the_last_pose_is_held_and_its_age_counted(cogiro: CableRobot) -> None:
    all_lost = outage("pose camera", start=0.2, end=0.4)
    system = TargetCameras(cogiro, sample_time=0.05, outages=(all_lost,))
    simulator = Simulator(system, fixed_context(system, {"pose": POSE}))
    context = simulator.get_mutable_context()
    simulator.AdvanceTo(0.19)
    before = outputs(system, context)
    system.GetInputPort("pose").FixValue(context, POSE + 0.01)
    simulator.AdvanceTo(0.37)
    held = outputs(system, context)
    np.testing.assert_array_equal(held["measured_pose"], before["measured_pose"])
    for part in ("noise_covariance", "fixed_covariance"):
        np.testing.assert_array_equal(held[part], before[part])
        assert np.trace(held[part].reshape(6, 6)) > 0.0
    assert held["num_targets"] == held["num_cameras"] == 0.0
    assert held["age"] == pytest.approx(0.2) and held["frames_lost"] == 4.0
    simulator.AdvanceTo(0.41)
    after = outputs(system, context)
    np.testing.assert_allclose(after["measured_pose"], POSE + 0.01, atol=5e-3)
    assert after["age"] == 0.0 and after["frames_lost"] == 4.0 and after["num_cameras"] == 3.0
    assert after["images_lost"] == 12.0


def test_one_lost_camera_is_not_counted(cogiro: CableRobot) -> None:
    system = TargetCameras(cogiro, outages=(outage("pose camera", 2),))
    got = outputs(system, advance(system, {"pose": POSE}, 0.01))
    assert got["num_cameras"] == 2.0 and got["num_targets"] == 15.0
    assert got["images_lost"] == 1.0 and got["frames_lost"] == 0.0
    with pytest.raises(ValueError, match="there is no pose camera 4 among 3"):
        TargetCameras(cogiro, outages=(outage("pose camera", 4),))


def test_a_platform_never_seen_ends_the_run(cogiro: CableRobot) -> None:
    system = TargetCameras(cogiro, outages=(outage("pose camera"),))
    with pytest.raises(SimulationError, match="measured pose at t = 0 s: no pose camera sees"):
        advance(system, {"pose": POSE}, 0.1)
    above = POSE + np.eye(6)[5] * 9.0
    context = fixed_context(system, {"pose": above})
    with pytest.raises(GeometryError, match="no pose camera sees a whole pattern"):
        system.settle(context)


def test_numbers_that_are_not_finite_are_refused(cogiro: CableRobot) -> None:
    system = TargetCameras(cogiro)
    with pytest.raises(SimulationError, match="not finite"):
        advance(system, {"pose": np.full(6, np.nan)}, 0.01)
    stereo = StereoTangentCameras(cogiro)
    for name in ("tangents", "measured_tension", "measured_pose"):
        inputs = stereo_inputs(cogiro)
        inputs[name] = np.full_like(inputs[name], np.inf)
        with pytest.raises(SimulationError, match="not finite"):
            advance(stereo, inputs, 0.01)


# --- the stereo pairs


def test_the_tangents_are_measured_at_each_sample(cogiro: CableRobot) -> None:
    system = StereoTangentCameras(cogiro)
    inputs = stereo_inputs(cogiro)
    got = outputs(system, advance(system, inputs, 0.01))
    u = inputs["tangents"].reshape(-1, 3)
    assert angles(got["measured_tangents"].reshape(-1, 3), u).max() < 1e-6
    assert got["valid_tangents"].all() and not got["frames_lost"].any()
    assert np.all(got["curvature_bias"] > 1e-4)


def test_a_lost_pair_holds_its_two_cables(cogiro: CableRobot) -> None:
    lost = outage("stereo pair", 2, start=0.1)
    system = StereoTangentCameras(cogiro, outages=(lost,))
    inputs = stereo_inputs(cogiro)
    simulator = Simulator(system, fixed_context(system, inputs))
    context = simulator.get_mutable_context()
    simulator.AdvanceTo(0.09)
    before = outputs(system, context)["measured_tangents"].reshape(-1, 3)
    u, _ = cables_at(cogiro, RigidTransform([0.6, -0.2, 1.0]))
    system.GetInputPort("tangents").FixValue(context, u.ravel())
    simulator.AdvanceTo(0.19)
    after = outputs(system, context)
    got = after["measured_tangents"].reshape(-1, 3)
    np.testing.assert_array_equal(got[2:4], before[2:4])
    others = [0, 1, 4, 5, 6, 7]
    assert angles(got, u)[others].max() < 1e-4
    np.testing.assert_array_equal(after["valid_tangents"], [1, 1, 0, 0, 1, 1, 1, 1])
    np.testing.assert_array_equal(after["frames_lost"], [0, 0, 2, 2, 0, 0, 0, 0])


def test_a_cable_never_seen_is_taken_for_straight(cogiro: CableRobot) -> None:
    system = StereoTangentCameras(cogiro, outages=(outage("stereo pair", 1),))
    got = outputs(system, advance(system, stereo_inputs(cogiro), 0.01))
    chords = np.array([X_WP @ p for p in cogiro.attachment_points]) - cogiro.drawing_points
    chords /= np.linalg.norm(chords, axis=1, keepdims=True)
    np.testing.assert_allclose(got["measured_tangents"].reshape(-1, 3)[:2], chords[:2])


# --- load cells


def cell_rate(system: Any, tension: np.ndarray, state: np.ndarray, time: float) -> np.ndarray:
    context = fixed_context(system, {"tension_at_winch": tension}, state)
    context.SetTime(time)
    return system.EvalTimeDerivatives(context).CopyToVector()


@pytest.mark.parametrize("order", [1, 2])
def test_a_stuck_cell_keeps_what_it_shows_and_a_dead_one_falls(
    cogiro: CableRobot, order: int
) -> None:
    robot = cogiro.replace(load_cells=cogiro.load_cells.replace(order=order, bias=20.0, gain=1.1))
    stuck = outage("load cell", 2, start=1.0, end=2.0)
    dead = outage("load cell", 5, start=1.0, end=2.0, reading=0.0)
    system, sound = LoadCellFilter(robot, outages=(stuck, dead)), LoadCellFilter(robot)
    T = np.linspace(300.0, 400.0, 8)
    state = np.linspace(100.0, 500.0, 8 * order)
    for time in (0.5, 2.0):
        np.testing.assert_array_equal(
            cell_rate(system, T, state, time), cell_rate(sound, T, state, time)
        )
    rate = cell_rate(system, T, state, 1.0).reshape(order, 8)
    expected = cell_rate(sound, T, state, 1.0).reshape(order, 8)
    others = [0, 2, 3, 5, 6, 7]
    np.testing.assert_array_equal(rate[:, others], expected[:, others])
    np.testing.assert_allclose(rate[:, 1], 0.0, atol=1e-9)
    falling = 2.0 * np.pi * 2.0 * ((0.0 - 20.0) / 1.1 - state[4])
    assert rate[0, 4] == pytest.approx(falling)
    with pytest.raises(ValueError, match="there is no load cell 9 among 8"):
        LoadCellFilter(cogiro, outages=(outage("load cell", 9),))


def test_vibration_has_its_amplitude_and_band(cogiro: CableRobot) -> None:
    cells = cogiro.load_cells.replace(vibration_amplitude=30.0, vibration_band=[3.0, 8.0])
    system = LoadCellFilter(cogiro.replace(load_cells=cells))
    T = np.full(8, 300.0)
    dt, n = 0.01, 4000
    rates = np.array([cell_rate(system, T, T, i * dt) for i in range(n)])
    vibration = rates / (2.0 * np.pi * 2.0)
    np.testing.assert_allclose(vibration.std(axis=0), 30.0 / np.sqrt(2.0), rtol=0.05)
    assert np.abs(vibration.mean(axis=0)).max() < 1.0
    power = np.abs(np.fft.rfft(vibration, axis=0)) ** 2
    frequency = np.fft.rfftfreq(n, dt)
    outside = (frequency < 2.8) | (frequency > 8.2)
    assert power[outside].sum() < 1e-2 * power.sum()
    correlation = np.corrcoef(vibration.T) - np.eye(8)
    assert np.abs(correlation).max() < 0.95


def test_an_outage_says_what_is_wrong_with_it() -> None:
    with pytest.raises(ValueError, match='unknown sensor "camera"'):
        Outage(sensor="camera")
    with pytest.raises(ValueError, match=r"must end after 2\.0 s"):
        Outage(sensor="load cell", start=2.0, end=1.0)
    with pytest.raises(ValueError, match="reading must be finite"):
        Outage(sensor="load cell", reading=np.nan)


# --- loops


def closed_loop(robot: CableRobot, gain: float = 0.3, **options: Any) -> tuple[Diagram, Any]:
    """Test 4 on targets, tangents and load cells, at rest at its start."""
    start, goal = paper_test(4).poses(robot)
    options = {"noise": True, "sensing": TargetSensing()} | options
    loop = make_vision_based_control(robot, "SCMWE", gain, **options)
    context = rest_context(loop, start, seed=1)
    loop.GetInputPort("desired_pose").FixValue(context, pose_to_vector(goal))
    return loop, context


def final_errors(s: np.ndarray) -> tuple[float, float]:
    """Largest errors over the last 40 records: position [m], orientation [deg]."""
    last = np.linalg.norm(s[-40:].reshape(-1, 2, 3), axis=2).max(axis=0)
    return float(last[1]), float(np.degrees(last[0]))


def test_sensors_that_cannot_be_are_refused(cogiro: CableRobot) -> None:
    with pytest.raises(ValueError, match='unknown sensors "sonar"'):
        sensing_called("sonar")
    with pytest.raises(ValueError, match="give a sample time"):
        make_vision_based_control(cogiro, sensing=TargetSensing(), sample_time=None)
    with pytest.raises(ValueError, match="latency must be above 0"):
        make_vision_based_control(cogiro, sensing=TargetSensing(), latency=0.0)
    with pytest.raises(ValueError, match='unknown estimator "best"'):
        make_vision_based_control(cogiro, sensing=TargetSensing(estimator="best"))
    blind = cogiro.replace(cameras=cogiro.cameras.replace(stereo_pairs=()))
    with pytest.raises(RobotFileError, match="no pair sees cable 1"):
        make_vision_based_control(blind, sensing=TargetSensing())


@pytest.mark.parametrize("latency", [0.02, 0.05, 0.07, 0.10, 0.13])
def test_the_latency_is_counted_once(cogiro: CableRobot, latency: float) -> None:
    """Sampled by themselves or by samplers, exact measurements give the same motor rates."""
    robot = unbiased(cogiro)
    records = []
    for sensors in ("targets", "gaussian"):
        loop, context = closed_loop(
            robot, latency=latency, noise=False, sensing=sensing_called(sensors)
        )
        records.append(simulate(loop, context, 1.0, every=0.01, record=["commanded_motor_rates"]))
    rates, expected = (r["commanded_motor_rates"] for r in records)
    assert np.abs(expected).max() > 5.0
    np.testing.assert_allclose(rates, expected, atol=1e-4)


@pytest.mark.parametrize("latency", [0.04, 0.13])
def test_at_rest_nothing_moves(cogiro: CableRobot, latency: float) -> None:
    robot = unbiased(cogiro)
    start, _ = paper_test(4).poses(robot)
    loop, context = closed_loop(robot, latency=latency, noise=False)
    loop.GetInputPort("desired_pose").FixValue(context, pose_to_vector(start))
    record = simulate(loop, context, 0.5, record=["pose_error", "frames_lost", "valid_tangents"])
    assert np.abs(record["pose_error"]).max() < 1e-7
    assert record["valid_tangents"].all() and not record["frames_lost"].any()


@pytest.mark.needs("numba")
@pytest.mark.parametrize("estimator", ["joint", "mean"])
def test_test_4_arrives_on_noisy_targets(cogiro: CableRobot, estimator: str) -> None:
    """White noise averages out in the loop: 5 mm and 0.1 degrees with either estimate."""
    loop, context = closed_loop(unbiased(cogiro), sensing=TargetSensing(estimator=estimator))
    s = simulate(loop, context, 25.0, record=["pose_error"])["pose_error"]
    position, orientation = final_errors(s)
    assert np.linalg.norm(s[0, 3:]) > 1.7
    assert position <= 5e-3 and orientation <= 0.1


@pytest.mark.needs("numba")
@pytest.mark.parametrize(("estimator", "degrees"), [("joint", 0.15), ("mean", 0.3)])
def test_a_fixed_bias_of_the_targets_does_not_average_out(
    cogiro: CableRobot, estimator: str, degrees: float
) -> None:
    """A quarter of a pixel in every point still leaves 5 mm, but more than 0.1 degrees."""
    loop, context = closed_loop(cogiro, sensing=TargetSensing(estimator=estimator))
    s = simulate(loop, context, 25.0, record=["pose_error"])["pose_error"]
    position, orientation = final_errors(s)
    assert position <= 5e-3 and 0.1 < orientation < degrees


@pytest.mark.needs("numba")
@pytest.mark.parametrize(
    "lost",
    [
        *(outage("pose camera", n) for n in (1, 2, 3)),
        *(outage("stereo pair", n) for n in (1, 4)),
        outage("pose camera", start=2.0, end=3.0),
        outage("stereo pair", start=2.0, end=3.0),
        outage("load cell", 3),
        outage("load cell", 1, start=1.0, reading=0.0),
        outage("load cell", 6, reading=0.0),
    ],
    ids=lambda o: f"{o.sensor} {o.number or 'all'}{'' if o.reading is None else ' dead'}",
)
def test_a_lost_sensor_leaves_the_loop_stable(cogiro: CableRobot, lost: Outage) -> None:
    loop, context = closed_loop(unbiased(cogiro), 0.5, sensing=TargetSensing(outages=(lost,)))
    names = ["pose_error", "frames_lost", "tension_at_drawing_point"]
    record = simulate(loop, context, 16.0, record=names)
    position, orientation = final_errors(record["pose_error"])
    assert position < 10e-3 and orientation < 0.2
    T = record["tension_at_drawing_point"]
    assert T.min() > 50.0 and T.max() < 710.0
    all_cameras = lost.sensor == "pose camera" and lost.number is None
    assert record["frames_lost"][-1] == (20.0 if all_cameras else 0.0)


def test_the_same_seed_gives_the_same_run(cogiro: CableRobot) -> None:
    runs = []
    for _ in range(2):
        loop, context = closed_loop(cogiro)
        runs.append(simulate(loop, context, 0.5, record=["pose_error", "measured_tangents"]))
    for name in ("pose_error", "measured_tangents"):
        np.testing.assert_array_equal(runs[0][name], runs[1][name])
