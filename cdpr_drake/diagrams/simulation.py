"""Simulating a diagram: a default that suits its modes, a watch over its limits, a record."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram

from cdpr_drake.diagrams.rest import robot_of
from cdpr_drake.diagrams.watch import WATCH_PERIOD, LimitWatch

INTEGRATOR = "runge_kutta3"
"""Default integrator, by Drake's name: the fastest to 1e-3 mm (benchmarks/bench_integrators.py)."""

MAX_STEP = 0.01
"""Default step of the fixed-step Runge-Kutta 3 integrator [s]: six to a period of the winches."""

RECORDED = (
    "pose",
    "pose_error",
    "pose_error_seen",
    "desired_pose",
    "tension_at_winch",
    "tension_at_drawing_point",
    "tension_at_attachment_point",
    "measured_tension",
    "tangents_at_drawing_point",
    "dbeta",
    "unstrained_length",
    "motor_angles",
    "motor_rates",
    "motor_torques",
    "frames_lost",
    "images_lost",
    "tangent_frames_lost",
)
"""Ports that `simulate` records, those of them that a diagram has."""


@dataclass(frozen=True, kw_only=True)
class Record:
    """What a run left behind.

    Attributes:
        time: (n,) [s].
        signals: for each recorded output port its values (n, size).
        context: the context at the end.
        wall_time: how long the run took [s].
        slack_cables: for each cable (counting from 1) that went slack, the first time [s].
    """

    time: np.ndarray
    signals: dict[str, np.ndarray]
    context: Context
    wall_time: float
    slack_cables: dict[int, float]

    def __getitem__(self, name: str) -> np.ndarray:
        """Return the values (n, size) of a recorded output port."""
        return self.signals[name]

    @property
    def real_time_factor(self) -> float:
        """Simulated time over the time it took."""
        return float(self.time[-1] - self.time[0]) / self.wall_time


def make_simulator(
    diagram: Diagram,
    context: Context,
    *,
    max_step: float = MAX_STEP,
    accuracy: float | None = None,
    integrator: str = INTEGRATOR,
) -> Simulator:
    """Return a simulator with the integrator that suits these diagrams.

    Args:
        diagram: the diagram.
        context: where it starts, e.g. from `rest_context`.
        max_step: the integrator's step, its largest with error control [s].
        accuracy: for error control; fixed steps if None.
        integrator: as Drake calls it.

    Raises:
        RuntimeError: Drake has no such integrator, or none with or without error control.
    """
    simulator = Simulator(diagram, context)
    config = SimulatorConfig()
    config.integration_scheme = integrator
    config.max_step_size = max_step
    config.start_time = context.get_time()  # which applying the configuration would set to 0
    config.use_error_control = accuracy is not None
    if accuracy is not None:
        config.accuracy = accuracy
    ApplySimulatorConfig(config, simulator)
    return simulator


def simulate(
    diagram: Diagram,
    context: Context,
    until: float,
    *,
    record: Iterable[str] | None = None,
    every: float = 0.05,
    max_step: float = MAX_STEP,
    accuracy: float | None = None,
    integrator: str = INTEGRATOR,
    progress: Callable[[float], None] | None = None,
) -> Record:
    """Run a diagram to a time and return what was recorded.

    Args:
        diagram: a diagram of this package, or one built around it, with an output "pose".
        context: where it starts; it is moved on to the end.
        until: [s].
        record: names of output ports; those of `RECORDED` that the diagram has if None.
        every: period of the record [s].
        max_step: step of the integrator [s].
        accuracy: for error control; fixed steps if None.
        integrator: as Drake calls it.
        progress: called with the time at each record.

    Raises:
        ValueError: an end or period that is none.
        CableError: a cable broke or has no equilibrium.
        SimulationError: the platform left the hull of the drawing points, its pitch came within 5
            degrees of 90, or a value is not finite.
    """
    if not (math.isfinite(until) and math.isfinite(every) and every > 0.0):
        raise ValueError(f"a run needs a finite end and a positive period, got {until}, {every} s")
    names = RECORDED if record is None else record
    ports = {n: diagram.GetOutputPort(n) for n in names if diagram.HasOutputPort(n)}
    times: list[float] = []
    values: dict[str, list[np.ndarray]] = {name: [] for name in ports}
    watch = LimitWatch(robot_of(diagram))
    pose = diagram.GetOutputPort("pose")
    tension = diagram.GetOutputPort("tension_at_drawing_point")
    simulator = make_simulator(
        diagram, context, max_step=max_step, accuracy=accuracy, integrator=integrator
    )
    begun = time.perf_counter()
    simulator.Initialize()
    for t, is_record in _stops(context.get_time(), until, every):
        simulator.AdvanceTo(t)
        watch.check_pose(t, pose.Eval(context))
        if is_record:
            watch.check_tensions(t, tension.Eval(context))
            times.append(t)
            for name, port in ports.items():
                values[name].append(port.Eval(context))
            if progress is not None:
                progress(t)
    return Record(
        time=np.array(times),
        signals={name: np.array(v) for name, v in values.items()},
        context=context,
        wall_time=time.perf_counter() - begun,
        slack_cables=watch.slack,
    )


def _stops(start: float, until: float, every: float) -> Iterator[tuple[float, bool]]:
    """Yield (time, whether to record there): every period, the end, and the watch's looks between.

    Times come from counting, not adding, so that they meet the samples of a loop exactly.
    """
    looks = max(1, math.ceil(every / WATCH_PERIOD - 1e-9))
    count = max(0, math.floor((until - start) / every + 1e-9))
    for n in range(count * looks + 1):
        yield start + n * every / looks, n % looks == 0
    if until > start + count * every + 1e-9:
        yield until, True
