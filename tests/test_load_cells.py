"""Which load cells are believed: dead, stuck and light ones told apart, continuously."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from pydrake.math import RigidTransform
from system_checks import check_derivatives, fixed_context

from cdpr_drake.diagrams import GaussianSensing, make_vision_based_control, rest_context, simulate
from cdpr_drake.errors import TensionError
from cdpr_drake.model.cable_models import cable_angles
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.load_cells import (
    DEAD,
    FLOOR,
    LIVE,
    LOW,
    STUCK,
    CellJudge,
    reading_deviation,
)
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.rotations import pose_to_vector
from cdpr_drake.model.servo import MotorRateLaw, ServoSettings
from cdpr_drake.model.statics import bounded_distribution, weight_wrench, wrench_matrix
from cdpr_drake.model.vision.outages import Outage
from cdpr_drake.runs.paper_tests import paper_test
from cdpr_drake.systems import PlausibleTension

ROBOTS = ("cogiro", "cogiro-2015-pulleys", "cogiro-22m", "cogiro-37m", "cogiro-98m")
PERIOD, FRAMES, HELD, SEEDS = 0.05, 80, 4, 100
LIGHT = 4
REST = [0.05, 0.0, 0.1, -1.4, -0.9, 0.8]


def move_of(robot: CableRobot) -> tuple[RigidTransform, RigidTransform]:
    """Return X_WP at the ends of a move: Test 4, or up from a third of the height."""
    if robot.name == "cogiro":
        return paper_test(4).poses(robot)
    centre, height = robot.drawing_points.mean(axis=0), robot.drawing_points[:, 2].max()
    start = np.array([*centre[:2], 0.3 * height])
    shift = np.array([0.05 * np.ptp(robot.drawing_points[:, 0]), 0.0, 0.1 * height])
    return RigidTransform(start), RigidTransform(start + shift)


def tensions(
    robot: CableRobot, pose: np.ndarray, light: dict[int, float] | None = None
) -> np.ndarray:
    """Return tensions at the drawing points of parabolas that hold the platform.

    Those of least norm, or the closest to them with which some cables bear what is wanted and the
    others no less than 60 N.

    Raises:
        TensionError: there are none.
    """
    geometry = cable_geometry(robot, pose)
    W, wrench = wrench_matrix(geometry), weight_wrench(robot, geometry)
    chord = np.linalg.lstsq(W, wrench, rcond=None)[0]

    def at_A(chord: np.ndarray) -> np.ndarray:
        H = chord * geometry.Bx / geometry.L
        return cable_angles(geometry.Bx, geometry.Bz, H, robot.weight_per_metre, "SCMWE").T_A

    if light is None:
        return at_A(chord)
    lower, upper = np.full(robot.num_cables, 60.0), np.full(robot.num_cables, 5000.0)
    for cable, wanted in light.items():
        # T_A^2 = (c - s sin)^2 + (s cos)^2 for the chord tension c and s = w L / 2.
        half = 0.5 * robot.weight_per_metre * geometry.L[cable]
        across = half * geometry.Bx[cable] / geometry.L[cable]
        along = half * geometry.Bz[cable] / geometry.L[cable]
        lower[cable] = upper[cable] = along + np.sqrt(wanted**2 - across**2)
    return at_A(bounded_distribution(W, wrench, lower, upper, chord))


def floor_of(robot: CableRobot, pose: np.ndarray) -> np.ndarray:
    """Return the least tensions [N] that the law gets."""
    span = FLOOR * robot.weight_per_metre * cable_geometry(robot, pose).Bx
    return np.minimum(span, LOW * robot.cable.min_tension)


@dataclass
class Trace:
    """What a run of cells left: truth, readings, what the law got and the judgement (n, k)."""

    truth: np.ndarray
    reading: np.ndarray
    used: np.ndarray
    health: np.ndarray


def run_cells(
    believed: CableRobot,
    poses: list[np.ndarray],
    truth: np.ndarray,
    failing: dict[int, str],
    start: int,
    seed: int,
) -> Trace:
    """Run cells with the noise of the robot's through their filters; some fail from a frame on."""
    generator = np.random.default_rng(seed)
    cells, k = believed.load_cells, believed.num_cables
    kept = np.exp(-2.0 * np.pi * cells.cutoff * PERIOD)
    judge, noise = CellJudge(believed, PERIOD), np.zeros(k)
    memory, found = np.zeros(3 * k), []
    for frame, (pose, T) in enumerate(zip(poses, truth, strict=True)):
        noise = kept * noise + (1.0 - kept) * cells.noise * generator.standard_normal(k)
        reading = T + noise
        for cell, kind in failing.items():
            if frame >= start:
                reading[cell] = noise[cell] if kind == "dead" else found[-1][0][cell]
        now = pose, reading, memory
        found.append((reading, judge.plausible(*now), judge.health(*now)))
        judge.remember(*now, memory)
    reading, used, health = (np.array(column) for column in zip(*found, strict=True))
    return Trace(truth=truth, reading=reading, used=used, health=health)


def draw(seed: int, names: tuple[str, ...] = ROBOTS) -> tuple[Any, CableRobot, CableRobot, list]:
    """Return a generator, a robot with an unknown load, as it is believed, and poses on a move."""
    generator = np.random.default_rng(1000 + seed)
    believed = load_robot(names[seed % len(names)])
    payload = believed.platform.mass * generator.uniform(-0.15, 0.15)
    platform = believed.platform
    heavier = platform.replace(
        mass=platform.mass + payload,
        inertia=platform.inertia * (1.0 + payload / platform.mass),
    )
    start, goal = (pose_to_vector(X) for X in move_of(believed))
    if generator.random() < 0.5:
        start, goal = goal, start
    share = np.repeat(np.clip(np.linspace(-0.3, 1.6, FRAMES // HELD), 0.0, 1.0), HELD)
    poses = [start + s * (goal - start) for s in share]
    return generator, believed.replace(platform=heavier), believed, poses


@pytest.mark.parametrize("count", [1, 2])
def test_dead_cells_are_called_dead(count: int) -> None:
    """One or two at once, on five robots: the others stay live, and their readings pass."""
    for seed in range(SEEDS):
        generator, true, believed, poses = draw(seed)
        truth = np.repeat([tensions(true, pose) for pose in poses[::HELD]], HELD, axis=0)
        failing = dict.fromkeys(generator.choice(8, count, replace=False).tolist(), "dead")
        trace = run_cells(believed, poses, truth, failing, 20, seed)
        dead, live = list(failing), [i for i in range(8) if i not in failing]
        assert np.all(trace.health[20:, dead] == DEAD), seed
        assert np.all(trace.health[:, live] == LIVE), seed
        np.testing.assert_array_equal(trace.used[:, live], trace.reading[:, live])
        # What the law gets is right but for noise and the unknown load: no cable counts as slack.
        ratio = trace.used[20:, dead] / truth[20:, dead]
        assert ratio.min() > 0.4 and ratio.max() < 1.8, seed


def test_stuck_cells_are_called_stuck_once_the_truth_has_moved_on() -> None:
    for seed in range(SEEDS):
        generator, true, believed, poses = draw(seed)
        truth = np.repeat([tensions(true, pose) for pose in poses[::HELD]], HELD, axis=0)
        moved = np.abs(truth - truth[0]).max(axis=0)
        cell = int(generator.choice(np.flatnonzero(moved > 0.95 * np.sort(moved)[-3])))
        trace = run_cells(believed, poses, truth, {cell: "stuck"}, 20, seed)
        far = np.flatnonzero(np.abs(truth[:, cell] - truth[20, cell]) > 45.0)
        assert far.size > 15, (believed.name, far.size)
        assert np.all(trace.health[:20, cell] == LIVE), seed
        assert np.all(trace.health[far[0] + 10 :, cell] == STUCK), seed
        others = np.delete(trace.health, cell, axis=1)
        assert np.all(others == LIVE), seed
        assert np.abs(trace.used[-10:, cell] / truth[-10:, cell] - 1.0).max() < 0.35
        # It is handed over, not switched.
        steps = np.abs(np.diff(trace.used[:, cell]))[20:]
        assert steps.max() < 0.2 * np.abs(trace.used[-1, cell] - trace.reading[-1, cell]) + 40.0


def test_light_cables_are_believed() -> None:
    """Truly at 15 to 45 N, where their sag allows that: the law gets what the cell reads."""
    for seed in range(SEEDS):
        generator, true, believed, poses = draw(seed, ROBOTS[:4])
        floor = np.array([floor_of(believed, pose) for pose in poses])
        truth = None
        while truth is None:  # not every cable can be light, and the others taut, on all the way
            cell = int(generator.integers(8))
            wanted = generator.uniform(max(15.0, 1.1 * floor[:, cell].max()), 45.0)
            with suppress(TensionError):
                found = [tensions(true, pose, {cell: wanted}) for pose in poses[::HELD]]
                truth = np.repeat(found, HELD, axis=0)
        assert np.abs(truth[:, cell] - wanted).max() < 1e-6
        trace = run_cells(believed, poses, truth, {}, 0, seed)
        assert np.all(trace.health == LIVE), seed
        np.testing.assert_allclose(trace.used, np.maximum(trace.reading, floor), rtol=1e-14)


def test_nothing_is_stuck_at_rest_without_noise(cogiro: CableRobot) -> None:
    """Nor while another cell dies, which disturbs what is expected for a moment."""
    k, pose = 8, np.array(REST)
    truth = tensions(cogiro, pose)
    judge, memory = CellJudge(cogiro, PERIOD), np.zeros(3 * k)
    for frame in range(100):
        reading = truth.copy()
        reading[3] *= np.exp(-12.6 * PERIOD * max(frame - 40, 0))
        health = judge.health(pose, reading, memory)
        judge.remember(pose, reading, memory, memory)
        assert np.all(np.delete(health, 3) == LIVE)
    assert health[3] == DEAD


# --- continuity


def commanded(robot: CableRobot, name: str = "SCMWE") -> Any:
    """Return the law's motor rates for readings at the start of a move, towards its goal."""
    start, goal = (pose_to_vector(X) for X in move_of(robot))
    judge, law = CellJudge(robot), MotorRateLaw(robot, ServoSettings(cable_model=name))
    geometry = cable_geometry(robot, start)
    truth = tensions(robot, start)

    def rates(reading: np.ndarray) -> np.ndarray:
        used = judge.plausible(start, reading, judge.healthy)
        z = np.concatenate([start, goal, np.zeros(6), used, geometry.u.ravel()])
        return law(z, 0.1)[: robot.num_cables]

    return rates, truth, start


@pytest.mark.parametrize("name", ["cogiro", "cogiro-22m", "cogiro-98m"])
@pytest.mark.parametrize("state", ["taut", "light"])
@pytest.mark.needs("numba")  # minutes without compilation
def test_the_motor_rates_are_continuous_in_each_reading(name: str, state: str) -> None:
    """Readings from 10 to 100 N: ten times finer steps make ten times smaller jumps, no larger."""
    robot = load_robot(name)
    rates, taut, start = commanded(robot)
    largest = np.abs(rates(taut)).max()
    for cable in range(robot.num_cables):
        others = taut
        if state == "light":
            with suppress(TensionError):
                others = tensions(robot, start, {cable: 90.0})
        jumps = []
        for step in (0.1, 0.01):
            sweep = np.arange(10.0, 100.0, step)
            found = np.array([rates(np.where(np.arange(8) == cable, T, others)) for T in sweep])
            jumps.append(np.abs(np.diff(found, axis=0)).max() / step / largest)
        assert jumps[1] < 1.5 * jumps[0] + 1e-6
        assert jumps[0] < 0.5  # of the largest rate, per newton


def test_a_reading_may_cross_half_the_least_tension(cogiro: CableRobot) -> None:
    """Where a step used to be, between 49.999 and 50 N, nothing happens."""
    rates, taut, _ = commanded(cogiro)
    for cable in range(8):
        two = [rates(np.where(np.arange(8) == cable, T, taut)) for T in (49.999, 50.0)]
        assert np.abs(two[1] - two[0]).max() < 1e-4 * np.abs(two[0]).max()


# --- the system


@pytest.mark.parametrize("low", [[], [2], [2, 5]])
def test_derivatives_of_the_system(cogiro: CableRobot, low: list[int]) -> None:
    reading = tensions(cogiro, np.array(REST))
    reading[low] = np.array([62.0, 72.0])[: len(low)]
    reading[1] += 3.0
    inputs = {"measured_pose": np.array(REST), "measured_tension": reading}
    steps = {"measured_tension": 1e-3, "measured_pose": 1e-5}
    check_derivatives(PlausibleTension(cogiro), inputs, steps=steps)


def test_what_to_expect_does_not_depend_on_the_cell_itself(cogiro: CableRobot) -> None:
    judge, reading = CellJudge(cogiro), tensions(cogiro, np.array(REST))
    for cable in range(8):
        expected = []
        for T in (0.0, 60.0, 300.0, 900.0):
            z = np.concatenate([REST, np.where(np.arange(8) == cable, T, reading), np.zeros(8)])
            expected.append(judge(z)[1, cable])
        np.testing.assert_allclose(expected, reading[cable], atol=0.05)


@pytest.mark.parametrize("count", [4, 6])
def test_with_six_cables_or_fewer_the_weight_alone_decides(cogiro: CableRobot, count: int) -> None:
    few = cogiro.replace(
        drawing_points=cogiro.drawing_points[:count],
        attachment_points=cogiro.attachment_points[:count],
        cable=cogiro.cable.replace(drum_run=cogiro.cable.drum_run[:count]),
        winch=cogiro.winch.replace(encoder_zero_length=np.zeros(count)),
        load_cells=cogiro.load_cells.replace(bias=np.zeros(count), gain=np.ones(count)),
        cameras=cogiro.cameras.replace(stereo_pairs=()),
    )
    pose = np.array(REST)
    geometry = cable_geometry(few, pose)
    chord = np.linalg.lstsq(wrench_matrix(geometry), weight_wrench(few, geometry), rcond=None)[0]
    expected = chord - 0.5 * few.weight_per_metre * geometry.Bz
    judged = CellJudge(few)(np.concatenate([pose, np.full(count, 150.0), np.zeros(count)]))
    if count == 6:
        np.testing.assert_allclose(judged[1], np.minimum(expected, 5000.0), rtol=1e-5)
    assert np.all(np.isfinite(judged))
    np.testing.assert_array_equal(judged[0], 150.0)


def test_the_memory_is_at_rest_from_the_start(cogiro: CableRobot) -> None:
    loop = make_vision_based_control(cogiro)
    context = rest_context(loop, REST)
    system = loop.GetSubsystemByName("plausible_tension")
    own = system.GetMyContextFromRoot(context)
    before = own.get_discrete_state_vector().CopyToVector()
    after = system.EvalUniquePeriodicDiscreteUpdate(own).value()
    np.testing.assert_array_equal(after, before)
    assert np.all(loop.GetOutputPort("cell_health").Eval(context) == LIVE)
    assert before[:8].min() > 100.0 and np.all(before[16:] == 0.0)


@pytest.mark.parametrize("latency", [0.0, 0.04, 0.1])
@pytest.mark.parametrize("noise", [True, False])
def test_a_loop_reports_its_cells(cogiro: CableRobot, latency: float, noise: bool) -> None:
    """The move of Test 4 with a dead and a stuck cell: both are found, all others stay live."""
    start, goal = paper_test(4).poses(cogiro)
    outages = (
        Outage(sensor="load cell", number=2, start=1.0, reading=0.0),
        Outage(sensor="load cell", number=4, start=1.0),
    )
    loop = make_vision_based_control(
        cogiro, gain=0.5, latency=latency, noise=noise, sensing=GaussianSensing(outages=outages)
    )
    context = rest_context(loop, start, seed=1)
    loop.GetInputPort("desired_pose").FixValue(context, pose_to_vector(goal))
    record = simulate(loop, context, 8.0, record=["cell_health", "pose_error"])
    health = record["cell_health"]
    assert np.all(np.delete(health, [1, 3], axis=1) == LIVE)
    assert np.all(health[record.time < 1.0] == LIVE)
    assert np.all(health[record.time > 1.5, 1] == DEAD)
    assert np.all(health[record.time > 6.0, 3] == STUCK)
    assert np.linalg.norm(record["pose_error"][-1, 3:]) < 0.07


@pytest.mark.parametrize("cells", [(1, 3, 5), (None,)], ids=["three", "all"])
@pytest.mark.parametrize("reading", [0.0, None], ids=["dead", "stuck"])
def test_no_cable_is_torn_where_many_cells_fail(
    cogiro: CableRobot, cells: tuple[int | None, ...], reading: float | None
) -> None:
    start, goal = paper_test(4).poses(cogiro)
    outages = tuple(
        Outage(sensor="load cell", number=cell, start=0.5, reading=reading) for cell in cells
    )
    loop = make_vision_based_control(
        cogiro, gain=0.5, noise=True, sensing=GaussianSensing(outages=outages)
    )
    context = rest_context(loop, start, seed=2)
    loop.GetInputPort("desired_pose").FixValue(context, pose_to_vector(goal))
    record = simulate(loop, context, 12.0, record=["tension_at_winch", "pose_error"])
    # As with healthy cells: 189 N are the lowest, 438 N at rest the highest.
    tension = record["tension_at_winch"]
    assert tension.min() > 170.0 and tension.max() < 470.0
    assert np.linalg.norm(record["pose_error"][-1, 3:]) < 0.01


def test_light_readings_pass_the_system(cogiro: CableRobot) -> None:
    """A system without memory: low readings that are to be expected stay, others go over."""
    pose = np.array(REST)
    light = tensions(cogiro, pose, {LIGHT: 30.0})
    inputs = {"measured_pose": pose, "measured_tension": light}
    system = PlausibleTension(cogiro)
    context = fixed_context(system, inputs)
    got = system.GetOutputPort("plausible_tension").Eval(context)
    np.testing.assert_array_equal(got, light)
    taut = rest_state(cogiro, pose).tension_at_drawing_point
    for low in (-20.0, 0.0, 49.0):
        inputs["measured_tension"] = np.where(np.arange(8) == LIGHT, low, taut)
        context = fixed_context(system, inputs)
        got = system.GetOutputPort("plausible_tension").Eval(context)
        np.testing.assert_allclose(got, taut, atol=0.5)
        health = system.GetOutputPort("cell_health").Eval(context)
        np.testing.assert_array_equal(health, np.where(np.arange(8) == LIGHT, DEAD, LIVE))


def test_the_noise_of_a_reading(cogiro: CableRobot) -> None:
    generator, cells = np.random.default_rng(0), cogiro.load_cells
    kept, x, found = np.exp(-2.0 * np.pi * cells.cutoff * PERIOD), 0.0, []
    for n in cells.noise * generator.standard_normal(20000):
        x = kept * x + (1.0 - kept) * n
        found.append(x)
    assert np.std(found) == pytest.approx(reading_deviation(cogiro), rel=0.03)
    silent = cogiro.replace(load_cells=cells.replace(noise=0.0))
    assert reading_deviation(silent) == 1.0
