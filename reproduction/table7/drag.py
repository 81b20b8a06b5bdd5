"""Drag on the platform: the damping that the large robot lacks under vision-based control.

An undamped mode of the platform grows under the law of eq. (19), by a factor e in about 2 / lambda:
the winches move at lambda times an error that the mode carries. Stretch of the cables damps modes
that stretch them; where sagging cables give way by their sag hardly anything does.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from cdpr_drake import CableRobot
from cdpr_drake.analysis import SampledServo
from cdpr_drake.diagrams import Record, rest_context, simulate
from cdpr_drake.model.rest_model import mass_matrix
from cdpr_drake.model.rotations import pose_to_vector, vector_to_pose
from cdpr_drake.runs import RECORD_PERIOD, Setup

SCANNED = 13
"""Number of values over three decades at which stability is looked at."""


class PlatformDrag(LeafSystem):
    """A wrench that slows the platform down, in proportion to its momentum.

    .. pydrake_system::

        name: PlatformDrag
        input_ports:
        - platform_state
        output_ports:
        - wrench

    wrench = - drag M [omega; v], with the mass matrix M of platform and payload at the
    platform's origin: it damps each mode that moves the platform alone by drag / 2.

    Args:
        robot: the true robot.
        drag: [1/s].
    """

    def __init__(self, robot: CableRobot, drag: float) -> None:
        super().__init__()
        self.robot, self.drag = robot, drag
        self._state_port = self.DeclareVectorInputPort("platform_state", 12)
        self.DeclareVectorOutputPort("wrench", 6, self._calc)

    def _calc(self, context: Context, output: BasicVector) -> None:
        state = self._state_port.Eval(context)
        mass = mass_matrix(self.robot, vector_to_pose(state[:6]).rotation().matrix())
        output.SetFromVector(-self.drag * mass @ state[6:])


def run_with_drag(setup: Setup, drag: float) -> Record:
    """Return the record of a vision-based run with drag on the platform.

    Args:
        setup: the run, without noise.
        drag: [1/s].
    """
    part = partial(PlatformDrag, drag=drag)
    loop = setup.loop.make(setup.robot, parts=(part,), fast=True)
    context = rest_context(loop, setup.start, setup.tensions)
    loop.GetInputPort("desired_pose").FixValue(context, pose_to_vector(setup.goal))
    return simulate(loop, context, setup.until, every=RECORD_PERIOD, max_step=setup.max_step)


def what_it_takes(robot: CableRobot, pose: RigidTransform, gain: float) -> dict[str, float]:
    """Return what keeps the sampled loop stable at a goal, and how unstable it is without drag.

    The result holds growth [1/s] of the fastest growing mode without drag, its frequency [Hz], the
    least drag [1/s] with which none grows, the damping [-] that gives that mode by itself, and the
    least damping_time [s] of the cables that would do in its place, infinite above 10 s.

    Args:
        robot: the robot, which believes itself.
        pose: X_WP of the goal.
        gain: lambda [1/s].
    """
    cameras = robot.cameras

    def grows(damping_time: float, drag: float) -> complex:
        damped = robot.replace(cable=robot.cable.replace(damping_time=damping_time))
        servo = SampledServo(damped, pose, cameras.sample_time, drag=drag)
        return servo.growth(gain, cameras.latency)

    own = robot.cable.damping_time
    without = grows(own, 0.0)
    drag = _least(lambda d: grows(own, d).real, 1.0)
    return {
        "growth": without.real,
        "frequency": abs(without) / (2.0 * math.pi),
        "drag": drag,
        "damping": 0.5 * drag / abs(without),
        "damping_time": _least(lambda t: grows(t, 0.0).real, 10.0),
    }


def _least(growth: Callable[[float], float], highest: float) -> float:
    """Return the least value with which nothing grows, to 0.1 %; infinite above the `highest`.

    Values over three decades are looked at: growth has to end there once and for all.
    """
    grows = [growth(value) > 0.0 for value in np.geomspace(1e-3 * highest, highest, SCANNED)]
    if grows != sorted(grows, reverse=True):
        raise ArithmeticError("stable and unstable values alternate: there is no least one")
    if grows[-1]:
        return math.inf
    low, high = 0.0, highest
    while high - low > 1e-3 * high:
        middle = 0.5 * (low + high)
        if growth(middle) > 0.0:
            low = middle
        else:
            high = middle
    return high
