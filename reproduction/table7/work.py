"""Table 7 and Fig. 16: 20 m across a room of 75 x 98 x 38.9 m with four cable models."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.model.rotations import Array, as_pose
from cdpr_drake.study import excursion
from reproduction.assumptions import assumed, assumptions
from reproduction.table7.drag import run_with_drag, what_it_takes
from reproduction.table7.large_robot import GOAL, MODELS, printed_errors, setup_of_move, true_robot
from reproduction.section import Case, Result
from reproduction.table7.claims import ALONG, FAST_RAMP
from reproduction.table7.section import section
from reproduction.table7.variations import slow_errors, variations, vary

__all__ = ["cases", "fit", "move", "name", "section"]

name = "table7"

COARSE = {"linear_density": 0.065, "platform_scale": 1.01, "gain": 0.0594, "target_angle": 0.1}
"""Where the fit starts: CoGiRo's cable and platform, the gain that Table 7 implies, 0.1 degrees."""


def cases() -> Sequence[Case]:
    """Return four simulations, four that start fast, the fit, variations, and places on the way."""
    moves = [Case(key=f"move_{m}", function=move, arguments={"cable_model": m}) for m in MODELS]
    fast = [
        Case(key=f"fast_{m}", function=move, arguments={"cable_model": m, "ramp_time": FAST_RAMP})
        for m in MODELS
    ]
    varied = [Case(key=f"vary_{k}", function=vary, arguments={"key": k}) for k in variations()]
    stable = [Case(key=f"stable_{x}", function=stability, arguments={"x": float(x)}) for x in ALONG]
    return [*moves, *fast, Case(key="fit", function=fit), *varied, *stable]


def stability(x: float) -> Result:
    """Return how unstable the loop is at a goal on the way, and what would keep it stable.

    Args:
        x: of the goal [m], which is level with START and GOAL.
    """
    values = assumed(name)
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
    values = assumed(name)
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

    given, values = assumptions(name), assumed(name)
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
