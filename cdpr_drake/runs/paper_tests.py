"""The paper's Tests 1 to 5 (section 6) as data: poses, payload, gain, and where each comes from."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from importlib import resources

from pydrake.math import RigidTransform

from cdpr_drake.model.records import Record
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.robot_file import read_record

NUMBERS = (1, 2, 3, 4, 5)


@dataclass(frozen=True, kw_only=True, eq=False)
class PaperTest(Record):
    """One test of the paper, its poses as printed: those of the target frame M in a camera frame F.

    Args:
        description: one line.
        start: X_FM at the start.
        goal: X_FM at the goal.
        payload: [kg], what the platform carries besides the forklift.
        gain: lambda [1/s].
        duration: [s].
        sources: where the values come from, by field.
        assumptions: what is assumed rather than known.
    """

    description: str
    start: RigidTransform
    goal: RigidTransform
    payload: float
    gain: float
    duration: float
    sources: dict[str, str] = field(default_factory=dict)
    assumptions: tuple[str, ...] = ()

    def poses(self, robot: CableRobot) -> tuple[RigidTransform, RigidTransform]:
        """Return X_WP at start and goal: X_WF X_FM X_PM^-1, with the transforms of a `robot`."""
        X_WF, X_MP = robot.cameras.X_WF, robot.cameras.X_PM.inverse()
        return X_WF @ self.start @ X_MP, X_WF @ self.goal @ X_MP

    def carried_by(self, robot: CableRobot) -> CableRobot:
        """Return a `robot` with the test's payload in place of its own."""
        return robot.with_payload(self.payload)


@dataclass(frozen=True, kw_only=True, eq=False)
class PaperTests(Record):
    """The file of the paper's tests.

    Args:
        robot: name of the built-in robot they were made with.
        test_1: Test 1.
        test_2: Test 2.
        test_3: Test 3.
        test_4: Test 4.
        test_5: Test 5.
    """

    robot: str
    test_1: PaperTest
    test_2: PaperTest
    test_3: PaperTest
    test_4: PaperTest
    test_5: PaperTest


@functools.cache
def paper_tests() -> PaperTests:
    """Return the tests of the data file."""
    file = resources.files("cdpr_drake") / "runs" / "tests.yaml"
    return read_record(PaperTests, file.read_text(encoding="utf-8"), "tests.yaml")


def paper_test(number: int) -> PaperTest:
    """Return one of the paper's tests.

    Args:
        number: 1 to 5, as in the paper.

    Raises:
        ValueError: there is no such test.
    """
    if number not in NUMBERS:
        known = ", ".join(map(str, NUMBERS))
        raise ValueError(f"no test {number}; the paper's tests are {known}")
    test: PaperTest = getattr(paper_tests(), f"test_{number}")
    return test
