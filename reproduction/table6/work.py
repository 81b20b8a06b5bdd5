"""The work behind Table 6: searches for the printed numbers, and for ones that are not printed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import rankdata

from cdpr_drake import load_robot
from cdpr_drake.model.rotations import Array
from reproduction.assumptions import assumptions, printed
from reproduction.null_models import share
from reproduction.section import Result
from reproduction.table6.sag_search import LEAST_TENSION, NAMES, ScaledRobots, search

SIZES = ("22m", "37m", "98m")

LOOKS: dict[str, tuple[tuple[str, ...], dict[str, float]]] = {
    "common": (SIZES, {}),
    "level": (SIZES, {"roll": 0.0, "pitch": 0.0}),
    "own_com": (SIZES, {"com_x": 0.013, "com_y": -0.034}),
    "heavy": (SIZES, {"mass": 100.0}),
    "least_norm": (SIZES, {"tension_3": 0.0, "tension_6": 0.0}),
    "22m": (("22m",), {}),
    "37m": (("37m",), {}),
    "98m": (("98m",), {}),
}
"""What is searched, by key: for which robots, with which values held."""

RANDOM = 4000
"""Sets drawn from the ranges."""


def permute(seeds: list[int]) -> Result:
    """Return what a search finds for the printed numbers with the cables in a random order.

    The order is the same at all three sizes; the search is that of "common", in full.

    Args:
        seeds: of the orders.

    Returns:
        "rms" (seeds,) and the least "rank" (seeds,) correlation.
    """
    found = []
    for seed in seeds:
        order = np.random.default_rng(seed).permutation(8)
        found.append(_searched("common", printed_dbeta(SIZES)[:, order]))
    return {
        "rms": np.array([one["rms"] for one in found]),
        "rank": np.array([min(one["rank"]) for one in found]),
    }


def random_sets() -> Result:
    """Return how often dbeta grows with the size for all cables, of random sets in the ranges.

    The result holds "held_up", how many have all cables tensed at all sizes, and "growing", of
    these the share whose dbeta grows.
    """
    ranges, fixed = _ranges_of("common")
    bounds = np.array([ranges.get(n, (fixed.get(n, 0.0),) * 2) for n in NAMES])
    low, high = bounds.T
    draw = np.random.default_rng(0).random((RANDOM, len(NAMES)))
    tension, dbeta = _robots(SIZES)(low + (high - low) * draw)
    tensed = np.all(tension > LEAST_TENSION, axis=(1, 2))
    grows = np.all(np.diff(dbeta[tensed], axis=1) > 0.0, axis=(1, 2))
    return {"held_up": int(tensed.sum()), "growing": share(grows)}


def look(key: str) -> Result:
    """Search one of `LOOKS` from the ranges in the file of assumptions.

    Args:
        key: of `LOOKS`.
    """
    return _searched(key, printed_dbeta(LOOKS[key][0]))


def _searched(key: str, theirs: Array) -> Result:
    """Return what a search finds for the dbeta of `theirs` [deg]."""
    ranges, fixed = _ranges_of(key)
    robots = _robots(LOOKS[key][0])
    values = search(robots, theirs, ranges, fixed)
    tension, dbeta = robots.one(values)
    return {
        "values": values,
        "free": len(ranges),
        "on_bound": [n for n, (low, high) in ranges.items() if _at_end(values[n], low, high)],
        "dbeta": dbeta,
        "tension": tension,
        "rms": float(np.sqrt(np.mean((dbeta / theirs - 1.0) ** 2))),
        "rank": [rank_correlation(a, b) for a, b in zip(dbeta, theirs, strict=True)],
    }


def _ranges_of(key: str) -> tuple[dict[str, tuple[float, float]], dict[str, float]]:
    """Return the ranges of the values that a search is free in, and the values that it holds."""
    given = assumptions("table6")
    held = {n: a.value for n, a in given.items() if n in NAMES and a.kind == "assumed"}
    held |= LOOKS[key][1]
    return {n: (a.low, a.high) for n, a in given.items() if n in NAMES and n not in held}, held


def _robots(sizes: Sequence[str]) -> ScaledRobots:
    return ScaledRobots([load_robot(f"cogiro-{size}") for size in sizes])


def printed_dbeta(sizes: Sequence[str]) -> Array:
    """Return what the paper prints (r, 8) [deg].

    Args:
        sizes: r of `SIZES`.
    """
    numbers = printed("table6")
    return np.array([numbers[f"dbeta_{size}"].value for size in sizes])


def rank_correlation(a: Array, b: Array) -> float:
    """Return Spearman's rank correlation; numbers that agree share their mean rank.

    Args:
        a: (n,) numbers.
        b: (n,) numbers.
    """
    return float(np.corrcoef(rankdata(a), rankdata(b))[0, 1])


def _at_end(value: float, low: float, high: float) -> bool:
    return min(value - low, high - value) < 1e-3 * (high - low)
