"""One frame of the vision loop, from targets and cable edges in pixels to motor rates.

The parts: the pose from targets (joint, from the pose a frame ago or afresh, and the paper's mean),
the tangents from edges, and the control law; then the whole frame, beside the 40 ms that images and
control took in the paper (section 6.2). Projection and noise, the simulation's own part, are timed
apart.

    python -m benchmarks vision [--rounds 300]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import numpy as np

from benchmarks.harness import Contestant, Report, Spread, interleave, positive, run
from cdpr_drake.model.catenary import elastic_catenary
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.robot import load_robot
from cdpr_drake.model.rotations import pose_to_vector
from cdpr_drake.model.servo import MotorRateLaw, ServoSettings
from cdpr_drake.model.vision.pose import PoseEstimator
from cdpr_drake.model.vision.tangents import CableImages, TangentEstimator
from cdpr_drake.model.vision.targets import TargetImages
from cdpr_drake.runs.paper_tests import paper_test

LIMIT = 3.0  # ms, from targets to motor rates
PAPER = 40.0  # ms


def measure(report: Report, options: argparse.Namespace) -> None:
    """Fill the report."""
    robot = load_robot("cogiro")
    X_WP, goal = paper_test(4).poses(robot)
    rest = rest_state(robot, X_WP)
    ends = np.array([X_WP @ p for p in robot.attachment_points]) - robot.drawing_points
    cables = elastic_catenary(
        ends,
        rest.unstrained_length,
        robot.weight_per_metre,
        robot.cable.stiffness,
        robot.cable.drum_run,
    )
    u, T = cables.tangent_at_drawing_point, cables.tension_at_drawing_point
    targets, edges = TargetImages(robot), CableImages(robot)
    joint, mean = PoseEstimator(robot), PoseEstimator(robot, "mean")
    tangents = TangentEstimator(robot)
    law = MotorRateLaw(robot, ServoSettings(gain=0.1))
    generator = np.random.default_rng(0)
    target_noise = generator.standard_normal(targets.noise_size)
    edge_noise = generator.standard_normal(edges.noise_size)
    seen, lines = targets(X_WP, target_noise), edges(u, T, edge_noise)
    prior = joint(seen).X_WP

    def rates(X, directions):
        pose = pose_to_vector(X)
        z = [pose, pose_to_vector(goal), np.zeros(6), T, directions.ravel()]
        return law(np.concatenate(z), 0.1)

    def frame(estimator, prior):
        X = estimator(seen, prior).X_WP
        return rates(X, tangents(lines, T, X).tangents)

    rows = {
        "images of the targets (simulation)": lambda: targets(X_WP, target_noise),
        "images of the cables (simulation)": lambda: edges(u, T, edge_noise),
        "pose, joint, tracked": lambda: joint(seen, prior),
        "pose, joint, afresh": lambda: joint(seen),
        "pose, mean": lambda: mean(seen, prior),
        "tangents": lambda: tangents(lines, T, X_WP),
        "control law": lambda: rates(X_WP, u),
        "frame, joint, tracked": lambda: frame(joint, prior),
        "frame, joint, afresh": lambda: frame(joint, None),
        "frame, mean": lambda: frame(mean, prior),
    }
    contestants = [Contestant(name=name, call=call) for name, call in rows.items()]
    times = interleave(contestants, options.rounds, warm=3)
    spreads = {name: Spread.of(seconds).scaled(1e3) for name, seconds in times.items()}
    report.table("one frame", [{"part": name, "ms": ms} for name, ms in spreads.items()])
    tracked = spreads["frame, joint, tracked"]
    report.figure("from targets to motor rates", tracked.median, "ms", at_most=LIMIT)
    faster = Spread.of([1e-3 * PAPER / t for t in times["frame, joint, tracked"]])
    report.ratio("the paper's 40 ms with images / a frame from targets", faster)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add this benchmark's options."""
    parser.add_argument("--rounds", type=positive, default=300)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; times are told, not judged."""
    run("vision", __doc__, measure, add_options, arguments)
    return 0


if __name__ == "__main__":
    sys.exit(main())
