"""What tests of the robot share: robots, poses, small motions and numerical differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from oracle import ORACLE
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.diagrams import JointSpaceLoop, VisionLoop
from cdpr_drake.errors import CdprError
from cdpr_drake.model.equilibrium import platform_balance, rest_state
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import exp_rotation


def swap_halves(x: np.ndarray) -> np.ndarray:
    """Return [b; a] for [a; b], halves of the last axis: (v, omega) from [omega; v] and back."""
    return np.concatenate([x[..., 3:], x[..., :3]], axis=-1)


def rotation(rotation_vector: object) -> RotationMatrix:
    """Return the rotation matrix of a rotation vector [rad]."""
    return RotationMatrix(exp_rotation(rotation_vector))


def oracle_robot(cogiro: CableRobot) -> CableRobot:
    """Return the robot of the oracle table's robot rows: older geometry, G at E, its own cable."""
    row = ORACLE["robot"]
    return cogiro.replace(
        drawing_points=row["A"],
        attachment_points=row["B"],
        gravity=row["gravity"],
        platform=cogiro.platform.replace(mass=row["mass"], center_of_mass=np.zeros(3)),
        payload=cogiro.payload.replace(center_of_mass=np.zeros(3)),
        cable=cogiro.cable.replace(
            linear_density=row["w"] / row["gravity"], stiffness=row["EA"], drum_run=0.0
        ),
    )


def random_pose(generator: np.random.Generator) -> RigidTransform:
    """Return a pose amid CoGiRo's frame, turned by up to 0.2 rad about each axis."""
    position = generator.uniform([-2.5, -1.5, 0.3], [2.5, 1.5, 2.5])
    return RigidTransform(rotation(generator.uniform(-0.2, 0.2, 3)), position)


def random_robot(cogiro: CableRobot, num_cables: int, seed: int) -> tuple[CableRobot, np.ndarray]:
    """Return a robot with its cables placed at random, and a pose where it rests stably.

    Drawn again until the tensions of least norm are between 50 N and a fifth of the breaking load
    and the stiffness is positive in all directions.
    """
    generator = np.random.default_rng([seed, num_cables])
    pose = np.array([0.02, -0.03, 0.05, 0.2, -0.1, 1.2])
    for _ in range(2000):
        around = 2.0 * np.pi * (np.arange(num_cables) + generator.uniform(-0.3, 0.3, num_cables))
        around /= num_cables
        height = generator.uniform(5.2, 5.6, num_cables)
        drawing = np.column_stack([7.0 * np.cos(around), 5.5 * np.sin(around), height])
        turn = around + generator.choice([-1.0, 1.0], num_cables) * generator.uniform(
            0.6, 1.4, num_cables
        )
        attachment = np.column_stack(
            [0.6 * np.cos(turn), 0.6 * np.sin(turn), generator.choice([0.0, 1.0], num_cables)]
        )
        cable = cogiro.cable.replace(drum_run=generator.uniform(2.0, 6.0, num_cables))
        robot = cogiro.replace(
            name=f"random-{num_cables}",
            drawing_points=drawing,
            attachment_points=attachment,
            cable=cable,
            winch=cogiro.winch.replace(encoder_zero_length=generator.uniform(0, 1, num_cables)),
            load_cells=cogiro.load_cells.replace(
                bias=np.zeros(num_cables), gain=np.ones(num_cables)
            ),
        )
        try:
            rest = rest_state(robot, pose)
        except CdprError:
            continue
        stiffness = platform_balance(robot, rest.X_WP, rest.unstrained_length)[1]
        lowest = np.linalg.eigvalsh(-0.5 * (stiffness + stiffness.T)).min()
        T = rest.chord_tension
        if lowest > 50.0 and T.min() > 50.0 and T.max() < 0.2 * cable.breaking_load:
            return robot, pose
    raise AssertionError(f"no robot of {num_cables} cables was found")


def moved(
    X: RigidTransform, twist: np.ndarray, t: float, R_FW: np.ndarray | None = None
) -> RigidTransform:
    """Return X_WP after a time t at a constant twist [omega; v] of P, given in F (W if None)."""
    R_WF = np.eye(3) if R_FW is None else R_FW.T
    turn = rotation(t * (R_WF @ twist[:3]))
    return RigidTransform(turn @ X.rotation(), X.translation() + t * (R_WF @ twist[3:]))


def derivative(f: Callable[[float], np.ndarray], step: float = 1e-3) -> np.ndarray:
    """Return df/dt at 0 by the central difference of fourth order."""
    near, far = f(step) - f(-step), f(2.0 * step) - f(-2.0 * step)
    return (8.0 * near - far) / (12.0 * step)


def jacobian(
    f: Callable[[np.ndarray], np.ndarray], x: np.ndarray, step: float = 1e-4
) -> np.ndarray:
    """Return df/dx (m, n) by central differences of fourth order, steps relative to |x| above 1."""
    columns = []
    for j, size in enumerate(np.maximum(np.abs(x), 1.0)):
        unit = np.zeros(x.size)
        unit[j] = size

        def along(t: float, unit: np.ndarray = unit) -> np.ndarray:
            return f(x + t * unit)

        columns.append(derivative(along, step) / size)
    return np.array(columns).T


def relative_error(got: np.ndarray, expected: np.ndarray) -> float:
    """Return the largest difference over the largest entry of what is expected."""
    got, expected = np.asarray(got, float), np.asarray(expected, float)
    assert got.shape == expected.shape, f"shape {got.shape}, expected {expected.shape}"
    return float(np.max(np.abs(got - expected)) / np.max(np.abs(expected)))


LOOPS = {"VBC": VisionLoop(), "JSC": JointSpaceLoop()}
"""The paper's controllers."""
