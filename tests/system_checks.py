"""Checks that hold for every system and diagram: its ports, its derivatives, its conversion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.systems.framework import Context, System

Values = Mapping[str, np.ndarray]


def input_sizes(system: System) -> dict[str, int]:
    """Return the size of each input port by name."""
    ports = (system.get_input_port(i) for i in range(system.num_input_ports()))
    return {port.get_name(): port.size() for port in ports}


def output_sizes(system: System) -> dict[str, int]:
    """Return the size of each output port by name."""
    ports = (system.get_output_port(i) for i in range(system.num_output_ports()))
    return {port.get_name(): port.size() for port in ports}


def feedthrough(system: System) -> set[tuple[str, str]]:
    """Return the pairs (input, output) of ports with direct feedthrough, by name."""
    inputs = [system.get_input_port(i) for i in range(system.num_input_ports())]
    outputs = [system.get_output_port(j) for j in range(system.num_output_ports())]
    return {
        (i.get_name(), o.get_name())
        for i in inputs
        for o in outputs
        if system.HasDirectFeedthrough(int(i.get_index()), int(o.get_index()))
    }


def documented_ports(thing: Any, expand: Mapping[str, list[str]]) -> tuple[str, dict, dict]:
    """Return (name, inputs, outputs) of the `pydrake_system` block in a docstring.

    Ports map to the remark in parentheses after them, or "". A line may name several ports;
    `expand` maps a line that stands for other ports, e.g. "those of ...", to their names.
    """
    marker = ".. pydrake_system::"
    text = thing.__doc__ or ""
    assert marker in text, f"{thing} has no pydrake_system block"
    name, ports, where = "", {"input_ports": {}, "output_ports": {}}, ""
    for line in text[text.index(marker) :].splitlines()[1:]:
        content = line.strip()
        if content.startswith("name:"):
            name = content.removeprefix("name:").strip()
        elif content in ("input_ports:", "output_ports:"):
            where = content.removesuffix(":")
        elif content.startswith("- "):
            names, _, remark = content.removeprefix("- ").partition("(")
            expanded = expand.get(names.strip(), names.split(","))
            ports[where].update({n.strip(): remark.rstrip(")") for n in expanded})
        elif content:
            break
    return name, ports["input_ports"], ports["output_ports"]


def fixed_context(system: System, inputs: Values, state: np.ndarray | None = None) -> Context:
    """Return a context with input ports fixed by name, and the continuous state if given."""
    context = system.CreateDefaultContext()
    for name, value in inputs.items():
        system.GetInputPort(name).FixValue(context, value)
    if state is not None:
        context.SetContinuousState(state)
    return context


def evaluate(system: System, context: Context) -> dict[str, np.ndarray]:
    """Return the vector outputs by name, and the time derivatives as "derivatives"."""
    ports = (system.get_output_port(i) for i in range(system.num_output_ports()))
    values = {port.get_name(): np.array(port.Eval(context)) for port in ports}
    if context.num_continuous_states():
        values["derivatives"] = system.EvalTimeDerivatives(context).CopyToVector()
    return values


def check_derivatives(
    system: System,
    inputs: Values,
    state: np.ndarray | None = None,
    *,
    time: float = 0.0,
    steps: Mapping[str, float] | None = None,
    tolerance: float = 1e-6,
) -> dict[str, float]:
    """Compare outputs and derivatives in AutoDiffXd with differences in all inputs and states.

    Args:
        system: in float.
        inputs: value of each input port to be fixed; the others stay open.
        state: the continuous state, if it has one.
        time: of the context.
        steps: of the differences, by input port and "state"; 1e-4 times what is above 1 elsewhere.
        tolerance: of each output, relative to its largest derivative.

    Returns:
        the error of each output.
    """
    names = [*inputs, "state"] if state is not None else list(inputs)
    parts = [np.asarray(inputs[n], float) for n in inputs] + ([state] if state is not None else [])
    splits = np.cumsum([len(part) for part in parts])[:-1]
    z = np.concatenate(parts)

    def run(system: System, z: np.ndarray) -> dict[str, np.ndarray]:
        values = dict(zip(names, np.split(z, splits), strict=True))
        own = values.pop("state", None)
        context = fixed_context(system, values, own)
        context.SetTime(time)
        return evaluate(system, context)

    converted = run(system.ToAutoDiffXd(), InitializeAutoDiff(z).ravel())
    plain = run(system, z)
    steps = steps or {}
    sizes = np.concatenate(
        [
            np.full(len(part), steps[name])
            if name in steps
            else 1e-4 * np.maximum(np.abs(part), 1.0)
            for name, part in zip(names, parts, strict=True)
        ]
    )
    difference = {name: np.zeros((value.size, z.size)) for name, value in plain.items()}
    for j, h in enumerate(sizes):
        unit = np.zeros(z.size)
        unit[j] = h
        near = run(system, z + unit), run(system, z - unit)
        far = run(system, z + 2 * unit), run(system, z - 2 * unit)
        for name, column in difference.items():
            column[:, j] = (
                8.0 * (near[0][name] - near[1][name]) - (far[0][name] - far[1][name])
            ) / (12.0 * h)
    errors = {}
    for name, expected in difference.items():
        np.testing.assert_allclose(
            ExtractValue(converted[name]).ravel(), plain[name], rtol=1e-12, atol=1e-13
        )
        got = gradient(converted[name], z.size)
        largest = np.abs(expected).max(initial=0.0)
        errors[name] = float(np.abs(got - expected).max(initial=0.0) / (largest or 1.0))
        assert errors[name] <= tolerance, f"{name}: {errors[name]:.2e}"
    return errors


def gradient(value: np.ndarray, size: int) -> np.ndarray:
    """Return the gradient (n, size) of an array of AutoDiffXd, zeros if it carries none."""
    g = ExtractGradient(np.asarray(value).reshape(-1, 1))
    return g if g.shape[1] else np.zeros((value.size, size))


def check_conversion(
    system: System, make_context: Callable[[System], Context], *attributes: str
) -> None:
    """Convert to AutoDiffXd and back to float: names, ports, feedthrough, values, parameters stay.

    Args:
        system: in float.
        make_context: gives a context of a system in float, with all it needs fixed.
        attributes: of the system, which must be the very same objects.
    """
    converted = system.ToAutoDiffXd()
    back = converted.ToScalarType[float]()
    assert type(back) is type(system)
    assert type(converted) is not type(system)
    for other in (converted, back):
        assert other.get_name() == system.get_name()
        assert input_sizes(other) == input_sizes(system)
        assert output_sizes(other) == output_sizes(system)
        assert feedthrough(other) == feedthrough(system)
        for name in attributes:
            assert getattr(other, name) is getattr(system, name)
    again = back.ToAutoDiffXd()
    assert isinstance(again, type(converted))
    context = make_context(system)
    expected = evaluate(system, context)
    got = evaluate(back, make_context(back))
    in_autodiff = converted.CreateDefaultContext()
    in_autodiff.SetTimeStateAndParametersFrom(context)
    converted.FixInputPortsFrom(system, context, in_autodiff)
    values = evaluate(converted, in_autodiff)
    for name, value in expected.items():
        np.testing.assert_array_equal(got[name], value)
        plain = ExtractValue(values[name]).ravel()
        np.testing.assert_allclose(plain, value, rtol=1e-12, atol=1e-13)
        assert np.asarray(values[name]).dtype == object or not value.size
    assert all(isinstance(v, AutoDiffXd) for value in values.values() for v in value)
