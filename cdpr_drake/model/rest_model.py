"""A robot at rest, linearised by hand: how wrench and tensions change with pose and lengths.

An independent way to the linear model of `make_cable_robot`, without Drake, fast enough for maps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cdpr_drake.model.cables import CableSet
from cdpr_drake.model.equilibrium import RestState
from cdpr_drake.model.kinematics import D_Bf, cable_geometry
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, pose_to_vector, rpy_rate_matrix, skew
from cdpr_drake.model.winch import WinchModel


@dataclass(frozen=True, kw_only=True, eq=False)
class RestModel:
    """First-order changes about a rest, with x = [rotation; translation] of the platform in W.

    Wrenches are [torque; force] at the platform's origin, in W; velocities are [omega; v].

    Attributes:
        robot: the robot.
        rest: where it rests.
        stiffness: (6, 6) dW/dx, cables and weight; negative definite where the rest is stable.
        damping: (6, 6) dW/d(velocity).
        wrench_per_length: (6, k) dW/dl [N, N m per m] of total unstrained lengths.
        wrench_per_rate: (6, k) dW/d(dl/dt).
        tension: (k, 12 + 2 k) change of the tensions at the drawing points [N] with [x; velocity;
            lengths; their rates].
        tangents: (k, 3) unit tangents at the drawing points, from A to B.
        dbeta: (k,) [rad] angle from chord to cable at the attachment points.
        mass: (6, 6) of platform and payload, at the platform's origin.
    """

    robot: CableRobot
    rest: RestState
    stiffness: Array
    damping: Array
    wrench_per_length: Array
    wrench_per_rate: Array
    tension: Array
    tangents: Array
    dbeta: Array
    mass: Array

    @property
    def pose_per_length(self) -> Array:
        """dx/dl (6, k) = -K^-1 dW/dl: how the platform settles when lengths change."""
        return -np.asarray(np.linalg.solve(self.stiffness, self.wrench_per_length), float)

    @property
    def motion(self) -> Array:
        """dx/dq (6, 6): a motion [rotation; translation] by [roll, pitch, yaw, x, y, z]."""
        E = np.eye(6)
        E[:3, :3] = rpy_rate_matrix(pose_to_vector(self.rest.X_WP)[:3])
        return E

    def locked(self) -> Array:
        """Return A (12, 12) of d[q; velocity]/dt with the winches locked: M dv/dt = K x + C v.

        q is [roll, pitch, yaw, x, y, z] (rad, m), the platform's coordinates in diagrams.
        """
        A, E = np.zeros((12, 12)), self.motion
        A[:6, 6:] = np.linalg.inv(E)
        A[6:] = np.linalg.solve(self.mass, np.hstack([self.stiffness @ E, self.damping]))
        return A

    def controlled(self) -> tuple[Array, Array]:
        """Return A (12 + 3 k, 12 + 3 k), B (12 + 3 k, k) with the winches under their PID.

        State: [q; velocity; motor angles; rates; integrals]; input: desired motor angles [rad].
        """
        k = self.robot.num_cables
        winch = self.robot.winch
        lengths = np.zeros((2 * k, 12 + 3 * k))  # lengths and rates from the state
        lengths[:, 12 : 12 + 2 * k] = winch.transmission * np.eye(2 * k)
        A = np.zeros((12 + 3 * k, 12 + 3 * k))
        A[:12, :12] = self.locked()
        push = np.hstack([self.wrench_per_length, self.wrench_per_rate])
        A[6:12] += np.linalg.solve(self.mass, push) @ lengths
        tension = self.tension[:, 12:] @ lengths
        tension[:, :6] += self.tension[:, :6] @ self.motion
        tension[:, 6:12] += self.tension[:, 6:12]
        jacobian = self._winch_jacobian()
        A[12:, 12:] = jacobian[:, : 3 * k]
        A[12:] += jacobian[:, 4 * k :] @ tension
        B = np.zeros((12 + 3 * k, k))
        B[12:] = jacobian[:, 3 * k : 4 * k]
        return A, B

    def _winch_jacobian(self) -> Array:
        """Return (3 k, 5 k): the winches' derivatives with [state; desired angles; tensions]."""
        k, winches = self.robot.num_cables, WinchModel(self.robot)
        T_A = self.rest.tension_at_drawing_point
        # The angle itself plays no part but in its difference to the desired one.
        state, desired = winches.at_rest(np.zeros(k), T_A)
        return winches.with_jacobian(state, desired, T_A)[1][: 3 * k]


def rest_model(robot: CableRobot, rest: RestState) -> RestModel:
    """Return the linear model of a robot about a rest.

    Args:
        robot: the robot.
        rest: from `rest_state` or `forward_kinematics`.

    Raises:
        EquilibriumError: a cable's catenary was not found.
    """
    k, X_WP = robot.num_cables, rest.X_WP
    _, stiffness, out, jacobian = CableSet(robot).balance(X_WP, rest.unstrained_length)
    motion = D_Bf(cable_geometry(robot, X_WP))
    to_wrench = motion.swapaxes(1, 2)
    diagonal = np.arange(k)
    tension = np.zeros((k, 12 + 2 * k))
    tension[:, :6] = np.einsum("kj,kjm->km", jacobian[:, 3, :3], motion)
    tension[:, 6:12] = np.einsum("kj,kjm->km", jacobian[:, 3, 3:6], motion)
    tension[diagonal, 12 + diagonal] = jacobian[:, 3, 6]
    tension[diagonal, 12 + k + diagonal] = jacobian[:, 3, 7]
    return RestModel(
        robot=robot,
        rest=rest,
        stiffness=stiffness,
        damping=np.einsum("kij,kjl,klm->im", to_wrench, jacobian[:, :3, 3:6], motion),
        wrench_per_length=np.einsum("kij,kj->ik", to_wrench, jacobian[:, :3, 6]),
        wrench_per_rate=np.einsum("kij,kj->ik", to_wrench, jacobian[:, :3, 7]),
        tension=tension,
        tangents=out[:, 5:8],
        dbeta=out[:, 11],
        mass=mass_matrix(robot, X_WP.rotation().matrix()),
    )


def mass_matrix(robot: CableRobot, R_WP: Array) -> Array:
    """Return (6, 6): momentum [angular; linear] at the platform's origin per [omega; v], in W.

    Args:
        robot: the robot, for mass, centre of mass and inertia of platform and payload.
        R_WP: (3, 3) orientation of the platform.
    """
    arm = skew(R_WP @ robot.center_of_mass)
    M = np.zeros((6, 6))
    M[:3, :3] = R_WP @ robot.inertia @ R_WP.T - robot.mass * arm @ arm
    M[:3, 3:], M[3:, :3] = robot.mass * arm, -robot.mass * arm
    M[3:, 3:] = robot.mass * np.eye(3)
    return M
