"""Table 7 and Fig. 16: what is simulated, and the section of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from reproduction.assumptions import assumptions
from reproduction.section import Case, Result, Section
from reproduction.table7.claims import ALONG, FAST_RAMP, claims
from reproduction.table7.large_robot import DURATION, GOAL, MODELS, printed_errors
from reproduction.table7.tables import tables
from reproduction.table7.variations import variations, vary
from reproduction.table7.work import fit, move, stability
from reproduction.texts import Texts

name = "table7"


def cases() -> Sequence[Case]:
    """Return four simulations, four that start fast, the fit, variations, and places on the way."""
    moves = [Case(key=f"move_{m}", function=move, arguments={"cable_model": m}) for m in MODELS]
    fast = [
        Case(key=f"fast_{m}", function=move, arguments={"cable_model": m, "ramp_time": FAST_RAMP})
        for m in MODELS
    ]
    varied = [Case(key=f"vary_{k}", function=vary, arguments={"key": k}) for k in variations()]
    stable = [Case(key=f"stable_{x}", function=stability, arguments={"x": float(x)}) for x in ALONG]
    return [*moves, *fast, Case(key="fit", function=fit), *varied, *stable]


def section(results: Mapping[str, Result]) -> Section:
    """Return the section on Table 7, from the `results` of all cases."""
    given, ecm = assumptions(name), printed_errors()[0]
    fitted = [n for n, a in given.items() if a.kind == "fitted"]
    distance = float(np.linalg.norm(GOAL.translation()))
    stable = [results[f"stable_{x}"] for x in ALONG]
    growth, damping = (sorted(r[key] for r in stable) for key in ("growth", "damping"))
    without, points = (
        np.asarray(results[f"vary_{key}"]["errors"])[0, 1] for key in ("target_angle_low", "points")
    )
    return Texts(name).section(
        name,
        tables=tables(results),
        claims=claims(results),
        fitted={n: a.value for n, a in given.items()},
        distance=distance,
        duration=DURATION,
        ecm=ecm,
        implied=np.log(1e3 * distance / (3.0 * ecm[0])) / DURATION,
        fits=len(fitted),
        fitted_names=fitted,
        coupling=without,
        points=points,
        given=given,
        damping_time=1e3 * given["damping_time"].value,
        growth=[growth[0], growth[-1]],
        drag=max(r["drag"] for r in stable),
        damping=[damping[0], damping[-1]],
    )
