"""The model in the place of load cells and tangent cameras: values, blocks, loops."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from system_checks import documented_ports, feedthrough, input_sizes, output_sizes

from cdpr_drake.analysis import comparable_pose, gain_matrix, middle_of_workspace
from cdpr_drake.analysis.modelled_gain import modelled_gain_matrix
from cdpr_drake.diagrams import (
    ModelledSensing,
    blocks,
    make_vision_based_control,
    rest_context,
    simulate,
)
from cdpr_drake.diagrams.sensing import sensing_called
from cdpr_drake.errors import SimulationError
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.modelled import modelled_tangents, modelled_tensions
from cdpr_drake.model.rest_model import rest_model
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.runs import run, setup_of_test
from cdpr_drake.systems import ModelledTangents, ModelledTension

POSE = np.array([0.02, -0.03, 0.05, 0.4, -0.3, 1.2])


@pytest.mark.parametrize(
    ("name", "newtons", "radians"), [("cogiro", 0.05, 1e-4), ("cogiro-98m", 1.0, 4e-3)]
)
def test_at_rest_with_least_norm_tensions_the_model_is_nearly_right(
    name: str, newtons: float, radians: float
) -> None:
    """Against the elastic catenaries of the plant; what is left is the parabola's."""
    robot = load_robot(name)
    model = rest_model(robot, rest_state(robot, comparable_pose(robot)))
    pose, T_A = model.rest.X_WP, model.rest.tension_at_drawing_point
    tensions = modelled_tensions(robot, pose)
    assert np.abs(tensions - T_A).max() < newtons
    tangents = modelled_tangents(robot, pose, T_A)
    np.testing.assert_allclose(np.linalg.norm(tangents, axis=1), 1.0, atol=1e-14)
    assert np.arccos(np.clip(np.sum(tangents * model.tangents, axis=1), -1, 1)).max() < radians
    # Without sag it would be wrong by much more.
    chords = cable_geometry(robot, pose).u
    assert np.linalg.norm(chords - model.tangents, axis=1).max() > 5.0 * radians


@pytest.mark.parametrize("name", ["ipanema-2", "segesta-10", "acrobot"])
def test_modelled_tensions_follow_the_default_rule(name: str) -> None:
    robot = load_robot(name)
    pose = middle_of_workspace(robot)
    expected = rest_state(robot, pose).tension_at_drawing_point
    np.testing.assert_allclose(modelled_tensions(robot, pose), expected, rtol=1e-3)


def test_a_cable_that_would_have_to_push_hangs_slack(cogiro: CableRobot) -> None:
    tensions = modelled_tensions(cogiro, [0.0, 0.0, 0.0, -6.5, -4.0, 5.0])
    assert np.all(np.isfinite(tensions)) and tensions.min() > 0.0
    weight = cogiro.weight_per_metre * 15.0  # of a cable from side to side
    assert tensions.min() < 2.0 * weight and tensions.max() > 500.0
    assert np.all(np.isfinite(modelled_tangents(cogiro, POSE, np.zeros(8))))


@pytest.mark.parametrize(
    ("cls", "inputs", "results"),
    [
        (ModelledTension, {"measured_pose": 6}, {"measured_tension": 8}),
        (ModelledTangents, {"measured_pose": 6, "measured_tension": 8}, {"measured_tangents": 24}),
    ],
)
def test_the_blocks_give_what_the_functions_do(
    cogiro: CableRobot, cls: Any, inputs: dict[str, int], results: dict[str, int]
) -> None:
    system = cls(cogiro)
    assert (input_sizes(system), output_sizes(system)) == (inputs, results)
    name, documented_in, documented_out = documented_ports(cls, {})
    assert name == cls.__name__
    assert set(documented_in) == set(inputs) and set(documented_out) == set(results)
    (output,) = results
    assert feedthrough(system) == {(i, output) for i in inputs}
    context = system.CreateDefaultContext()
    tension = np.linspace(150.0, 500.0, 8)
    system.GetInputPort("measured_pose").FixValue(context, POSE)
    if "measured_tension" in inputs:
        system.GetInputPort("measured_tension").FixValue(context, tension)
        expected = modelled_tangents(cogiro, POSE, tension).ravel()
    else:
        expected = modelled_tensions(cogiro, POSE)
    np.testing.assert_array_equal(system.get_output_port().Eval(context), expected)
    system.GetInputPort("measured_pose").FixValue(context, np.full(6, np.nan))
    with pytest.raises(SimulationError, match="not finite"):
        system.get_output_port().Eval(context)


BOTH = ("tensions", "tangents")


@pytest.mark.parametrize("sensors", ["gaussian", "targets"])
@pytest.mark.parametrize("modelled", [("tensions",), ("tangents",), BOTH])
def test_the_loop_has_the_model_instead_of_the_sensor(
    cogiro: CableRobot, sensors: str, modelled: tuple[str, ...]
) -> None:
    loop = make_vision_based_control(
        cogiro, sensing=ModelledSensing(modelled=modelled, cameras=sensing_called(sensors))
    )
    names = {path[-1] for path, _ in blocks(loop)}
    assert ("load_cells" in names) != ("tension_model" in names)
    assert ("tangent_cameras" in names) != ("tangent_model" in names)
    assert {n for n in BOTH if f"{n[:-1]}_model" in names} == set(modelled)
    context = rest_context(loop, POSE)
    record = simulate(loop, context, 0.3, record=["pose", "measured_tension", "measured_tangents"])
    assert record["measured_tangents"].shape[1] == 24
    if sensors == "gaussian":
        assert np.abs(record["pose"] - record["pose"][0]).max() < 1e-9


@pytest.mark.parametrize("modelled", [("tension",), ("tangents", "tangents")])
def test_what_cannot_be_modelled_is_refused(cogiro: CableRobot, modelled: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match="known are tensions, tangents"):
        ModelledSensing(modelled=modelled)


@pytest.mark.needs("numba")
def test_test_4_arrives_without_load_cells_and_tangent_cameras() -> None:
    summary = run(
        setup_of_test(4, gain=0.5, until=14.0, noise=False, sensing=ModelledSensing())
    ).summary
    assert summary.position_error < 3.0 and summary.orientation_error < 0.05
    assert not summary.slack_cables


@pytest.mark.needs("numba")
def test_a_continuous_loop_takes_the_model_too() -> None:
    setup = setup_of_test(4, gain=0.4, until=0.5, noise=False, sample_time=None)
    with_model, with_sensors = run(setup.replace(sensing=ModelledSensing())), run(setup)
    apart = with_model.record["pose"] - with_sensors.record["pose"]
    assert 0.0 < np.abs(apart).max() < 1e-4


# --- what it does to the gain matrix


def coupling(gamma: np.ndarray) -> float:
    """Return the largest entry off the diagonal."""
    return float(np.abs(gamma - np.diag(np.diag(gamma))).max())


@pytest.mark.parametrize("cable_model", ["SCMWE", "SLSM"])
def test_with_all_sensors_the_gain_matrix_is_the_study_s(
    cogiro: CableRobot, cable_model: str
) -> None:
    robot, pose = cogiro.with_payload(50.0), comparable_pose(cogiro)
    gamma = modelled_gain_matrix(robot, cogiro, pose, cable_model=cable_model)
    expected = gain_matrix(robot, cogiro, pose, cable_model).matrix
    np.testing.assert_allclose(gamma, expected, atol=1e-12)
    straight = modelled_gain_matrix(robot, cogiro, pose, BOTH, "SLSM")  # which asks no sensor
    expected = gain_matrix(robot, cogiro, pose, "SLSM").matrix
    np.testing.assert_allclose(straight, expected, atol=1e-12)


def test_load_cells_are_worth_what_the_mass_is_unknown() -> None:
    """On the 98 m robot, away from the middle, where cables sag by degrees."""
    robot = load_robot("cogiro-98m")
    pose = comparable_pose(robot)
    known = [modelled_gain_matrix(robot, robot, pose, m) for m in ((), BOTH)]
    assert np.abs(known[1] - known[0]).max() < 2e-3
    loaded = robot.with_payload(100.0)
    seen, guessed = (modelled_gain_matrix(loaded, robot, pose, m) for m in ((), ("tensions",)))
    assert coupling(guessed) > 3.0 * coupling(seen)
    without_pairs = modelled_gain_matrix(loaded, robot, pose, ("tangents",))
    assert np.abs(without_pairs - seen).max() < 2e-3
