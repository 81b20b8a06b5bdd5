"""What tests of the study share: poses, robots of a class, central differences of a diagram."""

from __future__ import annotations

from typing import Any

import numpy as np

from cdpr_drake.errors import CdprError
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import as_pose
from cdpr_drake.model.statics import wrench_matrix

POSE = np.array([0.02, -0.03, 0.31, -2.28, -0.6, 1.66])
"""Near the goal of the paper's Test 4 on CoGiRo."""

MODELS = ("ECM", "CMWE", "SCMWE", "SLSM")


def miscalibrated(robot: CableRobot) -> CableRobot:
    """Return a robot with the calibration errors that a laser tracker leaves, a bit larger."""
    generator = np.random.default_rng(3)
    cameras = robot.cameras
    shift = type(cameras.X_WF)([0.004, -0.003, 0.005])
    return robot.replace(
        drawing_points=robot.drawing_points + generator.normal(0.0, 4e-3, (robot.num_cables, 3)),
        attachment_points=robot.attachment_points
        + generator.normal(0.0, 3e-3, (robot.num_cables, 3)),
        cameras=cameras.replace(X_WF=shift @ cameras.X_WF, X_PM=cameras.X_PM @ shift.inverse()),
        load_cells=robot.load_cells.replace(gain=np.full(robot.num_cables, 1.02)),
    )


def robot_of_a_class(
    cogiro: CableRobot, num_cables: int, drum_run: float, seed: int
) -> tuple[CableRobot, np.ndarray]:
    """Return a random robot and a pose that a law with exact knowledge controls well.

    t_d = 5 ms, tensions of least norm from 50 N to 3 kN, singular values of the wrench matrix of
    0.3 and more (unit force directions, arms in m).
    """
    generator = np.random.default_rng([seed, num_cables])
    k = num_cables
    for _ in range(20000):
        size = generator.uniform([6.0, 5.0, 4.0], [16.0, 12.0, 7.0])
        angle = np.sort(generator.uniform(0.0, 2.0 * np.pi, k))
        around = np.column_stack([np.cos(angle), np.sin(angle)])
        plan = 0.5 * size[:2] * around * generator.uniform(0.8, 1.2, (k, 2))
        drawing = np.column_stack([plan, size[2] * generator.uniform(0.9, 1.1, k)])
        attachment = generator.uniform([-0.6, -0.6, 0.0], [0.6, 0.6, 1.2], (k, 3))
        turn = generator.uniform(-0.1, 0.1, 3)
        pose = np.concatenate([turn, generator.uniform([-1.0, -1.0, 0.5], [1.0, 1.0, 2.0])])
        if not _may_do(cogiro, drawing, attachment, pose):
            continue
        robot = cogiro.replace(
            name=f"random-{k}",
            drawing_points=drawing,
            attachment_points=attachment,
            cable=cogiro.cable.replace(damping_time=5e-3, drum_run=np.full(k, drum_run)),
            winch=cogiro.winch.replace(encoder_zero_length=np.zeros(k)),
            load_cells=cogiro.load_cells.replace(bias=np.zeros(k), gain=np.ones(k)),
        )
        matrix = wrench_matrix(cable_geometry(robot, pose))
        if np.linalg.svd(matrix, compute_uv=False)[-1] < 0.3:
            continue
        try:
            tension = rest_state(robot, pose).chord_tension
        except CdprError:
            continue
        if tension.min() >= 50.0 and tension.max() <= 3000.0:
            return robot, pose
    raise AssertionError("no such robot")


def _may_do(
    cogiro: CableRobot, drawing: np.ndarray, attachment: np.ndarray, pose: np.ndarray
) -> bool:
    """Whether straight cables would nearly do: a quick look before a robot is made."""
    R = as_pose(pose).rotation().matrix()
    EB = attachment @ R.T
    u = EB + pose[3:] - drawing
    u /= np.linalg.norm(u, axis=1)[:, None]
    matrix = np.concatenate([np.cross(EB, u), u], axis=1).T
    if np.linalg.svd(matrix, compute_uv=False)[-1] < 0.3:
        return False
    force = np.array([0.0, 0.0, -cogiro.mass * cogiro.gravity])
    weight = np.concatenate([np.cross(R @ cogiro.center_of_mass, force), force])
    return bool(np.linalg.lstsq(matrix, weight, rcond=None)[0].min() > 45.0)


def central_differences(
    diagram: Any, context: Any, inputs: list[str], outputs: list[str], step: float = 1e-6
) -> tuple[np.ndarray, ...]:
    """Return A, B, C, D of a continuous diagram by central differences of its plain numbers."""
    ports = [diagram.GetInputPort(name) for name in inputs]
    values = [p.Eval(context) if p.HasValue(context) else np.zeros(p.size()) for p in ports]
    x = context.get_continuous_state_vector().CopyToVector()
    z = np.concatenate([x, *values])
    splits = np.cumsum([x.size] + [v.size for v in values])[:-1]
    work = diagram.CreateDefaultContext()
    work.SetTimeStateAndParametersFrom(context)
    diagram.FixInputPortsFrom(diagram, context, work)

    def evaluate(z: np.ndarray) -> np.ndarray:
        state, *u = np.split(z, splits)
        work.SetContinuousState(state)
        for port, value in zip(ports, u, strict=True):
            port.FixValue(work, value)
        y = [diagram.GetOutputPort(name).Eval(work) for name in outputs]
        return np.concatenate([diagram.EvalTimeDerivatives(work).CopyToVector(), *y])

    columns = []
    for i in range(z.size):
        h = step * max(1.0, abs(z[i]))
        up, down = z.copy(), z.copy()
        up[i] += h
        down[i] -= h
        columns.append((evaluate(up) - evaluate(down)) / (up[i] - down[i]))
    J = np.column_stack(columns)
    n = x.size
    return J[:n, :n], J[:n, n:], J[n:, :n], J[n:, n:]
