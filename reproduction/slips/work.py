"""The work behind the section on slips: what each does at one rest of one robot."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake import CableRobot, load_robot
from cdpr_drake.analysis import target_twist
from cdpr_drake.model.cable_models import profile, unstrained_length
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.rest_model import rest_model
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.servo import pose_error, servo_twist
from cdpr_drake.runs import paper_test
from reproduction.assumptions import assumed
from reproduction.section import Result
from reproduction.slips.printed_equations import (
    A_I_READINGS,
    SLIPS,
    ecm,
    length_rates,
    printed_a,
    servo_twist_by_inversion,
)
from reproduction.table7.large_robot import GOAL, ORDER, true_robot

PLACES = ("cogiro", "large")
"""CoGiRo at the goal of Test 1, and the 98 m robot of Table 7 at its goal."""

MODEL_OF = {"half_plane": "SLSM", "sign_of_H": "SCMWE"}
"""Cable model by which a slip is looked at; the ECM for the others."""


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
