"""The elastic catenaries between winches and platform, as a stateless system."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from cdpr_drake.errors import CableError
from cdpr_drake.model.cables import CableSet, no_catenary, packed_sizes
from cdpr_drake.model.digits import significant
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import vector_to_pose
from cdpr_drake.model.statics import wrench_matrix
from cdpr_drake.systems._template import (
    chain,
    check_finite,
    part_of_port,
    scalar_convertible,
    seconds,
    value,
)


@scalar_convertible
class CatenaryCableForce(LeafSystem):
    """Forces of k sagging elastic cables on the platform, with their tensions and tangents.

    .. pydrake_system::

        name: CatenaryCableForce
        input_ports:
        - platform_state
        - unstrained_length
        - unstrained_length_rate
        output_ports:
        - platform_wrench
        - tension_at_drawing_point
        - tension_at_attachment_point
        - tangents_at_drawing_point
        - tangents_at_attachment_point
        - dbeta
        - packed

    Each cable is the exact elastic catenary (Irvine, Cable Structures, 1981) between its
    drawing point A and attachment point B, in series with the run from the drum, which stretches
    with it. Where a cable leaves over a pulley, A is where it does, on a pulley that swivels
    after it, and the arc round the pulley stretches as the run does. Structural damping resists
    the rate s at which a cable stretches, as its tension at rest has it, not its gain of chord,
    which may be loss of sag:

        s = e_B . v_B + e_l dl/dt,   T_d = (E A t_d / l) s,
        force on the platform - e_B T_d,   T_A - e_l T_d,

    with the gradient e of the stretch (kernels/catenary.py), so that it takes out the power
    T_d s >= 0. Where T_A, or T_B along the tangent, would become negative, T_d is held at what
    makes it zero: no cable pushes. Slack cables are hardly damped.

    platform_state (12) is [roll, pitch, yaw, x, y, z, omega, v] of the platform in W, as the
    plant has it; unstrained_length (k) [m] includes the run; platform_wrench (6) is [torque;
    force] at the platform's origin in W; tangents (3 k) are unit vectors from A to B in W,
    cable after cable; dbeta (k) [rad] is the angle from chord to tangent at B (section 6.1);
    packed (6 + 9 k) holds all of these one after another: all ports share its one solution
    per state, and a Demultiplexer splits it fast.

    Args:
        robot: the robot.

    Raises:
        CableError: at evaluation, when a cable has no catenary or exceeds its breaking load.
    """

    def __init__(self, robot: CableRobot) -> None:
        super().__init__()
        self.robot = self.cable_robot = robot
        self._cables = CableSet(robot)
        k = robot.num_cables
        self._state_port = self.DeclareVectorInputPort("platform_state", 12)
        self._length_port = self.DeclareVectorInputPort("unstrained_length", k)
        self._rate_port = self.DeclareVectorInputPort("unstrained_length_rate", k)
        sizes = packed_sizes(k)
        self._packed_port = self.DeclareVectorOutputPort(
            "packed", sum(sizes.values()), self._solve, {self.all_input_ports_ticket()}
        )
        start = 0
        for name, size in sizes.items():
            part = part_of_port(self._packed_port, slice(start, start + size))
            self.DeclareVectorOutputPort(name, size, part, {self.all_input_ports_ticket()})
            start += size

    def wrench_scale(self, context: Context) -> tuple[float, float]:
        """Return the largest torque [N m] and force [N] of any cable in a `context`."""
        X_WP = vector_to_pose(self._state_port.Eval(context)[:6])
        start = 6 + self.robot.num_cables
        pull = np.abs(self._packed_port.Eval(context)[start : start + self.robot.num_cables])
        arms = np.linalg.norm(wrench_matrix(cable_geometry(self.robot, X_WP))[:3], axis=0)
        return float(np.max(pull * arms)), float(np.max(pull))

    def _solve(self, context: Context, output: BasicVector) -> None:
        args = (
            self._state_port.Eval(context),
            self._length_port.Eval(context),
            self._rate_port.Eval(context),
        )
        jacobian = None
        if not args[0].dtype.hasobject:
            packed, status = self._cables(*args)
        else:
            packed, status, jacobian = self._cables.with_jacobian(*map(value, args))
        if status:
            check_finite(value(args[0]), self, context, "input platform_state")
            state, length = value(args[0]), value(args[1])
            raise_cable_error(self.robot, context, state, length, packed, status)
        output.SetFromVector(packed if jacobian is None else chain(packed, jacobian, *args))


def raise_cable_error(
    robot: CableRobot,
    context: Context,
    state: np.ndarray,
    length: np.ndarray,
    packed: np.ndarray,
    status: int,
) -> None:
    """Raise what a status of `CableSet` that is not 0 means.

    Args:
        robot: the robot.
        context: of the system that solved for the cables, for the time.
        state: (12,) or more, the platform's first.
        length: (k,) total unstrained lengths [m].
        packed: as `CableSet` gives it.
        status: likewise.

    Raises:
        CableError: always.
    """
    time = seconds(context)
    cable, k = abs(status), robot.num_cables
    if status > 0:
        raise no_catenary(robot, cable, vector_to_pose(state[:6]), length[cable - 1], time)
    highest = packed[5 + cable : 6 + 2 * k : k].max()
    limit = robot.cable.breaking_load
    raise CableError(
        cable,
        time,
        f"{significant(highest)} N is above the breaking load of {significant(limit)} N",
    )
