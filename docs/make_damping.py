"""Write the table of docs/damping.md: gain limits and damping before and after a correction.

    python docs/make_damping.py

Version 0.1's numbers are kept in docs/damping_before.json; the others are computed.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.analysis import gain_limit, gain_limit_band, platform_modes
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.runs.paper_tests import paper_test, paper_tests

DOCS = Path(__file__).resolve().parent
PAGE, BEFORE = DOCS / "damping.md", DOCS / "damping_before.json"
LATENCIES = (0.0, 0.02, 0.04, 0.08, 0.12)
"""Of the second table [s]."""

TESTS = ((1, 0), (1, 1), (2, 1), (3, 0), (3, 1), (4, 0), (4, 1), (5, 1))
"""Number of the test, and 0 for its start or 1 for its goal; others share these starts."""

LATE = ("Test 1, goal", "Test 4, goal", "near the middle, goal")
"""Places in the table of latencies."""

ENDS = ("start", "goal")


@dataclass(frozen=True, kw_only=True)
class Place:
    """A robot at a pose, by the name of both."""

    robot_name: str
    name: str
    robot: CableRobot
    pose: RigidTransform


def low_move(robot: CableRobot) -> tuple[RigidTransform, RigidTransform]:
    """Return X_WP at the ends of version 0.1's short move, low in the room.

    It starts under the centroid of the drawing points at 30 % of their height, rises by 10 % of it
    and moves along x by 5 % of the room's length.

    Args:
        robot: the robot.
    """
    points = robot.drawing_points
    centre, height = points.mean(axis=0), float(points[:, 2].max())
    start = np.array([centre[0], centre[1], 0.3 * height])
    shift = np.array([0.05 * float(np.ptp(points[:, 0])), 0.0, 0.1 * height])
    return RigidTransform(start), RigidTransform(start + shift)


def places() -> Iterator[Place]:
    """Yield all rows of the table: the paper's on CoGiRo, moves near the middle, Table 7's ends."""
    cogiro = load_robot(paper_tests().robot)
    for number, end in TESTS:
        test = paper_test(number)
        yield Place(
            robot_name=cogiro.name,
            name=f"Test {number}, {ENDS[end]}",
            robot=test.carried_by(cogiro),
            pose=test.poses(cogiro)[end],
        )
    for name in ("cogiro-22m", "cogiro-37m", "cogiro-98m"):
        robot = load_robot(name)
        for end, pose in zip(ENDS, low_move(robot), strict=True):
            yield Place(robot_name=name, name=f"near the middle, {end}", robot=robot, pose=pose)
    for end, x in zip(ENDS, (0.0, 20.0), strict=True):
        pose = RigidTransform([x, 0.0, 0.0])
        yield Place(robot_name="cogiro-98m", name=f"Table 7, {end}", robot=robot, pose=pose)


def numbers(place: Place) -> dict[str, float]:
    """Return gain limit [1/s], its band, the critical frequency [Hz], and the least damping [-]."""
    limit = gain_limit(place.robot, place.pose)
    band = gain_limit_band(place.robot, place.pose)
    modes = platform_modes(place.robot, place.pose).modes
    return {
        "limit": limit.gain,
        "lowest": band.lowest,
        "highest": band.highest,
        "frequency": limit.frequency,
        "damping": min(mode.damping for mode in modes if mode.frequency > 0.0),
    }


def line(place: Place, before: list[dict[str, Any]]) -> str:
    """Return a row of the table in Markdown.

    Args:
        place: of the row.
        before: what version 0.1 found, all places.
    """
    (old,) = (
        row for row in before if (row["robot"], row["place"]) == (place.robot_name, place.name)
    )
    new = numbers(place)
    cells = (
        place.robot_name, place.name, f"{old['limit']:.3g}", f"{new['limit']:.3g}",
        f"{new['lowest']:.2g} to {new['highest']:.2g}", f"{new['frequency']:.2g}",
        f"{100.0 * old['damping']:.2g}", f"{100.0 * new['damping']:.2g}",
    )  # fmt: skip
    return "| " + " | ".join(cells) + " |"


def latency_line(place: Place) -> str:
    """Return a row of the table of latencies in Markdown."""
    limits = (gain_limit(place.robot, place.pose, latency).gain for latency in LATENCIES)
    cells = [place.robot_name, place.name, *(f"{limit:.3g}" for limit in limits)]
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Fill the page."""
    before = json.loads(BEFORE.read_text(encoding="utf-8"))
    page = PAGE.read_text(encoding="utf-8")
    rows = list(places())
    limits = [
        "| robot | where | limit before [1/s] | now [1/s] | band [1/s] | at [Hz] "
        "| least damping before [%] | now [%] |",
        "|---|---|---:|---:|---:|---:|---:|---:|",
        *(line(place, before) for place in rows),
    ]
    latencies = [
        "| robot | where | " + " | ".join(f"{1e3 * t:g} ms" for t in LATENCIES) + " |",
        "|---|---|" + "---:|" * len(LATENCIES),
        *(latency_line(place) for place in rows if place.name in LATE),
    ]
    for name, table in (("limits", limits), ("latencies", latencies)):
        begin, end = f"<!-- begin {name} -->\n", f"<!-- end {name} -->"
        head, rest = page.split(begin)
        page = head + begin + "\n".join(table) + "\n" + end + rest.split(end)[1]
    PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
