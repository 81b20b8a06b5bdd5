"""`cdpr-drake stability`: how far the gain can go at a pose."""

from __future__ import annotations

import argparse
import math
from typing import Any

import numpy as np

from cdpr_drake.commands.answer import counted, leave, wrapped
from cdpr_drake.commands.arguments import UsageError
from cdpr_drake.commands.kernels import compilation_announced
from cdpr_drake.commands.place import as_file_name, in_words, place, pose_values
from cdpr_drake.errors import CdprError
from cdpr_drake.study import (
    GainBand,
    GainLimit,
    StabilityMap,
    gain_limit,
    gain_limit_band,
    stability_map,
)


def stability_command(options: argparse.Namespace) -> int:
    """Carry out `cdpr-drake stability` and return the exit status.

    Args:
        options: the parsed arguments.

    Raises:
        UsageError: the input cannot be used; nothing was written.
    """
    try:
        robot, pose, where = place(options)
        if options.damping_time is not None:
            cable = robot.cable.replace(damping_time=options.damping_time)
            robot = robot.replace(cable=cable)
        cameras = robot.cameras
        period = cameras.sample_time if options.sample_time is None else options.sample_time
        latency = cameras.latency if options.latency is None else options.latency
        law = {"cable_model": options.cable_model}
        with compilation_announced():
            limit = gain_limit(robot, pose, latency, period, **law)
            band = gain_limit_band(robot, pose, latency, period, **law)
            found = _map(options, robot, pose, period, law) if options.map else None
    except (CdprError, ValueError) as error:
        raise UsageError(str(error)) from error
    head = f"{in_words(robot, pose, where)}; {options.cable_model}, {period:g} s, "
    head += f"{1e3 * latency:g} ms late, damping time {1e3 * robot.cable.damping_time:g} ms."
    summary: dict[str, Any] = {
        "robot": robot.name,
        "mass_kg": robot.mass,
        "pose_x_y_z_m_roll_pitch_yaw_deg": pose_values(pose),
        "cable_model": options.cable_model,
        "damping_time_s": robot.cable.damping_time,
        "sample_time_s": period,
        "latency_s": latency,
        **_limit(limit),
        "band": _band(band),
    }
    lines = [*wrapped(head), "", *wrapped(_sentence(limit)), *wrapped(_band_sentence(band))]
    if found is not None:
        summary["map"] = {
            "gains_per_s": found.gains.tolist(),
            "latencies_s": found.latencies.tolist(),
            "growth_per_s": found.growth.tolist(),
            "frequency_hz": found.frequency.tolist(),
            "limits": [_limit(x) for x in found.limits],
        }
        lines += ["", *_table(found)]

    def figures() -> dict[str, Any]:
        from cdpr_drake.show import stability_figure

        return {} if found is None else {"stability": stability_figure(found, title=head)}

    return leave(options, f"stability-{as_file_name(robot.name)}", summary, lines, figures)


def _map(
    options: argparse.Namespace, robot: Any, pose: Any, period: float, law: dict[str, Any]
) -> StabilityMap:
    """Return the map, a latency at a time, with the count of them on stderr."""
    low, high, count = options.gains
    if low <= 0.0:
        raise ValueError(f"--gains: the lowest must be positive, got {low:g}/s")
    gains = np.geomspace(low, high, count)
    latencies = np.linspace(*options.latencies)
    rows = [
        stability_map(robot, pose, gains, [latency], period, **law)
        for latency in counted(list(latencies), "latencies")
    ]
    return StabilityMap(
        gains=gains,
        latencies=latencies,
        growth=np.vstack([row.growth for row in rows]),
        frequency=np.vstack([row.frequency for row in rows]),
        limits=tuple(limit for row in rows for limit in row.limits),
    )


def _limit(limit: GainLimit) -> dict[str, Any]:
    """Return a limit as plain values; what is infinite or unknown as None."""
    return {
        "gain_limit_per_s": limit.gain if math.isfinite(limit.gain) else None,
        "critical_mode": limit.mode or None,
        "critical_frequency_hz": limit.frequency if math.isfinite(limit.frequency) else None,
        "unstable_gains_per_s": [list(span) for span in limit.unstable],
        "searched_up_to_per_s": limit.searched,
    }


def _band(band: GainBand) -> dict[str, Any]:
    """Return a band as plain values."""
    return {
        "loss_factors": list(band.loss_factors),
        "damping_times_s": list(band.damping_times),
        "limits": [_limit(limit) for limit in band.limits],
    }


def _band_sentence(band: GainBand) -> str:
    return f"The damping of the cables is not known: {band}."


def _sentence(limit: GainLimit) -> str:
    text = str(limit)
    return f"{text[0].upper()}{text[1:]}."


def _table(found: StabilityMap) -> list[str]:
    """Return a line for each latency: the limit and the mode that goes unstable."""
    lines = ["latency [ms]  limit [1/s]  mode that goes unstable"]
    for latency, limit in zip(found.latencies, found.limits, strict=True):
        gain = f"{limit.gain:.3g}" if limit.unstable else f"> {limit.searched:.3g}"
        mode = f"{limit.mode}, {limit.frequency:.3g} Hz" if limit.unstable else ""
        lines.append(f"{1e3 * latency:12.4g}  {gain:>11}  {mode}".rstrip())
    return lines
