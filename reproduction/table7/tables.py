"""The tables of the section on Table 7."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from reproduction.assumptions import assumptions
from reproduction.section import Result, Table
from reproduction.table7.claims import (
    ALONG,
    FAST_RAMP,
    FRACTIONS,
    delta_t,
    errors_of,
    excursions,
    printed_delta_t,
)
from reproduction.table7.large_robot import MODELS, printed_errors
from reproduction.table7.variations import FRAMES, LIGHTER, POINTS, SOFT, variations
from reproduction.texts import Texts

TEXTS = Texts("table7")


def tables(results: Mapping[str, Result]) -> tuple[Table, ...]:
    """Return all tables on Table 7, from the `results` of all cases."""
    return (
        _comparison(results),
        _delta_t_table(results),
        _excursion_table(results),
        _stability_table(results),
        _set_table(results),
        _variation_table(results),
    )


def _comparison(results: Mapping[str, Result]) -> Table:
    theirs, ours = printed_errors(), errors_of(results, "move")
    (t, t_turn), (o, o_turn) = theirs.T, ours.T
    slow = np.asarray(results["vary_none"]["errors"])[:, 0]
    columns = (t, o, o / t, t - t[0], o - o[0], t_turn, o_turn, o_turn / t_turn, slow)
    rows = [(model, *row) for model, row in zip(MODELS, np.transpose(columns), strict=True)]
    return TEXTS.table("comparison", rows)


def _delta_t_table(results: Mapping[str, Result]) -> Table:
    rows = [
        (model, wanted, *(delta_t(results, model, f) for f in FRACTIONS))
        for model, wanted in zip(MODELS, printed_delta_t(), strict=False)
    ]
    return TEXTS.table("delta_t", rows, fractions=FRACTIONS)


def _excursion_table(results: Mapping[str, Result]) -> Table:
    rows = []
    for kind, after in (("move", ""), ("fast", f", ramp {FAST_RAMP:g} s")):
        for model in MODELS:
            result = results[f"{kind}_{model}"]
            speed = np.abs(np.asarray(result["velocity"])).max(axis=0)
            tension = np.asarray(result["tension"])
            side = 1e3 * float(np.abs(np.asarray(result["position_error"])[:, 1]).max())
            z, turn = excursions(result)
            bounds = (tension.min(), tension.max())
            rows.append((f"{model}{after}", z, side, turn, *speed.tolist(), *bounds))
    return TEXTS.table("excursions", rows)


def _stability_table(results: Mapping[str, Result]) -> Table:
    rows = []
    for x in ALONG:
        r = results[f"stable_{x}"]
        time = f"{r['damping_time']:.2f}" if math.isfinite(r["damping_time"]) else "more than 10"
        rows.append((x, r["growth"], r["frequency"], r["drag"], 100.0 * r["damping"], time))
    return TEXTS.table("stability", rows)


def _set_table(results: Mapping[str, Result]) -> Table:
    found = results["fit"]["values"]
    rows = [
        (n, a.unit, _text(a.value), found.get(n), _text(a.range or ""), a.kind)
        for n, a in assumptions("table7").items()
    ]
    return TEXTS.table("set", rows)


def _text(value: Any) -> str:
    if isinstance(value, list | tuple):
        return " to ".join(f"{x:g}" for x in value) if len(value) == 2 else str(value)
    return f"{value:g}" if isinstance(value, float | int) else str(value)


def _variation_table(results: Mapping[str, Result]) -> Table:
    rows: list[tuple[Any, ...]] = []
    for key, text in _changes().items():
        errors = np.asarray(results[f"vary_{key}"]["errors"])
        if results[f"vary_{key}"]["failed"]:
            rows.append((text, *[None] * 8))
            continue
        ordered = "yes" if np.all(np.diff(errors[:, 0]) > 0.0) else "no"
        rows.append((text, *errors[:, 0].tolist(), *errors[[0, 2, 3], 1], ordered))
    return TEXTS.table("variations", rows)


def _changes() -> dict[str, str]:
    """Return what each of the `variations` is."""
    said = TEXTS.words(
        "variations",
        soft=SOFT,
        lighter=1 - LIGHTER,
        points=[1e3 * POINTS.drawing_points, 1e3 * POINTS.attachment_points],
        angle=np.degrees(FRAMES.camera_angle),
    )
    given = assumptions("table7")

    def of_value(changes: Mapping[str, Any]) -> str:
        ((name, value),) = changes.items()
        unit = "" if given[name].unit == "-" else f" {given[name].unit}"
        return f"{name} {value:g}{unit}"

    every = variations().items()
    return {key: said[key] if key in said else of_value(changes) for key, changes in every}
