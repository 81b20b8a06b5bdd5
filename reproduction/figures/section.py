"""Figures 10 to 15: the runs they are made of, and the sections of the report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from reproduction.figures.claims import claims_of_13, claims_of_15, claims_of_test, key, similar
from reproduction.section import Case, Claim, Figure, Panel, Result, Section
from reproduction.texts import Texts
from reproduction.traces import cable_panel, error_panels, trace

TEXTS = Texts("figures")

TENSION = "tension at the winch [N]"

Results = Mapping[str, Result]
"""Of runs, by their keys."""


@dataclass(frozen=True, kw_only=True)
class PaperFigure:
    """A figure of the paper, made from runs of its tests.

    Args:
        name: as `--only` takes it.
        runs: (test, cable model, setting) of each.
        panels: makes the panels, row by row, of the runs' results.
        claims_of: what the paper says of it, beside these results.
    """

    name: str
    runs: tuple[tuple[int, str, str], ...]
    panels: Callable[[Results], Sequence[Sequence[Panel]]]
    claims_of: Callable[[Results], Sequence[Claim]]

    def cases(self) -> Sequence[Case]:
        """Return a case for each run."""
        names = ("number", "cable_model", "setting")
        return [
            Case(key=key(*run), function=trace, arguments=dict(zip(names, run, strict=True)))
            for run in self.runs
        ]

    def section(self, results: Results) -> Section:
        """Return the figure and what the paper says of it, from the `results` of all cases."""
        figure: Figure = TEXTS.figure(self.name, self.panels(results))
        return TEXTS.section(self.name, figures=(figure,), claims=self.claims_of(results))


def _of_test(number: int) -> PaperFigure:
    """Return the figure of one of Tests 1 to 3; Fig. 12 compares with the others."""

    def panels(results: Results) -> Sequence[Sequence[Panel]]:
        result = results[key(number, "SCMWE", "robot")]
        tension = cable_panel(result, "tension", "filtered tensions", TENSION)
        dbeta = cable_panel(result, "dbeta", "angle differentials", "dβ [deg]")
        return (error_panels({"": result}), (tension, dbeta))

    return PaperFigure(
        name=f"figure{9 + number}",
        runs=tuple((n, "SCMWE", "robot") for n in ((1, 2, 3) if number == 3 else (number,))),
        panels=panels,
        claims_of=claims_of_test(number),
    )


def _panels_13(results: Results) -> Sequence[Sequence[Panel]]:
    models = ("SCMWE", "SLSM")
    return [
        error_panels({m: results[key(n, m, "robot")] for m in models}, f"Test {n}") for n in (4, 5)
    ]


def _panels_14(results: Results) -> Sequence[Sequence[Panel]]:
    places = ("robot", "simulator")
    return [
        error_panels({place: results[key(4, m, place)] for place in places}, f"Test 4, {m}")
        for m in ("SCMWE", "SLSM")
    ]


def _panels_15(results: Results) -> Sequence[Sequence[Panel]]:
    runs = {f"Test {n}": results[key(n, "SCMWE", "simulator")] for n in (2, 3)}
    return [
        (*error_panels({"": run}, test), cable_panel(run, "tension", test, TENSION))
        for test, run in runs.items()
    ]


FIGURES = (
    *(_of_test(number) for number in (1, 2, 3)),
    PaperFigure(
        name="figure13",
        runs=tuple((n, m, "robot") for n in (4, 5) for m in ("SCMWE", "SLSM")),
        panels=_panels_13,
        claims_of=claims_of_13,
    ),
    PaperFigure(
        name="figure14",
        runs=tuple((4, m, p) for m in ("SCMWE", "SLSM") for p in ("robot", "simulator")),
        panels=_panels_14,
        claims_of=lambda results: [similar(4, results, ("SCMWE", "SLSM"))],
    ),
    PaperFigure(
        name="figure15",
        runs=tuple((n, "SCMWE", p) for n in (2, 3) for p in ("simulator", "robot")),
        panels=_panels_15,
        claims_of=claims_of_15,
    ),
)
"""Figure 16 is made from the runs of Table 7."""
