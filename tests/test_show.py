"""Figures show what was recorded; replays and block diagrams hold what they should."""

from __future__ import annotations

import base64
import json
import re
import struct
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Gain

from cdpr_drake.diagrams import (
    Record,
    make_joint_space_control,
    make_vision_based_control,
    rest_context,
    simulate,
)
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.rotations import vector_to_pose
from cdpr_drake.model.servo import pose_error
from cdpr_drake.show import (
    BrowserError,
    GraphvizError,
    block_diagram,
    block_diagram_dot,
    cable_sag,
    error_norm_figure,
    motor_rate_figure,
    pose_error_figure,
    sag_figure,
    save_figures,
    screenshot_replay,
    tension_figure,
    write_replay,
)
from cdpr_drake.show.plots import spread
from cdpr_drake.show.replay import cable_shapes, default_speed, frame_times, nearest
from cdpr_drake.show.scene import bar_pose

START = [0.0, 0.0, 0.0, -1.38, -0.93, 0.3]
GOAL = [0.1, 0.05, -0.1, -2.2, -0.6, 1.7]
GAIN = 0.3
K = 8


@pytest.fixture(scope="module")
def robot() -> CableRobot:
    return load_robot("cogiro")


@pytest.fixture(scope="module")
def runs(robot: CableRobot) -> dict[str, Record]:
    loop = make_vision_based_control(robot, gain=GAIN, noise=True)
    records = {}
    for label, seed in (("first", 1), ("second", 2)):
        context = rest_context(loop, START, seed=seed)
        loop.GetInputPort("desired_pose").FixValue(context, GOAL)
        records[label] = simulate(loop, context, 2.0, every=0.1)
    return records


@pytest.fixture(scope="module")
def run(runs: dict[str, Record]) -> Record:
    return runs["first"]


def labelled(axes: Any, start: str = "") -> dict[str, np.ndarray]:
    """Return the y data of the lines in a panel that a legend would name, by label."""
    lines = [line for line in axes.get_lines() if not line.get_label().startswith("_")]
    return {i.get_label(): i.get_ydata() for i in lines if i.get_label().startswith(start)}


def texts(axes: Any) -> list[str]:
    return [text.get_text() for text in axes.texts]


def altered(run: Record, **signals: np.ndarray) -> Record:
    return replace(run, signals={**run.signals, **signals})


# --- figures


def test_pose_error_shows_each_component_of_each_run(runs: dict[str, Record]) -> None:
    panels = pose_error_figure(runs).axes
    assert len(panels) == 6
    for i, axes in enumerate(panels):
        shown = labelled(axes)
        assert list(shown) == list(runs)
        for label, record in runs.items():
            s = record["pose_error"]
            expected = 1e3 * s[:, 3 + i] if i < 3 else np.degrees(s[:, i - 3])
            assert_array_equal(shown[label], expected)
    assert [a.get_title() for a in panels[:3]] == [f"translation {c}" for c in "xyz"]
    assert [a.get_title() for a in panels[3:]] == [f"rotation {c}" for c in "xyz"]
    assert "[mm]" in panels[0].get_ylabel() and "[deg]" in panels[3].get_ylabel()
    assert all(axes.get_xlabel() == "time [s]" for axes in panels[3:])


def test_pose_error_tells_the_last_values(run: Record) -> None:
    panels = pose_error_figure({"one": run}).axes
    mm, deg = 1e3 * run["pose_error"][-1, 5], np.degrees(run["pose_error"][-1, 0])
    assert f"{mm:+.1f} mm".replace("-", "−") in texts(panels[2])
    assert f"{deg:+.2f}°".replace("-", "−") in texts(panels[3])


def test_pose_error_to_a_goal_is_taken_from_the_pose(robot: CableRobot, run: Record) -> None:
    moving = altered(run, pose_error=np.zeros_like(run["pose_error"]))
    panels = pose_error_figure({"one": moving}, robot, GOAL).axes
    expected = [1e3 * pose_error(p, GOAL, robot.cameras.X_PM)[5] for p in run["pose"]]
    assert_array_equal(labelled(panels[2])["one"], expected)
    with pytest.raises(ValueError, match="needs the robot"):
        pose_error_figure({"one": run}, goal=GOAL)


def test_error_norms_and_reference_slope(runs: dict[str, Record]) -> None:
    for axes, part, unit in zip(
        error_norm_figure(runs, GAIN).axes,
        (slice(3, 6), slice(0, 3)),
        (1e3, np.degrees(1.0)),
        strict=True,
    ):
        assert axes.get_yscale() == "log"
        reference, *shown = labelled(axes).values()
        for values, record in zip(shown, runs.values(), strict=True):
            norm = np.linalg.norm(record["pose_error"][:, part], axis=1)
            assert_allclose(values, unit * norm, rtol=1e-12)
        time = runs["first"].time
        assert_allclose(np.diff(np.log(reference)) / np.diff(time), -GAIN, rtol=1e-9)
        assert reference[0] == shown[0][0]
        assert f"{-GAIN:g}" in next(iter(labelled(axes)))


def test_error_norm_without_gain_has_no_reference(runs: dict[str, Record]) -> None:
    assert list(labelled(error_norm_figure(runs).axes[0])) == list(runs)


def test_an_error_of_zero_can_be_drawn(run: Record) -> None:
    still = altered(run, pose_error=np.zeros_like(run["pose_error"]))
    error_norm_figure({"still": still}, GAIN).canvas.draw()


@pytest.mark.parametrize(
    ("figure", "signal", "unit"),
    [
        (tension_figure, "tension_at_drawing_point", "[N]"),
        (lambda runs, robot: motor_rate_figure(runs), "motor_rates", "[rad/s]"),
    ],
)
def test_cable_signals_have_a_panel_for_each_run(
    runs: dict[str, Record], robot: CableRobot, figure: Any, signal: str, unit: str
) -> None:
    panels = figure(runs, robot).axes
    assert [axes.get_title() for axes in panels] == list(runs)
    assert unit in panels[0].get_ylabel()
    for axes, record in zip(panels, runs.values(), strict=True):
        shown = labelled(axes, "cable ")
        assert list(shown) == [f"cable {i}" for i in range(1, K + 1)]
        assert_array_equal(np.array(list(shown.values())).T, record[signal])


def test_tension_limits_are_drawn_or_noted(robot: CableRobot, run: Record) -> None:
    def horizontal(axes: Any) -> set[float]:
        return {line.get_ydata()[0] for line in axes.get_lines() if len(line.get_ydata()) == 2}

    axes = tension_figure({"one": run}, robot).axes[0]
    assert robot.cable.min_tension in horizontal(axes)
    assert robot.cable.max_tension not in horizontal(axes)
    assert any("upper limit 5000 N, out of view" in text for text in texts(axes))
    weak = robot.replace(cable=robot.cable.replace(max_tension=450.0))
    axes = tension_figure({"one": run}, weak).axes[0]
    assert {robot.cable.min_tension, 450.0} <= horizontal(axes)
    assert axes.get_ylim()[1] > 450.0


def test_cables_are_numbered_at_the_ends_of_their_lines(robot: CableRobot, run: Record) -> None:
    axes = tension_figure({"one": run}, robot).axes[0]
    heights = {t.get_text(): t.get_position()[1] for t in axes.texts if t.get_text().isdigit()}
    assert sorted(heights) == [str(i) for i in range(1, K + 1)]
    by_height = sorted(range(K), key=lambda i: heights[str(i + 1)])
    assert by_height == np.argsort(run["tension_at_drawing_point"][-1]).tolist()


def test_sag_figure_shows_dbeta_and_sag(runs: dict[str, Record], robot: CableRobot) -> None:
    panels = sag_figure(runs, robot).axes
    assert "[deg]" in panels[0].get_ylabel() and "[mm]" in panels[2].get_ylabel()
    for i, record in enumerate(runs.values()):
        upper = np.array(list(labelled(panels[i], "cable ").values())).T
        assert_allclose(upper, np.degrees(record["dbeta"]), rtol=1e-12)
        lower = np.array(list(labelled(panels[2 + i], "cable ").values())).T
        assert_allclose(lower, 1e3 * cable_sag(record, robot), rtol=1e-12)


def test_sag_is_the_largest_distance_of_the_drawn_shape_from_its_chord(
    robot: CableRobot, run: Record
) -> None:
    shape = cable_shapes(robot, run["pose"][:1], run["unstrained_length"][:1], 801)[0]
    along = np.linalg.norm(shape[..., :2] - shape[:, :1, :2], axis=-1)
    chord = shape[:, :1, 2] + (shape[:, -1:, 2] - shape[:, :1, 2]) * along / along[:, -1:]
    # The figure's catenary does not stretch, the drawn one does, by T / EA of about 1e-3.
    assert_allclose(cable_sag(run, robot)[0], (chord - shape[..., 2]).max(axis=1), rtol=2e-3)


def test_a_slack_cable_has_no_sag(robot: CableRobot, run: Record) -> None:
    tension = run["tension_at_drawing_point"].copy()
    tension[:, 2] = 0.0
    slack = altered(run, tension_at_drawing_point=tension)
    depth = cable_sag(slack, robot)
    assert np.isnan(depth[:, 2]).all() and np.isfinite(np.delete(depth, 2, axis=1)).all()
    sag_figure({"slack": slack}, robot).canvas.draw()


def test_save_figures_writes_small_files(
    runs: dict[str, Record], robot: CableRobot, tmp_path: Path
) -> None:
    paths = save_figures(runs, robot, tmp_path / "new", gain=GAIN)
    names = ["pose_error.png", "error_norm.png", "tension.png", "sag.png", "motor_rate.png"]
    assert [path.name for path in paths] == names
    for path in paths:
        assert path.read_bytes().startswith(b"\x89PNG")
        assert path.stat().st_size < 200_000


def test_figures_leave_pyplot_and_matplotlib_alone() -> None:
    code = """if True:
        import sys
        import cdpr_drake.show as show
        assert "matplotlib" not in sys.modules
        import numpy as np
        class Run:
            time = np.arange(3.0)
            def __getitem__(self, name):
                return np.ones((3, 8))
        show.motor_rate_figure({"run": Run()}).canvas.draw()
        assert "matplotlib.figure" in sys.modules and "matplotlib.pyplot" not in sys.modules
    """
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_no_runs_are_refused(robot: CableRobot) -> None:
    for figure in (pose_error_figure, error_norm_figure, motor_rate_figure):
        with pytest.raises(ValueError, match="no runs"):
            figure({})
    with pytest.raises(ValueError, match="no runs"):
        tension_figure({}, robot)


@given(st.lists(st.floats(-1.0, 2.0), min_size=1, max_size=10))
def test_spread_keeps_order_distance_and_mean(heights: list[float]) -> None:
    before = np.array(heights)
    after = spread(before, 0.05)
    order = np.argsort(before, kind="stable")
    assert np.all(np.diff(after[order]) >= 0.05 - 1e-12)
    assert_allclose(after.mean(), before.mean(), atol=1e-12)
    if np.all(np.diff(before[order]) >= 0.05):
        assert_allclose(after, before, atol=1e-12)


# --- replay: what its frames hold


@pytest.mark.parametrize(
    ("duration", "speed"), [(5.0, 1.0), (20.0, 1.0), (20.1, 2.0), (80.0, 4.0), (200.0, 10.0)]
)
def test_long_runs_are_shown_faster(duration: float, speed: float) -> None:
    assert default_speed(np.array([3.0, 3.0 + duration])) == speed


def test_frames_reach_from_start_to_end() -> None:
    frames = frame_times(np.array([1.0, 2.0, 6.05]), 2.0, 10)
    assert_allclose(frames[:3], [1.0, 1.2, 1.4])
    assert frames[-1] == 6.05 and frames[-2] < 6.05 and len(frames) == 27


@pytest.mark.parametrize(("speed", "rate"), [(0.0, 10), (-1.0, 10), (np.nan, 10), (1.0, 0)])
def test_a_pace_that_is_none_is_refused(speed: float, rate: int) -> None:
    with pytest.raises(ValueError, match="must be positive"):
        frame_times(np.array([0.0, 1.0]), speed, rate)


def test_nearest_sample() -> None:
    time = np.array([0.0, 1.0, 2.0, 4.0])
    wanted = np.array([-1.0, 0.0, 0.4, 0.6, 2.9, 3.1, 9.0])
    assert nearest(time, wanted).tolist() == [0, 0, 0, 1, 2, 3, 3]


def test_cable_shapes_join_drawing_and_attachment_points(robot: CableRobot, run: Record) -> None:
    shapes = cable_shapes(robot, run["pose"], run["unstrained_length"])
    for shape, pose in zip(shapes, run["pose"], strict=True):
        p_WB = (vector_to_pose(pose) @ robot.attachment_points.T).T
        assert_allclose(shape[:, 0], robot.drawing_points, atol=1e-9)
        assert_allclose(shape[:, -1], p_WB, atol=1e-6)
        middle = 0.5 * (shape[:, 0] + shape[:, -1])
        assert np.all(shape[:, shape.shape[1] // 2, 2] < middle[:, 2])


def test_bar_pose_lies_along_the_bar() -> None:
    X, length = bar_pose([1.0, 2.0, 3.0], [1.0, 5.0, -1.0])
    assert length == pytest.approx(5.0)
    assert_allclose(X.translation(), [1.0, 3.5, 1.0])
    assert_allclose(X.rotation().matrix()[:, 2], [0.0, 0.6, -0.8], atol=1e-12)


class Unpacker:
    """Enough of MessagePack to read what Meshcat writes."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def number(self, form: str) -> Any:
        value = struct.unpack_from(">" + form, self.data, self.at)[0]
        self.at += struct.calcsize(form)
        return value

    def text(self, size: int) -> str:
        self.at += size
        return self.data[self.at - size : self.at].decode()

    def items(self, size: int) -> list[Any]:
        return [self.read() for _ in range(size)]

    def mapping(self, size: int) -> dict[str, Any]:
        return {self.read(): self.read() for _ in range(size)}

    def read(self) -> Any:
        tag = self.number("B")
        constants = {0xC0: None, 0xC2: False, 0xC3: True}
        numbers = dict(zip(range(0xCA, 0xD4), "fdBHIQbhiq", strict=True))
        sizes = {0xD9: "B", 0xDA: "H", 0xDB: "I", 0xDC: "H", 0xDD: "I", 0xDE: "H", 0xDF: "I"}
        if tag < 0x80:
            return tag
        if tag < 0x90:
            return self.mapping(tag & 0x0F)
        if tag < 0xA0:
            return self.items(tag & 0x0F)
        if tag < 0xC0:
            return self.text(tag & 0x1F)
        if tag in constants:
            return constants[tag]
        if tag in numbers:
            return self.number(numbers[tag])
        if tag in sizes:
            size = self.number(sizes[tag])
            kinds = (self.text, self.items, self.mapping)
            return kinds[(tag >= 0xDC) + (tag >= 0xDE)](size)
        if tag >= 0xE0:
            return tag - 0x100
        raise ValueError(f"unexpected MessagePack tag {tag:#x}")


def animation(page: str) -> dict[str, Any]:
    """Return the animation in a page: for each path its tracks, each a dict of frame to value."""
    messages = re.findall(r'fetch\("data:application/octet-binary;base64,([^"]*)"\)', page)
    (data,) = [d for d in map(base64.b64decode, messages) if d[:30].find(b"set_animation") > 0]
    message = Unpacker(data).read()
    clips: dict[str, Any] = {"options": message["options"]}
    for entry in message["animations"]:
        clip = entry["clip"]
        assert clip["fps"] == 10
        clips[entry["path"]] = {
            track["name"]: {key["time"]: key["value"] for key in track["keys"]}
            for track in clip["tracks"]
        }
    return clips


@pytest.fixture(scope="module")
def replay(
    robot: CableRobot, runs: dict[str, Record], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    path = tmp_path_factory.mktemp("replay") / "replay.html"
    others = {"another <run>": runs["second"]}
    title = 'A "title" & </script>'
    assert write_replay(path, robot, runs["first"], GOAL, others=others, title=title) == path
    return path


@pytest.fixture(scope="module")
def page(replay: Path) -> str:
    return replay.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def clips(page: str) -> dict[str, Any]:
    return animation(page)


FRAMES = 21  # 2 s at 10 frames per second


def test_platforms_move_as_recorded(clips: dict[str, Any], runs: dict[str, Record]) -> None:
    for path, record in zip(("/run", "/other1"), runs.values(), strict=True):
        track = clips[f"{path}/platform"][".position"]
        assert list(track) == list(range(FRAMES))
        assert_allclose(list(track.values()), record["pose"][:, 3:], atol=1e-12)
        for x_y_z_w, pose in zip(
            clips[f"{path}/platform"][".quaternion"].values(), record["pose"], strict=True
        ):
            q = vector_to_pose(pose).rotation().ToQuaternion()
            assert abs(np.dot(x_y_z_w, [q.x(), q.y(), q.z(), q.w()])) == pytest.approx(1.0)


def test_cables_are_recorded_bars(clips: dict[str, Any], robot: CableRobot, run: Record) -> None:
    shapes = cable_shapes(robot, run["pose"], run["unstrained_length"])
    for cable in range(K):
        for segment in range(shapes.shape[2] - 1):
            tracks = clips[f"/run/cable{cable + 1}/{segment + 1}"]
            ends = shapes[:, cable, segment : segment + 2]
            lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
            assert_allclose(list(tracks[".position"].values()), ends.mean(axis=1), atol=1e-12)
            scales = np.array(list(tracks[".scale"].values()))
            assert_allclose(scales, np.column_stack([np.ones((FRAMES, 2)), lengths]), atol=1e-12)


def test_cable_colours_follow_tension(clips: dict[str, Any], page: str, run: Record) -> None:
    data = legend(page)
    colours = np.array([[int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in data["colours"]]) / 255
    tension = run["tension_at_drawing_point"]
    for cable in range(K):
        keys = clips[f"/run/cable{cable + 1}/1/<object>"][".material.color"]
        assert {0, FRAMES - 1} <= set(keys)
        for frame, linear in keys.items():
            linear = np.array(linear)
            srgb = np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
            part = (tension[frame, cable] - data["low"]) / (data["high"] - data["low"])
            scale = np.linspace(0.0, 1.0, len(colours))
            expected = [np.interp(part, scale, colours[:, i]) for i in range(3)]
            assert_allclose(srgb, expected, atol=0.02)  # the legend's scale has 17 colours only


def test_all_tracks_end_together_or_they_would_loop_apart(clips: dict[str, Any]) -> None:
    for path, tracks in clips.items():
        if path != "options":
            assert {max(track) for track in tracks.values()} == {FRAMES - 1}
    assert clips["options"]["play"] is True


def legend(page: str) -> dict[str, Any]:
    (text,) = re.findall(r'<script type="application/json" id="replay-data">(.*?)</script>', page)
    return json.loads(text)


def test_legend_holds_the_values_of_each_frame(page: str, robot: CableRobot, run: Record) -> None:
    data = legend(page)
    assert_allclose(data["time"], run.time, atol=1e-3)
    assert_array_equal(data["tension"], np.rint(run["tension_at_drawing_point"]))
    assert data["low"] <= run["tension_at_drawing_point"].min()
    assert data["high"] >= run["tension_at_drawing_point"].max()
    s = [pose_error(pose, GOAL, robot.cameras.X_PM) for pose in run["pose"]]
    expected = [f"{1e3 * np.linalg.norm(e[3:]):.1f}" for e in s]
    assert data["position"] == expected
    assert "another &lt;run&gt;" in page and "another <run>" not in page
    assert "<title>A &quot;title&quot; &amp; &lt;/script&gt;</title>" in page


def test_page_needs_nothing_from_elsewhere(page: str) -> None:
    addresses = []

    class Addresses(HTMLParser):
        def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            addresses.extend(value for name, value in attrs if name in ("src", "href"))

    Addresses().feed(page)
    assert not [a for a in addresses if a and not a.startswith("data:")]
    assert not re.findall(r"""\bfetch\(\s*["'`](?!data:)""", page)
    assert "://" not in added_to(page) and "@import" not in added_to(page)


def added_to(page: str) -> str:
    """Return what comes after Meshcat's own page: the legend, its data and script."""
    return page[page.index("<style>\n#replay") :]


def test_a_replay_of_80_s_stays_small(robot: CableRobot, run: Record, tmp_path: Path) -> None:
    repeat = 40
    signals = {name: np.tile(values, (repeat, 1)) for name, values in run.signals.items()}
    long = replace(run, time=np.linspace(0.0, 80.0, repeat * len(run.time)), signals=signals)
    path = write_replay(tmp_path / "long.html", robot, long)
    assert path.stat().st_size < 6_000_000
    clips = animation(path.read_text(encoding="utf-8"))
    assert len(clips["/run/platform"][".position"]) == 201
    assert legend(path.read_text(encoding="utf-8"))["speed"] == 4.0


def test_payload_goal_and_point_loads_are_optional(
    robot: CableRobot, run: Record, tmp_path: Path
) -> None:
    def card(robot: CableRobot) -> str:
        path = write_replay(tmp_path / "replay.html", robot, run, speed=10.0)
        return added_to(path.read_text(encoding="utf-8"))

    bare = card(robot)
    assert "Distance to the goal" not in bare and "payload" not in bare
    assert "payload, 110 kg" in card(robot.with_payload(110.0))
    assert "payload, 20 kg" in card(robot.with_payload(20.0, inertia=np.zeros((3, 3))))


def test_a_record_that_lacks_something_is_refused(
    robot: CableRobot, run: Record, tmp_path: Path
) -> None:
    def without(name: str) -> Record:
        return replace(run, signals={n: v for n, v in run.signals.items() if n != name})

    path = tmp_path / "replay.html"
    with pytest.raises(ValueError, match='"unstrained_length"'):
        write_replay(path, robot, without("unstrained_length"))
    with pytest.raises(ValueError, match='JSC: no signal "pose"'):
        write_replay(path, robot, run, others={"JSC": without("pose")})
    with pytest.raises(ValueError, match="two at least"):
        write_replay(path, robot, replace(run, time=run.time[:1]))
    assert not path.exists()


# --- replay: what a browser makes of it


def test_a_missing_browser_or_page_is_named(replay: Path, tmp_path: Path) -> None:
    with pytest.raises(BrowserError, match="no-such-browser"):
        screenshot_replay(replay, tmp_path / "x.png", browser="no-such-browser")
    with pytest.raises(FileNotFoundError):
        screenshot_replay(tmp_path / "none.html", tmp_path / "x.png")


@pytest.mark.render
@pytest.mark.needs("chromium")
def test_a_browser_shows_the_robot_at_the_time_asked_for(replay: Path, tmp_path: Path) -> None:
    from matplotlib.image import imread

    pictures = []
    for at_time in (0.0, 2.0):
        path = screenshot_replay(replay, tmp_path / "x.png", at_time, width=800, height=500)
        pictures.append((255 * imread(path)[..., :3]).round().astype(int))
    scene = [picture[:, 300:] for picture in pictures]  # right of the legend
    assert scene[0].shape == (500, 500, 3)
    for picture in scene:
        assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 300
        red, green, blue = np.moveaxis(picture, -1, 0)
        cables = (red > green + 60) & (blue > green + 30)  # the purple of the scale's middle
        goal = (green > red + 30) & (green > blue + 10)
        assert cables.sum() > 300 and goal.sum() > 100
    assert (np.abs(scene[0] - scene[1]).max(axis=-1) > 30).sum() > 300


# --- block diagrams


@pytest.fixture(scope="module")
def loop_dot(robot: CableRobot) -> str:
    return block_diagram_dot(make_vision_based_control(robot))


def test_blocks_ports_and_sizes_are_in_the_diagram(loop_dot: str) -> None:
    for block in ("servo", "held_rates", "robot", "camera", "plausible_tension"):
        assert f'\n"{block}" [label=<' in loop_dot
    for port in ("measured_tangents [24]", "motor_rates [8]", "measured_tension [8]"):
        assert f">{port}<" in loop_dot or f"<B>{port.replace(' ', '</B> ')}<" in loop_dot
    assert '\n"input: desired_pose" [' in loop_dot
    assert "<B>commanded_motor_rates</B> [8]" in loop_dot  # an output's name in the loop


def test_every_connection_is_drawn_once(robot: CableRobot, loop_dot: str) -> None:
    loop = make_vision_based_control(robot)
    inside = len(loop.connection_map())
    inputs = loop.num_input_ports() + 1  # the desired pose enters two blocks
    assert loop_dot.count(" -> ") == inside + inputs


def test_feedback_runs_backwards(loop_dot: str) -> None:
    backward = re.findall(r'\n"(.*?)"\S* -> "(.*?)"\S* \[dir=back\]', loop_dot)
    assert ("servo", "sampled_pose") in backward and ("camera", "robot") in backward
    forward = re.findall(r'\n"(.*?)"\S* -> "(.*?)"\S* \[weight', loop_dot)
    assert {("servo", "held_rates"), ("held_rates", "robot")} <= set(forward)


def test_a_loop_without_feedback_and_a_foreign_diagram(robot: CableRobot) -> None:
    assert "dir=back" not in block_diagram_dot(make_joint_space_control(robot))
    builder = DiagramBuilder()
    gain = builder.AddNamedSystem('a "gain" {<1>}', Gain(2.0, 3))
    builder.ExportOutput(gain.get_output_port(), "twice")
    text = block_diagram_dot(builder.Build())
    assert "<B>twice</B> [3]" in text and "a &quot;gain&quot; {&lt;1&gt;}" in text


@pytest.mark.needs("graphviz")
@pytest.mark.parametrize("suffix", ["svg", "png", "dot"])
def test_block_diagram_is_written(robot: CableRobot, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"loop.{suffix}"
    assert block_diagram(make_vision_based_control(robot), path) == path
    if suffix == "png":
        assert path.read_bytes().startswith(b"\x89PNG")
    else:
        assert "measured_tangents" in path.read_text(encoding="utf-8")


@pytest.mark.needs("graphviz")
def test_a_format_unknown_to_dot_is_named(robot: CableRobot, tmp_path: Path) -> None:
    with pytest.raises(GraphvizError, match="nonsense"):
        block_diagram(make_joint_space_control(robot), tmp_path / "loop.nonsense")


def test_missing_dot_is_named(
    robot: CableRobot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(GraphvizError, match="not installed"):
        block_diagram(make_joint_space_control(robot), tmp_path / "loop.svg")
