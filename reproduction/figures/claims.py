"""What the paper says of Figures 10 to 15, beside what we get, and what could have come out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from cdpr_drake.model.rotations import Array
from cdpr_drake.runs import NUMBERS, paper_test
from reproduction.assumptions import printed
from reproduction.figures import poses
from reproduction.null_models import chance_of_cables, chance_of_order, share
from reproduction.section import Claim, Result
from reproduction.texts import Texts
from reproduction.traces import difference, rate, sizes

TEXTS = Texts("figures")

RATE_TOLERANCE = 0.05
"""A decay is exponential if the rate that fits it is λ to this part."""

ROUNDED = (0.01, float(np.degrees(0.01)))
"""The last digit of the printed poses [m, deg]."""

CLOSE = 0.05
"""Two runs are similar if they are never farther apart than this part of the move."""

SMALL = (0.0, 5.0)
"""What a small but not vanishing dbeta is between [deg]."""


def key(number: int, cable_model: str, setting: str) -> str:
    """Return the key of a run.

    Args:
        number: of the test.
        cable_model: of the law.
        setting: "robot" or "simulator".
    """
    return f"test-{number}-{cable_model}-{setting}"


def claims_of_test(number: int) -> Callable[[Mapping[str, Result]], list[Claim]]:
    """Return what makes the claims on Figures 10 to 12 of the runs' results, by their keys.

    Args:
        number: of the test, 1 to 3.
    """

    def claims(results: Mapping[str, Result]) -> list[Claim]:
        result = results[key(number, "SCMWE", "robot")]
        found = [_amplitude(number), _exponential(number, {"": result})]
        if number == 1:
            found.append(_least_tensed(result))
        if number == 3:
            found.append(_less_tensed_than_loaded(results))
        return [*found, _sag(result)]

    return claims


def _amplitude(number: int) -> Claim:
    metres, degrees = printed("figures")[f"amplitude_{number}"].value
    distance, angle = _move(number)

    def is_printed(distance: float, angle: float) -> bool:
        return abs(distance - metres) <= ROUNDED[0] and abs(angle - degrees) <= ROUNDED[1]

    return TEXTS.claim(
        "amplitude",
        agrees=is_printed(distance, angle),
        kind="by construction",
        null_rate=share(is_printed(*_move(n)) for n in NUMBERS),
        number=number,
        metres=metres,
        degrees=degrees,
        distance=distance,
        angle=angle,
        rounded=ROUNDED,
    )


def _move(number: int) -> tuple[float, float]:
    """Return how far [m] and by what angle [deg] the poses of a test are apart."""
    test = paper_test(number)
    move = test.start.InvertAndCompose(test.goal)
    distance = float(np.linalg.norm(move.translation()))
    return distance, float(np.degrees(move.rotation().ToAngleAxis().angle()))


def _exponential(number: int, runs: Mapping[str, Result]) -> Claim:
    gain = next(iter(runs.values()))["gain"]
    rates = {name: rate(result) for name, result in runs.items()}
    return TEXTS.claim(
        "exponential",
        agrees=all(abs(r / gain - 1.0) < RATE_TOLERANCE for r in rates.values()),
        kind="by construction",
        null_rate=poses.share_of_rates(RATE_TOLERANCE),
        rates=rates,
        gain=gain,
        final=max(float(np.mean(sizes(r)[-10:, 0])) for r in runs.values()),
        source=_source_of_gain(number),
    )


def _source_of_gain(number: int) -> str:
    """Return where a test's gain comes from, as its file says of the first test with that gain."""
    gain = paper_test(number).gain
    test = next(t for t in map(paper_test, NUMBERS) if t.gain == gain)
    assumed = [text for text in test.assumptions if text.startswith("gain: ")]
    return test.sources.get("gain", " ".join(assumed).removeprefix("gain: "))


def _least_tensed(result: Result) -> Claim:
    theirs = printed("figures")["least_tensed_test_1"].value
    tension, dbeta = np.mean(result["tension"], axis=0), np.mean(result["dbeta"], axis=0)
    least, most = _first(tension, len(theirs)), _first(-dbeta, len(theirs))
    return TEXTS.claim(
        "least_tensed",
        agrees=least == theirs and most == theirs,
        kind="tested",
        null_rate=chance_of_cables(theirs),
        theirs=theirs,
        least=least,
        most=most,
    )


def _less_tensed_than_loaded(results: Mapping[str, Result]) -> Claim:
    means = [np.mean(results[key(n, "SCMWE", "robot")]["tension"]) for n in (1, 2, 3)]
    return TEXTS.claim(
        "less_tensed",
        agrees=means[2] < min(means[:2]),
        kind="by construction",
        null_rate=poses.share_less_tensed(),
        means=means,
    )


def _sag(result: Result) -> Claim:
    low, high = np.min(result["dbeta"]), np.max(result["dbeta"])
    return TEXTS.claim(
        "sag",
        agrees=low > SMALL[0] and high < SMALL[1],
        kind="by construction",
        null_rate=poses.share_of_sag(*SMALL),
        low=low,
        high=high,
        small=SMALL,
    )


def claims_of_13(results: Mapping[str, Result]) -> list[Claim]:
    """Return the claims on Figure 13, from the `results` of its runs."""
    found = []
    for number in (4, 5):
        runs = {m: results[key(number, m, "robot")] for m in ("SCMWE", "SLSM")}
        found += [_amplitude(number), _exponential(number, runs)]
    return found


def similar(number: int, results: Mapping[str, Result], models: Sequence[str]) -> Claim:
    """Return the claim that errors of robot and simulator are alike.

    Args:
        number: of the test.
        results: of the runs, by their keys.
        models: of the law.
    """
    apart = {
        model: difference(*(results[key(number, model, where)] for where in ("robot", "simulator")))
        for model in models
    }
    return TEXTS.claim(
        "similar",
        agrees=max(apart.values()) < CLOSE,
        kind="by construction",
        number=number,
        apart={f"{model}: at most": a for model, a in apart.items()},
    )


def claims_of_15(results: Mapping[str, Result]) -> list[Claim]:
    """Return the claims on Figure 15, from the `results` of its runs."""
    theirs = printed("figures")["most_tensed_test_2"].value
    ours = {
        place: np.mean(results[key(2, "SCMWE", place)]["tension"], axis=0)
        for place in ("simulator", "robot")
    }
    most = {place: _first(-tension, len(theirs)) for place, tension in ours.items()}
    ratio = float(np.mean(ours["robot"]) / np.mean(ours["simulator"]))
    return [
        similar(2, results, ("SCMWE",)),
        similar(3, results, ("SCMWE",)),
        TEXTS.claim(
            "most_tensed",
            agrees=all(found == theirs for found in most.values()),
            kind="tested",
            null_rate=chance_of_cables(theirs),
            theirs=theirs,
            most=most,
        ),
        TEXTS.claim(
            "larger_in_experiments",
            agrees=ratio > 1.05,
            kind="tested",
            null_rate=chance_of_order(2),
            ratio=ratio,
        ),
    ]


def _first(values: Array, count: int) -> list[int]:
    """Return the cables of the lowest values, in the order of their numbers from 1."""
    return sorted(int(i) + 1 for i in np.argsort(values)[:count])
