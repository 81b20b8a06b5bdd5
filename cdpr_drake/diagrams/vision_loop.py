"""The vision-based control loop of Fig. 8: a description of it, and the diagram made from one."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any, ClassVar

from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import Adder, ConstantVectorSource
from pydrake.trajectories import Trajectory

from cdpr_drake.diagrams.robot import make_plant
from cdpr_drake.diagrams.sensing import GaussianSensing, Measurements, PlantToMeasure, Sensing
from cdpr_drake.diagrams.timing import Timing
from cdpr_drake.diagrams.wiring import (
    SystemOrMaker,
    add_noise,
    add_once,
    add_plant,
    add_reference,
    check_robot,
    class_of,
    export,
    finish,
    made,
)
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.servo import ServoSettings
from cdpr_drake.systems import (
    ModelledTangents,
    ModelledTension,
    PlausibleTension,
    PoseError,
    PositionBasedVisualServo,
)
from cdpr_drake.systems.fused_plant import fused_refusal

NOISE_PERIOD = 0.05
"""How long a noise sample lasts in an all-continuous loop with noise [s]."""


@dataclass(frozen=True, kw_only=True)
class VisionLoop:
    """A vision-based control loop, whatever the robot: each of its parts in a slot.

    Attributes:
        law: settings of the paper's law; or a system with its ports, which fits in one diagram; or
            what makes such a system for the robot as the controller believes it.
        sensing: what it measures with.
        timing: when it looks and acts.
        believed: the robot as the controller believes it; the true one if None.

    Raises:
        ValueError: the gain is too high for the period.
    """

    controller: ClassVar[str] = "VBC"

    law: ServoSettings | SystemOrMaker = field(default_factory=ServoSettings)
    sensing: Sensing = field(default_factory=GaussianSensing)
    timing: Timing = field(default_factory=Timing)
    believed: CableRobot | None = None

    def __post_init__(self) -> None:
        if isinstance(self.law, ServoSettings) and self.law.gain is not None:
            self.timing.check_gain(self.law.gain)

    def replace(self, **fields: Any) -> VisionLoop:
        """Return a copy with some `fields` changed: its own, its timing's or its law's.

        Raises:
            TypeError: there is no such field, or the law is none with settings.
        """
        own = {f.name for f in dataclasses.fields(self)}
        timing = {f.name for f in dataclasses.fields(Timing)}
        changed = {name: value for name, value in fields.items() if name in own}
        rest = {name: value for name, value in fields.items() if name not in own}
        when = {name: rest.pop(name) for name in timing & rest.keys()}
        if when:
            changed["timing"] = dataclasses.replace(changed.get("timing", self.timing), **when)
        if unknown := rest.keys() - {f.name for f in dataclasses.fields(ServoSettings)}:
            raise TypeError(
                f"{', '.join(sorted(unknown))}: neither a field of a vision-based loop nor of its "
                "timing or law"
            )
        if rest:
            law = changed.get("law", self.law)
            if not isinstance(law, ServoSettings):
                raise TypeError(
                    f"{', '.join(rest)}: the law is {law!r}, which has no such settings"
                )
            changed["law"] = dataclasses.replace(law, **rest)
        return dataclasses.replace(self, **changed)

    @property
    def cable_model(self) -> str | None:
        """The law's cable model, None if it is a law of a user's own."""
        return self.law.cable_model if isinstance(self.law, ServoSettings) else None

    @property
    def gain(self) -> float | None:
        """The law's gain lambda [1/s], None if it is open, or the law a user's own."""
        return self.law.gain if isinstance(self.law, ServoSettings) else None

    @property
    def ramp_time(self) -> float:
        """Over which the law's gain rises from zero at the start [s]."""
        return self.law.ramp_time if isinstance(self.law, ServoSettings) else 0.0

    @property
    def label(self) -> str:
        """A short name: "VBC" and the law's cable model, or what the law is called."""
        if isinstance(self.law, ServoSettings):
            return f"VBC {self.law.cable_model}"
        return f"VBC {getattr(self.law, '__name__', type(self.law).__name__)}"

    def slow_only(self, robot: CableRobot) -> str:
        """Return why the plant has to be in blocks around a robot, "" if the fast one will do.

        Args:
            robot: the true robot.
        """
        load_cells = getattr(self.sensing, "load_cells", True)
        outages = getattr(self.sensing, "outages", ())
        return fused_refusal(robot, outages=outages, load_cells=load_cells)

    def make(
        self,
        robot: CableRobot,
        *,
        reference: SystemOrMaker | Trajectory | None = None,
        parts: tuple[SystemOrMaker, ...] = (),
        noise: bool = False,
        fast: bool | None = False,
    ) -> Diagram:
        """Return the diagram of the loop around a robot; see `make_vision_based_control`.

        Args:
            robot: the true robot.
            reference: where the desired pose comes from; an input of the diagram if None.
            parts: what else pulls at the platform.
            noise: whether to add sources of measurement noise.
            fast: whether the plant is a `FusedPlant`; None if it can be.

        Raises:
            GeometryError, RenderingError, RobotFileError, TypeError, ValueError: as there.
        """
        check_robot(robot)
        believed = self.believed if self.believed is not None else robot
        check_robot(believed, "the robot is believed to be")
        if believed.num_cables != robot.num_cables:
            raise ValueError(
                f"{believed.num_cables} cables in the robot as it is believed, "
                f"{robot.num_cables} in the true one"
            )
        law = self._law(robot, believed)
        builder = DiagramBuilder()
        plant = make_plant(
            robot,
            believed=believed,
            load_cells=getattr(self.sensing, "load_cells", True),
            outages=getattr(self.sensing, "outages", ()),
            fast=not self.slow_only(robot) if fast is None else fast,
        )
        external_wrench = add_plant(builder, plant, robot, parts)
        found = self._sensed(builder, plant, robot, believed)
        add_once(builder, "servo", law, "control law")
        error = builder.AddNamedSystem("true_error", PoseError(robot))
        builder.Connect(plant.GetOutputPort("pose"), error.GetInputPort("pose"))
        rates = self.timing.held_rates(builder, law.GetOutputPort("motor_rates"))
        builder.Connect(rates, plant.GetInputPort("motor_rates"))
        measured = self.timing.sampled(builder, found.ports, found.samples)
        law_inputs = self._feed_law(builder, law, believed, measured, found)
        desired = [error.GetInputPort("desired_pose")]
        if "desired_pose" in law_inputs:
            desired.insert(0, law_inputs.pop("desired_pose"))
        wanted = {"desired_pose": desired}
        wanted |= {name: [port] for name, port in law_inputs.items()}
        add_reference(builder, reference, robot, wanted)
        builder.ExportInput(external_wrench, "external_wrench")
        inputs = dict(found.noise)
        if plant.HasInputPort("tension_noise"):
            inputs["tension_noise"] = plant.GetInputPort("tension_noise")
        add_noise(builder, inputs, noise, self.timing.sample_time or NOISE_PERIOD)
        export(builder, found.outputs)
        if law.HasOutputPort("pose_error"):
            builder.ExportOutput(law.GetOutputPort("pose_error"), "pose_error_seen")
        builder.ExportOutput(error.get_output_port(), "pose_error")
        builder.ExportOutput(rates, "commanded_motor_rates")
        return finish(builder, plant, "vision_based_control")

    def _law(self, robot: CableRobot, believed: CableRobot) -> System:
        """Return the system of the law, known to give motor rates."""
        if isinstance(self.law, ServoSettings):
            settings = self.law.of(robot)
            self.timing.check_gain(settings.gain_at(settings.ramp_time))
            return PositionBasedVisualServo(believed, settings)
        law = made(self.law, believed, "control law")
        if not law.HasOutputPort("motor_rates"):
            raise ValueError(f'the control law, {class_of(law)}, has no output "motor_rates"')
        return law

    def _sensed(
        self, builder: DiagramBuilder, plant: System, robot: CableRobot, believed: CableRobot
    ) -> Measurements:
        """Add the sensors and return what they give."""
        seen = PlantToMeasure(system=plant, robot=robot, believed=believed, timing=self.timing)
        add_to = getattr(self.sensing, "add_to", None)
        if add_to is None or isinstance(self.sensing, type):
            raise TypeError(f"sensing is a value with a method add_to, got {self.sensing!r}")
        found = add_to(builder, seen)
        if not isinstance(found, Measurements):
            raise TypeError(f"add_to of {self.sensing!r} has to return Measurements, got {found!r}")
        if "pose" not in found.ports:
            given = ", ".join(found.ports) or "nothing"
            raise ValueError(f'sensing has to give a "pose", and gives {given}')
        return found

    def _feed_law(
        self,
        builder: DiagramBuilder,
        law: System,
        believed: CableRobot,
        measured: dict[str, OutputPort],
        found: Measurements,
    ) -> dict[str, Any]:
        """Connect the law, by what it takes from the model and the judge of its load cells.

        Return the inputs of the law that are still open.
        """
        if "tension" not in measured:
            model = builder.AddNamedSystem("tension_model", ModelledTension(believed))
            builder.Connect(measured["pose"], model.get_input_port())
            measured["tension"] = model.get_output_port()
        judge = PlausibleTension(believed, self.timing.sample_time)
        plausible = builder.AddNamedSystem("plausible_tension", judge)
        for name in ("pose", "tension"):
            builder.Connect(measured[name], plausible.GetInputPort(f"measured_{name}"))
        judged = plausible.GetOutputPort("plausible_tension")
        if "tangents" not in measured:
            model = builder.AddNamedSystem("tangent_model", ModelledTangents(believed))
            builder.Connect(measured["pose"], model.GetInputPort("measured_pose"))
            builder.Connect(judged, model.GetInputPort("measured_tension"))
            measured["tangents"] = model.get_output_port()
        export(builder, {f"measured_{name}": port for name, port in measured.items()})
        builder.ExportOutput(plausible.GetOutputPort("cell_health"), "cell_health")
        ports = (law.get_input_port(i) for i in range(law.num_input_ports()))
        inputs = {port.get_name(): port for port in ports}
        for name, port in (measured | {"tension": judged}).items():
            if f"measured_{name}" in inputs:
                builder.Connect(port, inputs.pop(f"measured_{name}"))
        if "age" in inputs:
            builder.Connect(self._age(builder, found), inputs.pop("age"))
        return inputs

    def _age(self, builder: DiagramBuilder, found: Measurements) -> OutputPort:
        """Return how long before the motor rates change the measured pose was taken [s]."""
        latency = builder.AddNamedSystem("latency", ConstantVectorSource([self.timing.delay]))
        if found.age is None:
            return latency.get_output_port()
        age = builder.AddNamedSystem("age", Adder(2, 1))
        sampled = self.timing.sampled(builder, {"age": found.age}, {"age"})
        builder.Connect(latency.get_output_port(), age.get_input_port(0))
        builder.Connect(sampled["age"], age.get_input_port(1))
        return age.get_output_port()


def make_vision_based_control(
    robot: CableRobot,
    cable_model: str | None = None,
    gain: float | None = None,
    sample_time: float | None = 0.05,
    latency: float = 0.04,
    *,
    law: ServoSettings | SystemOrMaker | None = None,
    sensing: Sensing | None = None,
    believed: CableRobot | None = None,
    reference: SystemOrMaker | Trajectory | None = None,
    parts: tuple[SystemOrMaker, ...] = (),
    noise: bool = False,
    fast: bool | None = False,
    **servo: Any,
) -> Diagram:
    """Return the vision-based control loop of Fig. 8 around the robot.

    .. pydrake_system::

        name: vision_based_control
        input_ports:
        - desired_pose (without a reference)
        - desired_twist (may stay open)
        - external_wrench (may stay open)
        - pose_noise, tangent_noise, tension_noise (without `noise`; may stay open)
        output_ports:
        - pose_error_seen (of a law that has an output pose_error)
        - pose_error
        - measured_pose
        - measured_tangents
        - measured_tension
        - cell_health
        - commanded_motor_rates
        - desired_motor_angles
        - those of make_cable_robot

    Blocks: "robot" (the plant, see `make_plant`), "true_error", "plausible_tension", "servo" (the
    law), those of the sensing, a "reference", whose desired_pose is an output too; in the sampled
    loop "sampled_pose", "sampled_tangents", "sampled_tension" and "held_rates". Measurements are
    taken at k T; the motor rates change at k T + latency and are held.

    A law of one's own has an output motor_rates (k) [rad/s] and any of the inputs measured_pose,
    measured_tangents, measured_tension, other measurements of the sensing by name, desired_pose,
    desired_twist, and age [s]: how long before the rates change the measured pose was taken. Its
    other inputs become inputs of the loop.

    Args:
        robot: the true robot.
        cable_model: the paper's law's "ECM", "CMWE", "SCMWE" (if None) or "SLSM".
        gain: lambda [1/s]; if None, the robot's own where its file names one, else 0.1. Whether
            that is below the limit at a goal, `analysis.default_gain` knows.
        sample_time: period T of the vision loop [s]; None for an all-continuous loop.
        latency: from image to change of the motor rates [s]; without effect if all is continuous.
        law: settings of the paper's law, which then say cable model and gain; or a system, or what
            makes one for the robot as it is believed.
        sensing: `GaussianSensing()` if None, `TargetSensing`, `ImageSensing`, `ModelledSensing`, or
            one of a user's own.
        believed: the robot as the controller believes it; the true one if None.
        reference: a system with outputs desired_pose and perhaps desired_twist, what makes one for
            a robot, or a Drake trajectory of poses; if None, desired_pose is an input of the loop.
        parts: what else pulls at the platform: systems with an output "wrench" (6) [torque; force]
            at its origin in W, and inputs called as outputs of the plant.
        noise: whether to add named sources of measurement noise; otherwise noise ports are
            exported. Sources hold discrete and abstract state, which no linearisation takes.
        fast: whether the plant is one `FusedPlant`: the same loop, some three times as fast, for
            floats only; None, where it can be.
        servo: other fields of ServoSettings (order, ramp_time, max_speed, max_angular_speed,
            model_drum_run).

    Raises:
        GeometryError: the cables cannot control all six degrees of freedom.
        RenderingError: with images, Drake cannot render on this machine.
        RobotFileError: with targets or images, the robot lacks the cameras or patterns they need.
        TypeError: the robot, law, sensing, reference or a part is none.
        ValueError: a gain, period or latency out of range; gain * sample_time >= 1; what is said
            both in a law and beside it; a slot without the ports it needs, or with a system that is
            in a diagram already; what cannot be fast.
    """
    given = {"cable_model": cable_model, "gain": gain, **servo}
    given = {name: value for name, value in given.items() if value is not None}
    if law is not None and given:
        raise ValueError(f"{', '.join(given)}: the law says that; give the one or the other")
    loop = VisionLoop(
        law=ServoSettings() if law is None else law,
        sensing=GaussianSensing() if sensing is None else sensing,
        timing=Timing(sample_time=sample_time, latency=latency),
        believed=believed,
    ).replace(**given)
    return loop.make(robot, reference=reference, parts=parts, noise=noise, fast=fast)
