"""Cables over swivelling pulleys: against mpmath, closed forms, energy, differences and eyelets."""

from __future__ import annotations

from types import SimpleNamespace

import mpmath
import numpy as np
import pytest
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.analysis import gain_matrix, level_workspace
from cdpr_drake.diagrams import make_plant, make_vision_based_control, rest_context
from cdpr_drake.errors import CableError, EquilibriumError, GeometryError, RobotFileError
from cdpr_drake.model import kinematics
from cdpr_drake.model.equilibrium import forward_kinematics, rest_state
from cdpr_drake.model.inverse_kinematics import InverseKinematics
from cdpr_drake.model.kernels import catenary, pulley
from cdpr_drake.model.pulleys import contact
from cdpr_drake.model.robot import CableRobot, Pulleys, load_robot
from cdpr_drake.model.rotations import exp_rotation, pose_to_vector
from cdpr_drake.model.servo import ServoSettings
from cdpr_drake.runs.moves import move_near_the_middle
from cdpr_drake.study import linearize

UP, DOWN = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])
WITH_PULLEYS = ("cogiro-2015-pulleys", "caroca", "cuhk-cablerobot")

mpmath.mp.dps = 40


# --- one cable


def a_cable(F, a, rho, B, length, run=0.0, w=0.6, EA=4e5, damping=0.0):
    """Return the arguments of the kernel for one cable, but for speeds."""
    points = np.zeros((4, 1, 3))
    points[0, 0], points[2, 0], points[3, 0, 0] = F, a / np.linalg.norm(a), rho
    constants = np.array([w, EA, 0.0, 1.0, damping, 1e9, run])
    return points, np.array([B], float), np.array([float(length)]), constants


def solve(cable, v_B=(0.0, 0.0, 0.0), rate=0.0, differs=True):
    """Return the status, the outputs (14,) and the Jacobian (14, 8) of the kernel."""
    points, p_WB, length, constants = cable
    out, jacobian = np.zeros((1, 14)), np.zeros((1, 14, 8))
    status = pulley.robot_forces(
        points, p_WB, np.array([v_B], float), length, np.array([rate]), constants, differs, out,
        jacobian,
    )  # fmt: skip
    return status, out[0], jacobian[0]


def straight(F, a, rho, B):
    """Return (wrap angle, free length) of a straight cable, by the angle at the pulley's centre."""
    d = np.asarray(B) - F
    y = d @ a
    x = np.linalg.norm(d - y * a)
    to_centre = np.hypot(x - rho, y)
    # Seen from the centre B stands at atan2(y, x - rho) and the contact by acos(rho / distance)
    # further; the cable enters at the angle pi and wraps clockwise from there.
    contact_at = np.arctan2(y, x - rho) + np.arccos(rho / to_centre)
    return np.mod(np.pi - contact_at, 2.0 * np.pi), np.sqrt(to_centre**2 - rho**2)


def random_cable(rng, kind: str, stretch: float):
    """Return a cable, its straight length times `stretch` long."""
    a = {"up": UP, "down": DOWN}.get(kind, rng.normal(size=3))
    a = a / np.linalg.norm(a)
    while True:
        rho, F = 10.0 ** rng.uniform(-2.0, -0.5), rng.uniform(-5.0, 5.0, 3)
        B = F + rng.normal(0.0, 5.0, 3)
        if np.linalg.norm(np.cross(B - F, a)) > 3.0 * rho:
            break
    theta, free = straight(F, a, rho, B)
    run = rng.choice([0.0, 3.0])
    return a_cable(F, a, rho, B, run + (rho * theta + free) * stretch, run)


class Exact:
    """One cable shot from its winch, in many digits: B follows from (theta, sigma, T_A)."""

    def __init__(self, cable) -> None:
        points, _, _, constants = cable
        self.F, self.a = ([mpmath.mpf(x) for x in points[j, 0]] for j in (0, 2))
        size = mpmath.sqrt(sum(x * x for x in self.a))
        self.a = [x / size for x in self.a]
        self.rho, self.w, self.EA = (
            mpmath.mpf(x) for x in (points[3, 0, 0], constants[0], constants[1])
        )
        self.run = mpmath.mpf(constants[6])
        p = np.array([1.0, 0.0, 0.0]) if abs(points[2, 0, 0]) < 0.9 else np.array([0.0, 1.0, 0.0])
        along = sum(mpmath.mpf(x) * y for x, y in zip(p, self.a, strict=True))
        self.p = [mpmath.mpf(x) - along * y for x, y in zip(p, self.a, strict=True)]
        size = mpmath.sqrt(sum(x * x for x in self.p))
        self.p = [x / size for x in self.p]
        a, p = self.a, self.p
        self.q = [a[i - 2] * p[i - 1] - a[i - 1] * p[i - 2] for i in range(3)]

    def parts(self, theta, sigma):
        """Return A, the tangent there and e."""
        e = [
            mpmath.cos(sigma) * x + mpmath.sin(sigma) * y
            for x, y in zip(self.p, self.q, strict=True)
        ]
        s, c = mpmath.sin(theta), mpmath.cos(theta)
        A = [
            f + self.rho * (s * x + (1 - c) * y) for f, x, y in zip(self.F, self.a, e, strict=True)
        ]
        return A, [c * x + s * y for x, y in zip(self.a, e, strict=True)], e

    def end(self, theta, sigma, T_A, length):
        """Return B and the force of the cable on what it pulls there."""
        A, t, _ = self.parts(theta, sigma)
        l = length - (self.run + self.rho * theta) / (1 + T_A / self.EA)
        H, V_A = T_A * mpmath.hypot(t[0], t[1]), T_A * t[2]
        V_B = V_A + self.w * l
        x = H * l / self.EA + H / self.w * (mpmath.asinh(V_B / H) - mpmath.asinh(V_A / H))
        z = (V_A + V_B) * l / (2 * self.EA) + (mpmath.hypot(H, V_B) - T_A) / self.w
        level = [t[i] / mpmath.hypot(t[0], t[1]) for i in range(2)]
        B = [A[0] + level[0] * x, A[1] + level[1] * x, A[2] + z]
        return B, [-H * level[0], -H * level[1], -V_B]

    def solve(self, B, length, start):
        """Return (theta, sigma, T_A) for an end B."""
        found = mpmath.findroot(
            lambda *u: [x - y for x, y in zip(self.end(*u, length)[0], B, strict=True)], start
        )
        return list(found)


def swivel(exact: Exact, e) -> float:
    """Return the angle sigma of a direction e."""
    return float(
        mpmath.atan2(
            sum(mpmath.mpf(x) * y for x, y in zip(e, exact.q, strict=True)),
            sum(mpmath.mpf(x) * y for x, y in zip(e, exact.p, strict=True)),
        )
    )


def leaves_at(cable, tangent):
    """Return the contact of one cable by the NumPy twin of the kernel."""
    points, p_WB, _, _ = cable
    one = SimpleNamespace(
        drawing_points=points[0], pulley_radii=points[3, :, 0], pulley_axes=points[2]
    )
    return contact(one, p_WB, None if tangent is None else np.array([tangent]))


@pytest.mark.parametrize("kind", ["up", "down", "tilted"])
@pytest.mark.parametrize("stretch", [0.999, 1.0 + 1e-6, 1.02, 1.4])
def test_a_cable_is_the_one_shot_from_its_winch(kind: str, stretch: float) -> None:
    """Contact, forces and their derivatives by B and length, in 40 digits."""
    rng = np.random.default_rng([len(kind), int(1000 * stretch)])
    cable = random_cable(rng, kind, stretch)
    status, out, jacobian = solve(cable)
    assert status == 0
    at = leaves_at(cable, out[5:8])
    exact = Exact(cable)
    B, length = [mpmath.mpf(x) for x in cable[1][0]], mpmath.mpf(cable[2][0])
    found = exact.solve(B, length, (float(at.theta[0]), swivel(exact, at.e[0]), float(out[3])))
    A, t, _ = exact.parts(*found[:2])
    force = exact.end(*found, length)[1]
    np.testing.assert_allclose(at.p_WA[0], [float(x) for x in A], rtol=1e-11, atol=1e-11)
    assert at.theta[0] == pytest.approx(float(found[0]), rel=1e-9)
    np.testing.assert_allclose(out[5:8], [float(x) for x in t], atol=1e-10)
    size = float(mpmath.norm(force))
    np.testing.assert_allclose(out[:3], [float(x) for x in force], atol=1e-9 * size)
    assert out[3] == pytest.approx(float(found[2]), rel=1e-9)
    # Differences in 40 digits, four times as exact as they need be.
    h, K = mpmath.mpf(10) ** -12, np.zeros((3, 4))
    for j in range(4):
        ends = []
        for sign in (1, -1):
            moved = [x + (sign * h if i == j else 0) for i, x in enumerate(B)]
            longer = length + (sign * h if j == 3 else 0)
            u = exact.solve(moved, longer, found)
            ends.append(exact.end(*u, longer)[1])
        K[:, j] = [float((x - y) / (2 * h)) for x, y in zip(*ends, strict=True)]
    np.testing.assert_allclose(jacobian[:3, :3], K[:, :3], atol=1e-9 * np.abs(K[:, :3]).max())
    np.testing.assert_allclose(jacobian[:3, 6], K[:, 3], atol=1e-9 * np.abs(K[:, 3]).max())


@pytest.mark.parametrize("kind", ["up", "down", "tilted"])
def test_all_outputs_of_a_moving_cable_differentiate(kind: str) -> None:
    """The Jacobian (14, 8) with damping against differences, taut and sagging."""
    rng = np.random.default_rng(len(kind))
    for stretch in (0.9995, 1.01):
        points, p_WB, length, constants = random_cable(rng, kind, stretch)
        constants[4] = 1e-3
        v, rate = rng.normal(0.0, 0.3, 3), 0.2
        x = np.concatenate([p_WB[0], v, length, [rate]])

        def outputs(x, points=points, constants=constants):
            return solve((points, x[None, :3], x[6:7], constants), x[3:6], x[7], differs=False)[1]

        jacobian = solve((points, p_WB, length, constants), v, rate)[2]
        steps = 1e-5 * np.eye(8)
        found = np.array(
            [
                (8.0 * (outputs(x + h) - outputs(x - h)) - outputs(x + 2 * h) + outputs(x - 2 * h))
                / 12e-5
                for h in steps
            ]
        ).T
        scale = np.abs(found).max(axis=1, keepdims=True)
        np.testing.assert_allclose(jacobian / scale, found / scale, atol=1e-6)


def test_without_weight_a_cable_leaves_as_a_straight_one() -> None:
    rng = np.random.default_rng(0)
    for kind in 10 * ["up", "down", "tilted"]:
        points, p_WB, length, constants = random_cable(rng, kind, 0.99)
        constants[0] = 1e-12
        status, out, _ = solve((points, p_WB, length, constants))
        F, a, rho = points[0, 0], points[2, 0], points[3, 0, 0]
        theta, free = straight(F, a, rho, p_WB[0])
        at = leaves_at((points, p_WB, length, constants), out[5:8])
        plain = leaves_at((points, p_WB, length, constants), None)
        assert status == 0
        assert at.theta[0] == pytest.approx(theta, abs=1e-11)
        np.testing.assert_allclose(at.p_WA, plain.p_WA, atol=1e-11)
        T, EA = out[3], constants[1]
        assert (constants[6] + rho * theta + free) / (1.0 + T / EA) == pytest.approx(
            length[0], rel=1e-11
        )


def test_an_eyelet_is_a_pulley_without_radius() -> None:
    """Bit by bit, beside cables that have pulleys and alone."""
    rng = np.random.default_rng(1)
    points, p_WB, length, constants = random_cable(rng, "tilted", 1.001)
    points[3] = 0.0
    out, jacobian = np.zeros((1, 14)), np.zeros((1, 14, 8))
    v = rng.normal(size=(1, 3))
    args = (p_WB, v, length, np.array([0.1]))
    law = (constants[0], constants[1:4], constants[6:], 1e-3)
    catenary.cable_forces_jacobian(points[0], *args, *law, out, jacobian)
    constants[4] = 1e-3
    other = random_cable(rng, "up", 1.001)
    for many in (False, True):
        P, B, V, L, rates, C = points, *args, constants
        if many:
            P = np.concatenate([points, other[0]], axis=1)
            B, V = np.vstack([p_WB, other[1]]), np.vstack([v, v])
            L, rates = np.append(length, other[2] + 1.0), np.array([0.1, 0.0])
            C = np.append(constants, 0.0)
        found, change = np.zeros((len(L), 14)), np.zeros((len(L), 14, 8))
        assert pulley.robot_forces(P, B, V, L, rates, C, True, found, change) == 0
        assert np.array_equal(found[0], out[0]) and np.array_equal(change[0], jacobian[0])


@pytest.mark.parametrize("kind", ["up", "down", "tilted"])
def test_the_work_at_the_end_is_what_the_cable_takes_up(kind: str) -> None:
    """F_B . dB = dE - w z_A dl_f along a path at constant length, by quadrature."""
    rng = np.random.default_rng(5)
    points, p_WB, length, constants = random_cable(rng, kind, 1.002)
    w, EA = constants[:2]
    way = rng.normal(size=3)
    way *= 0.02 / np.linalg.norm(way)

    def state(x: float):
        B = p_WB + x * way
        _, out, _ = solve((points, B, length, constants), differs=False)
        at = leaves_at((points, B, length, constants), out[5:8])
        return out, at

    def energy(x: float) -> float:
        """Elastic energy of all of the cable, and the weight of the span, per Simpson's rule."""
        out, at = state(x)
        l, H = out[13], out[12]
        V_A = out[12] * out[7] / np.hypot(out[5], out[6])
        T_A = np.hypot(H, V_A)
        stretched = (length[0] - l) * T_A**2 / (2.0 * EA)
        s = np.linspace(0.0, l, 2001)
        V = V_A + w * s
        T = np.hypot(H, V)
        height = at.p_WA[0, 2] + (V_A * s + 0.5 * w * s**2) / EA + (T - T_A) / w
        weights = np.full(s.size, 2.0)
        weights[1::2], weights[[0, -1]] = 4.0, 1.0
        weights *= l / 2000.0 / 3.0
        return stretched + weights @ (T**2 / (2.0 * EA) + w * height)

    nodes, weights = np.polynomial.legendre.leggauss(12)
    work = entered = 0.0
    for node, weight in zip(0.5 * (nodes + 1.0), 0.5 * weights, strict=True):
        out, at = state(node)
        h = 1e-4
        l = [state(node + k * h)[0][13] for k in (-2, -1, 1, 2)]
        slope = (l[0] - 8.0 * l[1] + 8.0 * l[2] - l[3]) / (12.0 * h)
        work -= weight * out[:3] @ way  # the cable's force is on the platform
        entered += weight * w * at.p_WA[0, 2] * slope
    stored = energy(1.0) - energy(0.0)
    assert abs(work) > 1e-3
    assert work == pytest.approx(stored - entered, rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("kind", ["up", "down", "tilted"])
def test_every_cable_hangs_somewhere_or_is_refused(kind: str) -> None:
    """Taut to slack, far from the axis and near it; one without a place would go all round."""
    rng = np.random.default_rng([7, len(kind)])
    refused = 0
    for trial in range(400):
        a = {"up": UP, "down": DOWN}.get(kind, rng.normal(size=3))
        a = a / np.linalg.norm(a)
        rho, F = 10.0 ** rng.uniform(-2.0, -0.3), rng.uniform(-5.0, 5.0, 3)
        B = F + rng.normal(0.0, 5.0, 3)
        if trial % 4 == 3:
            B = F + a * rng.normal(0.0, 5.0) + rng.normal(0.0, 1.5 * rho, 3)
        reach = np.hypot(np.linalg.norm(np.cross(B - F, a)) - rho, (B - F) @ a)
        if not reach > rho + 0.05:
            continue
        theta, free = straight(F, a, rho, B)
        stretch = [
            1.0 + rng.choice([-1, 1]) * 10.0 ** rng.uniform(-9, -3),
            rng.uniform(1.0, 1.3),
            rng.uniform(1.3, 3.0),
            rng.uniform(0.999, 1.01),
        ]
        cable = a_cable(F, a, rho, B, (rho * theta + free) * stretch[trial % 4])
        status, out, _ = solve(cable, differs=False)
        if status:
            refused += 1
            assert kind == "up" and stretch[trial % 4] > 1.0 and theta < 0.5
            continue
        at = leaves_at(cable, out[5:8])
        np.testing.assert_allclose(at.tangent[0], out[5:8], atol=1e-6)
        assert 0.0 <= at.theta[0] < 2.0 * np.pi
    assert refused <= (20 if kind == "up" else 0)


# --- robots


def tilted(robot: CableRobot) -> CableRobot:
    """Return a robot with its pulleys' axes 15 degrees or so from the vertical."""
    aside = np.random.default_rng(2).normal(0.0, 0.25, (robot.num_cables, 3))
    return robot.replace(pulleys=robot.pulleys.replace(axis=robot.pulley_axes + aside))


@pytest.mark.parametrize("name", WITH_PULLEYS)
def test_a_robot_rests_where_forces_balance_and_is_found_from_its_lengths(name: str) -> None:
    for robot in (load_robot(name), tilted(load_robot(name))):
        start, goal = move_near_the_middle(robot)
        rest = rest_state(robot, goal)
        assert rest.residual < 1e-10
        found = forward_kinematics(robot, rest.unstrained_length, start)
        assert np.linalg.norm(found.X_WP.translation() - goal.translation()) < 1e-8
        np.testing.assert_allclose(found.chord_tension, rest.chord_tension, rtol=1e-5)


@pytest.mark.parametrize("name", WITH_PULLEYS)
def test_inverse_kinematics_asks_for_the_lengths_of_a_rest(name: str) -> None:
    """With the ECM, as well as for eyelets; a run's stretch it does not know: it is taken away."""
    robot = load_robot(name)
    robot = robot.replace(cable=robot.cable.replace(drum_run=0.0))
    _, goal = move_near_the_middle(robot)
    eyelets = robot.replace(pulleys=Pulleys())

    def off(robot: CableRobot, believed: CableRobot, cable_model: str = "ECM") -> float:
        lengths = InverseKinematics(believed, cable_model).lengths(goal)
        return float(np.abs(lengths - rest_state(robot, goal).unstrained_length).max())

    assert off(robot, robot) < 1.1 * off(eyelets, eyelets) + 1e-8 < 1e-4
    assert off(robot, robot, "SCMWE") < 0.02  # by the stretch
    assert off(robot, eyelets) > 0.02  # the arcs
    inverse, x, h = InverseKinematics(robot, "ECM"), pose_to_vector(goal), 1e-5
    jacobian = inverse.lengths_and_jacobian(x)[1]
    found = [(inverse.lengths(x + d) - inverse.lengths(x - d)) / (2 * h) for d in h * np.eye(6)]
    np.testing.assert_allclose(jacobian, np.array(found).T, atol=2e-7)


@pytest.mark.parametrize("name", WITH_PULLEYS)
def test_a_law_that_knows_the_pulleys_is_exact(name: str) -> None:
    """Six eigenvalues at 1, with the ECM and the run in its rows; not where it knows no pulleys."""
    robot = load_robot(name)
    _, goal = move_near_the_middle(robot)
    settings = ServoSettings(model_drum_run=True)
    for true, off in ((robot, 1e-5), (tilted(robot), 1e-3)):
        rates = gain_matrix(true, None, goal, "ECM", settings=settings).eigenvalues
        assert np.abs(rates - 1.0).max() < off
        believed = true.replace(pulleys=Pulleys())
        rates = gain_matrix(true, believed, goal, "ECM", settings=settings).eigenvalues
        assert np.abs(rates - 1.0).max() > 3e-3


@pytest.mark.parametrize("name", WITH_PULLEYS)
def test_the_whole_loop_linearises(name: str) -> None:
    """Six eigenvalues at -lambda; derivatives by AutoDiffXd are those of differences."""
    robot = load_robot(name)
    _, goal = move_near_the_middle(robot)
    loop = make_vision_based_control(
        robot, cable_model="ECM", gain=0.02, sample_time=None, latency=0.0, model_drum_run=True
    )
    context = rest_context(loop, goal)
    context.SetTime(2.0)  # the gain is no longer on its way
    model = linearize(loop, context)
    rates = np.sort_complex(-np.linalg.eigvals(model.A))
    internal = robot.num_cables - 6  # tensions that move nothing
    np.testing.assert_allclose(rates[:internal], 0.0, atol=1e-9)
    np.testing.assert_allclose(rates[internal:][:6], 0.02, rtol=0.01)


@pytest.mark.parametrize("name", WITH_PULLEYS)
def test_autodiff_is_that_of_differences(name: str) -> None:
    """Of the whole loop, off its rest and on the move."""
    for robot in (load_robot(name), tilted(load_robot(name))):
        _, goal = move_near_the_middle(robot)
        loop = make_vision_based_control(robot, cable_model="ECM", sample_time=None, latency=0.0)
        context = rest_context(loop, goal)
        context.SetTime(2.0)  # the gain is no longer on its way
        x = context.get_continuous_state_vector().CopyToVector()
        x = x + 1e-3 * np.random.default_rng(3).normal(size=x.size)

        def rates(x, loop=loop, context=context):
            context.SetContinuousState(x)
            return loop.EvalTimeDerivatives(context).CopyToVector()

        other = loop.ToAutoDiffXd()
        autodiff = other.CreateDefaultContext()
        autodiff.SetTimeStateAndParametersFrom(context)
        other.FixInputPortsFrom(loop, context, autodiff)
        autodiff.SetContinuousState(InitializeAutoDiff(x).ravel())
        found = other.EvalTimeDerivatives(autodiff).CopyToVector()
        np.testing.assert_allclose(ExtractValue(found).ravel(), rates(x), rtol=1e-9, atol=1e-9)
        h = 1e-5
        jacobian = np.array(
            [
                (8.0 * (rates(x + d) - rates(x - d)) - rates(x + 2 * d) + rates(x - 2 * d))
                / (12.0 * h)
                for d in h * np.eye(x.size)
            ]
        ).T
        scale = np.abs(jacobian).max(axis=1, keepdims=True) + 1e-9
        np.testing.assert_allclose(ExtractGradient(found) / scale, jacobian / scale, atol=1e-6)


@pytest.mark.parametrize("name", WITH_PULLEYS)
def test_the_rates_of_chords_are_those_of_moving_contacts(name: str) -> None:
    """D_u, gamma_row and D_B, with straight cables, against differences of the geometry."""
    for robot in (load_robot(name), tilted(load_robot(name))):
        _, goal = move_near_the_middle(robot)
        geometry = kinematics.cable_geometry(robot, goal)
        twist, h = np.array([0.2, -0.1, 0.3, 0.5, 0.4, -0.6]), 1e-6

        def moved(t: float, robot=robot, goal=goal, twist=twist):
            R = RotationMatrix(exp_rotation(t * twist[:3])) @ goal.rotation()
            X_WP = RigidTransform(R, goal.translation() + t * twist[3:])
            return kinematics.cable_geometry(robot, X_WP)

        ahead, behind = moved(h), moved(-h)
        for name_, D in (("u", kinematics.D_u), ("gamma", kinematics.gamma_row)):
            change = (getattr(ahead, name_) - getattr(behind, name_)) / (2.0 * h)
            np.testing.assert_allclose(D(geometry) @ twist, change, atol=1e-7)
        rate = kinematics.D_B(geometry) @ twist
        np.testing.assert_allclose(rate[:, 0], (ahead.Bx - behind.Bx) / (2.0 * h), atol=1e-7)
        np.testing.assert_allclose(rate[:, 2], (ahead.Bz - behind.Bz) / (2.0 * h), atol=1e-7)


# --- what is refused


def test_a_robot_file_that_makes_no_pulleys_is_refused() -> None:
    robot = load_robot("caroca")
    for field, value, match in (
        ("radius", -0.01, r"pulleys\.radius: must be >= 0 and finite"),
        ("radius", [0.1, 0.2], r"pulleys\.radius: must be one number, or one .* 8 cables, got 2"),
        ("axis", [0.0, 0.0, 0.0], r"pulleys\.axis: must be a direction"),
        ("axis", np.zeros((8, 3)), r"pulleys\.axis: must be a direction.* for cable 1"),
        ("axis", np.ones((3, 3)), r"pulleys\.axis: must be one direction, or one .*, got 3"),
        ("axis", None, r"pulleys\.axis: is missing"),
    ):
        with pytest.raises(RobotFileError, match=match):
            robot.replace(pulleys=robot.pulleys.replace(**{field: value}))
    with pytest.raises(
        RobotFileError, match=r"winch\.mounted_on: must be frame: winches that ride"
    ):
        robot.replace(winch=robot.winch.replace(mounted_on="platform"))


def test_cables_without_a_place_are_refused_by_name() -> None:
    robot = load_robot("caroca")
    goal = move_near_the_middle(robot)[1]
    inside = robot.replace(pulleys=robot.pulleys.replace(radius=[0.045] * 7 + [30.0]))
    for ask in (
        rest_state,
        kinematics.cable_geometry,
        lambda r, X: InverseKinematics(r).lengths(X),
    ):
        with pytest.raises(GeometryError, match="cable 8 is inside of its pulley, of radius 30000"):
            ask(inside, goal)
    large = robot.replace(pulleys=robot.pulleys.replace(radius=0.8))
    assert 0 < len(level_workspace(large)) < len(level_workspace(robot))  # some cells are inside
    above = robot.attachment_points.copy()
    above[2] = robot.drawing_points[2] - goal.translation() + [0.02, 0.0, 2.0]
    odd = robot.replace(attachment_points=above)
    length = np.full(8, 3.0)
    length[2] = 2.02
    with pytest.raises(EquilibriumError, match="cable 3: nowhere to leave its pulley"):
        forward_kinematics(odd, length, goal)


@pytest.mark.parametrize("fast", [False, True])
def test_a_cable_without_a_place_is_named_with_its_time(fast: bool) -> None:
    robot = load_robot("caroca")
    rest = rest_state(robot, move_near_the_middle(robot)[1])
    plant = make_plant(robot, command="desired_motor_angles", load_cells=False, fast=fast)
    context = plant.CreateDefaultContext()
    plant.GetInputPort("desired_motor_angles").FixValue(context, rest.desired_motor_angles)
    context.SetTime(2.5)
    x = np.zeros(36)
    x[3:6] = robot.drawing_points[0] - robot.attachment_points[0] + [0.07, 0.0, 0.0]
    x[12:20] = rest.motor_angles
    context.SetContinuousState(x)
    with pytest.raises(CableError, match=r"cable 1 at t = 2\.5 s: the attachment point of cable 1"):
        plant.GetOutputPort("tension_at_drawing_point").Eval(context)
