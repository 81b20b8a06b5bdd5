"""Make the pictures of the README: the demo's figures and replay, the loop and its models.

    python docs/make_images.py

Needs Graphviz (dot), Chromium and EGL besides the package.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from matplotlib.figure import Figure

from cdpr_drake.__main__ import main
from cdpr_drake.analysis import compare_cable_models
from cdpr_drake.analysis.calibration_study import calibration_effect, groups_of
from cdpr_drake.diagrams import make_vision_based_control
from cdpr_drake.model.catenary import elastic_catenary
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.vision.cable_drawing import CableDrawing
from cdpr_drake.model.vision.lines import CableLines
from cdpr_drake.runs.paper_tests import paper_test
from cdpr_drake.show import (
    block_diagram,
    calibration_study_figure,
    camera_view_figure,
    rates_and_responses_figure,
    screenshot_replay,
    stereo_view_figure,
)
from cdpr_drake.show.explorer import Explorer
from cdpr_drake.show.screenshot import screenshot

IMAGES = Path(__file__).resolve().parent / "images"
FIGURES = ("pose_error.png", "error_norm.png", "tension.png", "sag.png")


def make_images() -> None:
    """Run the demo and write the pictures."""
    IMAGES.mkdir(exist_ok=True)
    block_diagram(make_vision_based_control(load_robot("cogiro")), IMAGES / "loop.png")
    comparison = compare_cable_models(["cogiro", "cogiro-98m"])
    rates_and_responses_figure(comparison).savefig(IMAGES / "rates_and_responses.png", dpi=100)
    stereo_view().savefig(IMAGES / "stereo_view.png", dpi=100)
    cogiro = load_robot("cogiro")
    start, _ = paper_test(4).poses(cogiro)
    camera_view_figure(cogiro, start).savefig(IMAGES / "camera_views.png", dpi=100)
    calibration_study(cogiro).savefig(IMAGES / "calibration_study.png", dpi=100)
    explore_picture()
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "demo"
        if main(["run", "--output", str(output)]):
            raise SystemExit("the demo failed")
        for name in FIGURES:
            shutil.copy(output / name, IMAGES / name)
        screenshot_replay(output / "replay.html", IMAGES / "replay.png", at_time=8.0)


def calibration_study(robot: CableRobot) -> Figure:
    """Return what 40 random calibrations of each kind and size do to Test 4."""
    cases = [(group, 1.0) for group in groups_of(robot)]
    cases += [("all", 3.0), ("all", 10.0), ("all", 30.0)]
    move = (robot, *paper_test(4).poses(robot))
    return calibration_study_figure([calibration_effect(*move, *c, range(40)) for c in cases])


def explore_picture() -> None:
    """Write a picture of what `cdpr-drake explore` shows, a little off the start of Test 4."""
    explorer = Explorer(load_robot("cogiro").with_payload(150.0), [0, 0, 0.35, 1.5, 0.5, 2.2])
    try:
        screenshot(explorer.address, IMAGES / "explore.png", settle=6.0, height=720)
    finally:
        explorer.close()


def stereo_view() -> Figure:
    """Return what the first stereo pair sees at the start of Test 4, and detects in it."""
    robot = load_robot("cogiro")
    X_WP, _ = paper_test(4).poses(robot)
    lengths = rest_state(robot, X_WP).unstrained_length
    ends = [X_WP @ p for p in robot.attachment_points] - robot.drawing_points
    weight, cable = robot.weight_per_metre, robot.cable
    hung = elastic_catenary(ends, lengths, weight, cable.stiffness, cable.drum_run)
    tension = hung.tension_at_drawing_point
    images = CableDrawing(robot)(hung.tangent_at_drawing_point, tension, seed=1)
    edges = CableLines(robot)(images, tension, X_WP)
    return stereo_view_figure(images[0], {n: edges[n - 1] for n in (1, 2)})


if __name__ == "__main__":
    make_images()
