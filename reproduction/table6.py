"""Table 6: how the sag of the eight cables grows with the size of the robot."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cdpr_drake.model.rotations import Array
from reproduction.assumptions import assumptions
from reproduction.null_models import share
from reproduction.sag_search import NAMES
from reproduction.section import Case, Claim, Result, Section, Table, kind_by
from reproduction.table6_work import LOOKS, SIZES, look, permute, printed_dbeta, random_sets

name = "table6"

MOST_RMS, LEAST_RANK = 0.18, 0.9
"""Criteria: how far dbeta may be apart, and how alike the ranks of the cables must be."""

CHUNKS = (0, 15, 30, 45, 60)
"""Seeds of the permutations, those of one case between two of these."""


def cases() -> Sequence[Case]:
    """Return one case for each search."""
    looks = [Case(key=key, function=look, arguments={"key": key}) for key in LOOKS]
    permuted = [
        Case(key=f"permuted-{first}", function=permute, arguments={"seeds": [*range(first, last)]})
        for first, last in itertools.pairwise(CHUNKS)
    ]
    return [*looks, *permuted, Case(key="random", function=random_sets)]


def section(results: Mapping[str, Result]) -> Section:
    """Return the section on Table 6.

    Args:
        results: of all cases, by their keys.
    """
    common = results["common"]
    values = common["values"]
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
            _permutations_in_words(results),
        ),
        tables=(_comparison(common), _set_table(common), _looks_table(results)),
        claims=_claims(results),
        fitted={n: round(values[n], 4) for n in NAMES},
    )


def _permuted(results: Mapping[str, Result]) -> tuple[Array, Array]:
    """Return rms and least rank correlation (n,) of all permutations."""
    parts = [found for key, found in results.items() if key.startswith("permuted-")]
    rms, rank = (np.concatenate([np.asarray(p[what]) for p in parts]) for what in ("rms", "rank"))
    return rms, rank


def _permutations_in_words(results: Mapping[str, Result]) -> str:
    rms, rank = _permuted(results)
    common = results["common"]
    both = int(np.sum((rms <= MOST_RMS) & (rank >= LEAST_RANK)))
    better = int(np.sum(rms <= common["rms"]))
    return (
        f"What the fit is worth: the same search, in full, for {len(rms)} random orders of the "
        f"printed cables, the same at the three sizes. {both} of them meet both criteria (rms at "
        f"most {100 * MOST_RMS:.0f} %, rank correlations at least {LEAST_RANK:g}), {better} come "
        f"nearer than the printed order ({100 * common['rms']:.1f} % rms; median "
        f"{100 * np.median(rms):.1f} %). With so many free values the search follows almost any "
        "order: that it follows the printed one says nothing of the model."
    )


def _claims(results: Mapping[str, Result]) -> tuple[Claim, ...]:
    common, alone = results["common"], max(results[size]["rms"] for size in SIZES)
    rms, rank = _permuted(results)
    growing, grows = results["random"], bool(np.all(np.diff(common["dbeta"], axis=0) > 0.0))
    growth = np.mean(common["dbeta"], axis=1)
    order = f"a random order of the cables, searched anew; {len(rms)} of them"
    ten = f"{common['free']} values of the set (fitted), mass (assumed)"
    return (
        Claim(
            text="dβ of the eight cables at three sizes",
            printed="24 numbers, 0.8° to 9.4°",
            ours=f"{100 * common['rms']:.1f} % rms apart, one set for all",
            agrees=common["rms"] <= MOST_RMS,
            kind="fitted",
            null=order,
            null_rate=share(rms <= MOST_RMS),
            parameters=ten,
            reason=f"level, {100 * results['level']['rms']:.1f} % with "
            f"{results['level']['free']} values; each robot alone, at most {100 * alone:.1f} %",
        ),
        Claim(
            text="which cables sag more than which",
            printed="ranks of the eight cables, three times",
            ours="rank correlations " + ", ".join(f"{r:.2f}" for r in common["rank"]),
            agrees=min(common["rank"]) >= LEAST_RANK,
            kind="fitted",
            null=order,
            null_rate=share(rank >= LEAST_RANK),
            parameters=ten,
        ),
        Claim(
            text="dβ increases with the dimensions of the robot",
            printed=", ".join(f"{m:.1f}°" for m in printed_dbeta(SIZES).mean(1)) + " on mean",
            ours=", ".join(f"{m:.1f}°" for m in growth),
            agrees=grows,
            kind=kind_by(growing["growing"]),
            null=f"any set in the ranges that the cables hold up; {growing['held_up']} of them",
            null_rate=growing["growing"],
            parameters=ten,
            reason="with the same cable and platform; for every cable",
        ),
    )


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
