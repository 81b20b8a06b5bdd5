"""What a system may answer about itself, so that a diagram around it comes to rest and has names.

Rests, residuals, names and linear models ask the systems of a diagram, never what they are called.
A system, of this package or of a user, answers by having the method or attribute; all are optional.
Drake's own blocks answer through `diagrams.blocks`.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context

from cdpr_drake.model.equilibrium import RestState
from cdpr_drake.model.robot import CableRobot


class SystemAnswers(Protocol):
    """All that a system may answer. `context` is always its own.

    Attributes:
        state_names: what each of the continuous states is, e.g. "angle[1]".
        discrete_state_names: what each entry of the discrete state is, group after group.
        cable_robot: the robot whose cables this system is; it has an output port
            "tension_at_drawing_point". A diagram has one such system. If it also has ports
            "platform_state" and "unstrained_length", inputs or outputs, the integrator's step
            follows the robot's modes.
        eigenvalues: of what the system's state does by itself [1/s], besides the robot's modes: the
            integrator's step follows these too.
        never_rests: whether it is a source of noise, with which no loop has an equilibrium.
        steady_after: the time [s] after which it does the same whatever the time: ramps are over.
    """

    state_names: tuple[str, ...]
    discrete_state_names: tuple[str, ...]
    cable_robot: CableRobot
    eigenvalues: ArrayLike
    never_rests: bool
    steady_after: float

    def set_at_rest(self, context: Context, rest: RestState) -> None:
        """Put the state where it stays while the robot rests; no input is there yet to be read.

        Args:
            context: changed.
            rest: how the robot rests.
        """

    def settle(self, context: Context) -> None:
        """Put the state where it stays while the inputs are what they are now: samples, memories.

        It is called until nothing changes any more, after the robot has been set at rest.

        Args:
            context: changed.
        """

    def not_at_rest(self, context: Context) -> str:
        """Return why the system does not rest although it was set at rest, "" if it does.

        Args:
            context: with all of the diagram set at rest.
        """

    def unbalanced_wrench(self, context: Context) -> np.ndarray:
        """Return [torque; force] (6,) by which the platform is out of balance, at its origin in W.

        Args:
            context: the platform's.
        """

    def residual_scale(self, context: Context) -> np.ndarray:
        """Return the largest term (n,) in the equation of each continuous state.

        Args:
            context: at or near a rest.
        """

    def wrench_scale(self, context: Context) -> tuple[float, float]:
        """Return the largest torque [N m] and force [N] of any cable on the platform.

        Args:
            context: at or near a rest.
        """

    def transient(self, time: float) -> str:
        """Return what the system has at a time that it will not keep, in a few words; or "".

        Args:
            time: [s].
        """

    def motor_angles_at(self, X_WP: RigidTransform) -> np.ndarray:
        """Return the motor angles (k,) [rad] that the system asks for at a desired pose.

        A loop with such a system rests where the cables of these lengths hold the platform.

        Args:
            X_WP: the desired pose.
        """

    def true_pose(self, robot: CableRobot, seen: RigidTransform | ArrayLike) -> RigidTransform:
        """Return X_WP of the platform when the system measures it at the pose `seen`.

        Args:
            robot: the true robot.
            seen: the measured X_WP, or [roll, pitch, yaw, x, y, z] (rad, m).
        """
