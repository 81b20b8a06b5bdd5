"""What stretches and bends when a robot is loaded, and the error it leaves in joint space control.

At rest the winches' integral action has brought the motors to their angles, so the lengths are
those that the inverse kinematics asked for, and the end of a joint space move is a matter of
statics: no run is needed to find it.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake import CableRobot
from cdpr_drake.model.equilibrium import RestState, forward_kinematics
from cdpr_drake.model.inverse_kinematics import InverseKinematics
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.robot import AxialStiffness
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.statics import MINIMUM_NORM
from cdpr_drake.runs import Setup, setup_of_test
from cdpr_drake.systems import ExponentialApproach

GIGA = 1e9
MM_PER_KN = 1e-6
LAST_PART = 0.02
"""The share of a move over which the cables' last direction is judged."""


@dataclass(frozen=True, kw_only=True)
class Structure:
    """What a robot's true lengths and points may differ in from those its controller believes.

    Args:
        modulus: Young's modulus of the cables at high tension [GPa].
        slack_modulus: that at no tension [GPa]; None if it is the same.
        half_tension: tension at which the modulus is half-way between the two [N].
        drum_run: whether the run from drum to eyelet stretches.
        zero_offset: cables are longer than their encoders say by this [m].
        friction: capstan exponent mu theta of the eyelets [-]: the run bears the tension at the
            drawing point times exp(mu theta) where the cable came to rest reeling in, divided by
            it where it was paid out.
        post_compliance: of a post's top, horizontal, under the two cables there [mm/kN].
    """

    modulus: float
    slack_modulus: float | None = None
    half_tension: float = 0.0
    drum_run: bool = True
    zero_offset: float = 0.0
    friction: float = 0.0
    post_compliance: float = 0.0

    def robot(self, nominal: CableRobot) -> CableRobot:
        """Return a robot with these cables: modulus and run, all that a simulation can take.

        Args:
            nominal: the robot otherwise.
        """
        cable = nominal.cable
        EA = GIGA * self.modulus * cable.section
        stiffness = AxialStiffness(asymptote=EA)
        if self.slack_modulus is not None:
            slack = GIGA * self.slack_modulus * cable.section
            softening = (EA - slack) * self.half_tension
            stiffness = AxialStiffness(asymptote=EA, softening=softening, offset=self.half_tension)
        run = cable.drum_run if self.drum_run else np.zeros(nominal.num_cables)
        return nominal.replace(cable=cable.replace(stiffness=stiffness, drum_run=run))


def joint_space_rest(
    structure: Structure, believed: CableRobot, goal: RigidTransform, direction: Array
) -> RestState:
    """Return where joint space control brings the platform: the rest on the lengths asked for.

    Args:
        structure: what is true.
        believed: the robot as its controller knows it.
        goal: X_WP asked for.
        direction: (k,) sign of each cable's last motion, +1 where it was paid out.
    """
    robot = structure.robot(believed)
    cable = robot.cable
    asked = InverseKinematics(believed, rule=MINIMUM_NORM).lengths(goal) - believed.cable.drum_run
    length = asked + cable.drum_run + structure.zero_offset
    if structure.friction:
        # A run that bears c T stretches, to first order in T / EA, like one c times as long.
        longer = cable.drum_run * np.expm1(-structure.friction * direction)
        robot = robot.replace(cable=cable.replace(drum_run=cable.drum_run + longer))
        length = length + longer
    rest = forward_kinematics(robot, length, goal)
    if not structure.post_compliance:
        return rest
    for _ in range(20):
        deflection = MM_PER_KN * structure.post_compliance * _pull_on_posts(robot, rest)
        points = believed.drawing_points + deflection
        moved = np.abs(robot.drawing_points - points).max()
        robot = robot.replace(drawing_points=points)
        rest = forward_kinematics(robot, length, rest.X_WP)
        if moved < 3e-6:
            return rest
    raise ArithmeticError("the posts' deflection did not converge")


def _pull_on_posts(robot: CableRobot, rest: RestState) -> Array:
    """Return the horizontal pull (k, 3) [N] on each cable's post; two in succession share one."""
    pull = rest.chord_tension[:, None] * cable_geometry(robot, rest.X_WP).u
    pull[:, 2] = 0.0
    return np.repeat(pull.reshape(-1, 2, 3).sum(axis=1), 2, axis=0)


def last_direction(setup: Setup) -> Array:
    """Return (k,): +1 for each cable that is paid out at the end of a move, -1 if it is reeled in.

    Args:
        setup: the move, on the path of the ideal law.
    """
    path = ExponentialApproach(setup.robot, setup.start, setup.goal, setup.gain, 0.0)
    context = path.CreateDefaultContext()
    context.SetTime(-np.log(LAST_PART) / setup.gain)
    inverse = InverseKinematics(setup.robot, rule=MINIMUM_NORM)
    before = inverse.lengths(path.GetOutputPort("desired_pose").Eval(context))
    return np.sign(inverse.lengths(setup.goal) - before)


@dataclass(frozen=True, kw_only=True, eq=False)
class EndError:
    """The true pose at the end of a move minus the desired one.

    Attributes:
        position: (3,) of E in W [mm].
        orientation: (3,) [deg], X-Y-Z angles of the true platform in the desired one's frame
            turned parallel to W; so small that the convention does not matter.
    """

    position: Array
    orientation: Array

    @property
    def flat(self) -> Array:
        """Position [mm] and orientation [deg] in one (6,)."""
        return np.concatenate([self.position, self.orientation])


def joint_space_end(
    structure: Structure,
    number: int,
    *,
    payload: float | None = None,
    shift: ArrayLike = (0.0, 0.0, 0.0),
) -> EndError:
    """Return the end of one of the paper's tests under joint space control.

    Args:
        structure: what is true.
        number: of the test.
        payload: in place of the test's own [kg].
        shift: of the goal in W (3,) [m].
    """
    setup, direction = _move(number)
    robot, goal = setup.robot, setup.goal
    if payload is not None:
        robot = robot.with_payload(payload)
    goal = RigidTransform(goal.rotation(), goal.translation() + np.asarray(shift, float))
    rest = joint_space_rest(structure, robot, goal, direction)
    return end_error(rest.X_WP, goal)


@functools.cache
def _move(number: int) -> tuple[Setup, Array]:
    setup = setup_of_test(number)
    return setup, last_direction(setup)


def end_error(true: RigidTransform, desired: RigidTransform) -> EndError:
    """Return how far the platform is from where it should be.

    Args:
        true: X_WP.
        desired: X_WP.
    """
    turn = true.rotation() @ desired.rotation().inverse()
    return EndError(
        position=1e3 * (true.translation() - desired.translation()),
        orientation=np.degrees(turn.ToRollPitchYaw().vector()),
    )
