"""How fast a robot may move before its cables, static in the paper and here, would vibrate.

A cable between fixed ends has transverse modes of its own (Irvine, Cable Structures, MIT Press
1981, chapter 3; Irvine and Caughey, Proc. R. Soc. A 341, 1974): out of its plane and antisymmetric
in it those of a taut string, symmetric in it raised by the stretch that goes with them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.analysis import platform_modes
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake import CableRobot, load_robot
from cdpr_drake.model.rotations import Array
from cdpr_drake.runs import paper_test
from reproduction.assumptions import assumed, assumptions
from reproduction.table7.large_robot import GOAL, START, true_robot
from reproduction.null_models import share
from reproduction.section import Case, Claim, Result, Section, Table, kind_by

name = "cable_modes"

PLACES = {
    "test_1_start": "CoGiRo, 210 kg, start of Test 1",
    "test_1_goal": "CoGiRo, 210 kg, goal of Test 1",
    "test_4_start": "CoGiRo, 100 kg, start of Test 4",
    "test_4_goal": "CoGiRo, 100 kg, goal of Test 4",
    "file_start": "cogiro-98m.yaml, start of Table 7",
    "file_goal": "cogiro-98m.yaml, goal of Table 7",
    "large_start": "robot of Table 7, start",
    "large_goal": "robot of Table 7, goal",
}

SLOWER = 10.0
"""A motion this many times slower than the lowest cable mode leaves cables static."""


def cases() -> Sequence[Case]:
    """Return one case for each pose."""
    return [Case(key=key, function=look, arguments={"place": key}) for key in PLACES]


def look(place: str) -> Result:
    """Return the modes of cables and platform at one rest, frequencies in Hz.

    Args:
        place: of `PLACES`.
    """
    robot, X_WP = _robot_at(place)
    rest = rest_state(robot, X_WP)
    geometry = cable_geometry(robot, X_WP)
    T_A = rest.tension_at_drawing_point
    stiffness = np.array([robot.cable.stiffness(t) for t in T_A])
    w = robot.weight_per_metre
    string = string_frequencies(geometry.L, rest.chord_tension, robot.cable.linear_density)
    ratio = sag_ratios(
        geometry.L, geometry.Bx, rest.chord_tension, w, stiffness, robot.cable.drum_run
    )
    modes = platform_modes(robot, X_WP)
    found = sorted((m.frequency, m.damping) for m in modes.modes if m.frequency > 0.0)
    hung = robot.cable.linear_density * rest.unstrained_length.sum()
    return {
        "string": string,
        "in_plane": string * np.array([in_plane_factor(x) for x in ratio]),
        "lambda_squared": ratio,
        "tension": rest.chord_tension,
        "platform": np.array([f for f, _ in found]),
        "damping": np.array([d for _, d in found]),
        "mass_ratio": float(hung / robot.mass),
    }


def string_frequencies(L: Array, T: Array, linear_density: float) -> Array:
    """Return the lowest frequency (k,) [Hz] of taut strings, (1 / 2 L) (T / rho)^(1/2).

    Args:
        L: (k,) [m] chords.
        T: (k,) [N] chord tensions.
        linear_density: rho [kg/m].
    """
    return np.sqrt(T / linear_density) / (2.0 * L)


def sag_ratios(L: Array, Bx: Array, T: Array, w: float, EA: Array, run: Array) -> Array:
    """Return Irvine's lambda^2 (k,) [-], geometric over elastic stiffness of inclined cables.

    lambda^2 = (w L cos(beta0) / T)^2 L EA / (T L_e), L_e = L (1 + (w L cos(beta0) / T)^2 / 8), to
    which the run from drum to drawing point adds: it stretches too.

    Args:
        L: (k,) [m] chords.
        Bx: (k,) [m] their horizontal parts.
        T: (k,) [N] chord tensions.
        w: [N/m].
        EA: (k,) [N].
        run: (k,) [m].
    """
    sag = w * Bx / T
    stretching = L * (1.0 + sag**2 / 8.0) + run
    return sag**2 * L * EA / (T * stretching)


def in_plane_factor(lambda_squared: float) -> float:
    """Return the lowest in-plane frequency over that of the taut string.

    The lowest of the antisymmetric modes, 2, and the symmetric, where with x = half the frequency
    times L (rho / T)^(1/2), tan x = x - 4 x^3 / lambda^2.

    Args:
        lambda_squared: Irvine's.
    """
    if lambda_squared < 1e-9:
        return 1.0

    def rest(x: float) -> float:
        """Return the equation times cos x, which is finite and changes sign once in between."""
        return math.sin(x) - (x - 4.0 * x**3 / lambda_squared) * math.cos(x)

    low, high = 0.5 * math.pi, 1.5 * math.pi
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rest(middle) > 0.0 else (low, middle)
    return min(2.0, (low + high) / math.pi)


def section(results: Mapping[str, Result]) -> Section:
    """Return the section on the limit of static cables.

    Args:
        results: of all cases, by their keys.
    """
    gain = assumed("table7")["gain"]
    span = {start: _span(results, start) for start in ("test_", "file_", "large_")}
    cogiro, large = span["test_"][0], span["large_"][0]
    pace = gain / (2.0 * math.pi)
    agrees, rate = large > SLOWER * pace, _slower_over_ranges(large)
    return Section(
        name=name,
        title="The limit of static cables",
        text=(
            "Both the paper and this package take a cable to be at rest in its place at every "
            "moment: no waves run along it. That holds for motions slow beside its own modes, "
            "which are compared here with those of the platform on static cables, winches locked. "
            "Minimum-norm tensions; a tauter cable vibrates faster, as the root of its tension.",
            f"{SLOWER:g} times below the lowest cable mode are {cogiro / SLOWER:.2f} Hz on CoGiRo "
            f"and {large / SLOWER:.3f} Hz on the robot of Table 7. Vision-based control at λ = "
            f"{gain:.3g} 1/s moves at λ / 2π = {pace:.3f} Hz: what is said of final errors, "
            "excursions and convergence stands. Frequencies and damping of the platform's modes "
            "above a cable's do not: there the cables move too, and their mass adds to the "
            "platform's.",
        ),
        tables=(_table(results),),
        claims=(
            Claim(
                kind=kind_by(rate),
                null="any cable and gain of Table 7's ranges, its tension the same",
                null_rate=rate,
                parameters="linear_density, gain (fitted); mass (assumed)",
                text="cables may be taken as static under quasi-static control (7.2)",
                printed="assumed",
                ours=f"λ / 2π is {large / pace:.0f} times below the lowest cable mode at 98 m",
                agrees=agrees,
                reason=f"lowest modes of the cables {_range(span['test_'])} on CoGiRo, "
                f"{_range(span['file_'])} at 98 m with a 4 mm cable, {_range(span['large_'])} with "
                "that of Table 7; the platform's lowest "
                f"{_range(_platform(results, 'test_'))} and "
                f"{_range(_platform(results, 'large_'))}: its vibrations are not quasi-static",
            ),
        ),
    )


def _slower_over_ranges(lowest: float) -> float:
    """Return how often control is slow beside the cables over the ranges of cable and gain.

    At one tension a cable's frequency goes with the root of its mass.

    Args:
        lowest: frequency of a cable of the mass assumed [Hz].
    """
    given = assumptions("table7")
    density, gain = given["linear_density"], given["gain"]
    return share(
        lowest * math.sqrt(density.value / rho) > SLOWER * pace / (2.0 * math.pi)
        for rho in np.linspace(density.low, density.high, 21)
        for pace in np.linspace(gain.low, gain.high, 21)
    )


def _robot_at(place: str) -> tuple[CableRobot, RigidTransform]:
    kind, _, which = place.rpartition("_")
    if not kind.startswith("test_"):
        robot = load_robot("cogiro-98m") if kind == "file" else true_robot(assumed("table7"))
        return robot, START if which == "start" else GOAL
    test = paper_test(int(kind.removeprefix("test_")))
    robot = test.carried_by(load_robot("cogiro"))
    start, goal = test.poses(robot)
    return robot, start if which == "start" else goal


def _span(results: Mapping[str, Result], start: str) -> tuple[float, float]:
    """Return the least and largest of the cables' lowest frequencies over poses [Hz]."""
    all_of = np.concatenate([results[p]["string"] for p in PLACES if p.startswith(start)])
    return float(all_of.min()), float(all_of.max())


def _platform(results: Mapping[str, Result], start: str) -> tuple[float, float]:
    """Return the least and largest of the platform's lowest frequencies over poses [Hz]."""
    lowest = [float(results[p]["platform"][0]) for p in PLACES if p.startswith(start)]
    return min(lowest), max(lowest)


def _range(span: tuple[float, float]) -> str:
    return f"{span[0]:.2g} to {span[1]:.2g} Hz"


def _table(results: Mapping[str, Result]) -> Table:
    rows: list[tuple[Any, ...]] = []
    for place, text in PLACES.items():
        r = results[place]
        pair = (
            _range((float(np.min(r[key])), float(np.max(r[key])))) for key in ("string", "in_plane")
        )
        ratio, tension = np.asarray(r["lambda_squared"]), np.asarray(r["tension"])
        rows.append(
            (
                text,
                f"{tension.min():.0f} to {tension.max():.0f}",
                *pair,
                f"{ratio.min():.2g} to {ratio.max():.2g}",
                _range((float(r["platform"][0]), float(r["platform"][-1]))),
                100.0 * float(r["damping"][0]),
                100.0 * float(r["mass_ratio"]),
            )
        )
    return Table(
        title="Lowest modes of the eight cables, and of the platform",
        headings=(
            "where", "chord tensions [N]", "cables, out of plane", "cables, in plane",
            "Irvine's λ²", "platform, winches locked", "damping of its lowest [%]",
            "cables' mass [% of the platform's]",
        ),
        rows=tuple(rows),
        note="The damping is assumed (damping_time), not known.",
    )  # fmt: skip
