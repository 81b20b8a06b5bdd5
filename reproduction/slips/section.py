"""What each slip of the printed equations would do to the controlled robot if left in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.analysis import target_twist
from cdpr_drake.model.cable_models import profile, unstrained_length
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.rest_model import rest_model
from cdpr_drake import CableRobot, load_robot
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.servo import pose_error, servo_twist
from cdpr_drake.runs import paper_test
from reproduction.assumptions import assumed
from reproduction.table7.large_robot import GOAL, ORDER, true_robot
from reproduction.slips.printed_equations import (
    A_I_READINGS,
    SLIPS,
    ecm,
    length_rates,
    printed_a,
    servo_twist_by_inversion,
)
from reproduction.section import Case, Result, Section, Table

name = "slips"

PLACES = {
    "cogiro": "CoGiRo, goal of Test 1",
    "large": "98 m robot of Table 7, goal",
}

MODEL_OF = {"half_plane": "SLSM", "sign_of_H": "SCMWE"}
"""Cable model by which a slip is looked at; the ECM for the others."""

NOTHING, SOME = 1e-3, 0.1
"""A change of the gain matrix below the first counts as none, one below the second as small."""


def cases() -> Sequence[Case]:
    """Return one case for each robot."""
    return [Case(key=key, function=look, arguments={"place": key}) for key in PLACES]


def look(place: str) -> Result:
    """Return what each slip does at one rest of one robot.

    Args:
        place: of `PLACES`.
    """
    robot, X_WP = _robot_at(place)
    rest = rest_state(robot, X_WP)
    model = rest_model(robot, rest)
    H = rest.tension_at_drawing_point * np.hypot(model.tangents[:, 0], model.tangents[:, 1])
    T = target_twist(robot, X_WP)

    def gains(cable_model: str, slip: str) -> Array:
        """Return Gamma (6, 6): twist had per twist asked for, of the target frame."""
        D = length_rates(robot, X_WP, H, cable_model, ORDER, slip)
        return np.asarray(np.linalg.solve(T, model.pose_per_length @ D @ T))

    effects = {}
    for slip in SLIPS:
        cable_model = MODEL_OF.get(slip, "ECM")
        right, wrong = gains(cable_model, ""), gains(cable_model, slip)
        effects[slip] = {
            "right": _rates(right),
            "wrong": _rates(wrong),
            "change": float(np.abs(wrong - right).max()),
        }
    return {"effects": effects, **_lengths(robot, X_WP, H), **_servo(robot, X_WP)}


def section(results: Mapping[str, Result]) -> Section:
    """Return the section on slips.

    Args:
        results: of all cases, by their keys.
    """
    return Section(
        name=name,
        title="Slips of the printed equations, and what they would do",
        text=(
            "Each slip is left in alone, in equations coded term by term as printed. For those in "
            "the law of eq. (19) the measure is the gain matrix at rest at a goal: twist had per "
            "twist asked for. Its eigenvalues are the rates of convergence over λ, 1 for an exact "
            "law; one below zero is an unstable loop. Whether a slip is the printer's or our "
            "copy's cannot be told. The paper's robot moved, so that its code does not have those "
            "without which it cannot.",
        ),
        tables=(_law_table(results), _other_table(results)),
    )


def _robot_at(place: str) -> tuple[CableRobot, RigidTransform]:
    if place == "large":
        return true_robot(assumed("table7")), GOAL
    test = paper_test(1)
    robot = test.carried_by(load_robot("cogiro"))
    return robot, test.poses(robot)[1]


def _rates(gamma: Array) -> list[float]:
    """Return the least and the largest real part of the eigenvalues."""
    values = np.linalg.eigvals(gamma).real
    return [float(values.min()), float(values.max())]


def _lengths(robot: CableRobot, X_WP: RigidTransform, H: Array) -> dict[str, Any]:
    """Return by how much cables miss B, or are too long, by eqs. (2) and (6) as printed [m]."""
    geometry = cable_geometry(robot, X_WP)
    Bx, Bz, w = geometry.Bx, geometry.Bz, robot.weight_per_metre
    EA = robot.cable.stiffness(float(np.mean(H)))
    mu = w / H
    end = profile(Bx, Bx, Bz, H, w)
    misses = []
    for reading in range(len(A_I_READINGS)):
        a = printed_a(Bx, Bz, mu, reading)
        z = (np.cosh(mu * Bx + a) - np.cosh(a)) / mu
        misses.append(float(np.abs(z - end).max()))
    right = unstrained_length("ECM", Bx, Bz, H, w, EA, ORDER)
    wrong = ecm(Bx, Bz, H, w, EA, ORDER, "k_p")[0]
    return {
        "misses": misses,
        "length_right": float(right.max()),
        "length_wrong": float(np.abs(wrong).max()),
        "wrong_half_plane": int((geometry.u[:, 0] < 0.0).sum()),
    }


def _servo(robot: CableRobot, X_WP: RigidTransform) -> dict[str, Any]:
    """Return what the other sign in L_s and the other meaning of r_c change, relatively."""
    error = pose_error(RigidTransform([1.0, -0.5, 0.3]), X_WP, robot.cameras.X_PM)
    error[:3] = [0.3, -0.4, 0.2]
    tau = servo_twist(error, 1.0)
    other = servo_twist_by_inversion(error, 1.0, 1.0)
    pairs = len(robot.cameras.stereo_pairs)
    return {
        "sign_of_L_s": float(np.abs(other - tau).max() / np.abs(tau).max()),
        "r_c": robot.winch.transmission / pairs,
        "pairs": pairs,
    }


def _verdict(effect: Mapping[str, Any]) -> str:
    if effect["wrong"][1] < SOME:
        return "does not move"
    if effect["wrong"][0] < 0.0:
        return "unstable"
    if effect["change"] < NOTHING:
        return "nothing"
    return "small" if effect["change"] < SOME else "coupled"


def _law_table(results: Mapping[str, Result]) -> Table:
    rows = []
    for slip, text in SLIPS.items():
        row: list[Any] = [text, MODEL_OF.get(slip, "ECM")]
        for place in PLACES:
            effect = results[place]["effects"][slip]
            low, high = effect["wrong"]
            row += [f"{low:.4g} to {high:.4g}", effect["change"], _verdict(effect)]
        rows.append(tuple(row))
    headings = [h for p in PLACES for h in (f"{p}: rates / λ", "change of Γ", "effect")]
    rights = [
        f"{p}: {results[p]['effects']['k_p']['right'][0]:.4f} to "
        f"{results[p]['effects']['k_p']['right'][1]:.4f}"
        for p in PLACES
    ]
    return Table(
        title="Slips in the law",
        headings=("slip", "model", *headings),
        rows=tuple(rows),
        note="; ".join(f"{key}: {text}" for key, text in PLACES.items())
        + f". Without slips the ECM's rates over λ are, {', '.join(rights)}. Change of Γ: its "
        "largest entry, in rad, m and s mixed.",
    )


def _other_table(results: Mapping[str, Result]) -> Table:
    rows: list[tuple[Any, ...]] = []
    for i, reading in enumerate(A_I_READINGS):
        rows.append(
            (
                f"(2) a_i, {reading}: the profile misses B by up to [m]",
                *(results[p]["misses"][i] for p in PLACES),
            )
        )
    one = results["cogiro"]
    rows += [
        ("(6) the longest cable [m]", *(results[p]["length_right"] for p in PLACES)),
        (
            "(6) k_p = (j-1)/2 for odd j: the longest is then [m]",
            *(results[p]["length_wrong"] for p in PLACES),
        ),
        (
            "(1) tan⁻¹(uy/ux): cables in the wrong half-plane",
            *(results[p]["wrong_half_plane"] for p in PLACES),
        ),
        (
            "(18) L_s with +θ/2 [u]×: relative change of the twist asked for",
            *(results[p]["sign_of_L_s"] for p in PLACES),
        ),
        (
            f"(14) r_c the number of stereo pairs ({one['pairs']}): motor rates times",
            *(results[p]["r_c"] for p in PLACES),
        ),
    ]
    return Table(title="Other slips", headings=("slip", *PLACES), rows=tuple(rows))
