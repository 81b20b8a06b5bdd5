"""Tests 1 to 5 without noise are those kept in reference_runs.npz: to the picometre."""

from __future__ import annotations

import numpy as np
import pytest
from reference_runs import FILE, RUNS, poses


@pytest.mark.needs("numba")  # without, they take minutes
@pytest.mark.parametrize("name", RUNS)
def test_a_run_is_the_one_that_was_kept(name: str) -> None:
    with np.load(FILE) as kept:
        expected = kept[name]
    found = poses(name)
    assert found.shape == expected.shape
    assert np.abs(found - expected).max() <= 1e-12  # rad, m
