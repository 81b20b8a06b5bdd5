"""The elastic catenaries between winches and platform, as a stateless system."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import LeafSystem_, ValueProducer

from cdpr_drake.errors import CableError
from cdpr_drake.model.cables import CableSet
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.systems._template import chain, system_template, value


@system_template("CatenaryCableForce")
def CatenaryCableForce_(T: type) -> type:
    class Impl(LeafSystem_[T]):
        """Forces of k sagging elastic cables on the platform, with their tensions and tangents.

        .. pydrake_system::

            name: CatenaryCableForce
            input_ports:
            - platform_state
            - unstrained_length
            - unstrained_length_rate
            - external_wrench (optional)
            output_ports:
            - platform_wrench
            - tension_at_drawing_point
            - tension_at_attachment_point
            - tangents_at_drawing_point
            - tangents_at_attachment_point
            - dbeta

        Each cable is the exact elastic catenary (Irvine, Cable Structures, 1981) between its
        drawing point A and attachment point B, in series with the run from drum to eyelet, which
        stretches with it; both end tensions gain E A t_d (dL/dt - dl/dt) / l of structural damping.

        platform_state (12) is [roll, pitch, yaw, x, y, z, omega, v] of the platform in W, as the
        plant has it; unstrained_length (k) [m] includes the run; platform_wrench (6) is [torque;
        force] at the platform's origin in W, external_wrench (6, zero if left open) added;
        tangents (3 k) are unit vectors from A to B in W, cable after cable; dbeta (k) [rad] is the
        angle from chord to tangent at B (section 6.1).

        Args:
            robot: the robot.

        Raises:
            CableError: at evaluation, when a cable has no catenary or exceeds its breaking load.
        """

        def _construct(self, robot: CableRobot, *, converter: Any = None) -> None:
            super().__init__(converter=converter)
            self.robot = robot
            self._cables = CableSet(robot)
            k = robot.num_cables
            self._state_port = self.DeclareVectorInputPort("platform_state", 12)
            self._length_port = self.DeclareVectorInputPort("unstrained_length", k)
            self._rate_port = self.DeclareVectorInputPort("unstrained_length_rate", k)
            self._external_port = self.DeclareVectorInputPort("external_wrench", 6)
            inputs = {
                port.ticket() for port in (self._state_port, self._length_port, self._rate_port)
            }
            self._cache = self.DeclareCacheEntry(
                "cables",
                ValueProducer(allocate=lambda: AbstractValue.Make(()), calc=self._solve),
                inputs,
            )
            solved = self._cache.ticket()
            self.DeclareVectorOutputPort(
                "platform_wrench", 6, self._calc_wrench, {solved, self._external_port.ticket()}
            )
            for name, columns in _OUTPUTS.items():
                size = k * (columns.stop - columns.start)
                self.DeclareVectorOutputPort(name, size, self._output(columns), {solved})

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.robot, converter=converter)

        def _solve(self, context: Any, cached: Any) -> None:
            args = (
                self._state_port.Eval(context),
                self._length_port.Eval(context),
                self._rate_port.Eval(context),
            )
            if T is float:
                wrench, out, status = self._cables(*args)
                if status:
                    self._raise(context, args[1], out, status)
                cached.set_value((wrench, out))
                return
            values = [value(a) for a in args]
            k = self.robot.num_cables
            wrench, out, status, d_wrench, d_out = self._cables.with_jacobian(*values)
            if status:
                self._raise(context, values[1], out, status)
            split = [12, 12 + k]
            wrench = chain(wrench, np.split(d_wrench, split, axis=1), *args)
            flat = d_out.reshape(out.size, -1)
            out = chain(out.ravel(), np.split(flat, split, axis=1), *args).reshape(out.shape)
            cached.set_value((wrench, out))

        def _raise(self, context: Any, length: np.ndarray, out: np.ndarray, status: int) -> None:
            time = float(value(np.array([context.get_time()]))[0])
            cable = abs(status)
            if status > 0:
                what = f"no catenary of unstrained length {length[cable - 1]:.6g} m"
            else:
                limit, highest = self.robot.cable.breaking_load, out[cable - 1, 3:5].max()
                what = f"{highest:.0f} N is above the breaking load of {limit:.0f} N"
            raise CableError(cable, time, what)

        def _calc_wrench(self, context: Any, output: Any) -> None:
            wrench = self._cache.Eval(context)[0]
            if self._external_port.HasValue(context):
                wrench = wrench + self._external_port.Eval(context)
            output.SetFromVector(wrench)

        def _output(self, columns: slice) -> Any:
            def calc(context: Any, output: Any) -> None:
                output.SetFromVector(self._cache.Eval(context)[1][:, columns].ravel())

            return calc

    return Impl


_OUTPUTS = {
    "tension_at_drawing_point": slice(3, 4),
    "tension_at_attachment_point": slice(4, 5),
    "tangents_at_drawing_point": slice(5, 8),
    "tangents_at_attachment_point": slice(8, 11),
    "dbeta": slice(11, 12),
}

CatenaryCableForce = CatenaryCableForce_[None]
