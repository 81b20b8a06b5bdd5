"""Numbers as texts for people: digits that mean something, of large and of small robots."""

from __future__ import annotations

import math


def significant(value: float, digits: int = 3) -> str:
    """Return a value with some significant digits, without an exponent unless it is tiny.

    Args:
        value: any number; digits before the point are never rounded away.
        digits: how many.
    """
    if not math.isfinite(value):
        return str(value)
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e+" in text else text


def decimals(largest: float, digits: int = 3) -> int:
    """Return how many digits after the point show numbers up to a `largest` with some `digits`."""
    if not (math.isfinite(largest) and largest > 0.0):
        return 0
    return max(digits - 1 - math.floor(math.log10(largest)), 0)


def round_step(length: float) -> float:
    """Return the nearest of 1, 2, 5, 10, 20, ... and of their tenths that is not below a length.

    Args:
        length: positive.
    """
    power = 10.0 ** math.floor(math.log10(length))
    return next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= length * (1.0 - 1e-9))
