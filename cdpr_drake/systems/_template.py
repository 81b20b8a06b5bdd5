"""What every system here shares: scalar conversion, and the chain rule for AutoDiffXd."""

from __future__ import annotations

import inspect
import math
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.systems.scalar_conversion import TemplateSystem

from cdpr_drake.errors import SimulationError

GAUSSIAN_INPUT = "noise"


def system_template(name: str) -> Callable[[Callable[[type], type]], Any]:
    """Define a system for float and AutoDiffXd: the decorated function maps a scalar to its class.

    The class implements `_construct(self, ..., *, converter=None)` and `_construct_copy`; its
    constructor's signature, as users see it, is that of `_construct`.

    Args:
        name: the system's name, without underscore.
    """

    def decorate(instantiate: Callable[[type], type]) -> Any:
        def build(T: type) -> type:
            cls = instantiate(T)
            parameters = list(inspect.signature(cls._construct).parameters.values())  # type: ignore[attr-defined]
            kept = [p for p in parameters if p.name not in ("self", "converter")]
            cls.__signature__ = inspect.Signature(kept)  # type: ignore[attr-defined]
            return cls

        scope = sys.modules[instantiate.__module__]
        template = TemplateSystem.define(f"{name}_", (float, AutoDiffXd), scope=scope)(build)
        plain = _on_a_short_stack(lambda: template[float])
        # Drake has named it by its template and scalar.
        plain.__name__ = plain.__qualname__ = name
        return template

    return decorate


def _on_a_short_stack(make: Callable[[], type]) -> type:
    """Return what `make` returns, called on another thread.

    Drake asks for the source of every frame below a new class, twice: 0.1 s each amid imports.
    """
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(make).result()


def value(array: np.ndarray) -> np.ndarray:
    """Return the plain numbers of an array of float or AutoDiffXd."""
    return ExtractValue(array).ravel() if array.dtype == object else array


def chain(y: np.ndarray, jacobians: list[np.ndarray], *args: np.ndarray) -> np.ndarray:
    """Return y as AutoDiffXd, its gradient the sum over `args` of Jacobian times gradient.

    Args:
        y: (m,) value.
        jacobians: one (m, n_i) array per argument.
        args: (n_i,) arrays of float or AutoDiffXd.
    """
    gradients = [ExtractGradient(a) if a.dtype == object else None for a in args]
    width = max((g.shape[1] for g in gradients if g is not None), default=0)
    total = np.zeros((y.size, width))
    for jacobian, gradient in zip(jacobians, gradients, strict=True):
        if gradient is not None and gradient.shape[1]:
            total += jacobian @ gradient
    return InitializeAutoDiff(y, total).ravel()


def check_finite(plain: np.ndarray, system: Any, context: Any, what: str) -> None:
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
    time = float(value(np.array([context.get_time()]))[0])
    numbers = np.array2string(plain, precision=4, threshold=12)
    raise SimulationError(f"{what} of {system.GetSystemPathname()}", time, f"not finite: {numbers}")


def optional_input(port: Any, context: Any, size: int) -> np.ndarray:
    """Return the value of an input port that may stay open: zeros if it does.

    Args:
        port: the input port.
        context: the system's context.
        size: the port's size.
    """
    return port.Eval(context) if port.HasValue(context) else np.zeros(size)


def part_of_state(part: slice) -> Callable[[Any, Any], None]:
    """Return what calculates an output port that shows a part of the discrete state.

    Args:
        part: of the state vector.
    """

    def calc(context: Any, output: Any) -> None:
        output.SetFromVector(context.get_discrete_state_vector().CopyToVector()[part])

    return calc
