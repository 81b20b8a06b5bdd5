"""The plant in one system against the same plant in blocks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from system_checks import feedthrough

from cdpr_drake.diagrams import (
    GaussianSensing,
    ModelledSensing,
    blocks,
    make_vision_based_control,
    rest_context,
    robot_of,
    simulate,
)
from cdpr_drake.errors import CableError, SimulationError
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.vision.outages import Outage
from cdpr_drake.study import equilibrium, linearize
from cdpr_drake.systems import FusedPlant

POSE = [0.05, -0.1, 0.2, -1.0, 0.4, 1.3]
GOAL = [0.0, 0.0, 0.1, -0.8, 0.3, 1.5]
OPTIONS: dict[str, Any] = {"sample_time": 0.05, "latency": 0.04}
BLOCKS = {
    "platform": slice(0, 12),
    "winches": slice(12, 36),
    "load_cells": slice(36, -8),
    "integrator": slice(-8, None),
}


def variants(robot: CableRobot) -> dict[str, CableRobot]:
    """Return robots that use all that a plant can have."""
    rough = robot.winch.replace(
        coulomb_torque=1.5, coulomb_rate=0.4, capstan_exponent=0.12, capstan_speed=0.05, damping=0.1
    )
    cells = robot.load_cells.replace(order=3, cutoff=1.5)
    skew = robot.cable.stiffness.replace(softening=3e7, offset=200.0)
    return {
        "as it is": robot,
        "with a payload off centre": robot.with_payload(80.0, [0.3, -0.2, 0.4]),
        "with friction": robot.replace(winch=rough),
        "with more filters": robot.replace(load_cells=cells),
        "with softening cables": robot.replace(cable=robot.cable.replace(stiffness=skew)),
        "with little torque": robot.replace(winch=robot.winch.replace(torque_limit=6.0)),
    }


def states(loop: Any, context: Any) -> np.ndarray:
    """Return the continuous state of a loop in blocks in the order of `FusedPlant`."""
    parts = {}
    for path, system in leaves(loop):
        own = system.GetMyContextFromRoot(context)
        if own.num_continuous_states():
            parts[path] = own.get_continuous_state_vector().CopyToVector()
    return np.concatenate([parts[name] for name in BLOCKS])


def leaves(loop: Any) -> list[tuple[str, Any]]:
    """Return (name, system) of all systems in a loop."""
    return [(path[-1], system) for path, system in blocks(loop)]


def spread(loop: Any, context: Any, y: np.ndarray) -> None:
    """Put a state in the order of `FusedPlant` into a loop in blocks."""
    for name, system in leaves(loop):
        if name in BLOCKS:
            system.GetMyMutableContextFromRoot(context).SetContinuousState(y[BLOCKS[name]])


def both(robot: CableRobot, **options: Any) -> list[tuple[Any, Any]]:
    """Return (loop, context at rest) in blocks, and fused."""
    pairs = []
    for fused in (False, True):
        loop = make_vision_based_control(robot, fast=fused, **{**OPTIONS, **options})
        pairs.append((loop, rest_context(loop, POSE, "minimum norm", seed=3)))
    return pairs


@pytest.mark.parametrize("variant", sorted(variants(load_robot("cogiro"))))
def test_derivatives_and_outputs_are_those_of_the_blocks(cogiro: CableRobot, variant: str) -> None:
    robot = variants(cogiro)[variant]
    (blocks, in_blocks), (fused, in_one) = both(robot)
    rest = states(blocks, in_blocks)
    np.testing.assert_allclose(
        in_one.get_continuous_state_vector().CopyToVector(), rest, rtol=1e-14, atol=1e-14
    )
    draw = np.random.default_rng(8)
    y = rest + 0.02 * draw.standard_normal(rest.size)
    for loop, context in ((blocks, in_blocks), (fused, in_one)):
        loop.GetInputPort("external_wrench").FixValue(context, [5.0, -3.0, 2.0, 20.0, 10.0, -30.0])
        loop.GetInputPort("tension_noise").FixValue(context, np.linspace(-1.0, 1.0, 8))
        held = loop.GetSubsystemByName("held_rates").GetMyMutableContextFromRoot(context)
        held.SetDiscreteState(np.linspace(-0.5, 0.7, 8))
    spread(blocks, in_blocks, y)
    in_one.SetContinuousState(y)
    expected = {}
    for name, system in leaves(blocks):
        own = system.GetMyContextFromRoot(in_blocks)
        if own.num_continuous_states():
            expected[name] = system.EvalTimeDerivatives(own).get_vector().CopyToVector()
    got = fused.EvalTimeDerivatives(in_one).get_vector().CopyToVector()
    for name, part in BLOCKS.items():
        scale = np.abs(expected[name]).max()
        np.testing.assert_allclose(got[part], expected[name], rtol=0.0, atol=1e-11 * scale)
    for index in range(blocks.num_output_ports()):
        port = blocks.get_output_port(index)
        value = port.Eval(in_blocks)
        np.testing.assert_allclose(
            fused.GetOutputPort(port.get_name()).Eval(in_one),
            value,
            rtol=0.0,
            atol=1e-12 * max(1.0, np.abs(value).max()),
            err_msg=port.get_name(),
        )


@pytest.mark.parametrize(
    "options", [{}, {"sample_time": None}, {"sensing": ModelledSensing(modelled=("tensions",))}]
)
def test_a_noisy_run_is_the_same(cogiro: CableRobot, options: dict[str, Any]) -> None:
    records = []
    for loop, context in both(cogiro, noise=True, gain=0.5, **options):
        loop.GetInputPort("desired_pose").FixValue(context, GOAL)
        records.append(simulate(loop, context, 1.0))
    blocks, fused = records
    assert set(blocks.signals) == set(fused.signals) and len(blocks.time) == 21
    for name, values in blocks.signals.items():
        scale = max(1.0, np.abs(values).max())
        np.testing.assert_allclose(fused[name], values, rtol=0.0, atol=1e-9 * scale, err_msg=name)
    assert np.ptp(blocks["pose"][:, 5]) > 0.01


def test_all_outputs_but_the_acceleration_follow_from_the_state(cogiro: CableRobot) -> None:
    plant = FusedPlant(cogiro)
    assert feedthrough(plant) == {("external_wrench", "platform_acceleration")}
    assert plant.num_continuous_states() == 12 + 5 * 8
    assert robot_of(make_vision_based_control(cogiro, fast=True)) is cogiro


def test_what_cannot_be_fused_is_said(cogiro: CableRobot) -> None:
    cells = cogiro.load_cells.replace(vibration_amplitude=20.0)
    with pytest.raises(ValueError, match="vibrate"):
        make_vision_based_control(cogiro.replace(load_cells=cells), fast=True)
    dead = Outage(sensor="load cell", number=2, reading=0.0)
    with pytest.raises(ValueError, match="fail"):
        make_vision_based_control(cogiro, sensing=GaussianSensing(outages=(dead,)), fast=True)
    loop = make_vision_based_control(cogiro, sample_time=None, fast=True)
    context = equilibrium(loop, POSE)
    model = linearize(loop, context, ["desired_pose"], ["pose"], require_equilibrium=False)
    assert model.by_differences == ("robot",)
    blocks = make_vision_based_control(cogiro, sample_time=None)
    exact = linearize(blocks, equilibrium(blocks, POSE), ["desired_pose"], ["pose"])
    assert exact.by_differences == ()
    slow, exact_slow = (m.eigenvalues[np.argsort(abs(m.eigenvalues))][2:8] for m in (model, exact))
    np.testing.assert_allclose(np.sort(slow.real), np.sort(exact_slow.real), rtol=1e-6)
    s = 2j * np.pi * 0.05
    responses = [m.C @ np.linalg.solve(s * np.eye(len(m.A)) - m.A, m.B) for m in (model, exact)]
    np.testing.assert_allclose(responses[0], responses[1], atol=1e-7)


def test_a_torn_cable_and_a_nan_are_named(cogiro: CableRobot) -> None:
    weak = cogiro.replace(cable=cogiro.cable.replace(breaking_load=150.0, max_tension=140.0))
    with pytest.raises(CableError, match="above the breaking load of 150 N"):
        (_, _), (loop, context) = both(weak)
        loop.EvalTimeDerivatives(context)
    (_, _), (loop, context) = both(cogiro)
    held = loop.GetSubsystemByName("held_rates").GetMyMutableContextFromRoot(context)
    held.SetDiscreteState(np.full(8, np.nan))
    with pytest.raises(SimulationError, match=r"inputs of .*robot"):
        loop.EvalTimeDerivatives(context)
    held.SetDiscreteState(np.zeros(8))
    y = context.get_continuous_state_vector().CopyToVector()
    y[3] = np.nan
    context.SetContinuousState(y)
    with pytest.raises(SimulationError, match=r"state of .*robot"):
        loop.EvalTimeDerivatives(context)
