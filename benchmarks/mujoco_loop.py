"""The vision-based loop in MuJoCo with straight elastic cables: no sag, no drum, no winch's motor.

A cable is a spatial tendon with an actuator that pulls with EA (L - l) / l0 as long as it is
stretched, l0 its length at the start, and damps its rate of stretch likewise; the actuator's own
activation is l, which an integrator drives at the held rate. Between two changes of the rates
MuJoCo steps by itself, in compiled code. The law is the package's, fed with what MuJoCo knows: the
pose, the tendons' directions, and their forces filtered frame by frame, with the same noise as
elsewhere.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from benchmarks.solve_ivp_loop import Loop, Noise, Start, rotation_of
from cdpr_drake.model.camera import MeasuredPose
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.servo import MotorRateLaw, ServoSettings
from cdpr_drake.model.statics import wrench_matrix

BODY = """
<mujoco>
  <compiler inertiafromgeom="false"/>
  <option timestep="{step}" integrator="RK4" gravity="0 0 -{gravity}">
    <flag contact="disable" constraint="disable"/>
  </option>
  <worldbody>
    {drawing}
    <body name="platform">
      <freejoint/>
      <inertial pos="{com}" mass="{mass}" fullinertia="{inertia}"/>
      {attachment}
    </body>
  </worldbody>
  <tendon>{tendons}</tendon>
  <actuator>{actuators}</actuator>
</mujoco>
"""


def model_of(robot: Any, length: np.ndarray, step: float) -> mujoco.MjModel:
    """Return the robot with cables of about the given total lengths (k,) [m]."""

    def text(values: Any) -> str:
        return " ".join(f"{float(v):.17g}" for v in np.ravel(values))

    I, cable = robot.inertia, robot.cable
    drawing, attachment, tendons, actuators = [], [], [], []
    for i, (A, B, l) in enumerate(
        zip(robot.drawing_points, robot.attachment_points, length, strict=True)
    ):
        drawing.append(f'<site name="A{i}" pos="{text(A)}"/>')
        attachment.append(f'<site name="B{i}" pos="{text(B)}"/>')
        tendons.append(f'<spatial name="c{i}"><site site="A{i}"/><site site="B{i}"/></spatial>')
        stiffness = cable.stiffness(0.0) / l
        actuators.append(
            f'<intvelocity name="w{i}" tendon="c{i}" kp="{stiffness:.17g}" '
            f'kv="{stiffness * cable.damping_time:.17g}" actrange="0 1000" '
            f'forcelimited="true" forcerange="-{cable.breaking_load} 0"/>'
        )
    xml = BODY.format(
        step=step,
        gravity=robot.gravity,
        com=text(robot.center_of_mass),
        mass=robot.mass,
        inertia=text([I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]),
        drawing="".join(drawing),
        attachment="".join(attachment),
        tendons="".join(tendons),
        actuators="".join(actuators),
    )
    return mujoco.MjModel.from_xml_string(xml)


class MujocoLoop:
    """One robot and its loop in MuJoCo, ready to be run."""

    def __init__(self, robot: Any, loop: Loop, start: Start, step: float = 1e-3) -> None:
        self.robot, self.loop, self.start, self.step = robot, loop, start, step
        self.model = model_of(robot, start.length, step)
        self.measured = MeasuredPose(robot, robot)
        self.law = MotorRateLaw(robot, ServoSettings(gain=loop.gain, ramp_time=loop.ramp_time))
        self.goal = _vector(loop.goal_rotation, loop.goal_position)

    def at_rest(self) -> mujoco.MjData:
        """Return data at rest at the start: straight cables with tensions of least norm."""
        robot, start = self.robot, self.start
        data = mujoco.MjData(self.model)
        data.qpos[:3] = start.position
        data.qpos[3:] = RotationMatrix(start.rotation).ToQuaternion().wxyz()
        chords = cable_geometry(
            robot, RigidTransform(RotationMatrix(start.rotation), start.position)
        )
        weight = np.array([0.0, 0.0, -robot.mass * robot.gravity])
        arm = start.rotation @ robot.center_of_mass
        wrench = np.concatenate([np.cross(arm, weight), weight])
        tension = np.linalg.lstsq(wrench_matrix(chords), wrench, rcond=None)[0]
        data.act[:] = chords.L - tension * start.length / robot.cable.stiffness(0.0)
        mujoco.mj_forward(self.model, data)
        self.filtered = tension
        return data

    def rates(self, data: mujoco.MjData, noise: Noise, frame: int) -> np.ndarray:
        """Return the rates of the lengths (k,) [m/s] that follow from what is seen in a frame."""
        robot, cameras, cells = self.robot, self.robot.cameras, self.robot.load_cells
        sigma = np.repeat([cameras.orientation_noise, cameras.position_noise], 3)
        R = rotation_of(data.qpos[3:7])
        pose = self.measured(np.concatenate([_vector(R, data.qpos[:3]), sigma * noise.pose[frame]]))
        ends = robot.attachment_points @ R.T + data.qpos[:3]
        u = ends - robot.drawing_points
        u /= np.linalg.norm(u, axis=1)[:, None]
        u += cameras.tangent_noise * noise.tangents[frame].reshape(-1, 3)
        z = np.concatenate([pose, self.goal, np.zeros(6), self.filtered, u.ravel()])
        reading = -data.actuator_force + cells.noise * noise.tension[frame]
        passed = 1.0 - np.exp(-2.0 * np.pi * cells.cutoff * self.loop.sample_time)
        self.filtered += passed * (reading - self.filtered)
        now = self.law.settings.gain_at(frame * self.loop.sample_time + self.loop.latency)
        return self.law(z, now)[: robot.num_cables] * robot.winch.transmission

    def run(self, noise: Noise, until: float) -> np.ndarray:
        """Return the poses (n, 6) [roll, pitch, yaw, x, y, z] at the frames 0, T, ... until."""
        model, data, loop = self.model, self.at_rest(), self.loop
        before = round(loop.latency / self.step)
        after = round(loop.sample_time / self.step) - before
        poses = [_vector(rotation_of(data.qpos[3:7]), data.qpos[:3])]
        for frame in range(round(until / loop.sample_time)):
            rates = self.rates(data, noise, frame)
            mujoco.mj_step(model, data, nstep=before)
            data.ctrl[:] = rates
            mujoco.mj_step(model, data, nstep=after)
            mujoco.mj_forward(model, data)
            poses.append(_vector(rotation_of(data.qpos[3:7]), data.qpos[:3]))
        return np.array(poses)


def _vector(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    return np.concatenate([RollPitchYaw(RotationMatrix(R)).vector(), p])
