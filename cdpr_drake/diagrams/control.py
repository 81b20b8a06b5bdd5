"""The two control loops of the paper: vision-based (Fig. 8) and joint space control (Fig. 9)."""

from __future__ import annotations

import math
from typing import Any

from pydrake.common import RandomDistribution
from pydrake.systems.framework import (
    Diagram,
    DiagramBuilder,
    InputPort,
    LeafSystem,
    OutputPort,
    System,
)
from pydrake.systems.primitives import DiscreteTimeDelay, RandomSource, ZeroOrderHold

from cdpr_drake.diagrams.eyes import add_pose_cameras, add_tangent_cameras, check_sensors
from cdpr_drake.diagrams.robot import ROBOT_OUTPUTS, make_cable_robot
from cdpr_drake.model.modelled import MODELLED
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.servo import CUSTOMARY_GAIN, ServoSettings
from cdpr_drake.model.vision.outages import LOAD_CELL, Outage
from cdpr_drake.systems import (
    FusedPlant,
    InverseKinematicsAngles,
    LoadCellFilter,
    ModelledTangents,
    ModelledTension,
    MotorAngleIntegrator,
    PlausibleTension,
    PoseError,
    PositionBasedVisualServo,
)

NOISE_PERIOD = 0.05
"""How long a noise sample lasts in an all-continuous loop with noise [s]."""


def make_vision_based_control(
    robot: CableRobot,
    cable_model: str = "SCMWE",
    gain: float | None = None,
    sample_time: float | None = 0.05,
    latency: float = 0.04,
    *,
    calibrated: CableRobot | None = None,
    noise: bool = False,
    sensors: str = "gaussian",
    estimator: str = "joint",
    outages: tuple[Outage, ...] = (),
    modelled: tuple[str, ...] = (),
    fused: bool = False,
    settings: ServoSettings | None = None,
    **servo: Any,
) -> Diagram:
    """Return the vision-based control loop of Fig. 8 around the robot.

    .. pydrake_system::

        name: vision_based_control
        input_ports:
        - desired_pose
        - desired_twist (may stay open)
        - external_wrench (may stay open)
        - pose_noise, tangent_noise, tension_noise (without `noise`; may stay open)
        output_ports:
        - pose_error_seen
        - pose_error
        - measured_pose
        - measured_tangents
        - measured_tension
        - cell_health
        - commanded_motor_rates
        - desired_motor_angles
        - those of make_cable_robot

    Blocks: "robot", "camera", "tangent_cameras", "load_cells", "plausible_tension", "servo",
    "integrator", "true_error"; in the sampled loop "sampled_pose", "sampled_tangents",
    "sampled_tension" and "held_rates" too. Measurements are taken at k T; the motor rates change at
    k T + latency and are held. With sensors "targets" the camera blocks are `TargetCameras` and
    `StereoTangentCameras`, which sample by themselves, and the loop has their outputs num_targets,
    num_cameras, age, frames_lost and images_lost (of the pose), valid_tangents and
    tangent_frames_lost too. With "images" they are `ImageTargets` and `StereoImageCameras`, a block
    "pose_camera_images" renders for the former, and each image has a noise of its own:
    pose_noise_1, ... instead of pose_noise.

    Args:
        robot: the true robot.
        cable_model: the control law's "ECM", "CMWE", "SCMWE" or "SLSM".
        gain: lambda [1/s]; if None, the robot's own where its file names one, else 0.1. Whether
            that is below the limit at a goal, `analysis.default_gain` knows.
        sample_time: period T of the vision loop [s]; None for an all-continuous loop.
        latency: from image to change of the motor rates [s]; without effect if all is continuous.
        calibrated: the robot as the controller believes it; the true one if None.
        noise: whether to add named sources of measurement noise; otherwise noise ports are
            exported. Sources hold discrete and abstract state, which no linearisation takes.
        sensors: "gaussian"; "targets" for a pose from the patterns' points in the images of the
            pose cameras, and tangents from the cables' edges in those of the stereo pairs; or
            "images" for points and edges detected in rendered and drawn images, at some tenths of a
            second for each frame.
        estimator: of the pose from targets or images, "joint" or "mean" (the paper's).
        outages: when load cells are stuck or dead and, with targets or images, cameras see nothing.
        modelled: "tensions" and "tangents" that the law takes from the model at the measured pose:
            blocks "tension_model" and "tangent_model" instead of the sensors.
        fused: whether blocks "robot", "load_cells" and "integrator" are one `FusedPlant` named
            "robot": the same loop, some three times as fast, for floats only. Load cells then
            neither fail nor vibrate.
        settings: the law's other settings; its cable_model and gain give way to those above.
        servo: fields of ServoSettings (order, ramp_time, max_speed, max_angular_speed,
            model_drum_run), over those of `settings`.

    Raises:
        GeometryError: the cables cannot control all six degrees of freedom.
        RenderingError: with images, Drake cannot render on this machine.
        RobotFileError: with targets or images, the robot lacks the cameras or patterns they need.
        ValueError: a gain, period or latency out of range; gain * sample_time >= 1; unknown
            sensors; targets or images without sampling or latency; what cannot be modelled or
            fused.
    """
    believed = calibrated if calibrated is not None else robot
    k = robot.num_cables
    if believed.num_cables != robot.num_cables:
        raise ValueError(
            f"{believed.num_cables} cables in the calibrated robot, {k} in the true one"
        )
    if gain is None:
        gain = CUSTOMARY_GAIN if robot.gain is None else robot.gain
    fields = {**(vars(settings) if settings else {}), **servo}
    law = ServoSettings(**{**fields, "cable_model": cable_model, "gain": gain})
    check_sampling(gain, sample_time, latency)
    sees = check_sensors(sensors, sample_time, latency)
    check_modelled(modelled)

    builder = DiagramBuilder()
    plant, cells, integrator = _add_plant(builder, robot, believed, outages, modelled, fused)
    pose = plant.GetOutputPort("pose")
    camera, noise_ports = add_pose_cameras(
        builder, pose, robot, believed, sensors, sample_time, estimator, outages
    )
    tangents = None
    if "tangents" not in modelled:
        tangents = add_tangent_cameras(builder, robot, believed, sensors, sample_time, outages)
        noise_ports["tangent_noise"] = tangents.GetInputPort("noise")
    if cells is not None:
        noise_ports["tension_noise"] = cells.GetInputPort("noise")
    servo_law = builder.AddNamedSystem("servo", PositionBasedVisualServo(believed, law))
    error = builder.AddNamedSystem("true_error", PoseError(robot))

    builder.Connect(pose, error.GetInputPort("pose"))
    measured = {"pose": camera.GetOutputPort("measured_pose")}
    if cells is None:
        model = builder.AddNamedSystem("tension_model", ModelledTension(believed))
        builder.Connect(measured["pose"], model.get_input_port())
        measured["tension"] = model.get_output_port()
    else:
        measured["tension"] = cells.GetOutputPort("measured_tension")
    if tangents is not None:
        seen = {"tangents": plant.GetOutputPort("tangents_at_drawing_point")}
        if sees:
            seen["tension_at_drawing_point"] = plant.GetOutputPort("tension_at_drawing_point")
            seen |= {f"measured_{name}": port for name, port in measured.items()}
            builder.ExportOutput(tangents.GetOutputPort("valid_tangents"), "valid_tangents")
            builder.ExportOutput(tangents.GetOutputPort("frames_lost"), "tangent_frames_lost")
        for name, port in seen.items():
            builder.Connect(port, tangents.GetInputPort(name))
        measured["tangents"] = tangents.GetOutputPort("measured_tangents")
    if sees:
        for name in ("num_targets", "num_cameras", "age", "frames_lost", "images_lost"):
            builder.ExportOutput(camera.GetOutputPort(name), name)
    rates = servo_law.GetOutputPort("motor_rates")
    if sample_time is not None:
        held = {"pose", "tangents"} if sees else set()
        if sees and cells is None:
            held.add("tension")
        measured, rates = _sample(builder, measured, held, rates, sample_time, latency)
    plausible = builder.AddNamedSystem("plausible_tension", PlausibleTension(believed, sample_time))
    plausible_tension = plausible.GetOutputPort("plausible_tension")
    for name in ("pose", "tension"):
        builder.Connect(measured[name], plausible.GetInputPort(f"measured_{name}"))
    if tangents is None:
        model = builder.AddNamedSystem("tangent_model", ModelledTangents(believed))
        builder.Connect(measured["pose"], model.GetInputPort("measured_pose"))
        builder.Connect(plausible_tension, model.GetInputPort("measured_tension"))
        measured["tangents"] = model.GetOutputPort("measured_tangents")
    for name, port in (measured | {"tension": plausible_tension}).items():
        builder.Connect(port, servo_law.GetInputPort(f"measured_{name}"))
    builder.Connect(rates, integrator.GetInputPort("motor_rates"))

    _export_input(builder, "desired_pose", servo_law, error)
    builder.ExportInput(servo_law.GetInputPort("desired_twist"), "desired_twist")
    builder.ExportInput(plant.GetInputPort("external_wrench"), "external_wrench")
    for name, port in noise_ports.items():
        _add_noise(builder, name, port, noise, sample_time)

    builder.ExportOutput(servo_law.GetOutputPort("pose_error"), "pose_error_seen")
    builder.ExportOutput(error.GetOutputPort("pose_error"), "pose_error")
    for name, port in measured.items():
        builder.ExportOutput(port, f"measured_{name}")
    builder.ExportOutput(plausible.GetOutputPort("cell_health"), "cell_health")
    builder.ExportOutput(rates, "commanded_motor_rates")
    angles = "desired_motor_angles" if fused else "motor_angles"
    builder.ExportOutput(integrator.GetOutputPort(angles), "desired_motor_angles")
    return _finish(builder, plant, "vision_based_control")


def _add_plant(
    builder: DiagramBuilder,
    robot: CableRobot,
    believed: CableRobot,
    outages: tuple[Outage, ...],
    modelled: tuple[str, ...],
    fused: bool,
) -> tuple[System, System | None, System]:
    """Add what is continuous; return what has the robot's, the load cells', the integrator's ports.

    There are no load cells where tensions are modelled.
    """
    measures = "tensions" not in modelled
    if fused:
        if any(outage.sensor == LOAD_CELL for outage in outages):
            raise ValueError("load cells that fail need the blocks: fused=False")
        plant = builder.AddNamedSystem("robot", FusedPlant(robot, believed))
        return plant, plant if measures else None, plant
    plant = builder.AddNamedSystem("robot", make_cable_robot(robot))
    cells = None
    if measures:
        cells = builder.AddNamedSystem("load_cells", LoadCellFilter(robot, believed, outages))
        tension = plant.GetOutputPort("tension_at_winch")
        builder.Connect(tension, cells.GetInputPort("tension_at_winch"))
    integrator = builder.AddNamedSystem("integrator", MotorAngleIntegrator(robot.num_cables))
    angles = integrator.GetOutputPort("motor_angles")
    builder.Connect(angles, plant.GetInputPort("desired_motor_angles"))
    return plant, cells, integrator


def make_joint_space_control(
    robot: CableRobot, *, cable_model: str = "SCMWE", calibrated: CableRobot | None = None
) -> Diagram:
    """Return the joint space control loop of Fig. 9 around the robot.

    .. pydrake_system::

        name: joint_space_control
        input_ports:
        - desired_pose
        - external_wrench (may stay open)
        output_ports:
        - pose_error
        - desired_motor_angles
        - those of make_cable_robot

    Blocks: "robot", "inverse_kinematics", "true_error". Motor angle zero is an absolute,
    unstretched reference, so that the stretch of the cables shows as an error of the pose.

    Args:
        robot: the true robot.
        cable_model: of the inverse kinematics; the paper takes "SCMWE" (eq. 8).
        calibrated: the robot as the controller believes it; the true one if None.

    Raises:
        ValueError: an unknown cable model.
    """
    believed = calibrated if calibrated is not None else robot
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("robot", make_cable_robot(robot))
    inverse = builder.AddNamedSystem(
        "inverse_kinematics", InverseKinematicsAngles(believed, cable_model)
    )
    error = builder.AddNamedSystem("true_error", PoseError(robot))
    builder.Connect(
        inverse.GetOutputPort("motor_angles"), plant.GetInputPort("desired_motor_angles")
    )
    builder.Connect(plant.GetOutputPort("pose"), error.GetInputPort("pose"))
    _export_input(builder, "desired_pose", inverse, error)
    builder.ExportInput(plant.GetInputPort("external_wrench"), "external_wrench")
    builder.ExportOutput(error.GetOutputPort("pose_error"), "pose_error")
    builder.ExportOutput(inverse.GetOutputPort("motor_angles"), "desired_motor_angles")
    return _finish(builder, plant, "joint_space_control")


def with_reference(loop: Diagram, reference: LeafSystem) -> Diagram:
    """Return a diagram of a loop fed by a moving reference; its other ports are exported again.

    Args:
        loop: a control loop with an input "desired_pose" (and perhaps "desired_twist").
        reference: a system with outputs of those names, e.g. `ExponentialApproach`.
    """
    builder = DiagramBuilder()
    builder.AddNamedSystem("loop", loop)
    builder.AddNamedSystem("reference", reference)
    for index in range(loop.num_input_ports()):
        port = loop.get_input_port(index)
        if reference.HasOutputPort(port.get_name()):
            builder.Connect(reference.GetOutputPort(port.get_name()), port)
        else:
            builder.ExportInput(port, port.get_name())
    for index in range(loop.num_output_ports()):
        port = loop.get_output_port(index)
        builder.ExportOutput(port, port.get_name())
    builder.ExportOutput(reference.GetOutputPort("desired_pose"), "desired_pose")
    diagram = builder.Build()
    diagram.set_name(loop.get_name())
    return diagram


def check_sampling(gain: float, sample_time: float | None, latency: float) -> None:
    """Raise ValueError unless a sampled loop can work at all.

    Args:
        gain: lambda [1/s].
        sample_time: period [s], or None.
        latency: [s].
    """
    if sample_time is None:
        return
    if not (math.isfinite(sample_time) and sample_time > 0.0):
        raise ValueError(f"the sample time must be positive, got {sample_time} s")
    if not (math.isfinite(latency) and latency >= 0.0):
        raise ValueError(f"the latency must not be negative, got {latency} s")
    if gain * sample_time >= 1.0:
        raise ValueError(
            f"gain * sample time = {gain:g}/s * {sample_time:g} s = {gain * sample_time:.3g} must "
            "be below 1: the loop would overshoot at every sample"
        )


def check_modelled(modelled: tuple[str, ...]) -> None:
    """Raise ValueError unless all that is to be `modelled` can be, and is named once."""
    for name in modelled:
        if name not in MODELLED or modelled.count(name) > 1:
            raise ValueError(f'cannot model "{name}"; known are {", ".join(MODELLED)}')


def split_latency(sample_time: float, latency: float) -> tuple[int, float]:
    """Return (n, phase) with latency = n T + phase and 0 <= phase < T, phases near T rounded.

    Args:
        sample_time: T [s].
        latency: [s].
    """
    frames = math.floor(latency / sample_time + 1e-9)
    phase = latency - frames * sample_time
    return frames, (phase if phase > 1e-9 * sample_time else 0.0)


def _sample(
    builder: DiagramBuilder,
    measured: dict[str, OutputPort],
    held: set[str],
    rates: OutputPort,
    sample_time: float,
    latency: float,
) -> tuple[dict[str, OutputPort], OutputPort]:
    """Hold the measurements at k T and the motor rates from k T + latency on.

    Measurements named in `held` come from systems that sample and hold by themselves: what those
    took at k T can be read a frame later at the earliest, one sampler less is needed.

    Systems that update at the same instant read each other's old values. So when the latency is a
    whole number n of frames, `held_rates`, updating at k T too, reads what the samplers took a
    frame earlier: they delay by n - 1 frames only, and for n = 0 there are none.
    """
    frames, phase = split_latency(sample_time, latency)
    hold = builder.AddNamedSystem(
        "held_rates", ZeroOrderHold(sample_time, rates.size(), offset_sec=phase)
    )
    builder.Connect(rates, hold.get_input_port())
    delay = frames if phase > 0.0 else frames - 1
    if delay < 0:
        return measured, hold.get_output_port()
    sampled = {}
    for name, port in measured.items():
        steps = delay - 1 if name in held else delay
        if steps < 0:
            sampled[name] = port
            continue
        sampler = (
            ZeroOrderHold(sample_time, port.size())
            if steps == 0
            else DiscreteTimeDelay(sample_time, steps, port.size())
        )
        builder.AddNamedSystem(f"sampled_{name}", sampler)
        builder.Connect(port, sampler.get_input_port())
        sampled[name] = sampler.get_output_port()
    return sampled, hold.get_output_port()


def _add_noise(
    builder: DiagramBuilder, name: str, port: InputPort, noise: bool, sample_time: float | None
) -> None:
    if not noise:
        builder.ExportInput(port, name)
        return
    source = RandomSource(RandomDistribution.kGaussian, port.size(), sample_time or NOISE_PERIOD)
    builder.Connect(builder.AddNamedSystem(name, source).get_output_port(), port)


def _export_input(builder: DiagramBuilder, name: str, *systems: LeafSystem) -> None:
    """Export one input that feeds the port of that name of several systems."""
    index = builder.ExportInput(systems[0].GetInputPort(name), name)
    for system in systems[1:]:
        builder.ConnectInput(index, system.GetInputPort(name))


def _finish(builder: DiagramBuilder, plant: Diagram, name: str) -> Diagram:
    for port in ROBOT_OUTPUTS:
        builder.ExportOutput(plant.GetOutputPort(port), port)
    diagram = builder.Build()
    diagram.set_name(name)
    return diagram
