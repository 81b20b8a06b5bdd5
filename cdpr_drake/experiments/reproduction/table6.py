"""Table 6: how the sag of the eight cables grows with the size of the robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cdpr_drake.experiments.reproduction.assumptions import assumptions, printed
from cdpr_drake.experiments.reproduction.sag_search import NAMES, ScaledRobots, search
from cdpr_drake.experiments.reproduction.section import Case, Claim, Result, Section, Table
from cdpr_drake.model.robot import load_robot
from cdpr_drake.model.rotations import Array

name = "table6"

SIZES = ("22m", "37m", "98m")

LEVEL = {"roll": 0.0, "pitch": 0.0}

LOOKS = {
    "common": ("one set for all three", SIZES, {}),
    "level": ("the platform level", SIZES, LEVEL),
    "own_com": ("the robot file's centre of mass", SIZES, {"com_x": 0.013, "com_y": -0.034}),
    "heavy": ("100 kg, with the forklift", SIZES, {"mass": 100.0}),
    "least_norm": ("minimum-norm tensions", SIZES, {"tension_3": 0.0, "tension_6": 0.0}),
    "22m": ("a set for 22 m alone", ("22m",), {}),
    "37m": ("a set for 37 m alone", ("37m",), {}),
    "98m": ("a set for 98 m alone", ("98m",), {}),
}
"""What is searched, by key: what it is, for which robots, with which values held."""


def cases() -> Sequence[Case]:
    """Return one case for each search."""
    return [Case(key=key, function=look, arguments={"key": key}) for key in LOOKS]


def look(key: str) -> Result:
    """Search one of `LOOKS` from the ranges in the file of assumptions.

    Args:
        key: of `LOOKS`.
    """
    _, sizes, held = LOOKS[key]
    given = assumptions(name)
    fixed = {n: a.value for n, a in given.items() if n in NAMES and a.kind == "assumed"} | held
    ranges = {n: (a.low, a.high) for n, a in given.items() if n in NAMES and n not in fixed}
    theirs = printed_dbeta(sizes)
    robots = ScaledRobots([load_robot(f"cogiro-{size}") for size in sizes])
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


def section(results: Mapping[str, Result]) -> Section:
    """Return the section on Table 6.

    Args:
        results: of all cases, by their keys.
    """
    common = results["common"]
    rms, least_rank = common["rms"], min(common["rank"])
    values = common["values"]
    growth = np.mean(common["dbeta"], axis=1)
    alone = max(results[size]["rms"] for size in SIZES)
    return Section(
        name=name,
        title="Table 6: sag of the cables of three scaled robots",
        text=(
            "The paper prints dβ = β - β0 of the SCMWE for three scaled versions of CoGiRo at a "
            "pose, load and internal tension that it does not print. One set of them, relative to "
            "the robot's size, is searched for all three: differential evolution from sets spread "
            f"over the ranges of the file of assumptions, then least squares; {common['free']} "
            f"free values for {3 * len(common['dbeta'][0])} numbers. Platform and cable are "
            "CoGiRo's own at each size. Of the centre of mass only the horizontal distance from E "
            "counts at one tilt, so that its height stays that of the robot file.",
            "A search for one robot alone has more free values than numbers. What it leaves within "
            "the same ranges is a bound on what a set common to all can reach; it says nothing "
            "about the pose.",
        ),
        tables=(_comparison(common), _set_table(common), _looks_table(results)),
        claims=(
            Claim(
                text="dβ of the eight cables at three sizes",
                printed="24 numbers, 0.8° to 9.4°",
                ours=f"{100 * rms:.1f} % rms apart, one set for all",
                agrees=rms <= 0.18,
                reason=(
                    f"fits of {common['free']} values; level, {100 * results['level']['rms']:.1f} "
                    f"% with {results['level']['free']}; each robot alone, at most "
                    f"{100 * alone:.1f} %"
                ),
            ),
            Claim(
                text="which cables sag more than which",
                printed="ranks of the eight cables, three times",
                ours="rank correlations " + ", ".join(f"{r:.2f}" for r in common["rank"]),
                agrees=least_rank >= 0.9,
            ),
            Claim(
                text="dβ increases with the dimensions of the robot",
                printed=", ".join(f"{m:.1f}°" for m in printed_dbeta(SIZES).mean(1)) + " on mean",
                ours=", ".join(f"{m:.1f}°" for m in growth),
                agrees=bool(np.all(np.diff(common["dbeta"], axis=0) > 0.0)),
                reason="with the same cable and platform; for every cable",
            ),
        ),
        fitted={n: round(values[n], 4) for n in NAMES},
    )


def printed_dbeta(sizes: Sequence[str]) -> Array:
    """Return what the paper prints (r, 8) [deg].

    Args:
        sizes: r of `SIZES`.
    """
    numbers = printed(name)
    return np.array([numbers[f"dbeta_{size}"].value for size in sizes])


def rank_correlation(a: Array, b: Array) -> float:
    """Return Spearman's rank correlation; numbers that agree share their mean rank.

    Args:
        a: (n,) numbers.
        b: (n,) numbers.
    """
    return float(np.corrcoef(_ranks(a), _ranks(b))[0, 1])


def _ranks(a: Array) -> Array:
    below = (a[:, None] > a).sum(1)
    same = (a[:, None] == a).sum(1)
    return below + 0.5 * (same - 1)


def _at_end(value: float, low: float, high: float) -> bool:
    return min(value - low, high - value) < 1e-3 * (high - low)


def _comparison(common: Result) -> Table:
    theirs, ours = printed_dbeta(SIZES), np.asarray(common["dbeta"])
    rows: list[tuple[Any, ...]] = [
        (i + 1, *(x for r in range(len(SIZES)) for x in (float(theirs[r, i]), float(ours[r, i]))))
        for i in range(theirs.shape[1])
    ]
    error = 100 * np.sqrt(np.mean((ours / theirs - 1.0) ** 2, axis=1))
    rows.append(("rms [%]", *(x for e in error for x in (None, float(e)))))
    rows.append(("rank correlation", *(x for r in common["rank"] for x in (None, r))))
    headings = [f"{size}, {whose}" for size in SIZES for whose in ("paper", "ours")]
    return Table(
        title="dβ [deg]",
        headings=("cable", *headings),
        rows=tuple(rows),
        note=f"rms over all: {100 * common['rms']:.1f} %.",
    )


def _set_table(common: Result) -> Table:
    given = assumptions(name)
    tension = np.asarray(common["tension"])
    low = ", ".join(
        f"{size}: {', '.join(f'{t:.0f} N ({i + 1})' for i, t in _least(row))}"
        for size, row in zip(SIZES, tension, strict=True)
    )
    return Table(
        title="The set",
        headings=("value", "unit", "found", "from", "to", "kind"),
        rows=tuple(
            (n, a.unit, common["values"][n], *(a.range or (None, None)), a.kind)
            for n, a in given.items()
        ),
        note=(
            f"At the end of their range: {', '.join(common['on_bound']) or 'none'}. The cables "
            f"least tensed: {low}."
        ),
    )


def _least(tension: Array) -> list[tuple[int, float]]:
    return [(int(i), float(tension[i])) for i in np.argsort(tension)[:2]]


def _looks_table(results: Mapping[str, Result]) -> Table:
    rows: list[tuple[Any, ...]] = []
    for key, (text, sizes, _) in LOOKS.items():
        found = results[key]
        rows.append((text, found["free"], 8 * len(sizes), 100 * found["rms"], min(found["rank"])))
    return Table(
        title="What each freedom is worth",
        headings=("search", "free values", "numbers", "rms [%]", "least rank correlation"),
        rows=tuple(rows),
    )
