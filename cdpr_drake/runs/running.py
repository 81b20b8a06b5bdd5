"""One run of one controller: its setting, its start, what came of it."""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, Diagram

from cdpr_drake.analysis.default_gain import DefaultGain, default_gain, predicted_limit
from cdpr_drake.analysis.platform_modes import platform_modes
from cdpr_drake.analysis.stability import StabilityWarning
from cdpr_drake.analysis.step_size import StepWarning, step_error, step_limit
from cdpr_drake.diagrams import (
    Record,
    blocks,
    make_joint_space_control,
    make_vision_based_control,
    rest_context,
    simulate,
    with_reference,
)
from cdpr_drake.diagrams.eyes import SENSORS
from cdpr_drake.diagrams.simulation import MAX_STEP
from cdpr_drake.errors import CdprError
from cdpr_drake.model.cable_models import CABLE_MODELS
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.rotations import Array, as_pose, pose_to_vector
from cdpr_drake.model.servo import CUSTOMARY_GAIN, PoseErrorMap
from cdpr_drake.model.vision.outages import LOAD_CELL, Outage
from cdpr_drake.model.vision.pose import ESTIMATORS
from cdpr_drake.runs.metrics import Summary, summarize
from cdpr_drake.runs.paper_tests import paper_test, paper_tests
from cdpr_drake.runs.reach import check_inverse_kinematics, check_pose
from cdpr_drake.systems import ExponentialApproach

CONTROLLERS = ("VBC", "JSC")
"""The paper's vision-based control (Fig. 8) and joint space control (Fig. 9)."""

RECORD_PERIOD = 0.05
"""Time between two lines of a run's record [s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Setup:
    """All that decides how a run goes. Two runs of one setup agree to the last bit.

    Args:
        robot: the true robot, payload included.
        start: X_WP at the start, or [roll, pitch, yaw, x, y, z] (rad, m).
        goal: X_WP at the goal, in either form.
        controller: "VBC", or "JSC" along the path that the ideal vision-based law would take.
        cable_model: the controller's "ECM", "CMWE", "SCMWE" or "SLSM"; the paper's JSC has "SCMWE".
        gain: lambda [1/s]; if None, `analysis.default_gain` at the goal. A number once made: a copy
            by `replace` keeps it, and with gain=None chooses anew.
        sample_time: period of the vision loop [s]; None for an all-continuous loop.
        latency: from image to change of the motor rates [s].
        ramp_time: over which the gain rises from zero at the start [s].
        noise: whether cameras and load cells are noisy; joint space control uses neither.
        seed: of the noise.
        until: how long to run [s].
        max_step: step of the integrator [s].
        calibrated: the robot as the controller believes it; the true one if None.
        sensors: of VBC, one of `SENSORS`: the truth with Gaussian noise, or what cameras see.
        estimator: of the pose from targets, "joint" or "mean" (the paper's).
        outages: when load cells of VBC fail and, with sensors that see, its cameras.
        modelled: "tensions" and "tangents" that VBC takes from the model instead of from sensors.
        tensions: those of VBC at the start, "minimum norm" or "within limits" of the robot.

    Attributes:
        chosen: why the gain is what it is, if it was None; else None.

    Raises:
        ValueError: a value is out of range.
    """

    robot: CableRobot
    start: RigidTransform
    goal: RigidTransform
    controller: str = "VBC"
    cable_model: str = "SCMWE"
    gain: float = None  # type: ignore[assignment]
    sample_time: float | None = 0.05
    latency: float = 0.04
    ramp_time: float = 1.0
    noise: bool = True
    seed: int = 0
    until: float = 80.0
    max_step: float = MAX_STEP
    calibrated: CableRobot | None = None
    sensors: str = "gaussian"
    estimator: str = "joint"
    outages: tuple[Outage, ...] = ()
    modelled: tuple[str, ...] = ()
    tensions: str = "minimum norm"
    chosen: DefaultGain | None = dataclasses.field(default=None, init=False)

    def __post_init__(self) -> None:
        for name in ("start", "goal"):
            object.__setattr__(self, name, RigidTransform(as_pose(getattr(self, name))))
        for name, choice, known in (
            ("controller", self.controller, CONTROLLERS),
            ("cable model", self.cable_model, CABLE_MODELS),
            ("sensors", self.sensors, SENSORS),
            ("estimator", self.estimator, ESTIMATORS),
        ):
            if choice not in known:
                raise ValueError(f'unknown {name} "{choice}"; known are {", ".join(known)}')
        gain: Any = self.gain
        for name, value in (
            ("the gain", CUSTOMARY_GAIN if gain is None else gain),
            ("the time to run until", self.until),
            ("the integrator's step", self.max_step),
        ):
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive and finite, got {value}")
        if not (math.isfinite(self.ramp_time) and self.ramp_time >= 0.0):
            raise ValueError(f"the ramp time must not be negative, got {self.ramp_time} s")
        if self.until < RECORD_PERIOD:
            raise ValueError(f"a run takes at least {RECORD_PERIOD} s, got {self.until} s")
        if not 0.0 <= self.latency < self.until:
            raise ValueError(
                f"the latency must be from 0 to below the run's {self.until:g} s, "
                f"got {self.latency} s"
            )
        if not 0 <= self.seed < 2**32:
            raise ValueError(f"the seed must be from 0 to 2^32 - 1, got {self.seed}")
        if gain is None:
            chosen = _default_gain(self)
            object.__setattr__(self, "chosen", chosen)
            object.__setattr__(self, "gain", chosen.gain)

    @property
    def label(self) -> str:
        """A short name: the controller and, where it is open, its cable model."""
        if self.controller == "JSC" and self.cable_model == "SCMWE":
            return "JSC"
        return f"{self.controller} {self.cable_model}"

    def replace(self, **fields: Any) -> Setup:
        """Return a copy with some `fields` changed, checked like a new one."""
        return dataclasses.replace(self, **fields)


@dataclass(frozen=True, kw_only=True)
class Prepared:
    """A run that only has to be started.

    Attributes:
        setup: the setup.
        loop: the diagram.
        context: its context at the start.
    """

    setup: Setup
    loop: Diagram
    context: Context

    def tension_at_drawing_point(self) -> Array:
        """Return the tensions (k,) [N] of the robot where it starts."""
        tension: Array = self.loop.GetOutputPort("tension_at_drawing_point").Eval(self.context)
        return tension


@dataclass(frozen=True, kw_only=True)
class Run:
    """A run and what came of it.

    Attributes:
        setup: the setup.
        record: as `simulate` gives it, but its "pose_error" is to the goal for every controller;
            the error to a moving reference is in "reference_error".
        summary: what the run is judged by.
    """

    setup: Setup
    record: Record
    summary: Summary


def setup_of_test(number: int, robot: CableRobot | None = None, **changes: Any) -> Setup:
    """Return the setup of one of the paper's tests.

    Args:
        number: 1 to 5.
        robot: another robot to make it with; it carries the test's payload too.
        changes: fields of Setup to take another value.

    Raises:
        ValueError: there is no such test, or a value is out of range.
        RobotFileError: the robot cannot carry the payload.
    """
    test = paper_test(number)
    robot = test.carried_by(robot if robot is not None else load_robot(paper_tests().robot))
    start, goal = test.poses(robot)
    values: dict[str, Any] = {
        "robot": robot,
        "start": start,
        "goal": goal,
        "gain": test.gain,
        "sample_time": robot.cameras.sample_time,
        "latency": robot.cameras.latency,
        "until": test.duration,
    }
    return Setup(**{**values, **changes})


def prepare(setup: Setup) -> Prepared:
    """Return a run ready to start. All that can be refused beforehand is refused here.

    A StabilityWarning tells that the gain is above the limit predicted at the goal, or why there is
    no prediction; a StepWarning that the integrator's step is too coarse for the robot's modes.

    Args:
        setup: the setup.

    Raises:
        GeometryError, TensionError: the cables cannot control six degrees of freedom, or cannot
            hold the platform at the start, the goal, or on the way where the controller needs it.
        EquilibriumError: no rest state was found at the start.
        ValueError: a gain, period or latency out of range; gain * sample_time >= 1.
    """
    loop = _make_loop(setup)
    check_pose(setup.robot, setup.start, "start")
    check_pose(setup.robot, setup.goal, "goal")
    context = rest_context(loop, setup.start, setup.tensions, setup.seed)
    if setup.controller == "VBC":
        loop.GetInputPort("desired_pose").FixValue(context, pose_to_vector(setup.goal))
    _evaluate_all(loop, context)
    if message := doubt_about_gain(setup):
        warnings.warn(message, StabilityWarning, stacklevel=2)
    if message := doubt_about_step(setup):
        warnings.warn(message, StepWarning, stacklevel=2)
    return Prepared(setup=setup, loop=loop, context=context)


def run(setup: Setup | Prepared, progress: Callable[[float], None] | None = None) -> Run:
    """Run a setup and return what came of it.

    Args:
        setup: the setup, or what `prepare` made of it; the latter can be run once.
        progress: called with the simulated time [s] at each record.

    Raises:
        GeometryError, TensionError, EquilibriumError, ValueError: as `prepare` does.
        CableError, SimulationError: the run left what the model covers.
    """
    ready = setup if isinstance(setup, Prepared) else prepare(setup)
    setup = ready.setup
    record = simulate(
        ready.loop,
        ready.context,
        setup.until,
        every=RECORD_PERIOD,
        max_step=setup.max_step,
        progress=progress,
    )
    if setup.controller == "JSC":
        record = _with_error_to(setup, record)
    return Run(setup=setup, record=record, summary=summarize(record, _offset(setup, record)))


def doubt_about_gain(setup: Setup) -> str:
    """Return why the gain of a setup may be too high for its goal, in a line; "" if it is not.

    Joint space control closes no loop around the gain, so there is no doubt about it.

    Args:
        setup: the setup.
    """
    if setup.controller != "VBC":
        return ""
    limit = setup.chosen.limit if setup.chosen is not None else None
    if limit is None:
        try:
            limit = predicted_limit(*_loop(setup), **_law(setup), highest=max(setup.gain, 0.01))
        except CdprError as error:
            text = f"{setup.label}: whether the gain is stable at the goal is not predicted"
            return f"{text}: {error}"
    if setup.gain <= limit.gain:
        return ""
    return (
        f"{setup.label}: the gain of {setup.gain:g}/s is above the limit predicted at the goal, "
        f"{limit.gain:.3g}/s, where {limit.mode} goes unstable at {limit.frequency:.3g} Hz"
    )


def _default_gain(setup: Setup) -> DefaultGain:
    """Return the gain of a setup without one; joint space control closes no loop around it."""
    if setup.controller != "VBC":
        own = setup.robot.gain
        by = "custom" if own is None else "robot file"
        return DefaultGain(gain=CUSTOMARY_GAIN if own is None else own, decided_by=by)
    return default_gain(*_loop(setup), **_law(setup))


def _loop(setup: Setup) -> tuple[CableRobot, RigidTransform, str, float | None, float]:
    return setup.robot, setup.goal, setup.cable_model, setup.sample_time, setup.latency


def _law(setup: Setup) -> dict[str, Any]:
    return {"believed": setup.calibrated, "tensions": setup.tensions}


def doubt_about_step(setup: Setup) -> str:
    """Return why the integrator's step is too coarse for a setup, in a line; "" if it is not.

    Args:
        setup: the setup.

    Raises:
        GeometryError, TensionError, EquilibriumError: the robot cannot rest at the start.
    """
    modes = platform_modes(setup.robot, setup.start, "controlled", tensions=setup.tensions)
    limit = step_limit(modes)
    if setup.max_step <= limit.step:
        return ""
    wrong = step_error(limit.mode.eigenvalue, setup.max_step)
    return (
        f"{setup.label}: the integrator's step of {1e3 * setup.max_step:g} ms is too coarse for a "
        f"mode at {limit.mode.frequency:.3g} Hz: it gets {100.0 * wrong:.0f} % of its motion "
        f"wrong; {1e3 * limit.step:.2g} ms would do"
    )


def _make_loop(setup: Setup) -> Diagram:
    if setup.controller == "VBC":
        return make_vision_based_control(
            setup.robot,
            setup.cable_model,
            setup.gain,
            setup.sample_time,
            setup.latency,
            calibrated=setup.calibrated,
            noise=setup.noise,
            sensors=setup.sensors,
            estimator=setup.estimator,
            outages=setup.outages,
            modelled=setup.modelled,
            fused=_can_fuse(setup),
            ramp_time=setup.ramp_time,
        )
    loop = make_joint_space_control(
        setup.robot, cable_model=setup.cable_model, calibrated=setup.calibrated
    )
    reference = ExponentialApproach(
        setup.robot, setup.start, setup.goal, setup.gain, setup.ramp_time
    )
    _check_path(setup, reference)
    return with_reference(loop, reference)


def _can_fuse(setup: Setup) -> bool:
    """Return whether the robot, load cells and integrator can run as one system."""
    fails = any(outage.sensor == LOAD_CELL for outage in setup.outages)
    return not fails and setup.robot.load_cells.vibration_amplitude == 0.0


def _evaluate_all(loop: Diagram, context: Context) -> None:
    """Evaluate what a run will, so that kernels are compiled or loaded here, off its clock."""
    loop.EvalTimeDerivatives(context)
    for index in range(loop.num_output_ports()):
        loop.get_output_port(index).Eval(context)
    for path, system in blocks(loop):
        if path[-1] == "servo":  # sampled: no output of the loop needs it before the first frame
            system.GetOutputPort("motor_rates").Eval(system.GetMyContextFromRoot(context))


def _check_path(setup: Setup, reference: Any) -> None:
    """Ask joint space control for motor angles at points of equal steps from start to goal."""
    context = reference.CreateDefaultContext()
    port = reference.GetOutputPort("desired_pose")
    times = np.append(-np.log(np.linspace(1.0, 0.02, 50)) / setup.gain, setup.until)
    times = np.clip(times, 0.0, setup.until)
    poses = []
    for time in times:
        context.SetTime(time)
        poses.append(port.Eval(context))
    believed = setup.calibrated if setup.calibrated is not None else setup.robot
    check_inverse_kinematics(believed, np.array(poses), times, setup.cable_model)


def _with_error_to(setup: Setup, record: Record) -> Record:
    """Return a record whose "pose_error" is to the goal, not to the moving reference."""
    error, goal = PoseErrorMap(setup.robot), pose_to_vector(setup.goal)
    to_goal = np.array([error(np.concatenate([pose, goal])) for pose in record["pose"]])
    signals = {
        **record.signals,
        "pose_error": to_goal,
        "reference_error": record["pose_error"],
    }
    return dataclasses.replace(record, signals=signals)


def _offset(setup: Setup, record: Record) -> Array:
    """Return (n, 3): p_WM minus that of the goal [m]."""
    X_PM = setup.robot.cameras.X_PM
    desired = (setup.goal @ X_PM).translation()
    positions = [(as_pose(pose) @ X_PM).translation() for pose in record["pose"]]
    return np.array(positions) - desired
