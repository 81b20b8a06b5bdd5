"""Questions asked of a robot at a pose: modes, gain matrix, gain limits, what suits it."""

from cdpr_drake.analysis.compare import (
    Comparison,
    ModelComparison,
    comparable_pose,
    compare_cable_models,
)
from cdpr_drake.analysis.default_gain import DefaultGain, default_gain, lowest_gain
from cdpr_drake.analysis.explore import Snapshot, explore_pose
from cdpr_drake.analysis.gain_matrix import (
    GainMap,
    GainMatrix,
    gain_matrix,
    map_gain_matrix,
    target_twist,
)
from cdpr_drake.analysis.home import is_wrench_feasible, level_workspace, middle_of_workspace
from cdpr_drake.analysis.neutral import (
    NeutralDirections,
    internal_tension,
    internal_tension_drift,
    neutral_directions,
)
from cdpr_drake.analysis.platform_modes import platform_modes
from cdpr_drake.analysis.stability import (
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
from cdpr_drake.analysis.step_size import StepLimit, StepWarning, step_error, step_limit

__all__ = [
    "Comparison",
    "DefaultGain",
    "GainBand",
    "GainLimit",
    "GainMap",
    "GainMatrix",
    "ModelComparison",
    "NeutralDirections",
    "SampledServo",
    "Snapshot",
    "StabilityMap",
    "StabilityWarning",
    "StepLimit",
    "StepWarning",
    "comparable_pose",
    "compare_cable_models",
    "default_gain",
    "explore_pose",
    "gain_limit",
    "gain_limit_band",
    "gain_matrix",
    "internal_tension",
    "internal_tension_drift",
    "is_wrench_feasible",
    "level_workspace",
    "lowest_gain",
    "map_gain_matrix",
    "middle_of_workspace",
    "neutral_directions",
    "platform_modes",
    "stability_map",
    "step_error",
    "step_limit",
    "target_twist",
    "warn_if_unstable",
]
