"""All that decides how a run goes."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

from pydrake.math import RigidTransform

from cdpr_drake.analysis.default_gain import DefaultGain, default_gain
from cdpr_drake.diagrams import JointSpaceLoop, VisionLoop
from cdpr_drake.diagrams.wiring import SystemOrMaker
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.rotations import as_pose
from cdpr_drake.model.servo import CUSTOMARY_GAIN, ServoSettings
from cdpr_drake.model.statics import DEFAULT_RULE, MINIMUM_NORM
from cdpr_drake.runs.paper_tests import paper_test, paper_tests

RECORD_PERIOD = 0.05
"""Time between two lines of a run's record [s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Setup:
    """All that decides how a run goes. Two runs of one setup agree to the last bit.

    Args:
        robot: the true robot, payload included.
        start: X_WP at the start, or [roll, pitch, yaw, x, y, z] (rad, m).
        goal: X_WP at the goal, in either form.
        loop: what controls it: a `VisionLoop`, or a `JointSpaceLoop`, which goes along the path
            that the ideal vision-based law would take. A gain that is open in the loop becomes
            `analysis.default_gain` at the goal: a number once made, which a copy by `replace`
            keeps, and chooses anew with gain=None.
        noise: whether cameras and load cells are noisy; joint space control uses neither.
        seed: of the noise.
        until: how long to run [s].
        max_step: step of the integrator [s]; if None, the robot's modes decide, see `simulate`.
        tensions: those of vision-based control at the start, those of joint space control's inverse
            kinematics all the way: one of `model.statics.RULES`.
        parts: what else pulls at the platform, see `make_vision_based_control`.

    Attributes:
        chosen: why the gain is what it is, if it was open; else None.

    Raises:
        ValueError: a value is out of range.
    """

    robot: CableRobot
    start: RigidTransform
    goal: RigidTransform
    loop: VisionLoop | JointSpaceLoop = dataclasses.field(default_factory=VisionLoop)
    noise: bool = True
    seed: int = 0
    until: float = 80.0
    max_step: float | None = None
    tensions: str = DEFAULT_RULE
    parts: tuple[SystemOrMaker, ...] = ()
    chosen: DefaultGain | None = dataclasses.field(default=None, init=False)

    def __post_init__(self) -> None:
        for name in ("start", "goal"):
            object.__setattr__(self, name, RigidTransform(as_pose(getattr(self, name))))
        for name, value in (
            ("the time to run until", self.until),
            ("the integrator's step", self.max_step),
        ):
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive and finite, got {value}")
        if self.until < RECORD_PERIOD:
            raise ValueError(f"a run takes at least {RECORD_PERIOD} s, got {self.until} s")
        if not self.loop.timing.delay < self.until:
            raise ValueError(
                f"the latency must be from 0 to below the run's {self.until:g} s, "
                f"got {self.loop.timing.latency} s"
            )
        if not 0 <= self.seed < 2**32:
            raise ValueError(f"the seed must be from 0 to 2^32 - 1, got {self.seed}")
        follows = isinstance(self.loop, JointSpaceLoop)
        if self.loop.gain is None and (follows or self.paper_law is not None):
            chosen = self._default_gain()
            object.__setattr__(self, "chosen", chosen)
            object.__setattr__(self, "loop", self.loop.replace(gain=chosen.gain))

    @property
    def paper_law(self) -> ServoSettings | None:
        """The settings of the paper's law, None where it does not control the robot."""
        law = self.loop.law if isinstance(self.loop, VisionLoop) else None
        return law if isinstance(law, ServoSettings) else None

    def _default_gain(self) -> DefaultGain:
        """Return the gain of a loop without one; joint space control closes no loop around it."""
        if isinstance(self.loop, JointSpaceLoop):
            own = self.robot.gain
            by = "custom" if own is None else "robot file"
            return DefaultGain(gain=CUSTOMARY_GAIN if own is None else own, decided_by=by)
        return default_gain(self.robot, self.goal, **self.law_at_goal)

    @property
    def law_at_goal(self) -> dict[str, Any]:
        """Arguments of questions about the paper's law at a pose: model, times, belief, tensions.

        Raises:
            TypeError: the loop has no such law.
        """
        if self.paper_law is None:
            raise TypeError(f"{self.label} is not vision-based control by the paper's law")
        return {
            "cable_model": self.paper_law.cable_model,
            "sample_time": self.loop.timing.sample_time,
            "latency": self.loop.timing.latency,
            "believed": self.loop.believed,
            "tensions": self.tensions,
        }

    @property
    def gain(self) -> float:
        """The gain lambda [1/s].

        Raises:
            TypeError: the law is a user's own, without one.
        """
        if self.loop.gain is None:
            raise TypeError(f"{self.label} has no gain")
        return self.loop.gain

    @property
    def is_vision_based(self) -> bool:
        """Whether cameras close the loop."""
        return isinstance(self.loop, VisionLoop)

    @property
    def label(self) -> str:
        """A short name: the controller and, where it is open, its cable model."""
        return self.loop.label

    def replace(self, **fields: Any) -> Setup:
        """Return a copy with some `fields` changed, its own or its loop's, checked like a new one.

        Raises:
            TypeError: there is no such field.
        """
        own = {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.init}
        return make_setup(**{**own, **fields})


def make_setup(**fields: Any) -> Setup:
    """Return a setup, from its own `fields` and from those of its loop: gain, sample_time, ...

    Raises:
        TypeError: there is no such field.
        ValueError: a value is out of range.
    """
    own = {f.name for f in dataclasses.fields(Setup)}
    rest = {name: value for name, value in fields.items() if name not in own}
    kept = {name: value for name, value in fields.items() if name in own}
    if rest:
        kept["loop"] = kept.get("loop", VisionLoop()).replace(**rest)
    return Setup(**kept)


def setup_of_test(number: int, robot: CableRobot | None = None, **changes: Any) -> Setup:
    """Return the setup of one of the paper's tests.

    Args:
        number: 1 to 5.
        robot: another robot to make it with; it carries the test's payload too.
        changes: fields of Setup, or of its loop, to take another value. With another loop, e.g.
            `JointSpaceLoop()`, the test's gain stays unless `gain` says otherwise.

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
        "until": test.duration,
        "tensions": MINIMUM_NORM,  # the paper's own rule
    }
    loop = changes.get("loop", VisionLoop())
    if isinstance(loop, VisionLoop):
        cameras = robot.cameras
        values |= {"sample_time": cameras.sample_time, "latency": cameras.latency}
    if isinstance(changes.get("law", getattr(loop, "law", ServoSettings())), ServoSettings):
        values["gain"] = test.gain
    return make_setup(**{**values, **changes})
