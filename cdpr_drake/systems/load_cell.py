"""Load cells in the winches, and the filter their noise makes necessary."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.common import RandomDistribution
from pydrake.systems.framework import LeafSystem_

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.vision.outages import LOAD_CELL, Outage, Outages
from cdpr_drake.systems._template import GAUSSIAN_INPUT, check_finite, system_template, value

SINES = 5
"""How many sines make up the cables' vibration."""


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

        A cell reads y = gain (T_W + v) + bias + sigma n; the reading, freed of the gain and bias
        that the controller believes, passes n_f first-order filters in series, dx/dt = 2 pi f_c
        (y - x) (section 4.2: the noise requires filtering). v is the cables' vibration, a few sines
        in the robot's band. All ports have size k, in N; noise is standard normal, ignored if the
        port is left open. State: [filter 1 (k); ...; filter n_f (k)].

        Args:
            robot: the true robot, for its load cells.
            calibrated: the robot as the controller believes it; the true one if None.
            outages: when cells are stuck, which stops their filters too, or dead.

        Raises:
            ValueError: an outage of a cell that is not there.
        """

        def _construct(
            self,
            robot: CableRobot,
            calibrated: CableRobot | None = None,
            outages: tuple[Outage, ...] = (),
            *,
            converter: Any = None,
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
            self.outages = tuple(outages)
            self._outages = Outages(self.outages, LOAD_CELL, k)
            self._amplitude = cells.vibration_amplitude / np.sqrt(SINES)
            self._frequencies, self._phases = _vibration(cells.vibration_band, k)
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
            args = (other.robot, other.calibrated, other.outages)
            Impl._construct(self, *args, converter=converter)

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
            if self._amplitude > 0.0:
                drive = drive + gain * self._vibration(_seconds(context))
            check_finite(value(drive), self, context, "inputs")
            if self._outages:
                self._fail(_seconds(context), drive, x)
            if self._order > 1:
                drive = np.concatenate([drive, self._rate * x[: -self._k]])
            derivatives.SetFromVector(drive - self._rate * x)

        def _vibration(self, time: float) -> np.ndarray:
            """Return the vibration (k,) [N] of the tensions."""
            return self._amplitude * np.sin(time * self._frequencies + self._phases).sum(axis=1)

        def _fail(self, time: float, drive: np.ndarray, x: np.ndarray) -> None:
            """Put what failing cells read into `drive` (k,); stuck ones keep what they show."""
            believed, k = self.calibrated.load_cells, self._k
            for cell, reading in self._outages.at(time).items():
                if reading is None:
                    x[cell::k] = x[cell - k]
                    drive[cell] = self._rate * x[cell]
                else:
                    y = (reading - believed.bias[cell]) / believed.gain[cell]
                    drive[cell] = self._rate * y

        def _calc_tension(self, context: Any, output: Any) -> None:
            output.SetFromVector(context.get_continuous_state_vector().CopyToVector()[-self._k :])

    return Impl


def _vibration(band: np.ndarray, num_cables: int) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (SINES,) [rad/s] and phases (k, SINES), always the same."""
    frequencies = 2.0 * np.pi * np.linspace(band[0], band[1], SINES)
    return frequencies, np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, (num_cables, SINES))


def _seconds(context: Any) -> float:
    return float(value(np.array([context.get_time()]))[0])


LoadCellFilter = LoadCellFilter_[None]
