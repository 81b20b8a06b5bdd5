"""`cdpr-drake ablate`: what each sensor is worth."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from typing import Any

from cdpr_drake.commands.answer import leave, wrapped
from cdpr_drake.commands.arguments import UsageError
from cdpr_drake.commands.gain import gain_in_words, gain_values
from cdpr_drake.commands.kernels import compilation_announced
from cdpr_drake.commands.place import as_file_name
from cdpr_drake.commands.terminal import CaseProgress, Column, fitting, table, width_of
from cdpr_drake.errors import CdprError
from cdpr_drake.experiments.ablation import METRICS, Ablation, Statistic, Worth, ablate

ROBOTS = ("cogiro", "cogiro-98m")

UNITS = {
    "position_error": "mm",
    "orientation_error": "deg",
    "settled_after": "s",
    "position_excursion": "mm",
    "lowest_tension": "N",
    "highest_tension": "N",
}


def ablate_command(options: argparse.Namespace) -> int:
    """Carry out `cdpr-drake ablate` and return the exit status.

    Args:
        options: the parsed arguments.

    Raises:
        UsageError: the input cannot be used; nothing was written.
    """
    _check(options)
    robots = list(dict.fromkeys(options.robot or ROBOTS))
    progress = CaseProgress()
    try:
        with compilation_announced():
            found = ablate(
                robots,
                options.seeds,
                gain=options.gain,
                unknown_payload=options.unknown_payload,
                jobs=options.jobs,
                progress=progress,
            )
    except (CdprError, ValueError) as error:
        raise UsageError(str(error)) from error
    progress.done()

    def figures() -> dict[str, Any]:
        from cdpr_drake.show import ablation_figure

        return {"sensors": ablation_figure(found)}

    name = "-".join(as_file_name(ablation.robot) for ablation in found)
    return leave(options, f"ablate-{name}", _summary(options, found), list(_lines(found)), figures)


def _check(options: argparse.Namespace) -> None:
    """Raise UsageError for numbers that cannot be used."""
    for name, value, ok in (
        ("--seeds", options.seeds, options.seeds >= 1),
        ("--jobs", options.jobs, options.jobs is None or options.jobs >= 1),
    ):
        if not ok:
            raise UsageError(f"{name}: must be at least 1, got {value}")
    gain, payload = options.gain, options.unknown_payload
    if gain is not None and not (math.isfinite(gain) and gain > 0.0):
        raise UsageError(f"--gain: must be positive and finite, got {gain:g}/s")
    if not (math.isfinite(payload) and payload >= 0.0):
        raise UsageError(f"--unknown-payload: must be >= 0 and finite, got {payload:g} kg")


def _lines(found: Sequence[Ablation]) -> Iterator[str]:
    """Yield the lines of the answer."""
    for ablation in found:
        yield from wrapped(
            f"{ablation.robot}: {ablation.distance:.2f} m at "
            f"{gain_in_words(ablation.gain, ablation.chosen)}"
        )
        yield table(fitting(_columns(ablation), width_of(sys.stdout)))
        for row in ablation.rows:
            for seed, reason in row.failures.items():
                yield from wrapped(f"{row.sensors.label}, seed {seed}: {reason}")
        yield ""
    yield from wrapped(
        "Means over the seeds, +- the standard deviation of one run over noise and fixed biases, "
        "which a seed draws both; - where a run did not get "
        "there. * differs from all sensors by more than 3 standard errors of the difference, taken "
        "seed by seed, and by more than 1 %. Error: true, of the last second. To 2 %: from then on "
        "the error is below 2 % of the first. Strays: farthest from the straight way. Tension: "
        "lowest and highest at the drawing points."
    )


def _columns(ablation: Ablation) -> list[Column]:
    def cells(metric: str, digits: int, with_deviation: bool = False) -> list[str]:
        return [_cell(row.statistics[metric], digits, with_deviation) for row in ablation.rows]

    labels = [row.sensors.label for row in ablation.rows]
    return [
        Column(heading=("", "sensors"), cells=labels, to_the_left=True),
        Column(heading=("error", "mm"), cells=cells("position_error", 1, True)),
        Column(heading=("", "deg"), cells=cells("orientation_error", 3, True)),
        Column(heading=("to 2 %", "s"), cells=cells("settled_after", 1)),
        Column(heading=("strays", "mm"), cells=cells("position_excursion", 1), rank=2),
        Column(heading=("lowest", "N"), cells=cells("lowest_tension", 0), rank=1),
        Column(heading=("highest", "N"), cells=cells("highest_tension", 0), rank=3),
    ]


def _cell(value: Statistic, digits: int, with_deviation: bool) -> str:
    if value.mean is None:
        return "- "
    text = f"{value.mean:.{digits}f}"
    if with_deviation and value.deviation is not None:
        text += f" +- {value.deviation:.{digits}f}"
    return text + ("*" if value.is_told_apart else " ")


def _summary(options: argparse.Namespace, found: Sequence[Ablation]) -> dict[str, Any]:
    return {
        "seeds": options.seeds,
        "unknown_payload_kg": options.unknown_payload,
        "robots": {
            ablation.robot: {
                **gain_values(ablation.gain, ablation.chosen),
                "distance_m": ablation.distance,
                "sensors": {row.sensors.label: _values(row) for row in ablation.rows},
            }
            for ablation in found
        },
    }


def _values(row: Worth) -> dict[str, Any]:
    values: dict[str, Any] = {
        "pose_cameras": row.sensors.pose_cameras,
        "modelled": list(row.sensors.modelled),
    }
    for name in METRICS:
        statistic = row.statistics[name]
        values[f"{name}_{UNITS[name]}"] = {
            **vars(statistic),
            "is_told_apart": statistic.is_told_apart,
        }
    return {**values, "failures": {str(seed): text for seed, text in row.failures.items()}}
