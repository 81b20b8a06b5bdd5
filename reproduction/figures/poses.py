"""What holds at the poses of all the paper's tests, whichever of them a figure is of."""

from __future__ import annotations

import functools

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake import CableRobot, load_robot
from cdpr_drake.analysis import gain_matrix
from cdpr_drake.model.cable_models import CABLE_MODELS, cable_angles
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.rotations import Array
from cdpr_drake.runs import NUMBERS, paper_test
from reproduction.null_models import share

PAYLOADS = (0.0, 110.0)
"""Of the tests [kg]."""


def share_of_rates(tolerance: float) -> float:
    """Return how often all rates of convergence are the gain, whatever that is, to a tolerance.

    Of starts and goals of all tests, with each of the four cable models.

    Args:
        tolerance: as a part of the gain.
    """
    robots = [(robot, X) for payload in PAYLOADS for robot, X in _places(payload)]
    return share(
        bool(np.abs(gain_matrix(robot, None, X, model).eigenvalues - 1.0).max() < tolerance)
        for robot, X in robots
        for model in CABLE_MODELS
    )


def share_of_sag(low: float, high: float) -> float:
    """Return how often dbeta of all cables is between two angles, at starts and goals of all tests.

    Args:
        low: [deg].
        high: [deg].
    """
    every = [dbeta for payload in PAYLOADS for _, dbeta in _rests(payload)]
    return share(low < dbeta.min() and dbeta.max() < high for dbeta in every)


def share_less_tensed() -> float:
    """Return how often cables bear less on mean without the payload, at starts and goals."""
    without, loaded = ([tension.mean() for tension, _ in _rests(p)] for p in PAYLOADS)
    return share(a < b for a, b in zip(without, loaded, strict=True))


def _places(payload: float) -> list[tuple[CableRobot, RigidTransform]]:
    robot = load_robot("cogiro").with_payload(payload)
    return [(robot, X) for number in NUMBERS for X in paper_test(number).poses(robot)]


@functools.cache
def _rests(payload: float) -> list[tuple[Array, Array]]:
    """Return tensions at the drawing points [N] and dbeta [deg] of the SCMWE at each place."""
    found = []
    for robot, X in _places(payload):
        rest, geometry = rest_state(robot, X), cable_geometry(robot, X)
        H = rest.chord_tension * geometry.Bx / geometry.L
        ends = cable_angles(geometry.Bx, geometry.Bz, H, robot.weight_per_metre, "SCMWE")
        found.append((rest.tension_at_drawing_point, np.degrees(ends.dbeta)))
    return found
