"""Gain limits: predicted, and seen in simulation."""

from __future__ import annotations

import importlib.util
import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform
from study_samples import POSE, miscalibrated

from cdpr_drake.analysis import (
    SampledServo,
    StabilityWarning,
    gain_limit,
    gain_limit_band,
    platform_modes,
    stability_map,
    warn_if_unstable,
)
from cdpr_drake.analysis.stability import find_gain_limit
from cdpr_drake.diagrams import make_vision_based_control
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.runs.moves import move_near_the_middle
from cdpr_drake.runs.paper_tests import paper_test
from cdpr_drake.study import equilibrium, one_period_map, simulate_modes

DOCS = Path(__file__).parents[1] / "docs"


def with_damping(robot: CableRobot, damping_time: float) -> CableRobot:
    return robot.replace(cable=robot.cable.replace(damping_time=damping_time))


@pytest.mark.parametrize("latency", [0.0, 0.02, 0.05, 0.1, 0.13])
@pytest.mark.parametrize("gain", [0.1, 3.0])
def test_the_loop_by_hand_is_the_diagram_s(cogiro: CableRobot, latency: float, gain: float) -> None:
    """Two models with nothing in common but the cable kernel and the law."""
    believed = miscalibrated(cogiro)
    loop = make_vision_based_control(cogiro, "SLSM", gain=gain, latency=latency, believed=believed)
    z = one_period_map(loop, equilibrium(loop, POSE)).eigenvalues
    filters = math.exp(-2.0 * math.pi * cogiro.load_cells.cutoff * 0.05)
    z = z[(np.abs(z - 1.0) > 1e-8) & (np.abs(z - filters) > 1e-6) & (np.abs(z) > 1e-2)]
    servo = SampledServo(cogiro, POSE, believed=believed, cable_model="SLSM")
    ours = servo.map(gain, latency).eigenvalues
    ours = ours[np.abs(ours) > 1e-2]
    assert z.size == ours.size
    for value in z:
        assert np.abs(ours - value).min() < 1e-9
    worst = z[np.argmax(np.abs(z))]
    assert servo.growth(gain, latency).real == pytest.approx(math.log(abs(worst)) / 0.05, abs=1e-8)


@pytest.mark.parametrize(
    ("damping_time", "latency", "limit"),
    [
        (0.0, 0.0, 0.23), (0.0, 0.04, 0.70), (0.0, 0.05, 1.46),
        (1e-3, 0.0, 0.58), (1e-3, 0.04, 1.50), (1e-3, 0.05, 2.38),
        (1e-2, 0.0, 3.2), (1e-2, 0.04, 4.5), (1e-2, 0.05, 5.1),
    ],
)  # fmt: skip
def test_latency_and_damping_help(
    cogiro: CableRobot, damping_time: float, latency: float, limit: float
) -> None:
    """Limits [1/s] found once with another model of this robot, near the goal of Test 4."""
    found = gain_limit(with_damping(cogiro, damping_time), POSE, latency)
    assert found.gain == pytest.approx(limit, rel=0.05)
    assert found.mode == "platform/z" and 2.3 < found.frequency < 2.9
    assert found.unstable[0][0] == found.gain and found.searched == pytest.approx(0.99 / 0.05)


def test_on_either_side_of_the_limit(cogiro: CableRobot) -> None:
    servo = SampledServo(cogiro, POSE)
    found = find_gain_limit(servo, 0.04)
    assert servo.growth(found.gain * 0.999, 0.04).real < 0.0
    assert servo.growth(found.gain * 1.001, 0.04).real > 0.0
    for gain in np.geomspace(1e-3, found.gain * 0.999, 40):
        assert servo.growth(gain, 0.04).real < 0.0
    assert "platform/z at 2.7" in str(found)


class Islands(SampledServo):
    """A loop whose growth is a given function of the gain."""

    def __init__(self, growth: object) -> None:
        self.sample_time = 0.05
        self._given = growth

    def growth(self, gain: float, latency: float) -> complex:
        return complex(self._given(gain), 0.0)  # type: ignore[operator]

    def critical(self, gain: float, latency: float) -> tuple:
        from cdpr_drake.study import modes

        found = modes(np.diag([0.1, -1.0]))
        return found, found[0]


def test_islands_are_found_narrow_ones_too() -> None:
    """Unstable from 0.2 to 0.3, in a sliver narrower than the scan's steps, and from 3 on."""

    def growth(gain: float) -> float:
        island = 1.0 - (math.log(gain / 0.245) / 0.2) ** 2
        sliver = 0.01 - abs(math.log(gain / 1.0)) / 0.3
        return max(island, sliver, math.log(gain / 3.0), -1.0)

    found = find_gain_limit(Islands(growth), 0.0, points=80)
    ends = [end for span in found.unstable for end in span]
    expected = [0.245 * math.exp(-0.2), 0.245 * math.exp(0.2),
                math.exp(-0.003), math.exp(0.003), 3.0, 19.8]  # fmt: skip
    assert ends == pytest.approx(expected, rel=1e-5)
    assert found.gain == ends[0] and "unstable: 0.2006 to 0.2992" in str(found)


def test_never_unstable_and_always_unstable() -> None:
    stable = find_gain_limit(Islands(lambda gain: -gain), 0.0)
    assert stable.gain == math.inf and not stable.unstable and "stable up to" in str(stable)
    unstable = find_gain_limit(Islands(lambda gain: gain), 0.0)
    assert unstable.gain == 0.0 and unstable.unstable == ((0.0, pytest.approx(19.8)),)


def test_the_map_over_gain_and_latency(cogiro: CableRobot) -> None:
    gains, latencies = np.geomspace(0.1, 10.0, 8), [0.0, 0.05, 0.12]
    found = stability_map(cogiro, POSE, gains, latencies, cable_model="SLSM")
    assert found.growth.shape == found.frequency.shape == found.is_stable.shape == (3, 8)
    servo = SampledServo(cogiro, POSE, cable_model="SLSM")
    assert found.growth[1, 4] == pytest.approx(servo.growth(gains[4], 0.05).real)
    for row, limit in zip(found.is_stable, found.limits, strict=True):
        np.testing.assert_array_equal(row, gains < limit.gain)
        assert limit.searched == pytest.approx(10.0)
    # Not monotonic: some latency helps, too much does not.
    assert found.limits[0].gain < found.limits[2].gain < found.limits[1].gain * 2.0


def test_the_limit_depends_on_the_payload(cogiro: CableRobot) -> None:
    heavy = cogiro.with_payload(110.0)
    assert gain_limit(heavy, POSE).gain < 0.7 * gain_limit(cogiro, POSE).gain
    lowest = min(m.frequency for m in platform_modes(heavy, POSE).modes)
    assert gain_limit(heavy, POSE).frequency == pytest.approx(lowest, rel=0.15)


def test_times_out_of_range_are_refused(cogiro: CableRobot) -> None:
    with pytest.raises(ValueError, match="latency"):
        gain_limit(cogiro, POSE, latency=-0.1)
    with pytest.raises(ValueError, match="sample time"):
        SampledServo(cogiro, POSE, 0.0)
    with pytest.raises(ValueError, match="latency"):
        stability_map(cogiro, POSE, [0.1], [-0.1])


def test_an_unstable_loop_is_warned_of(cogiro: CableRobot) -> None:
    loop = make_vision_based_control(cogiro, gain=3.0)
    with pytest.warns(StabilityWarning, match="platform/z grows"):
        warn_if_unstable(loop, equilibrium(loop, POSE))
    calm = make_vision_based_control(cogiro, gain=0.5)
    assert not warn_if_unstable(calm, equilibrium(calm, POSE)).unstable


@pytest.mark.needs("numba")
@pytest.mark.parametrize("factor", [0.95, 1.05])
def test_the_limit_is_bracketed_in_simulation(cogiro: CableRobot, factor: float) -> None:
    """The critical mode of the nonlinear loop decays 5 % below the limit and grows 5 % above."""
    gain = factor * gain_limit(cogiro, POSE, 0.04).gain
    loop = make_vision_based_control(cogiro, gain=gain, latency=0.04)
    (mode,) = simulate_modes(loop, equilibrium(loop, POSE), 15.0)
    assert math.copysign(1.0, mode.growth) == math.copysign(1.0, factor - 1.0)
    assert mode.growth == pytest.approx(mode.predicted.real, rel=0.02)


# --- damping that only what stretches has


@pytest.mark.parametrize(
    ("number", "end", "limit"),
    [(1, 0, 0.636), (1, 1, 0.473), (4, 0, 2.716), (4, 1, 1.465), (5, 1, 1.084)],
)
def test_limits_on_the_papers_robot(
    cogiro: CableRobot, number: int, end: int, limit: float
) -> None:
    """Beside values that another program found for static cables damped by their stretch."""
    test = paper_test(number)
    found = gain_limit(test.carried_by(cogiro), test.poses(cogiro)[end])
    assert found.gain == pytest.approx(limit, rel=0.005)


def test_limits_of_a_robot_that_sags() -> None:
    large = load_robot("cogiro-98m")
    assert gain_limit(large, RigidTransform()).gain == pytest.approx(0.062, rel=0.02)
    assert gain_limit(large, RigidTransform([20.0, 0, 0])).gain == pytest.approx(0.0017, rel=0.05)


@pytest.mark.parametrize("name", ["cogiro", "cogiro-37m", "cogiro-98m"])
def test_a_band_holds_the_limits_of_its_loss_factors(name: str) -> None:
    robot = load_robot(name)
    _, pose = move_near_the_middle(robot)
    band = gain_limit_band(robot, pose)
    assert 0.0 < band.lowest < 0.5 * band.highest
    for factor, time, limit in zip(band.loss_factors, band.damping_times, band.limits, strict=True):
        assert time * 2.0 * np.pi * limit.frequency == pytest.approx(factor, rel=0.02)
        alone = gain_limit(with_damping(robot, time), pose)
        assert limit.gain == pytest.approx(alone.gain, rel=1e-5)
    text = str(band)
    assert f"{band.lowest:.3g} to {band.highest:.3g}/s" in text and "0.01 to 0.1" in text
    with pytest.raises(ValueError, match="positive"):
        gain_limit_band(robot, pose, loss_factors=[0.0])


@pytest.mark.parametrize("x", [0.0, 20.0])
def test_an_undamped_slow_mode_grows_at_half_the_gain_and_drag_stops_it(x: float) -> None:
    """Where the delay is short beside its period: m x'' = -k (x - u), u' = -lambda x."""
    robot, pose, gain = with_damping(load_robot("cogiro-98m"), 0.0), RigidTransform([x, 0, 0]), 0.06
    assert SampledServo(robot, pose).growth(gain, 0.04).real == pytest.approx(0.03, rel=0.1)
    assert SampledServo(robot, pose, drag=0.045).growth(gain, 0.04).real > 0.0
    assert SampledServo(robot, pose, drag=0.065).growth(gain, 0.04).real < 0.0


@pytest.mark.slow
def test_the_page_on_damping_has_what_is_computed() -> None:
    spec = importlib.util.spec_from_file_location("make_damping", DOCS / "make_damping.py")
    assert spec is not None and spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = script
    spec.loader.exec_module(script)
    page = (DOCS / "damping.md").read_text(encoding="utf-8")
    before = json.loads((DOCS / "damping_before.json").read_text(encoding="utf-8"))
    rows = list(script.places())
    late = [row for row in rows if row.name in script.LATE]
    assert len(before) == len(rows) == page.count("| cogiro") - len(late)
    for row in (rows[6], rows[11], rows[14]):
        assert script.line(row, before) in page
    assert script.latency_line(late[1]) in page
