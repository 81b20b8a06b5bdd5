"""What the control law believes of the load cells."""

from __future__ import annotations

import math

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from cdpr_drake.model.load_cells import HANDOVER, CellJudge
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.systems._template import (
    chain,
    check_finite,
    finite_inputs,
    numbered,
    scalar_convertible,
    value,
)


@scalar_convertible
class PlausibleTension(LeafSystem):
    """Readings of load cells, those of dead and stuck ones replaced by what to expect.

    .. pydrake_system::

        name: PlausibleTension
        input_ports:
        - measured_pose
        - measured_tension
        output_ports:
        - plausible_tension
        - cell_health

    A reading near zero would make the law take a taut cable for a slack one, which it moves by
    much more, and tear it. So a low reading is compared with what the other cells and the known
    weight let expect at the measured pose, and goes over to it continuously as far as it falls
    short by more than noise and an unknown load explain; readings of light cables that are to
    be expected pass as they are. A cell whose reading stays the same while what is expected of
    it moves is stuck, and is replaced over half a second. `cdpr_drake.model.load_cells` has the
    rule, and says what fools it.

    measured_pose is [roll, pitch, yaw, x, y, z] (rad, m) of X_WP; measured_tension and
    plausible_tension (k) [N] are at the drawing points; cell_health (k) is 0 for a live cell, 1
    for a dead, 2 for a stuck one.

    State, if it samples, else none and no cell is found stuck: discrete, each cell's reading when
    it last changed [N], what was expected then [N], how far it is stuck (3 k). A linear model of
    the update is that of live cells, whose readings change: all is forgotten in a frame.

    Args:
        robot: the robot as the controller believes it.
        sample_time: period of the memory [s]; None for no memory.
    """

    def __init__(self, robot: CableRobot, sample_time: float | None = None) -> None:
        super().__init__()
        self.robot, self.sample_time = robot, sample_time
        self._judge = CellJudge(robot, HANDOVER if sample_time is None else sample_time)
        k = self._k = robot.num_cables
        self._pose_port = self.DeclareVectorInputPort("measured_pose", 6)
        self._tension_port = self.DeclareVectorInputPort("measured_tension", k)
        needed = {self._pose_port.ticket(), self._tension_port.ticket()}
        if sample_time is not None:
            self.DeclareDiscreteState(3 * k)
            groups = ("last_change", "expected_then", "stuck")
            self.discrete_state_names = numbered(*groups, count=k)
            self.DeclarePeriodicDiscreteUpdateEvent(sample_time, 0.0, self._update)
            needed.add(self.xd_ticket())
        self.DeclareVectorOutputPort("plausible_tension", k, self._calc, needed)
        self.DeclareVectorOutputPort("cell_health", k, self._calc_health, needed)

    def settle(self, context: Context) -> None:
        """Make the memory that of live cells which read, and are expected to, what they do.

        Args:
            context: the system's own, changed; its inputs are at rest.
        """
        if self.sample_time is None:
            return
        pose, reading, _ = self._plain(self._inputs(context), context)
        memory = np.repeat([math.inf, math.inf, 0.0], self._k)  # as if all had just changed
        self._judge.remember(pose, reading, memory, memory)
        context.SetDiscreteState(memory)

    def _inputs(self, context: Context) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return pose, readings and memory."""
        memory = self._judge.healthy
        if self.sample_time is not None:
            memory = context.get_discrete_state_vector().CopyToVector()
        return self._pose_port.Eval(context), self._tension_port.Eval(context), memory

    def _plain(self, parts: tuple[np.ndarray, ...], context: Context) -> list[np.ndarray]:
        """Return parts of the input as floats, known to be finite."""
        finite_inputs(self, context, *parts)
        return [value(part) for part in parts]

    def _calc(self, context: Context, output: BasicVector) -> None:
        parts = self._inputs(context)
        if parts[0].dtype.hasobject:
            output.SetFromVector(self._chained(parts, context, 0))
            return
        tension = self._judge.plausible(*parts)
        if not tension.dot(tension) < math.inf:
            self._plain(parts, context)
            check_finite(tension, self, context, "output plausible_tension")
        output.SetFromVector(tension)

    def _chained(self, parts: tuple[np.ndarray, ...], context: Context, row: int) -> np.ndarray:
        """Return one row of the judgement as AutoDiffXd."""
        k = self._k
        z = finite_inputs(self, context, *parts)
        judged, jacobian = self._judge.with_jacobian(np.delete(z, np.s_[6 + k : 6 + 3 * k]))
        return chain(judged[row], jacobian[row], *parts[:2], parts[2][2 * k :])

    def _calc_health(self, context: Context, output: BasicVector) -> None:
        plain = self._plain(self._inputs(context), context)
        output.SetFromVector(self._judge.health(*plain))

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        pose, reading = self._pose_port.Eval(context), self._tension_port.Eval(context)
        if not pose.dtype.hasobject:
            # Drake hands in the state as it is: it is changed in place.
            memory = discrete.get_mutable_value()
            self._judge.remember(pose, reading, memory, memory)
            if not memory.dot(memory) < math.inf:
                self._plain((pose, reading), context)
            return
        parts = self._inputs(context)
        pose, reading, memory = self._plain(parts, context)
        self._judge.remember(pose, reading, memory, memory)
        live = np.concatenate([parts[1], self._chained(parts, context, 1)])
        discrete.set_value(chain(memory, np.eye(memory.size, live.size), live))
