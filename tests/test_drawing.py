"""Any robot can be drawn: 1 m or 500 m, in space or in a plane, with a body or a point to move."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.geometry import Box, Meshcat
from pydrake.math import RigidTransform

from cdpr_drake.__main__ import main
from cdpr_drake.diagrams import Record
from cdpr_drake.diagrams.hall import hall_parts
from cdpr_drake.errors import RobotFileError
from cdpr_drake.model.digits import decimals, round_step, significant
from cdpr_drake.model.kinematics import cable_ends
from cdpr_drake.model.robot import CableRobot, load_robot, robot_names, save_robot
from cdpr_drake.model.room import floor_height, home_position, room_of
from cdpr_drake.show import mode_plots, plots, replay, scene
from cdpr_drake.show.explorer import Explorer
from cdpr_drake.show.frame import frame_bars
from cdpr_drake.show.labels import labels_html

ABOVE = np.array([[-1.0, -0.8, 3.0], [1.0, -0.8, 3.0], [1.0, 0.8, 3.0], [-1.0, 0.8, 3.0]])
CUBE = np.array([[-1.0, -1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0], [-1.0, 1.0, -1.0]])
ROD = np.array([[-0.3, -0.3, 0.0], [0.3, 0.3, 0.0], [0.3, 0.3, 0.0], [-0.3, -0.3, 0.0]])
UPRIGHT = np.array([[-2.0, 0.0, 3.0], [2.0, 0.0, 3.0], [2.0, 0.0, 0.0], [-2.0, 0.0, 0.0]])

SHAPES: dict[str, tuple[Any, Any]] = {
    "a point on four cables": (ABOVE, np.zeros((4, 3))),
    "a rod": (ABOVE, ROD),
    "a plate": (ABOVE, 0.2 * CUBE * [1.0, 1.0, 0.0]),
    "a cube of 5 cm": (ABOVE, 0.025 * CUBE),
    "vertical cables": (ABOVE, ABOVE - [0.0, 0.0, 3.0]),
    "one cable": ([[0.0, 0.0, 3.0]], [[0.0, 0.0, 0.05]]),
    "one cable, from W's origin": ([[0.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]]),
    "in the plane x, z": (UPRIGHT, 0.1 * CUBE * [1.0, 0.0, 1.0]),
    "in the plane y, z": (UPRIGHT[:, [1, 0, 2]], np.zeros((4, 3))),
    "in the plane x, y": (ABOVE - [0.0, 0.0, 3.0], 0.1 * CUBE * [1.0, 1.0, 0.0]),
    "anchors on the floor": (
        [*ABOVE, [0.0, 0.0, 0.0], [1.0, -0.8, 0.0]],
        [*(0.1 * CUBE), [0.0, 0.0, -0.1], [0.1, 0.0, -0.1]],
    ),
    "anchors in the middle of the ceiling": (
        [*ABOVE, [0.0, 0.0, 2.9], [0.2, 0.1, 3.0]],
        [*(0.1 * CUBE), [0.0, 0.0, 0.1], [0.1, 0.0, 0.1]],
    ),
    "1 m in 500 m": (250.0 * (ABOVE - [0.0, 0.0, 2.7]), 0.5 * CUBE),
    "W at the ceiling": (ABOVE - [0.0, 0.0, 3.0], 0.1 * CUBE),
}
NAMES = [*robot_names(), *SHAPES]


def make(name: str) -> CableRobot:
    """Return a built-in robot, or one with points of `SHAPES`."""
    if name not in SHAPES:
        return load_robot(name)
    robot = load_robot(Path(__file__).parent / "outside" / "box.yaml")
    parts = {
        "cable": robot.cable.replace(drum_run=np.array(0.0)),
        "winch": robot.winch.replace(encoder_zero_length=np.array(0.0)),
        "load_cells": robot.load_cells.replace(bias=np.array(0.0), gain=np.array(1.0)),
    }
    A, B = SHAPES[name]
    return robot.replace(name=name, drawing_points=A, attachment_points=B, **parts)


def moving(robot: CableRobot) -> Record:
    """Return a record of a short motion near home, cables a little longer than their chords."""
    room = room_of(robot)
    poses = np.zeros((3, 6))
    poses[:, 3:] = home_position(robot) + np.outer([-0.02, 0.0, 0.02], room.high - room.low)
    chords = np.array([np.linalg.norm(cable_ends(robot, p).chord, axis=1) for p in poses])
    k = robot.num_cables
    signals = {
        "pose": poses,
        "unstrained_length": 1.001 * chords + robot.cable.drum_run,
        "tension_at_drawing_point": np.full((3, k), 0.1) + 0.01 * np.arange(k),
        "tangents_at_drawing_point": np.zeros((3, 3 * k)),
        "dbeta": np.zeros((3, k)),
        "motor_rates": np.zeros((3, k)),
        "pose_error": np.zeros((3, 6)),
    }
    context: Any = None
    return Record(
        time=np.arange(3.0), signals=signals, context=context, wall_time=1.0, slack_cables={}
    )


# --- the room


@pytest.mark.parametrize("name", NAMES)
def test_a_room_holds_the_robot_and_has_a_size(name: str) -> None:
    robot = make(name)
    room = room_of(robot)
    assert room.size > 0.0 and room.low[2] <= room.floor
    points = np.vstack([robot.drawing_points, home_position(robot) + robot.attachment_points])
    assert np.all(points >= room.low - 1e-9) and np.all(points <= room.high + 1e-9)
    assert room.floor == floor_height(robot) <= robot.drawing_points[:, 2].max()
    if robot.floor is None:
        assert points[:, 2].min() >= room.floor - 1e-9


def test_the_floor_is_what_the_file_says_and_else_the_lowest_point() -> None:
    robot = make("anchors on the floor")
    assert robot.floor is None and floor_height(robot) == 0.0
    assert floor_height(robot.replace(floor=-0.5)) == -0.5
    shifted = robot.drawing_points - [0.0, 0.0, 7.0]
    assert floor_height(robot.replace(drawing_points=shifted)) == -7.0
    hung = make("a plate")
    assert floor_height(hung) == pytest.approx(3.0 - 0.4 * 2.0)
    # Where the platform has been below, there was no floor.
    low = RigidTransform([0.0, 0.0, 0.5])
    assert room_of(hung, [low]).floor == pytest.approx(0.5)
    assert room_of(hung.replace(floor=1.0), [low]).floor == 1.0


def test_the_floor_goes_to_yaml_and_back(tmp_path: Path) -> None:
    for floor in (None, -1.25):
        save_robot(make("a rod").replace(floor=floor), tmp_path / "robot.yaml")
        assert load_robot(tmp_path / "robot.yaml").floor == floor


def test_a_floor_that_is_no_number_is_refused() -> None:
    with pytest.raises(RobotFileError, match="floor: must be finite"):
        make("a rod").replace(floor=np.inf)


# --- what is drawn


@pytest.fixture(scope="module")
def meshcat() -> Meshcat:
    return replay._quiet_meshcat()


@pytest.mark.parametrize("name", NAMES)
def test_no_bar_of_the_frame_is_nothing_and_each_point_is_held(name: str) -> None:
    robot = make(name)
    room = room_of(robot)
    bars = frame_bars(robot, room)
    lengths = [np.linalg.norm(bar.end - bar.start) for bar in bars]
    assert all(length > 1e-4 * room.size for length in lengths)
    held = np.array([p for bar in bars for p in (bar.start, bar.end)]).reshape(-1, 3)
    for point in robot.drawing_points:
        near = np.linalg.norm(held - point, axis=1).min(initial=np.inf)
        assert min(near, point[2] - room.floor) < 0.01 * room.size
    upright = [bar for bar in bars if np.allclose(bar.start[:2], bar.end[:2])]
    home = home_position(robot)[:2]
    reach = np.linalg.norm(robot.attachment_points[:, :2], axis=1).max()
    for bar in upright:
        if bar.start[2] == room.floor and name != "anchors on the floor" and name in SHAPES:
            assert np.linalg.norm(bar.start[:2] - home) > reach  # clear of the platform


@pytest.mark.parametrize("window", [scene.BESIDE_LEGEND, scene.BETWEEN_PANELS])
@pytest.mark.parametrize("name", NAMES)
def test_the_viewer_sees_all_and_the_robot_fills_the_view(name: str, window: scene.Window) -> None:
    robot = make(name)
    room = room_of(robot)
    points = scene.in_view(robot, room)
    eye, target = scene.fitted_view(points, scene.VIEW, window)
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    depth = (points - eye) @ ahead
    half = np.tan(0.5 * scene.FIELD_OF_VIEW)
    x = (points - eye) @ right / depth / half / scene.ASPECT
    y = (points - eye) @ np.cross(right, ahead) / depth / half
    assert np.all(depth > 5e-4 * room.size) and np.all(depth < 20.0 * room.size)
    assert window.left - 1e-9 <= x.min() and x.max() <= window.right + 1e-9
    assert window.bottom - 1e-9 <= y.min() and y.max() <= window.top + 1e-9
    across = np.ptp(x) / (window.right - window.left)
    assert max(across, np.ptp(y) / (window.top - window.bottom)) == pytest.approx(1.0)


@pytest.mark.parametrize("name", NAMES)
def test_every_robot_has_a_replay(name: str, tmp_path: Path) -> None:
    robot = make(name).with_payload(1.0, inertia=np.zeros((3, 3)))
    record = moving(robot)
    goal = record["pose"][-1]
    file = replay.write_replay(tmp_path / "r.html", robot, record, goal, others={"b": record})
    page = file.read_text(encoding="utf-8")
    (labels,) = re.findall(r'id="labels-data">(.*?)</script>', page)
    numbers, axes = json.loads(labels)
    assert [label["text"] for label in numbers] == [f"{i + 1}" for i in range(robot.num_cables)]
    assert [label["text"] for label in axes] == ["x", "y", "z"]
    assert f"Grid of {scene.grid_step(room_of(robot)):g} m" in page
    (data,) = re.findall(r'id="replay-data">(.*?)</script>', page)
    assert json.loads(data)["tension"][0][0] == 0.1  # not rounded to nothing


@pytest.mark.parametrize("name", ["a point on four cables", "1 m in 500 m", "cogiro"])
def test_a_platform_too_small_to_be_seen_is_drawn_in_a_ball(name: str, meshcat: Meshcat) -> None:
    robot = make(name)
    meshcat.Delete("/p")
    scene.draw_platform(meshcat, "/p", robot, room_of(robot), scene.PLATFORM)
    assert meshcat.HasPath("/p/ball") == (name != "cogiro")
    assert meshcat.HasPath("/p/edge0") == (name != "a point on four cables")


def test_a_bar_of_no_length_is_not_drawn(meshcat: Meshcat) -> None:
    scene.draw_bar(meshcat, "/bar/none", np.ones(3), np.ones(3), 0.1, scene.STEEL)
    assert not meshcat.HasPath("/bar/none")
    X, length = scene.bar_pose(np.ones(3), np.ones(3))
    assert length > 0.0 and X.translation() == pytest.approx(np.ones(3))


def test_a_payload_is_no_larger_than_the_platform(meshcat: Meshcat) -> None:
    robot = make("a cube of 5 cm").with_payload(1.0)  # the box of a pallet
    scene.draw_platform(meshcat, "/small", robot, room_of(robot), scene.PLATFORM)
    packed = meshcat._GetPackedObject("/small/payload")
    assert b"BoxGeometry" in packed
    sides = re.findall(rb"(?:width|height|depth)\xcb(.{8})", packed, re.DOTALL)[:3]
    assert max(np.frombuffer(b"".join(sides), ">f8")) < 0.1


@pytest.mark.parametrize("name", ["a point on four cables", "one cable", "in the plane x, z"])
def test_robots_that_may_not_rest_are_explored_all_the_same(name: str) -> None:
    robot = make(name)
    explorer = Explorer(robot, RigidTransform(home_position(robot)))
    try:
        if explorer.snapshot.answers is None:
            assert html.escape(explorer.snapshot.reason) in explorer._page.panel
        assert explorer.meshcat.HasPath("/cables/1/1")
    finally:
        explorer.close()


@pytest.mark.parametrize("name", ["ipanema-2", "segesta-10", "acrobot"])
def test_sliders_span_the_robot_s_own_room(name: str) -> None:
    robot = make(name)
    explorer = Explorer(robot, RigidTransform(home_position(robot)), tensions="within limits")
    try:
        assert explorer.snapshot.answers is not None, explorer.snapshot.reason
        explorer.meshcat.SetSliderValue("z [m]", 1e9)
        highest = explorer.meshcat.GetSliderValue("z [m]")
        explorer.meshcat.SetSliderValue("z [m]", -1e9)
        lowest = explorer.meshcat.GetSliderValue("z [m]")
        assert lowest == pytest.approx(0.0, abs=1e-9)
        assert highest == pytest.approx(room_of(robot).high[2], abs=0.01 * highest)
    finally:
        explorer.close()


def test_labels_cannot_end_their_script() -> None:
    from cdpr_drake.show.labels import Label

    assert "</script>x" not in labels_html([[Label("</script>x", np.zeros(3))]])


# --- figures


@pytest.mark.parametrize("name", ["segesta-10", "one cable", "a point on four cables"])
def test_every_robot_has_figures(name: str, tmp_path: Path) -> None:
    robot = make(name)
    paths = plots.save_figures({"a": moving(robot)}, robot, tmp_path, gain=0.1)
    assert all(path.stat().st_size > 1000 for path in paths)


def test_more_cables_than_colours_are_told_apart() -> None:
    robot = make("segesta-10")
    axes = plots.motor_rate_figure({"a": moving(robot)}).axes[0]
    lines = [i for i in axes.get_lines() if str(i.get_label()).startswith("cable")]
    looks = {(line.get_color(), str(line.get_linestyle())) for line in lines}
    assert len(lines) == len(looks) == 10


def test_a_point_s_motion_is_drawn() -> None:
    from matplotlib.figure import Figure

    robot = make("a point on four cables")
    axes = Figure().add_subplot(projection="3d")
    values = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 1.0j])
    mode_plots._draw_motion(axes, values, robot, RigidTransform(home_position(robot)))
    assert np.ptp(axes.get_xlim()) > 0.01


# --- halls


@pytest.mark.parametrize("name", NAMES)
def test_a_hall_has_no_part_without_a_size(name: str) -> None:
    robot = make(name)
    for part, shape, _, _ in hall_parts(robot):
        assert isinstance(shape, Box) and np.all(shape.size() > 0.0), part


def test_a_hall_stands_on_the_floor() -> None:
    robot = load_robot("cogiro")
    lower = robot.replace(drawing_points=robot.drawing_points - [0.0, 0.0, 2.0], floor=-2.0)
    for (_, _, X, _), (_, _, Y, _) in zip(hall_parts(robot), hall_parts(lower), strict=True):
        assert X.translation() - Y.translation() == pytest.approx([0.0, 0.0, 2.0])


# --- numbers


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.0823, "0.0823"), (1.0, "1"), (2.649, "2.65"), (447.6, "448"),
     (999.7, "1000"), (30091.8, "30092"), (np.inf, "inf")],
)  # fmt: skip
def test_digits_that_mean_something(value: float, text: str) -> None:
    assert significant(value) == text


@given(st.floats(1e-6, 1e6))
def test_decimals_show_three_digits(largest: float) -> None:
    digits = decimals(largest)
    assert largest * 10.0**digits >= 99.9
    assert digits == 0 or largest * 10.0**digits < 1000.1


@given(st.floats(1e-6, 1e6))
def test_round_steps(length: float) -> None:
    step = round_step(length)
    assert length * (1 - 1e-9) <= step <= 2.5 * length * (1 + 1e-9)
    assert f"{step:.0e}"[0] in "125" and float(f"{step:.0e}") == pytest.approx(step)


# --- no drawing costs a run


def test_a_drawing_that_fails_is_told_of_and_the_run_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*args: object, **kwargs: object) -> None:
        raise RuntimeError("no\nink")

    monkeypatch.setattr("cdpr_drake.show.plots.sag_figure", fail)
    monkeypatch.setattr("cdpr_drake.show.replay.write_replay", fail)
    out = tmp_path / "out"
    argv = ["run", "--test", "4", "--until", "0.5", "--cable-model", "SCMWE", "--controller", "vbc"]
    assert main([*argv, "--output", str(out)]) == 0
    told = capsys.readouterr()
    for name in ("sag.png", "replay.html"):
        assert f"warning: {name} is not drawn: no ink" in told.err
    assert "tension.png" in told.out and "sag.png" not in told.out
    summary = json.loads((out / "summary.json").read_text())
    assert summary["not_drawn"] == {"sag.png": "no ink", "replay.html": "no ink"}
    assert {file.name for file in out.iterdir()} == set(summary["files"])
    assert {"vbc-scmwe.csv", "tension.png"} <= set(summary["files"])


def test_an_answer_without_its_figure_is_an_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*args: object, **kwargs: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("cdpr_drake.show.rates_and_responses_figure", fail)
    argv = ["coupling", "--robot", "cogiro", "--output", str(tmp_path / "out")]
    assert main(argv) == 0
    told = capsys.readouterr()
    assert "rates_and_responses.png is not drawn: ZeroDivisionError" in told.err
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["files"] == ["summary.json"] and summary["rows"]


# --- the command


def test_the_explorer_begins_in_the_room_and_takes_a_rule(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    seen: list[Any] = []

    class Short(Explorer):
        def run(self, idle: float = 0.0) -> str:
            seen.append(self.snapshot)
            return "seen"

    monkeypatch.setattr("cdpr_drake.show.explorer.Explorer", Short)
    save_robot(make("one cable"), tmp_path / "one.yaml")
    assert main(["explore", "--robot", str(tmp_path / "one.yaml")]) == 0
    assert "(0.00, 0.00, 1.50) m" in capsys.readouterr().out
    box = str(Path(__file__).parent / "outside" / "box.yaml")
    for rule in ("minimum-norm-within-limits", "within-limits"):
        assert main(["explore", "--robot", box, "--tensions", rule]) == 0
    least, middle = (snapshot.answers.tension for snapshot in seen[1:])
    assert least.max() < 500.0 < middle.mean()
    assert main(["explore", "--tensions", "none"]) == 2
    assert 'unknown rule "none"' in capsys.readouterr().err
