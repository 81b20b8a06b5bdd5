"""Robot, load cells and integrator in one system, for simulations that want speed."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, ContinuousState, LeafSystem, OutputPort

from cdpr_drake.model.cables import CableSet, packed_sizes
from cdpr_drake.model.equilibrium import RestState
from cdpr_drake.model.rest_model import mass_matrix
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, pose_to_vector, vector_to_pose
from cdpr_drake.model.winch import WinchModel
from cdpr_drake.systems._template import Calc, check_finite, noise_input, part_of_port
from cdpr_drake.systems.cable_force import raise_cable_error
from cdpr_drake.systems.load_cell import LoadCellFilter


class FusedPlant(LeafSystem):
    """Platform, cables, winches, load cells and integrator with one compiled derivative.

    .. pydrake_system::

        name: FusedPlant
        input_ports:
        - motor_rates
        - external_wrench (optional)
        - noise (optional)
        output_ports:
        - state
        - packed
        - pose
        - platform_state
        - motor_angles
        - motor_rates
        - measured_tension
        - desired_motor_angles
        - platform_wrench
        - tension_at_drawing_point
        - tension_at_attachment_point
        - tangents_at_drawing_point
        - tangents_at_attachment_point
        - dbeta
        - unstrained_length
        - motor_torques
        - tension_at_winch

    The same equations as `make_cable_robot`, `LoadCellFilter` and `MotorAngleIntegrator` wired
    together, by the same kernels (kernels/plant.py): the framework is passed through once for a
    derivative, not ten times. Ports are as there, packed as in `CatenaryCableForce`; noise (k) is
    the load cells'. State, and the port of that name: [platform (12); motor angles (k); rates (k);
    integrals (k); filters (n_f k); desired angles (k)]. For floats only: to linearise, take the
    blocks.

    Args:
        robot: the true robot; its load cells do not vibrate.
        calibrated: the robot as the controller believes it; the true one if None.

    Attributes:
        numbers: what kernels/plant.py takes of the robot.

    Raises:
        ValueError: the robot's load cells vibrate.
        CableError, SimulationError: at evaluation, as the blocks raise them.
    """

    def __init__(self, robot: CableRobot, calibrated: CableRobot | None = None) -> None:
        from cdpr_drake.model.kernels import plant as kernel

        super().__init__()
        if robot.load_cells.vibration_amplitude > 0.0:
            raise ValueError("load cells that vibrate need the blocks: fused=False")
        self.robot = robot
        self._kernel = kernel
        self._cables, self._winch = CableSet(robot), WinchModel(robot)
        self._cells = LoadCellFilter(robot, calibrated)
        k = self._k = robot.num_cables
        zero = robot.winch.encoder_zero_length
        self.numbers = (
            *self._cables.numbers,
            self._cables.arrays.solid,
            self._winch.parameters,
            np.vstack([self._cells.parameters, zero]),
        )
        self._size = 12 + (4 + robot.load_cells.order) * k
        self._no_noise, self._no_wrench = np.zeros(k), np.zeros(6)
        state = self.DeclareContinuousState(self._size)
        self._rates_port = self.DeclareVectorInputPort("motor_rates", k)
        self._wrench_port = self.DeclareVectorInputPort("external_wrench", 6)
        self._noise_port = noise_input(self, k)
        self._state_port = self.DeclareStateOutputPort("state", state)
        self._packed_port = self._declare("packed", sum(packed_sizes(k).values()), self._solve)
        self._declare_outputs()
        self.cable_robot = robot

    def set_at_rest(self, context: Context, rest: RestState) -> None:
        """Put all of the plant where it rests in a `rest`, in a `context`."""
        tension, k = rest.tension_at_drawing_point, self._k
        y = np.zeros(self._size)
        y[:6] = pose_to_vector(rest.X_WP)
        y[12 : 12 + 3 * k] = self._winch.at_rest(rest.motor_angles, tension)[0]
        y[12 + 3 * k : -k] = np.tile(self.reading(tension), self.robot.load_cells.order)
        y[-k:] = rest.desired_motor_angles
        context.SetContinuousState(y)

    def unbalanced_wrench(self, context: Context) -> Array:
        """Return [torque; force] (6,) that the platform is out of balance by in a `context`."""
        rate = self.EvalTimeDerivatives(context).CopyToVector()[6:12]
        X_WP = vector_to_pose(self._state_port.Eval(context)[:6])
        unbalanced: Array = mass_matrix(self.robot, X_WP.rotation().matrix()) @ rate
        return unbalanced

    def reading(self, tension_at_winch: Array) -> Array:
        """Return what the load cells read without noise (k,) [N].

        Args:
            tension_at_winch: (k,) [N].
        """
        return self._cells.reading(tension_at_winch)

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        """Write the derivatives of the state in a context."""
        noise, wrench = self._no_noise, self._no_wrench
        if self._noise_port.HasValue(context):
            noise = self._noise_port.Eval(context)
        if self._wrench_port.HasValue(context):
            wrench = self._wrench_port.Eval(context)
        rates = self._rates_port.Eval(context)
        ydot = np.empty(self._size)
        status = self._kernel.plant_derivatives(
            self._state_port.Eval(context), rates, noise, wrench, *self.numbers, ydot
        )
        if status:
            self._packed_port.Eval(context)  # raises where a cable is at fault
            check_finite(np.concatenate([rates, noise, wrench]), self, context, "inputs")
            check_finite(ydot, self, context, "derivatives")
        derivatives.SetFromVector(ydot)

    def _declare(self, name: str, size: int, calc: Calc) -> OutputPort:
        return self.DeclareVectorOutputPort(name, size, calc, {self.xc_ticket()})

    def _declare_outputs(self) -> None:
        k, y = self._k, self._state_port

        parts = {"pose": slice(0, 6), "platform_state": slice(0, 12)}
        parts["motor_angles"] = slice(12, 12 + k)
        parts["motor_rates"] = slice(12 + k, 12 + 2 * k)
        parts["measured_tension"] = slice(self._size - 2 * k, self._size - k)
        parts["desired_motor_angles"] = slice(self._size - k, self._size)
        for name, part in parts.items():
            self._declare(name, part.stop - part.start, part_of_port(y, part))
        start = 0
        for name, size in packed_sizes(k).items():
            self._declare(name, size, part_of_port(self._packed_port, slice(start, start + size)))
            start += size
        self._declare("unstrained_length", k, self._calc_length)
        self._declare("motor_torques", k, self._calc_torque)
        self._declare("tension_at_winch", k, self._calc_tension)

    def _solve(self, context: Context, output: BasicVector) -> None:
        y = self._state_port.Eval(context)
        length, rate = self._motion(y)
        packed, status = self._cables(y[:12], length, rate)
        if status:
            check_finite(y, self, context, "state")
            raise_cable_error(self.robot, context, length, packed, status)
        output.SetFromVector(packed)

    def _motion(self, y: Array) -> tuple[Array, Array]:
        """Return unstrained lengths (k,) [m] and their rates (k,) [m/s]."""
        winch, k = self.robot.winch, self._k
        length = winch.encoder_zero_length + winch.transmission * y[12 : 12 + k]
        return length, winch.transmission * y[12 + k : 12 + 2 * k]

    def _winches(self, context: Context) -> Array:
        """Return [derivative (3 k); torques (k); tensions at the winches (k)]."""
        y, k = self._state_port.Eval(context), self._k
        T_A = self._packed_port.Eval(context)[6 : 6 + k]
        return self._winch(y[12 : 12 + 3 * k], y[self._size - k :], T_A)

    def _calc_length(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._motion(self._state_port.Eval(context))[0])

    def _calc_torque(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._winches(context)[3 * self._k : 4 * self._k])

    def _calc_tension(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._winches(context)[4 * self._k :])
