"""Load cells in the winches, and the filter their noise makes necessary."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, ContinuousState, LeafSystem

from cdpr_drake.model.equilibrium import RestState
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.vision.outages import LOAD_CELL, Outage, Outages
from cdpr_drake.systems._template import (
    chain,
    check_finite,
    noise_input,
    numbered,
    scalar_convertible,
    seconds,
    value,
)

SINES = 5
"""How many sines make up the cables' vibration."""


@scalar_convertible
class LoadCellFilter(LeafSystem):
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
        believed: the robot as the controller believes it; the true one if None.
        outages: when cells are stuck, which stops their filters too, or dead.

    Attributes:
        parameters: (4, k), as kernels/load_cell.py takes them.
        eigenvalues: (k,) of the filters [1/s].

    Raises:
        ValueError: an outage of a cell that is not there.
    """

    def __init__(
        self,
        robot: CableRobot,
        believed: CableRobot | None = None,
        outages: tuple[Outage, ...] = (),
    ) -> None:
        super().__init__()
        self.robot = robot
        self.believed = believed if believed is not None else robot
        from cdpr_drake.model.kernels.load_cell import filter_derivatives

        cells, ours = robot.load_cells, self.believed.load_cells
        gain, sigma = cells.gain / ours.gain, cells.noise / ours.gain
        bias = (cells.bias - ours.bias) / ours.gain
        rate = np.full(robot.num_cables, 2.0 * np.pi * cells.cutoff)
        self._filter, self.parameters = filter_derivatives, np.array([gain, bias, sigma, rate])
        self.eigenvalues = -rate
        self._order = cells.order
        stages = [f"stage_{i + 1}" for i in range(cells.order - 1)]
        self.state_names = numbered(*stages, "tension", count=robot.num_cables)
        k = self._k = robot.num_cables
        self.outages = tuple(outages)
        self._outages = Outages(self.outages, LOAD_CELL, k)
        self._amplitude = cells.vibration_amplitude / np.sqrt(SINES)
        self._frequencies, self._phases = _vibration(cells.vibration_band, k)
        self._no_noise = np.zeros(k)
        state = self.DeclareContinuousState(self._order * k)
        self._tension_port = self.DeclareVectorInputPort("tension_at_winch", k)
        self._noise_port = noise_input(self, k)
        if self._order == 1:
            self.DeclareStateOutputPort("measured_tension", state)
        else:
            self.DeclareVectorOutputPort(
                "measured_tension", k, self._calc_tension, {self.xc_ticket()}
            )

    def set_at_rest(self, context: Context, rest: RestState) -> None:
        """Have all filters show what the cells read in a `rest`, in a `context`."""
        # At rest no eyelet's friction acts: winch and drawing point carry the same.
        context.SetContinuousState(
            np.tile(self.reading(rest.tension_at_drawing_point), self._order)
        )

    def residual_scale(self, context: Context) -> np.ndarray:
        """Return the filters' rate times their readings in a `context`."""
        x = np.abs(context.get_continuous_state_vector().CopyToVector())
        return self.parameters[3, 0] * np.maximum(1.0, x)

    def reading(self, tension_at_winch: np.ndarray) -> np.ndarray:
        """Return the noiseless reading (k,) [N] for tensions (k,) [N], as the filter gets it.

        Args:
            tension_at_winch: (k,) [N].
        """
        gain, bias, _, _ = self.parameters
        return gain * tension_at_winch + bias

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        """Write the derivatives of the state in a context."""
        x = context.get_continuous_state_vector().CopyToVector()
        tension, noise = self._tension_port.Eval(context), self._no_noise
        if self._noise_port.HasValue(context):
            noise = self._noise_port.Eval(context)
        if self._amplitude > 0.0:
            tension = tension + self._vibration(seconds(context))
        args, xdot = (x, tension, noise), np.empty(x.size)
        plain = map(value, args) if x.dtype.hasobject else args
        if not self._filter(*plain, self.parameters, xdot):
            check_finite(xdot, self, context, "derivatives")
        if x.dtype.hasobject:
            xdot = chain(xdot, self._jacobian(), *args)
        if self._outages:
            self._fail(seconds(context), x, xdot)
        derivatives.SetFromVector(xdot)

    def _jacobian(self) -> np.ndarray:
        """Return that of the derivatives by state, tension and noise: all is linear."""
        gain, _, sigma, rate = self.parameters
        k, n = self._k, self._k * self._order
        through = np.eye(n, n, -k) - np.eye(n)
        first = np.eye(n, k) * rate
        return np.hstack([rate[0] * through, first * gain, first * sigma])

    def _vibration(self, time: float) -> np.ndarray:
        """Return the vibration (k,) [N] of the tensions."""
        return self._amplitude * np.sin(time * self._frequencies + self._phases).sum(axis=1)

    def _fail(self, time: float, x: np.ndarray, xdot: np.ndarray) -> None:
        """Put what failing cells do into the derivatives; stuck ones keep what they show."""
        believed, k = self.believed.load_cells, self._k
        for cell, reading in self._outages.at(time).items():
            if reading is None:
                xdot[cell::k] = 0.0 * x[cell::k]
            else:
                y = (reading - believed.bias[cell]) / believed.gain[cell]
                xdot[cell] = self.parameters[3, cell] * (y - x[cell])

    def _calc_tension(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_continuous_state_vector().CopyToVector()[-self._k :])


def _vibration(band: np.ndarray, num_cables: int) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (SINES,) [rad/s] and phases (k, SINES), always the same."""
    frequencies = 2.0 * np.pi * np.linspace(band[0], band[1], SINES)
    return frequencies, np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, (num_cables, SINES))
