"""Figures 10 to 15: errors, tensions and dbeta of the paper's tests, on robot and simulator."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from reproduction import figures_claims as claims
from reproduction.figures.claims import key
from reproduction.section import Case, Claim, Figure, Result, Section
from reproduction.traces import cable_panel, error_panels, trace

ROBOT = (
    "“Robot” is our plant with noisy cameras and load cells and one random calibration error, in "
    "place of the real robot; the errors are those that the controller sees, as in the paper."
)
SIMULATOR = (
    "“Simulator” is the same plant with perfect measurements and exact calibration, as in "
    "section 7.2."
)


@dataclass(frozen=True, kw_only=True)
class PaperFigure:
    """A figure of the paper, made from runs of its tests.

    Args:
        name: as `--only` takes it.
        title: what it shows.
        text: paragraphs.
        runs: (test, cable model, setting) of each.
        draw: makes the figure of the runs' results, by their keys.
        claims_of: what the paper says of it, beside these results.
    """

    name: str
    title: str
    text: tuple[str, ...]
    runs: tuple[tuple[int, str, str], ...]
    draw: Callable[[Mapping[str, Result]], Figure]
    claims_of: Callable[[Mapping[str, Result]], Sequence[Claim]]

    def cases(self) -> Sequence[Case]:
        """Return a case for each run."""
        return [
            Case(
                key=key(*run),
                function=trace,
                arguments=dict(zip(("number", "cable_model", "setting"), run, strict=True)),
            )
            for run in self.runs
        ]

    def section(self, results: Mapping[str, Result]) -> Section:
        """Return the figure and what the paper says of it.

        Args:
            results: of all cases, by their keys.
        """
        return Section(
            name=self.name,
            title=self.title,
            text=self.text,
            figures=(self.draw(results),),
            claims=tuple(self.claims_of(results)),
        )


# --- the figures


def _one_test(number: int) -> Callable[[Mapping[str, Result]], Figure]:
    def draw(results: Mapping[str, Result]) -> Figure:
        result = results[key(number, "SCMWE", "robot")]
        tension = cable_panel(result, "tension", "filtered tensions", "tension at the winch [N]")
        dbeta = cable_panel(result, "dbeta", "angle differentials", "dβ [deg]")
        return Figure(
            title=f"Test {number}, VBC with SCMWE",
            panels=(error_panels({"": result}), (tension, dbeta)),
        )

    return draw


def _figure_13(results: Mapping[str, Result]) -> Figure:
    rows = []
    for number in (4, 5):
        runs = {m: results[key(number, m, "robot")] for m in ("SCMWE", "SLSM")}
        rows.append(error_panels(runs, f"Test {number}"))
    return Figure(title="VBC with SCMWE and with SLSM", panels=tuple(rows))


def _figure_14(results: Mapping[str, Result]) -> Figure:
    rows = []
    for model in ("SCMWE", "SLSM"):
        runs = {place: results[key(4, model, place)] for place in ("robot", "simulator")}
        rows.append(error_panels(runs, f"Test 4, {model}"))
    return Figure(title="Test 4 on robot and simulator", panels=tuple(rows))


def _figure_15(results: Mapping[str, Result]) -> Figure:
    rows = []
    for number in (2, 3):
        result = results[key(number, "SCMWE", "simulator")]
        label = "tension at the winch [N]"
        tension = cable_panel(result, "tension", f"Test {number}", label)
        rows.append((*error_panels({"": result}, f"Test {number}"), tension))
    return Figure(title="Simulations of Tests 2 and 3", panels=tuple(rows))


FIGURES = (
    *(
        PaperFigure(
            name=f"figure{9 + number}",
            title=f"Figure {9 + number}: Test {number} under vision-based control",
            text=(ROBOT,),
            runs=tuple((n, "SCMWE", "robot") for n in ((1, 2, 3) if number == 3 else (number,))),
            draw=_one_test(number),
            claims_of=claims.claims_of_test(number),
        )
        for number in (1, 2, 3)
    ),
    PaperFigure(
        name="figure13",
        title="Figure 13: a sagging and a straight cable model in Tests 4 and 5",
        text=(ROBOT,),
        runs=tuple((n, m, "robot") for n in (4, 5) for m in ("SCMWE", "SLSM")),
        draw=_figure_13,
        claims_of=claims.claims_of_13,
    ),
    PaperFigure(
        name="figure14",
        title="Figure 14: Test 4 on the robot and in the simulator",
        text=(f"{ROBOT} {SIMULATOR}",),
        runs=tuple((4, m, p) for m in ("SCMWE", "SLSM") for p in ("robot", "simulator")),
        draw=_figure_14,
        claims_of=lambda results: [claims.similar(4, results, ("SCMWE", "SLSM"))],
    ),
    PaperFigure(
        name="figure15",
        title="Figure 15: Tests 2 and 3 in the simulator",
        text=(SIMULATOR,),
        runs=tuple((n, "SCMWE", p) for n in (2, 3) for p in ("simulator", "robot")),
        draw=_figure_15,
        claims_of=claims.claims_of_15,
    ),
)
"""Figure 16 is made from the runs of Table 7."""
