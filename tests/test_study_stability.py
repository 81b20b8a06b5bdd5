"""Gain limits: predicted, and seen in simulation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from study_samples import POSE, miscalibrated

from cdpr_drake.diagrams import make_vision_based_control
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.study import (
    SampledServo,
    StabilityWarning,
    equilibrium,
    gain_limit,
    one_period_map,
    platform_modes,
    simulate_modes,
    stability_map,
    warn_if_unstable,
)
from cdpr_drake.study.stability import find_gain_limit


def with_damping(robot: CableRobot, damping_time: float) -> CableRobot:
    return robot.replace(cable=robot.cable.replace(damping_time=damping_time))


@pytest.mark.parametrize("latency", [0.0, 0.02, 0.05, 0.1, 0.13])
@pytest.mark.parametrize("gain", [0.1, 3.0])
def test_the_loop_by_hand_is_the_diagram_s(cogiro: CableRobot, latency: float, gain: float) -> None:
    """Two models with nothing in common but the cable kernel and the law."""
    believed = miscalibrated(cogiro)
    loop = make_vision_based_control(
        cogiro, "SLSM", gain=gain, latency=latency, calibrated=believed
    )
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
