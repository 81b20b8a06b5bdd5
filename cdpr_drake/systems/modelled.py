"""Blocks that stand in for sensors: tensions and tangents from the model at the measured pose."""

from __future__ import annotations

from pydrake.systems.framework import BasicVector, Context, LeafSystem

from cdpr_drake.model.modelled import modelled_tangents, modelled_tensions
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import vector_to_pose
from cdpr_drake.systems._template import finite_inputs


class ModelledTension(LeafSystem):
    """The cables' tensions as a controller without load cells has to believe them.

    .. pydrake_system::

        name: ModelledTension
        input_ports:
        - measured_pose
        output_ports:
        - measured_tension

    The tensions of least norm that hold the weight at the measured pose (A.2). measured_pose is
    [roll, pitch, yaw, x, y, z] (rad, m) of X_WP; measured_tension (k) [N] at the drawing points.
    There is no AutoDiffXd.

    Args:
        robot: the robot as the controller believes it.
    """

    def __init__(self, robot: CableRobot) -> None:
        super().__init__()
        self.robot = robot
        self._pose_port = self.DeclareVectorInputPort("measured_pose", 6)
        self.DeclareVectorOutputPort("measured_tension", robot.num_cables, self._calc)

    def _calc(self, context: Context, output: BasicVector) -> None:
        pose = self._pose_port.Eval(context)
        finite_inputs(self, context, pose)
        output.SetFromVector(modelled_tensions(self.robot, vector_to_pose(pose)))


class ModelledTangents(LeafSystem):
    """The cables' directions at A as a controller without stereo pairs has to believe them.

    .. pydrake_system::

        name: ModelledTangents
        input_ports:
        - measured_pose
        - measured_tension
        output_ports:
        - measured_tangents

    Those of parabolas (SCMWE) that hang at the measured pose and bear the measured tension at A.
    measured_pose is [roll, pitch, yaw, x, y, z] (rad, m) of X_WP; measured_tension (k) [N];
    measured_tangents (3 k) are unit vectors from A to B in W. There is no AutoDiffXd.

    Args:
        robot: the robot as the controller believes it.
    """

    def __init__(self, robot: CableRobot) -> None:
        super().__init__()
        self.robot = robot
        k = robot.num_cables
        self._pose_port = self.DeclareVectorInputPort("measured_pose", 6)
        self._tension_port = self.DeclareVectorInputPort("measured_tension", k)
        self.DeclareVectorOutputPort("measured_tangents", 3 * k, self._calc)

    def _calc(self, context: Context, output: BasicVector) -> None:
        pose, tension = self._pose_port.Eval(context), self._tension_port.Eval(context)
        finite_inputs(self, context, pose, tension)
        tangents = modelled_tangents(self.robot, vector_to_pose(pose), tension)
        output.SetFromVector(tangents.ravel())
