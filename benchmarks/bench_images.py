"""Cost of one frame from pixels: eleven images of 1280 x 1024 to motor rates, on one core.

Three pose cameras see the platform and four stereo pairs the cables, along the first frames of the
paper's Test 4. Timed are the parts of a frame: the pose from the images of the pose cameras, the
cables' edges in those of the stereo pairs, the tangents from the edges, and the control law; both
tracked, around where the frame before saw them, and searched in whole images, as when lost. A
tracked frame should take at most 10 ms; the paper's took 40 ms, with a GPU. Rendering and drawing,
in place of acquisition, are timed apart. Times are CPU times of this process, the median of all
frames.

    python benchmarks/bench_images.py [--frames 8] [--repeats 10]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from pydrake.common.eigen_geometry import AngleAxis  # noqa: E402
from pydrake.math import RigidTransform, RotationMatrix  # noqa: E402

from cdpr_drake.diagrams.rendering import (  # noqa: E402
    make_pose_camera_images,
    rendering_available,
)
from cdpr_drake.model.catenary import elastic_catenary  # noqa: E402
from cdpr_drake.model.equilibrium import rest_state  # noqa: E402
from cdpr_drake.model.kernels import is_compiled  # noqa: E402
from cdpr_drake.model.robot import CableRobot, load_robot  # noqa: E402
from cdpr_drake.model.rotations import pose_to_vector  # noqa: E402
from cdpr_drake.model.servo import MotorRateLaw, ServoSettings  # noqa: E402
from cdpr_drake.model.vision.cable_drawing import CableDrawing  # noqa: E402
from cdpr_drake.model.vision.image_pose import ImagePoseEstimator  # noqa: E402
from cdpr_drake.model.vision.lines import CableLines  # noqa: E402
from cdpr_drake.model.vision.tangents import TangentEstimator  # noqa: E402
from cdpr_drake.runs.paper_tests import paper_test  # noqa: E402

LIMIT = 10.0  # ms, from pixels to motor rates when tracking
GAIN, PERIOD = 0.1, 0.05  # 1/s, s
PAPER = 40.0  # ms, section 6.2, with a GPU

PARTS = ("pose of the platform", "edges of the cables", "tangents", "control law")


def path(robot: CableRobot, frames: int) -> Iterator[RigidTransform]:
    """Yield the first poses of Test 4, from its start along exp(-gain t) to its goal."""
    start, goal = paper_test(4).poses(robot)
    turn = (start.rotation().inverse() @ goal.rotation()).ToAngleAxis()
    for i in range(frames):
        left = np.exp(-GAIN * PERIOD * i)
        R = start.rotation() @ RotationMatrix(AngleAxis((1.0 - left) * turn.angle(), turn.axis()))
        p = goal.translation() + left * (start.translation() - goal.translation())
        yield RigidTransform(R, p)


def cables_at(robot: CableRobot, X_WP: RigidTransform) -> tuple[np.ndarray, np.ndarray]:
    """Return tangents (k, 3) and tensions (k,) [N] at the drawing points of the robot at rest."""
    lengths = rest_state(robot, X_WP).unstrained_length
    ends = np.array([X_WP @ p for p in robot.attachment_points]) - robot.drawing_points
    cable = robot.cable
    at = elastic_catenary(ends, lengths, robot.weight_per_metre, cable.stiffness, cable.drum_run)
    return at.tangent_at_drawing_point, at.tension_at_drawing_point


class Recorder:
    """Takes the CPU time of calls, by name [ms]."""

    def __init__(self) -> None:
        self.times: dict[str, list[float]] = {}

    def __call__(self, name: str, f: Callable[..., Any], *args: Any) -> Any:
        """Return f(*args), timed."""
        start = time.process_time()
        result = f(*args)
        self.times.setdefault(name, []).append(1e3 * (time.process_time() - start))
        return result

    def median(self, name: str) -> float:
        """Return the median time of a name's calls [ms], NaN if there were none."""
        return float(np.median(self.times.get(name, [np.nan])))


class Frame:
    """The truth at one instant, and the images of it."""

    def __init__(self, robot: CableRobot, X_WP: RigidTransform) -> None:
        self.X_WP = X_WP
        self.tangents, self.tension = cables_at(robot, X_WP)
        self.platform: list[np.ndarray] = []
        self.cables: list[tuple[np.ndarray, np.ndarray]] = []


class Controller:
    """From images to motor rates: what runs once a frame."""

    def __init__(self, robot: CableRobot, goal: RigidTransform, timed: Recorder) -> None:
        self._pose, self._lines = ImagePoseEstimator(robot), CableLines(robot)
        self._tangents = TangentEstimator(robot)
        self._law = MotorRateLaw(robot, ServoSettings(gain=GAIN))
        self._goal, self._timed = pose_to_vector(goal), timed

    def __call__(self, frame: Frame, last: tuple[RigidTransform, np.ndarray] | None) -> Any:
        """Return (pose, tangents) of a frame, with those of the last if it is to be tracked."""
        start = time.process_time()
        X, u = last if last is not None else (None, None)
        kind = "searched" if last is None else "tracked"
        times = self._timed
        if frame.platform:
            pose = times(f"{PARTS[0]}, {kind}", self._pose, frame.platform, X)
            X = pose.X_WP
        else:
            X = frame.X_WP
        T = frame.tension
        edges = times(f"{PARTS[1]}, {kind}", self._lines, frame.cables, T, X, u)
        estimate = times(f"{PARTS[2]}, {kind}", self._tangents, edges, T, X)
        if not estimate.valid.all():
            raise SystemExit("a cable was not found")
        z = [pose_to_vector(X), self._goal, np.zeros(6), T, estimate.tangents.ravel()]
        times(f"{PARTS[3]}, {kind}", self._law, np.concatenate(z), GAIN)
        times.times.setdefault(f"frame, {kind}", []).append(1e3 * (time.process_time() - start))
        return X, estimate.tangents


def render(robot: CableRobot, frames: list[Frame], timed: Recorder) -> None:
    """Render the images of the pose cameras."""
    cameras = make_pose_camera_images(robot)
    context = cameras.CreateDefaultContext()
    for frame in frames:
        cameras.GetInputPort("pose").FixValue(context, pose_to_vector(frame.X_WP))
        ports = [cameras.get_output_port(i) for i in range(cameras.num_output_ports())]
        frame.platform = timed(
            "rendering", lambda ports=ports: [p.Eval(context).data.copy() for p in ports]
        )


def errors(frames: list[Frame], seen: list[Any]) -> str:
    """Return how far poses and tangents are from the truth, at most."""
    place = max(
        float(np.linalg.norm(X.translation() - f.X_WP.translation()))
        for f, (X, _) in zip(frames, seen, strict=True)
    )
    turn = max(
        float(np.linalg.norm(np.cross(u, f.tangents), axis=1).max())
        for f, (_, u) in zip(frames, seen, strict=True)
    )
    return f"position to {1e3 * place:.2f} mm, tangents to {1e3 * turn:.2f} mrad"


def main() -> int:
    """Print the table; the exit status is 1 if a tracked frame takes longer than it may."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=8, help="along the path")
    parser.add_argument("--repeats", type=int, default=10, help="of the path")
    options = parser.parse_args()

    import cv2

    cv2.setNumThreads(1)
    robot = load_robot("cogiro")
    timed = Recorder()
    frames = [Frame(robot, X) for X in path(robot, options.frames)]
    draw = CableDrawing(robot)
    for seed, frame in enumerate(frames):
        frame.cables = timed("drawing", draw, frame.tangents, frame.tension, seed)
    with_platform = rendering_available()
    if with_platform:
        render(robot, frames, timed)

    controller = Controller(robot, paper_test(4).poses(robot)[1], timed)
    last = controller(frames[0], None)
    controller(frames[0], last)  # all is compiled now
    for name in [name for name in timed.times if "," in name]:
        del timed.times[name]
    for _ in range(options.repeats):
        last, seen = controller(frames[0], None), []
        for frame in frames:
            last = controller(frame, last)
            seen.append(last)

    print(f"{'ms':26s} {'tracked':>8s} {'searched':>9s}")
    for part in (*PARTS, "frame"):
        both = (timed.median(f"{part}, {kind}") for kind in ("tracked", "searched"))
        print("{:26s} {:8.3f} {:9.3f}".format(part, *both))
    print("compiled" if is_compiled() else "not compiled")
    print(errors(frames, seen))
    print(
        f"apart: {timed.median('rendering'):.0f} ms to render three images, "
        f"{timed.median('drawing'):.0f} ms to draw eight"
    )
    if not with_platform:
        print("no EGL driver, so nothing was rendered: the pose is the true one")
        return 0
    frame_time = timed.median("frame, tracked")
    good = frame_time <= LIMIT
    print(
        f"from pixels to motor rates: {frame_time:.1f} ms, at most {LIMIT:g} ms "
        f"({PAPER:g} ms in the paper): {good}"
    )
    return 0 if good or not is_compiled() else 1


if __name__ == "__main__":
    sys.exit(main())
