"""The whole noisy, sampled loop against one written without the package, in NumPy and SciPy."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.rotations import vector_to_pose
from cdpr_drake.runs.running import prepare, run
from cdpr_drake.runs.setup import Setup, setup_of_test

sys.path.append(str(Path(__file__).resolve().parents[1]))  # behind what is installed

from benchmarks.loop_case import noise_of, numbers_of
from benchmarks.solve_ivp_loop import Loop, Noise, Simulation, Start

UNTIL = 1.5  # s: through the ramp of the gain, the platform has moved 0.1 m
FINE = 2.5e-3  # s


def prepared(**changes: object) -> tuple[Setup, Loop, Start, Noise, np.ndarray]:
    """Return Test 4 with some changes, as numbers, and the path (n, 6) it takes in our diagram."""
    loud = load_robot("cogiro")  # so that all that is measured has its effect
    loud = loud.replace(
        cameras=loud.cameras.replace(tangent_noise=0.2),
        load_cells=loud.load_cells.replace(noise=100.0),
    )
    setup = setup_of_test(4, loud, until=UNTIL, max_step=FINE, gain=0.1, seed=5, **changes)
    ready = prepare(setup)
    noise = noise_of(ready.loop, ready.context, UNTIL, setup.loop.timing.sample_time)
    return setup, *numbers_of(setup), noise, run(ready).record["pose"]


def independent(
    robot: CableRobot, loop: Loop, start: Start, noise: Noise, rtol: float = 1e-4
) -> tuple[np.ndarray, np.ndarray]:
    """Return places (n, 3) and rotations (n, 3, 3) by the independent script."""
    return Simulation(robot, loop).run(start, noise, UNTIL, rtol=rtol, atol=0.01 * rtol)


def difference(path: np.ndarray, places: np.ndarray, rotations: np.ndarray) -> float:
    """Return the largest difference of places [m] and of entries of rotation matrices."""
    turned = [vector_to_pose(pose).rotation().matrix() for pose in path]
    return float(max(np.abs(places - path[:, 3:]).max(), np.abs(rotations - turned).max()))


@pytest.mark.parametrize("latency", [0.04, 0.02])
def test_an_independent_loop_takes_the_same_path(latency: float) -> None:
    setup, loop, start, noise, path = prepared(latency=latency)
    places, rotations = independent(setup.robot, loop, start, noise, rtol=1e-6)
    assert np.linalg.norm(places[-1] - places[0]) > 0.1
    assert difference(path, places, rotations) < 1e-6


def test_the_agreement_is_no_accident() -> None:
    """Whatever the loop hangs on shows: noise, latency, a millimetre of calibration."""
    setup, loop, start, noise, path = prepared()
    other = np.random.default_rng(0)
    wrong = {
        name: Noise(**{**vars(noise), name: other.standard_normal(getattr(noise, name).shape)})
        for name in ("pose", "tangents", "tension")
    }
    for name, noisy in wrong.items():
        assert difference(path, *independent(setup.robot, loop, start, noisy)) > 3e-6, name
    late = Loop(**{**vars(loop), "latency": 0.045})
    assert difference(path, *independent(setup.robot, late, start, noise)) > 1e-5
    shifted = setup.robot.attachment_points + np.array([1e-3, 0.0, 0.0])
    moved = setup.robot.replace(attachment_points=shifted)
    assert difference(path, *independent(moved, loop, start, noise)) > 1e-5


@pytest.mark.needs("numba")
def test_the_fused_loop_takes_the_same_steps() -> None:
    from benchmarks.fused_loop import FusedLoop

    setup, loop, start, noise, path = prepared()
    fused = FusedLoop(setup.robot, loop, FINE).run(start, noise, UNTIL)
    np.testing.assert_allclose(fused, path, rtol=0.0, atol=1e-10)
