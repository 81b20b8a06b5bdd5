"""Systems of one's own for float and AutoDiffXd: what `scalar_convertible` makes of a class."""

from __future__ import annotations

import ast
import inspect
import pydoc
import textwrap
from typing import Any

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, InitializeAutoDiff
from pydrake.systems.framework import (
    BasicVector,
    Context,
    Diagram,
    DiagramBuilder,
    LeafSystem,
    LeafSystem_,
)
from pydrake.systems.primitives import Integrator

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.study import linearize
from cdpr_drake.systems import WinchDynamics, WinchDynamics_, scalar_convertible, template_of


@scalar_convertible
class Law(LeafSystem):
    """A law of a user's own: a turn towards a desired position, by two gains."""

    def __init__(self, gain: float, *, curvature: float = 0.0) -> None:
        super().__init__()
        self.gain, self.curvature = gain, curvature
        self._position_port = self.DeclareVectorInputPort("position", 1)
        self._desired_port = self.DeclareVectorInputPort("desired", 1)
        self.DeclareVectorOutputPort("rate", 1, self._calc_rate)

    def rate(self, error: np.ndarray) -> np.ndarray:
        return self.gain * error + self.curvature * np.sin(error)

    def _calc_rate(self, context: Context, output: BasicVector) -> None:
        error = self._desired_port.Eval(context) - self._position_port.Eval(context)
        output.SetFromVector(self.rate(error))


@scalar_convertible
class StrongerLaw(Law):
    """A subclass with a constructor and a method that build on those of its base."""

    def __init__(self, factor: float) -> None:
        super().__init__(3.0, curvature=0.5)
        self.factor = factor

    def rate(self, error: np.ndarray) -> np.ndarray:
        return self.factor * super().rate(2.0 * error)


@scalar_convertible
class SameLaw(StrongerLaw):
    """A subclass without a constructor of its own."""


class Undecorated(Law):
    """A subclass which lacks the decorator."""


MADE = {
    "keyword": (lambda: Law(gain=0.3, curvature=0.2), 0.5),
    "positional": (lambda: Law(0.3), 0.3),
    "subclass": (lambda: StrongerLaw(2.0), 2.0 * 3.5 * 2.0),
    "inherited constructor": (lambda: SameLaw(2.0), 2.0 * 3.5 * 2.0),
}
EACH = pytest.mark.parametrize(("make", "slope"), MADE.values(), ids=MADE)


def loop_with(law: LeafSystem) -> Diagram:
    """Return a diagram in a diagram: an integrator that the law moves to a desired position."""
    builder = DiagramBuilder()
    builder.AddNamedSystem("law", law)
    integrator = builder.AddNamedSystem("integrator", Integrator(1))
    position = integrator.get_output_port()
    builder.Connect(law.GetOutputPort("rate"), integrator.get_input_port())
    builder.Connect(position, law.GetInputPort("position"))
    builder.ExportInput(law.GetInputPort("desired"), "desired")
    builder.ExportOutput(position, "position")
    outer = DiagramBuilder()
    inner = outer.AddNamedSystem("loop", builder.Build())
    outer.ExportInput(inner.GetInputPort("desired"), "desired")
    outer.ExportOutput(inner.GetOutputPort("position"), "position")
    return outer.Build()


def rate(law: Any, error: np.ndarray) -> np.ndarray:
    context = law.CreateDefaultContext()
    law.GetInputPort("position").FixValue(context, 0.0 * error)
    law.GetInputPort("desired").FixValue(context, error)
    return law.get_output_port().Eval(context)


@EACH
def test_it_converts_both_ways_with_its_arguments(make: Any, slope: float) -> None:
    system = make()
    system.set_name("mine")
    twin = system.ToAutoDiffXd()
    back = twin.ToScalarType[float]()
    assert type(back) is type(system)
    assert type(twin) is template_of(type(system))[AutoDiffXd]
    for other in (twin, back):
        assert other.get_name() == "mine"
        assert (other.gain, other.curvature) == (system.gain, system.curvature)
    in_autodiff = rate(twin, InitializeAutoDiff(np.zeros(1)).ravel())
    np.testing.assert_allclose(ExtractGradient(in_autodiff), [[slope]], rtol=1e-15)
    np.testing.assert_array_equal(rate(back, np.array([0.7])), rate(system, np.array([0.7])))


@EACH
def test_a_loop_around_it_linearises(make: Any, slope: float) -> None:
    diagram = loop_with(make())
    context = diagram.CreateDefaultContext()
    diagram.GetInputPort("desired").FixValue(context, [0.0])
    model = linearize(diagram, context)
    np.testing.assert_allclose(model.A, [[-slope]], rtol=1e-15)
    (inner,) = diagram.ToAutoDiffXd().GetSystems()
    law = inner.GetSubsystemByName("law")
    assert isinstance(law, Law)


def test_any_scalar_is_an_instance_of_the_class_and_of_no_other() -> None:
    plain, stronger = Law(1.0), StrongerLaw(1.0)
    for law in (plain, plain.ToAutoDiffXd()):
        assert isinstance(law, Law)
        assert not isinstance(law, StrongerLaw | SameLaw | WinchDynamics | Undecorated)
    for law in (stronger, stronger.ToAutoDiffXd()):
        assert isinstance(law, StrongerLaw)
        assert isinstance(law, Law)
        assert not isinstance(law, SameLaw | Undecorated)
    assert isinstance(Undecorated(1.0), Undecorated)
    assert issubclass(Law, LeafSystem)
    assert issubclass(template_of(Law)[AutoDiffXd], LeafSystem_[AutoDiffXd])


def test_a_class_for_autodiff_makes_systems_itself(cogiro: CableRobot) -> None:
    assert isinstance(WinchDynamics_[AutoDiffXd](robot=cogiro), WinchDynamics)
    assert template_of(WinchDynamics) is WinchDynamics_


def test_tools_see_what_was_written() -> None:
    for cls in (Law, template_of(Law)[AutoDiffXd]):
        assert str(inspect.signature(cls)) == "(gain: 'float', *, curvature: 'float' = 0.0)"
    assert str(inspect.signature(SameLaw)) == "(factor: 'float')"
    assert str(inspect.signature(Law.__init__)).startswith("(self, gain: 'float'")
    assert (Law.__name__, Law.__qualname__, Law.__module__) == ("Law", "Law", __name__)
    source = inspect.getsource(Law)
    assert "class Law(LeafSystem):" in source
    assert "SetFromVector" in source
    assert "by two gains" in pydoc.render_doc(Law)
    with pytest.raises(TypeError, match="gain"):
        Law()


def test_a_subclass_without_the_decorator_is_not_taken_for_its_base() -> None:
    """Drake's own classes would turn into the base, and what the subclass adds be lost."""
    with pytest.raises(TypeError, match="Undecorated is not @scalar_convertible"):
        Undecorated(1.0).ToAutoDiffXd()
    with pytest.raises(TypeError, match="Undecorated is not @scalar_convertible"):
        loop_with(Undecorated(1.0)).ToAutoDiffXd()


def test_a_base_without_the_decorator_is_refused() -> None:
    class Base(LeafSystem):
        pass

    with pytest.raises(TypeError, match=r"Derived\(Base\): no LeafSystem"):

        @scalar_convertible
        class Derived(Base):
            pass


def test_the_documented_example_works() -> None:
    text = (scalar_convertible.__doc__ or "").partition("::\n\n")[2]
    example = textwrap.dedent(text[: text.index("\n    `isinstance")])
    assert len(ast.parse(example).body) == 1
    names: dict[str, Any] = globals() | {"LeafSystem": LeafSystem}
    exec(compile("from __future__ import annotations\n" + example, "<example>", "exec"), names)
    spring = names["Spring"](40.0)
    for system in (spring, spring.ToAutoDiffXd()):
        context = system.CreateDefaultContext()
        stretch = InitializeAutoDiff([0.5]).ravel() if system is not spring else [0.5]
        system.get_input_port().FixValue(context, stretch)
        force = system.get_output_port().Eval(context)
        assert force[0] == -20.0
    assert ExtractGradient(force) == [[-40.0]]
