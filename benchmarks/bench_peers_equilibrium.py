"""The pose of a robot from the lengths of its cables: ours, MoorPy, SciPy.

The platform hangs on eight sagging elastic cables of given unstrained lengths, without the run from
the drum, which only ours knows; each solver starts 0.17 m and 4 degrees away. The error is the
distance to the pose whose statics gave the lengths. Then ours alone over the whole workspace, with
the run, cables slack at random: how many equilibria it does not find, and what it leaves unbalanced
in force over the weight.

    python -m benchmarks peers_equilibrium [--count 10000] [--poses 5] [--rounds 3]
"""

from __future__ import annotations

import argparse
import contextlib
import io
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from pydrake.math import RollPitchYaw, RotationMatrix

from benchmarks.harness import Contestant, Report, Spread, interleave, positive, ratio, run
from cdpr_drake.errors import CdprError, EquilibriumError
from cdpr_drake.model.equilibrium import forward_kinematics, platform_balance, rest_state
from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.rotations import pose_to_vector

AT_LEAST = 10.0
MAX_RESIDUAL = 1e-9
MOORPY_TOLERANCE = 1e-7
"""Of MoorPy's positions [m], which leaves errors like ours below 1e-9 m; its default is 0.05 m."""

AWAY = np.array([0.04, -0.04, 0.04, 0.1, -0.1, 0.1])
LOW = np.array([-0.15, -0.15, -0.4, -4.5, -3.0, 0.2])
HIGH = np.array([0.15, 0.15, 0.4, 4.5, 3.0, 3.5])

Pose = np.ndarray  # [roll, pitch, yaw, x, y, z] (rad, m)


def plain_robot() -> CableRobot:
    """Return the robot without the runs from drum to eyelet."""
    robot = load_robot("cogiro")
    return robot.replace(cable=robot.cable.replace(drum_run=np.zeros(robot.num_cables)))


def some_poses(robot: CableRobot, count: int, seed: int) -> list[tuple[Pose, np.ndarray]]:
    """Return random poses and the cables' lengths of a rest there."""
    generator = np.random.default_rng(seed)
    found: list[tuple[Pose, np.ndarray]] = []
    while len(found) < count:
        pose = generator.uniform(0.5 * LOW, 0.5 * HIGH)
        pose[5] += 1.0
        with contextlib.suppress(CdprError):  # no tensions without a push hold it there
            found.append((pose, rest_state(robot, pose).unstrained_length))
    return found


class MoorPy:
    """The robot as a moored body: in water that weighs nothing, far above the sea bed."""

    def __init__(self, robot: CableRobot) -> None:
        import moorpy

        cable = robot.cable
        self.system = moorpy.System(depth=100.0, rho=0.0, g=robot.gravity)
        self.system.lineTypes["cable"] = {
            "name": "cable",
            "d_vol": cable.diameter,
            "m": cable.linear_density,
            "w": robot.weight_per_metre,
            "EA": cable.stiffness(0.0),
        }
        self.system.addBody(0, np.zeros(6), m=robot.mass, v=0.0, rCG=robot.center_of_mass)
        self.body = self.system.bodyList[0]
        for A, B in zip(robot.drawing_points, robot.attachment_points, strict=True):
            self.system.addPoint(1, A)
            self.system.addPoint(1, np.zeros(3))
            last = len(self.system.pointList)
            self.body.attachPoint(last, B)
            self.system.addLine(1.0, "cable", pointA=last - 1, pointB=last)

    def solve(self, length: np.ndarray, guess: Pose) -> Pose:
        """Return the pose."""
        # MoorPy turns by x, y and z angles of its own convention: give it Drake's rotation in them.
        R = RollPitchYaw(guess[:3]).ToRotationMatrix().matrix()
        for line, l in zip(self.system.lineList, length, strict=True):
            line.setL(l)
        self.body.setPosition(np.concatenate([guess[3:], _intrinsic_angles(R)]))
        with contextlib.redirect_stdout(io.StringIO()):
            self.system.initialize()
            if not self.system.solveEquilibrium(tol=MOORPY_TOLERANCE, no_fail=True):
                raise EquilibriumError("MoorPy found none")
        angles = RollPitchYaw(RotationMatrix.ProjectToRotationMatrix(self.body.R)).vector()
        return np.concatenate([angles, self.body.r6[:3]])


def _intrinsic_angles(R: np.ndarray) -> np.ndarray:
    """Return the angles of R = Rx Ry Rz, MoorPy's order."""
    y = np.arcsin(R[0, 2])
    return np.array([np.arctan2(-R[1, 2], R[2, 2]), y, np.arctan2(-R[0, 1], R[0, 0])])


class SciPy:
    """SciPy's `root` on pose and end forces of all cables at once, 6 + 2 k equations."""

    def __init__(self, robot: CableRobot) -> None:
        self.robot, self.EA = robot, robot.cable.stiffness(0.0)
        self.weight = robot.mass * robot.gravity

    def solve(self, length: np.ndarray, guess: Pose) -> Pose:
        """Return the pose."""
        from scipy.optimize import root

        k = self.robot.num_cables
        forces = np.tile([1.0, -0.3], k).reshape(k, 2) * self.weight / 3.0
        scale = np.concatenate([np.ones(6), np.full(2 * k, self.weight)])
        start = np.concatenate([guess, forces.T.ravel()]) / scale
        found = root(lambda z: self._misses(z * scale, length), start, options={"xtol": 1e-13})
        if not np.abs(found.fun).max() < 1e-6:
            raise EquilibriumError(found.message)
        return found.x[:6]

    def _misses(self, z: np.ndarray, l: np.ndarray) -> np.ndarray:
        robot, k, w, EA = self.robot, self.robot.num_cables, self.robot.weight_per_metre, self.EA
        R = RollPitchYaw(z[:3]).ToRotationMatrix().matrix()
        EB = robot.attachment_points @ R.T
        AB = EB + z[3:6] - robot.drawing_points
        Bx = np.hypot(AB[:, 0], AB[:, 1])
        H, V_B = np.maximum(z[6 : 6 + k], 1e-6), z[6 + k :]
        V_A = V_B - w * l
        T_A, T_B = np.hypot(H, V_A), np.hypot(H, V_B)
        x = H * l / EA + H / w * (np.arcsinh(V_B / H) - np.arcsinh(V_A / H))
        z_B = l * (V_A + V_B) * (0.5 / EA + 1.0 / (T_A + T_B))
        force = -np.column_stack([AB[:, :2] * (H / Bx)[:, None], V_B])
        G = np.array([0.0, 0.0, -self.weight])
        torque = np.cross(EB, force).sum(0) + np.cross(R @ robot.center_of_mass, G)
        balance = np.concatenate([torque, force.sum(0) + G]) / self.weight
        return np.concatenate([balance, x - Bx, z_B - AB[:, 2]])


def ours(robot: CableRobot) -> Callable[[np.ndarray, Pose], Pose]:
    """Return our way."""
    return lambda length, guess: pose_to_vector(forward_kinematics(robot, length, guess).X_WP)


def misses(solve: Callable[..., Pose], cases: list[tuple[Pose, np.ndarray]]) -> np.ndarray:
    """Return the distances [m] of what is found to the poses, NaN where nothing is found."""
    distances = []
    for pose, length in cases:
        try:
            distances.append(float(np.linalg.norm((solve(length, pose + AWAY) - pose)[3:])))
        except Exception:  # whatever a peer raises is its failure on this robot
            distances.append(np.nan)
    return np.array(distances)


def compare(report: Report, options: argparse.Namespace) -> None:
    """Time ours beside its peers."""
    robot = plain_robot()
    cases = some_poses(robot, options.poses, options.seed)
    ways: dict[str, Callable[..., Pose]] = {"ours": ours(robot)}
    if report.has("moorpy"):
        ways[f"MoorPy, {MOORPY_TOLERANCE:g} m"] = MoorPy(robot).solve
    ways["SciPy root"] = SciPy(robot).solve
    results: dict[str, np.ndarray] = {}

    def call(name: str) -> Callable[[], object]:
        return lambda: results.__setitem__(name, misses(ways[name], cases))

    contestants = [Contestant(name=n, call=call(n), units=len(cases)) for n in ways]
    times = interleave(contestants, options.rounds)
    rows: list[dict[str, Any]] = []
    for name in ways:
        found = results[name][np.isfinite(results[name])]
        largest = float(found.max()) if found.size else float("nan")
        rows.append(
            {
                "one equilibrium": name,
                "ms": Spread.of(times[name]).scaled(1e3),
                "largest error [m]": largest,
                "not found": f"{len(cases) - found.size} of {len(cases)}",
            }
        )
    report.table(f"{len(cases)} poses of {robot.name}", rows)
    for name in list(ways)[1:]:
        least = AT_LEAST if name.startswith("MoorPy") else None
        report.ratio(f"{name} / ours", ratio(times[name], times["ours"]), at_least=least)
    report.figure("largest error of ours [m]", rows[0]["largest error [m]"], at_most=MAX_RESIDUAL)


def random_lengths(
    robot: CableRobot, pose: Pose, generator: np.random.Generator
) -> tuple[np.ndarray, int]:
    """Return lengths that would give some tensions at a pose, up to three cables 2 to 8 % longer,
    and how many those are.
    """
    chords, k = cable_geometry(robot, pose).L, robot.num_cables
    tension = generator.uniform(50.0, 1500.0, k)
    length = (chords + robot.cable.drum_run) / (1.0 + tension / robot.cable.stiffness(0.0))
    loose = generator.choice(k, generator.integers(0, 4), replace=False)
    length[loose] += chords[loose] * generator.uniform(0.02, 0.08, loose.size)
    return length, loose.size


def sweep(report: Report, options: argparse.Namespace) -> None:
    """Find equilibria all over the workspace."""
    robot = load_robot("cogiro")
    generator = np.random.default_rng(options.seed)
    failed, loose_cables, residuals, moved = 0, 0, [], []
    begun = time.process_time()
    for _ in range(options.count):
        pose = generator.uniform(LOW, HIGH)
        length, loose = random_lengths(robot, pose, generator)
        loose_cables += loose
        try:
            found = forward_kinematics(robot, length, pose)
        except EquilibriumError as error:
            failed += 1
            print(f"  not found from {pose}: {error}")
            continue
        wrench = platform_balance(robot, found.X_WP, length)[0]
        residuals.append(float(np.abs(wrench).max()) / (robot.mass * robot.gravity))
        moved.append(float(np.linalg.norm(found.X_WP.translation() - pose[3:])))
    each = (time.process_time() - begun) / options.count
    print(
        f"\n{robot.name}, {options.count} equilibria over the workspace, {each * 1e3:.2f} ms each"
    )
    report.figure("equilibria", options.count)
    report.figure("not found", failed, at_most=0)
    report.figure("largest force left over the weight", max(residuals), at_most=MAX_RESIDUAL)
    report.figure("loose cables in each", loose_cables / options.count)
    report.figure("distance from guess to pose, median", float(np.median(moved)), "m")
    report.figure("distance from guess to pose, largest", max(moved), "m")
    report.figure("time each", each * 1e3, "ms")


def measure(report: Report, options: argparse.Namespace) -> None:
    """Fill the report."""
    compare(report, options)
    sweep(report, options)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add this benchmark's options."""
    parser.add_argument(
        "--count", type=positive, default=10000, help="equilibria over the workspace"
    )
    parser.add_argument("--poses", type=positive, default=5, help="that all solvers find")
    parser.add_argument("--rounds", type=positive, default=3)
    parser.add_argument("--seed", type=int, default=0)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; the exit status says whether a figure other than a ratio of times misses."""
    report = run("peers_equilibrium", __doc__, measure, add_options, arguments)
    return 0 if report.is_right() else 1


if __name__ == "__main__":
    sys.exit(main())
