"""The tables of the section on Table 4."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cdpr_drake.model.rotations import Array
from cdpr_drake.model.servo import pose_error
from cdpr_drake.runs.running import setup_of_test
from reproduction.assumptions import assumptions, printed
from reproduction.explanations import EXPLANATIONS, TESTS
from reproduction.section import Result, Table
from reproduction.table4_work import FEW, PAYLOADS

AXES = ("x [mm]", "y [mm]", "z [mm]", "φ [°]", "θ [°]", "ψ [°]")

KIND_NAMES = {
    "joint": "section 4.3, all pixels and reflectors together",
    "few": f"the same with {FEW} poses",
    "mean": "the mean of the patterns' poses, as in the paper",
    "independent": "^fT_b, ^mT_e misjudged each by itself",
}


def amplitude(number: int) -> float:
    """Return the length of a test's move, of M [m].

    Args:
        number: of the test.
    """
    setup = setup_of_test(number)
    error = pose_error(setup.start, setup.goal, setup.robot.cameras.X_PM)
    return float(np.linalg.norm(error[3:]))


def left_over(number: int) -> float:
    """Return what the exponential has left of a move after the test's duration [m].

    Args:
        number: of the test.
    """
    setup = setup_of_test(number)
    spent = setup.until - 0.5 * setup.ramp_time
    return amplitude(number) * float(np.exp(-setup.gain * spent))


def errors(results: Mapping[str, Result], ends: Mapping[str, Array]) -> Table:
    """Return Table 4 as we get it, with what the paper's text prints of it.

    Args:
        results: of all cases, by their keys.
        ends: of vision-based control, all calibrations (seeds, tests, 3).
    """
    paper = printed("table4")
    rows: list[tuple[Any, ...]] = []
    for i, number in enumerate(TESTS):
        both = np.concatenate([ends["position"][:, i], ends["orientation"][:, i]], axis=1)
        statics = results["jsc-statics"]
        rows += [
            (f"Test {number}, VBC, largest", *_rounded(np.abs(both).max(axis=0))),
            (f"Test {number}, VBC, after 200 s", *_rounded(results[f"vbc-{number}"]["then"])),
            (
                f"Test {number}, JSC",
                *_rounded([*statics["position"][i], *statics["orientation"][i]]),
            ),
        ]
    theirs = paper["jsc_z_test_3"].value
    rows.append(("Test 3, JSC, paper", None, None, theirs, None, None, None))
    return Table(
        title="Errors of Tests 1 to 3, true minus desired, in F_b",
        headings=("", *AXES),
        rows=tuple(rows),
        note=(
            f"VBC, largest: at rest, sizes, of {len(ends['position'])} calibrations; after 200 s: "
            "one run with noise, its move not quite finished. The paper prints at most "
            f"{paper['vbc_position'].value} mm and {paper['vbc_orientation'].value}° for VBC, "
            f"{paper['jsc_position'].value} mm for JSC. X-Y-Z angles, so small that their order "
            "does not matter."
        ),
    )


def explanations(results: Mapping[str, Result]) -> Table:
    """Return how each explanation fits, and what a fit to one number predicts for the other.

    Args:
        results: of all cases, by their keys.
    """
    paper = printed("table4")
    rows: list[tuple[Any, ...]] = [
        (
            "printed",
            "",
            paper["jsc_z_test_3"].value,
            paper["jsc_position"].value,
            None,
            None,
        )
    ]
    for i in range(len(EXPLANATIONS)):
        found = results[f"explain-{i + 1}"]
        position = np.asarray(found["position"])
        rows.append(
            (
                found["name"],
                _values(found["values"]),
                round(float(position[2, 2]), 1),
                round(float(np.abs(position[:2]).max()), 1),
                _interval(found["predictions"]["largest"]),
                _interval(found["predictions"]["z"]),
            )
        )
    return Table(
        title="Explanations of the JSC error, fitted to both printed numbers",
        headings=(
            "explanation",
            "fitted values",
            "z, Test 3 [mm]",
            "largest, Tests 1, 2 [mm]",
            "largest, if fitted to Test 3 alone [mm]",
            "z, if fitted to Tests 1, 2 alone [mm]",
        ),
        rows=tuple(rows),
        note=(
            "* at the end of its range. Two numbers, so that a fit of two values can be exact and "
            "proves nothing; with one number fitted, what is left free within its range gives the "
            "intervals. All but “no run” have 5.4 m of cable from drum to eyelet stretch, too."
        ),
    )


def apart(results: Mapping[str, Result]) -> Table:
    """Return what tells explanations apart: predictions of what was not fitted.

    Args:
        results: of all cases, by their keys.
    """
    rows = []
    reference = np.asarray(results["jsc-statics"]["position"])
    for i in range(len(EXPLANATIONS)):
        found = results[f"explain-{i + 1}"]
        position = np.asarray(found["position"])
        rows.append(
            (
                found["name"],
                *_rounded([position[0, 2], position[1, 2], position[2, 2]], 1),
                *_rounded(found["beyond"], 1),
                round(float(np.abs(position - reference).max()), 1),
            )
        )
    return Table(
        title="What would tell the explanations apart: z under JSC [mm]",
        headings=(
            "explanation, fitted",
            *(f"Test {n}" for n in TESTS),
            *(f"Test 2's goal, {m:.0f} kg" for m in PAYLOADS),
            "farthest from the set of the runs, Tests 1 to 3",
        ),
        rows=tuple(rows),
        note=(
            "The pallet's mass is varied at Test 2's goal. Explanations with equal rows cannot be "
            "told apart by any load; those nearer than a few millimetres in Tests 1 to 3, not by "
            "Table 4."
        ),
    )


def calibrations(visions: Mapping[str, Mapping[str, Array]]) -> Table:
    """Return what kinds of calibration leave at rest under vision-based control.

    Args:
        visions: ends by kind, (seeds, tests, 3).
    """
    rows = []
    for kind, text in KIND_NAMES.items():
        sizes = np.linalg.norm(visions[kind]["position"], axis=2)
        turns = np.linalg.norm(visions[kind]["orientation"], axis=2)
        for i, number in enumerate(TESTS):
            rows.append(
                (
                    f"{text}, Test {number}",
                    len(sizes),
                    *_rounded([np.median(sizes[:, i]), sizes[:, i].max()], 1),
                    round(float(np.abs(visions[kind]["position"][:, i]).max()), 1),
                    *_rounded([np.median(turns[:, i]), turns[:, i].max()]),
                )
            )
    return Table(
        title="VBC: true errors at rest by the kind of calibration",
        headings=(
            "calibration",
            "seeds",
            "median [mm]",
            "largest [mm]",
            "largest component [mm]",
            "median [°]",
            "largest [°]",
        ),
        rows=tuple(rows),
        note="Norms, but for the largest component. The first kind is taken as the realistic one.",
    )


def verification(results: Mapping[str, Result]) -> Table:
    """Return ends of runs beside those of statics.

    Args:
        results: of all cases, by their keys.
    """
    names = {
        "vbc": "VBC, the whole move with noise",
        "cameras": "VBC, near its end, cameras that see the patterns",
        "jsc": "JSC, the whole move",
    }
    rows = []
    for kind, text in names.items():
        for number in TESTS:
            found = results.get(f"{kind}-{number}")
            if found is not None:
                for how in ("rest", "predicted"):
                    label = "run" if how == "rest" else "statics"
                    rows.append((f"Test {number}, {text}: {label}", *_rounded(found[how])))
    return Table(
        title="Ends of runs beside those of statics, one calibration each",
        headings=("", *AXES),
        rows=tuple(rows),
    )


def sensitivity(statics: Result) -> Table:
    """Return how the JSC errors depend on what is assumed besides the cables.

    Args:
        statics: the result of that case.
    """
    return Table(
        title="JSC with the fitted cables, if what is assumed were otherwise",
        headings=("", "z, Test 3 [mm]", "largest, Tests 1, 2 [mm]"),
        rows=tuple((text, *_rounded(values, 1)) for text, *values in statics["changed"]),
        note="The camera's place in the room is assumed, and with it that of all poses.",
    )


def _values(values: Mapping[str, float]) -> str:
    given = assumptions("table4")
    parts = []
    for key, value in values.items():
        span = given[key].high - given[key].low
        bound = min(value - given[key].low, given[key].high - value) < 1e-3 * span
        unit = "" if given[key].unit == "-" else f" {given[key].unit}"
        parts.append(f"{key.replace('_', ' ')} {value:.3g}{unit}{'*' if bound else ''}")
    return ", ".join(parts)


def _interval(values: Any) -> str:
    if len(values) == 0:
        return "no fit"
    low, high = (f"{v:.1f}" for v in (np.min(values), np.max(values)))
    return low if low == high else f"{low} to {high}"


def _rounded(values: Any, digits: int = 2) -> list[float]:
    return [round(float(v), digits) + 0.0 for v in values]
