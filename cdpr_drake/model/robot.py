"""The robot as data: `CableRobot`, the built-in robots, and what makes a robot valid."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.errors import RobotFileError
from cdpr_drake.model.records import Record
from cdpr_drake.model.robot_checks import (
    PER_CABLE,
    Problems,
    geometry_problems,
    oddities,
    value_problems,
)
from cdpr_drake.model.robot_file import read_record, write_record
from cdpr_drake.model.vision.cameras import Pattern, PoseCamera, StereoPair


class RobotFileWarning(UserWarning):
    """A robot is valid, but a value is unusual enough to be a slip."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RigidBody(Record):
    """A rigid body carried by the platform frame P.

    Args:
        mass: [kg].
        center_of_mass: p_PG (3,) [m], in P.
        inertia: (3, 3) [kg m2], about the body's own centre of mass, in axes P; products of
            inertia with Drake's sign, I_xy = -int x y dm.
    """

    mass: float
    center_of_mass: np.ndarray
    inertia: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class AxialStiffness(Record):
    """Secant axial stiffness EA(T) of a cable: strain = T / EA(T).

    EA(T) = asymptote - softening / (T + offset), Feyrer's form of a wire rope that stiffens with
    tension. The strain grows with T wherever EA(0) > 0.

    Args:
        asymptote: [N], EA at high tension.
        softening: [N2]; 0 for a constant EA.
        offset: [N], without effect if softening is 0.
    """

    shorthand: ClassVar[str | None] = "asymptote"

    asymptote: float
    softening: float = 0.0
    offset: float = 1.0

    def __call__(self, T: Any) -> Any:
        """EA(T) [N].

        Args:
            T: tension in the cable [N], a scalar or an array, >= 0.
        """
        return self.asymptote - self.softening / (T + self.offset)

    def derivative(self, T: Any) -> Any:
        """dEA/dT [-].

        Args:
            T: tension in the cable [N], a scalar or an array, >= 0.
        """
        return self.softening / (T + self.offset) ** 2

    def as_array(self) -> np.ndarray:
        """The array [asymptote, softening, offset] (3,), as the kernels take it."""
        return np.array([self.asymptote, self.softening, self.offset])


@dataclass(frozen=True, kw_only=True, eq=False)
class Cable(Record):
    """The cables: all of one kind, but for the run between drum and drawing point.

    The limits are those of a distribution's tensions along the chords; at its ends a cable bears up
    to half of its weight more or less.

    Args:
        linear_density: [kg/m], per unstrained metre.
        diameter: [m].
        section: metallic cross-section [m2].
        stiffness: AxialStiffness; a number [N] stands for a constant EA.
        damping_time: [s], axial damping is EA * damping_time per unit of strain rate; what the sag
            gives way is no strain.
        drum_run: (k,) [m], geometric length from the drum to the drawing point; a number stands
            for all cables.
        min_tension: [N], the lowest a tension distribution may ask for.
        max_tension: [N], the highest a tension distribution may ask for.
        breaking_load: [N].
        tension_margin: [N], by which a distribution within the limits stays off both of them; 0 if
            None.
        preferred_tension: [N], to which the rule "within limits" stays close; the middle of the
            limits if None.
    """

    linear_density: float
    diameter: float
    section: float
    stiffness: AxialStiffness
    damping_time: float
    drum_run: np.ndarray
    min_tension: float
    max_tension: float
    breaking_load: float
    tension_margin: float | None = None
    preferred_tension: float | None = None

    @property
    def limits(self) -> tuple[float, float]:
        """The lowest and highest tension [N] that a distribution within the limits asks for."""
        margin = self.tension_margin or 0.0
        return self.min_tension + margin, self.max_tension - margin


@dataclass(frozen=True, kw_only=True, eq=False)
class Pulleys(Record):
    """The swivelling pulleys over which the cables leave, one for each, at the drawing points.

    A pulley turns freely about an axis through the drawing point, where the cable enters it, and
    is taken to weigh nothing. Radius 0 is an eyelet: the cable leaves the drawing point itself.

    Args:
        radius: (k,) [m], to the cable's centre line; a number stands for all cables.
        axis: (k, 3), in W, the swivel axis as the direction in which the cable moves as it enters,
            away from the drum: up for a pulley fed from below, down for one fed from above; of any
            length. (3,) stands for all cables. Eyelets need none.
    """

    radius: np.ndarray = field(default_factory=lambda: np.array(0.0))
    axis: np.ndarray | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Winch(Record):
    """The winches, all alike, with the PID of their motors. Motor angle q > 0 pays out.

    Args:
        transmission: [m/rad], cable paid out per radian of the motor.
        inertia: [kg m2], of motor, belt and drum at the motor.
        damping: [N m s/rad], viscous, at the motor.
        proportional_gain: [N m/rad].
        integral_gain: [N m/(rad s)].
        derivative_gain: [N m s/rad].
        torque_limit: [N m].
        encoder_zero_length: (k,) [m], unstrained length, from the drum on, at motor angle 0, below
            zero if no motor gets there; a number stands for all cables.
        coulomb_torque: [N m], dry friction at the motor; 0 is none.
        coulomb_rate: [rad/s], motor rate over which the dry friction builds up.
        capstan_exponent: [-], friction coefficient times angle of wrap at the drawing point; 0 is
            none.
        capstan_speed: [m/s], cable speed over which the capstan friction builds up.
        mounted_on: "frame"; winches that ride on the platform, with drums and pulleys, are not
            modelled.
    """

    transmission: float
    inertia: float
    damping: float = 0.0
    proportional_gain: float
    integral_gain: float
    derivative_gain: float
    torque_limit: float
    encoder_zero_length: np.ndarray = field(default_factory=lambda: np.array(0.0))
    coulomb_torque: float = 0.0
    coulomb_rate: float = 0.1
    capstan_exponent: float = 0.0
    capstan_speed: float = 0.002
    mounted_on: str = "frame"


@dataclass(frozen=True, kw_only=True, eq=False)
class Cameras(Record):
    """What the cameras see, and how well. Noise is Gaussian, one standard deviation.

    Poses of cameras are given in F, so that an error of X_WF, the paper's ^fT_b, moves them all.

    Args:
        X_WF: pose of the fixed camera frame F in the world.
        X_PM: pose of the target pattern frame M on the platform.
        position_noise: [m], of the measured p_FM, each axis.
        orientation_noise: [rad], of the measured R_FM, each axis.
        tangent_noise: [rad], of the measured cable tangents.
        sample_time: [s], between two measurements.
        latency: [s], from exposure to the measurement's use.
        pose_cameras: those that see the platform; the first is at F.
        patterns: what they see on it.
        stereo_pairs: those that see the cables near their drawing points.
        pixel_noise: [px], white, of each coordinate of a point of a pattern in an image.
        pixel_bias: [px], as pixel_noise, but fixed for each point of a pattern in each camera.
        pixel_bias_seed: of the draw of those biases.
        line_noise: [px], white, of a point on a cable's edge in an image, across the edge.
        cable_segment: (2,) [m], the stereo pairs see cables from here to there, along the
            unstrained cable from the drawing point on.
        edge_points: number of points of an edge that a line is fitted to.
    """

    X_WF: RigidTransform
    X_PM: RigidTransform
    position_noise: float
    orientation_noise: float
    tangent_noise: float
    sample_time: float = 0.05
    latency: float = 0.04
    pose_cameras: tuple[PoseCamera, ...] = ()
    patterns: tuple[Pattern, ...] = ()
    stereo_pairs: tuple[StereoPair, ...] = ()
    pixel_noise: float = 0.2
    pixel_bias: float = 0.25
    pixel_bias_seed: int = 1
    line_noise: float = 0.2
    cable_segment: np.ndarray = field(default_factory=lambda: np.array([0.3, 1.0]))
    edge_points: int = 20


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadCells(Record):
    """The load cells at the winches and their low-pass filters.

    Args:
        noise: [N], white, one standard deviation.
        bias: (k,) [N]; a number stands for all cables.
        gain: (k,) [-], reading over tension; a number stands for all cables.
        cutoff: [Hz], of the filter.
        order: of the filter.
        vibration_amplitude: [N], of the cables' vibration that the cells feel: its root mean
            square is that of a sine of this amplitude; 0 is none.
        vibration_band: (2,) [Hz], lowest and highest frequency of it.
    """

    noise: float
    bias: np.ndarray = field(default_factory=lambda: np.array(0.0))
    gain: np.ndarray = field(default_factory=lambda: np.array(1.0))
    cutoff: float
    order: int = 1
    vibration_amplitude: float = 0.0
    vibration_band: np.ndarray = field(default_factory=lambda: np.array([3.0, 8.0]))


def _no_payload() -> RigidBody:
    return RigidBody(mass=0.0, center_of_mass=np.zeros(3), inertia=np.zeros((3, 3)))


@dataclass(frozen=True, kw_only=True, eq=False)
class CableRobot(Record):
    """A cable-driven parallel robot with k cables: numbers only, checked, read-only.

    World frame W has z up; P is the platform frame, the paper's F_e. Any number of cables is
    accepted, also too few to hold the platform: whether a pose can be held is asked elsewhere.

    Args:
        name: short name.
        description: one line.
        gravity: [m/s2].
        drawing_points: (k, 3) [m], in W, where the cables leave the frame, or enter the pulleys
            over which they do.
        attachment_points: p_PB (k, 3) [m], in P, where they reach the platform.
        pulleys: over which the cables leave; eyelets, if none are given.
        platform: the platform with all that always goes with it.
        payload: what it carries; its mass may be 0, and its inertia 0 for a point load.
        cable: the cables.
        winch: the winches.
        cameras: the cameras.
        load_cells: the load cells.
        gain: lambda [1/s] of its control law where nobody asks for another; if None, what
            `analysis.default_gain` finds.
        floor: height of the floor in W [m], for drawings, rendered images and default poses; if
            None, what `model.room.floor_height` takes for it.
        sources: where the values come from, by field (`cable.section`) or group (`cable`).
        assumptions: what is assumed rather than known.

    Raises:
        RobotFileError: a value is not valid; names the field.
    """

    name: str
    description: str = ""
    gravity: float
    drawing_points: np.ndarray
    attachment_points: np.ndarray
    pulleys: Pulleys = field(default_factory=Pulleys)
    platform: RigidBody
    payload: RigidBody = field(default_factory=_no_payload)
    cable: Cable
    winch: Winch
    cameras: Cameras
    load_cells: LoadCells
    gain: float | None = None
    floor: float | None = None
    sources: dict[str, str] = field(default_factory=dict)
    assumptions: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        self._refuse(geometry_problems(self))
        for group, name in (path.split(".") for path in PER_CABLE):
            part = getattr(self, group)
            value = getattr(part, name)
            if value.ndim == 0:
                each = np.full(self.num_cables, value)
                object.__setattr__(self, group, part.replace(**{name: each}))
        self._refuse(value_problems(self))
        for path, message in oddities(self):
            text = f"robot {self.name!r}: {path}: {message}"
            warnings.warn(text, RobotFileWarning, stacklevel=3)

    def _refuse(self, problems: Problems) -> None:
        for path, message in problems:
            raise RobotFileError(f"robot {self.name!r}", path, message)

    def __repr__(self) -> str:
        return f"<CableRobot {self.name!r}: {self.num_cables} cables, {self.mass:g} kg>"

    @property
    def num_cables(self) -> int:
        """Number of cables k."""
        return self.drawing_points.shape[0]

    @property
    def pulley_radii(self) -> np.ndarray:
        """Radii of the pulleys (k,) [m]; 0 where a cable leaves through an eyelet."""
        return np.broadcast_to(self.pulleys.radius, (self.num_cables,))

    @property
    def pulley_axes(self) -> np.ndarray:
        """Unit vectors (k, 3) along the pulleys' axes, in W, the way the cables enter."""
        axis = np.array([0.0, 0.0, 1.0]) if self.pulleys.axis is None else self.pulleys.axis
        unit: np.ndarray = axis / np.linalg.norm(axis, axis=-1, keepdims=True)
        return np.broadcast_to(unit, (self.num_cables, 3))

    @property
    def mass(self) -> float:
        """Mass of platform and payload [kg]."""
        return self.platform.mass + self.payload.mass

    @property
    def center_of_mass(self) -> np.ndarray:
        """Centre of mass p_PG (3,) of platform and payload [m], in P."""
        bodies = (self.platform, self.payload)
        return sum((b.mass * b.center_of_mass for b in bodies), np.zeros(3)) / self.mass

    @property
    def inertia(self) -> np.ndarray:
        """Inertia (3, 3) of platform and payload about their common centre of mass, axes P.

        The parallel-axis theorem for each body, [kg m2].
        """
        total, center = np.zeros((3, 3)), self.center_of_mass
        for body in (self.platform, self.payload):
            d = body.center_of_mass - center
            total += body.inertia + body.mass * (d @ d * np.eye(3) - np.outer(d, d))
        return total

    @property
    def weight_per_metre(self) -> float:
        """Weight w of the cable per unstrained metre [N/m]."""
        return self.cable.linear_density * self.gravity

    def with_payload(
        self, mass: float, center_of_mass: Any = None, inertia: Any = None
    ) -> CableRobot:
        """The same robot with another payload in place of the one it carries.

        Args:
            mass: [kg]; 0 removes the payload.
            center_of_mass: (3,) [m], in P; by default the platform's own, so that the payload does
                not shift it.
            inertia: (3, 3) [kg m2], about the payload's centre of mass, in axes P; by default
                that of a solid box of a loaded pallet's size, 1.0 x 1.0 x 0.3 m (x, y, z).

        Raises:
            RobotFileError: the payload is not physical.
        """
        if center_of_mass is None:
            center_of_mass = self.platform.center_of_mass
        if inertia is None:
            x2, y2, z2 = 1.0**2, 1.0**2, 0.3**2
            inertia = mass / 12.0 * np.diag([y2 + z2, x2 + z2, x2 + y2])
        payload = RigidBody(mass=mass, center_of_mass=center_of_mass, inertia=inertia)
        return self.replace(payload=payload)

    def to_yaml(self) -> str:
        """The robot as the text of a robot file, which gives an equal robot when read."""
        return write_record(self)


def robot_names() -> dict[str, str]:
    """The built-in robots: a one-line description by name."""
    return {name: load_robot(name).description for name in sorted(_built_in())}


def load_robot(name_or_path: str | os.PathLike[str]) -> CableRobot:
    """Reads a robot.

    Args:
        name_or_path: the name of a built-in robot, see `robot_names`, or the path of a YAML file.

    Raises:
        RobotFileError: the file cannot be read, or is not a valid robot; names file and field.
    """
    files = _built_in()
    known = f"built-in robots: {', '.join(sorted(files))}"
    file = os.fspath(name_or_path)
    if not file:
        raise RobotFileError("no file", "", f"the name is empty; {known}")
    try:
        if name_or_path in files:
            text = files[file].read_text(encoding="utf-8")
            file = f"{file}.yaml"
        else:
            text = Path(file).read_text(encoding="utf-8")
    except OSError as error:
        raise RobotFileError(file, "", f"{error.strerror or error}; {known}") from None
    except ValueError as error:
        raise RobotFileError(file, "", f"is not a text file in UTF-8 ({error})") from None
    return read_record(CableRobot, text, file)


def save_robot(robot: CableRobot, path: str | os.PathLike[str]) -> None:
    """Writes a robot file, which `load_robot` reads back to an equal robot.

    Args:
        robot: the robot.
        path: of the file, which is replaced if it exists.

    Raises:
        OSError: the file cannot be written.
    """
    Path(path).write_text(robot.to_yaml(), encoding="utf-8")


def _built_in() -> dict[str, Any]:
    folder = resources.files("cdpr_drake") / "robots"
    return {
        file.name.removesuffix(".yaml"): file
        for file in folder.iterdir()
        if file.name.endswith(".yaml")
    }
