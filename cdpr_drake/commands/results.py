"""What `cdpr-drake run` tells of its runs: a table, and a summary for other programs."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from cdpr_drake import __version__
from cdpr_drake.commands.resolve import pose_values
from cdpr_drake.commands.terminal import Column, fitting, print_wrapped, table, width_of
from cdpr_drake.model.digits import decimals, significant

if TYPE_CHECKING:
    from cdpr_drake.runs import Run, Setup

UNITS = {
    "position_error": "mm",
    "orientation_error": "deg",
    "settled_after": "s",
    "position_excursion": "mm",
    "orientation_excursion": "deg",
    "lowest_tension": "N",
    "highest_tension": "N",
}


def summarize(name: str, setup: Setup, runs: Sequence[Run]) -> dict[str, Any]:
    """Return what the runs had in common and what came of each, as plain values.

    Args:
        name: of what was run.
        setup: of one of the runs.
        runs: all of them.
    """
    return {
        "name": name,
        "cdpr_drake": __version__,
        "drake": version("drake"),
        "robot": setup.robot.name,
        "mass_kg": setup.robot.mass,
        "payload_kg": setup.robot.payload.mass,
        "start_x_y_z_m_roll_pitch_yaw_deg": pose_values(setup.start),
        "goal_x_y_z_m_roll_pitch_yaw_deg": pose_values(setup.goal),
        "tensions": setup.tensions,
        "gain_per_s": setup.gain,
        **_sensing(setup),
        "calibrated": setup.loop.believed is not None,
        "noise": setup.noise,
        "seed": setup.seed,
        "runs": {
            r.setup.label: {
                **_law(r.setup),
                **r.summary.to_dict(),
                "beyond_limits": beyond_limits(r),
            }
            for r in runs
        },
    }


def _law(setup: Setup) -> dict[str, str]:
    return {"controller": setup.loop.controller, "cable_model": str(setup.loop.cable_model)}


def _sensing(setup: Setup) -> dict[str, Any]:
    """Return when and how cameras measure; nothing of joint space control."""
    from cdpr_drake.diagrams import VisionLoop

    if not isinstance(setup.loop, VisionLoop):
        return {}
    timing, sensing = setup.loop.timing, setup.loop.sensing
    return {
        "sample_time_s": timing.sample_time,
        "latency_s": timing.latency,
        "sensors": getattr(sensing, "name", type(sensing).__name__),
        "estimator": getattr(sensing, "estimator", None),
    }


def print_results(runs: Sequence[Run]) -> None:
    """Print a table of the runs, and what needs a word besides, on stdout.

    Args:
        runs: the runs.
    """
    columns = fitting(_columns(runs), width_of(sys.stdout))
    print()
    print(table(columns))
    print()
    print_wrapped(" ".join(column.meaning for column in columns if column.meaning))
    for r in runs:
        if text := _losses(r):
            print_wrapped(f"{r.setup.label}: {text}.")
        step = r.record.step
        if step.since is not None and step.decided_by == "modes":
            print_wrapped(
                f"{r.setup.label}: steps of {1e3 * step.size:.3g} ms from {step.since:.3g} s on, "
                f"for {step.mode}."
            )
        if text := beyond_limits(r):
            print_wrapped(f"{r.setup.label}: {text}.")
        for cable, time in sorted(r.summary.slack_cables.items()):
            print_wrapped(f"{r.setup.label}: cable {cable} went slack at {time:.1f} s.")


def beyond_limits(result: Run) -> str:
    """Return in words which cables leave the robot's limits by more than 1 %, and when first.

    Args:
        result: a run.
    """
    import numpy as np

    cable, time = result.setup.robot.cable, result.record.time
    tension = result.record["tension_at_drawing_point"]
    found = []
    for which, limit, is_beyond, worst in (
        ("below", cable.min_tension, tension < 0.99 * cable.min_tension, tension.min()),
        ("above", cable.max_tension, tension > 1.01 * cable.max_tension, tension.max()),
    ):
        cables = ", ".join(str(i + 1) for i in np.flatnonzero(is_beyond.any(axis=0)))
        if cables:
            first = time[is_beyond.any(axis=1).argmax()]
            found.append(
                f"tension {which} the robot's {limit:g} N in cable {cables}, first at "
                f"{first:.3g} s, at worst {significant(worst)} N"
            )
    return "; ".join(found)


def _losses(result: Run) -> str:
    """Return in words what the cameras of a run did not deliver, "" if they delivered all."""
    summary = result.summary
    lost = {
        "frames without a pose": summary.pose_frames_lost,
        "images of pose cameras without use": summary.pose_images_lost,
        "tangents not measured": sum(summary.tangent_frames_lost or ()),
    }
    return ", ".join(f"{count} {what}" for what, count in lost.items() if count)


def _columns(runs: Sequence[Run]) -> list[Column]:
    results = [r.summary for r in runs]

    def cells(attribute: str, digits: int) -> list[str]:
        """Return an entry of each run, with more digits where the largest would have none."""
        values = [getattr(summary, attribute) for summary in results]
        largest = max((abs(value) for value in values if value is not None), default=0.0)
        digits = max(digits, min(decimals(largest, 1), digits + 3))
        return ["-" if value is None else f"{value:.{digits}f}" for value in values]

    # fmt: off
    return [
        Column(("", "run"), [r.setup.label for r in runs], to_the_left=True),
        Column(("final", "mm"), cells("position_error", 1),
               meaning="Final error: true pose against the goal, mean of the last second."),
        Column(("error", "deg"), cells("orientation_error", 3)),
        Column(("seen", "mm"), cells("position_error_seen", 1), rank=4,
               meaning="Seen: the same as the controller measures it."),
        Column(("", "deg"), cells("orientation_error_seen", 3), rank=5),
        Column(("to 2 %", "s"), cells("settled_after", 1),
               meaning="To 2 %: from then on the position error is below 2 % of the first."),
        Column(("strays", "mm"), cells("position_excursion", 1), rank=1,
               meaning="Strays: farthest from the straight way to the goal."),
        Column(("", "deg"), cells("orientation_excursion", 2), rank=3),
        Column(("tension", "N"),
               ["-".join(map(significant, (s.lowest_tension, s.highest_tension))) for s in results],
               rank=2,
               meaning="Tension: lowest and highest at the drawing points."),
    ]
    # fmt: on
