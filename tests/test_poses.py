"""Poses as people write them: by name and in degrees, or as vectors, which are checked on entry."""

from __future__ import annotations

import importlib
import inspect
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydrake.autodiffutils import InitializeAutoDiff
from pydrake.math import RigidTransform, RollPitchYaw

import cdpr_drake as cdpr
from cdpr_drake import analysis, diagrams, runs, show, study, systems
from cdpr_drake.commands import UsageError
from cdpr_drake.commands.parsing import parse
from cdpr_drake.diagrams import Record
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.rotations import as_pose, pose_to_vector, vector_to_pose

ROOMS = (systems, diagrams, study, analysis, runs, show)
LEVEL = [0.0, 0.0, 0.0, 0.0, 0.0, 1.5]

IN_DEGREES = [0.0, 0.0, 10.0, 0.0, 0.0, 1.5]
POSITION_FIRST = [7.0, 0.0, 1.5, 0.0, 0.0, 0.1]
BAD = {
    "five numbers": LEVEL[:5],
    "seven numbers": [*LEVEL, 0.0],
    "a column": np.array(LEVEL)[:, None],
    "not a number": [0.0, 0.0, 0.0, math.nan, 0.0, 1.5],
    "infinite": [0.0, math.inf, 0.0, 0.0, 0.0, 1.5],
    "angles in degrees": IN_DEGREES,
    "the position first": POSITION_FIRST,
    "a text": "level",
    "nothing": None,
    "a mapping": {"x": 1.0},
    "ragged": [[0.0, 0.0], [0.0]],
    "derivatives of degrees": InitializeAutoDiff(IN_DEGREES).ravel(),
}


@cache
def robot() -> CableRobot:
    """Return CoGiRo."""
    return load_robot("cogiro")


@cache
def loop() -> Any:
    """Return its vision-based loop."""
    return diagrams.make_vision_based_control(robot())


def record() -> Record:
    """Return a record of a robot that hangs where it is."""
    signals = {
        "pose": np.tile(LEVEL, (2, 1)),
        "pose_error": np.zeros((2, 6)),
        "unstrained_length": np.full((2, 8), 10.0),
        "tension_at_drawing_point": np.full((2, 8), 500.0),
    }
    context = loop().CreateDefaultContext()
    return Record(
        time=np.array([0.0, 1.0]), signals=signals, context=context, wall_time=1.0, slack_cables={}
    )


# How each function that takes a pose is asked for one.
ASKED: dict[str, Callable[[Any], Any]] = {
    "systems.ExponentialApproach(start)": lambda p: systems.ExponentialApproach(robot(), p, LEVEL),
    "systems.ExponentialApproach(goal)": lambda p: systems.ExponentialApproach(robot(), LEVEL, p),
    "diagrams.rest_context": lambda p: diagrams.rest_context(loop(), p),
    "study.equilibrium": lambda p: study.equilibrium(loop(), p),
    "study.true_pose": lambda p: study.true_pose(loop(), p),
    "runs.Setup(start)": lambda p: runs.Setup(robot=robot(), start=p, goal=LEVEL),
    "runs.Setup(goal)": lambda p: runs.Setup(robot=robot(), start=LEVEL, goal=p),
    "analysis.SampledServo": lambda p: analysis.SampledServo(robot(), p),
    "analysis.compare_cable_models": lambda p: analysis.compare_cable_models(
        [robot()], ["SLSM"], poses={"cogiro": p}
    ),
    "analysis.default_gain": lambda p: analysis.default_gain(robot(), p),
    "analysis.explore_pose": lambda p: analysis.explore_pose(robot(), p),
    "analysis.gain_limit": lambda p: analysis.gain_limit(robot(), p),
    "analysis.gain_limit_band": lambda p: analysis.gain_limit_band(robot(), p),
    "analysis.gain_matrix": lambda p: analysis.gain_matrix(robot(), None, p),
    "analysis.map_gain_matrix": lambda p: analysis.map_gain_matrix(robot(), None, [LEVEL, p]),
    "analysis.neutral_directions": lambda p: analysis.neutral_directions(robot(), p),
    "analysis.platform_modes": lambda p: analysis.platform_modes(robot(), p),
    "analysis.stability_map": lambda p: analysis.stability_map(robot(), p, [0.1, 0.2], [0.0, 0.1]),
    "show.camera_view_figure": lambda p: show.camera_view_figure(robot(), p),
    "show.error_norm_figure": lambda p: show.error_norm_figure({"a": record()}, 0.1, robot(), p),
    "show.mode_shape_figure": lambda p: show.mode_shape_figure(*mode(), robot(), p),
    "show.pose_error_figure": lambda p: show.pose_error_figure({"a": record()}, robot(), p),
    "show.save_figures": lambda p: show.save_figures({"a": record()}, robot(), "nowhere", goal=p),
    "show.write_replay": lambda p: show.write_replay("nowhere", robot(), record(), p),
}
OPTIONAL = ("show.error", "show.pose", "show.save", "show.write")  # there, None is no goal


@cache
def mode() -> tuple[Any, Any]:
    """Return the modes of the platform, and one of them."""
    found = analysis.platform_modes(robot(), LEVEL)
    return found, found[0]


def takes_a_pose(thing: Any) -> bool:
    """Whether a function or class has an argument that is a pose in either form."""
    try:
        parameters = inspect.signature(thing).parameters.values()
    except (TypeError, ValueError):
        return False
    return any("RigidTransform | ArrayLike" in str(p.annotation) for p in parameters)


def test_every_function_that_takes_a_pose_is_asked_for_one() -> None:
    offered = {
        f"{room.__name__.removeprefix('cdpr_drake.')}.{name}"
        for room in ROOMS
        for name in room.__all__
        if takes_a_pose(getattr(room, name))
    }
    assert offered <= {name.partition("(")[0] for name in ASKED}


@pytest.mark.parametrize("asked", ASKED)
def test_a_vector_that_cannot_be_meant_is_refused(
    asked: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for bad, vector in BAD.items():
        if vector is None and asked.startswith(OPTIONAL):
            continue
        with pytest.raises(ValueError, match=r"\[roll, pitch, yaw, x, y, z\] in rad") as caught:
            ASKED[asked](vector)
        assert "cdpr_drake.pose(x=..., yaw_deg=...) takes them by name" in str(caught.value), bad
    assert not list(tmp_path.iterdir())


def test_the_angle_that_cannot_be_meant_is_named() -> None:
    with pytest.raises(ValueError, match="no angle beyond a full turn, 2 pi, got yaw = 10 rad"):
        as_pose(IN_DEGREES)
    with pytest.raises(ValueError, match="got roll = 7 rad"):
        as_pose(POSITION_FIRST)


ANGLES = st.floats(-2.0 * math.pi, 2.0 * math.pi)
NUMBERS = st.floats(-100.0, 100.0)


@given(arrays(float, 3, elements=ANGLES), arrays(float, 3, elements=NUMBERS))
def test_any_vector_up_to_a_full_turn_is_a_pose(angles: np.ndarray, p: np.ndarray) -> None:
    vector = np.concatenate([angles, p])
    expected = RigidTransform(RollPitchYaw(angles), p)
    assert as_pose(vector).IsExactlyEqualTo(expected)
    assert as_pose(list(vector)).IsExactlyEqualTo(expected)
    assert as_pose(vector.astype(object)).IsExactlyEqualTo(expected)


@given(st.integers(0, 2), st.floats(6.2832, 1e9), st.sampled_from([-1.0, 1.0]))
def test_any_angle_beyond_a_full_turn_is_refused(axis: int, angle: float, sign: float) -> None:
    vector = np.array(LEVEL)
    vector[axis] = sign * angle
    with pytest.raises(ValueError, match="full turn"):
        as_pose(vector)
    vector_to_pose(vector)  # a state may have turned that far


# --- by name


def test_a_pose_by_name() -> None:
    X_WP = cdpr.pose(x=1.0, y=-2.0, z=3.0, roll_deg=10.0, pitch_deg=-20.0, yaw_deg=30.0)
    expected = [*np.radians([10.0, -20.0, 30.0]), 1.0, -2.0, 3.0]
    np.testing.assert_allclose(pose_to_vector(X_WP), expected, atol=1e-15)
    roll, pitch, yaw = (RollPitchYaw(a).ToRotationMatrix().matrix() for a in np.diag(expected[:3]))
    np.testing.assert_allclose(X_WP.rotation().matrix(), yaw @ pitch @ roll, atol=1e-15)
    assert cdpr.pose().IsExactlyEqualTo(RigidTransform())
    assert as_pose(X_WP) is X_WP


@pytest.mark.parametrize("name", inspect.signature(cdpr.pose).parameters)
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_pose_of_numbers_that_are_not_finite_is_refused(name: str, bad: float) -> None:
    with pytest.raises(ValueError, match=f"{name} must be finite"):
        cdpr.pose(**{name: bad})


@pytest.mark.parametrize("name", ["roll_deg", "pitch_deg", "yaw_deg"])
def test_degrees_beyond_a_full_turn_are_refused(name: str) -> None:
    for turn in (360.0, -360.0):
        assert cdpr.pose(**{name: turn}).IsNearlyEqualTo(RigidTransform(), 1e-14)
    with pytest.raises(ValueError, match=f"{name} is no larger than a full turn, 360 degrees"):
        cdpr.pose(**{name: 360.1})


def test_a_pose_has_no_order_to_get_wrong() -> None:
    with pytest.raises(TypeError):
        cdpr.pose(1.0, 2.0, 3.0)
    assert importlib.import_module("cdpr_drake").pose is cdpr.pose
    assert "pose" in dir(cdpr)


# --- on a command line


def test_a_full_turn_in_degrees_is_taken_on_a_command_line() -> None:
    options = parse(["run", "--from", "1,2,3,360,0,-360"]).options
    assert as_pose(options.start).IsNearlyEqualTo(RigidTransform([1.0, 2.0, 3.0]), 1e-14)


@pytest.mark.parametrize("option", ["--from", "--to"])
def test_an_angle_beyond_a_full_turn_is_refused_in_degrees(option: str) -> None:
    with pytest.raises(UsageError, match=r"\[deg\] come last, none beyond a full turn"):
        parse(["run", option, "1,2,3,0,0,400"])


def test_a_replay_shows_a_platform_that_turned_further(tmp_path: Path) -> None:
    run = record()
    run.signals["pose"][1, 2] = 7.0
    file = show.write_replay(tmp_path / "replay.html", robot(), run, LEVEL)
    assert file.stat().st_size > 0
