"""`cdpr-drake linearize`: the modes of a control loop at a pose."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING, Any

from cdpr_drake.commands import Command, UsageError
from cdpr_drake.commands import arguments as common
from cdpr_drake.commands.files import write_answer
from cdpr_drake.commands.resolve import (
    Place,
    gain_in_words,
    gain_values,
    input_refused,
    resolve_gain,
    resolve_place,
    resolve_timing,
)
from cdpr_drake.commands.terminal import print_message, wrapped

if TYPE_CHECKING:
    from cdpr_drake.study import Mode, Modes


def _add_arguments(parser: ArgumentParser) -> None:
    common.add_place(parser).add_argument("--tensions", **common.TENSIONS)
    how = parser.add_argument_group("how it is controlled")
    how.add_argument("--cable-model", **common.CABLE_MODEL)
    how.add_argument("--gain", **common.GAIN)
    how.add_argument("--continuous", action="store_true", help="neither sampled nor late")
    how.add_argument("--sample-time", **common.SAMPLE_TIME)
    how.add_argument("--latency", **common.LATENCY)
    common.add_output(parser)


def _linearize(options: Namespace) -> int:
    from cdpr_drake.study.modes import named

    if options.continuous and (options.sample_time is not None or options.latency is not None):
        raise UsageError("--continuous: then there is neither --sample-time nor --latency")
    with input_refused():
        place = resolve_place(options)
        period, latency = resolve_timing(options, place.robot)
        print_message("linearising the loop ...")
        sampling = None if options.continuous else period
        gain, chosen = resolve_gain(options, place, sampling, latency)
        found = _find_modes(place, options.cable_model, gain, sampling, latency)
    timing = "continuous" if options.continuous else f"{period:g} s, {1e3 * latency:g} ms late"
    head = f"{place}; {options.cable_model}, {gain_in_words(gain, chosen, 'there')}, {timing}."
    summary: dict[str, Any] = {
        **place.to_dict(),
        "cable_model": options.cable_model,
        **gain_values(gain, chosen),
        "sample_time_s": sampling,
        "latency_s": None if options.continuous else latency,
        "is_stable": not found.unstable,
        "neutral": _neutral(found),
        "deadbeat": found.deadbeat,
        "modes": named(found),
    }

    def figures(show: Any) -> dict[str, Any]:
        drawn = {"poles": lambda: show.pole_figure({timing: found}, head)}
        if (swing := least_damped(found)) is not None:
            shape = found, swing, place.robot, place.pose
            drawn["mode_shape"] = lambda: show.mode_shape_figure(*shape)
        return drawn

    lines = [*wrapped(head), "", str(found), "", *wrapped(_verdict(found))]
    return write_answer(options, f"linearize-{place.robot.name}", summary, lines, figures)


COMMAND = Command(
    summary="tell the modes of the control loop at a pose",
    description="Linearise the whole vision-based control loop at rest at a pose, continuous or "
    "sampled, and list its modes: eigenvalues, frequencies, damping, time constants, and the "
    "states that take part. Draw the pole map, and the shape of the least damped oscillation.",
    example="--test 4 --gain 0.1 --continuous",
    add_arguments=_add_arguments,
    work=_linearize,
)


def _find_modes(
    place: Place, cable_model: str, gain: float, sample_time: float | None, latency: float
) -> Modes:
    """Return the modes of a loop, all continuous without a sample time."""
    from cdpr_drake.diagrams import make_vision_based_control
    from cdpr_drake.study import equilibrium, linearize, modes, one_period_map

    loop = make_vision_based_control(
        place.robot,
        cable_model,
        gain=gain,
        sample_time=sample_time,
        latency=0.0 if sample_time is None else latency,
    )
    at_rest = equilibrium(loop, place.pose, place.tensions)
    if sample_time is None:
        return modes(linearize(loop, at_rest, ["desired_pose"], ["pose_error"]))
    return modes(one_period_map(loop, at_rest))


def least_damped(found: Modes) -> Mode | None:
    """Return the oscillation of the platform that decays least, None if there is none.

    Args:
        found: the modes.
    """
    swings = [m for m in found.modes if m.frequency > 0.0 and "platform/" in found.name(m)]
    return max(swings, key=lambda m: m.eigenvalue.real, default=None)


def _neutral(found: Modes) -> int:
    """Return how many eigenvalues are zero; round-off may have made a complex pair of two."""
    return sum(2 if mode.eigenvalue.imag else 1 for mode in found.neutral)


def _verdict(found: Modes) -> str:
    neutral = f"{_neutral(found)} neutral, the internal tensions"
    if not found.unstable:
        return f"Stable; {neutral}."
    grows = ", ".join(
        f"{found.name(m)} ({m.frequency:.3g} Hz, by a factor e in {-m.time_constant:.3g} s)"
        for m in found.unstable
    )
    return f"UNSTABLE: {grows} grows; {neutral}."
