"""The bound: the arithmetic of the vision-based loop fused in one function, with no framework.

It calls the package's kernels for plant, camera and law, and does by itself what Drake does for the
diagram: the holds, and Runge-Kutta 3 in fixed steps. Nothing that gives the same numbers by the
same steps in this language is much faster.

The state is [roll, pitch, yaw, x, y, z, omega, v (12); motor angles (k); rates (k); error integrals
(k); filtered tensions (k); desired motor angles (k)], SI units and radians.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from benchmarks.solve_ivp_loop import Loop, Noise, Start
from cdpr_drake.model.arrays import RobotArrays
from cdpr_drake.model.cable_models import cable_model_index
from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.camera import measured_pose
from cdpr_drake.model.kernels.plant import plant_derivatives
from cdpr_drake.model.kernels.platform import platform_cable_forces
from cdpr_drake.model.kernels.servo import motor_rates
from cdpr_drake.model.rotations import pose_to_vector
from cdpr_drake.systems import FusedPlant


@jit
def advance(y, steps, h, rates, noise, wrench, numbers, slopes):
    """Move y on by steps of Runge-Kutta 3 of length h, slopes (3, n) being scratch."""
    points, constants, solid, winch, cells, filters = numbers
    for _ in range(steps):
        plant_derivatives(
            y, rates, noise, wrench, points, constants, solid, winch, cells, filters, slopes[0]
        )
        z = y + 0.5 * h * slopes[0]
        plant_derivatives(
            z, rates, noise, wrench, points, constants, solid, winch, cells, filters, slopes[1]
        )
        z = y + h * (2.0 * slopes[1] - slopes[0])
        plant_derivatives(
            z, rates, noise, wrench, points, constants, solid, winch, cells, filters, slopes[2]
        )
        y += h / 6.0 * (slopes[0] + 4.0 * slopes[1] + slopes[2])


@jit
def fused_run(y, frames, times, steps, gain, goal, sigmas, noises, numbers, law, transforms, poses):
    """Run the loop, writing the pose at each frame to poses (frames + 1, 6).

    times = (sample time, latency, ramp time); steps before and after the change of the rates;
    sigmas = (3,) rad, m, rad; noises = (pose, tangents, tension); law and transforms as the law's
    and the camera's kernels take them.
    """
    period, latency, ramp = times
    before, after = steps
    pose_noise, tangent_noise, tension_noise = noises
    model, order, limits, points, body, stiffness, run, target, least, straight = law
    left, mount, right = transforms
    k = run.shape[0]
    packed = np.zeros(6 + 9 * k)
    wrench = np.zeros(6)
    slopes = np.zeros((3, y.shape[0]))
    out = np.zeros(k + 6)
    rates = np.zeros(k)
    seen = np.zeros(12)
    z = np.zeros(18 + 4 * k)
    z[6:12] = goal
    transmission = numbers[3][6]
    poses[0] = y[:6]
    for frame in range(frames):
        seen[:6] = y[:6]
        seen[6:9] = sigmas[0] * pose_noise[frame, :3]
        seen[9:] = sigmas[1] * pose_noise[frame, 3:]
        measured_pose(seen, left, mount, right, z[:6])
        length = numbers[4][4] + transmission * y[12 : 12 + k]
        rate = transmission * y[12 + k : 12 + 2 * k]
        platform_cable_forces(y[:12], length, rate, numbers[0], numbers[1], packed)
        for i in range(k):
            T = y[12 + 3 * k + i]
            z[18 + i] = T if least <= T else straight
            u = z[18 + k + 3 * i : 21 + k + 3 * i]
            for a in range(3):
                noise = sigmas[2] * tangent_noise[frame, 3 * i + a]
                u[a] = packed[6 + 2 * k + 3 * i + a] + noise
            u /= math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
        advance(
            y,
            before,
            latency / max(before, 1),
            rates,
            tension_noise[frame],
            wrench,
            numbers,
            slopes,
        )
        now = gain
        if ramp > 0.0:
            now *= min((frame * period + latency) / ramp, 1.0)
        out[:] = 0.0
        motor_rates(model, order, now, limits, z, points, body, stiffness, run, target, out)
        rates[:] = out[:k] / transmission
        advance(
            y,
            after,
            (period - latency) / after,
            rates,
            tension_noise[frame],
            wrench,
            numbers,
            slopes,
        )
        poses[frame + 1] = y[:6]


class FusedLoop:
    """One robot and its loop as arrays, ready to be run."""

    def __init__(self, robot: Any, loop: Loop, max_step: float = 0.01) -> None:
        cable, cameras, cells = robot.cable, robot.cameras, robot.load_cells
        if cells.order != 1 or cells.vibration_amplitude != 0.0:
            raise ValueError("one filter, no vibration")
        self.robot, self.loop = robot, loop
        k = robot.num_cables
        arrays = RobotArrays(robot)
        # What the package's own plant takes: platform, winches, load cells without error.
        self.numbers = FusedPlant(robot, robot).numbers
        self.transforms = (
            np.vstack([np.eye(3), np.zeros(3)]),
            arrays.target,
            _stacked(cameras.X_PM.inverse()),
        )
        self.law = (
            cable_model_index("SCMWE"), 4, np.array([np.inf, np.inf]), arrays.points, arrays.body,
            arrays.stiffness, np.full(k, -1.0), arrays.target,
            0.5 * cable.min_tension, cable.max_tension,
        )  # fmt: skip
        self.sigmas = np.array(
            [cameras.orientation_noise, cameras.position_noise, cameras.tangent_noise]
        )
        T, latency = loop.sample_time, loop.latency
        self.steps = (_steps(latency, max_step), _steps(T - latency, max_step))

    def run(self, start: Start, noise: Noise, until: float) -> np.ndarray:
        """Return the poses (n, 6) [roll, pitch, yaw, x, y, z] at the frames 0, T, ... until."""
        from pydrake.math import RigidTransform, RotationMatrix

        winch, loop, k = self.robot.winch, self.loop, self.robot.num_cables

        def pose(R: np.ndarray, p: np.ndarray) -> np.ndarray:
            return pose_to_vector(RigidTransform(RotationMatrix(R), p))

        angle = (start.length - winch.encoder_zero_length) / winch.transmission
        integral = -winch.transmission * start.tension / winch.integral_gain
        parts = [pose(start.rotation, start.position), np.zeros(6), angle, np.zeros(k), integral]
        y = np.concatenate([*parts, start.tension, angle])
        frames = round(until / loop.sample_time)
        poses = np.zeros((frames + 1, 6))
        fused_run(
            y, frames, (loop.sample_time, loop.latency, loop.ramp_time), self.steps, loop.gain,
            pose(loop.goal_rotation, loop.goal_position), self.sigmas,
            (noise.pose, noise.tangents, noise.tension), self.numbers, self.law, self.transforms,
            poses,
        )  # fmt: skip
        return poses


def _steps(duration: float, max_step: float) -> int:
    return math.ceil(duration / max_step - 1e-9)


def _stacked(X: Any) -> np.ndarray:
    return np.vstack([X.rotation().matrix(), X.translation()])
