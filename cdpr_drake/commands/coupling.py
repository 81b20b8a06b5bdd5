"""`cdpr-drake coupling`: cable models compared by their gain matrices, without simulation."""

from __future__ import annotations

import math
import sys
from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING, Any

from cdpr_drake.commands import Command
from cdpr_drake.commands import arguments as common
from cdpr_drake.commands.files import write_answer
from cdpr_drake.commands.resolve import (
    gain_in_words,
    gain_values,
    input_refused,
    pose_values,
    resolve_place,
    resolve_rule,
)
from cdpr_drake.commands.terminal import Column, counted, fitting, table, width_of, wrapped
from cdpr_drake.model.digits import significant

if TYPE_CHECKING:
    from cdpr_drake.analysis import Comparison, DefaultGain, ModelComparison


def _add_arguments(parser: ArgumentParser) -> None:
    several = "built-in robots, or robot files (default: cogiro and its three larger versions)"
    robots = {**common.ROBOTS, "help": several}
    what = common.add_place(
        parser,
        robots,
        "part of the way to cable 1's drawing point, or "
        "the middle of its workspace where it cannot be held there",
    )
    what.add_argument("--tensions", **common.TENSIONS)
    how = parser.add_argument_group("how it is controlled")
    how.add_argument("--cable-model", **common.CABLE_MODELS,
                     help="of the law (default: ECM,CMWE,SCMWE,SLSM)")  # fmt: skip
    how.add_argument("--gain", type=common.positive("/s"), metavar="PER_S",
                     help="lambda of the figure [1/s] (default: the robot file's; else 0.1, or "
                     "half the limit at the pose if that is less; the lowest of robots and "
                     "models)")  # fmt: skip
    common.add_output(parser)


def _compare_models(options: Namespace) -> int:
    with input_refused():
        comparison = _compare(options)
        chosen = _lowest_gain(options, comparison) if options.gain is None else None
    gain = options.gain if chosen is None else chosen.gain
    summary = {**gain_values(gain, chosen), "rows": [_row(row) for row in comparison.rows]}
    columns = fitting(_columns(comparison), width_of(sys.stdout))
    meaning = " ".join(column.meaning for column in columns if column.meaning)
    lines = [table(columns), "", *wrapped(meaning)]
    if chosen is not None and chosen.reason():
        text = gain_in_words(gain, chosen, "at one of these poses")
        lines += wrapped(f"In the figure {text}.")
    names = "-".join(dict.fromkeys(row.robot for row in comparison.rows))
    return write_answer(
        options,
        f"coupling-{names if options.robot else 'sizes'}",
        summary,
        lines,
        lambda show: {
            "rates_and_responses": lambda: show.rates_and_responses_figure(comparison, gain)
        },
    )


COMMAND = Command(
    summary="compare the cable models by their gain matrices",
    description="Compare cable models by the gain matrix Gamma, motion had per motion asked for, "
    "without simulation: rates of convergence over lambda, coupling, and how far moves stray from "
    "the straight way. Draws rates and responses.",
    example="--robot cogiro,cogiro-98m",
    add_arguments=_add_arguments,
    work=_compare_models,
)


def _compare(options: Namespace) -> Comparison:
    """Return the comparison, a robot at a time, with the count of them on stderr."""
    from cdpr_drake.analysis import Comparison, compare_cable_models
    from cdpr_drake.analysis.compare import ROBOTS, pose_to_compare
    from cdpr_drake.model.cable_models import CABLE_MODELS

    names = list(dict.fromkeys(options.robot or ROBOTS))
    models = list(dict.fromkeys(options.cable_model or CABLE_MODELS))
    if len(names) > 1 and (options.test is not None or options.pose is not None):
        raise ValueError("--test and --pose are for one robot, and robots differ in size")
    rows: list[ModelComparison] = []
    for name in counted(names, "robots"):
        robot, pose, _, tensions, _ = resolve_place(options, name, None, pose_to_compare)
        poses = {robot.name: pose}
        rows += compare_cable_models([robot], models, poses=poses, tensions=tensions).rows
    return Comparison(rows=tuple(rows))


def _lowest_gain(options: Namespace, comparison: Comparison) -> DefaultGain:
    """Return the gain that is good for all rows: they are drawn at one."""

    from cdpr_drake.analysis import default_gain, lowest_gain

    found, rule = [], resolve_rule(options, options.test is not None)
    for row in comparison.rows:
        robot = row.gamma.rest.robot
        timing = robot.cameras.sample_time, robot.cameras.latency
        found.append(default_gain(robot, row.gamma.pose, row.cable_model, *timing, tensions=rule))
    return lowest_gain(found)


def _row(row: ModelComparison) -> dict[str, Any]:
    values = row.gamma.eigenvalues
    return {
        "robot": row.robot,
        "size_m": row.size,
        "pose_x_y_z_m_roll_pitch_yaw_deg": pose_values(row.gamma.pose),
        "cable_model": row.cable_model,
        "gamma": row.gamma.matrix.tolist(),
        "eigenvalues": [[float(v.real), float(v.imag)] for v in values],
        "is_stable": row.gamma.is_stable,
        "pushed_aside_mm_per_m": _aside(row),
        "move_m": row.move,
        "excursion_mm": row.excursion_mm,
        "excursion_deg": row.excursion_deg,
        "dbeta_deg": row.dbeta_deg,
    }


def _aside(row: ModelComparison) -> float:
    """Return the largest motion across an axis of M per motion asked for along it [mm/m]."""
    across = row.gamma.coupling[3:, 3:]
    return 1e3 * math.sqrt((across**2).sum(axis=0).max())


def _columns(comparison: Comparison) -> list[Column]:
    rows = comparison.rows
    # fmt: off
    return [
        Column(("robot", ""), [r.robot for r in rows], to_the_left=True),
        Column(("size", "m"), [significant(r.size, 2) for r in rows], rank=3),
        Column(("model", ""), [r.cable_model for r in rows], to_the_left=True),
        Column(("slowest", "/ lambda"), [f"{r.slowest:.4f}" for r in rows],
               meaning="Slowest, fastest: rates of convergence over lambda, the eigenvalues of "
               "Gamma; 1 for an exact model, unstable below 0."),
        Column(("fastest", "/ lambda"),
               [f"{r.gamma.eigenvalues.real.max():.4f}" for r in rows], rank=2),
        Column(("aside", "mm/m"), [f"{_aside(r):.2f}" for r in rows], rank=1,
               meaning="Aside: motion across per motion asked for, off Gamma's diagonal."),
        Column(("strays", "mm"), [f"{r.excursion_mm:.2f}" for r in rows],
               meaning="Strays: farthest from the straight way, of moves by a tenth of the robot's "
               "size."),
        Column(("", "deg"), [f"{r.excursion_deg:.3f}" for r in rows], rank=4),
        Column(("sag", "deg"), [f"{r.dbeta_deg:.1f}" for r in rows], rank=5,
               meaning="Sag: largest angle from chord to cable at the platform."),
    ]
    # fmt: on
