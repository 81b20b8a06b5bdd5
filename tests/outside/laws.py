"""Control laws of one's own: LQR on the robot as it settles, which needs no model of cables.

The winches are fast and the platform settles within tenths of a second, so that the pose follows
the desired motor angles, dX/dt = S dq_d/dt, with the static gain S = -C A^-1 B of the robot's
linear model. The laws differ from eqs. (18) and (19): they have no cable model, take no tensions
and no tangents, and are linear about one goal.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.systems.controllers import (
    DiscreteTimeLinearQuadraticRegulator,
    LinearQuadraticRegulator,
)
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

import cdpr_drake as cdpr
from cdpr_drake.diagrams import make_cable_robot
from cdpr_drake.study import equilibrium, linearize
from cdpr_drake.systems import scalar_convertible

Array = NDArray[np.float64]


def settled_pose_per_angle(
    robot: cdpr.CableRobot, goal: ArrayLike, tensions: str = "minimum norm"
) -> Array:
    """Return S (6, k): how the pose settles when desired motor angles change, at a goal.

    Args:
        robot: the robot.
        goal: [roll, pitch, yaw, x, y, z] (rad, m).
        tensions: how they are distributed there.
    """
    diagram = make_cable_robot(robot)
    context = equilibrium(diagram, goal, tensions)
    model = linearize(diagram, context, ["desired_motor_angles"], ["pose"])
    return model.D - model.C @ np.linalg.solve(model.A, model.B)


def weights(S: Array, rate: float, effort: float = 1.0) -> tuple[Array, Array]:
    """Return Q, R with which the error decays at a rate [1/s], alike in all directions.

    Args:
        S: (6, k).
        rate: [1/s].
        effort: what R is, for each motor.
    """
    # With P = p (S S^T)^-1, K = p R^-1 S^T (S S^T)^-1 makes S K = (p / effort) 1.
    return effort * rate**2 * np.linalg.inv(S @ S.T), effort * np.eye(S.shape[1])


class PlainLqr(LeafSystem):
    """dq_d/dt = -K (measured pose - desired pose), for floats alone.

    Args:
        robot: as it is believed.
        goal: about which it is linearised.
        rate: at which the error decays [1/s].
        tensions: how they are distributed at the goal.
    """

    def __init__(
        self,
        robot: cdpr.CableRobot,
        goal: ArrayLike,
        rate: float = 0.4,
        tensions: str = "minimum norm",
    ) -> None:
        super().__init__()
        self.S = settled_pose_per_angle(robot, goal, tensions)
        self.gain, _ = LinearQuadraticRegulator(np.zeros((6, 6)), self.S, *weights(self.S, rate))
        self._pose = self.DeclareVectorInputPort("measured_pose", 6)
        self._desired = self.DeclareVectorInputPort("desired_pose", 6)
        self.DeclareVectorOutputPort("motor_rates", robot.num_cables, self._calc)

    def _calc(self, context: Context, output: BasicVector) -> None:
        error = self._pose.Eval(context) - self._desired.Eval(context)
        output.SetFromVector(-self.gain @ error)


Lqr = scalar_convertible(PlainLqr)
"""The same for floats and for derivatives."""


@scalar_convertible
class IntegralLqr(LeafSystem):
    """Discrete LQR on the pose error, its sum, and the rates that are still on their way.

    u[n] = -K [e; z; u[n-1]], z[n+1] = z[n] + T e. On a ramp it has no lag.

    Discrete state: [z (6); u[n-1] (k)].

    Args:
        robot: as it is believed.
        goal: about which it is linearised.
        sample_time: T [s] of the loop, whose latency is a frame at most.
        rate: at which the error decays, about [1/s].
        tensions: how they are distributed at the goal.
    """

    def __init__(
        self,
        robot: cdpr.CableRobot,
        goal: ArrayLike,
        sample_time: float = 0.05,
        rate: float = 0.4,
        tensions: str = "minimum norm",
    ) -> None:
        super().__init__()
        S = settled_pose_per_angle(robot, goal, tensions)
        k, T, one = robot.num_cables, sample_time, np.eye(6)
        A = np.zeros((12 + k, 12 + k))
        A[:6, :6], A[:6, 12:] = one, T * S
        A[6:12, :6], A[6:12, 6:12] = T * one, one
        B = np.vstack([np.zeros((12, k)), np.eye(k)])
        Qe, R = weights(S, rate)
        Q = np.zeros_like(A)
        Q[:6, :6], Q[6:12, 6:12] = Qe, 0.1 * rate**2 * Qe
        self.gain, _ = DiscreteTimeLinearQuadraticRegulator(A, B, Q, R)
        self._period = T
        self._pose = self.DeclareVectorInputPort("measured_pose", 6)
        self._desired = self.DeclareVectorInputPort("desired_pose", 6)
        self.DeclareDiscreteState(6 + k)
        self.DeclarePeriodicDiscreteUpdateEvent(sample_time, 0.0, self._update)
        self.DeclareVectorOutputPort("motor_rates", k, self._calc)
        self.discrete_state_names = tuple(
            [f"sum[{i + 1}]" for i in range(6)] + [f"last_rate[{i + 1}]" for i in range(k)]
        )

    def settle(self, context: Context) -> None:
        """Forget all: the sum is what it is without an error, and nothing is on its way."""
        context.SetDiscreteState(np.zeros(context.get_discrete_state_vector().size()))

    def _error(self, context: Context) -> Array:
        return self._pose.Eval(context) - self._desired.Eval(context)

    def _rates(self, context: Context) -> Array:
        memory = context.get_discrete_state_vector().CopyToVector()
        return -self.gain @ np.concatenate([self._error(context), memory])

    def _calc(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._rates(context))

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        memory = context.get_discrete_state_vector().CopyToVector()
        total = memory[:6] + self._period * self._error(context)
        discrete.set_value(np.concatenate([total, self._rates(context)]))


@scalar_convertible
class RestingIntegralLqr(IntegralLqr):
    """The same, but it answers set_at_rest instead."""

    settle = None

    def set_at_rest(self, context: Context, rest: object) -> None:
        """Forget all, without a look at the inputs."""
        context.SetDiscreteState(np.zeros(context.get_discrete_state_vector().size()))


class Predicting(LeafSystem):
    """LQR on where the platform will be when the rates change: it takes the age of the pose.

    e = measured - desired + age S u[n-1]. The state, the rates of the last frame, has a default
    of zeros and does not answer for itself: zeros are its rest.

    Args:
        robot: as it is believed.
        goal: about which it is linearised.
        sample_time: T [s] of the loop.
        rate: at which the error decays [1/s].
        tensions: how they are distributed at the goal.
    """

    def __init__(
        self,
        robot: cdpr.CableRobot,
        goal: ArrayLike,
        sample_time: float = 0.05,
        rate: float = 0.4,
        tensions: str = "minimum norm",
    ) -> None:
        super().__init__()
        self._S = settled_pose_per_angle(robot, goal, tensions)
        self.gain, _ = LinearQuadraticRegulator(np.zeros((6, 6)), self._S, *weights(self._S, rate))
        self._pose = self.DeclareVectorInputPort("measured_pose", 6)
        self._desired = self.DeclareVectorInputPort("desired_pose", 6)
        self._age = self.DeclareVectorInputPort("age", 1)
        self.DeclareDiscreteState(robot.num_cables)
        self.DeclarePeriodicDiscreteUpdateEvent(sample_time, 0.0, self._update)
        self.DeclareVectorOutputPort("motor_rates", robot.num_cables, self._calc)

    def _rates(self, context: Context) -> Array:
        error = self._pose.Eval(context) - self._desired.Eval(context)
        coming = self._S @ context.get_discrete_state_vector().CopyToVector()
        return -self.gain @ (error + self._age.Eval(context)[0] * coming)

    def _calc(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._rates(context))

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        discrete.set_value(self._rates(context))


LawMaker = Callable[[cdpr.CableRobot], LeafSystem]
