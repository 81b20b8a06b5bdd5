"""Figures 10 to 15: the runs they are made of, and the sections of the report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from reproduction.figures import claims
from reproduction.figures.claims import key
from reproduction.section import Case, Claim, Figure, Result, Section
from reproduction.texts import Texts
from reproduction.traces import cable_panel, error_panels, trace

TEXTS = Texts("figures")

TENSION = "tension at the winch [N]"


@dataclass(frozen=True, kw_only=True)
class PaperFigure:
    """A figure of the paper, made from runs of its tests.

    Args:
        name: as `--only` takes it.
        runs: (test, cable model, setting) of each.
        draw: makes the figure of the runs' results, by their keys.
        claims_of: what the paper says of it, beside these results.
    """

    name: str
    runs: tuple[tuple[int, str, str], ...]
    draw: Callable[[Mapping[str, Result]], Figure]
    claims_of: Callable[[Mapping[str, Result]], Sequence[Claim]]

    def cases(self) -> Sequence[Case]:
        """Return a case for each run."""
        names = ("number", "cable_model", "setting")
        return [
            Case(key=key(*run), function=trace, arguments=dict(zip(names, run, strict=True)))
            for run in self.runs
        ]

    def section(self, results: Mapping[str, Result]) -> Section:
        """Return the figure and what the paper says of it.

        Args:
            results: of all cases, by their keys.
        """
        figures, claims = [self.draw(results)], self.claims_of(results)
        return TEXTS.section(self.name, figures=figures, claims=claims)


# --- the figures


def _one_test(number: int) -> Callable[[Mapping[str, Result]], Figure]:
    def draw(results: Mapping[str, Result]) -> Figure:
        result = results[key(number, "SCMWE", "robot")]
        tension = cable_panel(result, "tension", "filtered tensions", TENSION)
        dbeta = cable_panel(result, "dbeta", "angle differentials", "dβ [deg]")
        panels = (error_panels({"": result}), (tension, dbeta))
        return TEXTS.figure("one_test", panels, number=number)

    return draw


def _figure_13(results: Mapping[str, Result]) -> Figure:
    rows = []
    for number in (4, 5):
        runs = {m: results[key(number, m, "robot")] for m in ("SCMWE", "SLSM")}
        rows.append(error_panels(runs, f"Test {number}"))
    return TEXTS.figure("figure13", rows)


def _figure_14(results: Mapping[str, Result]) -> Figure:
    rows = []
    for model in ("SCMWE", "SLSM"):
        runs = {place: results[key(4, model, place)] for place in ("robot", "simulator")}
        rows.append(error_panels(runs, f"Test 4, {model}"))
    return TEXTS.figure("figure14", rows)


def _figure_15(results: Mapping[str, Result]) -> Figure:
    rows = []
    for number in (2, 3):
        result = results[key(number, "SCMWE", "simulator")]
        tension = cable_panel(result, "tension", f"Test {number}", TENSION)
        rows.append((*error_panels({"": result}, f"Test {number}"), tension))
    return TEXTS.figure("figure15", rows)


FIGURES = (
    *(
        PaperFigure(
            name=f"figure{9 + number}",
            runs=tuple((n, "SCMWE", "robot") for n in ((1, 2, 3) if number == 3 else (number,))),
            draw=_one_test(number),
            claims_of=claims.claims_of_test(number),
        )
        for number in (1, 2, 3)
    ),
    PaperFigure(
        name="figure13",
        runs=tuple((n, m, "robot") for n in (4, 5) for m in ("SCMWE", "SLSM")),
        draw=_figure_13,
        claims_of=claims.claims_of_13,
    ),
    PaperFigure(
        name="figure14",
        runs=tuple((4, m, p) for m in ("SCMWE", "SLSM") for p in ("robot", "simulator")),
        draw=_figure_14,
        claims_of=lambda results: [claims.similar(4, results, ("SCMWE", "SLSM"))],
    ),
    PaperFigure(
        name="figure15",
        runs=tuple((n, "SCMWE", p) for n in (2, 3) for p in ("simulator", "robot")),
        draw=_figure_15,
        claims_of=claims.claims_of_15,
    ),
)
"""Figure 16 is made from the runs of Table 7."""
