"""What could have come out otherwise: how often chance, or other choices, would meet a claim."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

CABLES = 8
TO_A_POST = 2
"""Cables in succession that share a post of CoGiRo, so that their tensions are alike."""


def share(outcomes: Iterable[bool]) -> float:
    """Return which part of some outcomes is true.

    Args:
        outcomes: at least one.
    """
    every = [bool(outcome) for outcome in outcomes]
    return sum(every) / len(every)


def chance_of_order(count: int) -> float:
    """Return how often things in random order are in a given one.

    Args:
        count: of them.
    """
    return 1.0 / math.factorial(count)


def chance_of_cables(numbers: Sequence[int]) -> float:
    """Return how often cables chosen at random are the given ones, by whole posts where they are.

    Args:
        numbers: of the cables, from 1.
    """
    posts = {(number - 1) // TO_A_POST for number in numbers}
    if len(numbers) == TO_A_POST * len(posts):
        return 1.0 / math.comb(CABLES // TO_A_POST, len(posts))
    return 1.0 / math.comb(CABLES, len(numbers))


def within(ours: float, theirs: float, factor: float) -> bool:
    """Whether neither of two positive numbers is more than a factor times the other.

    Args:
        ours: of any unit.
        theirs: of the same.
        factor: at least 1.
    """
    return 1.0 / factor <= ours / theirs <= factor
