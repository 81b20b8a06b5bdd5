"""Values of a report in words, the same on the screen, in HTML and in Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

DIGITS = 3


def in_words(value: Any) -> str:
    """Return a cell of a table as text: numbers to at most three digits, nothing for None.

    Args:
        value: a number, a text, None, or a list of these.
    """
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(map(in_words, value))
    return str(value)


def _number(value: float) -> str:
    if not math.isfinite(value):
        return ""
    if abs(value) >= 10.0**DIGITS:
        return f"{value:.0f}"
    if value == 0.0:
        return "0"
    decimals = max(DIGITS - 1 - math.floor(math.log10(abs(value))), 0)
    if decimals > 6:
        return f"{value:.2g}"
    given = len(repr(value).partition(".")[2])  # a number that was rounded gets no more digits
    return f"{value:.{min(decimals, given)}f}"


def verdict(claim: Mapping[str, Any]) -> str:
    """Return whether a `claim` holds, in a word."""
    return "agrees" if claim["agrees"] else "differs"


def how_often(claim: Mapping[str, Any]) -> str:
    """Return which part of its null model's outcomes would meet a `claim`; "" if there is none."""
    rate = claim["null_rate"]
    return "" if rate is None else f"{100.0 * rate:.2g} %" if rate < 0.995 else "100 %"


def what_else(claim: Mapping[str, Any]) -> str:
    """Return what could have come out otherwise, and how much of that would meet a `claim`."""
    often = how_often(claim)
    return f"{claim['null']}: {often} would agree" if often else str(claim["null"])


def tested(claims: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return those of some `claims` that could have failed: the only ones that are counted."""
    return [claim for claim in claims if claim["kind"] == "tested"]


def count_of_claims(report: Mapping[str, Any]) -> str:
    """Return in a sentence how many claims of a `report` hold, of those that could have failed."""
    claims = [claim for section in report["sections"] for claim in section["claims"]]
    counted = tested(claims)
    agree = sum(claim["agrees"] for claim in counted)
    rates = [claim["null_rate"] for claim in counted]
    chance, spread = sum(rates), math.sqrt(sum(rate * (1.0 - rate) for rate in rates))
    kinds = [claim["kind"] for claim in claims]
    text = (
        f"{agree} of {len(counted)} tested claims agree; null models would meet {chance:.1f} ± "
        f"{spread:.1f} of them"
    )
    if agree <= chance + 2.0 * spread:
        text += ", so this is no evidence for the model"
    return (
        f"{text}. {kinds.count('fitted')} more claims follow fits or choices and "
        f"{kinds.count('by construction')} come out as they do by construction; these are not "
        "counted."
    )


def fitted_and_assumed(section: Mapping[str, Any]) -> tuple[int, int]:
    """Return how many values of a `section` were fitted, and how many assumed."""
    kinds = [entry.get("kind") for entry in section["assumptions"]]
    return kinds.count("fitted"), kinds.count("assumed")
