"""Vision-based control of cable-driven parallel robots with sagging cables, on Drake.

The system of Dallej, Gouttefarde, Andreff, Herve and Martinet, "Modeling and vision-based control
of large-dimension cable-driven parallel robots using a multiple-camera setup" (Mechatronics, 2019).

    import cdpr_drake as cdpr
    robot = cdpr.load_robot("cogiro")
    goal = cdpr.pose(x=1.0, z=1.5, yaw_deg=10.0)

Pieces are in `cdpr_drake.systems`, loops in `cdpr_drake.diagrams`, questions to ask of them in
`cdpr_drake.study`, the mathematics without Drake in `cdpr_drake.model`.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cdpr_drake.model.robot import CableRobot, load_robot, robot_names, save_robot
    from cdpr_drake.model.rotations import pose

__version__ = "0.2.0.dev0"

__all__ = ["CableRobot", "__version__", "load_robot", "pose", "robot_names", "save_robot"]

_MODULES = {"pose": "cdpr_drake.model.rotations"}
"""Of the names that are not of `cdpr_drake.model.robot`."""

_ROOMS = ("analysis", "batch", "diagrams", "model", "runs", "show", "study", "systems")


def __getattr__(name: str) -> Any:
    """Import a room of the package, or what it offers of robots and poses, when first asked for.

    Args:
        name: of the room, or of what is offered.
    """
    if name in _ROOMS:
        return importlib.import_module(f"cdpr_drake.{name}")
    if name in __all__:
        return getattr(importlib.import_module(_MODULES.get(name, "cdpr_drake.model.robot")), name)
    raise AttributeError(f"module 'cdpr_drake' has no attribute '{name}'")


def __dir__() -> list[str]:
    """Return what there is, imported already or not."""
    return sorted({*globals(), *__all__, *_ROOMS})
