"""`cdpr-drake pulleys`: what it costs to believe other things of pulleys than are true."""

from __future__ import annotations

import csv
import io
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from cdpr_drake.commands import Command
from cdpr_drake.commands import arguments as common
from cdpr_drake.commands.files import write_answer
from cdpr_drake.commands.resolve import input_refused, resolve_move, resolve_robot
from cdpr_drake.commands.terminal import CaseProgress, Column, fitted_table, wrapped

if TYPE_CHECKING:
    from cdpr_drake.runs.pulley_study import BeliefCost, PulleyStudy

ROBOT = "cogiro-2015-pulleys"

FIELDS = {
    "belief": "belief",
    "controller": "controller",
    "position_error": "position_error_mm",
    "orientation_error": "orientation_error_deg",
    "apart": "apart_from_true_belief_mm",
    "tension_change": "tension_change_percent",
    "slowest": "slowest_eigenvalue",
    "fastest": "fastest_eigenvalue",
    "led_aside": "led_aside_mm",
    "failure": "failure",
}
"""Names in files, by those of a `BeliefCost`."""


def _add_arguments(parser: ArgumentParser) -> None:
    what = parser.add_argument_group("what moves, and where")
    what.add_argument("--robot", metavar="NAME|FILE", default=ROBOT,
                      help="a built-in robot, or a robot file, with pulleys (default: "
                      f"{ROBOT})")  # fmt: skip
    what.add_argument("--payload", **common.PAYLOAD)
    what.add_argument("--test", type=int, metavar="N",
                      help="one of the paper's Tests 1 to 5: poses, payload, gain (default: a "
                      "short move near the middle)")  # fmt: skip
    common.add_ends(what)
    what.add_argument("--tensions", **common.TENSIONS)
    how = parser.add_argument_group("how it is controlled")
    how.add_argument("--cable-model", **common.CABLE_MODEL)
    how.add_argument("--gain", type=common.positive("/s"), metavar="PER_S",
                     help="lambda [1/s] (default: that of --test; else the robot file's; else 0.1, "
                     "or half the limit at the goal if that is less)")  # fmt: skip
    how.add_argument("--until", type=common.positive(" s"), metavar="S",
                     help="time of each run (default: 12 time constants, at most "
                     "400 s)")  # fmt: skip
    how.add_argument("--max-step", **common.MAX_STEP)
    common.add_output(parser)


LEGEND = {
    "error": "Error: at the end, to the goal.",
    "apart": "Apart: the largest distance from where the platform is at the same time with the "
    "true belief.",
    "tension": "Tension: the largest difference from it then.",
    "aside": "Aside: farthest from the way with the true belief, across the straight way.",
    "Gamma": "Gamma: the slowest and fastest eigenvalue of the gain matrix at the goal, 1 for an "
    "exact law.",
}
"""What columns mean; of those that a narrow terminal leaves out nothing is said."""


def _study(options: Namespace) -> int:
    from cdpr_drake.runs.pulley_study import pulley_study, require_pulleys

    progress = CaseProgress()
    with input_refused():
        require_pulleys(resolve_robot(options.robot))
        move = resolve_move(options)
        is_test = move.number is not None and options.start is None and options.goal is None
        gain = options.gain
        if gain is None and move.test is not None:
            gain = move.test.gain
        asked = options.start is not None or options.goal is not None
        study = pulley_study(
            move.robot,
            move.start,
            move.goal,
            move=f"Test {move.number}" if is_test else "asked for" if asked else "near the middle",
            gain=gain,
            until=options.until,
            cable_model=options.cable_model,
            tensions=move.tensions,
            max_step=options.max_step,
            progress=progress,
        )
    progress.done()

    return write_answer(
        options,
        f"pulleys-{study.robot}" + (f"-test-{move.number}" if is_test else ""),
        _summary(study),
        list(_lines(study)),
        lambda show: {"pulleys": lambda: show.pulley_figure([study])},
        {"pulleys.csv": to_csv(study)},
    )


COMMAND = Command(
    summary="tell what wrong beliefs about pulleys cost",
    description="Make one move of a robot whose cables leave over pulleys, for each of several "
    "beliefs of the controller about them: the truth; eyelets where the cables enter the pulleys; "
    "eyelets where they leave them at the start; a larger radius; tilted axes. Under joint space "
    "control (JSC), its encoders zeroed at the start and sag and stretch known (ECM), and under "
    "vision-based control (VBC), without noise. Tell errors, tensions and rates of convergence.",
    example="--robot caroca --output out/caroca",
    add_arguments=_add_arguments,
    work=_study,
)


def to_csv(study: PulleyStudy) -> str:
    """Return the rows of a study as CSV, each unit in its heading.

    Args:
        study: the study.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(FIELDS.values())
    for row in study.rows:
        values = [getattr(row, name) for name in FIELDS]
        writer.writerow([f"{v:.6g}" if isinstance(v, float) else v for v in values])
    return text.getvalue()


def _lines(study: PulleyStudy) -> Iterator[str]:
    """Yield the lines of the answer."""
    yield from wrapped(
        f"{study.robot}, {study.move}: {study.distance:.2f} m, largest pulley "
        f"{1e3 * study.radius:g} mm, lambda = {study.gain:g} 1/s, {study.until:g} s"
    )
    tables = ""
    for controller, how in (
        ("JSC", "ECM, encoders zeroed at the start"),
        ("VBC", study.cable_model),
    ):
        rows = list(study.of(controller).values())
        yield ""
        yield f"{controller} ({how})"
        tables += (table := fitted_table(_columns(rows, controller)))
        yield table
        for row in rows:
            if row.failure:
                yield from wrapped(f"{row.belief}: {row.failure}")
    yield ""
    yield from wrapped(" ".join(text for name, text in LEGEND.items() if name in tables))


def _columns(rows: list[BeliefCost], controller: str) -> list[Column]:
    def cells(name: str, digits: int) -> list[str]:
        values = [getattr(row, name) for row in rows]
        return ["-" if value is None else f"{value:.{digits}f}" for value in values]

    columns = [
        Column(("", "belief"), [row.belief for row in rows], to_the_left=True),
        Column(("error", "mm"), cells("position_error", 2)),
        Column(("", "deg"), cells("orientation_error", 3), rank=2),
        Column(("apart", "mm"), cells("apart", 2)),
        Column(("tension", "%"), cells("tension_change", 2), rank=1),
    ]
    if controller == "JSC":
        return columns
    return [
        *columns,
        Column(("aside", "mm"), cells("led_aside", 2), rank=3),
        Column(("Gamma", "from"), cells("slowest", 4), rank=4),
        Column(("", "to"), cells("fastest", 4), rank=5),
    ]


def _summary(study: PulleyStudy) -> dict[str, Any]:
    rows = [{new: asdict(row)[old] for old, new in FIELDS.items()} for row in study.rows]
    return {
        "robot": study.robot,
        "move": study.move,
        "distance_m": study.distance,
        "pulley_radius_m": study.radius,
        "gain_per_s": study.gain,
        "until_s": study.until,
        "cable_models": {"VBC": study.cable_model, "JSC": "ECM"},
        "tensions": study.tensions,
        "beliefs": rows,
    }
