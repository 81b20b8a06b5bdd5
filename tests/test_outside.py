"""The package extended from outside: each extension is a file of a user's, in the folder outside.

Every one goes into the factories, and everything that can be asked of a loop is asked of the
result, on three robots of different kinds, under random names of the blocks.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from outside.laws import IntegralLqr, Lqr, PlainLqr, Predicting, RestingIntegralLqr
from outside.references import Circle, numbers, transforms
from outside.sensors import LaserTracker, NoPose, WithImu, rotation
from outside.spring import PlainSpring, Rubber, Spring, Weightless
from outside.wirings import fig_8
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, Diagram, System
from pydrake.systems.primitives import PassThrough
from test_commands import Elsewhere

import cdpr_drake as cdpr
from cdpr_drake.diagrams import (
    GaussianSensing,
    blocks,
    make_cable_robot,
    make_joint_space_control,
    make_vision_based_control,
    platform_pose,
    rest_context,
    simulate,
)
from cdpr_drake.errors import EquilibriumError
from cdpr_drake.show import block_diagram
from cdpr_drake.study import (
    equilibrium,
    linearize,
    modes,
    one_period_map,
    residuals,
    simulated_period_map,
)
from cdpr_drake.systems import WinchDynamics

OUTSIDE = Path(__file__).with_name("outside")


@dataclass(frozen=True)
class Place:
    """A robot somewhere.

    Attributes:
        robot: the robot.
        pose: where it is.
        tensions: how they are distributed there.
        size: what counts as a way for it [m].
    """

    robot: cdpr.CableRobot
    pose: np.ndarray
    tensions: str
    size: float

    def start(self) -> np.ndarray:
        """Return a pose at some distance."""
        way = np.array([0.1, -0.1, 0.1]) * self.size
        return self.pose + np.concatenate([[0.02, -0.02, 0.03], way])


def place(name: str) -> Place:
    """Return a robot of a kind: large and suspended, held from below too, small and light."""
    if name == "cogiro":
        pose = np.array([0.05, -0.1, 0.2, -1.0, 0.4, 1.3])
        return Place(cdpr.load_robot("cogiro"), pose, "minimum norm", 1.0)
    robot = cdpr.load_robot(OUTSIDE / f"{name}.yaml")
    if name == "box":
        pose = np.array([0.02, -0.01, 0.03, 0.1, -0.05, 1.2])
        return Place(robot, pose, "within limits", 0.3)
    return Place(robot, np.array([0.05, -0.1, 0.2, -0.1, 0.04, 0.13]), "minimum norm", 0.1)


NAMES = ("cogiro", "box", "desk")
PLACES = {name: place(name) for name in NAMES}
every_robot = pytest.mark.parametrize("name", NAMES)


def renamed(diagram: Diagram, seed: int = 0) -> Diagram:
    """Return a diagram with random names for all of its systems."""
    draw = np.random.default_rng(seed)
    for system in diagram.GetSystems():
        system.set_name("".join(draw.choice(list("abcdefghijklmnopqrstuvwxyz"), 9)))
        if isinstance(system, Diagram):
            renamed(system, int(draw.integers(1 << 30)))
    return diagram


def of(diagram: Diagram, kind: type) -> System:
    """Return the system of a class in a diagram, whatever it is called."""
    (found,) = (block.system for block in blocks(diagram) if isinstance(block.system, kind))
    return found


def standing(place: Place, context: Context, diagram: Diagram, until: float = 0.3) -> None:
    """Fail unless a diagram stays where it is."""
    before = platform_pose(diagram, context)
    simulate(diagram, context, context.get_time() + until, max_step=0.005)
    assert platform_pose(diagram, context).IsNearlyEqualTo(before, 1e-8 * place.size)


def law_of(kind: Callable[..., Any], place: Place, **options: Any) -> Callable[..., Any]:
    """Return what makes a law of a kind for a place."""
    return lambda robot: kind(robot, place.pose, tensions=place.tensions, **options)


def bearing(place: Place, kind: type = Spring) -> Any:
    """Return a spring to the ground with some of the platform's weight to bear."""
    weight = place.robot.mass * place.robot.gravity
    stiffness = 0.5 * weight / (0.1 * place.size) * np.array([0.6, 0.8, 1.0])
    return kind(stiffness, place.pose[3:] + 0.02 * place.size * np.array([1.0, -2.0, 3.0]))


def rubber(place: Place) -> Rubber:
    """Return a rubber rope that pulls the platform down and aside."""
    weight, size = place.robot.mass * place.robot.gravity, place.size
    anchor = place.pose[3:] + size * np.array([0.4, 0.3, -1.0])
    length = float(np.linalg.norm(anchor - place.pose[3:]))
    return Rubber(anchor, 0.8 * length, weight / length, 0.05 * weight / size)


Options = Callable[[Place], dict[str, Any]]

CONTINUOUS: dict[str, Options] = {
    "LQR": lambda p: {"law": law_of(Lqr, p)},
    "LQR for floats": lambda p: {"law": law_of(PlainLqr, p)},
    "IMU": lambda p: {"sensing": WithImu(bias=(0.1, -0.2, 0.3))},
    "tracker": lambda p: {"sensing": LaserTracker()},
    "way of numbers": lambda p: {"reference": numbers(p.start(), p.pose, 0.9)},
    "way of transforms": lambda p: {"reference": transforms(p.start(), p.pose, 0.9)},
    "spring": lambda p: {"parts": (bearing(p),)},
    "springs": lambda p: {"parts": (lambda robot: bearing(p, PlainSpring), rubber(p))},
    "all": lambda p: {
        "law": law_of(Lqr, p),
        "sensing": WithImu(others=GaussianSensing()),
        "reference": Standing(p.pose),
        "parts": (bearing(p), rubber(p)),
    },
}
"""Loops that may be all continuous."""

SAMPLED: dict[str, Options] = CONTINUOUS | {
    "integral LQR": lambda p: {"law": law_of(IntegralLqr, p)},
    "integral LQR, set": lambda p: {"law": law_of(RestingIntegralLqr, p)},
    "predicting LQR": lambda p: {"law": law_of(Predicting, p)},
}

BY_DIFFERENCES = {
    "LQR for floats": {PlainLqr},
    "tracker": {"Tracker", "ModelledTension", "ModelledTangents"},
    "springs": {PlainSpring},
    "predicting LQR": {Predicting},
}
"""Which blocks know no AutoDiffXd."""


class Standing(Circle):
    """A reference that stands."""

    def __init__(self, pose: np.ndarray) -> None:
        super().__init__(pose, 0.0, 1.0)


def classes(diagram: Diagram, names: tuple[str, ...]) -> set[str]:
    """Return the classes of the blocks of some names."""
    found = {"/".join(block.path): type(block.system).__name__ for block in blocks(diagram)}
    return {found[name] for name in names}


def expected_classes(label: str) -> set[str]:
    """Return the classes of the blocks without AutoDiffXd."""
    kinds = BY_DIFFERENCES.get(label, {"Standing"} if label == "all" else ())
    return {kind if isinstance(kind, str) else kind.__name__ for kind in kinds}


# --- everything asked of everything


@every_robot
@pytest.mark.parametrize("label", SAMPLED)
def test_all_is_asked_of_a_sampled_loop(name: str, label: str, tmp_path: Path) -> None:
    place = PLACES[name]
    loop = renamed(make_vision_based_control(place.robot, **SAMPLED[label](place)))
    context = equilibrium(loop, place.pose, place.tensions)
    assert residuals(loop, context).largest <= 1e-9
    assert residuals(loop, context).names  # of the new names
    found = one_period_map(loop, context, require_equilibrium=True)
    assert classes(loop, found.by_differences) == expected_classes(label)
    assert not modes(found).unstable
    assert len(modes(found).neutral) == place.robot.num_cables - 6
    if name == "desk":
        picture = block_diagram(loop, tmp_path / "loop.dot").read_text()
        assert all(system.get_name() in picture for system in loop.GetSystems())
        if not found.by_differences:
            simulated = simulated_period_map(loop, context, step=1e-3)
            np.testing.assert_allclose(found.matrix, simulated, atol=2e-3 * np.abs(simulated).max())
    standing(place, context, loop)


@every_robot
@pytest.mark.parametrize("label", CONTINUOUS)
def test_all_is_asked_of_a_continuous_loop(name: str, label: str) -> None:
    place = PLACES[name]
    options = CONTINUOUS[label](place)
    loop = renamed(make_vision_based_control(place.robot, sample_time=None, **options))
    context = equilibrium(loop, place.pose, place.tensions)
    assert residuals(loop, context).largest <= 1e-9
    model = linearize(loop, context, require_equilibrium=True)
    assert classes(loop, model.by_differences) == expected_classes(label)
    assert not modes(model).unstable
    assert len(modes(model).neutral) == place.robot.num_cables - 6
    standing(place, context, loop)


@every_robot
@pytest.mark.parametrize("label", ["spring", "springs", "way of numbers", "way of transforms"])
def test_all_is_asked_of_joint_space_control(name: str, label: str) -> None:
    place = PLACES[name]
    loop = renamed(make_joint_space_control(place.robot, **CONTINUOUS[label](place)))
    if "way" in label:  # it stands at its start only for an instant
        with pytest.raises(EquilibriumError, match=r"\(TrajectoryReference\) moves"):
            equilibrium(loop, place.start())
        return
    context = equilibrium(loop, place.pose)
    assert residuals(loop, context).largest <= 1e-9
    model = linearize(loop, context, require_equilibrium=True)
    assert not modes(model).unstable and not modes(model).neutral
    standing(place, context, loop)


# --- laws


@every_robot
def test_the_lqr_loop_decays_as_it_was_designed_and_arrives(name: str) -> None:
    place = PLACES[name]
    loop = make_vision_based_control(place.robot, law=law_of(Lqr, place), sample_time=None)
    context = equilibrium(loop, place.pose, place.tensions)
    rates = np.array(
        [m.eigenvalue.real for m in modes(linearize(loop, context)) if m.damping == 1.0]
    )
    # The winches' integral action, at -0.2/s, adds to the law's 0.4/s.
    designed = rates[(rates < -0.3) & (rates > -1.0)]
    assert designed.size == 6
    np.testing.assert_allclose(designed, -0.4, rtol=0.06)
    for law in (Lqr, IntegralLqr, RestingIntegralLqr, Predicting):
        loop = renamed(make_vision_based_control(place.robot, law=law_of(law, place)))
        context = rest_context(loop, place.start(), place.tensions)
        loop.GetInputPort("desired_pose").FixValue(context, place.pose)
        until = 60.0 if "Integral" in law.__name__ else 20.0
        record = simulate(loop, context, until, every=0.5)
        error = np.abs(record["pose"] - place.pose).max(axis=1)
        assert error[-1] < 2e-3 * error[0], law


@every_robot
def test_without_autodiff_the_matrices_are_the_same(name: str) -> None:
    place = PLACES[name]
    found = []
    for law, spring in ((PlainLqr, PlainSpring), (Lqr, Spring)):
        models = []
        for sample_time in (None, 0.05):
            loop = make_vision_based_control(
                place.robot,
                law=law_of(law, place),
                parts=(bearing(place, spring),),
                sample_time=sample_time,
            )
            context = equilibrium(loop, place.pose, place.tensions)
            if sample_time is None:
                inputs = ["desired_pose", "external_wrench"]
                model = linearize(loop, context, inputs)
                models += [model.A, model.B, model.C, model.D]
            else:
                model = one_period_map(loop, context)
                models.append(model.matrix)
            named = ("servo", "part_1") if law is PlainLqr else ()
            assert set(model.by_differences) == set(named)
        found.append(models)
    for by_differences, exact in zip(*found, strict=True):
        scale = np.maximum(1.0, np.abs(exact).max(axis=1, keepdims=True))
        np.testing.assert_allclose(by_differences / scale, exact / scale, rtol=0.0, atol=1e-6)


# --- sensors


@every_robot
def test_the_imu_feels_gravity_at_rest_and_the_second_difference_in_motion(name: str) -> None:
    place = PLACES[name]
    bias, g = np.array([0.1, -0.2, 0.3]), np.array([0.0, 0.0, place.robot.gravity])
    loop = make_vision_based_control(
        place.robot, gain=0.4, ramp_time=0.1, sample_time=None, sensing=WithImu(bias=tuple(bias))
    )
    assert loop.HasInputPort("acceleration_noise")
    context = rest_context(loop, place.start(), place.tensions)
    felt = loop.GetOutputPort("measured_acceleration")
    R = platform_pose(loop, context).rotation().matrix()
    np.testing.assert_allclose(felt.Eval(context), R.T @ g + bias, atol=1e-7)
    loop.GetInputPort("desired_pose").FixValue(context, place.pose)
    h = 2e-3
    names = ["pose", "measured_acceleration"]
    record = simulate(loop, context, 0.4, record=names, every=h, max_step=h / 2)
    p, seen = record["pose"][:, 3:], record["measured_acceleration"]
    near, far = p[3:-1] + p[1:-3] - 2.0 * p[2:-2], p[4:] + p[:-4] - 2.0 * p[2:-2]
    second = (16.0 * near - far) / (12.0 * h**2)
    moved = [
        rotation(pose[:3]) @ (f - bias) - g for pose, f in zip(record["pose"], seen, strict=True)
    ]
    true = np.array(moved)[2:-2]
    assert np.abs(true).max() > 0.02 * place.size
    # Not where the ramp of the gain ends, in whose corner the third derivative jumps.
    late = record.time[2:-2] > 0.11
    np.testing.assert_allclose(second[late], true[late], atol=2e-3 * np.abs(true).max())


def test_noise_of_a_sensor_of_one_s_own_is_a_source_of_its_name() -> None:
    place = PLACES["desk"]
    sensing = WithImu(sigma=0.5)
    loop = make_vision_based_control(place.robot, sensing=sensing, noise=True)
    ends = []
    for seed in (1, 1, 2):
        context = rest_context(loop, place.pose, seed=seed)
        loop.GetInputPort("desired_pose").FixValue(context, place.pose)
        record = simulate(loop, context, 2.0, record=["measured_acceleration"])
        ends.append(record["measured_acceleration"])
    assert np.array_equal(ends[0], ends[1]) and not np.array_equal(ends[0], ends[2])
    assert np.std(ends[0][5:], axis=0) == pytest.approx(0.5, rel=0.5)


# --- references


@every_robot
def test_a_circle_is_followed_within_its_lag(name: str) -> None:
    place = PLACES[name]
    radius, period, gain = 0.1 * place.size, 15.0, 0.4
    circle = Circle(place.pose, radius, period)
    omega = 2.0 * np.pi / period
    for tells_twist in (True, False):
        loop = renamed(
            make_vision_based_control(
                place.robot,
                gain=gain,
                ramp_time=0.0,
                reference=Circle(place.pose, radius, period, tells_twist),
            )
        )
        context = rest_context(loop, place.pose, place.tensions)
        record = simulate(loop, context, 2.0 * period, every=0.25)
        late = record.time > period
        wanted = np.array([circle.at(t) for t in record.time])
        away = np.linalg.norm((record["pose"] - wanted)[late, 3:], axis=1)
        # A first-order loop follows by 1 / (1 + i omega / gain): this is how far it is behind,
        # and with the twist fed forward by half a frame and the latency alone.
        lag = radius * omega / np.hypot(gain, omega)
        if tells_twist:
            lag = radius * omega * (0.04 + 0.5 * 0.05)
            assert away.max() < 3.0 * lag
        else:
            assert away == pytest.approx(lag, rel=0.15)


@pytest.mark.parametrize("tells_twist", [True, False])
@every_robot
def test_a_moving_reference_has_no_equilibrium_but_a_rest_and_a_linear_model(
    name: str, tells_twist: bool
) -> None:
    place = PLACES[name]
    # Where it passes the pose just at the time that counts for an equilibrium.
    reference = Circle(place.pose, 0.1 * place.size, 1.0, tells_twist)
    for make in (make_vision_based_control, make_joint_space_control)[: 1 + (name != "box")]:
        loop = renamed(make(place.robot, reference=reference))
        rest_context(loop, place.pose, place.tensions)
        with pytest.raises(EquilibriumError, match=r"\(Circle\) moves, and a loop rests only"):
            equilibrium(loop, place.pose, place.tensions)
        reference = Circle(place.pose, 0.1 * place.size, 1.0, tells_twist)
    loop = make_vision_based_control(place.robot, reference=reference, sample_time=None)
    context = rest_context(loop, place.pose, place.tensions)
    context.SetTime(2.0)
    model = linearize(loop, context, require_equilibrium=False)
    standing_still = make_vision_based_control(place.robot, sample_time=None)
    other = equilibrium(standing_still, place.pose, place.tensions)
    expected = linearize(standing_still, other)
    assert model.by_differences == ("reference",)
    if not tells_twist:  # which turns with the platform, in the law's frame
        scale = np.maximum(1.0, np.abs(expected.A).max(axis=1, keepdims=True))
        np.testing.assert_allclose(model.A / scale, expected.A / scale, atol=1e-6)


@every_robot
@pytest.mark.parametrize("way", [numbers, transforms])
def test_a_drake_trajectory_is_followed_to_its_end(name: str, way: Callable[..., Any]) -> None:
    place = PLACES[name]
    reference = way(place.start(), place.pose, 4.0)
    loop = renamed(make_vision_based_control(place.robot, gain=0.4, reference=reference))
    context = rest_context(loop, place.start(), place.tensions)
    record = simulate(loop, context, 8.0)
    away = np.abs(record["pose"] - record["desired_pose"]).max(axis=1)
    assert away.max() < 0.1 * np.abs(place.start() - place.pose).max()
    assert away[-1] < 0.02 * np.abs(place.start() - place.pose).max()


# --- parts of the plant


def out_of_balance(loop: Diagram, context: Context, place: Place, wrench: np.ndarray) -> np.ndarray:
    """Return what is left of the cables' pull, the weight and a wrench, by statics alone."""
    robot, k = place.robot, place.robot.num_cables
    tension = loop.GetOutputPort("tension_at_attachment_point").Eval(context)
    tangents = loop.GetOutputPort("tangents_at_attachment_point").Eval(context).reshape(k, 3)
    X_WP = platform_pose(loop, context)
    R = X_WP.rotation().matrix()
    weight = np.array([0.0, 0.0, -robot.mass * robot.gravity])
    total = wrench.copy()
    for T, t, b in zip(tension, tangents, robot.attachment_points, strict=True):
        total += np.concatenate([np.cross(R @ b, -T * t), -T * t])
    total += np.concatenate([np.cross(R @ robot.center_of_mass, weight), weight])
    return total / np.abs(weight).max()


@every_robot
def test_springs_shift_rest_and_tensions_as_statics_say(name: str) -> None:
    place = PLACES[name]
    for make in (make_vision_based_control, make_joint_space_control)[: 1 + (name != "box")]:
        parts = [bearing(place), rubber(place)]
        loop = renamed(make(place.robot, parts=tuple(parts)))
        context = equilibrium(loop, place.pose, place.tensions)
        wrench = np.zeros(6)
        for part in parts:
            wrench += part.GetOutputPort("wrench").Eval(part.GetMyContextFromRoot(context))
        weight = place.robot.mass * place.robot.gravity
        assert np.abs(wrench[3:]).max() > 0.05 * weight
        assert np.abs(out_of_balance(loop, context, place, wrench)).max() < 1e-8
        assert np.abs(out_of_balance(loop, context, place, np.zeros(6))).max() > 0.05
        bare = make(place.robot)
        other = equilibrium(bare, place.pose, place.tensions)
        tension = [
            d.GetOutputPort("tension_at_drawing_point").Eval(c)
            for d, c in ((loop, context), (bare, other))
        ]
        shift = (
            platform_pose(bare, other).translation() - platform_pose(loop, context).translation()
        )
        if make is make_vision_based_control:  # the pose is held, the cables bear the difference
            assert np.abs(tension[0] - tension[1]).max() > 0.01 * np.abs(tension[1]).max()
            assert np.abs(shift).max() < 1e-12
        else:  # the cables give way
            assert np.linalg.norm(shift) > 1e-5 * place.size


def test_a_spring_much_stiffer_than_the_cables_comes_to_rest() -> None:
    place = PLACES["desk"]
    away = np.array([0.001, -0.002, -0.003])
    stiff = Spring([1e3, 2e3, 3e3], place.pose[3:] + away)  # the cables have some 500 N/m
    loop = make_joint_space_control(place.robot, parts=(stiff,))
    context = equilibrium(loop, place.pose)
    wrench = stiff.GetOutputPort("wrench").Eval(stiff.GetMyContextFromRoot(context))
    assert np.abs(out_of_balance(loop, context, place, wrench)).max() < 1e-8
    held = platform_pose(loop, context).translation() - place.pose[3:]
    np.testing.assert_allclose(held, away, atol=2e-3)


@every_robot
def test_a_spring_s_stiffness_is_in_the_linear_model_and_its_modes(name: str) -> None:
    """Relaxed where the platform rests, so that rest and tensions stay the same."""
    place = PLACES[name]
    k = 0.3 * place.robot.mass * (2.0 * np.pi * 10.0) ** 2 * np.array([0.5, 0.7, 1.0])
    found = []
    for parts in ((), (Spring(k, place.pose[3:]),)):
        loop = make_vision_based_control(place.robot, sample_time=None, parts=parts)
        context = equilibrium(loop, place.pose, place.tensions)
        found.append((linearize(loop, context), loop, context))
    (without, *_), (model, loop, context) = found
    plant = of(loop, MultibodyPlant)
    M = plant.CalcMassMatrix(plant.GetMyContextFromRoot(context))
    K = np.zeros((6, 6))
    K[3:, 3:] = np.diag(k)
    change = np.zeros_like(model.A)
    change[6:12, :6] = -np.linalg.solve(M, K)
    at = [model.states.index(s) for s in without.states if s.startswith("robot/platform/")]
    assert at == list(range(12))
    np.testing.assert_allclose(model.A - without.A, change, atol=1e-7 * np.abs(change).max())
    lowest = [min(m.frequency for m in modes(w) if m.frequency > 0.5) for w in (without, model)]
    assert lowest[1] > 1.05 * lowest[0]


# --- a command


def test_a_command_of_another_package(tmp_path: Path) -> None:
    elsewhere = Elsewhere(tmp_path)
    text = (OUTSIDE / "hold.py").read_text()
    elsewhere.add("holding", "hold = holding:COMMAND", holding=text)
    done = elsewhere.call("hold", "--robot", str(OUTSIDE / "desk.yaml"), "--height", "0.1")
    assert (done.returncode, done.stderr) == (0, "")
    diagram = make_cable_robot(PLACES["desk"].robot)
    context = equilibrium(diagram, cdpr.pose(z=0.1))
    tension = diagram.GetOutputPort("tension_at_drawing_point").Eval(context)
    np.testing.assert_allclose(np.array(done.stdout.split(), float), tension, atol=1e-3)
    refused = elsewhere.call("hold", "--height", "-1")
    assert (refused.returncode, refused.stderr) == (
        2,
        "cdpr-drake: error: --height: above the ground\n",
    )


# --- wired by hand


def moving(diagram: Diagram, context: Context) -> float:
    """Return the largest rate of change, against the weight, the holding torques, or the state."""
    diagram.EvalTimeDerivatives(context)
    largest = 0.0
    for path_and_system in blocks(diagram):
        system = path_and_system.system
        own = system.GetMyContextFromRoot(context)
        if not system.num_continuous_states():
            continue
        rate = system.EvalTimeDerivatives(own).CopyToVector()
        x = own.get_continuous_state_vector().CopyToVector()
        scale = np.maximum(1.0, np.abs(x))
        if isinstance(system, MultibodyPlant):
            force = system.CalcMassMatrix(own) @ rate[6:]
            pull = 0.0
            for block in blocks(diagram):
                if block.answer("cable_robot") is not None:
                    tension = block.system.GetOutputPort("tension_at_attachment_point")
                    pull = np.max(tension.Eval(block.system.GetMyContextFromRoot(context)))
            weight = np.linalg.norm(system.CalcGravityGeneralizedForces(own)[3:])
            rate, scale = np.append(rate[:6], force), max(weight, pull) * np.ones(12)
        elif isinstance(system, WinchDynamics):
            k, winch = system.robot.num_cables, system.robot.winch
            torque = winch.transmission * system.GetInputPort("tension_at_drawing_point").Eval(own)
            rate[k : 2 * k] *= winch.inertia
            scale[k : 2 * k] = torque
        else:
            scale = 20.0 * scale  # [1/s], filters
        largest = max(largest, float(np.max(np.abs(rate) / scale)))
    return largest


def test_two_hundred_wirings_rest_or_say_what_does_not() -> None:
    outcomes: Counter[str] = Counter()
    nested = 0
    for seed in range(200):
        place = PLACES[NAMES[seed % 3]]
        net = fig_8(place.robot, place.pose, place.tensions, np.random.default_rng(seed))
        diagram = net.diagram()
        nested += any(isinstance(system, Diagram) for system in diagram.GetSystems())
        if net.at_fault:
            with pytest.raises(EquilibriumError) as caught:
                rest_context(diagram, place.pose, place.tensions)
            path = [s.GetSystemPathname().split("::")[2:] for s in net.at_fault]
            assert any(f'block "{"/".join(p)}"' in str(caught.value) for p in path), seed
            outcomes["refused"] += 1
            continue
        context = rest_context(diagram, place.pose, place.tensions)
        assert residuals(diagram, context).largest <= 1e-9, seed
        assert moving(diagram, context) <= 1e-9, seed
        outcomes["at rest"] += 1
    assert nested > 100
    assert outcomes["at rest"] >= 120 and outcomes["refused"] >= 30, outcomes


# --- what does not fit

ROBOT = PLACES["desk"].robot
POSE = PLACES["desk"].pose


class ThreeNumbers:
    """Sensing that returns what it should not."""

    def add_to(self, builder: Any, plant: Any) -> Any:
        """Return a dictionary."""
        return {"pose": plant["pose"]}


FAULTS: dict[str, tuple[Callable[[], Any], type[Exception], str]] = {
    "name": (
        lambda: make_vision_based_control("cogiro"),
        TypeError,
        r'made for a CableRobot, got \'cogiro\'; load_robot\("cogiro"\) makes one',
    ),
    "name, joint space": (lambda: make_joint_space_control("cogiro"), TypeError, "a CableRobot"),
    "believed": (
        lambda: make_vision_based_control(ROBOT, believed="cogiro"),
        TypeError,
        r"believed to be a CableRobot, got 'cogiro'; load_robot",
    ),
    "believed, joint space": (
        lambda: make_joint_space_control(ROBOT, believed="cogiro"),
        TypeError,
        r"believed to be a CableRobot",
    ),
    "law": (
        lambda: make_vision_based_control(ROBOT, law=PassThrough(8)),
        ValueError,
        r'^the control law, PassThrough, has no output "motor_rates"$',
    ),
    "no law": (
        lambda: make_vision_based_control(ROBOT, law=lambda robot: None),
        TypeError,
        "a control law is a Drake system, or makes one for a robot; got None from",
    ),
    "law's name": (
        lambda: make_vision_based_control(ROBOT, law="ECM"),
        TypeError,
        "a control law is a Drake system, or makes one for a robot; got 'ECM'",
    ),
    "part": (
        lambda: make_vision_based_control(ROBOT, parts=(Weightless(),)),
        ValueError,
        r'^Weightless has no output "wrench" on the platform$',
    ),
    "a part alone": (
        lambda: make_joint_space_control(ROBOT, parts=Spring([1.0] * 3, [0.0] * 3)),
        TypeError,
        r"parts of the plant are a tuple, \(part,\) for one",
    ),
    "reference": (
        lambda: make_joint_space_control(ROBOT, reference=PassThrough(6)),
        ValueError,
        r'^the reference, PassThrough, has no output "desired_pose"$',
    ),
    "pose for a reference": (
        lambda: make_vision_based_control(ROBOT, reference=POSE),
        TypeError,
        "a reference is a Drake system, or makes one",
    ),
    "sensing": (
        lambda: make_vision_based_control(ROBOT, sensing=NoPose()),
        ValueError,
        r'sensing has to give a "pose", and gives tension$',
    ),
    "sensing's name": (
        lambda: make_vision_based_control(ROBOT, sensing="targets"),
        TypeError,
        "sensing is a value with a method add_to, got 'targets'",
    ),
    "sensing's class": (
        lambda: make_vision_based_control(ROBOT, sensing=GaussianSensing),
        TypeError,
        "sensing is a value with a method add_to, got <class",
    ),
    "measurements": (
        lambda: make_vision_based_control(ROBOT, sensing=ThreeNumbers()),
        TypeError,
        r"ThreeNumbers.* has to return Measurements, got \{",
    ),
    "option": (
        lambda: make_vision_based_control(ROBOT, speed=3.0),
        TypeError,
        "speed: neither a field of a vision-based loop nor of its timing or law",
    ),
    "option, joint space": (
        lambda: make_joint_space_control(ROBOT, gain=3.0),
        TypeError,
        "unexpected keyword argument 'gain'",
    ),
}


@pytest.mark.parametrize("label", FAULTS)
def test_what_does_not_fit_is_told_in_one_line(label: str) -> None:
    make, error, message = FAULTS[label]
    with pytest.raises(error, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_a_system_fits_in_one_place() -> None:
    """Drake itself ends the process when a system is added twice."""
    law = Lqr(ROBOT, POSE)
    loop = make_vision_based_control(ROBOT, law=law)
    with pytest.raises(
        ValueError, match=r'control law is in a diagram already, as "vision.*servo"'
    ):
        make_vision_based_control(ROBOT, law=law)
    equilibrium(loop, POSE)  # the first is as good as before
    spring = bearing(PLACES["desk"])
    with pytest.raises(
        ValueError, match=r'part .* in the loop already, as "part_1"; a system fits'
    ):
        make_joint_space_control(ROBOT, parts=(spring, spring))
    circle = Circle(POSE, 0.01, 9.0)
    make_joint_space_control(ROBOT, reference=circle)
    with pytest.raises(ValueError, match="the reference is in a diagram already"):
        make_vision_based_control(ROBOT, reference=circle)
