"""The control law, pose error, integrator, inverse kinematics and reference as systems."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.analysis import Simulator
from samples import derivative, rotation
from system_checks import check_derivatives, evaluate, fixed_context
from test_servo import few_cables, tilted_target
from test_systems import GOAL, START, usual_inputs

from cdpr_drake.errors import GeometryError, TensionError
from cdpr_drake.model.inverse_kinematics import InverseKinematics
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import pose_to_vector, skew, vector_to_pose
from cdpr_drake.model.servo import MotorRateLaw, ServoSettings, pose_error
from cdpr_drake.systems import (
    ExponentialApproach,
    InverseKinematicsAngles,
    MotorAngleIntegrator,
    PoseError,
    PositionBasedVisualServo,
)

# --- the law


def law_inputs(robot: CableRobot, *, twist: bool = True) -> dict[str, np.ndarray]:
    return usual_inputs(robot, "PositionBasedVisualServo", optional=twist)


@pytest.mark.parametrize("twist", [True, False])
@pytest.mark.parametrize("cable_model", ["ECM", "CMWE", "SCMWE", "SLSM"])
def test_the_system_evaluates_the_law(cogiro: CableRobot, cable_model: str, twist: bool) -> None:
    robot = tilted_target(cogiro)
    settings = ServoSettings(cable_model=cable_model, gain=0.3, ramp_time=2.0)
    system = PositionBasedVisualServo(robot, settings)
    inputs = law_inputs(robot, twist=twist)
    context = fixed_context(system, inputs)
    parts = ("measured_pose", "desired_pose", "desired_twist", "measured_tension")
    values = {"desired_twist": np.zeros(6), **inputs}
    z = np.concatenate([values[p] for p in (*parts, "measured_tangents")])
    law = MotorRateLaw(robot, settings)
    for time, gain in ((0.0, 0.0), (0.5, 0.075), (7.0, 0.3)):
        context.SetTime(time)
        np.testing.assert_allclose(
            system.GetOutputPort("motor_rates").Eval(context), law(z, gain)[:-6], rtol=1e-13
        )
    s = pose_error(inputs["measured_pose"], inputs["desired_pose"], robot.cameras.X_PM)
    np.testing.assert_allclose(system.GetOutputPort("pose_error").Eval(context), s, atol=1e-14)


def test_default_settings(cogiro: CableRobot) -> None:
    assert PositionBasedVisualServo(cogiro).settings == ServoSettings(gain=0.1)


@pytest.mark.parametrize("twist", [True, False])
@pytest.mark.parametrize("cable_model", ["ECM", "SCMWE", "SLSM"])
def test_derivatives_of_the_law(cogiro: CableRobot, cable_model: str, twist: bool) -> None:
    robot = tilted_target(cogiro)
    settings = ServoSettings(cable_model=cable_model, ramp_time=0.0, model_drum_run=True)
    check_derivatives(PositionBasedVisualServo(robot, settings), law_inputs(robot, twist=twist))


def test_derivatives_of_the_law_at_its_speed_limit_and_on_its_ramp(cogiro: CableRobot) -> None:
    settings = ServoSettings(gain=0.5, ramp_time=4.0, max_speed=0.03)
    inputs = law_inputs(cogiro, twist=False)
    check_derivatives(PositionBasedVisualServo(cogiro, settings), inputs, time=3.0)


def test_the_law_refuses_a_robot_it_cannot_control(cogiro: CableRobot) -> None:
    with pytest.raises(GeometryError, match="rank below 6"):
        PositionBasedVisualServo(few_cables(cogiro, 5))


# --- pose error


def test_the_pose_error_by_hand(cogiro: CableRobot) -> None:
    system = PoseError(cogiro)  # M half a metre above P, parallel to it
    now, goal = np.array([0, 0, math.pi / 2, 1, 2, 3.0]), np.array([0, 0, 0, 4, 2, 3.0])
    context = fixed_context(system, {"pose": now, "desired_pose": goal})
    s = system.GetOutputPort("pose_error").Eval(context)
    np.testing.assert_allclose(s, [0, 0, -math.pi / 2, 0, -3, 0], atol=1e-14)


@pytest.mark.parametrize("goal", [[0.0] * 6, [2.5, 0.3, -1.0, 1.0, 2.0, 3.0]])
def test_derivatives_of_the_pose_error(cogiro: CableRobot, goal: list[float]) -> None:
    robot = tilted_target(cogiro)
    inputs = {"pose": np.array([0.3, -0.2, 0.5, 0.1, 0.2, 1.0]), "desired_pose": np.array(goal)}
    check_derivatives(PoseError(robot), inputs)
    same = {"pose": inputs["pose"], "desired_pose": inputs["pose"].copy()}
    check_derivatives(PoseError(robot), same)


# --- integrator


def test_the_integrator_integrates(cogiro: CableRobot) -> None:
    system = MotorAngleIntegrator(3)
    rates, start = np.array([1.0, -2.0, 0.5]), np.array([10.0, 20.0, 30.0])
    context = fixed_context(system, {"motor_rates": rates}, start)
    port = system.GetOutputPort("motor_angles")
    np.testing.assert_array_equal(port.Eval(context), start)
    Simulator(system, context).AdvanceTo(2.0)
    np.testing.assert_allclose(port.Eval(context), start + 2.0 * rates, rtol=1e-12)
    check_derivatives(system, {"motor_rates": rates}, start)


# --- inverse kinematics


@pytest.mark.parametrize("cable_model", ["ECM", "CMWE", "SCMWE", "SLSM"])
def test_angles_of_the_inverse_kinematics(cogiro: CableRobot, cable_model: str) -> None:
    winch = cogiro.winch.replace(encoder_zero_length=np.arange(8.0))
    robot = cogiro.replace(winch=winch)
    system = InverseKinematicsAngles(robot, cable_model)
    pose = usual_inputs(cogiro, "InverseKinematicsAngles")["desired_pose"]
    context = fixed_context(system, {"desired_pose": pose})
    lengths = InverseKinematics(robot, cable_model).lengths(pose)
    expected = (lengths - np.arange(8.0)) / 0.0225
    np.testing.assert_allclose(system.GetOutputPort("motor_angles").Eval(context), expected)
    check_derivatives(system, {"desired_pose": pose})


def test_inverse_kinematics_where_there_is_none(cogiro: CableRobot) -> None:
    system = InverseKinematicsAngles(cogiro)
    context = fixed_context(system, {"desired_pose": np.array([0, 0, 0, 6.5, 4.5, 1.0])})
    with pytest.raises(TensionError, match="outside the wrench-feasible workspace"):
        system.GetOutputPort("motor_angles").Eval(context)
    system = InverseKinematicsAngles(few_cables(cogiro, 5))
    context = fixed_context(system, {"desired_pose": np.array([0, 0, 0, 0, 0, 1.0])})
    with pytest.raises(GeometryError, match="rank below 6"):
        system.GetOutputPort("motor_angles").Eval(context)
    with pytest.raises(ValueError, match="unknown cable model"):
        InverseKinematicsAngles(cogiro, "XYZ")


# --- the reference


def reference_pose(system: ExponentialApproach, t: float) -> RigidTransform:
    context = system.CreateDefaultContext()
    context.SetTime(t)
    return vector_to_pose(system.GetOutputPort("desired_pose").Eval(context))


@pytest.mark.parametrize("ramp_time", [0.0, 3.0])
def test_the_reference_is_the_servo_s_own_path(cogiro: CableRobot, ramp_time: float) -> None:
    robot = tilted_target(cogiro)
    start = RigidTransform(rotation([1.0, -1.5, 1.2]), [1.0, -0.5, 0.4])
    system = ExponentialApproach(robot, start, GOAL, gain=0.25, ramp_time=ramp_time)
    X_PM = robot.cameras.X_PM
    s0 = pose_error(start, GOAL, X_PM)
    assert reference_pose(system, 0.0).IsNearlyEqualTo(start, 1e-13)
    for t in (0.1, 1.0, 2.9, 3.1, 20.0):
        # The integral of a gain that rises linearly over the ramp.
        spent = t * t / (2.0 * ramp_time) if t < ramp_time else t - 0.5 * ramp_time
        s = pose_error(reference_pose(system, t), GOAL, X_PM)
        np.testing.assert_allclose(s, math.exp(-0.25 * spent) * s0, atol=1e-13)


@pytest.mark.parametrize("ramp_time", [0.0, 3.0])
@pytest.mark.parametrize("time", [0.5, 2.0, 8.0])
def test_the_reference_s_twist_is_that_of_its_pose(
    cogiro: CableRobot, ramp_time: float, time: float
) -> None:
    robot = tilted_target(cogiro)
    start = RigidTransform(rotation([1.0, -1.5, 1.2]), [1.0, -0.5, 0.4])
    system = ExponentialApproach(robot, start, GOAL, gain=0.25, ramp_time=ramp_time)
    R = reference_pose(system, time).rotation().matrix()
    spin = derivative(lambda t: reference_pose(system, time + t).rotation().matrix()) @ R.T
    velocity = derivative(lambda t: reference_pose(system, time + t).translation())
    context = system.CreateDefaultContext()
    context.SetTime(time)
    twist = system.GetOutputPort("desired_twist").Eval(context)
    np.testing.assert_allclose(skew(twist[:3]), spin, atol=1e-10)
    np.testing.assert_allclose(twist[3:], velocity, atol=1e-10)


def test_the_reference_takes_poses_in_both_forms(cogiro: CableRobot) -> None:
    vectors = ExponentialApproach(cogiro, pose_to_vector(START), pose_to_vector(GOAL))
    poses = ExponentialApproach(cogiro, START, GOAL)
    assert (vectors.gain, vectors.ramp_time) == (0.1, 1.0)
    for t in (0.3, 5.0):
        expected = reference_pose(poses, t)
        assert reference_pose(vectors, t).IsNearlyEqualTo(expected, 1e-13)
    context = poses.CreateDefaultContext()
    context.SetTime(5.0)
    vector = evaluate(poses, context)["desired_pose"]
    expected = RollPitchYaw(reference_pose(poses, 5.0).rotation()).vector()
    np.testing.assert_allclose(vector[:3], expected, atol=1e-14)
