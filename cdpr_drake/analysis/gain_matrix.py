"""How the platform really moves when the controller asks for a twist: one matrix, no simulation.

Near the goal the law asks for tau = lambda s and moves the lengths by D^ tau; on its elastic cables
the platform then moves by (dx/dl) D^ tau = Gamma tau, and s' = -lambda Gamma s. With an exact model
Gamma is the identity. Its eigenvalues times lambda are the rates of convergence, and its
off-diagonal entries the coupling seen as overshoot: the eigenvalues are real, so the excursion is
coupling, not oscillation. It holds for motions slow beside the winches' integral action (Ki / Kp)
and the platform's vibration.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform

from cdpr_drake.errors import CdprError
from cdpr_drake.model.cable_models import cable_model_name
from cdpr_drake.model.camera import true_from_seen
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.kinematics import D_t
from cdpr_drake.model.load_cells import CellJudge
from cdpr_drake.model.rest_model import RestModel, rest_model
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import as_pose, pose_to_vector
from cdpr_drake.model.servo import MotorRateLaw, ServoSettings
from cdpr_drake.model.signals import TWIST
from cdpr_drake.model.statics import DEFAULT_RULE
from cdpr_drake.study.response import excursion, free_response
from cdpr_drake.study.state_space import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class GainMatrix:
    """The gain matrix at one pose.

    Attributes:
        matrix: Gamma (6, 6), twist [omega; v] (rad/s, m/s) of M in M had per twist asked for.
        pose: X_WP where the controller sees the platform.
        cable_model: the law's.
        rest: the robot's linear model at rest there.
        length_rates: D^ (k, 6) [m/rad, m/m], lengths per twist of M in M, as the law has it.
    """

    matrix: Array
    pose: RigidTransform
    cable_model: str
    rest: RestModel
    length_rates: Array

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Eigenvalues of Gamma (6,), slowest first; times lambda the rates of convergence."""
        values = np.linalg.eigvals(self.matrix).astype(complex)
        return values[np.argsort(values.real)]

    @property
    def coupling(self) -> Array:
        """Gamma without its diagonal (6, 6): motion had in directions not asked for."""
        return self.matrix - np.diag(np.diag(self.matrix))

    @property
    def is_stable(self) -> bool:
        """Whether every error decays for a small gain."""
        return bool(self.eigenvalues.real.min() > 0.0)

    def response(self, time: ArrayLike, error: ArrayLike, gain: float = 1.0) -> Array:
        """Return s(t) = expm(-gain Gamma t) s(0) (n, 6), the pose errors after a small one.

        Args:
            time: (n,) [s].
            error: s(0) = [s_w; s_t] (6,) [rad, m].
            gain: lambda [1/s].
        """
        return free_response(-gain * self.matrix, time, error)

    def excursion(self, error: ArrayLike) -> tuple[float, float]:
        """Return how far [m], and how much turned [rad], the way home leaves the straight line.

        The largest distance of the error from the segment between its start and zero, in position
        and in rotation. The same for every gain, which only sets the pace.

        Args:
            error: s(0) = [s_w; s_t] (6,) [rad, m].
        """
        pace = max(self.eigenvalues.real.min(), 0.05)
        s = self.response(np.linspace(0.0, 12.0 / pace, 601), error)
        return excursion(s)

    def __str__(self) -> str:
        lines = [f"Gamma of {self.cable_model}, had (rows) per asked for (columns), in M"]
        lines.append(" " * 9 + "".join(f"{name:>10}" for name in TWIST))
        for name, row in zip(TWIST, self.matrix, strict=True):
            lines.append(f"{name:>9}" + "".join(f"{v:10.4f}" for v in row))
        values = ", ".join(
            f"{v.real:.4f}" if abs(v.imag) < 1e-9 else f"{v:.4f}" for v in self.eigenvalues
        )
        lines.append("eigenvalues, the rates of convergence over lambda:")
        lines.append("  " + values)
        return "\n".join(lines)


def gain_matrix(
    robot: CableRobot,
    believed: CableRobot | None,
    pose: RigidTransform | ArrayLike,
    cable_model: str = "SCMWE",
    *,
    tensions: str = DEFAULT_RULE,
    settings: ServoSettings | None = None,
) -> GainMatrix:
    """Return Gamma = T^-1 (dx/dl) D^_a T^: twist had per twist asked for, of M in M.

    dx/dl = -K^-1 dW/dl is that of the true robot's elastic catenaries with their drum runs, K
    (6, 6) the platform's stiffness on them; D^_a the law's row (eqs. 11 to 14) with its own
    calibration and what its sensors tell it there; T and T^ (D_t of eq. 19) the true and believed
    target frame.

    Args:
        robot: the true robot.
        believed: the robot as the controller knows it; the true one if None.
        pose: X_WP where the controller sees the platform, or [roll, pitch, yaw, x, y, z] (rad, m).
        cable_model: the law's "ECM", "CMWE", "SCMWE" or "SLSM".
        tensions: one of `model.statics.RULES`.
        settings: the law's other settings (order, model_drum_run).

    Raises:
        GeometryError, TensionError, EquilibriumError: the robot cannot rest there.
        ValueError: an unknown cable model or rule.
    """
    return _Asker(robot, believed, cable_model, tensions, settings)(pose)


@dataclass(frozen=True, kw_only=True, eq=False)
class GainMap:
    """Gain matrices over the workspace; poses where the robot cannot rest hold NaN.

    Attributes:
        poses: (n, 6) [roll, pitch, yaw, x, y, z] (rad, m) as the controller sees them.
        matrices: (n, 6, 6).
        eigenvalues: (n, 6), slowest first.
        reasons: why there is no matrix, by the pose's index.
    """

    poses: Array
    matrices: Array
    eigenvalues: NDArray[np.complex128]
    reasons: dict[int, str]

    @property
    def slowest(self) -> Array:
        """Smallest real part of the eigenvalues (n,); below zero the loop is unstable."""
        return self.eigenvalues.real.min(axis=1)

    @property
    def coupling(self) -> Array:
        """Largest off-diagonal entry (n,), [rad/m, m/rad or neither], by size."""
        off = self.matrices * (1.0 - np.eye(6))
        return np.abs(off).max(axis=(1, 2))


def map_gain_matrix(
    robot: CableRobot,
    believed: CableRobot | None,
    poses: Iterable[RigidTransform | ArrayLike],
    cable_model: str = "SCMWE",
    *,
    tensions: str = DEFAULT_RULE,
    settings: ServoSettings | None = None,
) -> GainMap:
    """Return the gain matrices at many poses: which are slow, coupled, unstable.

    Args:
        robot: the true robot.
        believed: the robot as the controller knows it; the true one if None.
        poses: n of them, X_WP or [roll, pitch, yaw, x, y, z] (rad, m), as the controller sees them.
        cable_model: the law's "ECM", "CMWE", "SCMWE" or "SLSM".
        tensions: one of `model.statics.RULES`.
        settings: the law's other settings.

    Raises:
        ValueError: an unknown cable model or rule.
    """
    ask = _Asker(robot, believed, cable_model, tensions, settings)
    wanted = [as_pose(pose) for pose in poses]
    n = len(wanted)
    matrices = np.full((n, 6, 6), np.nan)
    values = np.full((n, 6), np.nan + 0j)
    reasons = {}
    for i, pose in enumerate(wanted):
        try:
            matrices[i] = ask.matrix(pose)[0]
        except CdprError as error:
            reasons[i] = str(error)
    good = [i for i in range(n) if i not in reasons]
    found = np.linalg.eigvals(matrices[good]) if good else np.zeros((0, 6))
    values[good] = np.take_along_axis(found, np.argsort(found.real, axis=1), axis=1)
    vectors = np.array([pose_to_vector(pose) for pose in wanted]).reshape(n, 6)
    return GainMap(poses=vectors, matrices=matrices, eigenvalues=values, reasons=reasons)


class _Asker:
    """What stays the same from pose to pose."""

    def __init__(
        self,
        robot: CableRobot,
        believed: CableRobot | None,
        cable_model: str,
        tensions: str,
        settings: ServoSettings | None,
    ) -> None:
        self.robot, self.tensions = robot, tensions
        self.believed = believed if believed is not None else robot
        fields = {**(vars(settings) if settings else {}), "cable_model": cable_model}
        self.law = MotorRateLaw(self.believed, ServoSettings(**fields))
        self.cable_model, self.judge = cable_model_name(cable_model), CellJudge(self.believed)

    def __call__(self, pose: RigidTransform | ArrayLike) -> GainMatrix:
        seen = as_pose(pose)
        matrix, model, rates = self.matrix(seen)
        return GainMatrix(
            matrix=matrix,
            pose=seen,
            cable_model=self.cable_model,
            rest=model,
            length_rates=rates,
        )

    def matrix(self, seen: RigidTransform) -> tuple[Array, RestModel, Array]:
        """Return Gamma (6, 6), the rest model and D^ (k, 6)."""
        true = true_from_seen(self.robot, self.believed, seen)
        model = rest_model(self.robot, rest_state(self.robot, true, self.tensions))
        D = self.length_rates(model, seen)
        moved = model.pose_per_length @ D
        return np.asarray(np.linalg.solve(target_twist(self.robot, true), moved)), model, D

    def length_rates(self, model: RestModel, seen: RigidTransform) -> Array:
        """Return D^ (k, 6): the law's length rates per twist of M in M, at rest at the goal."""
        cells, ours = self.robot.load_cells, self.believed.load_cells
        tension = model.rest.tension_at_drawing_point
        measured = (cells.gain * tension + cells.bias - ours.bias) / ours.gain
        vector = pose_to_vector(seen)
        # As the block "plausible_tension" does.
        measured = self.judge.plausible(vector, measured, self.judge.healthy)
        z = np.concatenate([vector, vector, np.zeros(6), measured, model.tangents.ravel()])
        k = self.robot.num_cables
        # The desired twist of E in W enters the law as it does the platform's: by D^_a.
        rates = self.law.with_jacobian(z, 1.0)[1][:k, 12:18]
        return self.robot.winch.transmission * rates @ target_twist(self.believed, seen)


def target_twist(robot: CableRobot, X_WP: RigidTransform) -> Array:
    """Return D_t (6, 6): twist [omega; v] of E, the platform's origin, in W per twist of M in M.

    Args:
        robot: the robot, for the target frame on its platform.
        X_WP: the pose.
    """
    X_PM = robot.cameras.X_PM
    R_WM = (X_WP @ X_PM).rotation().matrix()
    return D_t(R_WM, X_PM.rotation().matrix().T @ X_PM.translation())
