"""Questions asked of any diagram: rests, linear models, modes, gain matrices, gain limits."""

from cdpr_drake.study.compare import (
    Comparison,
    ModelComparison,
    comparable_pose,
    compare_cable_models,
)
from cdpr_drake.study.default_gain import DefaultGain, default_gain, lowest_gain
from cdpr_drake.study.equilibrium import Residuals, equilibrium, residuals, true_pose
from cdpr_drake.study.explore import Snapshot, explore_pose
from cdpr_drake.study.gain_matrix import GainMap, GainMatrix, gain_matrix, map_gain_matrix
from cdpr_drake.study.growth import SimulatedMode, simulate_modes
from cdpr_drake.study.linear import LinearizationWarning, Linearizer, linearize
from cdpr_drake.study.modes import Mode, Modes, modes, platform_modes
from cdpr_drake.study.neutral import (
    NeutralDirections,
    internal_tension,
    internal_tension_drift,
    neutral_directions,
)
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
from cdpr_drake.study.stability import (
    GainBand,
    GainLimit,
    SampledServo,
    StabilityMap,
    StabilityWarning,
    gain_limit,
    gain_limit_band,
    stability_map,
    warn_if_unstable,
)
from cdpr_drake.study.state_space import StateSpace
from cdpr_drake.study.step_size import StepLimit, StepWarning, step_error, step_limit
from cdpr_drake.study.sweep import Outcome, Sweep, sweep

__all__ = [
    "Comparison",
    "DefaultGain",
    "GainBand",
    "GainLimit",
    "GainMap",
    "GainMatrix",
    "LinearizationWarning",
    "Linearizer",
    "Mode",
    "ModelComparison",
    "Modes",
    "NeutralDirections",
    "OnePeriodMap",
    "Outcome",
    "Residuals",
    "ResponseMetrics",
    "SampledServo",
    "SimulatedMode",
    "Snapshot",
    "StabilityMap",
    "StabilityWarning",
    "StateSpace",
    "StepLimit",
    "StepWarning",
    "Sweep",
    "comparable_pose",
    "compare_cable_models",
    "default_gain",
    "equilibrium",
    "excursion",
    "explore_pose",
    "gain_limit",
    "gain_limit_band",
    "gain_matrix",
    "initial_response",
    "internal_tension",
    "internal_tension_drift",
    "linearize",
    "lowest_gain",
    "map_gain_matrix",
    "modes",
    "neutral_directions",
    "one_period_map",
    "platform_modes",
    "pose_error_response",
    "record_metrics",
    "residuals",
    "response_metrics",
    "side_by_side",
    "simulate_modes",
    "simulated_period_map",
    "stability_map",
    "step_error",
    "step_limit",
    "step_response",
    "sweep",
    "true_pose",
    "warn_if_unstable",
]
