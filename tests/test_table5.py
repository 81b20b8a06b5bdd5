"""Table 5: paired runs with two cable models, and when they have converged."""

import math

import numpy as np
import pytest
from scipy.stats import binom

from cdpr_drake.runs import run, setup_of_test
from reproduction.assumptions import assumptions
from reproduction.believed import Eyes, setup_from
from reproduction.table5 import claims as table5_claims
from reproduction.table5 import section as table5
from reproduction.table5 import work as table5_work
from reproduction.table5.convergence import crossing_time, median_interval, noiseless_error


def test_an_exponential_crosses_a_level_when_it_should():
    time = np.linspace(0.0, 50.0, 1001)
    assert crossing_time(time, np.exp(-0.1 * time), 0.02) == pytest.approx(
        math.log(50.0) / 0.1, abs=1e-4
    )
    assert crossing_time(time, np.exp(-0.1 * time), 1e-3) == math.inf
    assert crossing_time(time, np.zeros_like(time), 1e-3) == 0.0
    late = np.exp(-0.1 * time) + 0.1 * (np.abs(time - 45.0) < 1.0)  # comes back up
    assert crossing_time(time, late, 0.05) == pytest.approx(46.0, abs=0.05)


@pytest.mark.parametrize("n", [6, 20, 33])
def test_the_interval_of_a_median_covers_it(n):
    ordered = np.arange(1.0, n + 1.0)
    median, low, high = median_interval(np.random.default_rng(n).permutation(ordered))
    assert median == np.median(ordered)
    assert low + high == n + 1.0  # as many values outside at either end
    outside = 2.0 * binom.cdf(low - 1.0, n, 0.5)
    assert outside <= 0.05 < 2.0 * binom.cdf(low, n, 0.5)


def test_few_values_have_no_interval():
    with pytest.raises(ValueError, match="too few"):
        median_interval(np.arange(5.0))


def test_intervals_hold_the_true_median_as_often_as_they_say():
    draw = np.random.default_rng(7).exponential
    held = [low <= math.log(2.0) <= high for _, low, high in (
        median_interval(draw(size=20)) for _ in range(2000)
    )]  # fmt: skip
    assert 0.945 < np.mean(held) < 0.975  # 95.9 % by the coin


@pytest.fixture(scope="module")
def short_run():
    setup = setup_of_test(4, until=12.0, max_step=table5_work.MAX_STEP, seed=2)
    eyes = Eyes(setup.robot, 2, setup_from({"calibration_poses": 4, "calibration_turn": 4.0}))
    return run(setup.replace(believed=eyes.believed_at(setup.goal)))


def test_noise_aside_the_error_is_what_the_controller_sees(short_run):
    clean, seen = noiseless_error(short_run), short_run.record["pose_error_seen"]
    cameras = short_run.setup.robot.cameras
    late = slice(20, None)  # frames are seen with latency; the platform is slow enough for 5 %
    np.testing.assert_allclose(clean[late, 3:], seen[late, 3:], atol=0.03)
    noise = (seen - clean)[late]
    assert np.std(noise[:, :3]) == pytest.approx(cameras.orientation_noise, rel=0.25)


def test_measured_at_levels(short_run):
    found = table5_work.measured(short_run)
    times = found["converged"][0]
    gain, levels = short_run.setup.gain, np.array(table5_work.LEVELS)
    # The gain rises over the first second; what is reached within the run is reached in time.
    expected = -np.log(levels) / gain + 0.5
    assert np.all(np.isinf(times[expected > 12.0]))
    assert found["converged"].shape == (2, len(levels))


@pytest.mark.parametrize("change", table5_work.CHANGES[1:])
def test_each_change_changes_the_setup(change):
    setup = setup_of_test(4, noise=False)
    other = table5_work._otherwise(setup, change)
    names = ("robot", "loop", "tensions")
    assert any(getattr(other, name) != getattr(setup, name) for name in names)
    assert other.start.IsExactlyEqualTo(setup.start)


def test_an_unknown_change_is_refused():
    with pytest.raises(ValueError, match="unknown change"):
        table5_work._otherwise(setup_of_test(4), "magic")


def _results(later: float, final: float = 2.0, turn: float = 0.015) -> dict:
    """Return results of all cases in which SLSM converges later by some seconds."""
    draw = np.random.default_rng(1).standard_normal
    levels = -np.log(table5_work.LEVELS) / 0.1

    def one(model):
        late = later if model == "SLSM" else 0.0
        return {
            "seen": np.array([final, turn]),
            "true": np.array([final, 0.1]),
            "rates": np.array([0.99, 1.0]),
            "converged": levels + late + 0.01 * draw((2, 1)),
            "noisy": levels + late + 0.3 * draw(5),
        }

    runs = [f"{n} {m}" for n in table5.TESTS for m in table5.MODELS]
    return {case.key: {key: one(key.split()[1]) for key in runs} for case in table5.cases()}


def test_claims_follow_the_results():
    section = table5.section(_results(2.5))
    assert set(section.fitted) == set(assumptions("table5"))
    assert [c.agrees for c in section.claims] == [True, False, False, False] + 5 * [True]
    for table in section.tables:
        assert all(len(row) == len(table.headings) for row in table.rows)
    earlier = [c.agrees for c in table5.section(_results(-2.5)).claims]
    assert earlier[5:] == 4 * [False]
    for final, turn in ((0.9, 0.015), (4.3, 0.015), (2.0, 0.004), (2.0, 0.021)):
        rough = table5.section(_results(2.5, final, turn)).claims[0]
        assert not rough.agrees  # either way: too small an error differs, too


def test_final_errors_of_the_noise_alone():
    alone = table5_claims.without_model(4, noise=True)
    cameras = setup_of_test(4).robot.cameras
    sigma = np.array([1e3 * cameras.position_noise, np.degrees(cameras.orientation_noise)])
    left = table5_claims.without_model(4, noise=False)[0]
    maxwell = 2.0 * math.sqrt(2.0 / math.pi) * sigma  # the mean length of three normal errors
    mean = alone.mean(axis=0)
    assert np.all((0.99 * maxwell < mean) & (mean < np.hypot(maxwell, 1.1 * left)))
    assert mean == pytest.approx([1.77, 0.080], rel=0.01)  # what the runs have, robot and all
    assert left == pytest.approx([0.80, 0.008], rel=0.1)
