"""Sensing of one's own: an inertial unit beside what there is, and a laser tracker instead."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

import numpy as np
from pydrake.common import RandomDistribution
from pydrake.math import RollPitchYaw_
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, LeafSystem

from cdpr_drake.diagrams import GaussianSensing, Measurements, PlantToMeasure
from cdpr_drake.systems import scalar_convertible


def rotation(rpy: np.ndarray) -> np.ndarray:
    """Return R_WP (3, 3) of [roll, pitch, yaw], of float or AutoDiffXd."""
    of_scalar = RollPitchYaw_[type(rpy[0]) if rpy.dtype.hasobject else float]
    return of_scalar(rpy).ToRotationMatrix().matrix()


@scalar_convertible
class Imu(LeafSystem):
    """The specific force at the platform's origin, in P: R_WP^T (a - g) + bias + sigma n.

    Args:
        gravity: [m/s2].
        bias: (3,) [m/s2].
        sigma: of the noise [m/s2].
    """

    def __init__(self, gravity: float, bias: tuple[float, ...], sigma: float) -> None:
        super().__init__()
        self._up = np.array([0.0, 0.0, gravity])
        self._bias, self._sigma = np.array(bias), sigma
        self._pose = self.DeclareVectorInputPort("pose", 6)
        self._acceleration = self.DeclareVectorInputPort("platform_acceleration", 6)
        self._noise = self.DeclareVectorInputPort("noise", 3, RandomDistribution.kGaussian)
        self.DeclareVectorOutputPort("acceleration", 3, self._calc)

    def _calc(self, context: Context, output: BasicVector) -> None:
        felt = self._acceleration.Eval(context)[3:] + self._up
        reading = rotation(self._pose.Eval(context)[:3]).T @ felt + self._bias
        if self._noise.HasValue(context):
            reading = reading + self._sigma * self._noise.Eval(context)
        output.SetFromVector(reading)


@dataclass(frozen=True, kw_only=True)
class WithImu:
    """Other sensing, and an inertial unit: a measurement "acceleration" (3) [m/s2] in P.

    Attributes:
        others: what measures all else.
        bias: of the accelerometers [m/s2].
        sigma: of their noise [m/s2].
    """

    others: GaussianSensing = field(default_factory=GaussianSensing)
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sigma: float = 0.02

    def add_to(self, builder: DiagramBuilder, plant: PlantToMeasure) -> Measurements:
        """Add the sensors.

        Args:
            builder: of the loop.
            plant: what is measured.
        """
        found = self.others.add_to(builder, plant)
        imu = builder.AddNamedSystem("imu", Imu(plant.robot.gravity, self.bias, self.sigma))
        for name in ("pose", "platform_acceleration"):
            builder.Connect(plant[name], imu.GetInputPort(name))
        return dataclasses.replace(
            found,
            ports={**found.ports, "acceleration": imu.get_output_port()},
            noise={**found.noise, "acceleration_noise": imu.GetInputPort("noise")},
        )


class Tracker(LeafSystem):
    """A laser tracker of three reflectors: the pose, exact but for noise. For floats alone.

    Args:
        sigma: of the position [m], and over 0.5 m of the angles.
    """

    def __init__(self, sigma: float) -> None:
        super().__init__()
        self._sigma = np.repeat([2.0 * sigma, sigma], 3)
        self._pose = self.DeclareVectorInputPort("pose", 6)
        self._noise = self.DeclareVectorInputPort("noise", 6, RandomDistribution.kGaussian)
        self.DeclareVectorOutputPort("measured_pose", 6, self._calc)

    def _calc(self, context: Context, output: BasicVector) -> None:
        pose = self._pose.Eval(context)
        if self._noise.HasValue(context):
            pose = pose + self._sigma * self._noise.Eval(context)
        output.SetFromVector(pose)


@dataclass(frozen=True, kw_only=True)
class LaserTracker:
    """A laser tracker and nothing else: no load cells, no cameras at the cables."""

    load_cells = False

    sigma: float = 1e-5

    def add_to(self, builder: DiagramBuilder, plant: PlantToMeasure) -> Measurements:
        """Add the tracker.

        Args:
            builder: of the loop.
            plant: what is measured.
        """
        tracker = builder.AddNamedSystem("tracker", Tracker(self.sigma))
        builder.Connect(plant["pose"], tracker.GetInputPort("pose"))
        return Measurements(
            ports={"pose": tracker.get_output_port()},
            noise={"tracker_noise": tracker.GetInputPort("noise")},
        )


@dataclass(frozen=True, kw_only=True)
class NoPose:
    """Sensing that forgets the pose: the loop has to refuse it."""

    def add_to(self, builder: DiagramBuilder, plant: PlantToMeasure) -> Measurements:
        """Add nothing.

        Args:
            builder: of the loop.
            plant: what is measured.
        """
        return Measurements(ports={"tension": plant["measured_tension"]})
