"""The limit of static cables: what is worked out, and the section of the report."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from reproduction.assumptions import assumed, assumptions
from reproduction.cable_modes.work import PLACES, look
from reproduction.null_models import share
from reproduction.section import Case, Claim, Result, Section, Table
from reproduction.texts import Texts

name = "cable_modes"

TEXTS = Texts(name)

SLOWER = 10.0
"""A motion this many times slower than the lowest cable mode leaves cables static."""


def cases() -> Sequence[Case]:
    """Return one case for each pose."""
    return [Case(key=key, function=look, arguments={"place": key}) for key in PLACES]


def section(results: Mapping[str, Result]) -> Section:
    """Return the section on the limit of static cables, from the `results` of all cases."""
    gain = assumed("table7")["gain"]
    pace = gain / (2.0 * math.pi)
    return TEXTS.section(
        name,
        tables=(_table(results),),
        claims=(_claim(results, pace),),
        slower=SLOWER,
        cogiro=_span(results, "test_")[0] / SLOWER,
        large=_span(results, "large_")[0] / SLOWER,
        gain=gain,
        pace=pace,
    )


def _claim(results: Mapping[str, Result], pace: float) -> Claim:
    """Return the claim on cables as slow as the control, which moves at a pace [Hz]."""
    spans = {start: _span(results, start) for start in ("test_", "file_", "large_")}
    large = spans["large_"][0]
    return TEXTS.claim(
        "static",
        agrees=large > SLOWER * pace,
        null_rate=_slower_over_ranges(large),
        below=large / pace,
        cables=[_range(span) for span in spans.values()],
        platform=[_range(_platform(results, start)) for start in ("test_", "large_")],
    )


def _slower_over_ranges(lowest: float) -> float:
    """Return how often control is slow beside the cables over the ranges of cable and gain.

    At one tension a cable's frequency goes with the root of its mass.

    Args:
        lowest: frequency of a cable of the mass assumed [Hz].
    """
    given = assumptions("table7")
    density, gain = given["linear_density"], given["gain"]
    return share(
        lowest * math.sqrt(density.value / rho) > SLOWER * pace / (2.0 * math.pi)
        for rho in np.linspace(density.low, density.high, 21)
        for pace in np.linspace(gain.low, gain.high, 21)
    )


def _span(results: Mapping[str, Result], start: str) -> tuple[float, float]:
    """Return the least and largest of the cables' lowest frequencies over poses [Hz]."""
    all_of = np.concatenate([results[p]["string"] for p in PLACES if p.startswith(start)])
    return float(all_of.min()), float(all_of.max())


def _platform(results: Mapping[str, Result], start: str) -> tuple[float, float]:
    """Return the least and largest of the platform's lowest frequencies over poses [Hz]."""
    lowest = [float(results[p]["platform"][0]) for p in PLACES if p.startswith(start)]
    return min(lowest), max(lowest)


def _range(span: tuple[float, float]) -> str:
    return f"{span[0]:.2g} to {span[1]:.2g} Hz"


def _table(results: Mapping[str, Result]) -> Table:
    rows = []
    for place, text in TEXTS.words("places").items():
        r = results[place]
        ratio, tension = np.asarray(r["lambda_squared"]), np.asarray(r["tension"])
        rows.append(
            (
                text,
                f"{tension.min():.0f} to {tension.max():.0f}",
                *(_range((np.min(r[key]), np.max(r[key]))) for key in ("string", "in_plane")),
                f"{ratio.min():.2g} to {ratio.max():.2g}",
                _range((r["platform"][0], r["platform"][-1])),
                100.0 * float(r["damping"][0]),
                100.0 * float(r["mass_ratio"]),
            )
        )
    return TEXTS.table("modes", rows)
