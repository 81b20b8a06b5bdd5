"""Names of cable models: Python and the command line take the same spellings, and no others."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from cdpr_drake.analysis import (
    SampledServo,
    compare_cable_models,
    default_gain,
    explore_pose,
    gain_matrix,
    map_gain_matrix,
)
from cdpr_drake.commands import UsageError
from cdpr_drake.commands.parsing import parse
from cdpr_drake.diagrams import make_joint_space_control, make_vision_based_control
from cdpr_drake.model import cable_models as models
from cdpr_drake.model.inverse_kinematics import InverseKinematics
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.model.servo import D_a, ServoSettings
from cdpr_drake.systems import InverseKinematicsAngles

POSE = [0.0, 0.0, 0.1, 0.5, 0.2, 1.2]


@cache
def robot() -> CableRobot:
    """Return CoGiRo."""
    return load_robot("cogiro")


def named(command: str, several: bool = False) -> Callable[[str], Any]:
    """Return what asks a command for a cable model."""

    def ask(model: str) -> Any:
        found = parse([command, "--cable-model", model]).options.cable_model
        return found[0] if several else found

    return ask


# How each place that takes the name of a cable model is asked for one, and what comes of it.
ASKED: dict[str, Callable[[str], Any]] = {
    "cable_model_name": models.cable_model_name,
    "ServoSettings": lambda m: ServoSettings(cable_model=m).cable_model,
    "D_a": lambda m: D_a(robot(), POSE, np.full(8, 300.0), m),
    "InverseKinematics": lambda m: InverseKinematics(robot(), m).lengths(POSE),
    "InverseKinematicsAngles": lambda m: InverseKinematicsAngles(robot(), m).cable_model,
    "make_joint_space_control": lambda m: (
        make_joint_space_control(robot(), cable_model=m)
        .GetSubsystemByName("inverse_kinematics")
        .cable_model
    ),
    "make_vision_based_control": lambda m: (
        make_vision_based_control(robot(), cable_model=m)
        .GetSubsystemByName("servo")
        .settings.cable_model
    ),
    "gain_matrix": lambda m: gain_matrix(robot(), None, POSE, m).cable_model,
    "map_gain_matrix": lambda m: map_gain_matrix(robot(), None, [POSE], m).matrices,
    "SampledServo": lambda m: SampledServo(robot(), POSE, cable_model=m).gamma.cable_model,
    "compare_cable_models": lambda m: compare_cable_models([robot()], [m]).rows[0].cable_model,
    "Comparison.of": lambda m: len(compare_cable_models([robot()], ["ECM"]).of(m)),
    "default_gain": lambda m: default_gain(robot(), POSE, m).gain,
    "explore_pose": lambda m: explore_pose(robot(), POSE, m).cable_model,
    "run": named("run", several=True),
    "coupling": named("coupling", several=True),
    "linearize": named("linearize"),
    "stability": named("stability"),
    "sweep": named("sweep"),
    "explore": named("explore"),
}
SLOW = {"default_gain": ("ECM",), "make_vision_based_control": ("ECM", "SLSM")}


@pytest.mark.parametrize("asked", ASKED)
def test_lower_case_is_taken_for_upper_case(asked: str) -> None:
    for model in SLOW.get(asked, models.CABLE_MODELS):
        found = ASKED[asked](model)
        for spelling in (model.lower(), model.title(), f" {model} "):
            np.testing.assert_array_equal(ASKED[asked](spelling), found)
        assert not isinstance(found, str) or found == model


@pytest.mark.parametrize("asked", ASKED)
@pytest.mark.parametrize("bad", ["XYZ", "", "S CMWE", "ECM,SLSM,"])
def test_what_is_no_cable_model_is_refused_with_those_there_are(asked: str, bad: str) -> None:
    if "," in bad and asked in ("run", "coupling"):
        return  # which take several
    if not bad and asked in ("run", "coupling"):
        return  # none of several: the default
    known = rf'unknown cable model "{bad}"; known are ECM, CMWE, SCMWE, SLSM'
    with pytest.raises((ValueError, UsageError), match=known):
        ASKED[asked](bad)


def test_several_are_taken_on_a_command_line() -> None:
    options = parse(["run", "--cable-model", "ecm, Slsm", "--cable-model", "SCMWE"]).options
    assert options.cable_model == ["ECM", "SLSM", "SCMWE"]
