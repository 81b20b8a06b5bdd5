"""`cdpr-drake linearize`: the modes of a control loop at a pose."""

from __future__ import annotations

import argparse
from typing import Any

from cdpr_drake.commands.answer import leave, note, wrapped
from cdpr_drake.commands.arguments import UsageError
from cdpr_drake.commands.gain import gain_in_words, gain_values
from cdpr_drake.commands.kernels import compilation_announced
from cdpr_drake.commands.place import as_file_name, in_words, place, pose_values
from cdpr_drake.diagrams import make_vision_based_control
from cdpr_drake.errors import CdprError
from cdpr_drake.study import (
    Mode,
    Modes,
    default_gain,
    equilibrium,
    linearize,
    modes,
    one_period_map,
)
from cdpr_drake.study.modes import named


def linearize_command(options: argparse.Namespace) -> int:
    """Carry out `cdpr-drake linearize` and return the exit status.

    Args:
        options: the parsed arguments.

    Raises:
        UsageError: the input cannot be used; nothing was written.
    """
    if options.continuous and (options.sample_time is not None or options.latency is not None):
        raise UsageError("--continuous: then there is neither --sample-time nor --latency")
    try:
        robot, pose, where = place(options)
        cameras = robot.cameras
        period = cameras.sample_time if options.sample_time is None else options.sample_time
        latency = cameras.latency if options.latency is None else options.latency
        with compilation_announced():
            note("linearising the loop")
            sampling = None if options.continuous else period
            gain, chosen = options.gain, None
            if gain is None:
                chosen = default_gain(robot, pose, options.cable_model, sampling, latency)
                gain = chosen.gain
            loop = make_vision_based_control(
                robot,
                options.cable_model,
                gain=gain,
                sample_time=sampling,
                latency=0.0 if options.continuous else latency,
            )
            at_rest = equilibrium(loop, pose)
            if options.continuous:
                found = modes(linearize(loop, at_rest, ["desired_pose"], ["pose_error"]))
            else:
                found = modes(one_period_map(loop, at_rest))
    except (CdprError, ValueError) as error:
        raise UsageError(str(error)) from error
    timing = "continuous" if options.continuous else f"{period:g} s, {1e3 * latency:g} ms late"
    head = f"{in_words(robot, pose, where)}; {options.cable_model}, "
    head += f"{gain_in_words(gain, chosen, 'there')}, {timing}."
    summary: dict[str, Any] = {
        "robot": robot.name,
        "mass_kg": robot.mass,
        "pose_x_y_z_m_roll_pitch_yaw_deg": pose_values(pose),
        "cable_model": options.cable_model,
        **gain_values(gain, chosen),
        "sample_time_s": sampling,
        "latency_s": None if options.continuous else latency,
        "is_stable": not found.unstable,
        "neutral": _neutral(found),
        "deadbeat": found.deadbeat,
        "modes": named(found),
    }

    def figures() -> dict[str, Any]:
        from cdpr_drake.show import mode_shape_figure, pole_figure

        drawn = {"poles": pole_figure({timing: found}, head)}
        if (swing := least_damped(found)) is not None:
            drawn["mode_shape"] = mode_shape_figure(found, swing, robot, pose)
        return drawn

    lines = [*wrapped(head), "", str(found), "", *wrapped(_verdict(found))]
    return leave(options, f"linearize-{as_file_name(robot.name)}", summary, lines, figures)


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
