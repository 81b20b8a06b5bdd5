"""Whole runs: the error decays as the law says, joint space control sags, energy balances."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import Integrator

from cdpr_drake.diagrams import (
    blocks,
    make_joint_space_control,
    make_vision_based_control,
    rest_context,
    simulate,
)
from cdpr_drake.model.catenary import cable_energy, elastic_catenary
from cdpr_drake.model.kernels import is_compiled
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import pose_to_vector, vector_to_pose
from cdpr_drake.runs.paper_tests import paper_test
from cdpr_drake.systems import ExponentialApproach

GAIN = 0.1


def error_of(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the sizes (n,) of position [m] and rotation error [rad] of s (n, 6)."""
    return np.linalg.norm(s[:, 3:], axis=1), np.linalg.norm(s[:, :3], axis=1)


# --- vision-based control


@pytest.mark.parametrize(
    "until", [pytest.param(80.0, marks=pytest.mark.needs("numba")), 2.5], ids=["whole", "start"]
)
def test_the_exact_law_lets_the_error_decay_exponentially(cogiro: CableRobot, until: float) -> None:
    """Test 4, continuous, exact in model, measurement and calibration, from rest.

    The winches need a moment to get up to speed, since there is no ramp: from 1 s on the error is
    the exponential to 1 % of what it was at the start.
    """
    start, goal = paper_test(4).poses(cogiro)
    loop = make_vision_based_control(
        cogiro, "ECM", GAIN, sample_time=None, ramp_time=0.0, model_drum_run=True
    )
    context = rest_context(loop, start)
    loop.GetInputPort("desired_pose").FixValue(context, pose_to_vector(goal))
    run = simulate(loop, context, until, record=["pose_error", "pose_error_seen"], every=0.1)
    s = run["pose_error"]
    np.testing.assert_allclose(run["pose_error_seen"], s, atol=1e-12)
    assert not run.slack_cables
    ideal = np.exp(-GAIN * run.time)[:, None] * s[0]
    late = run.time > 1.0 - 1e-9
    for got, whole in zip(error_of(s - ideal), error_of(s), strict=True):
        assert got[late].max() < 0.01 * whole[0]
    if until == 80.0:
        position, angle = (size[-1] for size in error_of(s))
        assert position < 1e-3
        assert np.degrees(angle) < 0.02


@pytest.mark.needs("numba")
def test_the_sampled_noisy_loop_arrives(cogiro: CableRobot) -> None:
    """20 Hz, 40 ms of latency, noise, a cable model without stretch: it still arrives."""
    start, goal = paper_test(4).poses(cogiro)
    loop = make_vision_based_control(cogiro, "SCMWE", 0.3, noise=True)
    context = rest_context(loop, start, seed=1)
    loop.GetInputPort("desired_pose").FixValue(context, pose_to_vector(goal))
    position, angle = error_of(simulate(loop, context, 30.0, record=["pose_error"])["pose_error"])
    assert position[0] > 1.7 and position[-1] < 2e-3
    assert np.degrees(angle[0]) > 16.0 and np.degrees(angle[-1]) < 0.05


# --- joint space control


@pytest.mark.needs("numba")
def test_joint_space_control_ends_low(cogiro: CableRobot) -> None:
    """Its lengths know no stretch: the platform ends tens of millimetres under the goal."""
    start, goal = paper_test(4).poses(cogiro)
    reference = ExponentialApproach(cogiro, start, goal, gain=0.4)
    loop = make_joint_space_control(cogiro, reference=reference)
    context = rest_context(loop, start)
    end = simulate(loop, context, 40.0, record=["pose"], every=1.0)["pose"][-1]
    low = goal.translation() - end[3:]
    assert 0.02 < low[2] < 0.06
    assert np.abs(low[:2]).max() < 0.5 * low[2]
    # That is where it rests.
    joint = make_joint_space_control(cogiro)
    rest = joint.GetOutputPort("pose").Eval(rest_context(joint, goal))
    np.testing.assert_allclose(end, rest, atol=2e-4)


# --- energy


class Powers(LeafSystem):
    """The powers [W] that change the energy of a robot, from what its diagram puts out.

    Motors, viscous friction, dry friction, capstan friction, structural damping, what the cable
    takes with it onto the drum, external wrench.
    """

    NAMES = ("motors", "viscous", "dry", "capstan", "structural", "wound up", "external")
    PORTS = (
        "motor_torques",
        "motor_rates",
        "platform_state",
        "tension_at_winch",
        "tension_at_drawing_point",
        "unstrained_length",
    )

    def __init__(self, robot: CableRobot, loop: Diagram, wrench: np.ndarray) -> None:
        super().__init__()
        self.robot, self.wrench = robot, wrench
        for name in self.PORTS:
            self.DeclareVectorInputPort(name, loop.GetOutputPort(name).size())
        self.DeclareVectorOutputPort("powers", len(self.NAMES), self.calc)

    def calc(self, context: Context, output: Any) -> None:
        robot, winch, cable = self.robot, self.robot.winch, self.robot.cable
        torque, q_rate, state, T_W, T_A, length = (
            self.GetInputPort(name).Eval(context) for name in self.PORTS
        )
        X_WP, omega, v = vector_to_pose(state[:6]), state[6:9], state[9:]
        EB = robot.attachment_points @ X_WP.rotation().matrix().T
        AB = EB + X_WP.translation() - robot.drawing_points
        v_B = v + np.cross(omega, EB)
        l_rate = winch.transmission * q_rate
        EA = cable.stiffness.asymptote
        e_B, e_l = stretch_gradient(robot, AB, length)
        speed = np.sum(e_B * v_B, axis=1) + e_l * l_rate
        damping = EA * cable.damping_time / length * speed
        # A metre on the drum keeps its strain energy; l = l(0) + r q has the drum take up
        # unstrained length.
        strain = (T_A + e_l * damping) ** 2 / (2.0 * EA)
        powers = [
            torque @ q_rate,
            -winch.damping * q_rate @ q_rate,
            -winch.coulomb_torque * np.tanh(q_rate / winch.coulomb_rate) @ q_rate,
            (T_W - T_A) @ l_rate,
            -damping @ speed,
            -strain @ l_rate,
            self.wrench @ state[6:],
        ]
        output.SetFromVector(powers)


def stretch_gradient(
    robot: CableRobot, AB: np.ndarray, length: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return how much cables stretch with the place of B (k, 3) and with their length (k,).

    By differences: l / EA times the change of the tension in the middle of the span.
    """
    cable = robot.cable
    w, EA = robot.weight_per_metre, cable.stiffness.asymptote

    def stretch(AB: np.ndarray, more: float) -> np.ndarray:
        at = elastic_catenary(AB, length + more, w, cable.stiffness, cable.drum_run)
        V = -at.force_on_platform[:, 2] - 0.5 * w * at.unstrained_span_length
        return length / EA * np.hypot(at.horizontal_tension, V)

    h = 1e-5
    by_place = [(stretch(AB + d, 0.0) - stretch(AB - d, 0.0)) / (2 * h) for d in h * np.eye(3)]
    return np.column_stack(by_place), (stretch(AB, h) - stretch(AB, -h)) / (2 * h)


def energy(robot: CableRobot, diagram: Diagram, context: Context) -> dict[str, float]:
    """Return the energies [J] of a robot in a context of a diagram around it."""
    systems = {path[-1]: system for path, system in blocks(diagram)}
    plant = systems["platform"]
    own = plant.GetMyContextFromRoot(context)
    winches = systems["winches"].GetMyContextFromRoot(context)
    k = robot.num_cables
    state = winches.get_continuous_state_vector().CopyToVector()
    length = robot.winch.encoder_zero_length + robot.winch.transmission * state[:k]
    X_WP: RigidTransform = vector_to_pose(plant.GetPositions(own))
    EB = robot.attachment_points @ X_WP.rotation().matrix().T
    AB = EB + X_WP.translation() - robot.drawing_points
    cable = robot.cable
    cables = cable_energy(AB, length, robot.weight_per_metre, cable.stiffness, cable.drum_run)
    return {
        "platform, kinetic": plant.CalcKineticEnergy(own),
        "platform, gravitational": plant.CalcPotentialEnergy(own),
        "winches": 0.5 * robot.winch.inertia * state[k : 2 * k] @ state[k : 2 * k],
        "cables": float(cables.sum()),
    }


def metered(robot: CableRobot, loop: Diagram, wrench: np.ndarray) -> Diagram:
    """Return a diagram of a loop whose powers are integrated along, by the simulator itself."""
    builder = DiagramBuilder()
    builder.AddNamedSystem("loop", loop)
    powers = builder.AddNamedSystem("powers", Powers(robot, loop, wrench))
    work = builder.AddNamedSystem("work", Integrator(len(Powers.NAMES)))
    for name in Powers.PORTS:
        builder.Connect(loop.GetOutputPort(name), powers.GetInputPort(name))
    builder.Connect(powers.get_output_port(), work.get_input_port())
    for name in ("pose", "tension_at_drawing_point"):
        builder.ExportOutput(loop.GetOutputPort(name), name)
    builder.ExportOutput(work.get_output_port(), "work")
    return builder.Build()


@pytest.mark.parametrize("friction", [False, True])
def test_energy_balances(cogiro: CableRobot, friction: bool) -> None:
    """What the motors and the outside do is what the energies gain and the losses take.

    The robot lifts its platform and turns it, pushed from outside, with all kinds of friction on.
    """
    robot = cogiro.replace(cable=cogiro.cable.replace(damping_time=0.01))
    if friction:
        winch = robot.winch.replace(
            damping=0.2,
            coulomb_torque=0.5,
            coulomb_rate=0.5,
            capstan_exponent=0.1,
            capstan_speed=0.05,
        )
        robot = robot.replace(winch=winch)
    start = RigidTransform(RollPitchYaw([0.02, 0.0, 0.1]), [0.3, -0.2, 0.8])
    goal = RigidTransform(RollPitchYaw([0.0, 0.1, -0.1]), [-0.5, 0.3, 1.8])
    reference = ExponentialApproach(robot, start, goal, gain=1.0, ramp_time=0.5)
    loop = make_joint_space_control(robot, cable_model="ECM", reference=reference)
    wrench = np.array([5.0, -8.0, 6.0, 40.0, 60.0, -30.0])
    diagram = metered(robot, loop, wrench)
    context = rest_context(diagram, start)
    inner = loop.GetMyMutableContextFromRoot(context)
    loop.GetInputPort("external_wrench").FixValue(inner, wrench)
    before = energy(robot, diagram, context)
    simulate(diagram, context, 4.0 if is_compiled() else 1.5, record=[], every=0.5, max_step=0.005)
    after = energy(robot, diagram, context)
    gained = {name: after[name] - before[name] for name in before}
    work = dict(zip(Powers.NAMES, diagram.GetOutputPort("work").Eval(context), strict=True))
    turnover = abs(work["motors"])
    assert turnover > 100.0
    assert gained["platform, gravitational"] > 100.0
    balance = sum(gained.values()) - sum(work.values())
    assert abs(balance) < 1e-5 * turnover
    # What only takes energy does so, and counts: without it the balance would not hold.
    losses = ("viscous", "dry", "capstan") if friction else ()
    for name in (*losses, "structural"):
        assert work[name] < -10.0 * abs(balance)
    if not friction:
        assert work["viscous"] == work["dry"] == work["capstan"] == 0.0
    for name in ("external", "wound up"):
        assert abs(work[name]) > 10.0 * abs(balance)
