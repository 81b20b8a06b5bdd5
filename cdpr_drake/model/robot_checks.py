"""What makes a robot valid, all in one place. Runs whenever a `CableRobot` is made."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from cdpr_drake.model.vision.cameras import camera_problems

if TYPE_CHECKING:
    from cdpr_drake.model.robot import CableRobot

_STIFFEST = 1e15  # N, above which squares would leave the range of numbers

_STEEL, _FIBRE = 7850.0, (500.0, 1500.0)  # kg/m3, of ropes of fibres over their gross section

Problems = Iterator[tuple[str, str]]

PER_CABLE = ("cable.drum_run", "winch.encoder_zero_length", "load_cells.bias", "load_cells.gain")

_POSITIVE = (
    "gravity",
    "platform.mass",
    "cable.linear_density",
    "cable.diameter",
    "cable.section",
    "cable.stiffness.asymptote",
    "cable.stiffness.offset",
    "cable.max_tension",
    "cable.breaking_load",
    "winch.transmission",
    "winch.inertia",
    "winch.torque_limit",
    "winch.coulomb_rate",
    "winch.capstan_speed",
    "cameras.sample_time",
    "load_cells.gain",
    "load_cells.cutoff",
    "load_cells.order",
)
_NOT_NEGATIVE = (
    "payload.mass",
    "pulleys.radius",
    "cable.damping_time",
    "cable.drum_run",
    "cable.min_tension",
    "winch.damping",
    "winch.proportional_gain",
    "winch.integral_gain",
    "winch.derivative_gain",
    "winch.coulomb_torque",
    "winch.capstan_exponent",
    "cameras.position_noise",
    "cameras.orientation_noise",
    "cameras.tangent_noise",
    "cameras.latency",
    "cameras.pixel_noise",
    "cameras.pixel_bias",
    "cameras.line_noise",
    "load_cells.noise",
    "load_cells.vibration_amplitude",
)
_FINITE = (
    "drawing_points",
    "attachment_points",
    "platform.center_of_mass",
    "platform.inertia",
    "payload.center_of_mass",
    "payload.inertia",
    "cable.stiffness.softening",
    "winch.encoder_zero_length",
    "load_cells.bias",
)


def geometry_problems(robot: CableRobot) -> Problems:
    """Yields (field, what is wrong) for the points that say how many cables there are.

    Args:
        robot: the robot, as given.
    """
    shape = robot.drawing_points.shape
    if len(shape) != 2 or shape[0] < 1 or shape[1] != 3:
        yield "drawing_points", f"must have shape (k, 3) with k >= 1, got {shape}"
    if robot.attachment_points.shape != shape:
        got = robot.attachment_points.shape
        yield "attachment_points", f"must have the shape of drawing_points, {shape}, got {got}"


def value_problems(robot: CableRobot) -> Problems:
    """Yields (field, what is wrong) for everything else.

    Args:
        robot: the robot, its per-cable values given for each cable.
    """
    yield from _shapes(robot)
    yield from _pulleys(robot)
    for path in _FINITE:
        yield from _require(robot, path, np.isfinite, "finite")
    for path in _POSITIVE:
        yield from _positive(robot, path)
    for path in _NOT_NEGATIVE:
        yield from _require(robot, path, lambda v: np.isfinite(v) & (v >= 0), ">= 0 and finite")
    if robot.gain is not None:
        yield from _positive(robot, "gain")
    if robot.winch.mounted_on != "frame":
        text = "must be frame: winches that ride on the platform are not modelled"
        yield "winch.mounted_on", f"{text}, got {robot.winch.mounted_on!r}"
    if robot.floor is not None:
        yield from _require(robot, "floor", np.isfinite, "finite")
    for name in ("X_WF", "X_PM"):
        X: Any = getattr(robot.cameras, name)
        if not (np.all(np.isfinite(X.GetAsMatrix34())) and X.rotation().IsValid()):
            yield f"cameras.{name}", "must be a finite translation and a rotation"
    yield from _twins(robot)
    yield from _inertias(robot)
    yield from _cable(robot)
    yield from camera_problems(robot.cameras)
    band = robot.load_cells.vibration_band
    if band.shape != (2,) or not 0.0 < band[0] <= band[1] < np.inf:
        got = band.tolist()
        yield "load_cells.vibration_band", f"must be two frequencies, not falling, got {got}"
    for path in robot.sources:
        try:
            attrgetter(path)(robot)
        except AttributeError:
            yield "sources", f"{path!r} is not a field of a robot"


def oddities(robot: CableRobot) -> Problems:
    """Yields (field, what is unusual) for values that are valid but may be a slip.

    Args:
        robot: a valid robot.
    """
    density = robot.cable.linear_density / robot.cable.section
    if abs(density / _STEEL - 1.0) > 0.1 and not _FIBRE[0] <= density <= _FIBRE[1]:
        usual = "steel has {:.0f} kg/m3, ropes of fibres have {:.0f} to {:.0f}".format(
            _STEEL, *_FIBRE
        )
        yield "cable.linear_density", f"over section it is {density:.0f} kg/m3; {usual}"


def _shapes(robot: CableRobot) -> Problems:
    wanted: dict[str, tuple[int, ...]] = dict.fromkeys(PER_CABLE, (robot.num_cables,))
    for body in ("platform", "payload"):
        wanted |= {f"{body}.center_of_mass": (3,), f"{body}.inertia": (3, 3)}
    for path, shape in wanted.items():
        got = attrgetter(path)(robot).shape
        if got != shape:
            yield path, f"must have shape {shape}, got {got}"


def _positive(robot: CableRobot, path: str) -> Problems:
    yield from _require(robot, path, lambda v: np.isfinite(v) & (v > 0), "positive and finite")


def _require(robot, path: str, test, wanted: str) -> Problems:  # type: ignore[no-untyped-def]
    value = np.asarray(attrgetter(path)(robot))
    good = test(value)
    if value.ndim == 0 and not good:
        yield path, f"must be {wanted}, got {value.item()!r}"
    elif not np.all(good):
        row = int(np.argwhere(~good)[0][0])
        what = f"cable {row + 1}" if value.shape[0] == robot.num_cables else f"entry {row + 1}"
        yield path, f"must be {wanted}, got {value[row].tolist()!r} for {what}"


def _twins(robot: CableRobot) -> Problems:
    ends = np.hstack([robot.drawing_points, robot.attachment_points])
    for i, j in combinations(range(robot.num_cables), 2):
        if np.array_equal(ends[i], ends[j]):
            yield "drawing_points", f"cables {i + 1} and {j + 1} are the same at both ends"


def _pulleys(robot: CableRobot) -> Problems:
    k, pulleys = robot.num_cables, robot.pulleys
    radius, axis = pulleys.radius, pulleys.axis
    if radius.shape not in ((), (k,)):
        got = f"got {len(radius)}" if radius.ndim == 1 else f"got shape {radius.shape}"
        yield "pulleys.radius", f"must be one number, or one for each of the {k} cables, {got}"
    if axis is None:
        if np.any(radius):
            text = "is missing: [0, 0, 1] for pulleys fed from below, [0, 0, -1] from above"
            yield "pulleys.axis", f"{text}, or one such axis for each of the {k} cables"
        return
    if axis.shape not in ((3,), (k, 3)):
        got = f"got {len(axis)}" if axis.ndim == 2 else f"got shape {axis.shape}"
        yield "pulleys.axis", f"must be one direction, or one for each of the {k} cables, {got}"
    for i, one in enumerate(axis.reshape(-1, 3)):
        if not 0.0 < np.linalg.norm(one) < np.inf:
            which = f" for cable {i + 1}" if axis.ndim == 2 else ""
            yield "pulleys.axis", f"must be a direction, got {one.tolist()}{which}"


def _inertias(robot: CableRobot) -> Problems:
    for name in ("platform", "payload"):
        body = getattr(robot, name)
        inertia, path = body.inertia, f"{name}.inertia"
        if body.mass == 0.0:
            if np.any(inertia):
                yield path, "must be zero, for the mass is zero"
            continue
        size = np.abs(inertia).max()
        if not np.allclose(inertia, inertia.T, rtol=0.0, atol=1e-9 * size):
            yield path, f"must be symmetric, got {inertia.tolist()}"
            continue
        low, mid, high = np.linalg.eigvalsh(inertia)
        moments = f"principal moments are {low:.6g}, {mid:.6g}, {high:.6g} kg m2"
        if name == "platform" and low <= 0.0:
            yield path, f"must be positive definite, but its {moments}"
        elif low < -1e-9 * size:
            yield path, f"must not be negative, but its {moments}"
        elif high > (low + mid) * (1.0 + 1e-9):
            yield path, f"no body has it: its {moments}, the last above the sum of the others"


def _cable(robot: CableRobot) -> Problems:
    cable = robot.cable
    if cable.stiffness(0.0) <= 0.0:
        yield "cable.stiffness", f"must be positive at no tension, got {cable.stiffness(0.0):g} N"
    if cable.stiffness.asymptote > _STIFFEST:
        got = f"got {cable.stiffness.asymptote:g} N"
        yield "cable.stiffness", f"must not exceed {_STIFFEST:g} N, {got}"
    circle = 0.25 * math.pi * cable.diameter**2
    if cable.section > circle:
        yield "cable.section", f"{cable.section:g} m2 exceeds the circle's, {circle:g} m2"
    if cable.min_tension >= cable.max_tension:
        limits = f"{cable.max_tension:g} N, got {cable.min_tension:g} N"
        yield "cable.min_tension", f"must be below max_tension, {limits}"
    low, high = cable.limits
    if cable.tension_margin is not None and not (cable.tension_margin >= 0.0 and low < high):
        text = "must not be negative, and leave something between the limits"
        yield "cable.tension_margin", f"{text}, got {cable.tension_margin:g} N"
    preferred = cable.preferred_tension
    if preferred is not None and not cable.min_tension <= preferred <= cable.max_tension:
        yield "cable.preferred_tension", f"must be within the limits, got {preferred:g} N"
    if cable.max_tension > cable.breaking_load:
        limits = f"{cable.breaking_load:g} N, got {cable.max_tension:g} N"
        yield "cable.max_tension", f"must not exceed breaking_load, {limits}"
