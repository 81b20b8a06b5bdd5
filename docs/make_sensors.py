"""Write the tables of docs/sensors.md that come from noisy runs, and print what its text quotes.

    python docs/make_sensors.py [accuracy] [worth]

The other table there is of `analysis.calibration_study`, without noise.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from cdpr_drake.batch.ablation import Ablation, Statistic, ablate
from cdpr_drake.diagrams import GaussianSensing, TargetSensing
from cdpr_drake.diagrams.sensing import Sensing
from cdpr_drake.model.robot import load_robot
from cdpr_drake.runs import run, setup_of_test

PAGE = Path(__file__).resolve().parent / "sensors.md"
SEEDS = 4

POINTS, BIASED = "points with 0.2 px of noise", "and 0.25 px of fixed error per axis"
ROWS: tuple[tuple[str, Sensing, float | None], ...] = (
    ("the truth with noise, 1 mm and 0.05° per axis", GaussianSensing(), 0.0),
    (f"{POINTS}, joint estimate", TargetSensing(), 0.0),
    ("the same, the paper's mean", TargetSensing(estimator="mean"), 0.0),
    (f"{BIASED}, joint estimate", TargetSensing(), None),
    ("the same, the paper's mean", TargetSensing(estimator="mean"), None),
)
"""Of the first table: a name, what measures, and the points' fixed error [px], None the file's."""

METRICS = {"position_error": 1, "orientation_error": 3, "settled_after": 1,
           "position_excursion": 1, "lowest_tension": 0}  # fmt: skip
"""Columns of the second table, and their digits."""


def accuracy() -> Iterator[str]:
    """Yield the table of how accurate the pose is: Test 4 at 0.3 1/s, 8 time constants long."""
    yield "| what closes the loop | error, mm | deg | seen, mm | deg |"
    yield "|---|---|---|---|---|"
    exact = run(setup_of_test(4, gain=0.3, until=26.7, noise=False)).summary
    yield f"| the truth | {exact.position_error:.2f} | {exact.orientation_error:.3f} | | |"
    for name, sensing, bias in ROWS:
        found = np.array([errors(sensing, bias, seed) for seed in range(SEEDS)])
        means, spread = found.mean(axis=0), found.std(axis=0, ddof=1)
        cells = [figure(m, d, s) for m, s, d in zip(means, spread, (2, 3), strict=False)]
        yield f"| {name} | {' | '.join(cells)} | {means[2]:.1f} | {means[3]:.2f} |"
    yield "| the paper, Tests 1 to 3, a laser tracker (Table 4) | 9.9 at most, per axis | 0.38 at most | | |"  # noqa: E501
    yield "| the paper, Test 4 (Table 5) | 2.1 | 0.01 | | |"


def errors(sensing: Sensing, bias: float | None, seed: int) -> tuple[float | None, ...]:
    """Return the true errors at the end of a run [mm, deg], and the seen ones.

    Args:
        sensing: what measures.
        bias: fixed error of each point [px], the robot file's if None.
        seed: of noise and of fixed errors.
    """
    robot = load_robot("cogiro")
    changed = {"pixel_bias_seed": seed} | ({} if bias is None else {"pixel_bias": bias})
    robot = robot.replace(cameras=robot.cameras.replace(**changed))
    found = run(setup_of_test(4, robot, gain=0.3, until=26.7, sensing=sensing, seed=seed)).summary
    seen = (found.position_error_seen, found.orientation_error_seen)
    return found.position_error, found.orientation_error, *seen


def figure(mean: float, digits: int, spread: float | None = None) -> str:
    """Return a mean and its spread in words, with three figures at most.

    Args:
        mean: to be told.
        digits: after the point, at most.
        spread: standard deviation of one run, if it is told.
    """
    digits = max(0, min(digits, 2 - math.floor(math.log10(mean))))
    return f"{mean:.{digits}f}" + ("" if spread is None else f" ± {spread:.{digits}f}")


def worth(found: list[Ablation]) -> Iterator[str]:
    """Yield the table of what each sensor is worth."""
    yield "| sensors | error, mm | deg | to 2 %, s | strays, mm | lowest tension, N |"
    yield "|---|---|---|---|---|---|"
    moves = ("15 m: Test 4", "98 m")
    for move, ablation in zip(moves, found, strict=True):
        where = f"{ablation.distance:.2f} m" + (" near the middle" if ":" not in move else "")
        join = ", " if ":" in move else ": "
        yield f"| **{move}{join}{where}, λ = {ablation.gain:.2g} s⁻¹** | | | | | |"
        for row in ablation.rows:
            cells = [_cell(row.statistics[name], name) for name in METRICS]
            label = "all" if row is ablation.rows[0] else row.sensors.label
            yield f"| {label} | {' | '.join(cells)} |"


def _cell(value: Statistic, name: str) -> str:
    if value.mean is None:
        return "–"
    text = figure(value.mean, METRICS[name], value.deviation if "error" in name else None)
    return f"**{text}**" if value.is_told_apart else text


def differences(found: list[Ablation]) -> Iterator[str]:
    """Yield the largest differences to all sensors, of means over the seeds, as the text has."""
    for ablation in found:
        for row in ablation.rows[1:]:
            of = {n: row.statistics[n].difference for n in METRICS}
            text = ", ".join(f"{n} {d:+.2g}" for n, d in of.items() if d is not None)
            yield f"{ablation.robot}, {row.sensors.label}: {text}"


def main() -> None:
    """Fill the page, or those of its tables that are named."""
    tables, wanted = {}, sys.argv[1:] or ["accuracy", "worth"]
    if "accuracy" in wanted:
        tables["accuracy"] = list(accuracy())
    if "worth" in wanted:
        found = ablate(["cogiro", "cogiro-98m"], SEEDS, jobs=1)
        tables["worth"] = list(worth(found))
        print(*differences(found), sep="\n")
    page = PAGE.read_text(encoding="utf-8")
    for name, table in tables.items():
        begin, end = f"<!-- begin {name} -->\n", f"<!-- end {name} -->"
        head, rest = page.split(begin)
        page = head + begin + "\n".join(table) + "\n" + end + rest.split(end)[1]
    PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
