"""`cdpr-drake robots`: the built-in robots."""

from __future__ import annotations

from argparse import Namespace

from cdpr_drake.commands import Command
from cdpr_drake.commands.terminal import Column, fitted_table, print_wrapped
from cdpr_drake.model.digits import significant


def _list_robots(options: Namespace) -> int:
    """Print the built-in robots with size, mass and cables, then a line on each."""
    import numpy as np

    from cdpr_drake.model.robot import load_robot, robot_names
    from cdpr_drake.model.room import floor_height

    robots = [load_robot(name) for name in robot_names()]
    sizes = []
    for robot in robots:
        points = robot.drawing_points
        spans = [*np.ptp(points[:, :2], axis=0), points[:, 2].max() - floor_height(robot)]
        sizes.append(" x ".join(significant(span) for span in spans))
    columns = [
        Column(("robot", ""), [r.name for r in robots], to_the_left=True),
        Column(("x, y, height", "[m]"), sizes),
        Column(("mass", "[kg]"), [significant(r.mass) for r in robots], rank=1),
        Column(("cables", ""), [str(r.num_cables) for r in robots], rank=2),
    ]
    print(fitted_table(columns))
    print()
    for robot in robots:
        print_wrapped(f"{robot.name}: {robot.description}", indent="    ")
    return 0


COMMAND = Command(
    summary="list the built-in robots",
    description="List the built-in robots: size, mass, cables, description.",
    work=_list_robots,
)
