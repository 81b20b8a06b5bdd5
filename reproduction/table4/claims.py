"""What the paper says of Table 4, beside what we get, and what could have come out otherwise."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from cdpr_drake.model.rotations import Array
from reproduction.assumptions import printed
from reproduction.null_models import share
from reproduction.section import Claim, Result
from reproduction.table4.tables import Visions, left_over
from reproduction.texts import Texts

TEXTS = Texts("table4")

TOLERANCE = {"position": 10.0, "orientation": 0.5}
"""What the paper claims of vision-based control in its section 1 [mm, deg]."""

CLOSE_Z, CLOSE_LARGEST = 0.15, 0.25
"""How near the two printed JSC errors ours must be, as a share of them."""

ESTIMATORS = ("mean", "joint")
"""Of the pose, by the kind of calibration; the paper's is the mean of the patterns' poses."""


def claims(results: Mapping[str, Result], visions: Visions) -> tuple[Claim, ...]:
    """Return all claims on Table 4.

    Args:
        results: of all cases, by their keys.
        visions: ends of vision-based control by the kind of calibration, (seeds, tests, 3).
    """
    return (
        *(_accurate(visions, kind) for kind in ESTIMATORS),
        *(_largest(results, visions, kind) for kind in ESTIMATORS),
        _better_than_jsc(results, visions["mean"]),
        *_joint_space_claims(results),
        _from_test_3_alone(results),
    )


# --- vision-based control


def _with_estimator(name: str, kind: str, rate: float, agrees: bool, **numbers: Any) -> Claim:
    """Return a claim on the ends with the estimator of a kind of calibration."""
    return TEXTS.claim(
        name,
        agrees=agrees,
        kind=None if kind == "mean" else "fitted",
        null_rate=rate,
        estimator=TEXTS.words("estimators")[kind],
        parameters=TEXTS.words("calibration")[kind],
        **numbers,
    )


def _accurate(visions: Visions, kind: str) -> Claim:
    """Return the claim on the accuracy."""
    met = _accurate_draws(visions[kind])
    sizes, turns = _sizes(visions[kind])
    others = [other for other in visions if other != kind]
    if kind == "mean":  # the other two have our estimator
        others = ["independent"]
    return _with_estimator(
        "accurate",
        kind,
        share(one for other in others for one in _accurate_draws(visions[other])),
        all(met),
        size=sizes.max(),
        turn=turns.max(),
        met=share(met),
        count=len(met),
        others=others,
        beyond=(sizes > TOLERANCE["position"]).mean(axis=0),
    )


def _accurate_draws(ends: Mapping[str, Array]) -> list[bool]:
    """Return for each seed (seeds,) whether all tests end within the `TOLERANCE`."""
    sizes, turns = _sizes(ends)
    met = (sizes <= TOLERANCE["position"]) & (turns <= TOLERANCE["orientation"])
    return np.all(met, axis=1).tolist()


def _sizes(ends: Mapping[str, Array]) -> tuple[Array, Array]:
    return np.linalg.norm(ends["position"], axis=2), np.linalg.norm(ends["orientation"], axis=2)


def _largest(results: Mapping[str, Result], visions: Visions, kind: str) -> Claim:
    """Return the claim on the largest component, the printed one among those of all draws."""
    paper = printed("table4")
    theirs = [paper["vbc_position"].value, paper["vbc_orientation"].value]
    ours, other = _components(visions[kind]), _components(visions["independent"])
    low, high = ours.min(axis=0), ours.max(axis=0)
    return _with_estimator(
        "largest",
        kind,
        share(np.all((low <= other) & (other <= high), axis=1)),
        bool(np.all((low <= theirs) & (theirs <= high))),
        theirs=theirs,
        low=low,
        high=high,
        count=len(ours),
        after=results["vbc-1"]["after"],
        left=left_over(1),
    )


def _components(ends: Mapping[str, Array]) -> Array:
    """Return the largest components (seeds, 2) of three tests, position and orientation."""
    largest = [np.abs(ends[what]).max(axis=(1, 2)) for what in ("position", "orientation")]
    return np.stack(largest, axis=1)


def _better_than_jsc(results: Mapping[str, Result], ends: Mapping[str, Array]) -> Claim:
    vision = np.abs(ends["position"][:, :, 2])
    jsc = np.abs(results["jsc-statics"]["position"][:, 2])
    soft = np.abs(results["moduli"]["position"][:, :, 2])
    largest = vision.max(axis=0)
    return TEXTS.claim(
        "better",
        agrees=np.all(largest < jsc),
        null_rate=share(np.all(vision[:, None] < soft, axis=2).ravel()),
        vision=largest,
        jsc=jsc,
    )


# --- joint space control


def _joint_space_claims(results: Mapping[str, Result]) -> list[Claim]:
    paper, statics = printed("table4"), results["jsc-statics"]
    position, beyond = np.asarray(statics["position"]), statics["beyond"]
    theirs_z, theirs = paper["jsc_z_test_3"].value, paper["jsc_position"].value
    z, farthest = position[:, 2], _farthest(results)

    def over_moduli(
        name: str, meets: Callable[[Array, Array], bool], fitted: bool = False, **numbers: Any
    ) -> Claim:
        """Return a claim, with how often a constant modulus would meet it.

        Whether one meets it is told by positions (3, 3) [mm] of Tests 1 to 3, and z with each
        payload.
        """
        every = results["moduli"]
        return TEXTS.claim(
            name,
            agrees=meets(position, np.asarray(beyond)),
            kind="fitted" if fitted else None,
            null_rate=share(map(meets, every["position"], every["beyond"])),
            moduli=every["modulus"][[0, -1]],
            **numbers,
        )

    return [
        over_moduli(
            "z_of_test_3",
            lambda p, _: abs(p[2, 2] - theirs_z) <= CLOSE_Z * abs(theirs_z),
            fitted=True,
            theirs=theirs_z,
            ours=z[2],
        ),
        over_moduli(
            "largest_jsc",
            lambda p, _: abs(_largest_of(p) - theirs) <= CLOSE_LARGEST * theirs,
            fitted=True,
            theirs=theirs,
            ours=_largest_of(position),
        ),
        over_moduli(
            "downwards",
            lambda p, _: p[:, 2].max() < -3.0 * np.abs(p[:, :2]).max(),
            high=z.max(),
            low=z.min(),
            aside=np.abs(position[:, :2]).max(),
        ),
        over_moduli(
            "less_with_less_mass",
            lambda p, _: abs(p[2, 2]) < np.abs(p[:2, 2]).min(),
            less=-z[2],
            more=-z[:2],
        ),
        over_moduli(  # runs of both masses end where the calibration alone says
            "mass",
            lambda _, b: abs(b[1]) > 1.1 * abs(b[0]) and farthest < 0.1 * TOLERANCE["position"],
            empty=beyond[0],
            loaded=beyond[1],
            farthest=farthest,
        ),
    ]


def _from_test_3_alone(results: Mapping[str, Result]) -> Claim:
    """Return the claim that one number of the two follows from the other."""
    theirs, every = printed("table4")["jsc_position"].value, results["moduli"]
    predicted = np.asarray(results["explain-1"]["predictions"]["largest"])
    ours = float(predicted[0]) if predicted.size else np.nan

    def near(largest: float) -> bool:
        return abs(largest - theirs) <= CLOSE_LARGEST * theirs

    return TEXTS.claim(
        "from_test_3",
        agrees=near(ours),
        null_rate=share(near(_largest_of(position)) for position in every["position"]),
        theirs=theirs,
        ours=ours,
        moduli=every["modulus"][[0, -1]],
    )


def _largest_of(position: Array) -> float:
    """Return the largest component of Tests 1 and 2 [mm]."""
    return float(np.abs(position[:2]).max())


def _farthest(results: Mapping[str, Result]) -> float:
    """Return how far the ends of vision-based runs are from those of statics at most [mm]."""
    return max(
        float(np.linalg.norm(found["rest"][:3] - found["predicted"][:3]))
        for key, found in results.items()
        if key.startswith(("vbc-", "cameras-"))
    )
