"""The cables as a system: forces by hand, against the catenary, derivatives, errors."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.math import RigidTransform
from samples import rotation
from system_checks import check_derivatives, evaluate, fixed_context
from test_servo import few_cables
from test_systems import START, usual_inputs

from cdpr_drake.errors import CableError, SimulationError
from cdpr_drake.model.catenary import elastic_catenary
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.rotations import pose_to_vector
from cdpr_drake.systems import CatenaryCableForce

RUN = 2.0


def light_cables(cogiro: CableRobot) -> CableRobot:
    """Return two nearly weightless cables of EA 1e5 N and damping time 10 ms, with a run of 2 m."""
    two = few_cables(cogiro, 2)
    return two.replace(
        drawing_points=[[0.0, 0.0, 5.0], [6.0, 0.0, 5.0]],
        attachment_points=[[0.0, 0.0, 1.0], [0.5, 0.0, 1.0]],
        cable=two.cable.replace(
            linear_density=1e-9, stiffness=1e5, damping_time=0.01, drum_run=RUN
        ),
    )


def inputs(
    state: np.ndarray, length: np.ndarray, rate: np.ndarray | None = None
) -> dict[str, np.ndarray]:
    return {
        "platform_state": state,
        "unstrained_length": length,
        "unstrained_length_rate": np.zeros(len(length)) if rate is None else rate,
    }


# --- values


@pytest.mark.filterwarnings("ignore::cdpr_drake.model.robot.RobotFileWarning")  # of no weight
def test_weightless_cables_are_springs_and_dampers(cogiro: CableRobot) -> None:
    robot = light_cables(cogiro)
    # B1 at (3, 0, 1), B2 at (3.5, 0, 1): chords (3, 0, -4) of 5 m and (-2.5, 0, -4).
    state = np.array([0, 0, 0, 3.0, 0, 0, 0, 0, 0, 0.2, 0, -0.1])
    chords = np.array([[3.0, 0.0, -4.0], [-2.5, 0.0, -4.0]])
    L = np.linalg.norm(chords, axis=1)
    u = chords / L[:, None]
    length, rate = np.array([6.9, 6.6]), np.array([0.05, -0.02])
    system = CatenaryCableForce(robot)
    values = evaluate(system, fixed_context(system, inputs(state, length, rate)))
    # Run and span bear the same tension, EA ((L + R) / l - 1), and the rate of that by t_d. What
    # the winch pays out stretches: its end feels it by as much more.
    longer = (L + RUN) / length
    stretching = u @ np.array([0.2, 0.0, -0.1]) - longer * rate
    T_d = 1e5 * 0.01 * stretching / length
    T = 1e5 * (longer - 1.0) + T_d
    T_A = 1e5 * (longer - 1.0) + longer * T_d
    np.testing.assert_allclose(values["tension_at_drawing_point"], T_A, rtol=1e-9)
    np.testing.assert_allclose(values["tension_at_attachment_point"], T, rtol=1e-9)
    force = -T[:, None] * u
    arms = np.array([[0.0, 0.0, 1.0], [0.5, 0.0, 1.0]])
    wrench = np.concatenate([np.cross(arms, force).sum(0), force.sum(0)])
    np.testing.assert_allclose(values["platform_wrench"], wrench, rtol=1e-8, atol=1e-6)
    np.testing.assert_allclose(values["tangents_at_drawing_point"], u.ravel(), atol=1e-9)
    np.testing.assert_allclose(values["tangents_at_attachment_point"], u.ravel(), atol=1e-9)
    np.testing.assert_allclose(values["dbeta"], 0.0, atol=1e-9)


def test_sagging_cables_are_those_of_the_catenary(cogiro: CableRobot) -> None:
    robot = cogiro.with_payload(40.0)
    X = RigidTransform(rotation([0.1, -0.2, 0.15]), [0.7, -0.4, 1.1])
    length = rest_state(robot, X).unstrained_length + np.linspace(-3e-3, 0.4, 8)
    state = np.concatenate([pose_to_vector(X), np.zeros(6)])
    system = CatenaryCableForce(robot)
    values = evaluate(system, fixed_context(system, inputs(state, length)))
    EB = robot.attachment_points @ X.rotation().matrix().T
    p_AB = EB + X.translation() - robot.drawing_points
    cable = robot.cable
    cables = elastic_catenary(p_AB, length, robot.weight_per_metre, cable.stiffness, cable.drum_run)
    force = cables.force_on_platform
    wrench = np.concatenate([np.cross(EB, force).sum(0), force.sum(0)])
    expected = {
        "platform_wrench": wrench,
        "tension_at_drawing_point": cables.tension_at_drawing_point,
        "tension_at_attachment_point": cables.tension_at_attachment_point,
        "tangents_at_drawing_point": cables.tangent_at_drawing_point.ravel(),
        "tangents_at_attachment_point": cables.tangent_at_attachment_point.ravel(),
        "dbeta": cables.dbeta,
    }
    for name, value in expected.items():
        np.testing.assert_allclose(values[name], value, rtol=1e-10, atol=1e-10)
    np.testing.assert_array_equal(values["packed"], np.concatenate(list(expected_parts(values))))
    # The tangent at B is steeper than the chord by dbeta, in the cable's plane.
    chord = p_AB / np.linalg.norm(p_AB, axis=1)[:, None]
    beside = values["tangents_at_attachment_point"].reshape(8, 3)
    angle = np.arccos(np.einsum("ij,ij->i", chord, beside))
    np.testing.assert_allclose(angle, values["dbeta"], atol=1e-7)


def expected_parts(values: dict[str, np.ndarray]) -> list[np.ndarray]:
    """Return the parts of the packed output in their order."""
    names = (
        "platform_wrench",
        "tension_at_drawing_point",
        "tension_at_attachment_point",
        "tangents_at_drawing_point",
        "tangents_at_attachment_point",
        "dbeta",
    )
    return [values[name] for name in names]


@pytest.mark.parametrize("name", ["cogiro", "cogiro-37m", "cogiro-98m"])
def test_structural_damping_takes_energy_out(name: str) -> None:
    """Of any motion of the platform and the winches together, on small and large robots."""
    robot = load_robot(name)
    generator = np.random.default_rng(3)
    span = np.ptp(robot.drawing_points, axis=0)
    height = robot.drawing_points[:, 2].max()
    for _ in range(50):
        X = RigidTransform([*(0.1 * generator.normal(size=2) * span[:2]), 0.25 * height])
        length = rest_state(robot, X).unstrained_length
        v, rate = 0.1 * generator.normal(size=6), 0.1 * generator.normal(size=8)
        state = np.concatenate([pose_to_vector(X), v])
        found = []
        for damping_time in (0.0, robot.cable.damping_time):
            system = CatenaryCableForce(
                robot.replace(cable=robot.cable.replace(damping_time=damping_time))
            )
            found.append(evaluate(system, fixed_context(system, inputs(state, length, rate))))
        still, moving = found
        wrench = moving["platform_wrench"] - still["platform_wrench"]
        pull = moving["tension_at_drawing_point"] - still["tension_at_drawing_point"]
        assert wrench @ v + pull @ rate < 0.0


# --- derivatives


@pytest.mark.parametrize("seed", range(3))
def test_derivatives_of_taut_cables(cogiro: CableRobot, seed: int) -> None:
    values = usual_inputs(cogiro, "CatenaryCableForce")
    generator = np.random.default_rng(seed)
    values["platform_state"][:6] += generator.uniform(-2e-3, 2e-3, 6)
    values["platform_state"][6:] = generator.uniform(-0.5, 0.5, 6)
    # Stiff cables: a step of 0.1 mm is a few N.
    check_derivatives(
        CatenaryCableForce(cogiro),
        values,
        steps={"platform_state": 5e-5, "unstrained_length": 1e-4},
    )


def test_derivatives_of_slack_cables_and_of_a_stiffening_cable(cogiro: CableRobot) -> None:
    stiffness = cogiro.cable.stiffness.replace(softening=4e7, offset=100.0)
    robot = cogiro.replace(cable=cogiro.cable.replace(stiffness=stiffness))
    values = usual_inputs(cogiro, "CatenaryCableForce")
    values["unstrained_length"] = rest_state(robot, START).unstrained_length
    values["unstrained_length"][[1, 4]] += [0.05, 1.0]
    check_derivatives(
        CatenaryCableForce(robot),
        values,
        steps={"platform_state": 5e-5, "unstrained_length": 1e-4},
    )


# --- errors


@pytest.mark.parametrize("scalar", ["float", "AutoDiffXd"])
def test_a_cable_without_a_catenary_is_named_with_the_time(cogiro: CableRobot, scalar: str) -> None:
    plain = CatenaryCableForce(cogiro)
    system = plain if scalar == "float" else plain.ToAutoDiffXd()
    values = usual_inputs(cogiro, "CatenaryCableForce")
    values["unstrained_length"][4] = 0.9 * cogiro.cable.drum_run[4] * 0.5
    context = fixed_context(system, values)
    context.SetTime(1.25)
    for output in ("platform_wrench", "dbeta"):
        with pytest.raises(CableError, match=r"cable 5 at t = 1\.25 s: no catenary") as caught:
            system.GetOutputPort(output).Eval(context)
        assert (caught.value.cable, caught.value.time) == (5, 1.25)


@pytest.mark.parametrize("scalar", ["float", "AutoDiffXd"])
def test_a_cable_above_its_breaking_load_is_named_with_the_time(
    cogiro: CableRobot, scalar: str
) -> None:
    plain = CatenaryCableForce(cogiro)
    system = plain if scalar == "float" else plain.ToAutoDiffXd()
    values = usual_inputs(cogiro, "CatenaryCableForce")
    values["unstrained_length"][2] *= 0.97
    context = fixed_context(system, values)
    context.SetTime(3.5)
    pattern = r"cable 3 at t = 3\.5 s: \d+ N is above the breaking load of 10000 N"
    with pytest.raises(CableError, match=pattern) as caught:
        system.GetOutputPort("platform_wrench").Eval(context)
    assert caught.value.cable == 3
    stated = float(str(caught.value).split(": ")[1].split(" N")[0])
    expected = 492306.0 * (1.0 / 0.97 - 1.0)
    assert stated == pytest.approx(expected, rel=0.1)


def test_numbers_that_are_none_name_the_cable_or_the_platform(cogiro: CableRobot) -> None:
    system = CatenaryCableForce(cogiro)
    values = usual_inputs(cogiro, "CatenaryCableForce")
    values["unstrained_length"][6] = np.nan
    with pytest.raises(CableError, match="cable 7 at t = 0 s"):
        system.GetOutputPort("platform_wrench").Eval(fixed_context(system, values))
    values = usual_inputs(cogiro, "CatenaryCableForce")
    values["platform_state"][4] = np.nan
    with pytest.raises(SimulationError, match="platform_state"):
        system.GetOutputPort("platform_wrench").Eval(fixed_context(system, values))


def test_a_platform_within_reach_of_no_cable_raises_no_error(cogiro: CableRobot) -> None:
    """Slack cables hang: any pose has forces."""
    values = usual_inputs(cogiro, "CatenaryCableForce")
    values["unstrained_length"] = np.full(8, 40.0)
    system = CatenaryCableForce(cogiro)
    outputs = evaluate(system, fixed_context(system, values))
    assert all(np.all(np.isfinite(value)) for value in outputs.values())
    assert outputs["platform_wrench"][5] < 0.0  # they only weigh on it
