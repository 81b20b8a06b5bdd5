"""What a run looks like: figures, block diagrams, and replays that a browser plays."""

from cdpr_drake.show import style
from cdpr_drake.show.block_diagram import GraphvizError, block_diagram, block_diagram_dot
from cdpr_drake.show.calibration_plots import calibration_figure
from cdpr_drake.show.camera_views import camera_view_figure
from cdpr_drake.show.mode_plots import mode_shape_figure, pole_figure, stability_figure
from cdpr_drake.show.plots import (
    cable_sag,
    error_norm_figure,
    motor_rate_figure,
    number_cables,
    pose_error_figure,
    sag_figure,
    save_figures,
    tension_figure,
)
from cdpr_drake.show.pulley_plots import pulley_figure
from cdpr_drake.show.replay import write_replay
from cdpr_drake.show.screenshot import BrowserError, screenshot_replay
from cdpr_drake.show.sensor_plots import ablation_figure, calibration_study_figure
from cdpr_drake.show.stereo_views import stereo_view_figure
from cdpr_drake.show.study_plots import gain_map_figure, rates_and_responses_figure

__all__ = [
    "BrowserError",
    "GraphvizError",
    "ablation_figure",
    "block_diagram",
    "block_diagram_dot",
    "cable_sag",
    "calibration_figure",
    "calibration_study_figure",
    "camera_view_figure",
    "error_norm_figure",
    "gain_map_figure",
    "mode_shape_figure",
    "motor_rate_figure",
    "number_cables",
    "pole_figure",
    "pose_error_figure",
    "pulley_figure",
    "rates_and_responses_figure",
    "sag_figure",
    "save_figures",
    "screenshot_replay",
    "stability_figure",
    "stereo_view_figure",
    "style",
    "tension_figure",
    "write_replay",
]
