"""The platform's pose as Drake's SceneGraph takes it."""

from __future__ import annotations

from pydrake.common.value import AbstractValue, Value
from pydrake.geometry import FrameId, FramePoseVector
from pydrake.systems.framework import Context, LeafSystem

from cdpr_drake.model.rotations import vector_to_pose
from cdpr_drake.systems._template import check_finite


class PoseInScene(LeafSystem):
    """The pose of one frame of a SceneGraph from a pose vector.

    .. pydrake_system::

        name: PoseInScene
        input_ports:
        - pose
        output_ports:
        - frame_poses

    pose is [roll, pitch, yaw, x, y, z] (rad, m) of X_WP; frame_poses is a FramePoseVector.

    Args:
        frame: the frame that moves with the platform.
    """

    def __init__(self, frame: FrameId) -> None:
        super().__init__()
        self._frame = frame
        self._pose_port = self.DeclareVectorInputPort("pose", 6)
        tickets = {self._pose_port.ticket()}
        self.DeclareAbstractOutputPort(
            "frame_poses", lambda: Value(FramePoseVector()), self._calc_poses, tickets
        )

    def _calc_poses(self, context: Context, output: AbstractValue) -> None:
        pose = self._pose_port.Eval(context)
        check_finite(pose, self, context, "inputs")
        output.get_mutable_value().set_value(self._frame, vector_to_pose(pose))
