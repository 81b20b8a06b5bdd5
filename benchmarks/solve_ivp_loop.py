"""The sampled, noisy vision-based loop in NumPy and SciPy alone, written without the package.

It reads a robot's numbers and does the rest by itself: the platform by a quaternion and Newton and
Euler, the cables as elastic catenaries solved for the force at the drawing point, winches, filter,
and the control law from the paper's equations, differentiated by complex steps. Each stretch
between two changes of the motor rates is a call of `solve_ivp`. So it is both a peer in speed and
an oracle: it has to follow the same path as the package's diagram.

Its state is [quaternion w, x, y, z (4); p_WP (3) [m]; omega (3) [rad/s]; v (3) [m/s]; motor angles
(k) [rad]; rates (k) [rad/s]; error integrals (k) [rad s]; filtered tensions (k) [N]; desired motor
angles (k) [rad]], in W.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

Array = np.ndarray
H_STEP = 1e-30  # of complex steps
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, kw_only=True)
class Loop:
    """What the loop is told besides the robot: rotation (3, 3) and place (3,) of the goal's X_WP,
    gain [1/s], period [s], latency [s] below the period, ramp time of the gain [s].
    """

    goal_rotation: Array
    goal_position: Array
    gain: float
    sample_time: float
    latency: float
    ramp_time: float


@dataclass(frozen=True, kw_only=True)
class Start:
    """A rest: rotation (3, 3) and place (3,) of X_WP, total unstrained lengths (k,) [m], tensions
    at the drawing points (k,) [N].
    """

    rotation: Array
    position: Array
    length: Array
    tension: Array


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Standard normal samples, a row a frame: pose (n, 6), tangents (n, 3 k), tensions (n, k)."""

    pose: Array
    tangents: Array
    tension: Array


class Simulation:
    """One robot under vision-based control with the parabolic cable model (SCMWE)."""

    def __init__(self, robot: Any, loop: Loop) -> None:
        winch, cells, cable = robot.winch, robot.load_cells, robot.cable
        law = cable.stiffness.as_array()
        friction = winch.coulomb_torque != 0.0 or winch.capstan_exponent != 0.0
        if law[1] != 0.0 or friction or cells.order != 1 or cells.vibration_amplitude != 0.0:
            raise ValueError("one axial stiffness, no friction, one filter, no vibration")
        self.robot, self.loop, self.winch, self.cells = robot, loop, winch, cells
        self.k = robot.num_cables
        self.A, self.B = np.array(robot.drawing_points), np.array(robot.attachment_points)
        self.EA, self.w = float(law[0]), robot.weight_per_metre
        self.drum_run = np.array(cable.drum_run)
        self.damping = self.EA * cable.damping_time
        self.mass, self.PG = robot.mass, np.array(robot.center_of_mass)
        self.inertia, self.weight = np.array(robot.inertia), robot.mass * robot.gravity
        self.target = np.array(robot.cameras.X_PM.rotation().matrix())
        self.p_PM = np.array(robot.cameras.X_PM.translation())
        self._force = np.empty((2, 0))

    # --- the plant

    def catenaries(self, Bx: Array, Bz: Array, length: Array) -> tuple[Array, ...]:
        """Return (H, V_A, V_B, T_A, T_B), by Newton's method from where it ended last, and how the
        cables stretch with Bx, Bz and their lengths, (3, k): as Hooke's law has it for the tension
        in the middle of the span.
        """
        w, EA = self.w, self.EA
        H, V_A = self._force
        for _ in range(50):
            T_A = np.sqrt(H * H + V_A * V_A)
            stretch = 1.0 + T_A / EA
            l0 = length - self.drum_run / stretch
            V_B = V_A + w * l0
            T_B = np.sqrt(H * H + V_B * V_B)
            D = np.arcsinh(V_B / H) - np.arcsinh(V_A / H)
            e = l0 / EA
            x = H * e + H * D / w - Bx
            z = 0.5 * (V_A + V_B) * e + (T_B - T_A) / w - Bz
            cA, sA, cB, sB = H / T_A, V_A / T_A, H / T_B, V_B / T_B
            slack = self.drum_run / (EA * stretch * stretch)  # dl0 / dT_A
            by_l0 = H / EA + cB, (V_A + V_B) / (2.0 * EA) + 0.5 * w * e + sB
            xH = e + (D - sB + sA) / w + by_l0[0] * slack * cA
            xV = (cB - cA) / w + by_l0[0] * slack * sA
            zH = (cB - cA) / w + by_l0[1] * slack * cA
            zV = e + (sB - sA) / w + by_l0[1] * slack * sA
            det = xH * zV - xV * zH
            dH, dV = (xV * z - zV * x) / det, (zH * x - xH * z) / det
            scale = np.where(dH < -0.9 * H, -0.9 * H / np.where(dH < 0.0, dH, -1.0), 1.0)
            H, V_A = H + scale * dH, V_A + scale * dV
            if np.max((np.abs(dH) + np.abs(dV)) / T_A) < 1e-7:  # the next would be its square
                break
        else:
            raise ArithmeticError("a cable has no catenary")
        self._force = np.array([H, V_A])
        T_A = np.sqrt(H * H + V_A * V_A)
        l0 = length - self.drum_run / (1.0 + T_A / EA)
        V_B = V_A + w * l0
        V_m = V_A + 0.5 * w * l0
        T_m = np.sqrt(H * H + V_m * V_m)
        by_H = (H + 0.5 * w * V_m * slack * cA) / T_m
        by_V = V_m * (1.0 + 0.5 * w * slack * sA) / T_m
        e_x = (by_H * zV - by_V * zH) / det
        e_z = (by_V * xH - by_H * xV) / det
        e_l = 0.5 * w * V_m / T_m - e_x * by_l0[0] - e_z * by_l0[1]
        stretch = length / EA * np.array([e_x, e_z, e_l])
        return H, V_A, V_B, T_A, np.sqrt(H * H + V_B * V_B), stretch

    def cables(self, y: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        """Return R, EB (k, 3), forces on the platform (k, 3), T_A; H and V_A without damping."""
        k, r = self.k, self.winch.transmission
        R = rotation_of(y[:4])
        EB = self.B @ R.T
        AB = EB + y[4:7] - self.A
        length = self.winch.encoder_zero_length + r * y[13 : 13 + k]
        Bx = np.sqrt(AB[:, 0] ** 2 + AB[:, 1] ** 2)
        H, V_A, V_B, T_A, T_B, stretch = self.catenaries(Bx, AB[:, 2], length)
        velocity = y[10:13] + EB @ cross_matrix(y[7:10]).T
        e_x, e_z, e_l = stretch
        e_B = np.column_stack([(e_x / Bx)[:, None] * AB[:, :2], e_z])
        forces = np.column_stack([(-H / Bx)[:, None] * AB[:, :2], -V_B])
        e_t = -np.einsum("ij,ij->i", e_B, forces) / T_B
        stretching = np.einsum("ij,ij->i", e_B, velocity) + e_l * r * y[13 + k : 13 + 2 * k]
        # Neither end pushes: e_l < 0 < e_t as long as the cables are not slack.
        T_d = np.maximum(self.damping * stretching / length, -np.minimum(-T_A / e_l, T_B / e_t))
        return R, EB, forces - T_d[:, None] * e_B, T_A - e_l * T_d, H, V_A

    def derivatives(self, _t: float, y: Array, rates: Array, noise: Array) -> Array:
        """Return dy/dt with held motor rates [rad/s] and the load cells' noise."""
        k, winch, cells = self.k, self.winch, self.cells
        R, EB, forces, T_A, _H, _V_A = self.cables(y)
        out = np.empty_like(y)
        omega = y[7:10]
        force = forces.sum(0) - self.weight * UP
        EG = R @ self.PG
        # Moment about the centre of mass; what the products of EB and EG add up to, in one product.
        arms = EB - EG
        M = arms.T @ forces
        moment = np.array([M[1, 2] - M[2, 1], M[2, 0] - M[0, 2], M[0, 1] - M[1, 0]])
        inertia = R @ self.inertia @ R.T
        spin = cross_matrix(omega)
        alpha = np.linalg.solve(inertia, moment - spin @ (inertia @ omega))
        w, x, y_, z = y[:4]
        a, b, c = omega
        out[0] = 0.5 * (-a * x - b * y_ - c * z)
        out[1] = 0.5 * (a * w + b * z - c * y_)
        out[2] = 0.5 * (b * w + c * x - a * z)
        out[3] = 0.5 * (c * w + a * y_ - b * x)
        out[4:7] = y[10:13]
        out[7:10] = alpha
        out[10:13] = force / self.mass - cross_matrix(alpha) @ EG - spin @ (spin @ EG)
        angle, rate, integral, filtered, desired = y[13:].reshape(5, k)
        error = desired - angle
        wanted = winch.proportional_gain * error + winch.integral_gain * integral
        wanted = wanted - winch.derivative_gain * rate
        torque = np.clip(wanted, -winch.torque_limit, winch.torque_limit)
        load = winch.transmission * T_A - winch.damping * rate
        out[13 : 13 + k] = rate
        out[13 + k : 13 + 2 * k] = (torque + load) / winch.inertia
        out[13 + 2 * k : 13 + 3 * k] = np.where((torque != wanted) & (wanted * error > 0), 0, error)
        reading = T_A + cells.noise / cells.gain * noise
        out[13 + 3 * k : 13 + 4 * k] = 2.0 * np.pi * cells.cutoff * (reading - filtered)
        out[13 + 4 * k :] = rates
        return out

    # --- the controller

    def measure(self, y: Array, noise: Noise, frame: int) -> tuple[Array, Array, Array, Array]:
        """Return R, p, tensions and tangents (k, 3) at the drawing points as they are measured."""
        cameras = self.robot.cameras
        R, _EB, _forces, _T_A, H, V_A = self.cables(y)
        turn, shift = np.split(noise.pose[frame], 2)
        turn, shift = turn * cameras.orientation_noise, shift * cameras.position_noise
        R_WM = R @ self.target
        seen = R_WM @ rotation_of(np.concatenate([[1.0], 0.5 * turn])) @ self.target.T
        p = y[4:7] + R @ self.p_PM + R_WM @ shift - seen @ self.p_PM
        AB = self.B @ R.T + y[4:7] - self.A
        along = AB[:, :2] / np.hypot(AB[:, 0], AB[:, 1])[:, None]
        u = np.column_stack([H[:, None] * along, V_A]) / np.hypot(H, V_A)[:, None]
        u = u + cameras.tangent_noise * noise.tangents[frame].reshape(-1, 3)
        u /= np.linalg.norm(u, axis=1)[:, None]
        return seen, p, y[13 + 3 * self.k : 13 + 4 * self.k], u

    def motor_rates(self, t: float, R: Array, p: Array, T: Array, u: Array) -> Array:
        """Return the motor rates [rad/s] of eqs. (18), (19) at a time, from what was measured."""
        loop, cable = self.loop, self.robot.cable
        gain = loop.gain * min(t / loop.ramp_time, 1.0) if loop.ramp_time > 0.0 else loop.gain
        R_M, R_Md = R @ self.target, loop.goal_rotation @ self.target
        EM = R @ self.p_PM
        s_w = Rotation.from_matrix(R_M.T @ R_Md).as_rotvec()
        s_t = R_M.T @ (loop.goal_position + loop.goal_rotation @ self.p_PM - p - EM)
        omega = gain * R_M @ s_w
        v = gain * R_M @ (s_t + np.cross(s_t, s_w)) - np.cross(omega, EM)
        # A dead load cell's cable is taken for straight; a slack one keeps a least tension.
        is_dead = 0.5 * cable.min_tension > T
        T = np.where(is_dead, cable.max_tension, T)
        H = T * np.hypot(u[:, 0], u[:, 1])
        EB = self.B @ R.T
        AB = EB + p - self.A
        Bx = np.hypot(AB[:, 0], AB[:, 1])
        H = np.maximum(H, self.w * Bx / 20.0)
        # Wrench and chords as the platform moves by the twist, H held: a complex step.
        dEB = np.cross(omega, EB)
        step = 1j * H_STEP
        EB_, AB_ = EB + step * dEB, AB + step * (dEB + v)
        EG_ = R @ self.PG + step * np.cross(omega, R @ self.PG)
        Bx_ = np.sqrt(AB_[:, 0] ** 2 + AB_[:, 1] ** 2)
        L_ = np.sqrt(Bx_**2 + AB_[:, 2] ** 2)
        per_H = np.column_stack([AB_[:, :2] / Bx_[:, None], AB_[:, 2] / Bx_])
        on_cables = per_H * H[:, None] + 0.5 * self.w * L_[:, None] * UP
        moment = np.cross(EB_, on_cables).sum(0) + np.cross(EG_, self.weight * UP)
        change = np.concatenate([moment, on_cables.sum(0)]).imag / H_STEP
        D = np.vstack([np.cross(EB, per_H.real).T, per_H.real.T])
        dH = -np.linalg.pinv(D) @ change
        length = parabola(Bx_, AB_[:, 2], H + step * dH, self.w)
        return length.imag / H_STEP / self.winch.transmission

    # --- the run

    def at_rest(self, start: Start) -> Array:
        """Return the state at a rest."""
        winch = self.winch
        angle = (start.length - winch.encoder_zero_length) / winch.transmission
        q = Rotation.from_matrix(start.rotation).as_quat()[[3, 0, 1, 2]]
        integral = -winch.transmission * start.tension / winch.integral_gain
        zero = np.zeros(self.k)
        tail = [angle, zero, integral, start.tension, angle]
        AB = self.B @ start.rotation.T + start.position - self.A
        L = np.linalg.norm(AB, axis=1)
        H = start.tension * np.hypot(AB[:, 0], AB[:, 1]) / L
        self._force = np.array([H, start.tension * AB[:, 2] / L])
        return np.concatenate([q, start.position, np.zeros(6), *tail])

    def run(
        self, start: Start, noise: Noise, until: float, method: str = "RK45", **settings: float
    ) -> tuple[Array, Array]:
        """Return place (n, 3) [m] and rotation (n, 3, 3) at the frames 0, T, ... until.

        Args:
            start: the rest to start from.
            noise: of at least as many frames.
            until: [s], a whole number of frames.
            method: of `solve_ivp`.
            settings: rtol, atol.
        """
        T, latency = self.loop.sample_time, self.loop.latency
        y, rates, first = self.at_rest(start), np.zeros(self.k), None
        places, rotations = [y[4:7]], [rotation_of(y[:4])]
        for frame in range(round(until / T)):
            measured = self.measure(y, noise, frame)
            t, change, end = frame * T, frame * T + latency, (frame + 1) * T
            for a, b in ((t, change), (change, end)):
                if a == change:
                    rates = self.motor_rates(a, *measured)
                if b <= a:
                    continue
                step = min(first, b - a) if first else None
                found = solve_ivp(
                    self.derivatives, (a, b), y, method, args=(rates, noise.tension[frame]),
                    first_step=step, **settings,
                )  # fmt: skip
                if not found.success:
                    raise ArithmeticError(found.message)
                y = found.y[:, -1]
                first = max(np.diff(found.t))
            places.append(y[4:7])
            rotations.append(rotation_of(y[:4]))
        return np.array(places), np.array(rotations)


def rotation_of(q: Array) -> Array:
    """Return the rotation matrix of a quaternion [w, x, y, z] of any norm."""
    w, x, y, z = q
    n = 2.0 / (w * w + x * x + y * y + z * z)
    return np.array(
        [
            [1.0 - n * (y * y + z * z), n * (x * y - w * z), n * (x * z + w * y)],
            [n * (x * y + w * z), 1.0 - n * (x * x + z * z), n * (y * z - w * x)],
            [n * (x * z - w * y), n * (y * z + w * x), 1.0 - n * (x * x + y * y)],
        ]
    )


def cross_matrix(a: Array) -> Array:
    """Return [a]x."""
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def parabola(Bx: Array, Bz: Array, H: Array, w: float) -> Array:
    """Return the lengths of parabolic cables (eq. 8), in complex numbers too."""
    r = w * np.sqrt(Bx**2 + Bz**2) / H
    k1, k2 = Bz / Bx + 0.5 * r, Bz / Bx - 0.5 * r
    c1, c2 = np.sqrt(1.0 + k1**2), np.sqrt(1.0 + k2**2)
    return Bx / (2.0 * r) * (c1 * k1 - c2 * k2 + np.arcsinh(k1) - np.arcsinh(k2))
