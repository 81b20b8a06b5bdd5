"""Table 5: what is worked out, and the section of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cdpr_drake.runs import setup_of_test
from reproduction.assumptions import assumed, printed
from reproduction.section import Case, Result, Section
from reproduction.table5.claims import LEVEL, claims, differences
from reproduction.table5.tables import CHANGED_TEST, spread, tables
from reproduction.table5.work import CHANGES, MODELS, TESTS, changed, ideal, pair
from reproduction.texts import Texts

name = "table5"


def cases() -> Sequence[Case]:
    """Return the paired runs, the ideal ones, and those that show what the difference hangs on."""
    seeds = range(assumed(name)["seeds"])
    return [
        *(Case(key=f"pair-{seed}", function=pair, arguments={"seed": seed}) for seed in seeds),
        *(Case(key=f"ideal-{n}", function=ideal, arguments={"number": n}) for n in TESTS),
        *(
            Case(
                key=f"changed-{i}",
                function=changed,
                arguments={"number": CHANGED_TEST, "change": change},
            )
            for i, change in enumerate(CHANGES)
            if i > 0
        ),
    ]


def section(results: Mapping[str, Result]) -> Section:
    """Return the section on Table 5, from the `results` of all cases."""
    pairs = [results[key] for key in results if key.startswith("pair-")]
    rates = {
        model: min(float(results[f"ideal-{n}"][f"{n} {model}"]["rates"][0]) for n in TESTS)
        for model in MODELS
    }
    return Texts(name).section(
        name,
        tables=tables(results, pairs),
        claims=claims(results, pairs),
        fitted=assumed(name),
        pairs=len(pairs),
        gain=setup_of_test(CHANGED_TEST).gain,
        rates=rates,
        spread=max(float(spread(pairs, n)[-1]) for n in TESTS),
        apart=-offset_effect(),
        changed=_most_changed(results),
    )


def offset_effect() -> float:
    """Return Δt [s] of two exponentials alike but for the printed final errors of Test 4.

    They are taken for constant offsets, and 10 mm for converged, the accuracy the paper aims at.
    """
    paper, gain = printed(name), setup_of_test(CHANGED_TEST).gain
    left = [10.0 - paper[f"real_{m.lower()}_test_{CHANGED_TEST}"].value[0] for m in MODELS]
    return float(np.log(left[1] / left[0]) / gain)


def _most_changed(results: Mapping[str, Result]) -> float:
    """Return the largest Δt of the changed runs, at the levels of the table [s]."""
    found = [results[key] for key in results if key.startswith("changed-")]
    return float(np.abs(differences(found, CHANGED_TEST)[:, :, [LEVEL, -1]]).max())
