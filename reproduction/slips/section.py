"""Slips of the printed equations: what is worked out, and the section of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from reproduction.section import Case, Result, Section, Table
from reproduction.slips.printed_equations import A_I_READINGS, SLIPS
from reproduction.slips.work import MODEL_OF, PLACES, look
from reproduction.texts import Texts

name = "slips"

TEXTS = Texts(name)

NOTHING, SOME = 1e-3, 0.1
"""A change of the gain matrix below the first counts as none, one below the second as small."""


def cases() -> Sequence[Case]:
    """Return one case for each robot."""
    return [Case(key=key, function=look, arguments={"place": key}) for key in PLACES]


def section(results: Mapping[str, Result]) -> Section:
    """Return the section on slips, from the `results` of all cases."""
    return TEXTS.section(name, tables=(_law_table(results), _other_table(results)))


def _verdict(effect: Mapping[str, Any]) -> str:
    if effect["wrong"][1] < SOME:
        return "does not move"
    if effect["wrong"][0] < 0.0:
        return "unstable"
    if effect["change"] < NOTHING:
        return "nothing"
    return "small" if effect["change"] < SOME else "coupled"


def _law_table(results: Mapping[str, Result]) -> Table:
    rows = []
    for slip, text in SLIPS.items():
        row: list[Any] = [text, MODEL_OF.get(slip, "ECM")]
        for place in PLACES:
            effect = results[place]["effects"][slip]
            low, high = effect["wrong"]
            row += [f"{low:.4g} to {high:.4g}", effect["change"], _verdict(effect)]
        rows.append(row)
    rights = {place: results[place]["effects"]["k_p"]["right"] for place in PLACES}
    return TEXTS.table(
        "law",
        rows,
        places="; ".join(f"{place}: {text}" for place, text in TEXTS.words("places").items()),
        right={f"{place}:": f"{low:.4f} to {high:.4f}" for place, (low, high) in rights.items()},
    )


def _other_table(results: Mapping[str, Result]) -> Table:
    rows: list[list[Any]] = []
    for i, reading in enumerate(A_I_READINGS):
        text = TEXTS.words("others", reading=reading, pairs=results["cogiro"]["pairs"])
        rows.append([text["misses"], *(results[p]["misses"][i] for p in PLACES)])
    rows += [[text[key], *(results[p][key] for p in PLACES)] for key in text if key != "misses"]
    return TEXTS.table("others", rows)
