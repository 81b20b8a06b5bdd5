"""What the control law believes of the load cells."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.systems.framework import LeafSystem_

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.systems._template import chain, check_finite, system_template, value

LEAST = 0.5
"""Part of the cables' min_tension below which a reading is not believed [-]."""


@system_template("PlausibleTension")
def PlausibleTension_(T: type) -> type:
    class Impl(LeafSystem_[T]):
        """Readings of load cells, those of dead ones replaced.

        .. pydrake_system::

            name: PlausibleTension
            input_ports:
            - measured_tension
            output_ports:
            - plausible_tension

        A reading near zero would make the law take a taut cable for a slack one, which it moves by
        much more, and tear it. So readings below `LEAST` times the cables' min_tension become their
        max_tension, with which the law takes a cable for straight: this costs little (section 6.2).
        All other readings pass as they are. Both ports have size k, in N.

        Args:
            robot: the robot as the controller believes it.
        """

        def _construct(self, robot: CableRobot, *, converter: Any = None) -> None:
            super().__init__(converter=converter)
            self.robot = robot
            self._least = LEAST * robot.cable.min_tension
            self._straight = robot.cable.max_tension
            k = robot.num_cables
            self._port = self.DeclareVectorInputPort("measured_tension", k)
            self.DeclareVectorOutputPort("plausible_tension", k, self._calc, {self._port.ticket()})

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.robot, converter=converter)

        def _calc(self, context: Any, output: Any) -> None:
            tension = self._port.Eval(context)
            plain = value(tension)
            check_finite(plain, self, context, "inputs")
            dead = plain < self._least
            replaced = np.where(dead, self._straight, plain)
            if T is not float:
                replaced = chain(replaced, [np.diag(1.0 - dead)], tension)
            output.SetFromVector(replaced)

    return Impl


PlausibleTension = PlausibleTension_[None]
