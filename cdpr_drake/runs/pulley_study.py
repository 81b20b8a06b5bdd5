"""What it costs to believe other things of pulleys than are true: one move for each belief.

The plant is always the true robot. Vision-based control (VBC) sees the pose and the tangents of the
cables; joint space control (JSC) knows motor angles only, its encoders zeroed at the start. Its
cable model is the ECM, so that sag and stretch are in every belief and only pulleys differ. There
is no noise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.analysis import gain_matrix
from cdpr_drake.analysis.calibration_study import led_aside
from cdpr_drake.diagrams import JointSpaceLoop, VisionLoop
from cdpr_drake.errors import CdprError, RobotFileError
from cdpr_drake.model.encoders import zeroed_at
from cdpr_drake.model.pulley_beliefs import BELIEFS, Belief
from cdpr_drake.model.pulleys import has_pulleys
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, as_pose, vector_to_pose
from cdpr_drake.model.statics import DEFAULT_RULE
from cdpr_drake.runs.moves import LONGEST, move_near_the_middle
from cdpr_drake.runs.running import Run, run
from cdpr_drake.runs.setup import Setup, make_setup

CONTROLLERS = ("JSC", "VBC")

JSC_CABLE_MODEL = "ECM"

DECAYS = 12.0
"""How long a run takes, in time constants 1 / gain: what is left of the way is 6e-6 of it."""


@dataclass(frozen=True, kw_only=True)
class BeliefCost:
    """What one belief costs under one controller; None where a run did not come to its end.

    Attributes:
        belief: its name.
        controller: "JSC" or "VBC".
        position_error: of the target frame at the end [mm].
        orientation_error: at the end [deg].
        apart: largest distance between the target frame and where it is at the same time with the
            true belief [mm].
        tension_change: largest difference of a cable's tension at the drawing point from what it is
            at the same time with the true belief, over the latter [%].
        slowest: smallest real part of the eigenvalues of Gamma at the goal; times lambda the
            slowest rate of convergence. None under JSC.
        fastest: largest one.
        led_aside: how far the way is led aside of the one with the true belief at most, both
            compared with the straight way, at the same times [mm]; None under JSC.
        failure: why the run did not come to its end, "" if it did.
    """

    belief: str
    controller: str
    position_error: float | None = None
    orientation_error: float | None = None
    apart: float | None = None
    tension_change: float | None = None
    slowest: float | None = None
    fastest: float | None = None
    led_aside: float | None = None
    failure: str = ""


@dataclass(frozen=True, kw_only=True)
class PulleyStudy:
    """What beliefs cost on one move of one robot.

    Attributes:
        robot: its name.
        move: what it is called.
        distance: between start and goal, of the platform's origin [m].
        radius: of the largest pulley [m].
        gain: lambda of all runs [1/s].
        until: how long they take [s].
        cable_model: of VBC's law.
        tensions: the rule for them.
        rows: one for each belief and controller, JSC first.
    """

    robot: str
    move: str
    distance: float
    radius: float
    gain: float
    until: float
    cable_model: str
    tensions: str
    rows: tuple[BeliefCost, ...]

    def of(self, controller: str) -> dict[str, BeliefCost]:
        """Return the rows of one controller, "JSC" or "VBC", by belief.

        Args:
            controller: its name.
        """
        return {row.belief: row for row in self.rows if row.controller == controller}


def pulley_study(
    robot: CableRobot,
    start: RigidTransform | ArrayLike | None = None,
    goal: RigidTransform | ArrayLike | None = None,
    *,
    move: str = "near the middle",
    gain: float | None = None,
    until: float | None = None,
    cable_model: str = "SCMWE",
    tensions: str = DEFAULT_RULE,
    max_step: float | None = None,
    beliefs: Mapping[str, Belief] = BELIEFS,
    progress: Callable[[int, int], None] | None = None,
) -> PulleyStudy:
    """Return what beliefs of a robot's pulleys cost under JSC and VBC.

    Args:
        robot: the true robot, with its payload.
        start: X_WP, or [roll, pitch, yaw, x, y, z] (rad, m); with the goal, that of
            `move_near_the_middle` if None.
        goal: X_WP in either form.
        move: what it is called.
        gain: lambda [1/s]; the robot's own, or `analysis.default_gain` at the goal, if None.
        until: how long runs take [s]; 12 time constants of the gain, at most 400 s, if None.
        cable_model: of VBC's law; JSC's is the ECM.
        tensions: the rule for them, one of `model.statics.RULES`.
        max_step: of the integrator [s]; if None, the robot's modes decide.
        beliefs: by name; the others are compared with the first, which should be true.
        progress: called with the number of runs done and of all.

    Raises:
        RobotFileError: the robot has no pulleys.
        GeometryError, TensionError, EquilibriumError: there is no such move.
        CdprError: a run with the first belief did not come to its end.
        ValueError: a value cannot be used.
    """
    require_pulleys(robot)
    ends = move_near_the_middle(robot) if start is None or goal is None else (start, goal)
    X_start, X_goal = (as_pose(pose) for pose in ends)
    common = _common(robot, X_start, X_goal, gain, until, cable_model, tensions, max_step)
    known = {name: belief(robot, X_start) for name, belief in beliefs.items()}
    rows: list[BeliefCost] = []
    total = len(CONTROLLERS) * len(known)
    if progress is not None:
        progress(0, total)
    for controller in CONTROLLERS:
        exact: Run | None = None
        for name, believed in known.items():
            try:
                done = run(_setup(common, controller, believed, cable_model))
            except CdprError as error:
                if exact is None:
                    raise
                rows.append(BeliefCost(belief=name, controller=controller, failure=str(error)))
            else:
                exact = done if exact is None else exact
                rows.append(_cost(name, believed, done, exact))
            if progress is not None:
                progress(len(rows), total)
    return PulleyStudy(
        robot=robot.name,
        move=move,
        distance=float(np.linalg.norm(X_goal.translation() - X_start.translation())),
        radius=float(robot.pulley_radii.max()),
        gain=common["gain"],
        until=common["until"],
        cable_model=cable_model,
        tensions=tensions,
        rows=tuple(rows),
    )


def require_pulleys(robot: CableRobot) -> None:
    """Refuse a robot without pulleys.

    Args:
        robot: the robot.

    Raises:
        RobotFileError: it has none.
    """
    if not has_pulleys(robot):
        raise RobotFileError(
            f"robot {robot.name!r}", "pulleys.radius", "no cable leaves over a pulley"
        )


def _common(
    robot: CableRobot,
    start: RigidTransform,
    goal: RigidTransform,
    gain: float | None,
    until: float | None,
    cable_model: str,
    tensions: str,
    max_step: float | None,
) -> dict[str, Any]:
    """Return what the setups of all runs have in common."""
    fields = {
        "robot": robot,
        "start": start,
        "goal": goal,
        "noise": False,
        "tensions": tensions,
        "max_step": max_step,
    }
    if gain is None:
        gain = make_setup(**fields, loop=_vision(robot), cable_model=cable_model).gain
    if until is None:
        until = float(f"{min(DECAYS / gain, LONGEST):.3g}")
    return {**fields, "gain": gain, "until": until}


def _vision(robot: CableRobot) -> VisionLoop:
    cameras = robot.cameras
    return VisionLoop().replace(sample_time=cameras.sample_time, latency=cameras.latency)


def _setup(
    common: Mapping[str, Any], controller: str, believed: CableRobot, cable_model: str
) -> Setup:
    if controller == "VBC":
        loop = _vision(common["robot"]).replace(cable_model=cable_model, believed=believed)
        return make_setup(**common, loop=loop)
    where = common["robot"], common["start"], JSC_CABLE_MODEL, common["tensions"]
    zeroed = zeroed_at(believed, *where)
    return make_setup(**common, loop=JointSpaceLoop(cable_model=JSC_CABLE_MODEL, believed=zeroed))


def _cost(name: str, believed: CableRobot, done: Run, exact: Run) -> BeliefCost:
    """Return what a run tells beside the one with the true belief."""
    setup, summary = done.setup, done.summary
    apart = np.linalg.norm(_positions(done) - _positions(exact), axis=1)
    tension, right = (r.record["tension_at_drawing_point"] for r in (done, exact))
    seen: dict[str, Any] = {}
    if setup.is_vision_based:
        law: dict[str, Any] = {"cable_model": setup.loop.cable_model, "tensions": setup.tensions}
        rates = gain_matrix(setup.robot, believed, setup.goal, **law).eigenvalues.real
        aside = led_aside(done.record["pose_error"], exact.record["pose_error"])[1]
        seen = {"slowest": float(rates.min()), "fastest": float(rates.max())}
        seen["led_aside"] = 1e3 * aside
    return BeliefCost(
        belief=name,
        controller=setup.loop.controller,
        position_error=summary.position_error,
        orientation_error=summary.orientation_error,
        apart=1e3 * float(apart.max()),
        tension_change=100.0 * float(np.abs(tension / right - 1.0).max()),
        **seen,
    )


def _positions(done: Run) -> Array:
    """Return where the target frame is (n, 3) [m], in W."""
    X_PM = done.setup.robot.cameras.X_PM
    poses = (vector_to_pose(pose) @ X_PM for pose in done.record["pose"])
    return np.array([X.translation() for X in poses])
