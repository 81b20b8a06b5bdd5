"""`cdpr-drake robots`: the built-in robots."""

from __future__ import annotations

import sys

import numpy as np

from cdpr_drake.commands.terminal import Column, fitting, print_wrapped, table, width_of
from cdpr_drake.model.robot import load_robot, robot_names


def list_robots() -> int:
    """Print the built-in robots with size, mass and cables, then a line on each; return 0."""
    robots = [load_robot(name) for name in robot_names()]
    sizes = []
    for robot in robots:
        points = robot.drawing_points
        spans = [*np.ptp(points[:, :2], axis=0), points[:, 2].max()]
        sizes.append(" x ".join(f"{span:.1f}" for span in spans))
    columns = [
        Column(heading=("robot", ""), cells=[r.name for r in robots], to_the_left=True),
        Column(heading=("x, y, height", "[m]"), cells=sizes),
        Column(heading=("mass", "[kg]"), cells=[f"{r.mass:.0f}" for r in robots], rank=1),
        Column(heading=("cables", ""), cells=[str(r.num_cables) for r in robots], rank=2),
    ]
    print(table(fitting(columns, width_of(sys.stdout))))
    print()
    for robot in robots:
        print_wrapped(f"{robot.name}: {robot.description}", indent="    ")
    return 0
