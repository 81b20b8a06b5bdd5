"""The tables of the section on Table 4."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cdpr_drake.model.rotations import Array
from cdpr_drake.model.servo import pose_error
from cdpr_drake.runs import setup_of_test
from reproduction.assumptions import assumptions, printed
from reproduction.section import Result, Table, rounded
from reproduction.table4.explanations import EXPLANATIONS, TESTS
from reproduction.table4.work import FEW, PAYLOADS
from reproduction.texts import Texts

TEXTS = Texts("table4")

Visions = Mapping[str, Mapping[str, Array]]


def tables(results: Mapping[str, Result], visions: Visions) -> tuple[Table, ...]:
    """Return all tables on Table 4.

    Args:
        results: of all cases, by their keys.
        visions: ends of vision-based control by the kind of calibration, (seeds, tests, 3).
    """
    return (
        _errors(results, visions["joint"]),
        _explanations(results),
        _apart(results),
        _calibrations(visions),
        _verification(results),
        TEXTS.table(
            "sensitivity",
            [(text, *rounded(values, 1)) for text, *values in results["jsc-statics"]["changed"]],
        ),
    )


def amplitude(number: int) -> float:
    """Return the length [m] of the move of M in a test, by its `number`."""
    setup = setup_of_test(number)
    error = pose_error(setup.start, setup.goal, setup.robot.cameras.X_PM)
    return float(np.linalg.norm(error[3:]))


def left_over(number: int) -> float:
    """Return what the exponential has left of a move after the test's duration [mm].

    Args:
        number: of the test.
    """
    setup = setup_of_test(number)
    spent = setup.until - 0.5 * setup.loop.ramp_time
    return 1e3 * (amplitude(number) * float(np.exp(-setup.gain * spent)))


def fits(results: Mapping[str, Result]) -> list[Result]:
    """Return what the fits of the explanations found, from the `results` of all cases."""
    return [results[f"explain-{i + 1}"] for i in range(len(EXPLANATIONS))]


def _errors(results: Mapping[str, Result], ends: Mapping[str, Array]) -> Table:
    """Return Table 4 as we get it, with what the paper's text prints of it."""
    paper, statics = printed("table4"), results["jsc-statics"]
    rows: list[tuple[Any, ...]] = []
    for i, number in enumerate(TESTS):
        both = np.concatenate([ends["position"][:, i], ends["orientation"][:, i]], axis=1)
        jsc = [*statics["position"][i], *statics["orientation"][i]]
        rows += [
            (f"Test {number}, VBC, largest", *rounded(np.abs(both).max(axis=0))),
            (f"Test {number}, VBC, after 200 s", *rounded(results[f"vbc-{number}"]["then"])),
            (f"Test {number}, JSC", *rounded(jsc)),
        ]
    theirs = paper["jsc_z_test_3"].value
    rows.append(("Test 3, JSC, paper", None, None, theirs, None, None, None))
    return TEXTS.table("errors", rows, count=len(ends["position"]), paper=paper)


def _explanations(results: Mapping[str, Result]) -> Table:
    """Return how each explanation fits, and what a fit to one number predicts for the other."""
    paper = printed("table4")
    theirs = (paper["jsc_z_test_3"].value, paper["jsc_position"].value)
    rows: list[tuple[Any, ...]] = [("printed", "", *theirs, None, None)]
    for found in fits(results):
        position, predicted = np.asarray(found["position"]), found["predictions"]
        rows.append(
            (
                found["name"],
                _values(found["values"]),
                *rounded([position[2, 2], np.abs(position[:2]).max()], 1),
                _interval(predicted["largest"]),
                _interval(predicted["z"]),
            )
        )
    return TEXTS.table("explanations", rows)


def _apart(results: Mapping[str, Result]) -> Table:
    """Return what tells explanations apart: predictions of what was not fitted."""
    reference = np.asarray(results["jsc-statics"]["position"])
    rows = []
    for found in fits(results):
        position = np.asarray(found["position"])
        away = np.abs(position - reference).max()
        rows.append((found["name"], *rounded([*position[:, 2], *found["beyond"], away], 1)))
    return TEXTS.table("apart", rows, payloads=PAYLOADS)


def _calibrations(visions: Visions) -> Table:
    """Return what kinds of calibration leave at rest under vision-based control."""
    rows = []
    for kind, text in TEXTS.words("kinds", few=FEW).items():
        position = visions[kind]["position"]
        sizes = np.linalg.norm(position, axis=2)
        turns = np.linalg.norm(visions[kind]["orientation"], axis=2)
        for i, number in enumerate(TESTS):
            largest = np.abs(position[:, i]).max()
            rows.append(
                (
                    f"{text}, Test {number}",
                    len(sizes),
                    *rounded([np.median(sizes[:, i]), sizes[:, i].max(), largest], 1),
                    *rounded([np.median(turns[:, i]), turns[:, i].max()]),
                )
            )
    return TEXTS.table("calibrations", rows)


def _verification(results: Mapping[str, Result]) -> Table:
    """Return ends of runs beside those of statics."""
    rows = [
        (f"Test {number}, {text}: {label}", *rounded(results[f"{kind}-{number}"][how]))
        for kind, text in TEXTS.words("runs").items()
        for number in TESTS
        if f"{kind}-{number}" in results
        for label, how in (("run", "rest"), ("statics", "predicted"))
    ]
    return TEXTS.table("verification", rows)


def _values(values: Mapping[str, float]) -> str:
    given = assumptions("table4")
    parts = []
    for key, value in values.items():
        entry = given[key]
        bound = min(value - entry.low, entry.high - value) < 1e-3 * (entry.high - entry.low)
        unit = "" if entry.unit == "-" else f" {entry.unit}"
        parts.append(f"{key.replace('_', ' ')} {value:.3g}{unit}{'*' if bound else ''}")
    return ", ".join(parts)


def _interval(values: Any) -> str:
    if len(values) == 0:
        return "no fit"
    low, high = (f"{v:.1f}" for v in (np.min(values), np.max(values)))
    return low if low == high else f"{low} to {high}"
