"""What each sensor is worth: one move with all sensors, and with some of them taken away.

Without load cells the law takes tensions of least norm within the limits, without tangent
cameras the tangents of parabolas there (`model/modelled.py`). Every set of sensors makes the same
runs: a seed decides the noise and the fixed bias of each target in each image, so that differences
to all sensors are taken seed by seed.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cdpr_drake.analysis import DefaultGain, default_gain
from cdpr_drake.batch import Outcome, sweep
from cdpr_drake.diagrams import ModelledSensing, TargetSensing
from cdpr_drake.diagrams.step import StepWarning
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.statics import DEFAULT_RULE
from cdpr_drake.runs.moves import move_near_the_middle
from cdpr_drake.runs.paper_tests import paper_test, paper_tests
from cdpr_drake.runs.running import prepare, run
from cdpr_drake.runs.setup import Setup, make_setup

TEST = 4
"""The paper's test that its own robot makes; others make a short move near their middle."""

HIGHEST_GAIN, SHARE_OF_LIMIT = 0.3, 0.6
"""The gain is this one [1/s], or this share of the limit at the goal if that is less."""

DECAYS = 8.0
"""How long a run takes, in time constants 1 / gain: e^-8 is 1/3000 of the way."""

METRICS = (
    "position_error",
    "orientation_error",
    "settled_after",
    "position_excursion",
    "lowest_tension",
    "highest_tension",
)
"""What a run is judged by, as in its `Summary`."""

TOLD_APART = 3.0
"""A difference is told from noise if it is this many standard errors of its mean."""

RELEVANT = 0.01
"""A difference smaller than this part of what it is a difference to is none."""


@dataclass(frozen=True, kw_only=True)
class SensorSet:
    """The sensors of a run.

    Attributes:
        label: in words.
        pose_cameras: how many of the robot's pose cameras there are, the first of them.
        modelled: what the law takes from the model instead of from sensors.
    """

    label: str
    pose_cameras: int
    modelled: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Statistic:
    """One metric of one set of sensors over all seeds.

    Attributes:
        mean: over the seeds; None if a run did not settle, or none came to its end.
        deviation: standard deviation of one run, over white noise and the fixed bias of each point
            together: a seed draws both, and a single robot keeps its biases.
        difference: mean of the differences to all sensors, seed by seed; None if there is none.
        uncertainty: standard error of that mean.
    """

    mean: float | None
    deviation: float | None = None
    difference: float | None = None
    uncertainty: float | None = None

    @property
    def is_told_apart(self) -> bool:
        """Whether it differs from all sensors' by more than noise explains, and enough to care."""
        if self.mean is None or self.difference is None or self.uncertainty is None:
            return False
        least = RELEVANT * abs(self.mean - self.difference)
        return abs(self.difference) > max(TOLD_APART * self.uncertainty, least)


@dataclass(frozen=True, kw_only=True)
class Worth:
    """What came of one set of sensors.

    Attributes:
        sensors: the set.
        statistics: by metric.
        failures: what ended runs early, by seed.
    """

    sensors: SensorSet
    statistics: Mapping[str, Statistic]
    failures: Mapping[int, str]


@dataclass(frozen=True, kw_only=True)
class Ablation:
    """What the sensors of one robot are worth.

    Attributes:
        robot: its name.
        gain: lambda of all runs [1/s].
        chosen: why it is this one, if nobody asked for one; else None.
        distance: of the move [m].
        rows: one for each set of sensors, all of them first.
    """

    robot: str
    gain: float
    chosen: DefaultGain | None = None
    distance: float
    rows: tuple[Worth, ...]


def sensor_sets(robot: CableRobot) -> tuple[SensorSet, ...]:
    """Return the sets of sensors that are compared, all of them first.

    Args:
        robot: the robot.
    """
    n = len(robot.cameras.pose_cameras)
    words = {1: "one pose camera", 2: "two pose cameras"}
    return (
        SensorSet(label="all sensors", pose_cameras=n),
        SensorSet(label="no load cells", pose_cameras=n, modelled=("tensions",)),
        SensorSet(label="no tangent cameras", pose_cameras=n, modelled=("tangents",)),
        SensorSet(label="neither of these", pose_cameras=n, modelled=("tensions", "tangents")),
        *(
            SensorSet(label=words.get(i, f"{i} pose cameras"), pose_cameras=i)
            for i in range(n - 1, 0, -1)
        ),
    )


def ablation_setup(
    robot: CableRobot,
    sensors: SensorSet,
    seed: int,
    gain: float,
    unknown_payload: float = 0.0,
    max_step: float | None = None,
    tensions: str = DEFAULT_RULE,
) -> Setup:
    """Return the run of a robot with some of its sensors.

    Args:
        robot: the robot, as it is but for the payload.
        sensors: which of them.
        seed: of the noise, and of each target's fixed bias.
        gain: lambda [1/s].
        unknown_payload: [kg] that the robot carries and the controller does not know of.
        max_step: of the integrator [s]; if None, the robot's modes decide.
        tensions: at the start, one of `model.statics.RULES`.
    """
    cameras = robot.cameras.replace(
        pose_cameras=robot.cameras.pose_cameras[: sensors.pose_cameras], pixel_bias_seed=seed
    )
    believed = robot.replace(cameras=cameras)
    start, goal = _move(believed)
    return make_setup(
        robot=believed.with_payload(unknown_payload) if unknown_payload else believed,
        believed=believed,
        start=start,
        goal=goal,
        gain=gain,
        until=DECAYS / gain,
        sample_time=robot.cameras.sample_time,
        latency=robot.cameras.latency,
        sensing=ModelledSensing(modelled=sensors.modelled, cameras=TargetSensing()),
        seed=seed,
        max_step=max_step,
        tensions=tensions,
    )


def suitable_gain(robot: CableRobot, payload: float = 0.0) -> DefaultGain:
    """Return lambda for a robot's run: its file's, or `HIGHEST_GAIN`, less where the limit is near.

    Args:
        robot: the robot.
        payload: carried [kg].
    """
    _, goal = _move(robot)
    timing = (robot.cameras.sample_time, robot.cameras.latency)
    loaded = robot.with_payload(payload) if payload else robot
    return default_gain(
        loaded, goal, "SCMWE", *timing, customary=HIGHEST_GAIN, share=SHARE_OF_LIMIT
    )


def ablate(
    robots: Sequence[str],
    seeds: int = 4,
    *,
    gain: float | None = None,
    unknown_payload: float = 0.0,
    max_step: float | None = None,
    tensions: str = DEFAULT_RULE,
    jobs: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Ablation]:
    """Return what each sensor of some robots is worth, one answer a robot.

    Args:
        robots: names of built-in robots, or files.
        seeds: runs of each set of sensors.
        gain: lambda [1/s]; `suitable_gain` if None.
        unknown_payload: [kg] that the robots carry and the controllers do not know of.
        max_step: of the integrator [s]; if None, each robot's modes decide.
        tensions: at the start, one of `model.statics.RULES`.
        jobs: processes at a time; as many as cores if None.
        progress: called with the number of runs done and of all.

    Raises:
        CdprError: a robot cannot be read, or cannot make the move.
        ValueError: seeds, gain or jobs cannot be used.
    """
    if seeds < 1:
        raise ValueError(f"at least one seed is needed, got {seeds}")
    plans = [_plan(name, gain, unknown_payload, max_step, tensions) for name in robots]
    cases = [
        {
            "robot": name,
            "label": sensors.label,
            "gain": setup.gain,
            "unknown_payload": unknown_payload,
            "max_step": max_step,
            "tensions": tensions,
            "seed": seed,
        }
        for name, (setup, sets, _) in zip(robots, plans, strict=True)
        for sensors in sets
        for seed in range(seeds)
    ]
    results = sweep(ablation_case, cases, seed=None, jobs=jobs, batch=1, progress=progress)
    outcomes = iter(results.outcomes)
    found = []
    for setup, sets, chosen in plans:
        own = [[next(outcomes) for _ in range(seeds)] for _ in sets]
        rows = [_worth(s, o, own[0]) for s, o in zip(sets, own, strict=True)]
        distance = float(np.linalg.norm(setup.goal.translation() - setup.start.translation()))
        ablation = Ablation(
            robot=setup.robot.name,
            gain=setup.gain,
            chosen=chosen,
            distance=distance,
            rows=tuple(rows),
        )
        found.append(ablation)
    return found


def ablation_case(
    robot: str,
    label: str,
    gain: float,
    unknown_payload: float,
    seed: int,
    max_step: float | None = None,
    tensions: str = DEFAULT_RULE,
) -> dict[str, float]:
    """Return the metrics of one run; NaN for a run that did not settle.

    Args:
        robot: a name or file.
        label: of the set of sensors.
        gain: lambda [1/s].
        unknown_payload: [kg].
        seed: of noise and bias.
        max_step: of the integrator [s].
        tensions: at the start.
    """
    true = load_robot(robot)
    sensors = next(s for s in sensor_sets(true) if s.label == label)
    setup = ablation_setup(true, sensors, seed, gain, unknown_payload, max_step, tensions)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", StepWarning)  # said once, of the first run
        summary = run(setup).summary
    values = {name: getattr(summary, name) for name in METRICS}
    return {name: math.nan if v is None else float(v) for name, v in values.items()}


def _move(robot: CableRobot) -> Any:
    if robot.name == paper_tests().robot:
        return paper_test(TEST).poses(robot)
    return move_near_the_middle(robot)


def _plan(
    name: str, gain: float | None, unknown_payload: float, max_step: float | None, tensions: str
) -> tuple[Setup, tuple[SensorSet, ...], DefaultGain | None]:
    """Return the first run of a robot, which works, all sets of sensors, and why that gain."""
    robot = load_robot(name)
    sets = sensor_sets(robot)
    chosen = suitable_gain(robot, unknown_payload) if gain is None else None
    pace = gain if chosen is None else chosen.gain
    assert pace is not None
    setup = ablation_setup(robot, sets[0], 0, pace, unknown_payload, max_step, tensions)
    prepare(setup)
    return setup, sets, chosen


def _worth(sensors: SensorSet, outcomes: Sequence[Outcome], reference: Sequence[Outcome]) -> Worth:
    statistics = {}
    for name in METRICS:
        own, theirs = (_values(which, name) for which in (outcomes, reference))
        statistics[name] = _statistic(own, None if outcomes is reference else own - theirs)
    failures = {i: ": ".join(o.error) for i, o in enumerate(outcomes) if o.error is not None}
    return Worth(sensors=sensors, statistics=statistics, failures=failures)


def _values(outcomes: Sequence[Outcome], name: str) -> np.ndarray:
    return np.array([math.nan if o.result is None else o.result[name] for o in outcomes])


def _statistic(values: np.ndarray, differences: np.ndarray | None) -> Statistic:
    n = values.size
    if not np.all(np.isfinite(values)):
        return Statistic(mean=None)
    deviation = float(values.std(ddof=1)) if n > 1 else None
    difference = uncertainty = None
    if differences is not None and np.all(np.isfinite(differences)):
        difference = float(differences.mean())
        uncertainty = float(differences.std(ddof=1) / math.sqrt(n)) if n > 1 else None
    return Statistic(
        mean=float(values.mean()),
        deviation=deviation,
        difference=difference,
        uncertainty=uncertainty,
    )
