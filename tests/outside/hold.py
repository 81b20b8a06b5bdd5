"""A command of one's own: the tensions that hold the platform somewhere, one to a line."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from cdpr_drake.commands import Command, UsageError
from cdpr_drake.commands import arguments as common


def add_arguments(parser: ArgumentParser) -> None:
    """Add the options to a `parser`."""
    parser.add_argument("--robot", **common.ROBOT)
    parser.add_argument("--height", type=float, default=1.0, metavar="M", help="of the platform")


def work(options: Namespace) -> int:
    """Do what the `options` say and return the exit status."""
    if options.height <= 0.0:
        raise UsageError("--height: above the ground")
    import cdpr_drake as cdpr
    from cdpr_drake.commands.resolve import resolve_robot
    from cdpr_drake.diagrams import make_cable_robot
    from cdpr_drake.study import equilibrium

    diagram = make_cable_robot(resolve_robot(options.robot))
    context = equilibrium(diagram, cdpr.pose(z=options.height))
    for tension in diagram.GetOutputPort("tension_at_drawing_point").Eval(context):
        print(f"{tension:.3f}")
    return 0


COMMAND = Command(
    summary="tell the tensions that hold the platform",
    description="Tell the tensions at the drawing points that hold the platform at a height.",
    example="--height 2",
    add_arguments=add_arguments,
    work=work,
)
