"""Linear models of continuous diagrams, by port names."""

from __future__ import annotations

import subprocess
import sys
import warnings
from typing import Any

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import (
    Adder,
    ConstantVectorSource,
    Integrator,
    Linearize,
    LinearSystem,
    LogVectorOutput,
    PassThrough,
    Saturation,
    ZeroOrderHold,
)
from study_samples import POSE, central_differences

from cdpr_drake.diagrams import (
    blocks,
    make_cable_robot,
    make_joint_space_control,
    make_vision_based_control,
    rest_context,
)
from cdpr_drake.diagrams.blocks import continuous_state_names, discrete_state_names
from cdpr_drake.errors import LinearizationError
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.study import LinearizationWarning, Linearizer, equilibrium, linearize
from cdpr_drake.study.linear import vector_names
from cdpr_drake.study.twin import twin_of
from cdpr_drake.systems import ExponentialApproach

LOOPS = {
    "vision": lambda r: make_vision_based_control(r, "ECM", sample_time=None),
    "joint": make_joint_space_control,
    "robot": make_cable_robot,
}
INPUT = {"vision": "desired_pose", "joint": "desired_pose", "robot": "desired_motor_angles"}


@pytest.fixture(scope="module")
def loop(cogiro: CableRobot) -> tuple[Any, Any]:
    diagram = make_vision_based_control(cogiro, "ECM", sample_time=None)
    return diagram, equilibrium(diagram, POSE)


# --- right


@pytest.mark.parametrize("name", LOOPS)
def test_it_equals_drake_s_own(cogiro: CableRobot, name: str) -> None:
    diagram = LOOPS[name](cogiro)
    context = equilibrium(diagram, POSE)
    port = "pose_error" if name != "robot" else "pose"
    model = linearize(diagram, context, [INPUT[name]], [port])
    drake = Linearize(
        diagram,
        context,
        diagram.GetInputPort(INPUT[name]).get_index(),
        diagram.GetOutputPort(port).get_index(),
    )
    for ours, theirs in zip(
        (model.A, model.B, model.C, model.D), (drake.A(), drake.B(), drake.C(), drake.D()),
        strict=True,
    ):  # fmt: skip
        np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-12)


def test_it_equals_central_differences(loop: tuple[Any, Any]) -> None:
    inputs = ["desired_pose", "external_wrench", "desired_twist", "pose_noise", "tension_noise"]
    outputs = ["pose_error", "pose_error_seen", "motor_torques", "measured_tension", "dbeta",
               "commanded_motor_rates", "tangents_at_attachment_point"]  # fmt: skip
    model = linearize(*loop, inputs, outputs)
    differences = central_differences(*loop, inputs, outputs)
    for ours, theirs in zip((model.A, model.B, model.C, model.D), differences, strict=True):
        assert np.abs(ours - theirs).max() <= 1e-6 * np.abs(ours).max()
    assert np.abs(model.B).max() > 0.0 and np.abs(model.D).max() > 0.0


def test_away_from_rest_it_equals_central_differences(loop: tuple[Any, Any]) -> None:
    diagram, rest = loop
    context = diagram.CreateDefaultContext()
    context.SetTimeStateAndParametersFrom(rest)
    diagram.GetInputPort("desired_pose").FixValue(
        context, np.add(POSE, [0.1, 0.0, -0.2, 0.3, 0.2, 0.1])
    )
    model = linearize(diagram, context, ["desired_pose"], ["pose_error"], require_equilibrium=False)
    A, B, C, D = central_differences(diagram, context, ["desired_pose"], ["pose_error"])
    assert not model.is_equilibrium
    assert np.abs(model.derivatives).max() > 1e-3
    for ours, theirs in ((model.A, A), (model.B, B), (model.C, C), (model.D, D)):
        assert np.abs(ours - theirs).max() <= 1e-6 * max(np.abs(ours).max(), 1.0)


@pytest.mark.needs("numba")
def test_drake_s_own_linearize_works_on_every_continuous_diagram() -> None:
    """In another process, for where it does not work it ends the process."""
    code = """
from pydrake.systems.primitives import Linearize
from cdpr_drake.diagrams import *
from cdpr_drake.model.robot import load_robot
from cdpr_drake.study import equilibrium
robot = load_robot("cogiro")
loops = [make_vision_based_control(robot, m, sample_time=None)
         for m in ("ECM", "CMWE", "SCMWE", "SLSM")]
loops += [make_joint_space_control(robot), make_cable_robot(robot)]
for loop in loops:
    context = equilibrium(loop, [0.0, 0.0, 0.1, -0.5, 0.3, 1.5])
    print(Linearize(loop, context).A().shape[0])
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert run.stdout.split() == ["52"] * 4 + ["36"] * 2


def test_exact_knowledge_gives_six_eigenvalues_at_minus_lambda(loop: tuple[Any, Any]) -> None:
    values = linearize(*loop, [], []).eigenvalues
    values = values[np.argsort(np.abs(values))]
    assert np.abs(values[:2]).max() < 1e-6 < np.abs(values[2])
    np.testing.assert_allclose(values[2:8], -0.1, rtol=0.01)
    assert values[2:].real.max() < 0.0


def test_near_the_winches_integral_action_it_is_off(cogiro: CableRobot) -> None:
    """At lambda = Ki / Kp the PID's slow poles are in the way."""
    gain = cogiro.winch.integral_gain / cogiro.winch.proportional_gain
    diagram = make_vision_based_control(cogiro, "ECM", gain, sample_time=None)
    values = linearize(diagram, equilibrium(diagram, POSE), [], []).eigenvalues
    nearest = np.sort(np.abs(values / -gain - 1.0))[:6]
    assert nearest.max() > 1e-3
    assert values[np.abs(values) > 1e-6].real.max() < 0.0


# --- names


def test_each_state_has_the_name_of_its_place(cogiro: CableRobot) -> None:
    diagram = make_vision_based_control(cogiro, latency=0.12)
    context = diagram.CreateDefaultContext()
    names = continuous_state_names(diagram)
    assert len(set(names)) == len(names) == 52
    systems = dict(blocks(diagram))

    def at(*path: str) -> Any:
        return systems[path].GetMyMutableContextFromRoot(context)

    plant = systems["robot", "platform"]
    plant.SetPositions(at("robot", "platform"), np.arange(1.0, 7.0))
    plant.SetVelocities(at("robot", "platform"), np.arange(7.0, 13.0))
    at("robot", "winches").SetContinuousState(np.arange(100.0, 124.0))
    at("robot", "load_cells").SetContinuousState(np.arange(200.0, 208.0))
    at("robot", "integrator").SetContinuousState(np.arange(300.0, 308.0))
    x = dict(zip(names, context.get_continuous_state_vector().CopyToVector(), strict=True))
    assert [x[f"robot/platform/{c}"] for c in ("roll", "pitch", "yaw", "x", "y", "z")] == [
        1, 2, 3, 4, 5, 6
    ]  # fmt: skip
    assert x["robot/platform/omega_x"] == 7.0 and x["robot/platform/v_z"] == 12.0
    assert x["robot/winches/angle[3]"] == 102.0
    assert x["robot/winches/rate[1]"] == 108.0 and x["robot/winches/integral[8]"] == 123.0
    assert x["robot/load_cells/tension[8]"] == 207.0 and x["robot/integrator/angle[1]"] == 300.0


def test_each_discrete_state_has_the_name_of_its_place(cogiro: CableRobot) -> None:
    diagram = make_vision_based_control(cogiro, latency=0.12)
    context = rest_context(diagram, POSE)
    systems = dict(blocks(diagram))
    delay = systems[("sampled_pose",)]
    own = delay.GetMyMutableContextFromRoot(context)
    # Update with marked poses: what came last is not 1 or 2 frames ago.
    for mark in (1.0, 2.0, 3.0):
        delay.get_input_port().FixValue(own, np.full(6, mark))
        own.SetDiscreteState(delay.EvalUniquePeriodicDiscreteUpdate(own).value())
    groups = [context.get_discrete_state(i).CopyToVector() for i in range(5)]
    names = discrete_state_names(diagram)
    d = dict(zip(names, np.concatenate(groups), strict=True))
    assert d["sampled_pose/yaw"] == 3.0
    assert d["sampled_pose/1_frames_ago/x"] == 2.0 and d["sampled_pose/2_frames_ago/roll"] == 1.0
    assert d["plausible_tension/last_change[1]"] > 100.0 and d["plausible_tension/stuck[8]"] == 0.0
    assert "held_rates[8]" in d and "sampled_tangents/1_frames_ago[3]/z" in d


def test_the_names_of_vectors() -> None:
    assert vector_names("desired_pose", 6)[:4] == (
        "desired_pose/roll", "desired_pose/pitch", "desired_pose/yaw", "desired_pose/x"
    )  # fmt: skip
    assert vector_names("pose_error", 6)[0] == "pose_error/rotation_x"
    assert vector_names("motor_torques", 8)[-1] == "motor_torques[8]"
    assert vector_names("measured_tangents", 6)[-1] == "measured_tangents[2]/z"
    assert vector_names("speed", 1) == ("speed",)
    assert vector_names("platform_state", 12)[6] == "platform_state/omega_x"


def test_a_block_s_own_names_are_used() -> None:
    tank = Tank()
    assert continuous_state_names(tank) == (f"{tank.get_name()}/level", f"{tank.get_name()}/heat")


class Tank(LeafSystem):
    """A system with names of its own, and no AutoDiffXd."""

    state_names = ("level", "heat")

    def __init__(self) -> None:
        super().__init__()
        self.DeclareContinuousState(2)

    def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
        derivatives.SetFromVector([0.0, 0.0])


# --- never a crash


def linear_diagram(*extra: Any) -> Any:
    """Return a diagram of an integrator "memory" with other systems beside it, not connected."""
    builder = DiagramBuilder()
    memory = builder.AddNamedSystem("memory", Integrator(2))
    builder.ExportInput(memory.get_input_port(), "u")
    builder.ExportOutput(memory.get_output_port(), "y")
    for name, system in extra:
        builder.AddNamedSystem(name, system)
        if system.num_output_ports():
            builder.ExportOutput(system.get_output_port(0), f"{name}_out")
    return builder.Build()


def at_zero(diagram: Any) -> Any:
    context = diagram.CreateDefaultContext()
    for i in range(diagram.num_input_ports()):
        port = diagram.get_input_port(i)
        port.FixValue(context, np.zeros(port.size()))
    return context


def test_constant_outputs_give_rows_of_zeros() -> None:
    """Drake's own Linearize ends the process here."""
    diagram = linear_diagram(("source", ConstantVectorSource([1.0, 2.0])))
    model = linearize(diagram, at_zero(diagram))
    assert model.outputs == ("y[1]", "y[2]", "source_out[1]", "source_out[2]")
    np.testing.assert_array_equal(model.C, [[1, 0], [0, 1], [0, 0], [0, 0]])
    np.testing.assert_array_equal(model.y0, [0, 0, 1, 2])
    np.testing.assert_array_equal(model.B, np.eye(2))
    np.testing.assert_array_equal(linearize(diagram, at_zero(diagram), []).A, np.zeros((2, 2)))


def test_derivatives_without_derivatives_give_zeros() -> None:
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("source", ConstantVectorSource([0.0, 0.0]))
    memory = builder.AddNamedSystem("memory", Integrator(2))
    builder.Connect(source.get_output_port(), memory.get_input_port())
    diagram = builder.Build()
    model = linearize(diagram, diagram.CreateDefaultContext())
    np.testing.assert_array_equal(model.A, np.zeros((2, 2)))
    assert model.B.shape == (2, 0) and model.C.shape == (0, 2)


def test_a_diagram_without_state_has_a_model() -> None:
    system = PassThrough(3)
    model = linearize(system, at_zero(system))
    np.testing.assert_array_equal(model.D, np.eye(3))
    assert model.A.shape == (0, 0) and model.is_equilibrium


def test_saturation_and_loggers_are_in_nobody_s_way() -> None:
    builder = DiagramBuilder()
    clip = builder.AddNamedSystem("clip", Saturation([-1.0], [1.0]))
    memory = builder.AddNamedSystem("memory", Integrator(1))
    builder.Connect(clip.get_output_port(), memory.get_input_port())
    builder.ExportInput(clip.get_input_port(), "u")
    LogVectorOutput(memory.get_output_port(), builder)
    diagram = builder.Build()
    assert linearize(diagram, at_zero(diagram)).B == 1.0


class Abstract(LeafSystem):
    def __init__(self) -> None:
        super().__init__()
        self.DeclareAbstractState(Value("x"))


@pytest.mark.parametrize(
    "system",
    [
        ZeroOrderHold(0.1, 2),
        Abstract(),
        LinearSystem(np.eye(2), np.eye(2), np.eye(2), np.eye(2), 0.1),
    ],
)
def test_a_block_in_the_way_is_named(system: Any) -> None:
    with pytest.raises(LinearizationError, match='block "culprit"'):
        linearize(*(lambda d: (d, d.CreateDefaultContext()))(linear_diagram(("culprit", system))))


def test_a_block_without_autodiff_is_linearised_by_differences_and_named() -> None:
    diagram = linear_diagram(("tank", Tank()), ("pump", Pump()))
    context = diagram.CreateDefaultContext()
    diagram.GetInputPort("u").FixValue(context, [1.0, 2.0])
    context.SetContinuousState([0.0, 0.0, 0.3, 0.0, 2.0])
    model = linearize(diagram, context, require_equilibrium=False)
    assert model.by_differences == ("tank", "pump")
    assert model.states[2:] == ("tank/level", "tank/heat", "pump/x[1]")
    np.testing.assert_allclose(model.A[4, 4], -3.0 * 2.0**2, rtol=1e-12)
    np.testing.assert_allclose(model.B[:2], np.eye(2), atol=1e-12)
    np.testing.assert_allclose(model.C[-1], [0.0, 0.0, 0.0, 0.0, np.cos(2.0)], atol=1e-10)
    assert np.count_nonzero(model.A) == 1


class Pump(LeafSystem):
    """A nonlinear system without AutoDiffXd: dx/dt = 8 - x^3, y = sin x."""

    def __init__(self) -> None:
        super().__init__()
        self.DeclareContinuousState(1)
        self.DeclareVectorOutputPort("y", 1, self._calc)

    def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
        derivatives.SetFromVector(8.0 - context.get_continuous_state_vector().CopyToVector() ** 3)

    def _calc(self, context: Any, output: Any) -> None:
        output.SetFromVector(np.sin(context.get_continuous_state_vector().CopyToVector()))


def test_noise_and_sampling_are_named(cogiro: CableRobot) -> None:
    noisy = make_vision_based_control(cogiro, sample_time=None, noise=True)
    with pytest.raises(LinearizationError, match=r'"pose_noise" \(RandomSource\)'):
        linearize(noisy, noisy.CreateDefaultContext())
    sampled = make_vision_based_control(cogiro)
    with pytest.raises(LinearizationError, match=r"held_rates.*one_period_map"):
        Linearizer(sampled)


def test_a_required_port_that_is_open_is_named(cogiro: CableRobot, loop: tuple[Any, Any]) -> None:
    diagram, rest = loop
    context = diagram.CreateDefaultContext()
    context.SetTimeStateAndParametersFrom(rest)
    for inputs in (None, ["desired_pose"], ["external_wrench"]):
        with pytest.raises(LinearizationError, match=r'input port "desired_pose" is open.*"servo"'):
            linearize(diagram, context, inputs)
    builder = DiagramBuilder()
    adder = builder.AddNamedSystem("adder", Adder(2, 1))
    builder.ExportInput(adder.get_input_port(0), "u")
    builder.ExportOutput(adder.get_output_port(), "y")
    open_inside = builder.Build()
    with pytest.raises(LinearizationError, match='input port "u1" is open, and block "adder"'):
        linearize(open_inside, at_zero(open_inside))


def test_optional_ports_stay_open(loop: tuple[Any, Any]) -> None:
    model = linearize(*loop)
    assert {name.split("/")[0] for name in model.inputs} == {"desired_pose"}
    wide = linearize(*loop, ["external_wrench", "desired_pose"], ["pose"])
    assert wide.inputs[0] == "external_wrench/torque_x"
    np.testing.assert_array_equal(wide.A, model.A)
    np.testing.assert_array_equal(wide.B[:, 6:], model.B)


def test_an_unknown_port_is_refused(loop: tuple[Any, Any]) -> None:
    with pytest.raises(KeyError, match=r"no vector input port.*desired_pose"):
        linearize(*loop, ["nonsense"])
    with pytest.raises(KeyError, match=r"no vector output port.*pose_error"):
        linearize(*loop, [], ["nonsense"])


# --- the point


def test_off_equilibrium_warns_raises_or_is_silent_as_asked(loop: tuple[Any, Any]) -> None:
    diagram, rest = loop
    context = diagram.CreateDefaultContext()
    context.SetTimeStateAndParametersFrom(rest)
    diagram.GetInputPort("desired_pose").FixValue(context, np.add(POSE, [0, 0, 0, 0.1, 0, 0]))
    with pytest.warns(
        LinearizationWarning, match="not an equilibrium: d/dt robot/integrator/angle"
    ):
        linearize(diagram, context, [], [])
    with pytest.raises(LinearizationError, match="not an equilibrium"):
        linearize(diagram, context, [], [], require_equilibrium=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        linearize(diagram, context, [], [], require_equilibrium=False)
        linearize(diagram, rest, [], [], require_equilibrium=True)


def test_a_gain_on_its_ramp_is_warned_of(cogiro: CableRobot, loop: tuple[Any, Any]) -> None:
    diagram, _ = loop
    context = rest_context(diagram, POSE)
    with pytest.warns(LinearizationWarning, match='block "servo".*gain of 0/s.*1 s or later') as w:
        model = linearize(diagram, context, [], [])
    assert w[0].filename == __file__
    assert np.sum(np.abs(model.eigenvalues) < 1e-6) == 8  # nothing is controlled yet
    with pytest.warns(LinearizationWarning, match='block "servo"') as w:
        Linearizer(diagram)(context, [], [])
    assert w[0].filename == __file__


def test_a_moving_reference_is_frozen(cogiro: CableRobot) -> None:
    start = np.add(POSE, [0, 0, 0, 0.5, 0, 0])
    reference = ExponentialApproach(cogiro, start, POSE)
    diagram = make_vision_based_control(cogiro, sample_time=None, reference=reference)
    context = rest_context(diagram, start)
    context.SetTime(5.0)
    model = linearize(diagram, context, [], ["pose_error"], require_equilibrium=False)
    assert model.time == 5.0 and model.A.shape == (52, 52)
    assert "robot/platform/x" in model.states


def test_a_diagram_is_converted_once(loop: tuple[Any, Any]) -> None:
    diagram, rest = loop
    twin = twin_of(diagram)
    linearize(diagram, rest, [], [])
    assert twin_of(diagram) is twin


# --- to other packages


def test_it_becomes_a_drake_and_a_scipy_system(loop: tuple[Any, Any]) -> None:
    model = linearize(*loop, ["desired_pose"], ["pose_error"])
    drake, scipy = model.to_drake(), model.to_scipy()
    for key in "ABCD":
        np.testing.assert_array_equal(getattr(drake, key)(), getattr(model, key))
        np.testing.assert_array_equal(getattr(scipy, key), getattr(model, key))
    assert repr(model) == "<StateSpace: 52 states, 6 inputs, 6 outputs at t = 1 s>"


def test_it_becomes_a_control_system_or_says_what_is_missing(loop: tuple[Any, Any]) -> None:
    model = linearize(*loop, ["desired_pose"], ["pose_error"])
    try:
        import control  # noqa: F401
    except ImportError:
        with pytest.raises(ImportError, match="pip install control"):
            model.to_control()
        return
    system = model.to_control()
    np.testing.assert_array_equal(system.A, model.A)
    assert system.state_labels == list(model.states)
    assert system.output_labels == list(model.outputs)


def test_parts_of_a_model_are_selected_by_name(loop: tuple[Any, Any]) -> None:
    model = linearize(*loop, ["desired_pose", "external_wrench"], ["pose_error", "pose"])
    part = model.select(["external_wrench/force_z"], ["pose", "pose_error/x"])
    assert part.inputs == ("external_wrench/force_z",)
    pose = [f"pose/{c}" for c in ("roll", "pitch", "yaw", "x", "y", "z")]
    assert part.outputs == (*pose, "pose_error/x")
    np.testing.assert_array_equal(part.B[:, 0], model.B[:, 11])
    np.testing.assert_array_equal(part.C[-1], model.C[3])
    assert part.y0[3] == pytest.approx(POSE[3])
    with pytest.raises(KeyError, match='no "nonsense"'):
        model.select(["nonsense"])
