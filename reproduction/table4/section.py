"""Table 4: what is worked out, and the section of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cdpr_drake.model.rotations import Array
from reproduction.assumptions import assumed, printed
from reproduction.section import Case, Result, Section
from reproduction.table4.claims import claims
from reproduction.table4.explanations import EXPLANATIONS, TESTS
from reproduction.table4.tables import Visions, amplitude, fits, left_over, tables
from reproduction.table4.work import (
    FEW,
    PAYLOADS,
    calibration,
    camera_run,
    explain,
    fitted_ends,
    joint_space_run,
    moduli,
    noise_run,
    vision_run,
)
from reproduction.texts import Texts

name = "table4"

CHUNK = {"joint": 5, "few": 4, "mean": 10, "independent": 20}
"""Seeds of one case, by the kind of calibration."""

NOISY_TEST = 3
VERIFIED_TESTS = (1, 3)
"""Tests whose ends are verified by runs with cameras that see the patterns."""


def cases() -> Sequence[Case]:
    """Return the fits, the calibrations, and the runs."""

    def by_test(key: str, function: Any, tests: Sequence[int] = TESTS) -> list[Case]:
        return [Case(key=f"{key}-{n}", function=function, arguments={"number": n}) for n in tests]

    return [
        *by_test("vbc", vision_run),
        *(
            Case(key=f"explain-{i + 1}", function=explain, arguments={"index": i})
            for i in range(len(EXPLANATIONS))
        ),
        *(
            Case(
                key=f"calibrations-{kind}-{i + 1}",
                function=calibration,
                arguments={"kind": kind, "seeds": seeds},
            )
            for kind in CHUNK
            for i, seeds in enumerate(_chunks(kind))
        ),
        *by_test("jsc", joint_space_run),
        *by_test("cameras", camera_run, VERIFIED_TESTS),
        Case(key="noise", function=noise_run, arguments={"number": NOISY_TEST}),
        Case(key="jsc-statics", function=fitted_ends),
        Case(key="moduli", function=moduli),
    ]


def _chunks(kind: str) -> list[list[int]]:
    """Return the seeds of each case of a kind; one that only compares has fewer."""
    seeds, size = list(range(assumed(name)["seeds"])), CHUNK[kind]
    used = seeds[: len(seeds) // 2] if kind == "few" else seeds
    return [used[i : i + size] for i in range(0, len(used), size)]


def section(results: Mapping[str, Result]) -> Section:
    """Return the section on Table 4, from the `results` of all cases."""
    visions = {kind: _gathered(results, kind) for kind in CHUNK}
    return Texts(name).section(
        name,
        tables=tables(results, visions),
        claims=claims(results, visions),
        fitted=assumed(name),
        **_numbers(results, visions),
    )


def _gathered(results: Mapping[str, Result], kind: str) -> dict[str, Array]:
    """Return the ends of all seeds of a kind of calibration (seeds, tests, 3) [mm], [deg]."""
    parts = [results[key] for key in results if key.startswith(f"calibrations-{kind}-")]
    return {
        what: np.concatenate([np.asarray(part[what]) for part in parts])
        for what in ("position", "orientation")
    }


def _numbers(results: Mapping[str, Result], visions: Visions) -> dict[str, Any]:
    noise, values, paper = results["noise"], assumed(name), printed(name)
    by_name = {found["name"]: found for found in fits(results)}
    constant = np.asarray(by_name["constant modulus"]["position"])[:, 2]
    offsets = by_name["encoder offset"], by_name["encoder offset, no run"]
    statics = results["jsc-statics"]
    return {
        "exact": [n for n, found in by_name.items() if np.abs(found["left"]).max() < 0.1],
        "ratio": constant[1] / constant[2],
        "most": paper["jsc_position"].value / -paper["jsc_z_test_3"].value,
        "near": [np.abs(np.asarray(o["position"]) - statics["position"]).max() for o in offsets],
        "far": [abs(o["beyond"][-1] - statics["beyond"][-1]) for o in offsets],
        "payload": PAYLOADS[-1],
        "alone": np.linalg.norm(visions["independent"]["position"], axis=2).max(),
        "poses": values["calibration_poses"],
        "seeds": values["seeds"],
        "few": FEW,
        "means": np.abs(visions["mean"]["position"]).max(),
        "noise": noise["position"].max(),
        "noise_of_law": noise["position_of_law"],
        "noisy_test": NOISY_TEST,
        "left": left_over(1),
        "amplitude": amplitude(1),
    }
