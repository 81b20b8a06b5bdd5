"""What a run looks like: figures, block diagrams, and replays that a browser plays."""

from cdpr_drake.show.block_diagram import GraphvizError, block_diagram, block_diagram_dot
from cdpr_drake.show.plots import (
    cable_sag,
    error_norm_figure,
    motor_rate_figure,
    pose_error_figure,
    sag_figure,
    save_figures,
    tension_figure,
)
from cdpr_drake.show.replay import write_replay
from cdpr_drake.show.screenshot import BrowserError, screenshot_replay

__all__ = [
    "BrowserError",
    "GraphvizError",
    "block_diagram",
    "block_diagram_dot",
    "cable_sag",
    "error_norm_figure",
    "motor_rate_figure",
    "pose_error_figure",
    "sag_figure",
    "save_figures",
    "screenshot_replay",
    "tension_figure",
    "write_replay",
]
