"""Drawn pulleys stand where the contact is, turn with the cable, and cables leave them at A."""

from __future__ import annotations

import re
from base64 import b64decode
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform, RollPitchYaw
from test_show import Unpacker, animation

from cdpr_drake.diagrams import Record
from cdpr_drake.model.cable_models import sag
from cdpr_drake.model.equilibrium import platform_balance, rest_state
from cdpr_drake.model.kinematics import cable_ends
from cdpr_drake.model.robot import CableRobot, Pulleys, load_robot
from cdpr_drake.model.room import home_position, room_of
from cdpr_drake.model.rotations import pose_to_vector
from cdpr_drake.show import cable_sag, pulleys, write_replay
from cdpr_drake.show.cables import CABLE_RADIUS, cable_shapes, hanging_ends
from cdpr_drake.show.explorer import Explorer, _chords
from cdpr_drake.show.frame import frame_bars
from cdpr_drake.show.meshes import revolved
from cdpr_drake.show.replay import _quiet_meshcat

NAMES = ("cogiro-2015-pulleys", "caroca", "cuhk-cablerobot")
SIGNALS = ("pose", "unstrained_length", "tangents_at_drawing_point", "tension_at_drawing_point")


def at_rest(robot: CableRobot) -> Record:
    """Return a record of rests at five poses, from which to which wheels turn many radians."""
    rows = []
    for shift in np.linspace(-0.2, 0.2, 5):
        p = home_position(robot) + shift * np.array([1.0, 0.5, -0.5])
        X_WP = RigidTransform(RollPitchYaw(0.0, 0.1 * shift, 0.2 * shift), p)
        rest = rest_state(robot, X_WP)
        out = platform_balance(robot, X_WP, rest.unstrained_length)[2]
        rows.append((pose_to_vector(X_WP), rest.unstrained_length, out[:, 5:8].ravel(), out[:, 3]))
    signals = {n: np.array(v) for n, v in zip(SIGNALS, zip(*rows, strict=True), strict=True)}
    context: Any = None
    return Record(
        time=0.1 * np.arange(5.0), signals=signals, context=context, wall_time=1.0, slack_cables={}
    )


class Page:
    """What a replay page holds: the tracks of its animation, and where things stand at rest."""

    def __init__(self, path: Path) -> None:
        text = path.read_text(encoding="utf-8")
        data = re.findall(r'fetch\("data:application/octet-binary;base64,([^"]*)"\)', text)
        self.tracks = animation(text)
        self.objects: dict[str, Any] = {}
        self.transforms: dict[str, np.ndarray] = {}
        for packed in map(b64decode, data):
            kind = re.match(rb"..?type.(set_object|set_transform)", packed[:30], re.DOTALL)
            if kind and kind[1] == b"set_transform":
                message = Unpacker(packed).read()
                matrix = np.reshape(message["matrix"], (4, 4), order="F")
                self.transforms[message["path"]] = matrix
            elif kind:
                (name,) = re.findall(rb"path(?:[\xa0-\xbf]|\xd9.)([ -~]+)\xa6object", packed)
                self.objects[name.decode()] = packed

    def pose(self, path: str, frame: int) -> RigidTransform:
        """Return where a moving thing is in its parent."""
        x, y, z, w = self.tracks[path][".quaternion"][frame]
        q = np.array([w, x, y, z]) / np.linalg.norm([w, x, y, z])
        return RigidTransform(Quaternion(q), self.tracks[path][".position"][frame])


@pytest.fixture(scope="module", params=[*NAMES, "tilted axes"])
def robot(request: pytest.FixtureRequest) -> CableRobot:
    if request.param in NAMES:
        return load_robot(request.param)
    robot = load_robot("cuhk-cablerobot")
    axis = robot.pulley_axes + np.array([0.2, -0.3, 0.0])
    return robot.replace(pulleys=robot.pulleys.replace(axis=axis))


@pytest.fixture(scope="module")
def record(robot: CableRobot) -> Record:
    return at_rest(robot)


@pytest.fixture(scope="module")
def page(robot: CableRobot, record: Record, tmp_path_factory: pytest.TempPathFactory) -> Page:
    path = tmp_path_factory.mktemp("replay") / "replay.html"
    return Page(write_replay(path, robot, record))


def true_ends(robot: CableRobot, record: Record) -> list[Any]:
    return [
        cable_ends(robot, pose, tangents.reshape(-1, 3))
        for pose, tangents in zip(record["pose"], record["tangents_at_drawing_point"], strict=True)
    ]


# --- replay


def test_there_is_a_pulley_for_each_cable_and_no_ball_in_it(page: Page, robot: CableRobot) -> None:
    k = robot.num_cables
    found = {path.split("/")[2] for path in page.objects if path.startswith("/run/pulley")}
    assert found == {f"pulley{i + 1}" for i in range(k)}
    rims = [path for path in page.objects if path.endswith("/wheel/turning/rim")]
    marks = [path for path in page.objects if path.endswith("/wheel/turning/mark")]
    assert len(rims) == len(marks) == k
    assert not any("drawing_point" in path for path in page.objects)


def test_wheels_stand_where_the_contact_is(page: Page, robot: CableRobot, record: Record) -> None:
    for frame, ends in enumerate(true_ends(robot, record)):
        for i, rho in enumerate(robot.pulley_radii):
            a, e = robot.pulley_axes[i], ends.contact.e[i]
            X_SV = RigidTransform(page.transforms[f"/run/pulley{i + 1}/wheel"])
            X_WV = page.pose(f"/run/pulley{i + 1}", frame) @ X_SV
            assert_allclose(X_WV.translation(), robot.drawing_points[i] + rho * e, atol=1e-12)
            assert_allclose(X_WV.rotation().matrix()[:, 2], np.cross(a, e), atol=1e-12)
            assert_allclose(X_WV.rotation().matrix()[:, 0], e, atol=1e-12)
            # All three in the plane of the wheel, and A on its edge.
            out = ends.p_WA[i] - X_WV.translation()
            assert abs(out @ X_WV.rotation().matrix()[:, 2]) < 1e-9
            assert np.linalg.norm(out) == pytest.approx(rho, abs=1e-9)


def test_the_mark_turns_by_the_cable_paid_out(
    page: Page, robot: CableRobot, record: Record
) -> None:
    paid_out = record["unstrained_length"] - record["unstrained_length"][0]
    for i, rho in enumerate(robot.pulley_radii):
        track = page.tracks[f"/run/pulley{i + 1}/wheel/turning"]
        angles = np.array(list(track[".rotation[z]"].values()))
        assert_allclose(angles - angles[0], paid_out[:, i] / rho, atol=1e-9)
    assert np.abs(paid_out / robot.pulley_radii).max() > 2.0


def test_the_rim_moves_the_way_the_cable_enters(robot: CableRobot, record: Record) -> None:
    for ends in true_ends(robot, record):
        for i, rho in enumerate(robot.pulley_radii):
            X_WS = pulleys.swivel_pose(robot, ends.contact, i)
            X_WV = X_WS @ pulleys.wheel_pose(rho)
            velocity = np.cross(X_WV.rotation().matrix()[:, 2], -rho * ends.contact.e[i])
            assert_allclose(velocity, rho * robot.pulley_axes[i], atol=1e-12)


def ring_middles(vertices: np.ndarray, thick: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """Return the middles of the first and the last ring of a tube."""
    return vertices[:, :thick].mean(axis=1), vertices[:, -thick:].mean(axis=1)


def test_the_cable_on_a_wheel_reaches_from_F_to_A(robot: CableRobot, record: Record) -> None:
    all_ends = true_ends(robot, record)
    for i, rho in enumerate(robot.pulley_radii):
        spans, angles = pulleys.wrap_pieces([ends.contact.theta[i] for ends in all_ends])
        assert len(spans) == 2
        for ends, stops in zip(all_ends, angles, strict=True):
            X_WS = pulleys.swivel_pose(robot, ends.contact, i)
            X_WV = X_WS @ pulleys.wheel_pose(rho)
            points = []
            for span, stop in zip(spans, stops, strict=True):
                tube = pulleys.wrap_tube(rho, 0.1 * rho, span)
                X_WT = X_WV @ RigidTransform(RollPitchYaw(0.0, 0.0, stop), np.zeros(3))
                points.append([X_WT @ p for p in ring_middles(tube.vertices)])
            assert_allclose(points[0][0], robot.drawing_points[i], atol=1e-9)
            assert_allclose(points[-1][1], ends.p_WA[i], atol=1e-9)
            assert stops[-1] - spans[-1] <= stops[0] + 1e-12  # no gap


def test_the_pieces_in_the_page_turn_to_A(page: Page, robot: CableRobot, record: Record) -> None:
    theta = np.array([ends.contact.theta for ends in true_ends(robot, record)])
    for i in range(robot.num_cables):
        last = page.tracks[f"/run/pulley{i + 1}/wheel/wrap2"][".rotation[z]"]
        assert_allclose(list(last.values()), theta[:, i], atol=1e-9)
        first = page.transforms[f"/run/pulley{i + 1}/wheel/wrap1"]
        angle = np.arctan2(first[1, 0], first[0, 0])
        assert angle == pytest.approx(theta[:, i].min(), abs=1e-9)


def test_cables_begin_at_A_along_the_tangent(robot: CableRobot, record: Record) -> None:
    lengths, tangents = record["unstrained_length"], record["tangents_at_drawing_point"]
    ends = hanging_ends(robot, record["pose"], lengths, tangents)
    shapes = cable_shapes(robot, record["pose"], lengths, points=401, ends=ends)
    for shape, true, tangent in zip(shapes, true_ends(robot, record), tangents, strict=True):
        assert_allclose(shape[:, 0], true.p_WA, atol=1e-9)
        assert_allclose(shape[:, -1], true.p_WB, atol=1e-6)
        first = shape[:, 1] - shape[:, 0]
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        assert_allclose(first, tangent.reshape(-1, 3), atol=1e-3)
        assert np.abs(true.p_WA - robot.drawing_points).max() > 0.04


def test_a_record_without_tangents_will_do(robot: CableRobot, record: Record) -> None:
    found = hanging_ends(robot, record["pose"], record["unstrained_length"])
    for ends, true in zip(found, true_ends(robot, record), strict=True):
        assert_allclose(ends.p_WA, true.p_WA, atol=1e-9)


def test_bars_of_cables_begin_at_A(page: Page, robot: CableRobot, record: Record) -> None:
    for frame, ends in enumerate(true_ends(robot, record)):
        for i in range(robot.num_cables):
            path = f"/run/cable{i + 1}/1"
            X, length = page.pose(path, frame), page.tracks[path][".scale"][frame][2]
            assert_allclose(X @ np.array([0.0, 0.0, -0.5 * length]), ends.p_WA[i], atol=1e-9)


def test_the_cable_on_a_wheel_has_the_colour_of_the_rest(page: Page, robot: CableRobot) -> None:
    for i in range(robot.num_cables):
        rest = page.tracks[f"/run/cable{i + 1}/1/<object>"][".material.color"]
        for piece in ("run", "wheel/wrap1", "wheel/wrap2"):
            assert page.tracks[f"/run/pulley{i + 1}/{piece}/<object>"][".material.color"] == rest


# --- pieces


@pytest.mark.parametrize("wraps", [[1.0], [1.0, 1.0], [0.5, 3.0, 1.5], [0.0, 2.0]])
def test_pieces_cover_each_wrap_and_no_more(wraps: list[float]) -> None:
    spans, ends = pulleys.wrap_pieces(wraps)
    for wrap, stops in zip(wraps, ends, strict=True):
        begins = stops - spans
        assert begins[0] == pytest.approx(0.0) and stops[-1] == pytest.approx(wrap)
        assert np.all(begins[1:] <= stops[:-1] + 1e-12)
        if min(wraps) > 0.0:
            assert begins.min() > -1e-12


def test_a_ring_is_closed_and_as_large_as_told() -> None:
    mesh = revolved([[0.5, -0.1], [1.0, -0.1], [1.0, 0.1], [0.5, 0.1]])
    corners = mesh.vertices.T[mesh.triangles.T]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    ring = 0.2 * np.pi * (1.0 - 0.25)
    assert abs(volume) == pytest.approx(ring, rel=0.01)
    assert np.hypot(*mesh.vertices[:2]).max() == pytest.approx(1.0)


def test_grooves_are_no_deeper_than_a_pulley_has_room_for(robot: CableRobot) -> None:
    depths = pulleys.groove_depths(robot, CABLE_RADIUS)
    assert np.all(depths <= 0.2 * robot.pulley_radii + 1e-15) and np.all(depths > 0.0)
    eyelets = robot.replace(pulleys=Pulleys())
    assert np.all(pulleys.groove_depths(eyelets, CABLE_RADIUS) == CABLE_RADIUS)


def test_arms_of_the_frame_end_at_the_bearings(robot: CableRobot) -> None:
    ends = np.array([bar.end for bar in frame_bars(robot, room_of(robot))])
    for F, a, rho in zip(robot.drawing_points, robot.pulley_axes, robot.pulley_radii, strict=True):
        near = np.linalg.norm(ends - (F - 0.75 * rho * a), axis=1)
        assert near.min() < 1e-9


# --- robots that have some, or none


def test_eyelets_have_no_pulley(tmp_path: Path) -> None:
    robot = load_robot("cuhk-cablerobot")
    radius = np.where(np.arange(8) % 2, 0.045, 0.0)
    robot = robot.replace(pulleys=Pulleys(radius=radius, axis=robot.pulleys.axis))
    page = Page(write_replay(tmp_path / "r.html", robot, at_rest(robot)))
    found = {path.split("/")[2] for path in page.objects if path.startswith("/run/pulley")}
    assert found == {"pulley2", "pulley4", "pulley6", "pulley8"}
    balls = {path for path in page.objects if path.startswith("/robot/drawing_point")}
    assert balls == {f"/robot/drawing_point{i}" for i in (1, 3, 5, 7)}
    robot = robot.replace(pulleys=Pulleys())
    page = Page(write_replay(tmp_path / "r.html", robot, at_rest(robot)))
    assert not any("pulley" in path for path in (*page.objects, *page.tracks))


# --- figures


def test_sag_is_taken_from_where_cables_leave(robot: CableRobot, record: Record) -> None:
    lengths, tangents = record["unstrained_length"], record["tangents_at_drawing_point"]
    ends = hanging_ends(robot, record["pose"], lengths, tangents)
    shapes = cable_shapes(robot, record["pose"], lengths, points=201, ends=ends)
    depths = cable_sag(record, robot)
    chord = np.array([end.chord for end in true_ends(robot, record)])
    u = tangents.reshape(chord.shape)
    H = record["tension_at_drawing_point"] * np.hypot(u[..., 0], u[..., 1])
    Bx = np.hypot(chord[..., 0], chord[..., 1])
    assert_allclose(depths, sag(Bx, chord[..., 2], H, robot.weight_per_metre), rtol=1e-12)
    for shape, found in zip(shapes, depths, strict=True):
        for points, depth in zip(shape, found, strict=True):
            x = np.hypot(*(points - points[0])[:, :2].T)
            straight = points[0, 2] + x / x[-1] * (points[-1, 2] - points[0, 2])
            assert depth == pytest.approx(
                (straight - points[:, 2]).max(), rel=2e-3
            )  # of w by stretched metre


# --- explorer


def test_the_explorer_draws_pulleys_where_the_contact_is(robot: CableRobot) -> None:
    X_WP = RigidTransform(home_position(robot))
    explorer = Explorer(robot, X_WP)
    try:
        meshcat, answers = explorer.meshcat, explorer.snapshot.answers
        assert answers is not None, explorer.snapshot.reason
        length = answers.rest.rest.unstrained_length
        tangents = platform_balance(robot, explorer.snapshot.pose, length)[2][:, 5:8]
        ends = cable_ends(robot, explorer.snapshot.pose, tangents)
        assert ends.contact is not None
        for i in range(robot.num_cables):
            expected = pulleys.swivel_pose(robot, ends.contact, i).GetAsMatrix4()
            assert_allclose(matrix(meshcat, f"/pulleys/{i + 1}"), expected, atol=1e-9)
            turn = matrix(meshcat, f"/pulleys/{i + 1}/wheel/turning")
            angle = length[i] / robot.pulley_radii[i]
            assert_allclose(turn[:2, 0], [np.cos(angle), np.sin(angle)], atol=1e-9)
            assert meshcat.HasPath(f"/pulleys/{i + 1}/wheel/wrap1")
        explorer.meshcat.SetSliderValue("roll [deg]", 30.0)
        explorer.meshcat.SetSliderValue("z [m]", 1e9)
        assert explorer.update()  # and where there is no rest, it draws all the same
    finally:
        explorer.close()


def test_the_explorer_goes_on_where_the_platform_is_inside_of_a_pulley() -> None:
    robot = load_robot("cuhk-cablerobot")
    inside = robot.drawing_points[0] + [0.045, 0.0, 0.0] - robot.attachment_points[0]
    ends = _chords(robot, RigidTransform(inside))
    assert ends.contact is None
    assert_allclose(ends.p_WA, robot.drawing_points)


def matrix(meshcat: Meshcat, path: str) -> np.ndarray:
    """Return the transform (4, 4) at a path."""
    message = Unpacker(meshcat._GetPackedTransform(path)).read()
    return np.reshape(message["matrix"], (4, 4), order="F")


def test_a_pulley_is_as_large_as_it_is() -> None:
    meshcat = _quiet_meshcat()
    pulleys.draw_pulley(meshcat, "/p", 0.045, 0.005)
    packed = meshcat._GetPackedObject("/p/wheel/turning/rim")
    assert b"BufferGeometry" in packed
    assert_allclose(matrix(meshcat, "/p/wheel")[:3, 3], [0.045, 0.0, 0.0])
