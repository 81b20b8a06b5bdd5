"""`cdpr-drake ablate`: what each sensor is worth."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from cdpr_drake.commands import Command
from cdpr_drake.commands import arguments as common
from cdpr_drake.commands.files import write_answer
from cdpr_drake.commands.resolve import gain_in_words, gain_values, input_refused
from cdpr_drake.commands.results import UNITS
from cdpr_drake.commands.terminal import CaseProgress, Column, fitted_table, wrapped
from cdpr_drake.model.digits import decimals

if TYPE_CHECKING:
    from cdpr_drake.batch.ablation import Ablation, Statistic, Worth

ROBOTS = ("cogiro", "cogiro-98m")


def _add_arguments(parser: ArgumentParser) -> None:
    what = parser.add_argument_group("what is compared")
    what.add_argument("--robot", **common.ROBOTS,
                      help="built-in robots, or robot files, with cameras (default: "
                      f"{','.join(ROBOTS)})")  # fmt: skip
    what.add_argument("--tensions", **common.SAME_TENSIONS)
    what.add_argument("--seeds", type=common.parse_count, default=4, metavar="N",
                      help="runs of each set of sensors, each with noise and bias of its own "
                      "(default: 4)")  # fmt: skip
    what.add_argument("--gain", type=common.positive("/s"), metavar="PER_S",
                      help="lambda [1/s] (default: the robot file's; else 0.3, or 0.6 of the limit "
                      "at the goal if that is less)")  # fmt: skip
    what.add_argument("--unknown-payload", metavar="KG",
                      type=common.positive(" kg", or_zero=True), default=0.0,
                      help="carried, and not known to the controller (default: 0)")  # fmt: skip
    what.add_argument("--max-step", **common.MAX_STEP)
    what.add_argument("--jobs", **common.JOBS)
    common.add_output(parser)


def _ablate(options: Namespace) -> int:
    from cdpr_drake.batch.ablation import ablate
    from cdpr_drake.model.statics import DEFAULT_RULE

    robots = list(dict.fromkeys(options.robot or ROBOTS))
    progress = CaseProgress()
    with input_refused():
        found = ablate(
            robots,
            options.seeds,
            gain=options.gain,
            unknown_payload=options.unknown_payload,
            max_step=options.max_step,
            tensions=options.tensions or DEFAULT_RULE,
            jobs=options.jobs,
            progress=progress,
        )
    progress.done()

    return write_answer(
        options,
        f"ablate-{'-'.join(ablation.robot for ablation in found)}",
        _summary(options, found),
        list(_lines(found)),
        lambda show: {"sensors": lambda: show.ablation_figure(found)},
    )


COMMAND = Command(
    summary="tell what each sensor is worth",
    description="Make one move with all sensors, without load cells, without tangent cameras (the "
    "law then takes tensions and tangents from the model), and with fewer pose cameras; the pose "
    "comes from the patterns' points in noisy, biased images. Tell final error, convergence and "
    "tensions, and what differs by more than noise explains. CoGiRo makes Test 4, other robots a "
    "short move near their middle.",
    example="--robot cogiro --seeds 3",
    add_arguments=_add_arguments,
    work=_ablate,
)


def _lines(found: Sequence[Ablation]) -> Iterator[str]:
    """Yield the lines of the answer."""
    for ablation in found:
        yield from wrapped(
            f"{ablation.robot}: {ablation.distance:.2f} m at "
            f"{gain_in_words(ablation.gain, ablation.chosen)}"
        )
        yield fitted_table(_columns(ablation))
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
    highest = [row.statistics["highest_tension"].mean for row in ablation.rows]
    newtons = decimals(max((value for value in highest if value is not None), default=0.0))
    return [
        Column(("", "sensors"), labels, to_the_left=True),
        Column(("error", "mm"), cells("position_error", 1, True)),
        Column(("", "deg"), cells("orientation_error", 3, True)),
        Column(("to 2 %", "s"), cells("settled_after", 1)),
        Column(("strays", "mm"), cells("position_excursion", 1), rank=2),
        Column(("lowest", "N"), cells("lowest_tension", newtons), rank=1),
        Column(("highest", "N"), cells("highest_tension", newtons), rank=3),
    ]


def _cell(value: Statistic, digits: int, with_deviation: bool) -> str:
    if value.mean is None:
        return "- "
    text = f"{value.mean:.{digits}f}"
    if with_deviation and value.deviation is not None:
        text += f" +- {value.deviation:.{digits}f}"
    return text + ("*" if value.is_told_apart else " ")


def _summary(options: Namespace, found: Sequence[Ablation]) -> dict[str, Any]:
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
    from cdpr_drake.batch.ablation import METRICS

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
