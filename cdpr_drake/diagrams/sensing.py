"""What the vision-based loop measures with: one of several values, each with its own options.

A value of a user's own fits in the slot too: an object with `add_to`, and perhaps with `load_cells`
and `outages`, as `Sensing` has them; or a class derived from one of these.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort, System

from cdpr_drake.diagrams.rendering import make_pose_camera_images
from cdpr_drake.diagrams.timing import Timing
from cdpr_drake.model.modelled import MODELLED
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.vision.outages import LOAD_CELL, Outage
from cdpr_drake.model.vision.pose import ESTIMATORS
from cdpr_drake.systems import (
    CableTangentCameras,
    CameraMeasurement,
    ImageTargets,
    ModelledTension,
    StereoImageCameras,
    StereoTangentCameras,
    TargetCameras,
)


@dataclass(frozen=True, kw_only=True)
class PlantToMeasure:
    """What sensing is given: the plant that it measures, in the loop around it.

    Attributes:
        system: the plant, already in the builder; its outputs are those of `make_plant`.
        robot: the true robot.
        believed: the robot as the controller believes it.
        timing: when measurements are taken.
    """

    system: System
    robot: CableRobot
    believed: CableRobot
    timing: Timing

    def __getitem__(self, name: str) -> OutputPort:
        """Return an output port of the plant."""
        return self.system.GetOutputPort(name)


@dataclass(frozen=True, kw_only=True)
class Measurements:
    """What sensing gives to the loop.

    Attributes:
        ports: measurements by name. The loop samples each, exports it as "measured_..." and gives
            it to a law that has an input of that name. "pose" has to be there; the law of the paper
            takes "tension" and "tangents" too, and has them from the model where they are missing.
        noise: inputs for noise by the name of the loop's, which the loop exports or feeds.
        outputs: what else the loop exports, by name.
        samples: names of the measurements that come from systems which sample by themselves.
        age: how long ago the pose held was taken, beyond the loop's latency [s]; None if it is
            always fresh.
    """

    ports: Mapping[str, OutputPort]
    noise: Mapping[str, InputPort] = field(default_factory=dict)
    outputs: Mapping[str, OutputPort] = field(default_factory=dict)
    samples: frozenset[str] = frozenset()
    age: OutputPort | None = None


class Sensing(Protocol):
    """What fits in the slot. Only `add_to` is asked for; the rest counts as here if missing.

    Attributes:
        load_cells: whether the plant's load cells are read, True if missing.
        outages: when sensors fail, none if missing; those of load cells count in the plant.
    """

    def add_to(self, builder: DiagramBuilder, plant: PlantToMeasure) -> Measurements:
        """Add the sensors to a loop and return what they give.

        Args:
            builder: of the loop.
            plant: what is measured.
        """


@dataclass(frozen=True, kw_only=True)
class GaussianSensing:
    """The truth with Gaussian noise: pose, tangents and tensions.

    Blocks "camera" and "tangent_cameras"; inputs pose_noise, tangent_noise and tension_noise.

    Attributes:
        outages: when load cells are stuck or dead; there are no cameras that could fail.

    Raises:
        ValueError: an outage of a camera.
    """

    name: ClassVar[str] = "gaussian"

    outages: tuple[Outage, ...] = ()

    def __post_init__(self) -> None:
        for outage in self.outages:
            if outage.sensor != LOAD_CELL:
                raise ValueError(
                    f"an outage of a {outage.sensor} means nothing where the truth is measured "
                    "with Gaussian noise: take TargetSensing or ImageSensing"
                )

    def add_to(
        self, builder: DiagramBuilder, plant: PlantToMeasure, without: tuple[str, ...] = ()
    ) -> Measurements:
        """Add the sensors; see `Sensing`.

        Args:
            builder: of the loop.
            plant: what is measured.
            without: "tensions" or "tangents" that are not measured.
        """
        camera = CameraMeasurement(plant.robot, plant.believed)
        builder.AddNamedSystem("camera", camera)
        builder.Connect(plant["pose"], camera.GetInputPort("pose"))
        ports = {"pose": camera.get_output_port()}
        noise = {"pose_noise": camera.GetInputPort("noise")}
        ports["tension"] = _tension(builder, plant, ports["pose"], without)
        if "tangents" not in without:
            pairs = builder.AddNamedSystem("tangent_cameras", CableTangentCameras(plant.robot))
            builder.Connect(plant["tangents_at_drawing_point"], pairs.GetInputPort("tangents"))
            ports["tangents"] = pairs.get_output_port()
            noise["tangent_noise"] = pairs.GetInputPort("noise")
        return Measurements(ports=ports, noise=noise)


@dataclass(frozen=True, kw_only=True)
class TargetSensing:
    """What cameras see: pose from the patterns' points, tangents from the cables' edges.

    Blocks "camera" (`TargetCameras`) and "tangent_cameras" (`StereoTangentCameras`), which sample
    by themselves. The loop then has outputs num_targets, num_cameras, age, frames_lost and
    images_lost (of the pose), valid_tangents and tangent_frames_lost too.

    Attributes:
        estimator: of the pose, "joint" or "mean" (the paper's).
        outages: when cameras see nothing, and load cells are stuck or dead.

    Raises:
        ValueError: an unknown estimator.
    """

    name: ClassVar[str] = "targets"

    estimator: str = "joint"
    outages: tuple[Outage, ...] = ()

    def __post_init__(self) -> None:
        if self.estimator not in ESTIMATORS:
            known = ", ".join(ESTIMATORS)
            raise ValueError(f'unknown estimator "{self.estimator}"; known are {known}')

    def add_to(
        self, builder: DiagramBuilder, plant: PlantToMeasure, without: tuple[str, ...] = ()
    ) -> Measurements:
        """Add the sensors; see `Sensing`.

        Args:
            builder: of the loop.
            plant: what is measured.
            without: "tensions" or "tangents" that are not measured.

        Raises:
            RobotFileError: the robot lacks the cameras or patterns they need.
            ValueError: no sampling or no latency; an outage of a camera that is not there.
        """
        if plant.timing.sample_time is None:
            raise ValueError("cameras that see take images: give a sample time")
        if plant.timing.latency <= 0.0:
            raise ValueError("cameras that see take time: the latency must be above 0")
        camera, noise = self.add_pose_cameras(builder, plant)
        ports = {"pose": camera.GetOutputPort("measured_pose")}
        ports["tension"] = _tension(builder, plant, ports["pose"], without)
        names = ("num_targets", "num_cameras", "age", "frames_lost", "images_lost")
        outputs = {name: camera.GetOutputPort(name) for name in names}
        samples = {"pose", "tangents"} | ({"tension"} if "tensions" in without else set())
        if "tangents" not in without:
            pairs = builder.AddNamedSystem("tangent_cameras", self.tangent_cameras(plant))
            for name, port in {
                "tangents": plant["tangents_at_drawing_point"],
                "tension_at_drawing_point": plant["tension_at_drawing_point"],
                "measured_pose": ports["pose"],
                "measured_tension": ports["tension"],
            }.items():
                builder.Connect(port, pairs.GetInputPort(name))
            ports["tangents"] = pairs.GetOutputPort("measured_tangents")
            noise["tangent_noise"] = pairs.GetInputPort("noise")
            outputs["valid_tangents"] = pairs.GetOutputPort("valid_tangents")
            outputs["tangent_frames_lost"] = pairs.GetOutputPort("frames_lost")
        return Measurements(
            ports=ports,
            noise=noise,
            outputs=outputs,
            samples=frozenset(samples),
            age=outputs["age"],
        )

    def add_pose_cameras(
        self, builder: DiagramBuilder, plant: PlantToMeasure
    ) -> tuple[System, dict[str, InputPort]]:
        """Add the block "camera" and return it, and its inputs for noise by name.

        Args:
            builder: of the loop.
            plant: what is measured.
        """
        camera = TargetCameras(
            plant.robot, plant.believed, plant.timing.sample_time, self.estimator, self.outages
        )
        builder.AddNamedSystem("camera", camera)
        builder.Connect(plant["pose"], camera.GetInputPort("pose"))
        return camera, {"pose_noise": camera.GetInputPort("noise")}

    def tangent_cameras(self, plant: PlantToMeasure) -> System:
        """Return the stereo pairs.

        Args:
            plant: what is measured.
        """
        period = plant.timing.sample_time
        return StereoTangentCameras(plant.robot, plant.believed, period, self.outages)


@dataclass(frozen=True, kw_only=True)
class ImageSensing(TargetSensing):
    """Points and edges detected in rendered and drawn images, some tenths of a second a frame.

    As `TargetSensing`, with estimator and outages too, by `ImageTargets` and `StereoImageCameras`.
    A block "pose_camera_images" renders, and each image has a noise of its own: pose_noise_1, ...
    instead of pose_noise.
    """

    name: ClassVar[str] = "images"

    def add_pose_cameras(
        self, builder: DiagramBuilder, plant: PlantToMeasure
    ) -> tuple[System, dict[str, InputPort]]:
        """Add the blocks "camera" and "pose_camera_images"; return the former, and noise inputs.

        Args:
            builder: of the loop.
            plant: what is measured.

        Raises:
            RenderingError: Drake cannot render on this machine.
        """
        period = plant.timing.sample_time
        camera = ImageTargets(plant.believed, period, self.estimator, self.outages)
        builder.AddNamedSystem("camera", camera)
        images = make_pose_camera_images(plant.robot)
        builder.AddNamedSystem("pose_camera_images", images)
        builder.Connect(plant["pose"], images.GetInputPort("pose"))
        numbers = range(1, camera.num_cameras + 1)
        for n in numbers:
            builder.Connect(images.GetOutputPort(f"image_{n}"), camera.GetInputPort(f"image_{n}"))
        return camera, {f"pose_noise_{n}": images.GetInputPort(f"noise_{n}") for n in numbers}

    def tangent_cameras(self, plant: PlantToMeasure) -> System:
        """Return the stereo pairs.

        Args:
            plant: what is measured.
        """
        period = plant.timing.sample_time
        return StereoImageCameras(plant.robot, plant.believed, period, self.outages)


@dataclass(frozen=True, kw_only=True)
class ModelledSensing:
    """Fewer sensors: what they would measure the law takes from the model at the measured pose.

    Blocks "tension_model" and "tangent_model" instead of the sensors.

    Attributes:
        modelled: "tensions", "tangents" or both.
        cameras: what measures the rest.

    Raises:
        ValueError: what cannot be modelled, or is named twice; an outage of a load cell that is
            not read.
    """

    modelled: tuple[str, ...] = MODELLED
    cameras: GaussianSensing | TargetSensing = field(default_factory=GaussianSensing)

    def __post_init__(self) -> None:
        for name in self.modelled:
            if name not in MODELLED or self.modelled.count(name) > 1:
                raise ValueError(f'cannot model "{name}"; known are {", ".join(MODELLED)}')
        if not self.load_cells and any(o.sensor == LOAD_CELL for o in self.outages):
            raise ValueError("an outage of a load cell means nothing where tensions are modelled")

    @property
    def name(self) -> str:
        """What measures, and what does not."""
        return f"{self.cameras.name}, {' and '.join(self.modelled)} modelled"

    @property
    def load_cells(self) -> bool:
        """Whether the plant's load cells are read."""
        return "tensions" not in self.modelled

    @property
    def outages(self) -> tuple[Outage, ...]:
        """When sensors fail."""
        return self.cameras.outages

    def add_to(self, builder: DiagramBuilder, plant: PlantToMeasure) -> Measurements:
        """Add the sensors; see `Sensing`.

        Args:
            builder: of the loop.
            plant: what is measured.
        """
        return self.cameras.add_to(builder, plant, self.modelled)


SENSORS = ("gaussian", "targets", "images")
"""Names of sensing on a command line: `GaussianSensing`, `TargetSensing` and `ImageSensing`."""


def sensing_called(name: str, estimator: str | None = None) -> GaussianSensing | TargetSensing:
    """Return a sensing by its name.

    Args:
        name: one of `SENSORS`.
        estimator: of the pose, "joint" or "mean", of sensing that has one; its default if None.

    Raises:
        ValueError: an unknown name or estimator; an estimator where nothing is estimated.
    """
    if name not in SENSORS:
        raise ValueError(f'unknown sensors "{name}"; known are {", ".join(SENSORS)}')
    if name == "gaussian":
        if estimator is not None:
            raise ValueError("an estimator means nothing where the pose itself is measured")
        return GaussianSensing()
    seeing = TargetSensing if name == "targets" else ImageSensing
    return seeing() if estimator is None else seeing(estimator=estimator)


def _tension(
    builder: DiagramBuilder, plant: PlantToMeasure, pose: OutputPort, without: tuple[str, ...]
) -> OutputPort:
    """Return the load cells' tensions, or add a model that gives them at a measured pose."""
    if "tensions" not in without:
        return plant["measured_tension"]
    model = builder.AddNamedSystem("tension_model", ModelledTension(plant.believed))
    builder.Connect(pose, model.get_input_port())
    return model.get_output_port()
