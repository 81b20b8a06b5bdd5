"""Exploring a robot: what is told at a pose, and the page with sliders that tells it."""

from __future__ import annotations

import os
import re
import signal
import struct
import subprocess
import sys
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import find_chromium, heed_interrupts

from cdpr_drake.__main__ import main
from cdpr_drake.analysis import gain_limit, gain_matrix, platform_modes
from cdpr_drake.analysis.explore import Snapshot, explore_pose
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.show.explore_page import HOST, explore_page, panel_html
from cdpr_drake.show.explorer import GAIN, PAYLOAD, STOP, Explorer

POSE = [0.0, 0.0, 0.3, -2.2, -0.6, 1.7]
PIECES = ("/platform", "/refused")
SHORT_OF_CABLES = [0.0, 0.0, 0.0, 6.0, 5.0, 4.0]


@pytest.fixture(scope="module")
def robot(cogiro: CableRobot) -> CableRobot:
    """CoGiRo with 50 kg to carry."""
    return cogiro.with_payload(50.0)


# --- what is told at a pose


@pytest.mark.parametrize("model", ["SCMWE", "SLSM"])
def test_a_snapshot_tells_what_the_single_questions_answer(robot: CableRobot, model: str) -> None:
    answers = explore_pose(robot, POSE, model).answers
    assert answers is not None
    gamma = gain_matrix(robot, None, POSE, model)
    assert answers.gamma.matrix == pytest.approx(gamma.matrix, abs=1e-14)
    assert answers.rates == pytest.approx(
        (gamma.eigenvalues.real[0], gamma.eigenvalues.real[-1]), rel=1e-12
    )
    assert answers.tension == pytest.approx(rest_state(robot, POSE).tension_at_drawing_point)
    found = platform_modes(robot, POSE, "controlled")
    ours = [mode.eigenvalue for mode in answers.modes.modes]
    assert ours == pytest.approx([mode.eigenvalue for mode in found.modes], rel=1e-9)


def test_the_lowest_modes_are_those_of_the_platform_by_frequency(robot: CableRobot) -> None:
    answers = explore_pose(robot, POSE).answers
    assert answers is not None
    names = [answers.modes.name(mode) for mode in answers.lowest(6)]
    assert len(set(names)) == 6 and all(name.startswith("platform/") for name in names)
    frequencies = [mode.frequency for mode in answers.lowest(6)]
    assert frequencies == sorted(frequencies)
    locked = sorted(mode.frequency for mode in platform_modes(robot, POSE).modes)
    assert frequencies == pytest.approx(locked, rel=0.05)  # the winches give a little
    assert frequencies != pytest.approx(locked, rel=1e-3)


def test_motion_aside_is_what_a_move_along_an_axis_has_across_it(robot: CableRobot) -> None:
    answers = explore_pose(robot, POSE, "SLSM").answers
    assert answers is not None
    across = []
    for axis in range(3):
        had = answers.gamma.matrix @ np.eye(6)[3 + axis]
        across.append(np.linalg.norm(np.delete(had[3:], axis)))
    assert answers.aside == pytest.approx(max(across), rel=1e-12)
    assert answers.aside > 1e-4


def test_a_gain_is_called_unstable_from_the_gain_limit_on(robot: CableRobot) -> None:
    cameras = robot.cameras
    limit = gain_limit(robot, POSE, cameras.latency, cameras.sample_time)
    below = explore_pose(robot, POSE, gain=0.99 * limit.gain).answers
    above = explore_pose(robot, POSE, gain=1.01 * limit.gain).answers
    assert below is not None and above is not None
    assert below.unstable == ""
    assert above.unstable == f"{limit.mode} at {limit.frequency:.2g} Hz"


def test_cables_outside_of_their_limits_are_named(robot: CableRobot) -> None:
    rule = "minimum norm"
    tension = rest_state(robot, POSE, rule).tension_at_drawing_point
    order = np.sort(tension)
    cable = robot.cable.replace(
        min_tension=float(order[:2].mean()), max_tension=float(order[-2:].mean())
    )
    snapshot = explore_pose(robot.replace(cable=cable), POSE, tensions=rule)
    assert snapshot.answers is not None
    expected = sorted([int(np.argmin(tension)) + 1, int(np.argmax(tension)) + 1])
    assert snapshot.answers.out_of_limits() == expected
    assert f"cable {expected[0]}, {expected[1]}." in panel_html(snapshot, (0.0, 1000.0))
    inside = explore_pose(robot, POSE).answers
    assert inside is not None and inside.out_of_limits() == []


@pytest.mark.parametrize(
    ("pose", "reason"),
    [
        (SHORT_OF_CABLES, "cable 8 would bear -"),
        ([0, 0, 0, 30, 0, 1], "outside the hull of the drawing points"),
        ([0, np.pi / 2, 0, 0, 0, 1], "within 5 deg of 90"),
        ([0, 0, 0, 0, 0, 5.4], "outside the wrench-feasible workspace"),
    ],
)
def test_a_pose_beyond_the_workspace_is_told_of_not_raised(
    robot: CableRobot, pose: list[float], reason: str
) -> None:
    snapshot = explore_pose(robot, pose)
    assert snapshot.answers is None
    assert reason in snapshot.reason
    assert "cannot rest here" in panel_html(snapshot, (0.0, 1.0))


def test_a_wrong_question_is_an_error(robot: CableRobot) -> None:
    with pytest.raises(ValueError, match="unknown cable model"):
        explore_pose(robot, POSE, "XYZ")
    for gain in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="gain must be positive"):
            explore_pose(robot, POSE, gain=gain)
    with pytest.raises(ValueError, match="six finite numbers"):
        explore_pose(robot, [0, 0, 0, np.nan, 0, 1])
    with pytest.raises(ValueError, match="rule"):
        explore_pose(robot, POSE, tensions="any")


def test_the_panel_has_the_numbers_and_escapes_names(robot: CableRobot) -> None:
    snapshot = explore_pose(robot.replace(name="<b>"), POSE, gain=4.0)
    assert snapshot.answers is not None
    text = panel_html(snapshot, (0.0, 1000.0))
    assert "&lt;b&gt;, 150 kg" in text and "<b>" not in text.replace("<b>The", "")
    for value in snapshot.answers.tension:
        assert f"{value:.0f} N" in text
    assert f"{snapshot.answers.rates[0]:.4f}" in text
    assert f"Unstable at &lambda; = 4/s: {snapshot.answers.unstable}." in text


# --- the page


@pytest.fixture
def explorer(robot: CableRobot) -> Iterator[Explorer]:
    made = Explorer(robot, POSE)
    yield made
    made.close()


def get(address: str, path: str) -> tuple[int, str]:
    """Return status and text of a path of the page's server."""
    host, port = re.fullmatch(r"http://([\d.]+):(\d+)/", address).groups()  # type: ignore[union-attr]
    connection = HTTPConnection(host, int(port), timeout=30)
    connection.request("GET", path)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, text


def click(explorer: Explorer, button: str) -> None:
    """Tell Meshcat, as a browser does in MessagePack, that a button was clicked."""
    parts = ("type", "button", "name", button)
    message = b"\x82" + b"".join(bytes([0xA0 + len(part)]) + part.encode() for part in parts)
    explorer.meshcat._InjectWebsocketMessage(message=message)


def transform(explorer: Explorer, path: str) -> np.ndarray:
    """Return the transform (4, 4) that Meshcat holds, from its MessagePack."""
    packed = explorer.meshcat._GetPackedTransform(path)
    assert packed[-153:-147] == b"matrix"
    values = struct.unpack(">" + 16 * "xd", packed[-144:])  # columns first, a byte before each
    return np.array(values).reshape(4, 4).T


def is_visible(explorer: Explorer, path: str) -> bool:
    """Whether Meshcat was told to show what is at a path."""
    packed = explorer.meshcat._GetPackedProperty(path, "visible")
    return {0xC3: True, 0xC2: False}[packed[-1]]


def test_moving_a_slider_changes_snapshot_drawing_and_page(
    explorer: Explorer, robot: CableRobot
) -> None:
    assert not explorer.update()  # nothing has moved
    explorer.meshcat.SetSliderValue("x [m]", 1.25)
    explorer.meshcat.SetSliderValue("yaw [deg]", -20.0)
    explorer.meshcat.SetSliderValue(PAYLOAD, 200.0)
    assert explorer.update()
    pose = explorer.snapshot.pose
    assert pose.translation() == pytest.approx([1.25, -0.6, 1.7])
    assert pose.rotation().ToRollPitchYaw().yaw_angle() == pytest.approx(np.radians(-20.0))
    expected = explore_pose(robot.with_payload(200.0), pose)
    assert explorer.snapshot.answers is not None and expected.answers is not None
    assert explorer.snapshot.answers.tension == pytest.approx(expected.answers.tension)
    assert transform(explorer, "/platform") == pytest.approx(pose.GetAsMatrix4(), abs=1e-12)
    status, panel = get(explorer.address, "/panel")
    assert status == 200 and "300 kg" in panel
    assert f"{expected.answers.tension[0]:.0f} N" in panel


def test_the_bars_of_a_cable_reach_from_drawing_to_attachment_point(
    explorer: Explorer, robot: CableRobot
) -> None:
    ends = explorer.snapshot.pose @ robot.attachment_points.T
    for cable in (0, 5):
        first, last = (transform(explorer, f"/cables/{cable + 1}/{i}") for i in (1, 8))
        chord = np.linalg.norm(ends[:, cable] - robot.drawing_points[cable])
        half = chord / 16.0
        start = first[:3, 3] - half * first[:3, 2]
        end = last[:3, 3] + half * last[:3, 2]
        assert np.linalg.norm(start - robot.drawing_points[cable]) < 0.01 * chord
        assert np.linalg.norm(end - ends[:, cable]) < 0.01 * chord


def test_beyond_the_workspace_the_page_says_so_and_comes_back(explorer: Explorer) -> None:
    for name, value in zip(("x [m]", "y [m]", "z [m]"), SHORT_OF_CABLES[3:], strict=True):
        explorer.meshcat.SetSliderValue(name, value)
    explorer.meshcat.SetSliderValue(PAYLOAD, 20.0)  # which has the platform drawn anew
    assert explorer.update() and explorer.snapshot.answers is None
    assert [is_visible(explorer, path) for path in PIECES] == [False, True]
    panel = get(explorer.address, "/panel")[1]
    assert "cannot rest here" in panel and "would bear" in panel
    for name, value in zip(("x [m]", "y [m]", "z [m]"), POSE[3:], strict=True):
        explorer.meshcat.SetSliderValue(name, value)
    assert explorer.update() and explorer.snapshot.answers is not None
    assert [is_visible(explorer, path) for path in PIECES] == [True, False]
    assert "cannot rest here" not in get(explorer.address, "/panel")[1]


def test_it_ends_by_its_button_or_without_a_browser(explorer: Explorer) -> None:
    assert explorer.run(idle=0.05) == "no browser for 0.05 s"
    assert not explorer.stopped
    click(explorer, STOP)
    assert explorer.stopped
    assert explorer.run() == "stopped in the browser"


def test_the_page_is_for_this_machine_only_and_has_two_texts(explorer: Explorer) -> None:
    assert explorer.address.startswith(f"http://{HOST}:")
    assert explorer.meshcat.web_url().startswith(f"http://{HOST}:")
    assert explorer._page._server.server_address[0] == "127.0.0.1"
    assert get(explorer.address, "/nothing")[0] == 404
    page = get(explorer.address, "/")[1]
    assert "<title>cogiro at rest</title>" in page and 'id="panel"' in page
    assert f'url = "http://{HOST}:{explorer.meshcat.port()}/"' in page


def test_a_page_of_meshcat_that_is_not_known_is_refused() -> None:
    with pytest.raises(ValueError, match="another page"):
        explore_page("<html><body></body></html>", "title", 7000)


@pytest.mark.needs("chromium")
def test_a_browser_shows_panel_and_open_controls(explorer: Explorer, tmp_path: Path) -> None:
    options = [
        "--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--no-first-run",
        "--enable-unsafe-swiftshader", "--disable-background-networking",
        f"--user-data-dir={tmp_path}", "--virtual-time-budget=4000", "--dump-dom",
    ]  # fmt: skip
    command = [str(find_chromium()), *options, explorer.address]
    document = subprocess.run(command, capture_output=True, text=True, timeout=120).stdout
    assert "Slowest oscillations" in document and "cable 8" in document
    assert "Close Controls" in document  # which is to say that they are open
    for name in ("x [m]", "yaw [deg]", PAYLOAD, GAIN, STOP):
        assert f">{name}<" in document


# --- the command


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["--port", "80"], "--port: from 1024 to 65534"),
        (["--idle", "-1"], "--idle: must be 0 or more"),
        (["--gain", "0"], "gain must be positive"),
        (["--cable-model", "X"], "unknown cable model"),
        (["--robot", "nope"], "nope: "),
        (["--payload", "-3"], "payload must be >= 0"),
    ],
)
def test_bad_input_costs_one_line(
    argv: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["explore", *argv]) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and message in printed.err
    assert len([line for line in printed.err.splitlines() if "error" in line]) == 1


def test_a_port_that_is_taken_costs_one_line(
    explorer: Explorer, capsys: pytest.CaptureFixture[str]
) -> None:
    taken = explorer.address.rstrip("/").rpartition(":")[2]
    assert main(["explore", "--port", taken]) == 2
    assert f"--port {taken}: " in capsys.readouterr().err


def test_the_command_follows_a_scripted_slider(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    seen: list[Snapshot] = []

    class Scripted(Explorer):
        def run(self, idle: float = 0.0) -> str:
            for gain in (0.2, 4.0):
                self.meshcat.SetSliderValue(GAIN, gain)
                super().run(idle)
                seen.append(self.snapshot)
            click(self, STOP)
            return super().run(idle)

    monkeypatch.setattr("cdpr_drake.show.explorer.Explorer", Scripted)
    monkeypatch.setenv("COLUMNS", "80")
    options: list[Any] = ["--payload", "60", "--pose", "-2,-0.6,1.7", "--idle", "0.2"]
    assert main(["explore", *options]) == 0
    assert [snapshot.gain for snapshot in seen] == [0.2, 4.0]
    tame, wild = (snapshot.answers for snapshot in seen)
    assert tame is not None and not tame.unstable
    assert wild is not None and wild.unstable
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("cogiro, 160 kg, at the pose asked for, (-2.00, -0.60, 1.70) m")
    assert lines[1].startswith("Open http://127.0.0.1:")
    assert lines[-1] == "Ended: stopped in the browser."
    assert max(map(len, lines)) <= 80


@pytest.mark.skipif(os.name != "posix", reason="signals of other systems differ")
def test_control_c_ends_it_cleanly(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "cdpr_drake", "explore"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
        preexec_fn=heed_interrupts,
    )  # fmt: skip
    assert process.stdout is not None
    try:
        process.stdout.readline()
        address = re.search(r"http://\S+", process.stdout.readline())
        assert address is not None
        assert get(address.group(), "/panel")[0] == 200
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 0
    assert out.splitlines()[-1] == "Ended: interrupted."
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []
