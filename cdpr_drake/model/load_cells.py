"""Which load cells can be believed: dead and stuck ones told from light cables, by the balance.

What a control law must not do is to take a taut cable for a slack one: it would reel in much more
of it and tear it. So a reading is compared with what the other cells, the measured pose and the
known weight let expect of it. With the wrenches W (6, k) of unit tensions along the chords, the
tensions c (k,) along them that the cells read, the weight's wrench w (A.2), and the trust in each
cell as the weights of least squares, D = diag(1 / trust),

    expected_i = c_i - z_i / g_i,   z = W^T G^-1 (W c - w),   g_i = W_i^T G^-1 W_i,   G = W D W^T

is the tension of cable i that balances the readings of the others best: it does not depend on the
cell's own reading, and takes any internal tension. With six cables or fewer it comes from the
weight alone.

* A cell is *dead* as far as its reading is low, below `HIGH` (fully below `LOW`) times the cables'
  min_tension, and as far as the expectation exceeds it by more than is tolerated: `DEVIATIONS`
  standard deviations of the difference, which the cells' noise causes, and what an error of the
  weight by `LOAD` does to the expectation.
* A cell is *stuck* if its reading stays the same within `STILL` while its expectation moves by more
  than the noise causes. This takes a memory: see `CellJudge.remember`.
* The tension for the law goes over from the reading to the expectation as far as the cell is dead
  or stuck, and never falls below `FLOOR` times w Bx, where the cable sags by a sixteenth of its
  span, or `LOW` min_tension if that is less: below that the rates that the law asks for grow with
  the third power of 1 / T. All of this is continuous in each reading, and a trusted reading above
  that floor is not changed at all.

A low reading counts little, a stuck cell's next to nothing, in what is expected of others, so that
one failing cell does not condemn the next.

The rule can be fooled. It cannot tell a dead cell of a cable of which no more is expected than is
tolerated: that cell reads as a light cable does, and the law gets the floor. A light cable is taken
for a dead cell if the weight is less than believed by more than `LOAD`, if something pushes or
pulls on the platform, or if another cell is wrong without being low or stuck, as one with a wrong
gain or bias is. A cell that is stuck is not found as long as what is expected of it does not move,
nor is one that still jitters. Where most cells fail at once the least-norm tensions of the weight
decide.
"""

from __future__ import annotations

import math

import numpy as np

from cdpr_drake.model.arrays import RobotArrays
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array

LIVE, DEAD, STUCK = 0.0, 1.0, 2.0
"""What a cell is judged to be."""

LOW, HIGH = 0.5, 1.0
"""Readings below LOW min_tension may be those of dead cells, those above HIGH are not [-]."""

DEVIATIONS = 5.0
"""Standard deviations by which a reading may fall short of its expectation [-]."""

LOAD = 0.2
"""Part of the weight by which it may be wrong [-]."""

RISE = 0.5
"""A reading that falls short is not believed any more at 1 + RISE times what is tolerated [-]."""

TRUST = 0.02
"""Least weight of a cell's reading in what is expected of others [-]."""

FLOOR = 2.0
"""Least tension for the law, over the weight of the cable's horizontal span, if that is less than
LOW min_tension, which is the least otherwise [-]."""

STILL = 1e-4
"""A reading that changes by less than this part of min_tension stays the same [-]."""

HANDOVER = 0.5
"""Time over which a stuck cell's reading is replaced, or a recovered one's taken again [s]."""

ZERO = 0.1
"""A cell that stays below this part of min_tension is called dead rather than stuck [-]."""


def reading_deviation(robot: CableRobot) -> float:
    """Return the standard deviation [N] of a filtered reading, at least 1 % of min_tension.

    White noise held over the cameras' period passes a first-order filter, vibration passes as it
    is: more filters, or shorter samples, leave less.

    Args:
        robot: the robot as the controller believes it.
    """
    cells = robot.load_cells
    kept = np.exp(-2.0 * np.pi * cells.cutoff * robot.cameras.sample_time)
    noise = cells.noise / cells.gain.min() * np.sqrt((1.0 - kept) / (1.0 + kept))
    deviation = np.hypot(noise, cells.vibration_amplitude / np.sqrt(2.0))
    return float(max(deviation, 0.01 * robot.cable.min_tension))


class CellJudge:
    """What a robot's balance says of its load cells, ready to be evaluated.

    The input z (6 + 2 k,) is [pose [roll, pitch, yaw, x, y, z] (6) (rad, m) of X_WP; readings at
    the drawing points (k) [N]; how far each cell is known to be stuck (k), 0 to 1]. The output
    (4, k) is [plausible tensions [N]; expectations [N]; how far each cell is dead, 0 to 1; noise
    tolerated of the difference between reading and expectation [N]].

    What is remembered of the cells (3 k,) is [reading when it last changed (k) [N]; what was
    expected then (k) [N]; how far the cell is stuck (k), 0 to 1].

    Args:
        robot: the robot as the controller believes it.
        sample_time: time between two updates of the memory [s], if there are any.
    """

    def __init__(self, robot: CableRobot, sample_time: float = HANDOVER) -> None:
        from cdpr_drake.model.kernels import load_cell as kernel

        self.robot, self._kernel = robot, kernel
        least, self._k = robot.cable.min_tension, robot.num_cables
        radius = float(np.linalg.norm(robot.attachment_points, axis=1).max())
        rules = [LOW * least, HIGH * least, robot.cable.max_tension]
        rules += [DEVIATIONS * reading_deviation(robot), LOAD, TRUST, FLOOR, radius or 1.0, RISE]
        rules += [STILL * least, 1.0 / math.ceil(HANDOVER / sample_time)]
        arrays = RobotArrays(robot)
        self._arrays = (arrays.points, arrays.body, np.array(rules))
        self.healthy = np.zeros(3 * self._k)

    def __call__(self, z: Array) -> Array:
        """Return the output (4, k) for the input `z` (6 + 2 k,)."""
        out = np.zeros((4, self._k))
        self._kernel.judge_readings(z, *self._arrays, out)
        return out

    def with_jacobian(self, z: Array) -> tuple[Array, Array]:
        """Return the output and its Jacobian (4, k, 6 + 2 k) for the input `z` (6 + 2 k,)."""
        out = np.zeros((4, self._k))
        jacobian = np.zeros((*out.shape, z.size))
        self._kernel.judge_readings_jacobian(z, *self._arrays, out, jacobian)
        return out, jacobian

    def plausible(self, pose: Array, reading: Array, memory: Array) -> Array:
        """Return the tensions (k,) [N] for the law.

        Args:
            pose: [roll, pitch, yaw, x, y, z] (rad, m) of X_WP, as measured.
            reading: (k,) [N] at the drawing points.
            memory: (3 k,); `healthy`, if nothing is remembered.
        """
        out = np.empty(self._k)
        self._kernel.plausible_tension(pose, reading, memory, *self._arrays, out)
        return out

    def remember(self, pose: Array, reading: Array, memory: Array, after: Array) -> None:
        """Write what is remembered of the cells a frame later.

        A cell is on its way to being stuck while its reading is the same and its expectation is
        away from what it was then by more than the noise tolerated; once half stuck it stays so
        until its reading changes. Each frame makes one step on that way, so that a short
        disturbance of the expectation does no harm.

        Args:
            pose: [roll, pitch, yaw, x, y, z] (rad, m) of X_WP, as measured.
            reading: (k,) [N] at the drawing points.
            memory: (3 k,) before.
            after: (3 k,) result; may be `memory` itself.
        """
        self._kernel.remember(pose, reading, memory, *self._arrays, after)

    def health(self, pose: Array, reading: Array, memory: Array) -> Array:
        """Return what each cell is (k,): `LIVE`, `DEAD` or `STUCK`.

        Args:
            pose: [roll, pitch, yaw, x, y, z] (rad, m) of X_WP, as measured.
            reading: (k,) [N] at the drawing points.
            memory: (3 k,).
        """
        stuck = memory[2 * self._k :]
        judged = self(np.concatenate([pose, reading, stuck]))
        still = (stuck > 0.5) & (np.abs(reading) > ZERO * self.robot.cable.min_tension)
        dead = (judged[2] > 0.5) | (stuck > 0.5)
        return np.where(still, STUCK, np.where(dead, DEAD, LIVE))
