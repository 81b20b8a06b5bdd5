"""`cdpr-drake stability`: how far the gain can go at a pose."""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING, Any

from cdpr_drake.commands import Command
from cdpr_drake.commands import arguments as common
from cdpr_drake.commands.files import write_answer
from cdpr_drake.commands.resolve import Place, input_refused, resolve_place, resolve_timing
from cdpr_drake.commands.terminal import counted, wrapped

if TYPE_CHECKING:
    from cdpr_drake.analysis import GainLimit, StabilityMap


def _add_arguments(parser: ArgumentParser) -> None:
    common.add_place(parser).add_argument("--tensions", **common.TENSIONS)
    parser.add_argument_group("the cables").add_argument(
        "--damping-time", type=float, metavar="S",
        help="damping of the cables over their stiffness (default: the robot's)",
    )  # fmt: skip
    how = parser.add_argument_group("how it is controlled")
    how.add_argument("--cable-model", **common.CABLE_MODEL)
    how.add_argument("--sample-time", **common.SAMPLE_TIME)
    how.add_argument("--latency", **common.LATENCY)
    over = parser.add_argument_group("the map")
    over.add_argument("--map", action="store_true", help="map stability, with a figure")
    over.add_argument("--gains", **common.SPAN, default=(0.1, 15.0, 24),
                      help="of the map [1/s] (default: 0.1,15,24)")  # fmt: skip
    over.add_argument("--latencies", **common.SPAN, default=(0.0, 0.24, 17),
                      help="of the map [s] (default: 0,0.24,17)")  # fmt: skip
    common.add_output(parser)


def _find_limit(options: Namespace) -> int:
    from cdpr_drake.analysis import gain_limit, gain_limit_band

    with input_refused():
        place = resolve_place(options)
        robot = place.robot
        if options.damping_time is not None:
            robot = robot.replace(cable=robot.cable.replace(damping_time=options.damping_time))
            place = place._replace(robot=robot)
        period, latency = resolve_timing(options, robot)
        law = {"cable_model": options.cable_model, "tensions": place.tensions}
        limit = gain_limit(robot, place.pose, latency, period, **law)
        band = gain_limit_band(robot, place.pose, latency, period, **law)
        found = _map(options, place, period, law) if options.map else None
    head = f"{place}; {options.cable_model}, {period:g} s, "
    head += f"{1e3 * latency:g} ms late, damping time {1e3 * robot.cable.damping_time:g} ms."
    summary: dict[str, Any] = {
        **place.to_dict(),
        "cable_model": options.cable_model,
        "damping_time_s": robot.cable.damping_time,
        "sample_time_s": period,
        "latency_s": latency,
        **_limit(limit),
        "band": {
            "loss_factors": list(band.loss_factors),
            "damping_times_s": list(band.damping_times),
            "limits": [_limit(limit) for limit in band.limits],
        },
    }
    text = str(limit)
    lines = [*wrapped(head), "", *wrapped(f"{text[0].upper()}{text[1:]}.")]
    lines += wrapped(f"As damping is not known well, the limit may be {band}.")
    if found is not None:
        summary["map"] = _map_values(found)
        lines += ["", *_table(found)]

    def figures(show: Any) -> dict[str, Any]:
        if found is None:
            return {}
        return {"stability": lambda: show.stability_figure(found, title=head)}

    return write_answer(options, f"stability-{robot.name}", summary, lines, figures)


COMMAND = Command(
    summary="tell how far the gain can go at a pose",
    description="Find the smallest gain at which the sampled vision-based control loop is unstable "
    "at a pose, and the mode that is; with --map over gain and latency.",
    example="--test 4 --payload 200 --map",
    add_arguments=_add_arguments,
    work=_find_limit,
)


def _map(options: Namespace, place: Place, period: float, law: dict[str, Any]) -> StabilityMap:
    """Return the map, a latency at a time, with the count of them on stderr."""
    import numpy as np

    from cdpr_drake.analysis import StabilityMap, stability_map

    low, high, count = options.gains
    if low <= 0.0:
        raise ValueError(f"--gains: the lowest must be positive, got {low:g}/s")
    gains = np.geomspace(low, high, count)
    latencies = np.linspace(*options.latencies)
    rows = [
        stability_map(place.robot, place.pose, gains, [latency], period, **law)
        for latency in counted(list(latencies), "latencies")
    ]
    return StabilityMap(
        gains=gains,
        latencies=latencies,
        growth=np.vstack([row.growth for row in rows]),
        frequency=np.vstack([row.frequency for row in rows]),
        limits=tuple(limit for row in rows for limit in row.limits),
    )


def _map_values(found: StabilityMap) -> dict[str, Any]:
    return {
        "gains_per_s": found.gains.tolist(),
        "latencies_s": found.latencies.tolist(),
        "growth_per_s": found.growth.tolist(),
        "frequency_hz": found.frequency.tolist(),
        "limits": [_limit(limit) for limit in found.limits],
    }


def _limit(limit: GainLimit) -> dict[str, Any]:
    """Return a limit as plain values; what is infinite or unknown as None."""
    return {
        "gain_limit_per_s": limit.gain if math.isfinite(limit.gain) else None,
        "critical_mode": limit.mode or None,
        "critical_frequency_hz": limit.frequency if math.isfinite(limit.frequency) else None,
        "unstable_gains_per_s": [list(span) for span in limit.unstable],
        "searched_up_to_per_s": limit.searched,
    }


def _table(found: StabilityMap) -> list[str]:
    """Return a line for each latency: the limit and the mode that goes unstable."""
    lines = ["latency [ms]  limit [1/s]  mode that goes unstable"]
    for latency, limit in zip(found.latencies, found.limits, strict=True):
        gain = f"{limit.gain:.3g}" if limit.unstable else f"> {limit.searched:.3g}"
        mode = f"{limit.mode}, {limit.frequency:.3g} Hz" if limit.unstable else ""
        lines.append(f"{1e3 * latency:12.4g}  {gain:>11}  {mode}".rstrip())
    return lines
