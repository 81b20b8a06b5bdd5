"""How fast a robot may move before its cables, static in the paper and here, would vibrate.

A cable between fixed ends has transverse modes of its own (Irvine, Cable Structures, MIT Press
1981, chapter 3; Irvine and Caughey, Proc. R. Soc. A 341, 1974): out of its plane and antisymmetric
in it those of a taut string, symmetric in it raised by the stretch that goes with them.
"""

from __future__ import annotations

import math

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake import CableRobot, load_robot
from cdpr_drake.analysis import platform_modes
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.rotations import Array
from cdpr_drake.runs import paper_test
from reproduction.assumptions import assumed
from reproduction.section import Result
from reproduction.table7.large_robot import GOAL, START, true_robot

PLACES = tuple(
    f"{robot}_{end}" for robot in ("test_1", "test_4", "file", "large") for end in ("start", "goal")
)
"""Rests that are looked at: of CoGiRo, of cogiro-98m.yaml, of the robot of Table 7."""


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


def _robot_at(place: str) -> tuple[CableRobot, RigidTransform]:
    kind, _, which = place.rpartition("_")
    if not kind.startswith("test_"):
        robot = load_robot("cogiro-98m") if kind == "file" else true_robot(assumed("table7"))
        return robot, START if which == "start" else GOAL
    test = paper_test(int(kind.removeprefix("test_")))
    robot = test.carried_by(load_robot("cogiro"))
    start, goal = test.poses(robot)
    return robot, start if which == "start" else goal
