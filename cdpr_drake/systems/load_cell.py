"""Load cells in the winches, and the filter their noise makes necessary."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.common import RandomDistribution
from pydrake.systems.framework import LeafSystem_

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.systems._template import GAUSSIAN_INPUT, check_finite, system_template, value


@system_template("LoadCellFilter")
def LoadCellFilter_(T: type) -> type:
    class Impl(LeafSystem_[T]):
        """Cable tensions as k filtered load cells report them.

        .. pydrake_system::

            name: LoadCellFilter
            input_ports:
            - tension_at_winch
            - noise (optional)
            output_ports:
            - measured_tension

        A cell reads y = gain T_W + bias + sigma n; the reading, freed of the gain and bias that the
        controller believes, passes n_f first-order filters in series, dx/dt = 2 pi f_c (y - x)
        (section 4.2: the noise requires filtering). All ports have size k, in N; noise is standard
        normal, ignored if the port is left open. State: [filter 1 (k); ...; filter n_f (k)].

        Args:
            robot: the true robot, for its load cells.
            calibrated: the robot as the controller believes it; the true one if None.
        """

        def _construct(
            self, robot: CableRobot, calibrated: CableRobot | None = None, *, converter: Any = None
        ) -> None:
            super().__init__(converter=converter)
            self.robot = robot
            self.calibrated = calibrated if calibrated is not None else robot
            cells, believed = robot.load_cells, self.calibrated.load_cells
            self._gain = cells.gain / believed.gain
            self._bias = (cells.bias - believed.bias) / believed.gain
            self._sigma = cells.noise / believed.gain
            self._rate = 2.0 * np.pi * cells.cutoff
            self._drive = self._rate * self._gain, self._rate * self._bias, self._rate * self._sigma
            self._order = cells.order
            k = self._k = robot.num_cables
            state = self.DeclareContinuousState(self._order * k)
            self._tension_port = self.DeclareVectorInputPort("tension_at_winch", k)
            self._noise_port = self.DeclareVectorInputPort(
                GAUSSIAN_INPUT, k, RandomDistribution.kGaussian
            )
            if self._order == 1:
                self.DeclareStateOutputPort("measured_tension", state)
            else:
                self.DeclareVectorOutputPort(
                    "measured_tension", k, self._calc_tension, {self.xc_ticket()}
                )

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.robot, other.calibrated, converter=converter)

        def reading(self, tension_at_winch: np.ndarray) -> np.ndarray:
            """Return the noiseless reading (k,) [N] for tensions (k,) [N], as the filter gets it.

            Args:
                tension_at_winch: (k,) [N].
            """
            return self._gain * tension_at_winch + self._bias

        def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
            """Write the derivatives of the state in a context."""
            x = context.get_continuous_state_vector().CopyToVector()
            gain, bias, sigma = self._drive
            drive = gain * self._tension_port.Eval(context) + bias
            if self._noise_port.HasValue(context):
                drive += sigma * self._noise_port.Eval(context)
            check_finite(value(drive), self, context, "inputs")
            if self._order > 1:
                drive = np.concatenate([drive, self._rate * x[: -self._k]])
            derivatives.SetFromVector(drive - self._rate * x)

        def _calc_tension(self, context: Any, output: Any) -> None:
            output.SetFromVector(context.get_continuous_state_vector().CopyToVector()[-self._k :])

    return Impl


LoadCellFilter = LoadCellFilter_[None]
