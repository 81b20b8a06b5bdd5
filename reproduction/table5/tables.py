"""The tables of the section on Table 5."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cdpr_drake.model.rotations import Array
from reproduction.assumptions import printed
from reproduction.section import Result, Table, rounded
from reproduction.table5.claims import LEVEL, NORM, Z, differences, stacked, unpaired
from reproduction.table5.convergence import median_interval
from reproduction.table5.work import CHANGES, LAST, LEVELS, MODELS, TESTS
from reproduction.texts import Texts

TEXTS = Texts("table5")

CHANGED_TEST = 4


def tables(results: Mapping[str, Result], pairs: Sequence[Result]) -> tuple[Table, ...]:
    """Return all tables on Table 5.

    Args:
        results: of all cases, by their keys.
        pairs: results of `pair`.
    """
    return (
        _errors(results, pairs),
        _times(results, pairs),
        _levels(pairs),
        _changes(results),
    )


def _errors(results: Mapping[str, Result], pairs: Sequence[Result]) -> Table:
    paper, rows = printed("table5"), []
    for number in TESTS:
        for model in MODELS:
            seen = stacked(pairs, number, model, "seen")
            true = stacked(pairs, number, model, "true")
            columns = (seen.mean(axis=0), seen.max(axis=0), np.median(true, axis=0), true.max(0))
            theirs = paper[f"real_{model.lower()}_test_{number}"].value
            ours = rounded(np.ravel(columns))
            rows.append((f"{model}, real robot, Test {number}", *theirs, *ours))
        for model in MODELS:
            entry = paper.get(f"simulator_{model.lower()}_test_{number}")
            ideal = rounded(results[f"ideal-{number}"][f"{number} {model}"]["true"])
            theirs = entry.value if entry else (None, None)
            rows.append((f"{model}, simulator, Test {number}", *theirs, *(4 * ideal)))
    return TEXTS.table("errors", rows, last=LAST, pairs=len(pairs))


def _times(results: Mapping[str, Result], pairs: Sequence[Result]) -> Table:
    paper, rows = printed("table5"), []
    for number in TESTS:
        every = differences(pairs, number)
        ideally = differences([results[f"ideal-{number}"]], number)[0]
        for row, text in ((NORM, "position error"), (Z, "its z")):
            ours = (*median_interval(every[:, row, LEVEL]), ideally[row, LEVEL])
            theirs = -paper[f"delta_t_test_{number}"].value
            rows.append((f"Test {number}, {text}", theirs, *(round(float(x), 4) for x in ours)))
    others = [-value for value in paper["delta_t_unassigned"].value]
    return TEXTS.table("times", rows, others=others)


def _levels(pairs: Sequence[Result]) -> Table:
    rows = []
    for number in TESTS:
        clean = differences(pairs, number)[:, NORM]
        noisy = differences(pairs, number, "noisy")
        apart = spread(pairs, number)
        for i, level in enumerate(LEVELS):
            medians = rounded([np.median(clean[:, i]), np.median(noisy[:, i])], 4)
            rows.append((f"Test {number}, {100 * level:g} %", *medians, round(float(apart[i]), 2)))
    return TEXTS.table("levels", rows)


def spread(pairs: Sequence[Result], number: int) -> Array:
    """Return half the width (levels,) [s] of what 95 % of `unpaired` differences lie in.

    Args:
        pairs: results of `pair`.
        number: of the test.
    """
    low, high = np.percentile(unpaired(pairs, number), [2.5, 97.5], axis=0)
    return np.asarray(0.5 * (high - low))


def _changes(results: Mapping[str, Result]) -> Table:
    rows = []
    texts = TEXTS.words("changes")
    for i, change in enumerate(CHANGES):
        found = results[f"changed-{i}" if i > 0 else f"ideal-{CHANGED_TEST}"]
        dt = differences([found], CHANGED_TEST)[0]
        times = (dt[NORM, LEVEL], dt[Z, LEVEL], dt[NORM, -1])
        final = [found[f"{CHANGED_TEST} {m}"]["seen"][0] for m in MODELS]
        rows.append((texts[change], *(round(float(t), 4) for t in times), *rounded(final)))
    return TEXTS.table("changes", rows, number=CHANGED_TEST, least=LEVELS[-1])
