"""Questions asked of any diagram: rests, linear models, modes, responses."""

import importlib
from typing import Any

from cdpr_drake.study.equilibrium import Residuals, equilibrium, residuals, true_pose
from cdpr_drake.study.growth import SimulatedMode, simulate_modes
from cdpr_drake.study.linear import LinearizationWarning, Linearizer, linearize
from cdpr_drake.study.modes import Mode, Modes, modes
from cdpr_drake.study.response import (
    ResponseMetrics,
    excursion,
    initial_response,
    pose_error_response,
    record_metrics,
    response_metrics,
    side_by_side,
    step_response,
)
from cdpr_drake.study.sampled import OnePeriodMap, one_period_map, simulated_period_map
from cdpr_drake.study.state_space import StateSpace

__all__ = [
    "LinearizationWarning",
    "Linearizer",
    "Mode",
    "Modes",
    "OnePeriodMap",
    "Residuals",
    "ResponseMetrics",
    "SimulatedMode",
    "StateSpace",
    "equilibrium",
    "excursion",
    "initial_response",
    "linearize",
    "modes",
    "one_period_map",
    "pose_error_response",
    "record_metrics",
    "residuals",
    "response_metrics",
    "side_by_side",
    "simulate_modes",
    "simulated_period_map",
    "step_response",
    "true_pose",
]


def __getattr__(name: str) -> Any:
    """Offer two questions of a robot at a pose here too, by `name`, as users look for them here."""
    if name in ("gain_limit", "gain_matrix"):
        return getattr(importlib.import_module("cdpr_drake.analysis"), name)
    raise AttributeError(f"module 'cdpr_drake.study' has no attribute '{name}'")
