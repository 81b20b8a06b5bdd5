"""The joint space control loop of Fig. 9: a description of it, and the diagram made from one."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, ClassVar

from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.trajectories import Trajectory

from cdpr_drake.diagrams.robot import make_plant
from cdpr_drake.diagrams.timing import Timing
from cdpr_drake.diagrams.wiring import SystemOrMaker, add_plant, add_reference, check_robot, finish
from cdpr_drake.model.cable_models import cable_model_name
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.statics import DEFAULT_RULE, check_rule
from cdpr_drake.systems import InverseKinematicsAngles, PoseError
from cdpr_drake.systems.fused_plant import fused_refusal


@dataclass(frozen=True, kw_only=True)
class JointSpaceLoop:
    """A joint space control loop, and the way along which a run takes it to its goal.

    Attributes:
        cable_model: of the inverse kinematics; the paper takes "SCMWE" (eq. 8).
        believed: the robot as the controller believes it; the true one if None.
        gain: lambda [1/s] of the exponential approach of a run, as the ideal vision-based law would
            make it; the robot's own or 0.1 if None.
        ramp_time: over which that gain rises from zero at the start [s].
        tensions: how the inverse kinematics chooses them, one of `model.statics.RULES`.

    Raises:
        ValueError: an unknown cable model or rule.
    """

    controller: ClassVar[str] = "JSC"
    timing: ClassVar[Timing] = Timing(sample_time=None, latency=0.0)

    cable_model: str = "SCMWE"
    believed: CableRobot | None = None
    gain: float | None = None
    ramp_time: float = 1.0
    tensions: str = DEFAULT_RULE

    def __post_init__(self) -> None:
        check_rule(self.tensions)
        object.__setattr__(self, "cable_model", cable_model_name(self.cable_model))

    def replace(self, **fields: Any) -> JointSpaceLoop:
        """Return a copy with some `fields` changed."""
        return dataclasses.replace(self, **fields)

    @property
    def label(self) -> str:
        """A short name: "JSC", with the cable model if it is not the paper's."""
        return "JSC" if self.cable_model == "SCMWE" else f"JSC {self.cable_model}"

    def make(
        self,
        robot: CableRobot,
        *,
        reference: SystemOrMaker | Trajectory | None = None,
        parts: tuple[SystemOrMaker, ...] = (),
        fast: bool | None = False,
    ) -> Diagram:
        """Return the diagram of the loop around a robot; see `make_joint_space_control`.

        Args:
            robot: the true robot.
            reference: where the desired pose comes from; an input of the diagram if None.
            parts: what else pulls at the platform.
            fast: whether the plant is a `FusedPlant`; None if it can be.
        """
        check_robot(robot)
        believed = self.believed if self.believed is not None else robot
        check_robot(believed, "the robot is believed to be")
        builder = DiagramBuilder()
        if fast is None:
            fast = not fused_refusal(robot, load_cells=False)
        plant = make_plant(robot, command="desired_motor_angles", load_cells=False, fast=fast)
        external_wrench = add_plant(builder, plant, robot, parts)
        inverse = builder.AddNamedSystem(
            "inverse_kinematics",
            InverseKinematicsAngles(believed, self.cable_model, self.tensions),
        )
        error = builder.AddNamedSystem("true_error", PoseError(robot))
        builder.Connect(inverse.get_output_port(), plant.GetInputPort("desired_motor_angles"))
        builder.Connect(plant.GetOutputPort("pose"), error.GetInputPort("pose"))
        desired = [system.GetInputPort("desired_pose") for system in (inverse, error)]
        add_reference(builder, reference, robot, {"desired_pose": desired})
        builder.ExportInput(external_wrench, "external_wrench")
        builder.ExportOutput(error.get_output_port(), "pose_error")
        return finish(builder, plant, "joint_space_control")


def make_joint_space_control(
    robot: CableRobot,
    *,
    cable_model: str = "SCMWE",
    tensions: str = DEFAULT_RULE,
    believed: CableRobot | None = None,
    reference: SystemOrMaker | Trajectory | None = None,
    parts: tuple[SystemOrMaker, ...] = (),
    fast: bool | None = False,
) -> Diagram:
    """Return the joint space control loop of Fig. 9 around the robot.

    .. pydrake_system::

        name: joint_space_control
        input_ports:
        - desired_pose (without a reference)
        - external_wrench (may stay open)
        output_ports:
        - pose_error
        - desired_motor_angles
        - those of make_cable_robot

    Blocks: "robot" (the plant, see `make_plant`), "inverse_kinematics", "true_error", a
    "reference", whose desired_pose is an output too. Motor angle zero is an absolute, unstretched
    reference, so that the stretch of the cables shows as an error of the pose.

    Args:
        robot: the true robot.
        cable_model: of the inverse kinematics; the paper takes "SCMWE" (eq. 8).
        tensions: how it chooses them, one of `model.statics.RULES`; the paper takes "minimum norm".
        believed: the robot as the controller believes it; the true one if None.
        reference: a system with an output desired_pose, what makes one for a robot, or a Drake
            trajectory of poses; if None, desired_pose is an input of the loop.
        parts: what else pulls at the platform, as for `make_vision_based_control`.
        fast: whether the plant is one `FusedPlant`, for floats only; None, where it can be.

    Raises:
        TypeError: the robot, reference or a part is none.
        ValueError: an unknown cable model; a slot without the ports it needs; what cannot be fast.
    """
    loop = JointSpaceLoop(cable_model=cable_model, believed=believed, tensions=tensions)
    return loop.make(robot, reference=reference, parts=parts, fast=fast)
