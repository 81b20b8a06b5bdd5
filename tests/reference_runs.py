"""Runs of the paper's tests without noise, kept to tell whether a change alters what is computed.

    python tests/reference_runs.py

makes the file anew: only where a change is meant to alter it, and then in a commit of its own.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from samples import LOOPS

from cdpr_drake.runs.running import run
from cdpr_drake.runs.setup import RECORD_PERIOD, setup_of_test

FILE = Path(__file__).with_name("reference_runs.npz")

RUNS = {
    **{f"test {n}, VBC SCMWE": (n, "VBC", "SCMWE") for n in (1, 2, 3, 4, 5)},
    **{f"test {n}, VBC SLSM": (n, "VBC", "SLSM") for n in (4, 5)},
    **{f"test {n}, JSC": (n, "JSC", "SCMWE") for n in (1, 2, 3, 4)},
}
"""The test, the controller and its cable model, by the name of the run."""


def poses(name: str) -> np.ndarray:
    """Return the poses (n, 6) [roll, pitch, yaw, x, y, z] (rad, m) of a run, one a second."""
    test, controller, cable_model = RUNS[name]
    setup = setup_of_test(test, loop=LOOPS[controller], cable_model=cable_model, noise=False)
    record = run(setup).record
    every = round(1.0 / RECORD_PERIOD)
    np.testing.assert_allclose(record.time[::every], np.arange(setup.until + 0.5), atol=1e-9)
    return record["pose"][::every]


if __name__ == "__main__":
    np.savez_compressed(FILE, **{name: poses(name) for name in RUNS})
