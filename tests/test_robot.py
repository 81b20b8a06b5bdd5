"""The robot as data: built-in robots, files and their errors, mass properties, scaling."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable
from functools import cache, reduce
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.tree import RotationalInertia, SpatialInertia, UnitInertia

from cdpr_drake.errors import CdprError, RobotFileError
from cdpr_drake.model.robot import (
    AxialStiffness,
    CableRobot,
    RigidBody,
    RobotFileWarning,
    load_robot,
    robot_names,
    save_robot,
)

load_robot_once = cache(load_robot)  # for hypothesis, which warns of fixtures
COGIROS = ("cogiro", "cogiro-2015-pulleys", "cogiro-22m", "cogiro-37m", "cogiro-98m")
NAMES = ("acrobot", "caroca", *COGIROS, "cuhk-cablerobot", "ipanema-2", "segesta-10")


@pytest.fixture(scope="module")
def cogiro() -> CableRobot:
    return load_robot("cogiro")


@pytest.fixture(scope="module")
def parsed_cogiro(cogiro: CableRobot) -> dict[str, Any]:
    return yaml.safe_load(cogiro.to_yaml())


@pytest.fixture
def data(parsed_cogiro: dict[str, Any]) -> dict[str, Any]:
    """CoGiRo as the parsed YAML of a robot file, to be changed at will."""
    return copy.deepcopy(parsed_cogiro)


# --- built-in robots


def test_the_built_in_robots_have_a_line_each() -> None:
    names = robot_names()
    assert tuple(names) == NAMES
    assert all(text and "\n" not in text for text in names.values())


def leaves(data: dict[str, Any], path: str = "") -> list[str]:
    """The paths of all values of a robot file, down to what is not a mapping."""
    if not isinstance(data, dict):
        return [path]
    return [
        leaf for key, value in data.items() for leaf in leaves(value, f"{path}.{key}".strip("."))
    ]


@pytest.mark.parametrize("name", NAMES)
def test_every_value_of_a_built_in_robot_has_a_source_or_is_an_assumption(name: str) -> None:
    robot = load_robot(name)
    assert (robot.name, robot.num_cables) == (name, 10 if name == "segesta-10" else 8)
    data = yaml.safe_load(robot.to_yaml())
    for key in ("name", "description", "sources", "assumptions"):
        del data[key]
    said = set(robot.sources)
    for text in robot.assumptions:
        said |= set(text.partition(": ")[0].split(", "))
    silent = [p for p in leaves(data) if not any(p == s or p.startswith(f"{s}.") for s in said)]
    assert not silent


def test_the_numbers_of_cogiro(cogiro: CableRobot) -> None:
    assert cogiro.mass == 100.0 and cogiro.with_payload(110.0).mass == 210.0
    assert cogiro.weight_per_metre == pytest.approx(0.62784)  # 0.064 kg/m x 9.81 m/s2
    assert cogiro.cable.stiffness(500.0) == pytest.approx(60e9 * 8.2051e-6)
    assert cogiro.winch.transmission == pytest.approx(0.0675 / 3)
    assert cogiro.cameras.orientation_noise == pytest.approx(math.radians(0.05), abs=1e-10)
    np.testing.assert_array_equal(cogiro.cable.drum_run, np.full(8, 5.4))
    # 15 Hz and a damping ratio of 0.48 are what the paper's gains give with this inertia
    winch = cogiro.winch
    frequency = math.sqrt(winch.proportional_gain / winch.inertia)
    assert frequency / (2 * math.pi) == pytest.approx(15.0, abs=0.05)
    ratio = winch.derivative_gain / (2 * winch.inertia * frequency)
    assert ratio == pytest.approx(0.48, abs=0.005)


def test_the_inertia_of_cogiro_is_the_datasheet_s_at_100_kg(cogiro: CableRobot) -> None:
    xy, xz, yz = -0.453, 3.012, -1.539  # printed, as +int x y dm
    measured = np.array([[36.598, -xy, -xz], [-xy, 35.982, -yz], [-xz, -yz, 25.439]])
    np.testing.assert_allclose(cogiro.platform.inertia, measured * 100 / 91.058, atol=6e-4)
    later = load_robot("cogiro-2015-pulleys")
    np.testing.assert_array_equal(later.platform.inertia, measured)
    assert later.mass == 91.058


def rotation(vector: tuple[float, float, float]) -> np.ndarray:
    """Rodrigues' formula."""
    x, y, z = vector
    angle = math.hypot(x, y, z)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) / angle
    return np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K


def platform_position(robot: CableRobot, p_FM: tuple, vector: tuple) -> np.ndarray:
    X_FM = RigidTransform(RotationMatrix(rotation(vector)), p_FM)
    return robot.cameras.X_WF.multiply(X_FM).multiply(robot.cameras.X_PM.inverse()).translation()


def test_the_camera_frame_puts_the_paper_s_poses_where_they_were(cogiro: CableRobot) -> None:
    start = (-0.09, -2.08, 9.22), (2.14, -1.03, 0.48)
    np.testing.assert_allclose(platform_position(cogiro, *start), [-0.75, -0.22, 0.71], atol=6e-3)
    R_WP = cogiro.cameras.X_WF.rotation().matrix() @ rotation(start[1])
    np.testing.assert_allclose(R_WP, np.eye(3), atol=1e-14)
    ground = (0.07, -1.04, 8.9), (2.17, -1.06, 0.48)
    np.testing.assert_allclose(platform_position(cogiro, *ground), [-1.38, -0.93, 0.17], atol=6e-3)
    optical_axis = cogiro.cameras.X_WF.rotation().matrix()[:, 2]
    np.testing.assert_allclose(optical_axis, [0.59, 0.43, -0.68], atol=6e-3)


# --- the large robots


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("cogiro-22m", (16.2, 22.2, 8.3)),
        ("cogiro-37m", (27.0, 37.0, 13.9)),
        ("cogiro-98m", (75.0, 98.0, 38.9)),
    ],
)
def test_the_large_robots_are_cogiro_turned_and_scaled(
    name: str, size: tuple[float, float, float], cogiro: CableRobot
) -> None:
    robot = load_robot(name)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # +90 degrees about z
    turned = cogiro.drawing_points @ turn.T
    scale = size / np.array([*np.ptp(turned[:, :2], axis=0), turned[:, 2].max()])
    # the files give lengths to 0.1 mm, and keep the digits of what is only turned
    half = 0.5e-4 * (1 + 1e-6)
    np.testing.assert_allclose(robot.drawing_points, turned * scale, rtol=0, atol=half)
    np.testing.assert_array_equal(robot.attachment_points, cogiro.attachment_points @ turn.T)
    body = cogiro.platform
    assert robot.mass == cogiro.mass == 100.0
    np.testing.assert_array_equal(robot.platform.center_of_mass, turn @ body.center_of_mass)
    np.testing.assert_array_equal(robot.platform.inertia, turn @ body.inertia @ turn.T)
    np.testing.assert_allclose(robot.cable.drum_run, 5.4 * scale[2], rtol=0, atol=5e-4)
    X, X0 = robot.cameras.X_WF, cogiro.cameras.X_WF
    expected = turn @ X0.translation() * scale
    np.testing.assert_allclose(X.translation(), expected, rtol=0, atol=half)
    np.testing.assert_allclose(X.rotation().matrix(), turn @ X0.rotation().matrix(), atol=1e-9)
    # all else is CoGiRo's, but for the damping
    cable = {"drum_run": cogiro.cable.drum_run, "damping_time": cogiro.cable.damping_time}
    assert robot.cable.replace(**cable) == cogiro.cable
    assert robot.winch == cogiro.winch and robot.load_cells == cogiro.load_cells
    placed = {
        f: getattr(cogiro.cameras, f) for f in ("pose_cameras", "stereo_pairs", "cable_segment")
    }
    assert robot.cameras.replace(X_WF=X0, **placed) == cogiro.cameras
    assert robot.cable.damping_time > cogiro.cable.damping_time


# --- mass, centre of mass, inertia


def test_total_mass_properties_by_hand(cogiro: CableRobot) -> None:
    # 3 kg at x = 0 and 1 kg at x = 4 m: G at x = 1 m, and
    # I_yy = I_zz = own + 3 x 1^2 + 1 x 3^2 = own + 12 kg m2, I_xx = own
    platform = RigidBody(mass=3.0, center_of_mass=[0, 0, 0], inertia=np.diag([2.0, 3.0, 4.0]))
    robot = cogiro.replace(platform=platform)
    robot = robot.with_payload(1.0, [4.0, 0.0, 0.0], np.diag([0.5, 0.6, 0.7]))
    assert robot.mass == 4.0
    np.testing.assert_allclose(robot.center_of_mass, [1.0, 0.0, 0.0], rtol=1e-15)
    np.testing.assert_allclose(robot.inertia, np.diag([2.5, 15.6, 16.7]), rtol=1e-14)


def test_a_product_of_inertia_by_hand(cogiro: CableRobot) -> None:
    # 2 kg at (1, 1, 0) and 2 kg at (-1, -1, 0): int x y dm = 4, so I_xy is 4 less
    own = np.diag([1.0, 1.0, 1.0])
    body = RigidBody(mass=2.0, center_of_mass=[1.0, 1.0, 0.0], inertia=own)
    robot = cogiro.replace(platform=body).with_payload(2.0, [-1.0, -1.0, 0.0], own)
    np.testing.assert_allclose(robot.center_of_mass, np.zeros(3), atol=1e-16)
    np.testing.assert_allclose(robot.inertia, [[6, -4, 0], [-4, 6, 0], [0, 0, 10]], rtol=1e-15)


@given(
    masses=st.tuples(st.floats(1.0, 500.0), st.floats(0.1, 500.0)),
    centers=st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6),
)
def test_total_mass_properties_agree_with_drake(
    masses: tuple[float, float], centers: list[float]
) -> None:
    inertia = np.array([[40.2, 0.5, -3.3], [0.5, 39.5, 1.7], [-3.3, 1.7, 27.9]])
    points = np.reshape(centers, (2, 3))
    bodies = [
        RigidBody(mass=m, center_of_mass=c, inertia=inertia)
        for m, c in zip(masses, points, strict=True)
    ]
    robot = load_robot_once("cogiro").replace(platform=bodies[0], payload=bodies[1])

    def drake(body: RigidBody) -> SpatialInertia:
        I = body.inertia
        moments = RotationalInertia(I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2])
        return SpatialInertia.MakeFromCentralInertia(body.mass, body.center_of_mass, moments)

    total = drake(bodies[0])
    total += drake(bodies[1])
    assert robot.mass == pytest.approx(total.get_mass(), rel=1e-15)
    np.testing.assert_allclose(robot.center_of_mass, total.get_com(), atol=1e-14)
    shifted = total.Shift(total.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
    np.testing.assert_allclose(robot.inertia, shifted, rtol=1e-12, atol=1e-10)


def test_with_payload_defaults_to_a_pallet_at_the_platform_s_centre(cogiro: CableRobot) -> None:
    robot = cogiro.with_payload(110.0)
    np.testing.assert_allclose(robot.center_of_mass, cogiro.center_of_mass, rtol=1e-15)
    box = UnitInertia.SolidBox(1.0, 1.0, 0.3).CopyToFullMatrix3()
    np.testing.assert_allclose(robot.payload.inertia, 110.0 * box, rtol=1e-15)
    np.testing.assert_allclose(robot.inertia, cogiro.inertia + 110.0 * box, rtol=1e-14)
    assert robot.with_payload(0.0).mass == 100.0
    np.testing.assert_array_equal(robot.with_payload(0.0).inertia, cogiro.platform.inertia)
    assert cogiro.payload.mass == 0.0  # the original is as it was
    point = cogiro.with_payload(10.0, [0.0, 0.0, -1.0], np.zeros((3, 3)))  # a point load is fine
    assert point.mass == 110.0


# --- stiffness


def test_axial_stiffness_by_hand() -> None:
    stiffness = AxialStiffness(asymptote=1000.0, softening=5000.0, offset=10.0)
    assert stiffness(0.0) == 500.0 and stiffness(40.0) == 900.0
    np.testing.assert_array_equal(stiffness(np.array([0.0, 40.0])), [500.0, 900.0])
    assert stiffness.derivative(40.0) == 2.0
    step = stiffness(40.0 + 1e-3) - stiffness(40.0 - 1e-3)
    assert stiffness.derivative(40.0) == pytest.approx(step / 2e-3, rel=1e-8)
    np.testing.assert_array_equal(stiffness.as_array(), [1000.0, 5000.0, 10.0])
    assert AxialStiffness(asymptote=7.0)(0.0) == 7.0


def test_a_softening_stiffness_from_a_file(data: dict, tmp_path: Path) -> None:
    data["cable"]["stiffness"] = {"asymptote": 6e5, "softening": 5e7, "offset": 200.0}
    path = write(tmp_path, data)
    assert load_robot(path).cable.stiffness(300.0) == 5e5
    data["cable"]["stiffness"] = "5e5"  # YAML 1.1 takes a number without a point for text
    assert load_robot(write(tmp_path, data)).cable.stiffness == AxialStiffness(asymptote=5e5)


# --- values, copies, files


def test_a_robot_is_a_value(cogiro: CableRobot) -> None:
    again = load_robot("cogiro")
    assert again is not cogiro and again == cogiro and hash(again) == hash(cogiro)
    heavier = cogiro.with_payload(1.0)
    assert heavier != cogiro and heavier.with_payload(0.0) == cogiro
    assert cogiro != "cogiro" and cogiro.cable != cogiro.winch
    moved = RigidTransform([0.0, 0.0, 1e-9]) @ cogiro.cameras.X_WF
    assert cogiro.cameras.replace(X_WF=moved) != cogiro.cameras
    assert repr(cogiro) == "<CableRobot 'cogiro': 8 cables, 100 kg>"


@pytest.mark.parametrize("remake", [lambda r: pickle.loads(pickle.dumps(r)), copy.deepcopy])
def test_a_copy_is_equal_and_read_only_too(remake: Callable, cogiro: CableRobot) -> None:
    again = remake(cogiro)
    assert again == cogiro
    for robot in (cogiro, again):
        for array in (robot.drawing_points, robot.platform.inertia, robot.cable.drum_run):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0.0
    with pytest.raises(AttributeError):
        again.gravity = 1.0  # type: ignore[misc]


def test_a_robot_keeps_its_own_copy_of_what_it_is_given(cogiro: CableRobot) -> None:
    points = np.array(cogiro.drawing_points)
    X_WF = RigidTransform(cogiro.cameras.X_WF)
    robot = cogiro.replace(drawing_points=points, cameras=cogiro.cameras.replace(X_WF=X_WF))
    points[0] = 0.0
    X_WF.set_translation([0.0, 0.0, 0.0])
    assert robot == cogiro


@pytest.mark.parametrize("name", NAMES)
def test_a_saved_robot_loads_as_it_was(name: str, tmp_path: Path) -> None:
    robot = load_robot(name)
    save_robot(robot, tmp_path / "robot.yaml")
    assert load_robot(tmp_path / "robot.yaml") == robot
    assert load_robot(str(tmp_path / "robot.yaml")) == robot


@settings(max_examples=25)
@given(
    angles=st.tuples(*[st.floats(-3.2, 3.2)] * 3),
    point=st.tuples(*[st.floats(-1e3, 1e3)] * 3),
    runs=st.lists(st.floats(0.0, 50.0), min_size=8, max_size=8),
)
def test_a_robot_goes_through_a_file_to_the_last_bit(
    angles: tuple, point: tuple, runs: list[float], tmp_path_factory: pytest.TempPathFactory
) -> None:
    cogiro = load_robot_once("cogiro")
    X = RigidTransform(RotationMatrix(rotation((angles[0] or 1.0, *angles[1:]))), point)
    robot = cogiro.replace(
        cameras=cogiro.cameras.replace(X_WF=X), cable=cogiro.cable.replace(drum_run=runs)
    )
    path = tmp_path_factory.mktemp("robot") / "robot.yaml"
    save_robot(robot, path)
    assert load_robot(path) == robot


def test_a_file_may_use_anchors_and_leave_out_what_has_a_default(
    cogiro: CableRobot, data: dict, tmp_path: Path
) -> None:
    for key in ("description", "payload", "sources", "assumptions"):
        del data[key]
    for key in ("encoder_zero_length", "coulomb_torque", "capstan_speed", "damping"):
        del data["winch"][key]
    del data["load_cells"]["bias"], data["load_cells"]["gain"], data["gravity"]
    path = tmp_path / "robot.yaml"
    path.write_text(f"_earth: &earth 9.81\ngravity: *earth\n{yaml.safe_dump(data)}")
    robot = load_robot(path)
    assert robot.gravity == 9.81 and robot.winch == cogiro.winch and robot.payload.mass == 0.0
    assert robot.load_cells == cogiro.load_cells


@pytest.mark.parametrize("text", ["", "gain: null\n", "gain: 0.05\n", "gain: 5e-2\n"])
def test_a_file_may_name_a_gain(text: str, cogiro: CableRobot, data: dict, tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(text + yaml.safe_dump(data))
    robot = load_robot(path)
    named = 0.05 if "5" in text else None
    assert robot.gain == named and cogiro.gain is None
    assert (robot == cogiro) is (named is None)
    assert robot == cogiro.replace(gain=named) and hash(robot) == hash(cogiro.replace(gain=named))
    assert pickle.loads(pickle.dumps(robot)) == robot and robot.replace(gain=None) == cogiro
    save_robot(robot, path)
    assert load_robot(path) == robot and ("\ngain:" in path.read_text()) is (named is not None)
    with pytest.raises(RobotFileError, match=r"gain: must be positive and finite, got -1\.0"):
        robot.replace(gain=-1.0)


def test_a_rotation_may_be_written_as_a_matrix(
    cogiro: CableRobot, data: dict, tmp_path: Path
) -> None:
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    data["cameras"]["X_PM"]["rotation"] = turn.tolist()
    robot = load_robot(write(tmp_path, data))
    np.testing.assert_array_equal(robot.cameras.X_PM.rotation().matrix(), turn)
    rounded = np.round(cogiro.cameras.X_WF.rotation().matrix(), 8)
    data["cameras"]["X_PM"]["rotation"] = rounded.tolist()
    R_PM = load_robot(write(tmp_path, data)).cameras.X_PM.rotation()
    assert R_PM.IsValid()
    np.testing.assert_allclose(R_PM.matrix(), rounded, atol=2e-8)


def test_any_number_of_cables_is_a_robot(cogiro: CableRobot) -> None:
    ends = {f: getattr(cogiro, f)[:3] for f in ("drawing_points", "attachment_points")}
    robot = cogiro.replace(
        **ends,
        cable=cogiro.cable.replace(drum_run=5.4),
        winch=cogiro.winch.replace(encoder_zero_length=1.0),
        load_cells=cogiro.load_cells.replace(bias=0.0, gain=1.0),
    )
    assert robot.num_cables == 3
    np.testing.assert_array_equal(robot.winch.encoder_zero_length, [1.0, 1.0, 1.0])


# --- what is refused


def write(folder: Path, data: Any) -> Path:
    path = folder / "my robot.yaml"
    path.write_text(data if isinstance(data, str) else yaml.safe_dump(data), encoding="utf-8")
    return path


def put(path: str, value: Any) -> Callable[[dict], None]:
    """An edit that puts a value at a place like `cable.section`."""

    def edit(data: dict) -> None:
        *groups, name = path.split(".")
        reduce(lambda d, key: d[key], groups, data)[name] = value

    return edit


def drop(path: str) -> Callable[[dict], None]:
    def edit(data: dict) -> None:
        *groups, name = path.split(".")
        del reduce(lambda d, key: d[key], groups, data)[name]

    return edit


def row(path: str, index: int, value: Any) -> Callable[[dict], None]:
    def edit(data: dict) -> None:
        reduce(lambda d, key: d[key], path.split("."), data)[index] = value

    return edit


def same_cable_twice(data: dict) -> None:
    for name in ("drawing_points", "attachment_points"):
        data[name][4] = data[name][1]


BAD = [
    # form
    (put("cable.lenght", 1.0), "cable.lenght", "unknown field"),
    (put("cable.stifness", 1.0), "cable.stifness", "did you mean stiffness"),
    (put("colour", "red"), "colour", "unknown field; known: name, description"),
    (put("cameras.X_WF.position", [0, 0, 0]), "cameras.X_WF.position", "unknown field"),
    (drop("platform.mass"), "platform.mass", "is missing"),
    (drop("cable"), "cable", "is missing"),
    (drop("cameras.X_WF.rotation"), "cameras.X_WF.rotation", "is missing"),
    (put("name", 3), "name", "must be text, got 3"),
    (put("gravity", "down"), "gravity", "must be a number, got 'down'"),
    (put("gravity", True), "gravity", "must be a number, got True"),
    (put("gravity", None), "gravity", "must be a number, got None"),
    (put("gravity", 10**400), "gravity", "must be a number"),
    (put("platform", 50.0), "platform", "must be a mapping with mass"),
    (put("platform.mass", [50.0]), "platform.mass", "must be a number"),
    (put("load_cells.order", 1.5), "load_cells.order", "must be a whole number, got 1.5"),
    (put("cable.stiffness", [1e5]), "cable.stiffness", "must be a mapping with asymptote"),
    (put("cable.stiffness", {"softening": 1.0}), "cable.stiffness.asymptote", "is missing"),
    (put("cable.drum_run", "long"), "cable.drum_run", "must hold numbers, not 'long'"),
    (row("cable.drum_run", 2, True), "cable.drum_run", "must hold numbers, not True"),
    (put("sources", ["me"]), "sources", "must map names to texts"),
    (put("sources", {"cabel": "me"}), "sources", "'cabel' is not a field of a robot"),
    (put("assumptions", "all"), "assumptions", "must be a list of texts"),
    # shape
    (row("drawing_points", 2, [1.0, 2.0]), "drawing_points", "rows of equal length"),
    (put("drawing_points", []), "drawing_points", "must have shape (k, 3)"),
    (put("drawing_points", [[1.0, 2.0]]), "drawing_points", "must have shape (k, 3)"),
    (put("attachment_points", [[1.0, 2.0, 3.0]]), "attachment_points", "shape of drawing_points"),
    (put("platform.center_of_mass", [0.0]), "platform.center_of_mass", "must have shape (3,)"),
    (put("platform.inertia", [1.0, 1.0, 1.0]), "platform.inertia", "must have shape (3, 3)"),
    (put("cable.drum_run", [5.4, 5.4]), "cable.drum_run", "must have shape (8,), got (2,)"),
    (put("cameras.X_WF.rotation", [1.0]), "cameras.X_WF.rotation", "must have shape (3,)"),
    (put("cameras.X_PM.translation", 0.5), "cameras.X_PM.translation", "must have shape (3,)"),
    # not finite
    (row("drawing_points", 2, [1.0, math.nan, 2.0]), "drawing_points", "for cable 3"),
    (row("attachment_points", 7, [1.0, math.inf, 2.0]), "attachment_points", "for cable 8"),
    (put("platform.mass", math.nan), "platform.mass", "got nan"),
    (put("winch.inertia", math.inf), "winch.inertia", "got inf"),
    (row("platform.inertia", 1, [0.0, math.nan, 0.0]), "platform.inertia", "must be finite"),
    (put("payload.center_of_mass", [0, 0, -math.inf]), "payload.center_of_mass", "must be finite"),
    (put("cameras.X_WF.rotation", [math.nan, 0, 0]), "cameras.X_WF.rotation", "must be finite"),
    (put("cameras.X_WF.translation", [0, math.inf, 0]), "cameras.X_WF.translation", "finite"),
    # sign and size
    (put("platform.mass", 0.0), "platform.mass", "must be positive"),
    (put("payload.mass", -1.0), "payload.mass", "must be >= 0"),
    (put("gravity", -9.81), "gravity", "must be positive"),
    (put("cable.linear_density", 0.0), "cable.linear_density", "must be positive"),
    (put("cable.section", -1e-6), "cable.section", "must be positive"),
    (put("cable.section", 8.2051), "cable.section", "exceeds the circle's"),
    (put("cable.damping_time", -1e-3), "cable.damping_time", "must be >= 0"),
    (row("cable.drum_run", 5, -1.0), "cable.drum_run", "got -1.0 for cable 6"),
    (put("cable.stiffness", 0.0), "cable.stiffness.asymptote", "must be positive"),
    (
        put("cable.stiffness", {"asymptote": 1e5, "softening": 1e7, "offset": 100.0}),
        "cable.stiffness",
        "must be positive at no tension, got 0 N",
    ),
    (
        put("cable.stiffness", {"asymptote": 1e5, "softening": 1e7, "offset": 0.0}),
        "cable.stiffness.offset",
        "must be positive",
    ),
    (put("cable.min_tension", -1.0), "cable.min_tension", "must be >= 0"),
    (put("cable.min_tension", 5000.0), "cable.min_tension", "must be below max_tension"),
    (put("cable.max_tension", 10001.0), "cable.max_tension", "must not exceed breaking_load"),
    (put("winch.transmission", 0.0), "winch.transmission", "must be positive"),
    (put("winch.inertia", 0.0), "winch.inertia", "must be positive"),
    (put("winch.proportional_gain", -1.0), "winch.proportional_gain", "must be >= 0"),
    (put("winch.capstan_speed", 0.0), "winch.capstan_speed", "must be positive"),
    (put("cameras.sample_time", 0.0), "cameras.sample_time", "must be positive"),
    (put("cameras.latency", -0.04), "cameras.latency", "must be >= 0"),
    (put("load_cells.order", 0), "load_cells.order", "must be positive"),
    (put("load_cells.noise", -1.0), "load_cells.noise", "must be >= 0"),
    (put("gain", 0.0), "gain", "must be positive and finite, got 0.0"),
    (put("gain", -0.1), "gain", "must be positive and finite"),
    (put("gain", math.nan), "gain", "must be positive and finite"),
    (put("gain", math.inf), "gain", "must be positive and finite"),
    (put("gain", "fast"), "gain", "must be a number, got 'fast'"),
    (put("gain", True), "gain", "must be a number"),
    (put("gain", [0.1]), "gain", "must be a number"),
    (same_cable_twice, "drawing_points", "cables 2 and 5 are the same at both ends"),
    # bodies and rotations
    (row("platform.inertia", 0, [40.0, 9.0, 0.0]), "platform.inertia", "must be symmetric"),
    (put("platform.inertia", np.diag([1.0, 1.0, 2.1]).tolist()), "platform.inertia", "no body"),
    (
        put("platform.inertia", np.diag([-1.0, 1.0, 1.0]).tolist()),
        "platform.inertia",
        "must be positive definite",
    ),
    (
        put("platform.inertia", np.diag([0.0, 1.0, 1.0]).tolist()),
        "platform.inertia",
        "must be positive definite",
    ),
    (put("payload.inertia", np.eye(3).tolist()), "payload.inertia", "must be zero"),
    (
        put("cameras.X_PM.rotation", np.diag([1.0, 1.0, 1.001]).tolist()),
        "cameras.X_PM.rotation",
        "is not a rotation matrix",
    ),
    (
        put("cameras.X_PM.rotation", np.diag([1.0, 1.0, -1.0]).tolist()),
        "cameras.X_PM.rotation",
        "is not a rotation matrix",
    ),
]


@pytest.mark.parametrize(("edit", "field", "message"), BAD, ids=[f"{b[1]}: {b[2]}" for b in BAD])
def test_a_bad_file_is_refused_naming_file_and_field(
    edit: Callable[[dict], None], field: str, message: str, data: dict, tmp_path: Path
) -> None:
    edit(data)
    path = write(tmp_path, data)
    with pytest.raises(RobotFileError) as caught:
        load_robot(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: {field}: ") and message in text and "\n" not in text
    assert caught.value.field == field and isinstance(caught.value, CdprError)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must be a mapping with name"),
        ("- 1\n- 2\n", "must be a mapping with name"),
        ("name: [\n", "not valid YAML"),
        ("name: *nobody\n", "line 1: not valid YAML: found undefined alias"),
        ("name: !odd thing\n", "not valid YAML"),
        ("name: a\ngravity: 9.81\nname: b\n", "name: is given twice, on lines 1 and 3"),
        ("cable:\n  section: 1\n  section: 2\n", "cable.section: is given twice"),
        ("1: 2\n", "1: must be text to be a field's name, line 1"),
        ("[a, b]: 2\n", "must be text to be a field's name, line 1"),
        ("name: \x00", "not valid YAML"),
        ("a: &a [*a]", "a: unknown field"),
        ("[" * 5000, "recursion"),
    ],
)
def test_what_is_not_a_robot_file_at_all_is_refused(
    text: str, message: str, tmp_path: Path
) -> None:
    path = write(tmp_path, text)
    with pytest.raises(RobotFileError) as caught:
        load_robot(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_a_name_that_is_no_robot_lists_those_there_are(tmp_path: Path) -> None:
    for name in ("cogirO", str(tmp_path / "robot.yaml"), tmp_path, ""):
        with pytest.raises(RobotFileError) as caught:
            load_robot(name)
        assert all(known in str(caught.value) for known in NAMES)
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x80")
    with pytest.raises(RobotFileError, match="not a text file"):
        load_robot(tmp_path / "binary.yaml")


def test_a_robot_made_in_code_is_checked_too(cogiro: CableRobot) -> None:
    with pytest.raises(RobotFileError, match=r"^robot 'cogiro': gravity: must be positive"):
        cogiro.replace(gravity=0.0)
    with pytest.raises(RobotFileError, match=r"cable\.section: must be positive"):
        cogiro.replace(cable=cogiro.cable.replace(section=-1.0))
    with pytest.raises(RobotFileError, match=r"cable\.drum_run: must have shape \(3,\)"):
        cogiro.replace(
            drawing_points=cogiro.drawing_points[:3],
            attachment_points=cogiro.attachment_points[:3],
        )
    with pytest.raises(RobotFileError, match=r"payload\.mass: must be >= 0"):
        cogiro.with_payload(-1.0)
    with pytest.raises(RobotFileError, match=r"^Winch: inertia: must be a number, got '0.03'"):
        cogiro.winch.replace(inertia="0.03")
    with pytest.raises(RobotFileError, match=r"^CableRobot: cable: must be a Cable"):
        cogiro.replace(cable=cogiro.winch)
    with pytest.raises(RobotFileError, match=r"cameras\.X_PM: must be a finite translation"):
        X_PM = RigidTransform([math.nan, 0.0, 0.0])
        cogiro.replace(cameras=cogiro.cameras.replace(X_PM=X_PM))
    with pytest.raises(RobotFileError, match=r"sources: 'cabel' is not a field"):
        cogiro.replace(sources={"cabel": "me"})


def test_a_stiffness_beyond_all_numbers_is_named(cogiro: CableRobot) -> None:
    for stiffness in (1e18, float("inf")):
        with pytest.raises(RobotFileError, match=r"cable\.stiffness"):
            cogiro.replace(
                cable=cogiro.cable.replace(stiffness=AxialStiffness(asymptote=stiffness))
            )


def test_a_density_that_is_not_steel_s_is_warned_of(cogiro: CableRobot) -> None:
    density = 0.9 * 7850.0 * cogiro.cable.section
    cogiro.replace(cable=cogiro.cable.replace(linear_density=1.001 * density))
    with pytest.warns(RobotFileWarning, match=r"linear_density: over section it is 7058 kg/m3"):
        cogiro.replace(cable=cogiro.cable.replace(linear_density=0.999 * density))


def test_a_payload_may_be_a_point_or_a_rod_but_not_less(cogiro: CableRobot) -> None:
    assert cogiro.with_payload(10.0, inertia=np.diag([0.0, 1.0, 1.0])).mass == 110.0
    with pytest.raises(RobotFileError, match=r"payload\.inertia: must not be negative"):
        cogiro.with_payload(10.0, inertia=np.diag([-0.1, 1.0, 1.0]))
