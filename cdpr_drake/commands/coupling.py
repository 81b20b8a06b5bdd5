"""`cdpr-drake coupling`: cable models compared by their gain matrices, without simulation."""

from __future__ import annotations

import argparse
import sys
from typing import Any

import numpy as np

from cdpr_drake.commands.answer import counted, leave, wrapped
from cdpr_drake.commands.arguments import UsageError
from cdpr_drake.commands.gain import gain_in_words, gain_values
from cdpr_drake.commands.kernels import compilation_announced
from cdpr_drake.commands.place import as_file_name, place, pose_values, with_payload
from cdpr_drake.commands.terminal import Column, fitting, table, width_of
from cdpr_drake.errors import CdprError
from cdpr_drake.model.cable_models import CABLE_MODELS
from cdpr_drake.model.robot import load_robot
from cdpr_drake.study import (
    Comparison,
    DefaultGain,
    ModelComparison,
    comparable_pose,
    compare_cable_models,
    default_gain,
    lowest_gain,
)
from cdpr_drake.study.compare import ROBOTS


def coupling_command(options: argparse.Namespace) -> int:
    """Carry out `cdpr-drake coupling` and return the exit status.

    Args:
        options: the parsed arguments.

    Raises:
        UsageError: the input cannot be used; nothing was written.
    """
    if options.gain is not None and not (np.isfinite(options.gain) and options.gain > 0.0):
        raise UsageError(f"--gain: must be positive and finite, got {options.gain:g}/s")
    try:
        with compilation_announced():
            comparison = _compare(options)
            chosen = _lowest_gain(comparison) if options.gain is None else None
    except (CdprError, ValueError) as error:
        raise UsageError(str(error)) from error
    gain = options.gain if chosen is None else chosen.gain
    rows = [_row(row) for row in comparison.rows]
    summary = {**gain_values(gain, chosen), "rows": rows}
    columns = fitting(_columns(comparison), width_of(sys.stdout))
    meaning = " ".join(column.meaning for column in columns if column.meaning)
    lines = [table(columns), "", *wrapped(meaning)]
    if chosen is not None and chosen.reason():
        text = gain_in_words(gain, chosen, "at one of these poses")
        lines += wrapped(f"In the figure {text}.")

    def figures() -> dict[str, Any]:
        from cdpr_drake.show import rates_and_responses_figure

        return {"rates_and_responses": rates_and_responses_figure(comparison, gain)}

    names = "-".join(dict.fromkeys(row.robot for row in comparison.rows))
    name = as_file_name(names) if options.robot else "sizes"
    return leave(options, f"coupling-{name}", summary, lines, figures)


def _compare(options: argparse.Namespace) -> Comparison:
    """Return the comparison, a robot at a time, with the count of them on stderr."""
    names = list(dict.fromkeys(options.robot or ROBOTS))
    models = list(dict.fromkeys(options.cable_model or CABLE_MODELS))
    if len(names) > 1 and (options.test is not None or options.pose is not None):
        raise ValueError("--test and --pose are for one robot, and robots differ in size")
    rows: list[ModelComparison] = []
    for name in counted(names, "robots"):
        robot = with_payload(load_robot(name), options.payload)
        pose = comparable_pose(robot)
        if options.test is not None or options.pose is not None:
            asked = argparse.Namespace(**{**vars(options), "robot": name})
            robot, pose, _ = place(asked)
        rows += compare_cable_models([robot], models, poses={robot.name: pose}).rows
    return Comparison(rows=tuple(rows))


def _lowest_gain(comparison: Comparison) -> DefaultGain:
    """Return the gain that is good for all rows: they are drawn at one."""

    def found(row: ModelComparison) -> DefaultGain:
        robot = row.gamma.rest.robot
        timing = robot.cameras.sample_time, robot.cameras.latency
        return default_gain(robot, row.gamma.pose, row.cable_model, *timing)

    return lowest_gain(found(row) for row in comparison.rows)


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
    return float(1e3 * np.linalg.norm(across, axis=0).max())


def _columns(comparison: Comparison) -> list[Column]:
    rows = comparison.rows
    return [
        Column(heading=("robot", ""), cells=[r.robot for r in rows], to_the_left=True),
        Column(heading=("size", "m"), cells=[f"{r.size:.0f}" for r in rows], rank=3),
        Column(heading=("model", ""), cells=[r.cable_model for r in rows], to_the_left=True),
        Column(
            heading=("slowest", "/ lambda"),
            cells=[f"{r.slowest:.4f}" for r in rows],
            meaning="Slowest, fastest: rates of convergence over lambda, the eigenvalues of "
            "Gamma; 1 for an exact model, unstable below 0.",
        ),
        Column(
            heading=("fastest", "/ lambda"),
            cells=[f"{r.gamma.eigenvalues.real.max():.4f}" for r in rows],
            rank=2,
        ),
        Column(
            heading=("aside", "mm/m"),
            cells=[f"{_aside(r):.2f}" for r in rows],
            rank=1,
            meaning="Aside: motion across per motion asked for, off Gamma's diagonal.",
        ),
        Column(
            heading=("strays", "mm"),
            cells=[f"{r.excursion_mm:.2f}" for r in rows],
            meaning="Strays: farthest from the straight way, of moves by a tenth of the robot's "
            "size.",
        ),
        Column(heading=("", "deg"), cells=[f"{r.excursion_deg:.3f}" for r in rows], rank=4),
        Column(
            heading=("sag", "deg"),
            cells=[f"{r.dbeta_deg:.1f}" for r in rows],
            rank=5,
            meaning="Sag: largest angle from chord to cable at the platform.",
        ),
    ]
