"""The paper's Test 4 closed on the pixels of eleven cameras, rendered and drawn: does it arrive?

The whole run at 20 Hz with noise in every image and load cell; it should end within 10 mm and
0.5 degrees of its goal, the paper's accuracy, with no frame lost. Rendering takes most of the time:
some tenths of a second for each frame, a quarter of an hour for the run at the paper's gain.

    python benchmarks/bench_rendered_loop.py [--gain 0.1] [--until 80]
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from cdpr_drake.diagrams import ImageSensing  # noqa: E402
from cdpr_drake.diagrams.rendering import rendering_available  # noqa: E402
from cdpr_drake.runs.running import prepare, run  # noqa: E402
from cdpr_drake.runs.setup import setup_of_test  # noqa: E402

POSITION, ORIENTATION = 10e-3, 0.5  # m, deg: the paper's accuracy
LAST = 1.0  # s: the errors are the largest of these last


def main() -> int:
    """Print what came of the run; the exit status is 1 if it did not arrive."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--gain", type=float, help="lambda [1/s] (default: the test's)")
    parser.add_argument("--until", type=float, help="simulated time [s] (default: the test's)")
    options = parser.parse_args()
    if not rendering_available():
        print("Drake cannot render without a display here: EGL finds no driver")
        return 0
    given = {name: value for name, value in vars(options).items() if value is not None}
    setup = setup_of_test(4, sensing=ImageSensing(), **given)
    start = time.process_time()
    ready = prepare(setup)

    def progress(now: float) -> None:
        if sys.stderr.isatty():
            print(f"\r{now:5.1f} of {setup.until:g} s", end="", file=sys.stderr, flush=True)

    result = run(ready, progress)
    spent = time.process_time() - start
    record, summary = result.record, result.summary
    errors = np.linalg.norm(record["pose_error"].reshape(-1, 2, 3), axis=2)
    last = errors[record.time >= record.time[-1] - LAST].max(axis=0)
    position, orientation = float(last[1]), float(np.degrees(last[0]))
    frames = setup.until / (setup.loop.timing.sample_time or np.inf)
    lost = summary.pose_frames_lost, summary.pose_images_lost, summary.tangent_frames_lost
    print(f"lambda = {setup.gain:g} 1/s, {setup.until:g} s, from {1e3 * errors[0, 1]:.0f} mm")
    print(f"largest error of the last {LAST:g} s: {1e3 * position:.1f} mm, {orientation:.2f} deg")
    print(f"lost: frames {lost[0]}, images {lost[1]}, tangents {sum(lost[2] or ())}")
    print(f"{spent:.0f} s of processor time, {1e3 * spent / frames:.0f} ms a frame")
    good = position <= POSITION and orientation <= ORIENTATION
    print(f"within {1e3 * POSITION:g} mm and {ORIENTATION:g} deg: {good}")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
