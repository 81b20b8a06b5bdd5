"""The cameras in the robot files: where they stand, what they see, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import yaml
from pydrake.math import RigidTransform

from cdpr_drake.errors import RobotFileError
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.vision.cameras import observers

NAMES = ("cogiro", "cogiro-2015-pulleys", "cogiro-22m", "cogiro-37m", "cogiro-98m")
SCALED = NAMES[2:]
TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # +90 degrees about z


def in_world(robot: CableRobot) -> list[RigidTransform]:
    """The poses of the pose cameras in W."""
    return [robot.cameras.X_WF @ camera.X_FC for camera in robot.cameras.pose_cameras]


@pytest.mark.parametrize("name", NAMES)
def test_the_paper_s_setup_has_eleven_cameras(name: str) -> None:
    robot = load_robot(name)
    cameras = robot.cameras
    assert len(cameras.pose_cameras) + 2 * len(cameras.stereo_pairs) == 11
    assert [len(p.points) for p in cameras.patterns] == [5, 5, 5, 5]
    assert in_world(robot)[0].IsExactlyEqualTo(cameras.X_WF)
    np.testing.assert_array_equal(observers(robot), [0, 0, 1, 1, 2, 2, 3, 3])
    for camera in cameras.pose_cameras:
        assert (camera.intrinsics.width, camera.intrinsics.height) == (1280, 1024)


def test_the_pose_cameras_of_cogiro_stand_on_three_posts_and_are_level(cogiro: CableRobot) -> None:
    for X, x, y in zip(in_world(cogiro), (-7.2, 7.2, 7.2), (-5.2, 5.2, -5.2), strict=True):
        np.testing.assert_allclose(X.translation(), [x, y, 6.0], atol=1e-4)
        assert abs(X.rotation().matrix()[2, 0]) < np.sin(np.radians(2.0))  # x axis horizontal
        assert X.rotation().matrix()[2, 1] < 0.0  # image y points down
        assert X.rotation().matrix()[2, 2] < 0.0


def test_the_patterns_lie_on_the_lateral_faces_of_the_cube(cogiro: CableRobot) -> None:
    normals = []
    for pattern in cogiro.cameras.patterns:
        corners = np.pad(pattern.points, ((0, 0), (0, 1)))
        in_M = np.array([pattern.X_MT @ p for p in corners])
        normal = pattern.X_MT.rotation().matrix()[:, 2]
        np.testing.assert_allclose(in_M @ normal, 0.5, atol=1e-15)
        assert np.abs(in_M).max() == 0.5 and normal[2] == 0.0
        sides = np.linalg.norm(np.diff(in_M[[0, 1, 2, 3, 0]], axis=0), axis=1)
        np.testing.assert_allclose(sides, 0.8)
        normals.append(normal)
    np.testing.assert_allclose(sum(np.outer(n, n) for n in normals), np.diag([2.0, 2.0, 0.0]))
    np.testing.assert_allclose(np.sum(normals, axis=0), 0.0)


@pytest.mark.parametrize("name", NAMES)
def test_the_stereo_pairs_look_at_the_cables_from_a_few_metres_above(name: str) -> None:
    robot = load_robot(name)
    size = robot.cameras.cable_segment[1]
    for pair in robot.cameras.stereo_pairs:
        left = robot.cameras.X_WF @ pair.X_FL
        right = left @ pair.X_LR
        middle = 0.5 * (left.translation() + right.translation())
        assert np.linalg.norm(pair.X_LR.translation()) == pytest.approx(0.4 * size, abs=1e-3)
        for cable in pair.cables:
            A = robot.drawing_points[cable - 1]
            assert 0.9 * size < np.linalg.norm(middle - A) < 1.6 * size
        both = [(X.rotation().matrix()[:, 2], X.translation()) for X in (left, right)]
        gap = np.cross(both[0][0], both[1][0]) @ (both[1][1] - both[0][1])
        assert abs(gap) < 1e-3  # the axes meet
        assert all(axis[2] < -0.9 for axis, _ in both)


@pytest.mark.parametrize("name", SCALED)
def test_the_cameras_of_the_large_robots_are_cogiro_s_turned_and_scaled(
    name: str, cogiro: CableRobot
) -> None:
    robot = load_robot(name)
    turned = cogiro.drawing_points @ TURN.T
    scale = robot.drawing_points.std(axis=0) / turned.std(axis=0)
    scale[2] = robot.drawing_points[:, 2].max() / turned[:, 2].max()
    for X, X0 in zip(in_world(robot), in_world(cogiro), strict=True):
        np.testing.assert_allclose(X.translation(), TURN @ X0.translation() * scale, atol=5e-3)
        np.testing.assert_allclose(X.rotation().matrix(), TURN @ X0.rotation().matrix(), atol=1e-8)
    assert robot.cameras.patterns == cogiro.cameras.patterns
    ours, theirs = (r.cameras.stereo_pairs[0].X_LR for r in (robot, cogiro))
    np.testing.assert_allclose(ours.rotation().matrix(), theirs.rotation().matrix(), atol=1e-8)


# --- what is refused


def change(path: list[Any], value: Any) -> Callable[[dict], None]:
    """An edit that puts a value at a place below `cameras`; a function is applied to what is."""

    def edit(data: dict) -> None:
        place: Any = data["cameras"]
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value(place[path[-1]]) if callable(value) else value

    return edit


CAMERA = ["pose_cameras", 1, "intrinsics"]
BAD = [
    (
        change([*CAMERA, "camera_matrix"], [[1100, 0, 640], [0, 0, 512], [0, 0, 1]]),
        "pose_cameras[1].intrinsics.camera_matrix",
        "is singular",
    ),
    (
        change([*CAMERA, "camera_matrix"], [[1100, 0, 640], [0, 1100, 512]]),
        "pose_cameras[1].intrinsics.camera_matrix",
        "of shape (3, 3)",
    ),
    (
        change([*CAMERA, "camera_matrix"], [[1100, 3, 640], [0, 1100, 512], [0, 0, 1]]),
        "pose_cameras[1].intrinsics.camera_matrix",
        "must be [[fx, 0, cx]",
    ),
    (
        change([*CAMERA, "camera_matrix", 0, 0], -1100.0),
        "pose_cameras[1].intrinsics.camera_matrix",
        "positive focal lengths",
    ),
    (
        change([*CAMERA, "distortion"], [0.1]),
        "pose_cameras[1].intrinsics.distortion",
        "must be five numbers",
    ),
    (change([*CAMERA, "width"], 0), "pose_cameras[1].intrinsics.width", "at least 1 px"),
    (
        change([*CAMERA, "width"], 1280.5),
        "pose_cameras[1].intrinsics.width",
        "must be a whole number",
    ),
    (
        change(["pose_cameras", 2, "X_FC", "rotation"], [0.0]),
        "pose_cameras[2].X_FC.rotation",
        "must have shape (3,)",
    ),
    (
        change(["pose_cameras", 0], {"intrinsics": 1}),
        "pose_cameras[0].X_FC",
        "is missing",
    ),
    (change(["pose_cameras"], 3), "pose_cameras", "must be a list, got 3"),
    (change(["patterns", 3, "points"], lambda p: p[:3]), "patterns[3].points", "at least four"),
    (
        change(["patterns", 3, "points"], [[0, 0], [1, 0], [2, 0], [3, 0]]),
        "patterns[3].points",
        "all lie on one line",
    ),
    (change(["patterns", 0, "points"], [[0, 0, 0]] * 4), "patterns[0].points", "shape (n, 2)"),
    (change(["patterns", 2, "point_diameter"], 0.0), "patterns[2].point_diameter", "be positive"),
    (
        change(["stereo_pairs", 1, "X_LR", "translation"], [0, 0, 0]),
        "stereo_pairs[1].X_LR",
        "at one place",
    ),
    (
        change(["stereo_pairs", 1, "right", "camera_matrix", 2, 2], 0.0),
        "stereo_pairs[1].right.camera_matrix",
        "is singular",
    ),
    (change(["stereo_pairs", 0, "cables"], [0, 2]), "stereo_pairs[0].cables", "from 1 on"),
    (change(["stereo_pairs", 0, "cables"], [2, 2]), "stereo_pairs[0].cables", "different numbers"),
    (
        change(["stereo_pairs", 0, "cables"], [1.5]),
        "stereo_pairs[0].cables[0]",
        "must be a whole number",
    ),
    (change(["cable_segment"], [1.0, 0.3]), "cable_segment", "the second larger"),
    (change(["cable_segment"], 0.5), "cable_segment", "two lengths"),
    (change(["edge_points"], 1), "edge_points", "at least 2"),
    (change(["pixel_noise"], -0.2), "pixel_noise", "must be >= 0"),
    (change(["pixel_bias_seed"], -1), "pixel_bias_seed", "must be >= 0"),
]


@pytest.mark.parametrize(("edit", "field", "message"), BAD, ids=[f"{b[1]}: {b[2]}" for b in BAD])
def test_bad_cameras_are_refused_naming_file_and_field(
    edit: Callable[[dict], None], field: str, message: str, cogiro: CableRobot, tmp_path: Any
) -> None:
    data = yaml.safe_load(cogiro.to_yaml())
    edit(data)
    path = tmp_path / "robot.yaml"
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    with pytest.raises(RobotFileError) as caught:
        load_robot(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: cameras.{field}: ") and message in text and "\n" not in text


def test_a_band_of_vibration_that_falls_is_refused(cogiro: CableRobot) -> None:
    for band in ([8.0, 3.0], [0.0, 3.0], 5.0):
        with pytest.raises(RobotFileError, match=r"load_cells\.vibration_band: must be two"):
            cogiro.replace(load_cells=cogiro.load_cells.replace(vibration_band=band))


def test_a_cable_that_no_pair_or_two_pairs_see_is_refused(cogiro: CableRobot) -> None:
    def with_cables(index: int, cables: tuple[int, ...]) -> CableRobot:
        pairs = list(cogiro.cameras.stereo_pairs)
        pairs[index] = pairs[index].replace(cables=cables)
        return cogiro.replace(cameras=cogiro.cameras.replace(stereo_pairs=tuple(pairs)))

    for robot, message in (
        (with_cables(1, (3,)), "cameras.stereo_pairs: no pair sees cable 4"),
        (with_cables(1, (3, 4, 5)), r"stereo_pairs\[2\]\.cables: another pair sees cable 5"),
        (with_cables(3, (7, 9)), r"stereo_pairs\[3\]\.cables: there is no cable 9 among 8"),
    ):
        with pytest.raises(RobotFileError, match=message):
            observers(robot)
