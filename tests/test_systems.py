"""What holds for every system: ports, feedthrough, conversion, documentation, open inputs."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pydrake.common import RandomGenerator
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import AddRandomInputs, RandomSource
from samples import rotation
from system_checks import (
    check_conversion,
    documented_ports,
    feedthrough,
    fixed_context,
    input_sizes,
    output_sizes,
)

from cdpr_drake import systems
from cdpr_drake.errors import CableError, SimulationError
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.servo import ServoSettings

# Those for AutoDiffXd too; the sampled cameras have their own tests, test_vision_systems.
NAMES = tuple(name for name in systems.__all__ if f"{name}_" in systems.__all__)
EACH_SYSTEM = pytest.mark.parametrize("name", NAMES)

START = RigidTransform(rotation([0.1, -0.05, 0.2]), [0.4, -0.3, 1.0])
GOAL = RigidTransform([-0.5, 0.2, 1.6])
SETTINGS = ServoSettings(cable_model="ECM", gain=0.2, ramp_time=0.0, model_drum_run=True)

# How each system is made for a robot, and the attributes that hold its parameters.
MAKE: dict[str, tuple[Callable[[CableRobot], LeafSystem], tuple[str, ...]]] = {
    "CatenaryCableForce": (lambda r: systems.CatenaryCableForce(r), ("robot",)),
    "WinchDynamics": (lambda r: systems.WinchDynamics(r), ("robot",)),
    "CameraMeasurement": (
        lambda r: systems.CameraMeasurement(r, misplaced(r)),
        ("robot", "believed"),
    ),
    "CableTangentCameras": (lambda r: systems.CableTangentCameras(r), ("robot",)),
    "LoadCellFilter": (
        lambda r: systems.LoadCellFilter(r, misplaced(r)),
        ("robot", "believed", "outages"),
    ),
    "PlausibleTension": (lambda r: systems.PlausibleTension(r), ("robot", "sample_time")),
    "PositionBasedVisualServo": (
        lambda r: systems.PositionBasedVisualServo(r, SETTINGS),
        ("robot", "settings"),
    ),
    "PoseError": (lambda r: systems.PoseError(r), ("robot",)),
    "MotorAngleIntegrator": (
        lambda r: systems.MotorAngleIntegrator(r.num_cables),
        ("num_cables",),
    ),
    "InverseKinematicsAngles": (
        lambda r: systems.InverseKinematicsAngles(r, "ECM"),
        ("robot", "cable_model"),
    ),
    "ExponentialApproach": (
        lambda r: systems.ExponentialApproach(r, START, GOAL, gain=0.3, ramp_time=2.0),
        ("robot", "start", "goal", "gain", "ramp_time"),
    ),
    "ZeroWhenOpen": (lambda r: systems.ZeroWhenOpen(5), ("size",)),
}

K = 8
# Inputs and outputs with their sizes for eight cables, and the pairs with direct feedthrough.
INPUTS: dict[str, dict[str, int]] = {
    "CatenaryCableForce": {
        "platform_state": 12,
        "unstrained_length": K,
        "unstrained_length_rate": K,
    },
    "WinchDynamics": {"desired_motor_angle": K, "tension_at_drawing_point": K},
    "CameraMeasurement": {"pose": 6, "noise": 6},
    "CableTangentCameras": {"tangents": 3 * K, "noise": 3 * K},
    "LoadCellFilter": {"tension_at_winch": K, "noise": K},
    "PlausibleTension": {"measured_pose": 6, "measured_tension": K},
    "PositionBasedVisualServo": {
        "measured_pose": 6,
        "measured_tangents": 3 * K,
        "measured_tension": K,
        "desired_pose": 6,
        "desired_twist": 6,
    },
    "PoseError": {"pose": 6, "desired_pose": 6},
    "MotorAngleIntegrator": {"motor_rates": K},
    "InverseKinematicsAngles": {"desired_pose": 6},
    "ExponentialApproach": {},
    "ZeroWhenOpen": {"u": 5},
}
OUTPUTS: dict[str, dict[str, int]] = {
    "CatenaryCableForce": {
        "platform_wrench": 6,
        "tension_at_drawing_point": K,
        "tension_at_attachment_point": K,
        "tangents_at_drawing_point": 3 * K,
        "tangents_at_attachment_point": 3 * K,
        "dbeta": K,
        "packed": 6 + 9 * K,
    },
    "WinchDynamics": {
        "unstrained_length": K,
        "unstrained_length_rate": K,
        "motor_angle": K,
        "motor_rate": K,
        "motor_torque": K,
        "tension_at_winch": K,
        "state": 3 * K,
    },
    "CameraMeasurement": {"measured_pose": 6},
    "CableTangentCameras": {"measured_tangents": 3 * K},
    "LoadCellFilter": {"measured_tension": K},
    "PlausibleTension": {"plausible_tension": K, "cell_health": K},
    "PositionBasedVisualServo": {"motor_rates": K, "pose_error": 6},
    "PoseError": {"pose_error": 6},
    "MotorAngleIntegrator": {"motor_angles": K},
    "InverseKinematicsAngles": {"motor_angles": K},
    "ExponentialApproach": {"desired_pose": 6, "desired_twist": 6},
    "ZeroWhenOpen": {"y": 5},
}
STATES = {"WinchDynamics": 3 * K, "LoadCellFilter": K, "MotorAngleIntegrator": K}


def all_pairs(name: str) -> set[tuple[str, str]]:
    return {(i, o) for i in INPUTS[name] for o in OUTPUTS[name]}


FEEDTHROUGH: dict[str, set[tuple[str, str]]] = {
    "CatenaryCableForce": all_pairs("CatenaryCableForce"),
    "WinchDynamics": {
        ("desired_motor_angle", "motor_torque"),
        ("tension_at_drawing_point", "tension_at_winch"),
    },
    "CameraMeasurement": all_pairs("CameraMeasurement"),
    "CableTangentCameras": all_pairs("CableTangentCameras"),
    "LoadCellFilter": set(),
    "PlausibleTension": all_pairs("PlausibleTension"),
    "PositionBasedVisualServo": {(i, "motor_rates") for i in INPUTS["PositionBasedVisualServo"]}
    | {("measured_pose", "pose_error"), ("desired_pose", "pose_error")},
    "PoseError": all_pairs("PoseError"),
    "MotorAngleIntegrator": set(),
    "InverseKinematicsAngles": all_pairs("InverseKinematicsAngles"),
    "ExponentialApproach": set(),
    "ZeroWhenOpen": {("u", "y")},
}
OPTIONAL = {
    "CameraMeasurement": {"noise"},
    "CableTangentCameras": {"noise"},
    "LoadCellFilter": {"noise"},
    "PositionBasedVisualServo": {"desired_twist"},
    "ZeroWhenOpen": {"u"},
}


def misplaced(robot: CableRobot) -> CableRobot:
    """Return a robot whose calibration of cameras and load cells is off."""
    cameras = robot.cameras
    wrong = cameras.replace(
        X_WF=cameras.X_WF @ RigidTransform(rotation([0.01, -0.02, 0.03]), [0.02, 0.01, -0.03]),
        X_PM=cameras.X_PM @ RigidTransform(rotation([-0.02, 0.01, 0.02]), [0.01, 0.0, 0.02]),
    )
    cells = robot.load_cells.replace(
        bias=np.linspace(5.0, 20.0, robot.num_cables),
        gain=np.linspace(0.9, 1.1, robot.num_cables),
    )
    return robot.replace(cameras=wrong, load_cells=cells)


def usual_inputs(robot: CableRobot, name: str, *, optional: bool = True) -> dict[str, np.ndarray]:
    """Return values for the inputs of a system, near a robot at rest but moving."""
    generator = np.random.default_rng(0)
    k = robot.num_cables
    rest = rest_state(robot, START)
    down = np.array([0.0, 0.0, -1.0])
    tangents = down + generator.normal(size=(k, 3))
    state = np.concatenate(
        [np.array([0.1, -0.05, 0.2, 0.4, -0.3, 1.0]), generator.uniform(-0.3, 0.3, 6)]
    )
    values = {
        "platform_state": state,
        "pose": state[:6],
        "measured_pose": state[:6],
        "desired_pose": np.array([0.05, 0.1, -0.1, 0.6, -0.1, 1.3]),
        "desired_twist": np.array([0.01, 0.02, -0.03, 0.1, -0.2, 0.05]),
        "unstrained_length": rest.unstrained_length - 0.002,
        "unstrained_length_rate": generator.uniform(-0.1, 0.1, k),
        "tension_at_drawing_point": rest.tension_at_drawing_point,
        "tension_at_winch": rest.tension_at_drawing_point,
        "measured_tension": rest.tension_at_drawing_point,
        "desired_motor_angle": generator.uniform(-0.1, 0.1, k),
        "motor_rates": generator.uniform(-2.0, 2.0, k),
        "tangents": (tangents / np.linalg.norm(tangents, axis=1, keepdims=True)).ravel(),
        "noise": generator.normal(size=INPUTS[name].get("noise", 0)),
        "u": np.arange(5.0),
    }
    values["measured_tangents"] = values["tangents"]
    skipped = set() if optional else OPTIONAL.get(name, set())
    return {port: values[port] for port in INPUTS[name] if port not in skipped}


def usual_state(name: str) -> np.ndarray | None:
    """Return the continuous state of a system, if it has one."""
    size = STATES.get(name)
    return np.random.default_rng(1).uniform(-0.05, 0.05, size) if size else None


def make(name: str, robot: CableRobot) -> LeafSystem:
    system = MAKE[name][0](robot)
    system.set_name(name)
    return system


def test_every_system_is_in_the_tables() -> None:
    for table in (MAKE, INPUTS, OUTPUTS, FEEDTHROUGH):
        assert set(table) == set(NAMES)


@EACH_SYSTEM
def test_ports_states_and_sizes(cogiro: CableRobot, name: str) -> None:
    system = make(name, cogiro)
    assert input_sizes(system) == INPUTS[name]
    assert output_sizes(system) == OUTPUTS[name]
    context = system.CreateDefaultContext()
    assert context.num_continuous_states() == STATES.get(name, 0)
    assert context.num_total_states() == context.num_continuous_states()


@EACH_SYSTEM
def test_the_exact_feedthrough(cogiro: CableRobot, name: str) -> None:
    assert feedthrough(make(name, cogiro)) == FEEDTHROUGH[name]


@EACH_SYSTEM
@pytest.mark.parametrize("optional", [True, False], ids=["connected", "open"])
def test_conversion_keeps_everything(cogiro: CableRobot, name: str, optional: bool) -> None:
    inputs = usual_inputs(cogiro, name, optional=optional)

    def context(system: Any) -> Context:
        context = fixed_context(system, inputs, usual_state(name))
        context.SetTime(1.5)
        return context

    check_conversion(make(name, cogiro), context, *MAKE[name][1])


@EACH_SYSTEM
def test_the_documented_ports_are_the_real_ones(cogiro: CableRobot, name: str) -> None:
    system = make(name, cogiro)
    documented, inputs, outputs = documented_ports(type(system), {})
    assert documented == name == type(system).__name__
    assert set(inputs) == set(INPUTS[name])
    assert {port for port, remark in inputs.items() if remark == "optional"} == OPTIONAL.get(
        name, set()
    )
    assert set(outputs) == set(OUTPUTS[name])
    assert not any(outputs.values())


@EACH_SYSTEM
def test_the_constructor_says_what_it_takes(name: str) -> None:
    cls = getattr(systems, name)
    parameters = inspect.signature(cls).parameters
    kinds = {p.kind for p in parameters.values()}
    assert inspect.Parameter.VAR_POSITIONAL not in kinds
    assert inspect.Parameter.VAR_KEYWORD not in kinds
    assert not {"self", "converter"} & set(parameters)
    arguments = cls.__doc__.partition("Args:")[2].partition("Raises:")[0]
    assert all(f" {p}: " in arguments for p in parameters)
    # The template takes the same scalar types and gives the same class.
    template = getattr(systems, f"{name}_")
    assert template[None] is template[float] is cls


@EACH_SYSTEM
def test_inputs_that_may_stay_open_do_and_the_others_do_not(cogiro: CableRobot, name: str) -> None:
    system = make(name, cogiro)
    everything = usual_inputs(cogiro, name)
    for port in everything:
        context = fixed_context(
            system, {n: v for n, v in everything.items() if n != port}, usual_state(name)
        )
        used = [o for i, o in FEEDTHROUGH[name] if i == port]
        for output in OUTPUTS[name]:
            if output in used and port not in OPTIONAL.get(name, set()):
                with pytest.raises((RuntimeError, ValueError), match=port):
                    system.GetOutputPort(output).Eval(context)
            else:
                assert np.all(np.isfinite(system.GetOutputPort(output).Eval(context)))


@EACH_SYSTEM
def test_open_inputs_count_as_zero(cogiro: CableRobot, name: str) -> None:
    system = make(name, cogiro)
    open_inputs = usual_inputs(cogiro, name, optional=False)
    zeros = {port: np.zeros(INPUTS[name][port]) for port in OPTIONAL.get(name, set())}
    open_context = fixed_context(system, open_inputs, usual_state(name))
    zero_context = fixed_context(system, open_inputs | zeros, usual_state(name))
    for output in OUTPUTS[name]:
        port = system.GetOutputPort(output)
        np.testing.assert_array_equal(port.Eval(open_context), port.Eval(zero_context))
    if name in STATES:
        np.testing.assert_array_equal(
            system.EvalTimeDerivatives(open_context).CopyToVector(),
            system.EvalTimeDerivatives(zero_context).CopyToVector(),
        )


@pytest.mark.parametrize("name", ["CameraMeasurement", "CableTangentCameras", "LoadCellFilter"])
def test_noise_is_asked_for_as_gaussian(cogiro: CableRobot, name: str) -> None:
    """Drake's own tool finds the port and feeds it standard normal numbers."""
    builder = DiagramBuilder()
    builder.AddNamedSystem("it", make(name, cogiro))
    assert AddRandomInputs(0.1, builder) == 1
    diagram = builder.Build()
    (source,) = (s for s in diagram.GetSystems() if isinstance(s, RandomSource))
    draws = []
    for seed in range(100):
        context = diagram.CreateDefaultContext()
        diagram.SetRandomContext(context, RandomGenerator(seed))
        draws.append(source.get_output_port().Eval(source.GetMyContextFromRoot(context)))
    draws = np.array(draws)
    assert draws.shape == (100, INPUTS[name]["noise"])
    assert abs(draws.mean()) < 5.0 / np.sqrt(draws.size)
    assert draws.var() == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / draws.size))


@EACH_SYSTEM
def test_a_system_keeps_no_state_of_its_own(cogiro: CableRobot, name: str) -> None:
    """Evaluations in another context, at another state, leave no trace."""
    system = make(name, cogiro)
    inputs, state = usual_inputs(cogiro, name), usual_state(name)
    context = fixed_context(system, inputs, state)
    before = {o: np.array(system.GetOutputPort(o).Eval(context)) for o in OUTPUTS[name]}
    other = fixed_context(
        system, {n: 1.001 * v for n, v in inputs.items()}, None if state is None else state + 0.01
    )
    other.SetTime(3.0)
    for output in OUTPUTS[name]:
        system.GetOutputPort(output).Eval(other)
    fresh = fixed_context(system, inputs, state)
    for output, value in before.items():
        np.testing.assert_array_equal(system.GetOutputPort(output).Eval(fresh), value)


@EACH_SYSTEM
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")  # uncompiled, of infinities
def test_a_number_that_is_none_is_refused(cogiro: CableRobot, name: str, bad: float) -> None:
    """An output or derivative that depends on it raises, naming the system and the time."""
    plain = make(name, cogiro)
    for system in (plain, plain.ToAutoDiffXd()):
        for port, values in usual_inputs(cogiro, name).items():
            broken = values.copy()
            broken[1] = bad
            inputs = usual_inputs(cogiro, name) | {port: broken}
            context = fixed_context(system, inputs, usual_state(name))
            context.SetTime(2.5)
            for output in (o for i, o in FEEDTHROUGH[name] if i == port):
                with pytest.raises((CableError, SimulationError), match=r"at t = 2\.5 s"):
                    system.GetOutputPort(output).Eval(context)
            if name in STATES:
                with pytest.raises(SimulationError, match=name):
                    system.EvalTimeDerivatives(context)
