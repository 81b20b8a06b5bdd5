"""Cables that hang vertically, and platforms that pass under a drawing point."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff

from cdpr_drake.analysis import gain_matrix
from cdpr_drake.diagrams import (
    make_joint_space_control,
    make_vision_based_control,
    rest_context,
    simulate,
)
from cdpr_drake.model.cable_models import CABLE_MODELS
from cdpr_drake.model.equilibrium import forward_kinematics, rest_state
from cdpr_drake.model.inverse_kinematics import InverseKinematics
from cdpr_drake.model.rest_model import rest_model
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.servo import MotorRateLaw, ServoSettings
from cdpr_drake.model.statics import RULES
from cdpr_drake.study import linearize, one_period_map
from cdpr_drake.systems import PositionBasedVisualServo

BOX = str(Path(__file__).parent / "outside" / "box.yaml")
AWAY = (0.02, 0.01, -0.03, 0.04, 0.03, 0.05)  # rad, m
OFFSETS = (1e-12, 1e-9, 1e-6, 1e-3)  # m
NEARBY = 3e-5  # m
DIRECTIONS = ((1.0, 0.0), (-0.6, 0.8), (0.0, -1.0))


def hung(name: str, cable: int, pose: np.ndarray) -> CableRobot:
    """Return a robot with a drawing point right above or below an attachment point at a pose."""
    robot = load_robot(name)
    points = robot.drawing_points.copy()
    points[cable, :2] = pose[3:5] + robot.attachment_points[cable, :2]
    return robot.replace(drawing_points=points)


CASES = {
    # As published, with cable 9 over its attachment point there.
    "segesta-10": (8, np.array([0.0, 0.0, 0.0, -0.009, -0.587, 0.126])),
    "cogiro": (2, np.array([0.0, 0.0, 0.0, 0.3, -0.2, 1.5])),
    BOX: (4, np.array([0.0, 0.0, 0.0, 0.1, 0.1, 1.2])),
}


@pytest.fixture(params=CASES)
def case(request: pytest.FixtureRequest) -> tuple[CableRobot, int, np.ndarray]:
    cable, pose = CASES[request.param]
    return hung(request.param, cable, pose), cable, pose


def law_at(robot: CableRobot, model: str, pose: np.ndarray) -> np.ndarray:
    """Return the motor rates towards a goal elsewhere, all measured as it is at a rest."""
    rest = rest_state(robot, pose)
    tangents = rest_model(robot, rest).tangents
    goal = pose + np.array(AWAY)
    z = np.concatenate([pose, goal, np.zeros(6), rest.tension_at_drawing_point, tangents.ravel()])
    return np.asarray(
        MotorRateLaw(robot, ServoSettings(cable_model=model))(z, 0.1)[: len(tangents)]
    )


def found_at(robot: CableRobot, pose: np.ndarray) -> dict[str, np.ndarray]:
    """Return what the laws, the gain matrices and inverse kinematics are at a pose."""
    found = {}
    for model in CABLE_MODELS:
        found[f"law {model}"] = law_at(robot, model, pose)
        found[f"gamma {model}"] = gain_matrix(robot, None, pose, model).matrix
        for rule in RULES[::2]:
            found[f"lengths {model} {rule}"] = InverseKinematics(robot, model, rule=rule).lengths(
                pose
            )
    return found


@cache
def around(name: str) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return each quantity at the vertical and its largest slope, per metre, NEARBY."""
    cable, pose = CASES[name]
    robot = hung(name, cable, pose)
    here = found_at(robot, pose)
    slopes = dict.fromkeys(here, 0.0)
    for direction in DIRECTIONS:
        away = found_at(robot, pose + np.array([0, 0, 0, *direction, 0]) * NEARBY)
        for key in here:
            change = np.abs(away[key] - here[key]).max() / np.abs(here[key]).max()
            slopes[key] = max(slopes[key], change / NEARBY)
    return {key: (here[key], slopes[key]) for key in here}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("offset", OFFSETS)
def test_laws_lengths_and_gain_matrices_are_continuous(name: str, offset: float) -> None:
    """No further away than the way there explains, whose slope is that between the offsets."""
    cable, pose = CASES[name]
    robot, known = hung(name, cable, pose), around(name)
    for direction in DIRECTIONS:
        there = found_at(robot, pose + np.array([0, 0, 0, *direction, 0]) * offset)
        for key, (here, slope) in known.items():
            assert np.all(np.isfinite(there[key]))
            change = np.abs(there[key] - here).max() / np.abs(here).max()
            assert change <= 1e-6 + 1.2 * slope * offset, key
    if offset <= 1e-9:
        assert all(np.abs(there[k] - known[k][0]).max() <= 1e-6 for k in known if "gamma" in k)


def test_the_model_that_knows_the_robot_has_no_coupling(
    case: tuple[CableRobot, int, np.ndarray],
) -> None:
    robot, cable, pose = case
    exact = robot.replace(cable=robot.cable.replace(drum_run=np.zeros(robot.num_cables)))
    rest = rest_state(exact, pose)
    chord = (pose[3:] + exact.attachment_points - exact.drawing_points)[cable]
    assert np.hypot(*chord[:2]) <= 1e-15
    assert rest.residual <= 1e-10
    np.testing.assert_allclose(gain_matrix(exact, None, pose, "ECM").matrix, np.eye(6), atol=1e-3)


@pytest.mark.parametrize("lean", [0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3])
def test_chord_tension_is_that_of_the_span_in_closed_form(lean: float) -> None:
    """Of the span's equation divided by its width, in 30 digits."""
    robot = hung("segesta-10", *CASES["segesta-10"])
    pose = CASES["segesta-10"][1] + lean * np.eye(6)[3]
    rest, w = rest_state(robot, pose, "within limits"), robot.weight_per_metre
    chord = np.linalg.norm(pose[3:] + robot.attachment_points[8] - robot.drawing_points[8])
    with mp.workdps(30):
        EA, l = mp.mpf(robot.cable.stiffness(0.0)), mp.mpf(rest.unstrained_length[8])
        ends = [mp.mpf(t[8]) for t in (rest.tension_at_drawing_point,
                                       rest.tension_at_attachment_point)]  # fmt: skip
        # By Irvine: T = L / (l / EA + (2 / w) atanh(w l / (T_A + T_B)))
        exact = mp.mpf(chord) / (l / EA + 2 / mp.mpf(w) * mp.atanh(w * l / sum(ends)))
        assert abs(rest.chord_tension[8] - exact) <= 1e-9 * exact


def test_a_hundred_kilograms_on_one_cable() -> None:
    """Straight down: T_B is the weight, T_A that and the cable's, and between them the chord's."""
    whole = load_robot("cogiro")
    robot = whole.replace(
        drawing_points=[[0.0, 0.0, 6.0]], attachment_points=[[0.0, 0.0, 0.0]],
        platform=whole.platform.replace(center_of_mass=np.zeros(3)),
        cable=whole.cable.replace(drum_run=5.4),
        winch=whole.winch.replace(encoder_zero_length=0.0),
        load_cells=whole.load_cells.replace(gain=1.0, bias=0.0),
        cameras=whole.cameras.replace(stereo_pairs=()),
    )  # fmt: skip
    rest = forward_kinematics(robot, [10.4], [0.01, 0.0, 0.0, 0.1, 0.05, 1.1])
    w, EA = robot.weight_per_metre, robot.cable.stiffness(0.0)
    assert rest.tension_at_attachment_point[0] == pytest.approx(981.0, rel=1e-9)
    l0 = (rest.tension_at_drawing_point[0] - 981.0) / w
    length = l0 * (1.0 + (981.0 + 0.5 * w * l0) / EA)
    assert rest.X_WP.translation()[2] == pytest.approx(6.0 - length, abs=1e-9)
    exact = length / (l0 / EA + np.log1p(w * l0 / 981.0) / w)
    assert rest.chord_tension[0] == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("model", CABLE_MODELS)
def test_derivatives_at_the_vertical(model: str, case: tuple[CableRobot, int, np.ndarray]) -> None:
    """AutoDiffXd through the block of the law, by all inputs, against central differences."""
    robot, _, pose = case
    rest = rest_state(robot, pose)
    law = PositionBasedVisualServo(robot, ServoSettings(cable_model=model, gain=0.2))
    k = robot.num_cables
    values = {
        "measured_pose": pose,
        "measured_tangents": rest_model(robot, rest).tangents.ravel(),
        "measured_tension": rest.tension_at_drawing_point,
        "desired_pose": pose + np.array(AWAY),
    }

    def rates(system: PositionBasedVisualServo, given: dict[str, np.ndarray]) -> np.ndarray:
        context = system.CreateDefaultContext()
        for name, value in given.items():
            system.GetInputPort(name).FixValue(context, value)
        return np.asarray(system.GetOutputPort("motor_rates").Eval(context))

    for name in ("measured_pose", "measured_tension"):
        x = InitializeAutoDiff(values[name]).ravel()
        typed = {key: value.astype(object) for key, value in values.items()}
        jacobian = ExtractGradient(rates(law.ToAutoDiffXd(), {**typed, name: x}))
        step = 1e-6 * np.eye(len(x))
        differences = [
            (rates(law, {**values, name: values[name] + h})
             - rates(law, {**values, name: values[name] - h})) / 2e-6
            for h in step
        ]  # fmt: skip
        assert jacobian.shape == (k, len(x)) and np.all(np.isfinite(jacobian))
        scale = np.abs(jacobian).max()
        np.testing.assert_allclose(jacobian, np.array(differences).T, atol=2e-6 * scale)


def test_loops_start_there_and_pass_through(case: tuple[CableRobot, int, np.ndarray]) -> None:
    """At rest by every rule but the paper's; linear models; over the vertical at a walk."""
    robot, _, pose = case
    vision = make_vision_based_control(robot, gain=0.3, ramp_time=0.0)
    joint = make_joint_space_control(robot, cable_model="ECM")
    for loop in (vision, joint):
        for rule in RULES[::2]:
            context = rest_context(loop, pose, rule)
            assert np.all(np.isfinite(loop.GetOutputPort("pose").Eval(context)))
    assert np.all(np.isfinite(one_period_map(vision, rest_context(vision, pose)).matrix))
    continuous = make_vision_based_control(robot, gain=0.3, sample_time=None, ramp_time=0.0)
    assert np.all(np.isfinite(linearize(continuous, rest_context(continuous, pose)).A))
    start, goal = (pose + np.array([0, 0, 0, s * 0.004, s * 0.003, 0.0]) for s in (-1.0, 1.0))
    loop = make_vision_based_control(robot, gain=2.0, noise=False)
    context = rest_context(loop, start)
    loop.GetInputPort("desired_pose").FixValue(context, goal)
    record = simulate(loop, context, 4.0)
    assert np.linalg.norm(record["pose_error"][-1, 3:]) < 5e-5
    assert not record.slack_cables
