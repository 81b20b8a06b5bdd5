"""The bound: the arithmetic of the vision-based loop fused in one function, with no framework.

It calls the package's kernels for cables, winches, load cells, camera and law, and does by itself
what Drake does for the diagram: the platform's equations of motion, the holds, and Runge-Kutta 3 in
fixed steps. Nothing that gives the same numbers by the same steps in this language is much faster.

The state is [roll, pitch, yaw, x, y, z, omega, v (12); motor angles (k); rates (k); error integrals
(k); filtered tensions (k); desired motor angles (k)], SI units and radians.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from benchmarks.solve_ivp_loop import Loop, Noise, Start
from cdpr_drake.model.cable_models import cable_model_index
from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.camera import measured_pose
from cdpr_drake.model.kernels.load_cell import filter_derivatives
from cdpr_drake.model.kernels.platform import platform_cable_forces
from cdpr_drake.model.kernels.servo import motor_rates, rpy_matrix
from cdpr_drake.model.kernels.winch import winch_derivatives
from cdpr_drake.model.rotations import pose_to_vector
from cdpr_drake.model.servo import law_body
from cdpr_drake.model.winch import WinchModel


@jit
def _product(M, x, y, z):
    """Return the product of M (3, 3) and (x, y, z)."""
    return (
        M[0, 0] * x + M[0, 1] * y + M[0, 2] * z,
        M[1, 0] * x + M[1, 1] * y + M[1, 2] * z,
        M[2, 0] * x + M[2, 1] * y + M[2, 2] * z,
    )


@jit
def _cross(a, b):
    """Return a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@jit
def platform_derivatives(state, wrench, body, inertia, inverse, R, out):
    """Write the derivatives (12,) of the platform under the cables' wrench [torque; force].

    body = [mass, x_G, y_G, z_G, g]; inertia and its inverse (3, 3) about G in P; R (3, 3) scratch.
    """
    rpy_matrix(state[0], state[1], state[2], R)
    Rt = R.T
    mass = body[0]
    EG = _product(R, body[1], body[2], body[3])
    omega = (state[6], state[7], state[8])
    fx, fy, fz = wrench[3], wrench[4], wrench[5] - mass * body[4]
    # About G the weight has no moment, and the cables' force acts at E.
    shift = _cross(EG, (wrench[3], wrench[4], wrench[5]))
    tx, ty, tz = wrench[0] - shift[0], wrench[1] - shift[1], wrench[2] - shift[2]
    torque = _product(Rt, tx, ty, tz)
    w = _product(Rt, omega[0], omega[1], omega[2])
    gyro = _cross(w, _product(inertia, w[0], w[1], w[2]))
    a = _product(inverse, torque[0] - gyro[0], torque[1] - gyro[1], torque[2] - gyro[2])
    alpha = _product(R, a[0], a[1], a[2])
    tangential = _cross(alpha, EG)
    centripetal = _cross(omega, _cross(omega, EG))
    cy, sy = math.cos(state[2]), math.sin(state[2])
    along = (cy * omega[0] + sy * omega[1]) / math.cos(state[1])
    out[0] = along
    out[1] = cy * omega[1] - sy * omega[0]
    out[2] = omega[2] + along * math.sin(state[1])
    out[3], out[4], out[5] = state[9], state[10], state[11]
    out[6], out[7], out[8] = alpha
    out[9] = fx / mass - tangential[0] - centripetal[0]
    out[10] = fy / mass - tangential[1] - centripetal[1]
    out[11] = fz / mass - tangential[2] - centripetal[2]


@jit
def derivatives(y, rates, noise, numbers, work, out):
    """Write dy/dt for held motor rates and load cells' noise; work = (packed, winches, R)."""
    points, constants, body, inertia, inverse, winch, zero, cells = numbers
    packed, winches, R = work
    k = rates.shape[0]
    r = winch[6]
    length = zero + r * y[12 : 12 + k]
    rate = r * y[12 + k : 12 + 2 * k]
    platform_cable_forces(y[:12], length, rate, points, constants, packed)
    platform_derivatives(y, packed, body, inertia, inverse, R, out)
    T_A = packed[6 : 6 + k]
    winch_derivatives(y[12 : 12 + 3 * k], y[12 + 4 * k :], T_A, winch, winches)
    out[12 : 12 + 3 * k] = winches[: 3 * k]
    T_W = winches[4 * k :]
    filter_derivatives(y[12 + 3 * k : 12 + 4 * k], T_W, noise, cells, out[12 + 3 * k : 12 + 4 * k])
    out[12 + 4 * k :] = rates


@jit
def advance(y, steps, h, rates, noise, numbers, work, slopes):
    """Move y on by steps of Runge-Kutta 3 of length h, slopes (3, n) being scratch."""
    for _ in range(steps):
        derivatives(y, rates, noise, numbers, work, slopes[0])
        derivatives(y + 0.5 * h * slopes[0], rates, noise, numbers, work, slopes[1])
        derivatives(y + h * (2.0 * slopes[1] - slopes[0]), rates, noise, numbers, work, slopes[2])
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
    model, order, limits, drawing, attachment, body, stiffness, run, target, least, straight = law
    left, mount, right = transforms
    k = drawing.shape[0]
    work = (np.zeros(6 + 9 * k), np.zeros(5 * k), np.zeros((3, 3)))
    slopes = np.zeros((3, y.shape[0]))
    out = np.zeros(k + 6)
    rates = np.zeros(k)
    seen = np.zeros(12)
    z = np.zeros(18 + 4 * k)
    z[6:12] = goal
    transmission = numbers[5][6]
    poses[0] = y[:6]
    for frame in range(frames):
        seen[:6] = y[:6]
        seen[6:9] = sigmas[0] * pose_noise[frame, :3]
        seen[9:] = sigmas[1] * pose_noise[frame, 3:]
        measured_pose(seen, left, mount, right, z[:6])
        derivatives(y, rates, tension_noise[frame], numbers, work, slopes[0])
        for i in range(k):
            T = y[12 + 3 * k + i]
            z[18 + i] = T if least <= T else straight
            u = z[18 + k + 3 * i : 21 + k + 3 * i]
            for a in range(3):
                noise = sigmas[2] * tangent_noise[frame, 3 * i + a]
                u[a] = work[0][6 + 2 * k + 3 * i + a] + noise
            u /= math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
        advance(
            y, before, latency / max(before, 1), rates, tension_noise[frame], numbers, work, slopes
        )
        now = gain
        if ramp > 0.0:
            now *= min((frame * period + latency) / ramp, 1.0)
        out[:] = 0.0
        motor_rates(
            model, order, now, limits, z, drawing, attachment, body, stiffness, run, target, out
        )
        rates[:] = out[:k] / transmission
        advance(
            y, after, (period - latency) / after, rates, tension_noise[frame], numbers, work, slopes
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
        law = cable.stiffness.as_array()
        points = np.array([robot.drawing_points, robot.attachment_points], float)
        scalars = [robot.weight_per_metre, *law, cable.damping_time, cable.breaking_load]
        body = np.array([robot.mass, *robot.center_of_mass, robot.gravity], float)
        inertia = np.array(robot.inertia, float)
        rate = np.full(k, 2.0 * np.pi * cells.cutoff)
        readings = np.array([np.ones(k), np.zeros(k), cells.noise / cells.gain, rate])
        self.numbers = (
            points, np.array([*scalars, *cable.drum_run], float), body, inertia,
            np.linalg.inv(inertia), WinchModel(robot).parameters,
            np.array(robot.winch.encoder_zero_length, float), readings,
        )  # fmt: skip
        mount = _stacked(cameras.X_PM)
        self.transforms = (
            np.vstack([np.eye(3), np.zeros(3)]),
            mount,
            _stacked(cameras.X_PM.inverse()),
        )
        self.law = (
            cable_model_index("SCMWE"), 4, np.array([np.inf, np.inf]), points[0].copy(),
            points[1].copy(), law_body(robot), law, np.zeros(k), mount,
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
