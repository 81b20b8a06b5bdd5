"""Values of a report in words, the same on the screen, in HTML and in Markdown."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
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


def count_of_claims(report: Mapping[str, Any]) -> str:
    """Return in a sentence how many claims of a `report` hold."""
    claims = [claim for section in report["sections"] for claim in section["claims"]]
    agree = sum(claim["agrees"] for claim in claims)
    return f"{agree} of {len(claims)} claims agree, {len(claims) - agree} differ."


def fitted_and_assumed(section: Mapping[str, Any]) -> tuple[int, int]:
    """Return how many values of a `section` were fitted, and how many assumed."""
    kinds = [entry.get("kind") for entry in section["assumptions"]]
    return kinds.count("fitted"), kinds.count("assumed")
