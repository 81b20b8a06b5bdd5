"""Table 6: what is searched, and the section of the report."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cdpr_drake.model.rotations import Array
from reproduction.assumptions import assumptions
from reproduction.null_models import share
from reproduction.section import Case, Claim, Result, Section, Table
from reproduction.table6.sag_search import NAMES
from reproduction.table6.work import LOOKS, SIZES, look, permute, printed_dbeta, random_sets
from reproduction.texts import Texts

name = "table6"

TEXTS = Texts(name)

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
    """Return the section on Table 6, from the `results` of all cases."""
    common = results["common"]
    rms, rank = _permuted(results)
    return TEXTS.section(
        name,
        tables=(_comparison(common), _set_table(common), _looks_table(results)),
        claims=_claims(results),
        fitted={n: round(common["values"][n], 4) for n in NAMES},
        free=common["free"],
        numbers=3 * len(common["dbeta"][0]),
        orders=len(rms),
        both=int(np.sum((rms <= MOST_RMS) & (rank >= LEAST_RANK))),
        most_rms=MOST_RMS,
        least_rank=LEAST_RANK,
        better=int(np.sum(rms <= common["rms"])),
        rms=common["rms"],
        median=np.median(rms),
    )


def _permuted(results: Mapping[str, Result]) -> tuple[Array, Array]:
    """Return rms and least rank correlation (n,) of all permutations."""
    parts = [found for key, found in results.items() if key.startswith("permuted-")]
    rms, rank = (np.concatenate([np.asarray(p[what]) for p in parts]) for what in ("rms", "rank"))
    return rms, rank


def _claims(results: Mapping[str, Result]) -> tuple[Claim, ...]:
    common, random = results["common"], results["random"]
    rms, rank = _permuted(results)
    return (
        TEXTS.claim(
            "dbeta",
            agrees=common["rms"] <= MOST_RMS,
            kind="fitted",
            null_rate=share(rms <= MOST_RMS),
            rms=common["rms"],
            orders=len(rms),
            free=common["free"],
            level=results["level"],
            alone=max(results[size]["rms"] for size in SIZES),
        ),
        TEXTS.claim(
            "ranks",
            agrees=min(common["rank"]) >= LEAST_RANK,
            kind="fitted",
            null_rate=share(rank >= LEAST_RANK),
            rank=common["rank"],
            orders=len(rms),
            free=common["free"],
        ),
        TEXTS.claim(
            "growth",
            agrees=np.all(np.diff(common["dbeta"], axis=0) > 0.0),
            null_rate=random["growing"],
            theirs=printed_dbeta(SIZES).mean(axis=1),
            ours=np.mean(common["dbeta"], axis=1),
            held_up=random["held_up"],
            free=common["free"],
        ),
    )


def _comparison(common: Result) -> Table:
    theirs, ours = printed_dbeta(SIZES), np.asarray(common["dbeta"])
    error = 100 * np.sqrt(np.mean((ours / theirs - 1.0) ** 2, axis=1))
    rows: list[tuple[Any, ...]] = [
        (i + 1, *np.column_stack(pairs).ravel().tolist())
        for i, pairs in enumerate(zip(theirs.T, ours.T, strict=True))
    ]
    rows.append(("rms [%]", *(x for e in error for x in (None, float(e)))))
    rows.append(("rank correlation", *(x for r in common["rank"] for x in (None, r))))
    return TEXTS.table("comparison", rows, rms=common["rms"])


def _set_table(common: Result) -> Table:
    rows = [
        (n, a.unit, common["values"][n], *(a.range or (None, None)), a.kind)
        for n, a in assumptions(name).items()
    ]
    least = {}
    for size, tension in zip(SIZES, np.asarray(common["tension"]), strict=True):
        first = np.argsort(tension)[:2]
        least[f"{size}:"] = [f"{tension[i]:.0f} N ({i + 1})" for i in first]
    return TEXTS.table("set", rows, on_bound=common["on_bound"], least=least)


def _looks_table(results: Mapping[str, Result]) -> Table:
    rows = []
    for key, text in TEXTS.words("looks").items():
        found, numbers = results[key], 8 * len(LOOKS[key][0])
        rows.append((text, found["free"], numbers, 100 * found["rms"], min(found["rank"])))
    return TEXTS.table("looks", rows)
