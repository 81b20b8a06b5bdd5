"""Vision-based control of cable-driven parallel robots with sagging cables, on Drake.

The system of Dallej, Gouttefarde, Andreff, Herve and Martinet, "Modeling and vision-based control
of large-dimension cable-driven parallel robots using a multiple-camera setup" (Mechatronics, 2019).

    import cdpr_drake as cdpr
    robot = cdpr.load_robot("cogiro")

Pieces are in `cdpr_drake.systems`, loops in `cdpr_drake.diagrams`, questions to ask of them in
`cdpr_drake.study`, the mathematics without Drake in `cdpr_drake.model`.
"""

import importlib
from types import ModuleType

from cdpr_drake.model.robot import CableRobot, load_robot, robot_names, save_robot

__version__ = "0.2.0.dev0"

__all__ = ["CableRobot", "__version__", "load_robot", "robot_names", "save_robot"]

_ROOMS = ("diagrams", "experiments", "model", "show", "study", "systems")


def __getattr__(name: str) -> ModuleType:
    """Import a room of the package, by its `name`, when it is first asked for."""
    if name in _ROOMS:
        return importlib.import_module(f"cdpr_drake.{name}")
    raise AttributeError(f"module 'cdpr_drake' has no attribute '{name}'")
