"""What every system here shares: scalar conversion, and the chain rule for AutoDiffXd."""

from __future__ import annotations

import functools
import inspect
import math
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from types import CellType, FunctionType
from typing import Any, TypeVar

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.common import RandomDistribution
from pydrake.systems.framework import (
    BasicVector,
    Context,
    InputPort,
    LeafSystem,
    LeafSystem_,
    OutputPort,
)
from pydrake.systems.scalar_conversion import TemplateSystem

from cdpr_drake.errors import SimulationError

C = TypeVar("C", bound=type)
Calc = Callable[[Context, BasicVector], None]
"""What calculates a vector output port."""


def scalar_convertible(cls: C) -> C:
    """Make a system for float and AutoDiffXd from a class written as for float alone.

    The decorated class is the one for float; `ToAutoDiffXd`, `Linearize` and diagrams around it
    make it anew for AutoDiffXd with the arguments it was made with, which are kept, not copied.
    Its methods serve both: what they evaluate and calculate with are arrays of either scalar.
    ::

        @scalar_convertible
        class Spring(LeafSystem):
            def __init__(self, stiffness: float) -> None:
                super().__init__()
                self._stiffness = stiffness
                self._stretch_port = self.DeclareVectorInputPort("stretch", 1)
                self.DeclareVectorOutputPort("force", 1, self._calc_force)

            def _calc_force(self, context: Context, output: BasicVector) -> None:
                output.SetFromVector(-self._stiffness * self._stretch_port.Eval(context))

    `isinstance(system, Spring)` holds for either scalar; `template_of(Spring)[AutoDiffXd]` is the
    class for the other. A subclass needs the decorator again.

    Args:
        cls: a class derived from LeafSystem, or from one that is decorated.

    Raises:
        TypeError: it has another base, or several; at conversion: of an undecorated subclass.
    """
    name, scope = cls.__name__, sys.modules[cls.__module__]

    @TemplateSystem.define(f"{name}_", (float, AutoDiffXd), scope=scope)
    def template(T: type) -> type:
        return _for_scalar(cls, T, template)

    plain = _on_a_short_stack(lambda: template[float])
    # Drake has named it by its template and scalar, and made its own of __init__.
    plain.__name__, plain.__qualname__ = name, cls.__qualname__
    functools.update_wrapper(plain.__init__, cls.__init__)  # type: ignore[misc]
    return plain  # type: ignore[return-value]


def template_of(cls: type) -> Any:
    """Return Drake's template of a system: indexed by a scalar type, it gives the class for that.

    Args:
        cls: a class that `scalar_convertible` has decorated.
    """
    return vars(cls)["_template"]


def _for_scalar(cls: type, T: type, template: Any) -> type:
    """Return `cls` derived from `LeafSystem_[T]`, as Drake's template takes it."""

    def construct(self: Any, *args: Any, converter: Any = None, **kwargs: Any) -> None:
        # A subclass has been here before, with its own.
        vars(self).setdefault("_made_with", (args, kwargs, converter))
        init(self, *args, **kwargs)

    def construct_copy(self: Any, other: Any, converter: Any = None) -> None:
        if vars(type(other)).get("_template") is not template:
            raise TypeError(f"{type(other).__name__} is not @scalar_convertible")
        args, kwargs, _ = other._made_with
        construct(self, *args, converter=converter, **kwargs)

    this_class = CellType()
    members = {name: _rebound(member, this_class) for name, member in vars(cls).items()}
    for name in ("__dict__", "__weakref__"):  # descriptors, which each class gets for itself
        members.pop(name, None)
    own_init = members.pop("__init__", None)
    members |= {"_construct": construct, "_construct_copy": construct_copy, "_template": template}
    if T is not float:  # isinstance asks for this too, so that it holds for either scalar
        members["__class__"] = property(lambda self: template[float])
    made: Any = type(cls.__name__, (_base_for_scalar(cls, T),), members)
    this_class.cell_contents = made
    init = own_init or made.__init__
    parameters = list(inspect.signature(init).parameters.values())[1:]
    made.__signature__ = inspect.Signature(parameters)
    return made


def _base_for_scalar(cls: Any, T: type) -> type:
    """Return what stands for the base of `cls` where the scalar is T."""
    if cls.__bases__ == (LeafSystem,):
        return _leaf_system(T)
    if len(cls.__bases__) > 1 or "_template" not in vars(cls.__base__):
        bases = ", ".join(base.__name__ for base in cls.__bases__)
        raise TypeError(f"{cls.__name__}({bases}): no LeafSystem or @scalar_convertible class")
    return template_of(cls.__base__)[T]


@functools.cache
def _leaf_system(T: type) -> type:
    """Return `LeafSystem_[T]`, whose constructor is told how to convert by `_for_scalar`."""

    class Convertible(LeafSystem_[T]):
        def __init__(self) -> None:
            super().__init__(converter=self._made_with[2])

    return Convertible


def _rebound(member: Any, this_class: CellType) -> Any:
    """Return a member of a class for another: in a function, `super()` means the other's."""
    if not isinstance(member, FunctionType) or "__class__" not in member.__code__.co_freevars:
        return member
    cells = zip(member.__code__.co_freevars, member.__closure__ or (), strict=True)
    closure = tuple(this_class if name == "__class__" else cell for name, cell in cells)
    copy = FunctionType(member.__code__, member.__globals__, member.__name__, None, closure)
    copy.__defaults__, copy.__kwdefaults__ = member.__defaults__, member.__kwdefaults__
    return functools.update_wrapper(copy, member)


def _on_a_short_stack(make: Callable[[], type]) -> type:
    """Return what `make` returns, called on another thread.

    Drake asks for the source of every frame below a new class, twice: 0.1 s each amid imports.
    """
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(make).result()


def value(array: np.ndarray) -> np.ndarray:
    """Return the plain numbers of an array of float or AutoDiffXd."""
    return ExtractValue(array).ravel() if array.dtype.hasobject else array


def chain(y: np.ndarray, jacobian: np.ndarray, *args: np.ndarray) -> np.ndarray:
    """Return y as AutoDiffXd, its gradient the sum over `args` of Jacobian times gradient.

    Args:
        y: (m,) value.
        jacobian: (m, n) by all `args`, one after another.
        args: arrays of float or AutoDiffXd, of n numbers together.
    """
    gradients = [ExtractGradient(a) if a.dtype.hasobject else None for a in args]
    width = max((g.shape[1] for g in gradients if g is not None), default=0)
    total = np.zeros((y.size, width))
    start = 0
    for a, gradient in zip(args, gradients, strict=True):
        if gradient is not None and gradient.shape[1]:
            total += jacobian[:, start : start + a.size] @ gradient
        start += a.size
    return InitializeAutoDiff(y, total).ravel()


def lift(function: Any, at: tuple[Any, ...], *args: np.ndarray) -> np.ndarray:
    """Return `function(*at)`, where `args` are AutoDiffXd with its gradient by the chain rule.

    Args:
        function: its `with_jacobian` returns value and Jacobian by all `args`.
        at: what it is called with: plain numbers.
        args: (n_i,) arrays of float or AutoDiffXd, whose values are in `at`.
    """
    for a in args:
        if a.dtype.hasobject:
            return chain(*function.with_jacobian(*at), *args)
    return function(*at)


def numbered(*groups: str, count: int) -> tuple[str, ...]:
    """Return names of states: the groups one after another, each counting from 1.

    Args:
        groups: what they are.
        count: of entries in each.
    """
    return tuple(f"{group}[{i + 1}]" for group in groups for i in range(count))


def seconds(context: Context) -> float:
    """Return the time of a context as a plain number.

    Args:
        context: for float or AutoDiffXd.
    """
    time = context.get_time()
    return time.value() if isinstance(time, AutoDiffXd) else time


def finite_inputs(system: LeafSystem, context: Context, *args: np.ndarray) -> np.ndarray:
    """Return the values of inputs one after another, known to be finite.

    Args:
        system: that got them.
        context: its context.
        args: (n_i,) arrays of float or AutoDiffXd.
    """
    z = np.concatenate(args)
    if z.dtype.hasobject:
        z = np.concatenate([value(a) for a in args])
    check_finite(z, system, context, "inputs")
    return z


def check_finite(plain: np.ndarray, system: LeafSystem, context: Context, what: str) -> None:
    """Raise SimulationError unless all numbers are finite, and below 1e150 in size.

    Every system that takes numbers from outside asks here: a NaN that got into the state would
    stay there.

    Args:
        plain: (n,) floats.
        system: the system that got them.
        context: its context.
        what: they are, for the message.
    """
    if plain.dot(plain) < math.inf:
        return
    numbers = np.array2string(plain, precision=4, threshold=12)
    where = f"{what} of {system.GetSystemPathname()}"
    raise SimulationError(where, seconds(context), f"not finite: {numbers}")


def noise_input(system: LeafSystem, size: int) -> InputPort:
    """Declare the input port "noise": standard normal numbers, none where it is left open.

    Args:
        system: gets the port.
        size: of the port.
    """
    return system.DeclareVectorInputPort("noise", size, RandomDistribution.kGaussian)


def optional_input(port: InputPort, context: Context) -> np.ndarray:
    """Return the value of an input port that may stay open: zeros if it does.

    Args:
        port: the input port.
        context: the system's context.
    """
    return port.Eval(context) if port.HasValue(context) else np.zeros(port.size())


def part_of_port(port: OutputPort, part: slice) -> Calc:
    """Return what calculates an output port that shows a part of another.

    Args:
        port: the other output port, of the same system.
        part: of its vector.
    """

    def calc(context: Context, output: BasicVector) -> None:
        output.SetFromVector(port.Eval(context)[part])

    return calc


def part_of_state(part: slice) -> Calc:
    """Return what calculates an output port that shows a part of the discrete state.

    Args:
        part: of the state vector.
    """

    def calc(context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state_vector().CopyToVector()[part])

    return calc
