"""What the paper says of Table 5, beside what we get, and what could have come out otherwise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cdpr_drake.model.rotations import Array
from cdpr_drake.model.servo import pose_error
from cdpr_drake.runs import setup_of_test
from reproduction.assumptions import printed
from reproduction.null_models import chance_of_order, share, within
from reproduction.section import Claim, Result
from reproduction.table5.convergence import median_interval
from reproduction.table5.work import LAST, LEVELS, MODELS, TESTS
from reproduction.texts import Texts

TEXTS = Texts("table5")

LEVEL = LEVELS.index(0.02)
"""Converged: at 2 % of the first error."""

NORM, Z = 0, 1
"""Rows of "converged": the position error's norm, and its z."""

LIKE = 2.0
"""A number is like the printed one if neither is this many times the other."""

DRAWS = 200
"""Of the noise, to see what it alone gives."""

FINAL = {"real": "final_real", "simulator": "final_simulator"}
"""Claims on final errors, by where the paper has them from."""


def claims(results: Mapping[str, Result], pairs: Sequence[Result]) -> tuple[Claim, ...]:
    """Return all claims on Table 5.

    Args:
        results: of all cases, by their keys.
        pairs: results of `pair`.
    """
    real = [_final(pairs, "real", m, n) for n in TESTS for m in MODELS]
    ideal = [results[f"ideal-{TESTS[0]}"]]
    return (
        *real,
        _final(ideal, "simulator", MODELS[0], TESTS[0]),
        *(claim for n in TESTS for claim in (_first(pairs, n), _by_how_much(pairs, n))),
    )


def _final(runs: Sequence[Result], place: str, model: str, number: int) -> Claim:
    """Return the claim on a row of final errors, beside what the assumed noise gives alone."""
    theirs = printed("table5")[f"{place}_{model.lower()}_test_{number}"].value
    seen = stacked(runs, number, model, "seen").mean(axis=0)
    alone = without_model(number, noise=place == "real")
    return TEXTS.claim(
        FINAL[place],
        agrees=_like(seen, theirs),
        null_rate=share(_like(one, theirs) for one in alone),
        model=model,
        number=number,
        theirs=theirs,
        seen=seen,
        alone=alone.mean(axis=0),
        like=LIKE,
        true=stacked(runs, number, model, "true").max(axis=0),
    )


def _like(ours: Array, theirs: Sequence[float]) -> bool:
    """Whether position and orientation error are both like the printed ones, in either way."""
    return all(within(a, b, LIKE) for a, b in zip(ours, theirs, strict=True))


def without_model(number: int, noise: bool) -> Array:
    """Return final errors (draws, 2) [mm, deg] of an exponential, with the assumed noise or not.

    Args:
        number: of the test.
        noise: of the cameras.
    """
    setup = setup_of_test(number)
    cameras, step = setup.robot.cameras, setup.loop.timing.sample_time or 1.0
    time = setup.until - np.arange(0.0, LAST, step) - 0.5 * setup.loop.ramp_time
    first = pose_error(setup.start, setup.goal, cameras.X_PM)
    errors = np.exp(-setup.gain * time)[:, None] * first
    sigma = np.repeat([cameras.orientation_noise, cameras.position_noise], 3)
    draw = np.random.default_rng(number).standard_normal((DRAWS if noise else 1, *errors.shape))
    seen = errors + (sigma * draw if noise else 0.0 * draw)
    sizes = np.linalg.norm(seen.reshape(*seen.shape[:2], 2, 3), axis=3).mean(axis=1)
    return np.stack([1e3 * sizes[:, 1], np.degrees(sizes[:, 0])], axis=1)


def _first(pairs: Sequence[Result], number: int) -> Claim:
    theirs = printed("table5")[f"delta_t_test_{number}"].value
    interval = median_interval(differences(pairs, number)[:, NORM, LEVEL])
    return TEXTS.claim(
        "first",
        agrees=interval[2] < 0.0,
        kind="tested",
        null_rate=chance_of_order(len(MODELS)),
        number=number,
        interval=[1e3 * time for time in interval],
        part=abs(interval[0]) / theirs,
        theirs=theirs,
        pairs=len(pairs),
    )


def _by_how_much(pairs: Sequence[Result], number: int) -> Claim:
    theirs = printed("table5")[f"delta_t_test_{number}"].value
    median = float(np.median(differences(pairs, number)[:, NORM, LEVEL]))
    alike = unpaired(pairs, number, (MODELS[0], MODELS[0])).ravel()
    return TEXTS.claim(
        "by_how_much",
        agrees=within(-median, theirs, LIKE),
        null_rate=share(within(-dt, theirs, LIKE) for dt in alike),
        number=number,
        theirs=theirs,
        median=median,
        like=LIKE,
    )


# --- what runs differ by


def differences(pairs: Sequence[Result], number: int, what: str = "converged") -> Array:
    """Return convergence times, SCMWE less SLSM, of runs alike in noise and calibration [s].

    Args:
        pairs: results of `pair`.
        number: of the test.
        what: "converged", without noise (pairs, 2, levels), or "noisy" (pairs, levels).
    """
    ours, straight = (stacked(pairs, number, model, what) for model in MODELS)
    return ours - straight


def unpaired(
    pairs: Sequence[Result], number: int, models: tuple[str, str] = (MODELS[0], MODELS[1])
) -> Array:
    """Return how convergence times seen differ between runs with other noise and calibration.

    Args:
        pairs: results of `pair`.
        number: of the test.
        models: of the law, in the one run and in the other.

    Returns:
        (n, levels) [s]: all differences, the first less the second, of runs of different seeds.
    """
    first, second = (stacked(pairs, number, model, "noisy") for model in models)
    every = first[:, None] - second[None]
    other: Array = every[~np.eye(len(pairs), dtype=bool)]
    return other


def stacked(pairs: Sequence[Result], number: int, model: str, what: str) -> Array:
    """Return what runs of a test with a model have, a row for each.

    Args:
        pairs: results of `pair`.
        number: of the test.
        model: of the law.
        what: of `measured`.
    """
    return np.array([found[f"{number} {model}"][what] for found in pairs])
