"""Why joint space control ends too low: explanations fitted to what Table 4 is known to print."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cdpr_drake.model.rotations import Array
from reproduction.assumptions import assumptions, printed
from reproduction.table4.structure import EndError, Structure, joint_space_end

TESTS = (1, 2, 3)
UNITS = {"zero_offset": 1e-3}
"""Fields of a `Structure` that the data file has in another unit, and what to multiply it by."""

GRID = 5
"""Values of a second parameter that predictions are made for, across its range."""


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """A hypothesis about the structure.

    Args:
        name: in a few words.
        free: fields of a `Structure` that are fitted, "modulus" first, each within the range of
            the data file.
        drum_run: whether the run from drum to eyelet stretches.
    """

    name: str
    free: tuple[str, ...]
    drum_run: bool = True

    def structure(self, values: Array) -> Structure:
        """Return the structure with the free fields at `values`, in the units of the data file."""
        fields = dict(zip(self.free, (float(v) for v in values), strict=True))
        fields = {name: UNITS.get(name, 1.0) * value for name, value in fields.items()}
        if "slack_modulus" in fields:  # cables stiffen with tension, never the reverse
            fields["slack_modulus"] = min(fields["slack_modulus"], fields["modulus"])
        return Structure(**fields, drum_run=self.drum_run)

    def bounds(self) -> tuple[Array, Array]:
        """Return the least and the largest values of the free fields."""
        entries = assumptions("table4")
        return (
            np.array([entries[name].low for name in self.free]),
            np.array([entries[name].high for name in self.free]),
        )


EXPLANATIONS = (
    Explanation(name="constant modulus", free=("modulus",)),
    Explanation(name="stiffening modulus", free=("modulus", "slack_modulus", "half_tension")),
    Explanation(name="encoder offset", free=("modulus", "zero_offset")),
    Explanation(name="encoder offset, no run", free=("modulus", "zero_offset"), drum_run=False),
    Explanation(name="eyelet friction", free=("modulus", "friction")),
    Explanation(name="compliant posts", free=("modulus", "post_compliance")),
)


def fitted_structure() -> Structure:
    """Return the structure of the data file: the one set that all runs take."""
    values = {name: entry.value for name, entry in assumptions("table4").items()}
    names = ("modulus", "slack_modulus", "half_tension", "friction", "post_compliance")
    fields = {name: values[name] for name in names}
    return Structure(**fields, zero_offset=UNITS["zero_offset"] * values["zero_offset"])


def ends(structure: Structure) -> dict[int, EndError]:
    """Return where joint space control ends in Tests 1 to 3.

    Args:
        structure: what is true.
    """
    return {number: joint_space_end(structure, number) for number in TESTS}


def largest_of_tests_1_and_2(errors: dict[int, EndError]) -> float:
    """Return the largest component [mm] of the position errors of Tests 1 and 2.

    Args:
        errors: by the test's number.
    """
    return float(max(np.abs(errors[number].position).max() for number in (1, 2)))


def data(errors: dict[int, EndError]) -> Array:
    """Return (2,) [mm]: z of Test 3 and the largest size in Tests 1 and 2, ours minus printed.

    Args:
        errors: by the test's number.
    """
    paper = printed("table4")
    return np.array(
        [
            errors[3].position[2] - paper["jsc_z_test_3"].value,
            largest_of_tests_1_and_2(errors) - paper["jsc_position"].value,
        ]
    )


def fit(explanation: Explanation) -> tuple[Array, Array]:
    """Return the values of the free fields that fit best, and what is left of the data (2,) [mm].

    Least squares over the two printed numbers, within the ranges of the data file.

    Args:
        explanation: what to fit.
    """
    from scipy.optimize import least_squares

    low, high = explanation.bounds()
    found = least_squares(
        lambda share: data(ends(explanation.structure(low + share * (high - low)))),
        np.where(np.arange(low.size) == 0, 0.8, 0.2),
        bounds=(0.0, 1.0),
        diff_step=1e-3,
        xtol=1e-5,
        ftol=1e-6,
        max_nfev=40,
    )
    return low + found.x * (high - low), found.fun


def predictions(explanation: Explanation) -> dict[str, Array]:
    """Return what a fit to one printed number alone predicts for the other, all fits considered.

    The modulus is solved for at values of the last free field across its range, and that field at
    either end of the modulus' range; other fields are at their least.

    Args:
        explanation: what to fit.

    Returns:
        "largest" (n,) in Tests 1 and 2 of fits to z of Test 3, and "z" (m,) of Test 3 of fits to
        the largest in Tests 1 and 2 [mm]; n = m = 0 where no value in range fits.
    """
    found: dict[str, list[float]] = {"largest": [], "z": []}
    for which, name in enumerate(found):
        for values in _fits_to_one(explanation, which):
            errors = ends(explanation.structure(values))
            z, largest = errors[3].position[2], largest_of_tests_1_and_2(errors)
            found[name].append(float(z if name == "z" else largest))
    return {name: np.array(values) for name, values in found.items()}


def _fits_to_one(explanation: Explanation, which: int) -> Iterator[Array]:
    """Yield values of the free fields that meet one datum."""
    low, high = explanation.bounds()
    if low.size == 1:
        yield from _solved(explanation, low, 0, 2, which)
        return
    for last in np.linspace(low[-1], high[-1], GRID):
        yield from _solved(explanation, np.append(low[:-1], last), 0, 2, which)
    for modulus in (low[0], high[0]):
        start = np.append(modulus, low[1:])
        yield from _solved(explanation, start, low.size - 1, GRID, which)


def _solved(
    explanation: Explanation, values: Array, free: int, count: int, which: int
) -> Iterator[Array]:
    """Yield values with one field solved for, wherever in its range the sign changes."""
    from scipy.optimize import brentq

    def at(value: float) -> Array:
        return np.concatenate([values[:free], [value], values[free + 1 :]])

    def miss(value: float) -> float:
        return float(data(ends(explanation.structure(at(value))))[which])

    low, high = (float(bound[free]) for bound in explanation.bounds())
    points = np.linspace(low, high, count).tolist()
    misses = [miss(point) for point in points]
    for i in range(count - 1):
        if misses[i] * misses[i + 1] < 0.0:
            tolerance = 1e-3 * (high - low)
            yield at(brentq(miss, points[i], points[i + 1], xtol=tolerance))
