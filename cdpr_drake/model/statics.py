"""The balance of the platform on sagging cables, and the choice of tensions (A.2).

The simplified static model of Gouttefarde et al. (ICRA 2012), behind the paper's appendix A.2: the
force applied to a cable at B is theta_B = H (x_A + tan(beta0) z) + (w L / 2) z: half of its weight
hangs on the platform. Wrenches are [torque; force] at the platform's origin.

Signs. A cable pulls the platform: everywhere else in the package a cable's force and wrench are
those on the platform (`CableSet`, `CatenaryCableForce`, `RestModel`). The appendix, and so this
module and the kernels of the law, balance the cables instead: u and theta_B point from A to B, the
wrench matrix holds the wrenches that the platform exerts on its cables, and W t = weight_wrench.
The pull of the cables on the platform is - W t.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.errors import GeometryError, TensionError
from cdpr_drake.model.distribution import RANK_TOLERANCE, bounded_distribution, feasibility_margin
from cdpr_drake.model.kinematics import D_AB, D_B, CableGeometry, D_Bf, D_u, cable_geometry
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, as_pose, numbers, skew

MINIMUM_NORM = "minimum norm"
DEFAULT_RULE = "minimum norm within limits"
CLOSEST = "within limits"
RULES = (DEFAULT_RULE, MINIMUM_NORM, CLOSEST)
"""How tensions are chosen among those that balance the platform: of least norm within the robot's
limits, which is continuous in the pose; of least norm whatever the limits, the paper's rule; within
the limits and closest to the robot's preferred tension, or else to their middle. A number says
which tension is preferred instead: "within limits, close to 120 N"."""

_CLOSE_TO = re.compile(rf"{CLOSEST}, close to (\d+(?:\.\d*)?) N")


def wrench_at(arm: Array, force: Array) -> Array:
    """Return (..., 6): the wrench [arm x force; force] at the platform's origin of a force.

    Args:
        arm: (..., 3) [m] from the platform's origin to where the force acts.
        force: (..., 3) [N], or one for all arms.
    """
    torque = np.cross(arm, force)
    return np.concatenate([torque, force if force.ndim == arm.ndim else 0.0 * arm + force], axis=-1)


def wrench_matrix(geometry: CableGeometry) -> Array:
    """Return (6, k): wrench [torque; force] on the cables per unit of chord tension, (EB x u; u).

    The platform feels the opposite: - wrench_matrix @ tensions.

    Args:
        geometry: the chords at a pose.
    """
    return wrench_at(geometry.EB, geometry.u).T


def D_theta(geometry: CableGeometry) -> Array:
    """Return (6, k): the wrench matrix per unit of horizontal tension, (EB x u; u) / cos(beta0).

    Args:
        geometry: the chords at a pose.
    """
    return wrench_matrix(geometry) * (geometry.L / geometry.Bx)


def check_rank(matrix: Array) -> None:
    """Raise GeometryError unless a wrench `matrix` (6, k) has rank 6: the law cannot do without."""
    singular = np.linalg.svd(matrix, compute_uv=False)
    if matrix.shape[1] < 6 or singular[-1] < RANK_TOLERANCE * singular[0]:
        raise GeometryError(
            f"the wrench matrix of the {matrix.shape[1]} cables has rank below 6 "
            f"(singular values {np.array2string(singular, precision=3)}): "
            "the platform's six degrees of freedom cannot all be controlled"
        )


def weight_wrench(robot: CableRobot, geometry: CableGeometry) -> Array:
    """Return (6,) [torque; force]: what the chord tensions must balance, weight of half cables off.

    The right-hand side of D_theta H = (EG x m g; m g) - sum (w L / 2) (EB x z; z).

    Args:
        robot: the robot.
        geometry: the chords at the pose; its frame is the result's.
    """
    weight = -robot.mass * robot.gravity * geometry.z
    EG = geometry.R_FP @ robot.center_of_mass
    half = 0.5 * robot.weight_per_metre * geometry.L[:, None] * geometry.z
    return wrench_at(EG, weight) - wrench_at(geometry.EB, half).sum(0)


def attachment_forces(robot: CableRobot, geometry: CableGeometry, H: ArrayLike) -> Array:
    """Return theta_B (k, 3) [N]: the force applied to each cable at B in the simplified model.

    Args:
        robot: the robot.
        geometry: the chords at a pose.
        H: (k,) [N] horizontal tensions.
    """
    chord = numbers(H) * geometry.L / geometry.Bx
    half_weight = 0.5 * robot.weight_per_metre * geometry.L
    return chord[:, None] * geometry.u + half_weight[:, None] * geometry.z


def D_tau(robot: CableRobot, geometry: CableGeometry, H: ArrayLike) -> Array:
    """Return (k, 6, 6): change of each cable's wrench [torque; force] with the twist, H held.

    Args:
        robot: the robot.
        geometry: the chords at a pose.
        H: (k,) [N] horizontal tensions.
    """
    H = numbers(H)
    Bx, Bz, L = geometry.Bx, geometry.Bz, geometry.L
    slope = np.stack([-Bz, 0.0 * Bx, Bx], -1)
    D_f = (H * Bz / (L * Bx**2))[:, None, None] * geometry.u[:, :, None] * slope[:, None, :]
    velocity = D_Bf(geometry)
    D_u1 = D_f @ D_B(geometry) + (H * L / Bx)[:, None, None] * D_u(geometry)
    stretch = np.einsum("ki,kij->kj", geometry.u, D_AB(geometry))
    D_urho = 0.5 * robot.weight_per_metre * geometry.z[None, :, None] * stretch[:, None, :]
    force = D_urho + D_u1
    D_EB = velocity.copy()
    D_EB[:, :, 3:] = 0.0
    torque = -skew(attachment_forces(robot, geometry, H)) @ D_EB + skew(geometry.EB) @ force
    return np.concatenate([torque, force], axis=1)


def D_ext(robot: CableRobot, geometry: CableGeometry) -> Array:
    """Return (6, 6): change of the weight's wrench [torque; force] with the twist [omega; v].

    Zero when the centre of mass is at the platform's origin, as the paper assumes.

    Args:
        robot: the robot.
        geometry: the chords at the pose.
    """
    EG = geometry.R_FP @ robot.center_of_mass
    D = np.zeros((6, 6)) + 0.0 * EG[0]
    D[:3, :3] = skew(-robot.mass * robot.gravity * geometry.z) @ skew(EG)
    return D


def D_s(
    robot: CableRobot, pose: RigidTransform | ArrayLike, H: ArrayLike, R_FW: ArrayLike | None = None
) -> Array:
    """Return (k, 6): rate of the horizontal tensions for a twist [omega; v] (eq. 12, A.2).

    The minimum-norm rates among those that keep the platform balanced.

    Args:
        robot: the robot.
        pose: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        H: (k,) [N] horizontal tensions.
        R_FW: (3, 3) rotation to the frame F of the twist; W itself if None.

    Raises:
        GeometryError: the wrench matrix has rank below 6.
    """
    X_WP = as_pose(pose)
    geometry = cable_geometry(robot, X_WP, R_FW)
    check_rank(wrench_matrix(geometry))
    change = D_tau(robot, geometry, H).sum(0) - D_ext(robot, geometry)
    return -np.linalg.lstsq(D_theta(geometry), change, rcond=None)[0]


def minimum_norm_horizontal_tensions(robot: CableRobot, pose: RigidTransform | ArrayLike) -> Array:
    """Return H (k,) [N]: the horizontal tensions of least norm that balance the weight (A.2).

    Args:
        robot: the robot; its nominal mass is the weight.
        pose: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).

    Raises:
        GeometryError: the wrench matrix has rank below 6.
        TensionError: some cable would have to push.
    """
    X_WP = as_pose(pose)
    geometry = cable_geometry(robot, X_WP)
    check_rank(wrench_matrix(geometry))
    return distribute(robot, D_theta(geometry), weight_wrench(robot, geometry), MINIMUM_NORM, X_WP)


def tension_distribution(
    robot: CableRobot, pose: RigidTransform | ArrayLike, rule: str = DEFAULT_RULE
) -> Array:
    """Return chord tensions T (k,) [N] that balance the weight at a pose in the simplified model.

    Args:
        robot: the robot.
        pose: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        rule: one of `RULES`.

    Raises:
        GeometryError: the wrench matrix has rank below 6.
        TensionError: no such tensions.
    """
    X_WP = as_pose(pose)
    geometry = cable_geometry(robot, X_WP)
    matrix = wrench_matrix(geometry)
    check_rank(matrix)
    return distribute(robot, matrix, weight_wrench(robot, geometry), rule, X_WP)


def distribute(
    robot: CableRobot, matrix: Array, wrench: Array, rule: str, X_WP: RigidTransform
) -> Array:
    """Return tensions (k,) [N] with matrix t = wrench, by a rule.

    Args:
        robot: the robot, for its limits.
        matrix: (6, k) wrench per unit of tension.
        wrench: (6,) to balance.
        rule: one of `RULES`.
        X_WP: the pose, for the message of an error.

    Raises:
        TensionError: no such tensions; says which rule failed, and what a linear programme knows.
        ValueError: an unknown rule.
    """
    check_rule(rule)
    low, high = robot.cable.limits
    least = np.asarray(np.linalg.lstsq(matrix, wrench, rcond=None)[0], float)
    if rule == MINIMUM_NORM:
        worst = int(np.argmin(least))
        if least[worst] <= 0.0:
            raise TensionError(
                f"minimum-norm tensions at {_describe(X_WP)} would need cable {worst + 1} to push "
                f"({least[worst]:.1f} N): {what_limits_allow(robot, matrix, wrench)}"
            )
        return least
    if rule == DEFAULT_RULE and np.all(least >= low) and np.all(least <= high):
        return least
    try:
        return bounded_distribution(matrix, wrench, low, high, preferred_tension(robot, rule))
    except TensionError:
        worst = int(np.argmax(np.maximum(low - least, least - high)))
        raise TensionError(
            f"at {_describe(X_WP)}: {what_limits_allow(robot, matrix, wrench)}; at least norm, "
            f"whatever the limits, cable {worst + 1} would bear {least[worst]:.1f} N"
        ) from None


def check_rule(rule: str) -> None:
    """Raise ValueError unless a `rule` is one of `RULES`, or says what tension is preferred."""
    if rule not in RULES and not _CLOSE_TO.fullmatch(rule):
        raise ValueError(
            f'unknown rule "{rule}"; known are {", ".join(RULES)}, and "{CLOSEST}, close to 120 N"'
        )


def preferred_tension(robot: CableRobot, rule: str) -> float:
    """Return the tension [N] that a rule within the limits stays close to.

    Args:
        robot: the robot, for its preferred tension and its limits.
        rule: one of `RULES`.
    """
    if rule == DEFAULT_RULE:
        return 0.0
    if found := _CLOSE_TO.fullmatch(rule):
        return float(found[1])
    own, limits = robot.cable.preferred_tension, robot.cable.limits
    return 0.5 * sum(limits) if own is None else own


def what_limits_allow(robot: CableRobot, matrix: Array, wrench: Array) -> str:
    """Return in words whether tensions within a robot's limits balance a wrench, and how well.

    A linear programme decides, see `feasibility_margin`.

    Args:
        robot: the robot, for its limits.
        matrix: (6, k) wrench per unit of tension.
        wrench: (6,) to balance.
    """
    low, high = robot.cable.limits
    margin = feasibility_margin(matrix, wrench, low, high).margin
    limits = f"the limits of {low:g} to {high:g} N"
    if margin >= 0.0:
        inside = f"tensions {margin:.3g} N inside {limits} hold it"
        return f'{inside}: the rule "{DEFAULT_RULE}" finds some'
    if margin == -np.inf:
        return "no tensions at all hold the weight there"
    return (
        f"the pose is outside the wrench-feasible workspace: {limits} would have to give way by "
        f"{-margin:.3g} N"
    )


def without_tension(cable: int) -> str:
    """Return in words that a rule leaves a `cable` (counting from 1) at a lower limit of zero."""
    return (
        f"the rule for tensions leaves cable {cable} at its lower limit of 0 N, where it has no "
        "length: cable.min_tension or cable.tension_margin above 0 keeps it taut"
    )


def _describe(X_WP: RigidTransform) -> str:
    x, y, z = X_WP.translation()
    angles = np.degrees(as_pose(X_WP).rotation().ToRollPitchYaw().vector())
    roll, pitch, yaw = np.round(angles, 1) + 0.0  # never "-0.0"
    return (
        f"(x, y, z) = ({x:.2f}, {y:.2f}, {z:.2f}) m, rpy = ({roll:.1f}, {pitch:.1f}, {yaw:.1f}) deg"
    )
