"""Write the tables and the figure of docs/pulleys.md: what wrong beliefs about pulleys cost.

python docs/make_pulleys.py
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from cdpr_drake.model.digits import significant
from cdpr_drake.model.robot import load_robot
from cdpr_drake.model.statics import MINIMUM_NORM
from cdpr_drake.runs.paper_tests import paper_test
from cdpr_drake.runs.pulley_study import BeliefCost, PulleyStudy, pulley_study
from cdpr_drake.show import pulley_figure

DOCS = Path(__file__).resolve().parent
PAGE, FIGURE = DOCS / "pulleys.md", DOCS / "images" / "pulleys.png"

COGIRO, OTHERS, TEST = "cogiro-2015-pulleys", ("caroca", "cuhk-cablerobot"), 4

LEAST = 0.001
"""What is smaller is not told [mm, deg, %]."""


def studies() -> Iterator[PulleyStudy]:
    """Yield the paper's Test 4 on CoGiRo as of 2015, then a short move of each of three robots."""
    robot, test = load_robot(COGIRO), paper_test(TEST)
    yield pulley_study(
        test.carried_by(robot),
        *test.poses(robot),
        move=f"Test {TEST}",
        gain=test.gain,
        tensions=MINIMUM_NORM,  # the paper's own rule
    )
    for name in (COGIRO, *OTHERS):
        yield pulley_study(load_robot(name))


def table(found: Sequence[PulleyStudy]) -> Iterator[str]:
    """Yield the table in Markdown.

    Args:
        found: the studies.
    """
    yield (
        "| the controller believes | JSC error, mm | deg | apart, mm | tensions, % "
        "| VBC error, mm | apart, mm | aside, mm | tensions, % | Γ from | to |"
    )
    yield "|---|" + "---:|" * 10
    for study in found:
        yield (
            f"| **{study.robot}, {study.move}: {study.distance:.2f} m, pulleys of "
            f"{1e3 * study.radius:g} mm, λ = {study.gain:g} s⁻¹** |" + " |" * 10
        )
        jsc, vbc = study.of("JSC"), study.of("VBC")
        for name, row in jsc.items():
            yield f"| {name} | {' | '.join(_cells(row, vbc[name]))} |"


def _cells(jsc: BeliefCost, vbc: BeliefCost) -> list[str]:
    values = [
        jsc.position_error, jsc.orientation_error, jsc.apart, jsc.tension_change,
        vbc.position_error, vbc.apart, vbc.led_aside, vbc.tension_change,
    ]  # fmt: skip
    cells = ["–" if value is None else _figure(value) for value in values]
    rates = (vbc.slowest, vbc.fastest)
    return cells + ["–" if rate is None else f"{rate:.3f}" for rate in rates]


def _figure(value: float) -> str:
    return significant(value, 2) if value == 0.0 or value >= LEAST else f"< {LEAST:g}"


def main() -> None:
    """Fill the page."""
    found = list(studies())
    pulley_figure(found).savefig(FIGURE, dpi=100)
    page = PAGE.read_text(encoding="utf-8")
    begin, end = "<!-- begin beliefs -->\n", "<!-- end beliefs -->"
    head, rest = page.split(begin)
    page = head + begin + "\n".join(table(found)) + "\n" + end + rest.split(end)[1]
    PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
