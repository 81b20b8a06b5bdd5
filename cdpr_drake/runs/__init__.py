"""The paper's tests as data, and runs of them."""

from cdpr_drake.runs.metrics import Summary
from cdpr_drake.runs.paper_tests import NUMBERS, PaperTest, paper_test
from cdpr_drake.runs.running import Prepared, Run, prepare, run
from cdpr_drake.runs.setup import RECORD_PERIOD, Setup, make_setup, setup_of_test

__all__ = [
    "NUMBERS",
    "RECORD_PERIOD",
    "PaperTest",
    "Prepared",
    "Run",
    "Setup",
    "Summary",
    "make_setup",
    "paper_test",
    "prepare",
    "run",
    "setup_of_test",
]
