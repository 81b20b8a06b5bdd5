"""Vision-based control of cable-driven parallel robots with sagging cables, on Drake.

The system of Dallej, Gouttefarde, Andreff, Herve and Martinet, "Modeling and vision-based control of
large-dimension cable-driven parallel robots using a multiple-camera setup", Mechatronics 61, 2019.

    import cdpr_drake as cdpr
    robot = cdpr.load_robot("cogiro")

Pieces are in `cdpr_drake.systems`, loops in `cdpr_drake.diagrams`, questions to ask of them in
`cdpr_drake.study`, the mathematics without Drake in `cdpr_drake.model`.
"""

from cdpr_drake.model.robot import CableRobot, load_robot, robot_names, save_robot

__version__ = "0.1.0"

__all__ = ["CableRobot", "__version__", "load_robot", "robot_names", "save_robot"]
