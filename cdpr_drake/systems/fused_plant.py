"""The plant in one system, for simulations that want speed."""

from __future__ import annotations

import numpy as np
from pydrake.common import RandomDistribution
from pydrake.systems.framework import (
    BasicVector,
    Context,
    ContinuousState,
    InputPort,
    LeafSystem,
    OutputPort,
)

from cdpr_drake.model.cables import CableSet, packed_sizes
from cdpr_drake.model.equilibrium import RestState
from cdpr_drake.model.inverse_kinematics import lengths_at
from cdpr_drake.model.rest_model import mass_matrix
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, pose_to_vector, vector_to_pose
from cdpr_drake.model.signals import POSE, TWIST
from cdpr_drake.model.vision.outages import LOAD_CELL, Outage
from cdpr_drake.model.winch import WinchModel
from cdpr_drake.systems._template import Calc, check_finite, numbered, part_of_port
from cdpr_drake.systems.cable_force import raise_cable_error
from cdpr_drake.systems.load_cell import LoadCellFilter
from cdpr_drake.systems.winch import not_at_rest

COMMANDS = ("motor_rates", "desired_motor_angles")
"""What a plant may be told to do: the name of its first input port."""


def fused_refusal(
    robot: CableRobot, *, outages: tuple[Outage, ...] = (), load_cells: bool = True
) -> str:
    """Return why a plant cannot be a `FusedPlant` and needs the blocks; empty text if it can.

    Args:
        robot: the true robot.
        outages: of any sensors.
        load_cells: whether the plant has any.
    """
    if load_cells and robot.load_cells.vibration_amplitude > 0.0:
        return "load cells that vibrate need the plant in blocks"
    if load_cells and any(outage.sensor == LOAD_CELL for outage in outages):
        return "load cells that fail need the plant in blocks"
    return ""


def check_command(command: str) -> None:
    """Raise ValueError unless a plant can be told to do `command`."""
    if command not in COMMANDS:
        raise ValueError(f'unknown command "{command}"; known are {", ".join(COMMANDS)}')


class FusedPlant(LeafSystem):
    """Platform, cables, winches, load cells and integrator with one compiled derivative.

    .. pydrake_system::

        name: FusedPlant
        input_ports:
        - motor_rates (or desired_motor_angles, as `command` says)
        - external_wrench (optional)
        - tension_noise (optional; with load cells)
        output_ports:
        - state
        - packed
        - platform_wrench
        - pose
        - platform_state
        - tension_at_winch
        - tension_at_drawing_point
        - tension_at_attachment_point
        - tangents_at_drawing_point
        - tangents_at_attachment_point
        - dbeta
        - unstrained_length
        - motor_angles
        - motor_rates
        - motor_torques
        - platform_acceleration
        - measured_tension (with load cells)
        - desired_motor_angles

    The same equations as the blocks of `make_plant`, by the same kernels (kernels/plant.py): the
    framework is passed through once for a derivative, not ten times. Ports, state and the names of
    the states are as there; besides, packed is as in `CatenaryCableForce`, and state is [platform
    (12); motor angles (k); rates (k); integrals (k); filters (n_f k), with load cells; desired
    angles (k), if motor rates command]. For floats only: to linearise, take the blocks.

    Args:
        robot: the true robot; its load cells do not vibrate.
        believed: the robot as the controller believes it; the true one if None.
        command: "motor_rates", which the plant integrates, or "desired_motor_angles".
        load_cells: whether the winches have them.

    Attributes:
        numbers: what kernels/plant.py takes of the robot.
        state_names: what the entries of the state are called.
        eigenvalues: of the load cells' filters [1/s].

    Raises:
        ValueError: an unknown command, or what `fused_refusal` says.
        CableError, SimulationError: at evaluation, as the blocks raise them.
    """

    def __init__(
        self,
        robot: CableRobot,
        believed: CableRobot | None = None,
        *,
        command: str = "motor_rates",
        load_cells: bool = True,
    ) -> None:
        from cdpr_drake.model.kernels import plant as kernel

        super().__init__()
        check_command(command)
        refusal = fused_refusal(robot, load_cells=load_cells)
        if refusal:
            raise ValueError(refusal)
        self.robot, self.command, self.load_cells = robot, command, load_cells
        self._kernel = kernel
        self._cables, self._winch = CableSet(robot), WinchModel(robot)
        self._cells = LoadCellFilter(robot, believed)
        self._integrates = command == "motor_rates"
        k = self._k = robot.num_cables
        filters = robot.load_cells.order if load_cells else 0
        self.eigenvalues = self._cells.eigenvalues if load_cells else np.zeros(0)
        self._solid = self._cables.arrays.solid
        self.numbers = (
            *self._cables.numbers,
            self._solid,
            self._winch.parameters,
            np.vstack([self._cells.parameters, robot.winch.encoder_zero_length]),
            filters,
        )
        self.state_names = _state_names(k, filters, self._integrates)
        self._size = len(self.state_names)
        self._first_angle = 12 + (3 + filters) * k  # of the desired ones
        self._no_noise, self._no_wrench, self._zeros = np.zeros(k), np.zeros(6), np.zeros(k)
        state = self.DeclareContinuousState(self._size)
        self._command_port = self.DeclareVectorInputPort(command, k)
        self._wrench_port = self.DeclareVectorInputPort("external_wrench", 6)
        self._noise_port: InputPort | None = None
        if load_cells:
            self._noise_port = self.DeclareVectorInputPort(
                "tension_noise", k, RandomDistribution.kGaussian
            )
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
        readings = self.reading(tension)
        for stage in range(12 + 3 * k, self._first_angle, k):
            y[stage : stage + k] = readings
        if self._integrates:
            y[self._first_angle :] = rest.desired_motor_angles
        context.SetContinuousState(y)

    def not_at_rest(self, context: Context) -> str:
        """Return why the desired angles do not let the winches rest in a `context`, or ""."""
        angle = self._state_port.Eval(context)[12 : 12 + self._k]
        T_A = self._packed_port.Eval(context)[6 : 6 + self._k]
        return not_at_rest(self._winch, self._desired(context), angle, T_A)

    def unbalanced_wrench(self, context: Context) -> Array:
        """Return [torque; force] (6,) that the platform is out of balance by in a `context`."""
        acceleration = self.GetOutputPort("platform_acceleration").Eval(context)
        R_WP = vector_to_pose(self._state_port.Eval(context)[:6]).rotation().matrix()
        unbalanced: Array = mass_matrix(self.robot, R_WP) @ acceleration
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
        if self._noise_port is not None and self._noise_port.HasValue(context):
            noise = self._noise_port.Eval(context)
        if self._wrench_port.HasValue(context):
            wrench = self._wrench_port.Eval(context)
        command = self._command_port.Eval(context)
        ydot = np.empty(self._size)
        status = self._kernel.plant_derivatives(
            self._state_port.Eval(context), command, noise, wrench, *self.numbers, ydot
        )
        if status:
            self._packed_port.Eval(context)  # raises where a cable is at fault
            check_finite(np.concatenate([command, noise, wrench]), self, context, "inputs")
            check_finite(ydot, self, context, "derivatives")
        derivatives.SetFromVector(ydot)

    def _declare(self, name: str, size: int, calc: Calc, *inputs: InputPort) -> OutputPort:
        tickets = {self.xc_ticket(), *(port.ticket() for port in inputs)}
        return self.DeclareVectorOutputPort(name, size, calc, tickets)

    def _declare_part(self, name: str, port: OutputPort, start: int, size: int) -> None:
        self._declare(name, size, part_of_port(port, slice(start, start + size)))

    def _declare_outputs(self) -> None:
        k, y = self._k, self._state_port
        parts, start = {}, 0
        for name, size in packed_sizes(k).items():
            parts[name] = (name, self._packed_port, start, size)
            start += size
        self._declare_part(*parts.pop("platform_wrench"))
        self._declare_part("pose", y, 0, 6)
        self._declare_part("platform_state", y, 0, 12)
        self._declare("tension_at_winch", k, self._calc_tension)
        for part in parts.values():
            self._declare_part(*part)
        self._declare("unstrained_length", k, self._calc_length)
        self._declare_part("motor_angles", y, 12, k)
        self._declare_part("motor_rates", y, 12 + k, k)
        commanded = () if self._integrates else (self._command_port,)
        self._declare("motor_torques", k, self._calc_torque, *commanded)
        self._declare("platform_acceleration", 6, self._calc_acceleration, self._wrench_port)
        if self.load_cells:
            self._declare_part("measured_tension", y, self._first_angle - k, k)
        self._declare("desired_motor_angles", k, self._calc_desired, *commanded)

    def _solve(self, context: Context, output: BasicVector) -> None:
        y = self._state_port.Eval(context)
        length, rate = self._motion(y)
        packed, status = self._cables(y[:12], length, rate)
        if status:
            check_finite(y, self, context, "state")
            raise_cable_error(self.robot, context, y, length, packed, status)
        output.SetFromVector(packed)

    def _motion(self, y: Array) -> tuple[Array, Array]:
        """Return unstrained lengths (k,) [m] and their rates (k,) [m/s]."""
        k, rates = self._k, y[12 + self._k : 12 + 2 * self._k]
        return lengths_at(self.robot, y[12 : 12 + k]), self.robot.winch.transmission * rates

    def _desired(self, context: Context) -> Array:
        """Return the desired motor angles (k,) [rad]."""
        if self._integrates:
            return self._state_port.Eval(context)[self._first_angle :]
        return self._command_port.Eval(context)

    def _winches(self, context: Context, desired: Array, T_A: Array) -> Array:
        """Return [derivative (3 k); torques (k); tensions at the winches (k)]."""
        y = self._state_port.Eval(context)
        return self._winch(y[12 : 12 + 3 * self._k], desired, T_A)

    def _calc_length(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._motion(self._state_port.Eval(context))[0])

    def _calc_torque(self, context: Context, output: BasicVector) -> None:
        k = self._k
        torque = self._winches(context, self._desired(context), self._zeros)[3 * k : 4 * k]
        check_finite(torque, self, context, "motor torque")
        output.SetFromVector(torque)

    def _calc_tension(self, context: Context, output: BasicVector) -> None:
        T_A = self._packed_port.Eval(context)[6 : 6 + self._k]
        output.SetFromVector(self._winches(context, self._zeros, T_A)[4 * self._k :])

    def _calc_acceleration(self, context: Context, output: BasicVector) -> None:
        wrench = self._packed_port.Eval(context)[:6]
        if self._wrench_port.HasValue(context):
            wrench = wrench + self._wrench_port.Eval(context)
        xdot = np.empty(12)
        self._kernel.platform_derivatives(
            self._state_port.Eval(context)[:12], wrench, self._solid, xdot
        )
        check_finite(xdot, self, context, "platform's derivatives")
        output.SetFromVector(xdot[6:])

    def _calc_desired(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._desired(context))


def _state_names(k: int, filters: int, integrates: bool) -> tuple[str, ...]:
    """Return what the blocks' states are called, k to a group but for the platform's."""
    groups = ["winches/angle", "winches/rate", "winches/integral"]
    groups += [f"load_cells/stage_{i + 1}" for i in range(filters - 1)]
    if filters:
        groups.append("load_cells/tension")
    if integrates:
        groups.append("integrator/angle")
    platform = tuple(f"platform/{name}" for name in POSE + TWIST)
    return platform + numbered(*groups, count=k)
