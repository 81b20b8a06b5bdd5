"""The plant: one boundary, and the two implementations behind it, which must be the same."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder, System
from samples import derivative, random_robot
from system_checks import documented_ports, evaluate, feedthrough, input_sizes, output_sizes

from cdpr_drake.diagrams import (
    make_cable_robot,
    make_joint_space_control,
    make_simulator,
    rest_context,
    simulate,
)
from cdpr_drake.diagrams.blocks import continuous_state_names
from cdpr_drake.diagrams.robot import ROBOT_OUTPUTS, make_plant
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.rotations import vector_to_pose
from cdpr_drake.model.vision.outages import Outage
from cdpr_drake.study import linearize
from cdpr_drake.systems import ExponentialApproach, FusedPlant
from cdpr_drake.systems.fused_plant import fused_refusal

EXTRA = ("state", "packed", "platform_wrench")
"""Ports that the fused plant has besides."""

COMMANDS = ("motor_rates", "desired_motor_angles")
KINDS = list(itertools.product(COMMANDS, (True, False)))
POSE = np.array([0.05, -0.1, 0.2, -1.0, 0.4, 1.3])


def rough(cogiro: CableRobot) -> tuple[CableRobot, np.ndarray]:
    """Return a robot of six cables with friction, hardly enough torque and three filters."""
    robot, pose = random_robot(cogiro, 6, seed=0)
    winch = robot.winch.replace(
        coulomb_torque=1.5,
        coulomb_rate=0.4,
        capstan_exponent=0.12,
        capstan_speed=0.05,
        damping=0.1,
        torque_limit=13.0,  # enough to hold the platform still, not for more
    )
    return robot.replace(
        winch=winch, load_cells=robot.load_cells.replace(order=3, cutoff=1.5)
    ), pose


def constrained(cogiro: CableRobot) -> tuple[CableRobot, np.ndarray]:
    """Return a small robot in a box of 4 m x 3 m x 2 m, held by four cables from below too."""
    corners = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
    drawing = [[2.0 * x, 1.5 * y, z] for z in (2.0, 0.0) for x, y in corners]
    # The upper cables hold the lower corners and turn the platform one way, the lower the other.
    attachment = [[0.2 * y, 0.15 * x, -0.1] for x, y in corners]
    attachment += [[-0.2 * y, -0.15 * x, 0.1] for x, y in corners]
    none = np.zeros(8)
    robot = cogiro.replace(
        name="box",
        drawing_points=np.array(drawing),
        attachment_points=np.array(attachment),
        cable=cogiro.cable.replace(drum_run=none, damping_time=5e-3),
        winch=cogiro.winch.replace(encoder_zero_length=none),
        load_cells=cogiro.load_cells.replace(bias=none, gain=np.ones(8)),
    )
    return robot, np.array([0.02, -0.01, 0.03, 0.1, -0.05, 1.0])


ROBOTS: dict[str, Callable[[CableRobot], tuple[CableRobot, np.ndarray]]] = {
    "suspended, 8 cables": lambda cogiro: (cogiro.with_payload(80.0, [0.3, -0.2, 0.4]), POSE),
    "98 m": lambda cogiro: (load_robot("cogiro-98m"), np.array([0.0, 0.0, 0.1, 5.0, -4.0, 8.0])),
    "rough, 6 cables": rough,
    "fully constrained": constrained,
}


def believed_of(robot: CableRobot) -> CableRobot:
    """Return a robot whose load cells are believed to be other than they are."""
    k = robot.num_cables
    cells = robot.load_cells.replace(gain=np.linspace(0.97, 1.02, k), bias=np.linspace(-9, 7, k))
    return robot.replace(load_cells=cells)


def both(
    robot: CableRobot, pose: np.ndarray, command: str, load_cells: bool, seed: int
) -> list[tuple[Any, Any]]:
    """Return (plant, context) in blocks, and fused, near rest and with all inputs fixed."""
    draw, k = np.random.default_rng(seed), robot.num_cables
    options: dict[str, Any] = {"believed": believed_of(robot), "load_cells": load_cells}
    blocks = make_plant(robot, command=command, **options)
    context = rest_context(blocks, pose, "within limits")
    y = context.get_continuous_state_vector().CopyToVector()
    kicks = {"platform/": 1e-3, "angle": 5e-3, "rate": 0.1, "integral": 0.02, "load_cells": 5.0}
    for i, name in enumerate(continuous_state_names(blocks)):
        y[i] += draw.normal() * next(size for part, size in kicks.items() if part in name)
    context.SetContinuousState(y)
    command_port = blocks.GetInputPort(command)
    rates = draw.uniform(-0.3, 0.3, k)
    if command == "desired_motor_angles":
        rates = command_port.Eval(context) + 0.1 * rates
    inputs = {command: rates, "external_wrench": draw.normal(size=6)}
    if load_cells:
        inputs["tension_noise"] = draw.normal(size=k)
    fused = make_plant(robot, command=command, fast=True, **options)
    in_one = fused.CreateDefaultContext()
    in_one.SetContinuousState(y)
    for name, values in inputs.items():
        blocks.GetInputPort(name).FixValue(context, values)
        fused.GetInputPort(name).FixValue(in_one, values)
    return [(blocks, context), (fused, in_one)]


def in_a_loop(plant: System) -> Diagram:
    """Return a diagram with nothing but a plant named "robot"."""
    builder = DiagramBuilder()
    builder.AddNamedSystem("robot", plant)
    return builder.Build()


def assert_same(got: np.ndarray, expected: np.ndarray, relative: float, what: str) -> None:
    """Fail unless two vectors are the same, relative to the largest entry expected."""
    scale = np.abs(expected).max(initial=0.0)
    np.testing.assert_allclose(got, expected, rtol=0.0, atol=relative * scale, err_msg=what)


def assert_same_derivatives(got: np.ndarray, expected: np.ndarray, names: tuple[str, ...]) -> None:
    """Fail unless each kind of derivative is the same, relative to its own largest entry."""
    kinds = [name.partition("[")[0].rstrip("xyz") for name in names]
    for kind in set(kinds):
        at = [i for i, other in enumerate(kinds) if other == kind]
        assert_same(got[at], expected[at], 1e-12, kind)


@pytest.mark.parametrize(("command", "load_cells"), KINDS)
@pytest.mark.parametrize("name", ROBOTS)
def test_the_two_have_the_same_ports_names_and_derivatives(
    cogiro: CableRobot, name: str, command: str, load_cells: bool
) -> None:
    robot, pose = ROBOTS[name](cogiro)
    for seed in range(3):
        (blocks, context), (fused, in_one) = both(robot, pose, command, load_cells, seed)
        expected, got = evaluate(blocks, context), evaluate(fused, in_one)
        names = continuous_state_names(blocks)
        assert_same_derivatives(got.pop("derivatives"), expected.pop("derivatives"), names)
        for port, values in expected.items():
            assert_same(got[port], values, 1e-12, port)
    assert isinstance(blocks, Diagram) and isinstance(fused, FusedPlant)
    assert list(input_sizes(fused).items()) == list(input_sizes(blocks).items())
    own = [item for item in output_sizes(fused).items() if item[0] not in EXTRA]
    assert own == list(output_sizes(blocks).items())
    assert {pair for pair in feedthrough(fused) if pair[1] not in EXTRA} == feedthrough(blocks)
    loops = [in_a_loop(plant) for plant in (blocks, fused)]
    of_blocks, of_fused = map(continuous_state_names, loops)
    assert of_fused == of_blocks and len(of_blocks) == in_one.num_continuous_states()


@pytest.mark.parametrize(("command", "load_cells"), KINDS)
@pytest.mark.parametrize("name", ROBOTS)
def test_a_second_is_the_same_in_both(
    cogiro: CableRobot, name: str, command: str, load_cells: bool
) -> None:
    robot, pose = ROBOTS[name](cogiro)
    ends = []
    for plant, context in both(robot, pose, command, load_cells, seed=7):
        make_simulator(plant, context, max_step=0.005).AdvanceTo(1.0)
        values = evaluate(plant, context)
        values.pop("derivatives")  # small by now, as the difference of large forces
        values |= {"states": context.get_continuous_state_vector().CopyToVector()}
        ends.append(values)
    expected, got = ends
    acceleration = got.pop("platform_acceleration") - expected.pop("platform_acceleration")
    assert np.abs(acceleration).max() < 1e-7
    np.testing.assert_allclose(got["pose"], expected["pose"], rtol=0.0, atol=1e-9)
    for name, values in expected.items():
        scale = max(1.0, np.abs(values).max())
        np.testing.assert_allclose(got[name], values, rtol=0.0, atol=1e-9 * scale, err_msg=name)


@pytest.mark.parametrize("fast", [False, True])
def test_the_ports_are_those_documented(cogiro: CableRobot, fast: bool) -> None:
    thing: Any = FusedPlant if fast else make_plant
    expand = {"those of make_cable_robot": list(ROBOT_OUTPUTS)}
    name, inputs, outputs = documented_ports(thing, expand)
    assert name == ("FusedPlant" if fast else make_plant(cogiro).get_name())
    for command, load_cells in KINDS:
        plant = make_plant(cogiro, command=command, load_cells=load_cells, fast=fast)
        without = () if load_cells else ("tension_noise", "measured_tension")
        named = [command, *(n for n in list(inputs)[1:] if n not in without)]
        assert list(input_sizes(plant)) == named
        assert list(output_sizes(plant)) == [n for n in outputs if n not in without]


@pytest.mark.parametrize("fast", [False, True])
def test_what_may_stay_open_does(cogiro: CableRobot, fast: bool) -> None:
    context = rest_context(make_plant(cogiro), POSE)
    plant = make_plant(cogiro, fast=fast)
    own = plant.CreateDefaultContext()
    own.SetContinuousState(context.get_continuous_state_vector().CopyToVector())
    with pytest.raises((RuntimeError, ValueError), match="not connected"):
        plant.EvalTimeDerivatives(own)
    plant.GetInputPort("motor_rates").FixValue(own, np.zeros(8))
    for port, values in evaluate(plant, own).items():
        assert np.all(np.isfinite(values)), port
    acceleration = plant.GetOutputPort("platform_acceleration")
    assert np.abs(acceleration.Eval(own)).max() < 1e-8 * cogiro.gravity
    # A force through the centre of mass turns nothing, and moves the origin as all the rest.
    arm = vector_to_pose(POSE).rotation() @ cogiro.center_of_mass
    force = np.array([300.0, -200.0, 1000.0])
    wrench = np.concatenate([np.cross(arm, force), force])
    plant.GetInputPort("external_wrench").FixValue(own, wrench)
    expected = np.concatenate([np.zeros(3), force / cogiro.mass])
    np.testing.assert_allclose(acceleration.Eval(own), expected, atol=1e-7)


def test_the_acceleration_is_that_of_the_path(cogiro: CableRobot) -> None:
    """Second differences of rotation and position, of a platform that turns and falls."""
    robot = cogiro.with_payload(80.0, [0.3, -0.2, 0.4])
    plant = make_plant(robot, fast=True)
    context = plant.CreateDefaultContext()
    y = rest_context(make_plant(robot), POSE).get_continuous_state_vector().CopyToVector()
    y[6:12] = [0.3, -0.5, 0.9, 0.2, -0.1, 0.3]
    context.SetContinuousState(y)
    plant.GetInputPort("motor_rates").FixValue(context, np.linspace(-0.4, 0.5, 8))
    plant.GetInputPort("external_wrench").FixValue(context, [30.0, 20, -40, 90, -50, -300])
    h = 1e-3
    simulator = make_simulator(plant, context, max_step=1e-4)
    poses, accelerations = [], []
    for n in range(5):
        simulator.AdvanceTo(n * h)
        poses.append(vector_to_pose(plant.GetOutputPort("pose").Eval(context)))
        accelerations.append(plant.GetOutputPort("platform_acceleration").Eval(context))
    middle, got = poses[2], accelerations[2]

    def motion(t: float) -> np.ndarray:
        """Return the rotation vector in W and the way since the middle."""
        X = poses[2 + round(t / h)]
        turn = (X.rotation() @ middle.rotation().inverse()).ToAngleAxis()
        return np.concatenate([turn.angle() * turn.axis(), X.translation() - middle.translation()])

    near, far = motion(h) + motion(-h), motion(2.0 * h) + motion(-2.0 * h)
    second = (16.0 * near - far) / (12.0 * h**2)
    assert np.abs(got).min() > 0.05
    assert_same(second[:3], got[:3], 1e-5, "angular")
    assert_same(second[3:], got[3:], 1e-5, "of the origin")
    velocity = derivative(motion, h)
    assert np.abs(np.cross(velocity[:3], velocity[3:])).max() > 0.05  # another frame would differ


@pytest.mark.parametrize(("command", "load_cells"), KINDS)
def test_the_blocks_are_made_for_derivatives_too(
    cogiro: CableRobot, command: str, load_cells: bool
) -> None:
    """Their linearisation against central differences of the fused plant."""
    (blocks, context), (fused, in_one) = both(cogiro, POSE, command, load_cells, seed=2)
    inputs = [command, "external_wrench", *["tension_noise"] * load_cells]
    outputs = [*ROBOT_OUTPUTS, *["measured_tension"] * load_cells, "desired_motor_angles"]
    system = linearize(blocks, context, inputs, outputs, require_equilibrium=False)
    y = in_one.get_continuous_state_vector().CopyToVector()
    values = [fused.GetInputPort(name).Eval(in_one) for name in inputs]
    z = np.concatenate([y, *values])
    splits = np.cumsum([y.size, *[v.size for v in values]])[:-1]

    def run(z: np.ndarray) -> np.ndarray:
        state, *u = np.split(z, splits)
        in_one.SetContinuousState(state)
        for name, value in zip(inputs, u, strict=True):
            fused.GetInputPort(name).FixValue(in_one, value)
        found = evaluate(fused, in_one)
        return np.concatenate([found["derivatives"], *[found[name] for name in outputs]])

    difference = np.empty((run(z).size, z.size))
    for j in range(z.size):

        def along(t: float, j: int = j) -> np.ndarray:
            return run(z + t * np.eye(z.size)[j])

        difference[:, j] = derivative(along, 1e-5)
    D = np.vstack([np.hstack([system.A, system.B]), np.hstack([system.C, system.D])])
    scale = np.abs(D).max(axis=1, keepdims=True)
    np.testing.assert_allclose(difference, D, rtol=0.0, atol=1e-6 * np.maximum(scale, 1.0).max())
    assert np.all(np.abs(difference - D) < 1e-5 * np.maximum(scale, 1e-3))


def test_what_needs_the_blocks_is_said_in_one_place(cogiro: CableRobot) -> None:
    cells = cogiro.load_cells.replace(vibration_amplitude=20.0)
    shaking = cogiro.replace(load_cells=cells)
    dead = (Outage(sensor="load cell", number=2, reading=0.0),)
    blind = (Outage(sensor="pose camera"), Outage(sensor="stereo pair"))
    assert not fused_refusal(cogiro) and not fused_refusal(cogiro, outages=blind)
    assert not fused_refusal(shaking, outages=dead, load_cells=False)
    for robot, outages in ((shaking, ()), (cogiro, dead), (shaking, dead)):
        text = fused_refusal(robot, outages=outages)
        assert text
        with pytest.raises(ValueError, match=f"^{text}$"):
            make_plant(robot, outages=outages, fast=True)
        assert isinstance(make_plant(robot, outages=outages), Diagram)
        make_plant(robot, outages=outages, load_cells=False, fast=True)
    with pytest.raises(ValueError, match=f"^{fused_refusal(shaking)}$"):
        FusedPlant(shaking)
    make_plant(cogiro, outages=blind, fast=True)


@pytest.mark.parametrize("fast", [False, True])
def test_an_unknown_command_is_refused(cogiro: CableRobot, fast: bool) -> None:
    with pytest.raises(ValueError, match='unknown command "speed"; known are motor_rates, desired'):
        make_plant(cogiro, command="speed", fast=fast)


def test_a_stuck_cell_of_the_plant_shows_what_it_showed(cogiro: CableRobot) -> None:
    stuck = (Outage(sensor="load cell", number=3, start=0.1),)
    plant = make_plant(cogiro, outages=stuck)
    context = rest_context(plant, POSE)
    plant.GetInputPort("motor_rates").FixValue(context, np.full(8, -0.2))
    simulator = Simulator(plant, context)
    simulator.AdvanceTo(0.1)
    port = plant.GetOutputPort("measured_tension")
    before = port.Eval(context).copy()
    simulator.AdvanceTo(0.3)
    assert port.Eval(context)[2] == before[2] and port.Eval(context)[1] != before[1]
    with pytest.raises(ValueError, match="there is no load cell 9 among 8"):
        make_plant(cogiro, outages=(Outage(sensor="load cell", number=9),))


def test_the_robot_has_the_blocks_and_ports_it_had(cogiro: CableRobot) -> None:
    robot = make_cable_robot(cogiro)
    assert list(output_sizes(robot)) == list(ROBOT_OUTPUTS)
    plant = make_plant(cogiro)
    names = [system.get_name() for system in robot.GetSystems()]
    assert [s.get_name() for s in plant.GetSystems()] == [*names, "load_cells", "integrator"]


def test_joint_space_control_of_the_fused_plant_is_that_of_the_blocks(cogiro: CableRobot) -> None:
    start = vector_to_pose(POSE)
    goal = RigidTransform(RollPitchYaw(0.0, 0.0, 0.1), [-0.6, 0.2, 1.6])
    runs = []
    for fast in (False, True):
        reference = ExponentialApproach(cogiro, start, goal, 0.5)
        moving = make_joint_space_control(cogiro, reference=reference, fast=fast)
        runs.append(simulate(moving, rest_context(moving, start), 1.0))
    in_blocks, fused = runs
    assert np.ptp(in_blocks["pose"][:, 5]) > 0.03
    np.testing.assert_allclose(fused["pose"], in_blocks["pose"], rtol=0.0, atol=1e-9)
    for name in ("tension_at_drawing_point", "motor_torques"):
        assert_same(fused[name], in_blocks[name], 1e-9, name)
