"""Simulating a diagram: a default that suits its modes, a watch over its limits, a record."""

from __future__ import annotations

import importlib
import math
import os
import textwrap
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, OutputPort, PortDataType

from cdpr_drake.diagrams.rest import robot_of
from cdpr_drake.diagrams.step import MAX_STEP, Step, StepWarning, StepWatch, choose_step
from cdpr_drake.diagrams.watch import WATCH_PERIOD, LimitWatch
from cdpr_drake.model.signals import vector_names

INTEGRATOR = "runge_kutta3"
"""Default integrator, by Drake's name: the fastest to 1e-3 mm (benchmarks/bench_integrators.py)."""

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


WATCHED = ("pose", "tension_at_drawing_point")
"""Ports that a diagram must have to be simulated: its limits are watched by them."""


@dataclass(frozen=True, kw_only=True)
class Record:
    """What a run left behind.

    Attributes:
        time: (n,) [s].
        signals: for each recorded output port its values (n, size).
        context: the context at the end.
        wall_time: how long the run took [s].
        slack_cables: for each cable (counting from 1) that went slack, the first time [s].
        step: the integrator's, at its smallest, and why it was that.
    """

    time: np.ndarray
    signals: dict[str, np.ndarray]
    context: Context
    wall_time: float
    slack_cables: dict[int, float]
    step: Step = field(default_factory=Step)

    def __getitem__(self, name: str) -> np.ndarray:
        """Return the values (n, size) of a recorded output port."""
        return self.signals[name]

    def __repr__(self) -> str:
        """How long, how often, what was recorded, and what went slack, in a few lines."""
        rows = len(self.time)
        span = f"{self.time[0]:g} to {self.time[-1]:g} s, " if rows else ""
        sizes = [f"{name} ({v.shape[-1]})" for name, v in self.signals.items()]
        count = f"{rows} row" if rows == 1 else f"{rows} rows"
        lines = [f"Record: {span}{count}, computed in {self.wall_time:.3g} s"]
        if self.step.size != MAX_STEP:
            lines[0] += f" with steps of {1e3 * self.step.size:.3g} ms"
        lines += _wrapped("signals", sizes or ["none"], 4)
        if self.slack_cables:
            slack = [f"{cable} from {t:.3g} s" for cable, t in sorted(self.slack_cables.items())]
            lines += _wrapped("slack cables", slack, 1)
        return "\n".join(lines)

    def columns(self) -> dict[str, np.ndarray]:
        """Return "time" and each entry of each signal, (n,) each, by its name in linear models.

        The names are those of `vector_names`: "pose/yaw", "tension_at_winch[8]".
        """
        columns = {"time": self.time}
        for name, values in self.signals.items():
            columns |= zip(vector_names(name, values.shape[1]), values.T, strict=True)
        return columns

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write a heading and a line for each time, with all digits, and return the path.

        The columns are those of `columns`, in SI units: s, m, rad, N.

        Args:
            path: of the file, which is replaced if it exists.

        Raises:
            OSError: the file cannot be written.
        """
        columns, file = self.columns(), Path(path)
        with file.open("w", encoding="utf-8", newline="") as lines:
            lines.write(",".join(columns) + "\n")
            np.savetxt(lines, np.column_stack(list(columns.values())), "%.17g", delimiter=",")
        return file

    def to_dataframe(self) -> Any:
        """Return a pandas DataFrame with the columns of `columns`, "time" as its index.

        Raises:
            ImportError: pandas is not installed; this package does not require it.
        """
        try:
            pandas = importlib.import_module("pandas")
        except ImportError as error:
            raise ImportError(
                'to_dataframe() needs pandas, which is not installed: "pip install pandas"; '
                "to_csv(path) does without it"
            ) from error
        return pandas.DataFrame(self.columns()).set_index("time")

    @property
    def real_time_factor(self) -> float:
        """Simulated time over the time it took."""
        return float(self.time[-1] - self.time[0]) / self.wall_time


def make_simulator(
    diagram: Diagram,
    context: Context,
    *,
    max_step: float | Step | None = None,
    accuracy: float | None = None,
    integrator: str = INTEGRATOR,
) -> Simulator:
    """Return a simulator with the integrator that suits these diagrams.

    Its step does not change when the robot does, as that of `simulate` may. A StepWarning tells of
    a `max_step` that is too coarse for a mode.

    Args:
        diagram: the diagram.
        context: where it starts, e.g. from `rest_context`.
        max_step: the integrator's step, its largest with error control [s]; if None, 0.01 s or the
            part of it that the modes in this context need, see `choose_step`. A `Step` that was
            chosen beforehand is taken without a word.
        accuracy: for error control; fixed steps if None.
        integrator: as Drake calls it.

    Raises:
        ValueError: a step or an accuracy that is not positive and finite.
        RuntimeError: Drake has no such integrator, or none with or without error control.
    """
    step = _step(diagram, context, max_step, accuracy, integrator)
    if step.doubt and step is not max_step:
        warnings.warn(step.doubt, StepWarning, stacklevel=2)
    return _simulator(diagram, context, step, accuracy, integrator)


def simulate(
    diagram: Diagram,
    context: Context,
    until: float,
    *,
    record: Iterable[str] | None = None,
    every: float = 0.05,
    max_step: float | Step | None = None,
    accuracy: float | None = None,
    integrator: str = INTEGRATOR,
    progress: Callable[[float], None] | None = None,
) -> Record:
    """Run a diagram to a time and return what was recorded.

    The diagram is one of this package or one built around it. Of the latter it is asked that the
    robot is somewhere inside, and that it exports two of the robot's outputs, which are watched
    during the run: "pose", [roll, pitch, yaw, x, y, z], and "tension_at_drawing_point", one for
    each cable. `DiagramBuilder.ExportOutput(robot.GetOutputPort("pose"), "pose")` does that for
    the first.

    Where nobody gives a step, it is 0.01 s, or the part of it that the robot's modes need; as
    tensions rise or the platform moves far, it becomes smaller when they need that. `choose_step`
    says what it is chosen from. A StepWarning tells, once, of a step given that is too coarse.
    Where damping is so heavy, or friction so steep, that the step becomes tiny, the integrator
    "radau3" in steps of 0.01 s may be many times faster.

    Args:
        diagram: the diagram.
        context: where it starts; it is moved on to the end.
        until: [s], from the context's time on.
        record: names of output ports, each of which has to be there; those of `RECORDED` that the
            diagram has if None.
        every: period of the record [s].
        max_step: step of the integrator [s], its largest with error control; chosen if None. A
            `Step` that was chosen beforehand is taken without a word.
        accuracy: for error control; fixed steps if None.
        integrator: as Drake calls it.
        progress: called with the time at each record.

    Raises:
        ValueError: an end, period, step or accuracy that is none; a name of no output port with
            numbers; a diagram that does not export what is watched.
        CableError: a cable broke or has no equilibrium.
        SimulationError: the platform left the hull of the drawing points, its pitch came within 5
            degrees of 90, or a value is not finite.
    """
    if not (math.isfinite(until) and math.isfinite(every) and every > 0.0):
        raise ValueError(f"a run needs a finite end and a positive period, got {until}, {every} s")
    if until < context.get_time() - 1e-9:
        raise ValueError(
            f"the run is to end at {until:g} s, but the context is at {context.get_time():g} s "
            "already"
        )
    outputs = _vector_outputs(diagram)
    pose, tension = (_watched(diagram, outputs, name) for name in WATCHED)
    ports = _recorded(outputs, record)
    times: list[float] = []
    values: dict[str, list[np.ndarray]] = {name: [] for name in ports}
    watch = LimitWatch(robot_of(diagram))
    step = _step(diagram, context, max_step, accuracy, integrator)
    if step.doubt and step is not max_step:
        warnings.warn(step.doubt, StepWarning, stacklevel=2)
    steps = StepWatch(diagram, context, step)
    simulator = _simulator(diagram, context, step, accuracy, integrator)
    begun = time.perf_counter()
    simulator.Initialize()
    for t, is_record in _stops(context.get_time(), until, every):
        simulator.AdvanceTo(t)
        watch.check_pose(t, pose.Eval(context))
        if steps.look(t, pose.Eval(context), tension.Eval(context)):
            simulator.get_mutable_integrator().set_maximum_step_size(steps.step.size)
            if steps.step.doubt and not step.doubt:
                warnings.warn(steps.step.doubt, StepWarning, stacklevel=2)
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
        step=steps.step,
    )


def _step(
    diagram: Diagram,
    context: Context,
    max_step: float | Step | None,
    accuracy: float | None,
    integrator: str,
) -> Step:
    """Return the step that was given or is chosen.

    What a step must be is known of Runge-Kutta 3: another integrator gets the same if nobody gives
    one, and no opinion on one that is given.
    """
    if accuracy is not None and not (math.isfinite(accuracy) and accuracy > 0.0):
        raise ValueError(f"the accuracy must be positive and finite, got {accuracy}")
    if isinstance(max_step, Step):
        return max_step
    if accuracy is not None:
        return Step(size=MAX_STEP if max_step is None else max_step, decided_by="accuracy")
    if max_step is not None and integrator != INTEGRATOR:
        return Step(size=max_step, decided_by="given")
    return choose_step(diagram, context, max_step)


def _simulator(
    diagram: Diagram, context: Context, step: Step, accuracy: float | None, integrator: str
) -> Simulator:
    simulator = Simulator(diagram, context)
    config = SimulatorConfig()
    config.integration_scheme = integrator
    config.max_step_size = step.size
    config.start_time = context.get_time()  # which applying the configuration would set to 0
    config.use_error_control = accuracy is not None
    if accuracy is not None:
        config.accuracy = accuracy
    ApplySimulatorConfig(config, simulator)
    return simulator


def _vector_outputs(diagram: Diagram) -> dict[str, OutputPort]:
    """Return the output ports of a diagram that give numbers, by their names."""
    ports = map(diagram.get_output_port, range(diagram.num_output_ports()))
    return {p.get_name(): p for p in ports if p.get_data_type() == PortDataType.kVectorValued}


def _watched(diagram: Diagram, outputs: Mapping[str, OutputPort], name: str) -> OutputPort:
    """Return an output port that every run is watched by."""
    if name not in outputs:
        raise ValueError(
            f'diagram "{diagram.get_name()}" has no output port "{name}", by which a run is '
            f'watched: export the robot\'s, ExportOutput(robot.GetOutputPort("{name}"), '
            f'"{name}"), before the diagram is built'
        )
    return outputs[name]


def _recorded(
    outputs: Mapping[str, OutputPort], asked: Iterable[str] | None
) -> dict[str, OutputPort]:
    """Return the output ports to record: those asked for, or those of RECORDED that there are."""
    if asked is None:
        return {name: outputs[name] for name in RECORDED if name in outputs}
    names = [asked] if isinstance(asked, str) else list(asked)
    unknown = [f'"{name}"' for name in names if name not in outputs]
    if unknown:
        raise ValueError(
            f"nothing to record by the name of {', '.join(unknown)}; the diagram's output ports "
            f"are {', '.join(sorted(outputs))}"
        )
    return {name: outputs[name] for name in names}


def _wrapped(head: str, items: Iterable[str], lines: int) -> list[str]:
    """Return items as a list of some lines at most, with what they are at its head."""
    return textwrap.wrap(
        f"{head}: {', '.join(items)}",
        width=100,
        initial_indent="  ",
        subsequent_indent="    ",
        max_lines=lines,
        placeholder=" ...",
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
