"""What the paper says of Table 7 and Fig. 16, beside what we get, and what else would do."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from cdpr_drake.model.rotations import Array
from reproduction.assumptions import assumptions, printed
from reproduction.null_models import chance_of_order, share, within
from reproduction.section import Claim, Kind, Result
from reproduction.table7.large_robot import MODELS, final_errors, printed_errors, time_to
from reproduction.table7.variations import SOFT, variations
from reproduction.texts import Texts

TEXTS = Texts("table7")

FRACTIONS = (0.5, 1.0 / math.e, 0.1, 0.02)
"""Of the way that is left when a run counts as arrived, to compare models by."""

WITHIN = 1.5
"""Ours and printed may differ by this factor."""

FAST_RAMP = 1.0
"""Of the moves that start fast [s]."""

ALONG = (0, 5, 10, 15, 20)
"""Places along x on the way of the move, whose stability is looked into [m]."""

FARTHER = 5.0
"""The SLSM strays, and the others do not, if it strays so many times as far."""

MORE = 1.1
"""A model overshoots more than another if it strays so many times as far."""

SAGGING = MODELS[:3]


def claims(results: Mapping[str, Result]) -> tuple[Claim, ...]:
    """Return all claims on Table 7, from the `results` of all cases."""
    ours = errors_of(results, "move")
    return (
        *_orders(results, ours),
        _farther_off(results, ours),
        _eight_errors(results, ours),
        *_excursions(results),
        _sagging_overshoot(results),
        _converges_before(results),
    )


def _orders(results: Mapping[str, Result], ours: Array) -> list[Claim]:
    theirs = printed_errors()
    every = varied_errors(results)

    def order(name: str, column: int, **numbers: Any) -> Claim:
        return TEXTS.claim(
            name,
            agrees=np.all(np.diff(ours[:, column]) > 0.0),
            kind="fitted",
            null_rate=chance_of_order(len(SAGGING)),
            theirs=theirs[:, column],
            ours=ours[:, column],
            kept=share(bool(np.all(np.diff(one[:, column]) > 0.0)) for one in every),
            **numbers,
        )

    return [
        order(
            "position_order",
            0,
            gap=_gap(results, "none"),
            soft_gap=_gap(results, "soft"),
            soft=SOFT,
            printed_gap=theirs[1, 0] - theirs[0, 0],
        ),
        order("orientation_order", 1),
    ]


def _farther_off(results: Mapping[str, Result], ours: Array) -> Claim:
    def ratio(errors: Array) -> float:
        return float(errors[3, 0] / errors[0, 0])

    theirs = ratio(printed_errors())
    every = varied_errors(results)
    return TEXTS.claim(
        "farther_off",
        agrees=within(ratio(ours), theirs, WITHIN),
        kind="fitted",
        null_rate=share(within(ratio(one), theirs, WITHIN) for one in every),
        theirs=theirs,
        ours=ratio(ours),
        variations=len(every),
        within=WITHIN,
    )


def one_for_three() -> Array:
    """Return the factors (2,) within which one value for ECM, CMWE and SCMWE is of the printed.

    The best such value is the geometric mean of the least and the largest; the SLSM has its own.
    """
    three = printed_errors()[: len(SAGGING)]
    factors: Array = np.sqrt(three.max(axis=0) / three.min(axis=0))
    return factors


def _eight_errors(results: Mapping[str, Result], ours: Array) -> Claim:
    ratio, fast = (_factors(errors) for errors in (ours, errors_of(results, "fast")))
    single = one_for_three()
    resolution = TEXTS.words("resolution")
    return TEXTS.claim(
        "eight_errors",
        agrees=ratio.max() <= WITHIN,
        kind="fitted",
        null_rate=share([single.max() <= WITHIN]),
        ours=ratio,
        single=single,
        within=WITHIN,
        resolves=resolution["nearer" if np.all(ratio < single) else "not nearer"],
        spread=_set_spread(results),
        ramp=FAST_RAMP,
        fast=fast,
    )


def _factors(errors: Array) -> Array:
    """Return the factors (2,) within which errors (4, 2) are of the printed ones."""
    factors: Array = np.exp(np.abs(np.log(errors / printed_errors()))).max(axis=0)
    return factors


def _excursions(results: Mapping[str, Result]) -> tuple[Claim, ...]:
    """Return the claims on excursions, with the ramp assumed and with a fast one."""
    most = {kind: _times_as_far(results, kind) for kind in ("move", "fast")}

    def one(name: str, run: str, kind: Kind, null_rate: float, ramp: float) -> Claim:
        strays = {m: excursions(results[f"{run}_{m}"]) for m in MODELS}
        return TEXTS.claim(
            name,
            agrees=most[run] >= FARTHER,
            kind=kind,
            null_rate=null_rate,
            ramp=ramp,
            strays={m: f"{z:.0f} mm, {turn:.2f}°" for m, (z, turn) in strays.items()},
            times=most[run],
            farther=FARTHER,
        )

    assumed = assumptions("table7")["ramp_time"].value
    by_ramp = share(times >= FARTHER for times in most.values())
    return (
        one("excursions_move", "move", "fitted", by_ramp, assumed),
        one("excursions_fast", "fast", "tested", 1.0 / len(MODELS), FAST_RAMP),
    )


def _sagging_overshoot(results: Mapping[str, Result]) -> Claim:
    """Return the claim that the ECM has no overshoots, but the other sagging models do."""

    def ratio(kind: str, model: str) -> float:
        ours, ecm = (excursions(results[f"{kind}_{m}"]) for m in (model, "ECM"))
        return max(ours[0] / ecm[0], ours[1] / ecm[1])

    slow, fast = ([ratio(kind, m) for m in SAGGING[1:]] for kind in ("move", "fast"))
    return TEXTS.claim(
        "sagging_overshoot",
        agrees=min(slow) >= MORE,
        kind="tested",
        null_rate=1.0 / len(SAGGING),
        slow=slow,
        ramp=FAST_RAMP,
        fast=fast,
        more=MORE,
    )


def _times_as_far(results: Mapping[str, Result], kind: str) -> float:
    """Return how many times as far as any other model the SLSM strays, at least."""
    slsm = np.array(excursions(results[f"{kind}_SLSM"]))
    others = np.array([excursions(results[f"{kind}_{m}"]) for m in SAGGING])
    return float((slsm / others).min())


def _converges_before(results: Mapping[str, Result]) -> Claim:
    theirs = printed_delta_t()
    first = [delta_t(results, m, f) for m in SAGGING for f in FRACTIONS]
    return TEXTS.claim(
        "converges_before",
        agrees=max(first) < 0.0,
        kind="fitted",
        null_rate=chance_of_order(2),
        theirs=theirs,
        first=(max(first), min(first)),
        lags=[fraction_of(results, m, t) for m, t in zip(SAGGING, theirs, strict=True)],
    )


# --- what is read off the runs


def varied_errors(results: Mapping[str, Result]) -> list[Array]:
    """Return the final errors [mm, deg] (4, 2) of all variations that the robot can move in.

    Args:
        results: of all cases, by their keys.
    """
    found = [results[f"vary_{key}"] for key in variations()]
    return [np.asarray(one["errors"]) for one in found if not one["failed"]]


def errors_of(results: Mapping[str, Result], kind: str) -> Array:
    """Return final errors [mm, deg] (4, 2) of the simulations, rows as in `MODELS`.

    Args:
        results: of all cases, by their keys.
        kind: the first part of the simulations' keys.
    """
    runs = [results[f"{kind}_{model}"] for model in MODELS]
    return np.array([final_errors(r["position_error"], r["orientation_error"]) for r in runs])


def excursions(result: Result) -> tuple[float, float]:
    """Return the largest error in z [mm], and how far the orientation strays from its way [deg].

    Args:
        result: of a simulation.
    """
    z = 1e3 * np.abs(np.asarray(result["position_error"])[:, 2]).max()
    return float(z), float(np.degrees(result["orientation_excursion"]))


def delta_t(results: Mapping[str, Result], model: str, fraction: float) -> float:
    """Return how much later than the SLSM a model arrives [s]; negative if it is first.

    Args:
        results: of all cases, by their keys.
        model: one of `MODELS`.
        fraction: of the way that is left at arrival.
    """
    ours, slsm = (results[f"move_{m}"] for m in (model, "SLSM"))
    return time_to(ours["time"], ours["position_error"], fraction) - time_to(
        slsm["time"], slsm["position_error"], fraction
    )


def fraction_of(results: Mapping[str, Result], model: str, wanted: float) -> float:
    """Return the fraction of the way left at which a model's `delta_t` is the one wanted.

    Args:
        results: of all cases, by their keys.
        model: one of `MODELS`.
        wanted: [s].
    """
    fractions = np.geomspace(0.95, 0.02, 60)
    ahead = np.array([delta_t(results, model, f) for f in fractions])
    return float(np.interp(-wanted, -ahead, fractions))


def printed_delta_t() -> list[float]:
    """Return the printed delta t of all models but the SLSM [s]."""
    return list(printed("table7")["delta_t"].value)


def _set_spread(results: Mapping[str, Result]) -> float:
    found, given = results["fit"]["values"], assumptions("table7")
    return max(abs(value / given[n].value - 1.0) for n, value in found.items())


def _gap(results: Mapping[str, Result], key: str) -> float:
    """Return how much farther off the CMWE ends than the ECM in a variation [mm]."""
    errors = np.asarray(results[f"vary_{key}"]["errors"])
    return float(errors[1, 0] - errors[0, 0])
