"""Make the pictures of the README: the demo's figures and replay, the loop's blocks, the models.

    python docs/make_images.py

Needs Graphviz (dot) and Chromium besides the package.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from cdpr_drake.__main__ import main
from cdpr_drake.diagrams import make_vision_based_control
from cdpr_drake.model.robot import load_robot
from cdpr_drake.show import block_diagram, rates_and_responses_figure, screenshot_replay
from cdpr_drake.study import compare_cable_models

IMAGES = Path(__file__).resolve().parent / "images"
FIGURES = ("pose_error.png", "error_norm.png", "tension.png", "sag.png")


def make_images() -> None:
    """Run the demo and write the pictures."""
    IMAGES.mkdir(exist_ok=True)
    block_diagram(make_vision_based_control(load_robot("cogiro")), IMAGES / "loop.png")
    comparison = compare_cable_models(["cogiro", "cogiro-98m"])
    rates_and_responses_figure(comparison).savefig(IMAGES / "rates_and_responses.png", dpi=100)
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "demo"
        if main(["run", "--output", str(output)]):
            raise SystemExit("the demo failed")
        for name in FIGURES:
            shutil.copy(output / name, IMAGES / name)
        screenshot_replay(output / "replay.html", IMAGES / "replay.png", at_time=8.0)


if __name__ == "__main__":
    make_images()
