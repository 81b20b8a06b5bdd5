"""The work behind Table 7 and Fig. 16: simulations of the move, and a fit without dynamics."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.model.rotations import Array, as_pose
from cdpr_drake.study import excursion
from reproduction.assumptions import assumed, assumptions
from reproduction.section import Result
from reproduction.table7.drag import run_with_drag, what_it_takes
from reproduction.table7.large_robot import GOAL, printed_errors, setup_of_move, true_robot
from reproduction.table7.variations import slow_errors

COARSE = {"linear_density": 0.065, "platform_scale": 1.01, "gain": 0.0594, "target_angle": 0.1}
"""Where the fit starts: CoGiRo's cable and platform, the gain that Table 7 implies, 0.1 degrees."""


def stability(x: float) -> Result:
    """Return how unstable the loop is at a goal on the way, and what would keep it stable.

    Args:
        x: of the goal [m], which is level with START and GOAL.
    """
    values = assumed("table7")
    return what_it_takes(true_robot(values), RigidTransform([x, 0.0, 0.0]), values["gain"])


def move(cable_model: str, ramp_time: float | None = None) -> Result:
    """Simulate the 20 m move with all dynamics, and with drag, without which it is unstable.

    The record has n lines, every 0.25 s.

    The result holds time (n,) [s]; position_error (n, 3) [m], wanted minus true place of the target
    frame's origin in W; orientation_error (n, 3) [rad], the rotation vector s_w of the true error;
    orientation_error_seen, as the controller sees it; velocity (n, 3) [m/s] of that origin in W;
    tension (n, 8) [N] at the drawing points; orientation_excursion [rad].

    Args:
        cable_model: the controller's.
        ramp_time: in place of that assumed [s].
    """
    values = assumed("table7")
    if ramp_time is not None:
        values["ramp_time"] = ramp_time
    setup = setup_of_move(values, cable_model)
    record = run_with_drag(setup, values["drag"])
    X_PM = setup.robot.cameras.X_PM
    places = np.array([(as_pose(pose) @ X_PM).translation() for pose in record["pose"]])
    velocity = np.gradient(places, record.time, axis=0)
    seen = record["pose_error_seen"]
    some = slice(None, None, 5)
    return {
        "time": record.time[some],
        "position_error": ((GOAL @ X_PM).translation() - places)[some],
        "orientation_error": record["pose_error"][some, :3],
        "orientation_error_seen": seen[some, :3],
        "velocity": velocity[some],
        "tension": record["tension_at_drawing_point"][some],
        "orientation_excursion": excursion(seen)[1],
    }


def fit() -> Result:
    """Fit the four numbers of `COARSE` to the eight final errors, without dynamics.

    Least squares of the logarithms of ours over printed.
    """
    from scipy.optimize import least_squares

    given, values = assumptions("table7"), assumed("table7")
    low, high = (np.log([getattr(given[n], end) + 1e-3 for n in COARSE]) for end in ("low", "high"))
    theirs = printed_errors()

    def misfit(logs: Array) -> Array:
        changed = values | dict(zip(COARSE, np.exp(logs).tolist(), strict=True))
        return np.log(slow_errors(changed) / theirs).ravel()

    start = np.log(list(COARSE.values()))
    found = least_squares(
        misfit, start, bounds=(low, high), diff_step=0.01, x_scale=[0.2, 0.3, 0.02, 0.3],
        max_nfev=8, xtol=1e-3, ftol=1e-3,
    )  # fmt: skip
    return {
        "values": dict(zip(COARSE, np.exp(found.x).tolist(), strict=True)),
        "errors": np.exp(found.fun).reshape(theirs.shape) * theirs,
    }
