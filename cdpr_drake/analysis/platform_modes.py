"""The modes of a robot on its cables at a pose, without a diagram."""

from __future__ import annotations

from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.rest_model import RestModel, rest_model
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.signals import POSE, TWIST
from cdpr_drake.model.statics import DEFAULT_RULE
from cdpr_drake.study.modes import Modes, modes_of


def platform_modes(
    robot: CableRobot,
    pose: RigidTransform | ArrayLike,
    winches: str = "locked",
    *,
    tensions: str = DEFAULT_RULE,
) -> Modes:
    """Return the modes of the platform on its cables at a rest.

    M dv/dt = K x + C v with the exact catenaries' stiffness K and damping C. With the winches under
    control their own modes are there too. States are called as `linearize` calls those of
    `make_cable_robot`.

    Args:
        robot: the robot, with its payload.
        pose: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        winches: "locked", or "controlled" by their PID at constant desired angles.
        tensions: one of `model.statics.RULES`.

    Raises:
        GeometryError, TensionError, EquilibriumError: the robot cannot rest there.
        ValueError: winches neither locked nor controlled; an unknown rule.
    """
    return rest_modes(rest_model(robot, rest_state(robot, pose, tensions)), winches)


def rest_modes(model: RestModel, winches: str = "locked") -> Modes:
    """Return the modes of the platform on its cables about a rest; see `platform_modes`.

    Args:
        model: the robot's linear model there.
        winches: "locked" or "controlled".

    Raises:
        ValueError: winches neither locked nor controlled.
    """
    if winches not in ("locked", "controlled"):
        raise ValueError(f'winches are "locked" or "controlled", not "{winches}"')
    names = tuple(f"platform/{part}" for part in POSE + TWIST)
    if winches == "locked":
        return modes_of(model.locked(), names)
    groups = ("angle", "rate", "integral")
    numbers = range(1, model.robot.num_cables + 1)
    return modes_of(
        model.controlled()[0],
        names + tuple(f"winches/{group}[{i}]" for group in groups for i in numbers),
    )
