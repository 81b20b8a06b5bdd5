"""When a run has converged, and how sure a median of such times is."""

from __future__ import annotations

import math

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.model.camera import true_from_seen
from cdpr_drake.model.rotations import Array, as_pose
from cdpr_drake.model.servo import pose_error
from cdpr_drake.runs import Run


def noiseless_error(done: Run) -> Array:
    """Return s = [s_w; s_t] (n, 6) (rad, m) as the controller would see it without noise.

    Args:
        done: a run under vision-based control.
    """
    setup = done.setup
    believed = setup.loop.believed if setup.loop.believed is not None else setup.robot
    errors = []
    for pose in done.record["pose"]:
        seen = true_from_seen(believed, setup.robot, as_pose(pose))
        errors.append(pose_error(RigidTransform(seen), setup.goal, believed.cameras.X_PM))
    return np.array(errors)


def crossing_time(time: Array, size: Array, level: float) -> float:
    """Return when a size last comes down to a level, by interpolation [s]; infinite if it does not.

    Args:
        time: (n,) [s].
        size: (n,) not negative.
        level: of the same unit.
    """
    above = np.flatnonzero(size > level)
    if above.size == 0:
        return float(time[0])
    i = int(above[-1])
    if i == size.size - 1:
        return math.inf
    share = (size[i] - level) / (size[i] - size[i + 1])
    return float(time[i] + share * (time[i + 1] - time[i]))


def median_interval(values: Array, confidence: float = 0.95) -> tuple[float, float, float]:
    """Return median, and bounds that hold the true one with at least a confidence.

    Order statistics, whatever the distribution: of n values as many are below the true median as
    heads come up in n throws of a coin.

    Args:
        values: (n,).
        confidence: from 0 to below 1.

    Raises:
        ValueError: too few values for that confidence.
    """
    ordered = np.sort(np.asarray(values, float))
    n = ordered.size
    outside, below = 0.0, 0
    while True:
        outside += math.comb(n, below) / 2.0**n
        if 2.0 * outside > 1.0 - confidence:
            break
        below += 1
    if below == 0:
        raise ValueError(f"{n} values are too few for an interval of {confidence:.0%}")
    return float(np.median(ordered)), float(ordered[below - 1]), float(ordered[n - below])
