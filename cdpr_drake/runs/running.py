"""One run of one controller: its setting, its start, what came of it."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context, Diagram

from cdpr_drake.analysis.default_gain import predicted_limit
from cdpr_drake.analysis.stability import StabilityWarning
from cdpr_drake.diagrams import (
    JointSpaceLoop,
    Record,
    VisionLoop,
    blocks,
    rest_context,
    simulate,
)
from cdpr_drake.diagrams.step import Step, StepWarning, choose_step
from cdpr_drake.errors import CdprError
from cdpr_drake.model.rotations import Array, pose_to_vector, vector_to_pose
from cdpr_drake.model.servo import PoseErrorMap
from cdpr_drake.runs.metrics import Summary, summarize
from cdpr_drake.runs.reach import check_inverse_kinematics, check_pose
from cdpr_drake.runs.setup import RECORD_PERIOD, Setup
from cdpr_drake.systems import ExponentialApproach


@dataclass(frozen=True, kw_only=True)
class Prepared:
    """A run that only has to be started.

    Attributes:
        setup: the setup.
        loop: the diagram.
        context: its context at the start.
        step: the integrator's at the start.
    """

    setup: Setup
    loop: Diagram
    context: Context
    step: Step

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


def prepare(setup: Setup) -> Prepared:
    """Return a run ready to start. All that can be refused beforehand is refused here.

    A StabilityWarning tells that the gain is above the limit predicted at the goal, or why there is
    no prediction; a StepWarning that the setup's step is too coarse for the robot's modes.

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
    if setup.is_vision_based:
        loop.GetInputPort("desired_pose").FixValue(context, pose_to_vector(setup.goal))
    _evaluate_all(loop, context)
    if message := doubt_about_gain(setup):
        warnings.warn(message, StabilityWarning, stacklevel=2)
    step = choose_step(loop, context, setup.max_step)
    if step.doubt:
        warnings.warn(step.doubt, StepWarning, stacklevel=2)
    return Prepared(setup=setup, loop=loop, context=context, step=step)


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
        max_step=ready.step,
        progress=progress,
    )
    if not setup.is_vision_based:
        record = _with_error_to(setup, record)
    return Run(setup=setup, record=record, summary=summarize(record, _offset(setup, record)))


def doubt_about_gain(setup: Setup) -> str:
    """Return why the gain of a setup may be too high for its goal, in a line; "" if it is not.

    Joint space control closes no loop around the gain, so there is no doubt about it.

    Args:
        setup: the setup.
    """
    if setup.paper_law is None:
        return ""
    limit = setup.chosen.limit if setup.chosen is not None else None
    if limit is None:
        try:
            limit = predicted_limit(
                setup.robot, setup.goal, **setup.law_at_goal, highest=max(setup.gain, 0.01)
            )
        except CdprError as error:
            text = f"{setup.label}: whether the gain is stable at the goal is not predicted"
            return f"{text}: {error}"
    if setup.gain <= limit.gain:
        return ""
    return (
        f"{setup.label}: the gain of {setup.gain:g}/s is above the limit predicted at the goal, "
        f"{limit.gain:.3g}/s, where {limit.mode} goes unstable at {limit.frequency:.3g} Hz"
    )


def _make_loop(setup: Setup) -> Diagram:
    loop = setup.loop
    if isinstance(loop, VisionLoop):
        return loop.make(setup.robot, parts=setup.parts, noise=setup.noise, fast=None)
    reference = ExponentialApproach(
        setup.robot, setup.start, setup.goal, setup.gain, loop.ramp_time
    )
    _check_path(setup, loop, reference)
    loop = loop.replace(tensions=setup.tensions)
    return loop.make(setup.robot, reference=reference, parts=setup.parts, fast=None)


def _evaluate_all(loop: Diagram, context: Context) -> None:
    """Evaluate what a run will, so that kernels are compiled or loaded here, off its clock."""
    loop.EvalTimeDerivatives(context)
    for index in range(loop.num_output_ports()):
        loop.get_output_port(index).Eval(context)
    for block in blocks(loop):
        # Of a sampled law no output of the loop needs the rates before the first frame.
        if block.system.HasInputPort("desired_pose") and block.system.HasOutputPort("motor_rates"):
            block.system.GetOutputPort("motor_rates").Eval(block.context(context))


def _check_path(setup: Setup, loop: JointSpaceLoop, reference: ExponentialApproach) -> None:
    """Ask joint space control for motor angles at points of equal steps from start to goal."""
    context = reference.CreateDefaultContext()
    port = reference.GetOutputPort("desired_pose")
    times = np.append(-np.log(np.linspace(1.0, 0.02, 50)) / setup.gain, setup.until)
    times = np.clip(times, 0.0, setup.until)
    poses = []
    for time in times:
        context.SetTime(time)
        poses.append(port.Eval(context))
    believed = loop.believed if loop.believed is not None else setup.robot
    check_inverse_kinematics(believed, np.array(poses), times, loop.cable_model, setup.tensions)


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
    positions = [(vector_to_pose(pose) @ X_PM).translation() for pose in record["pose"]]
    return np.array(positions) - desired
