"""Runs of the paper's tests as lines over time, and the panels that show them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from cdpr_drake.model.calibration_errors import CalibrationErrors, misjudged
from cdpr_drake.model.rotations import Array
from cdpr_drake.runs import Run, run, setup_of_test
from reproduction.section import Line, Panel, Result

MAX_STEP = 0.02
"""Of the integrator [s]; the errors are those of 0.01 s to 0.03 mm."""

POINTS = 400
"""Of a line: as many as a figure can show."""

ERRORS = ("$t_x$", "$t_y$", "$t_z$", "$θu_x$", "$θu_y$", "$θu_z$")


def trace(number: int, cable_model: str, setting: str) -> Result:
    """Return a run of one of Tests 1 to 5 under vision-based control.

    Args:
        number: of the test.
        cable_model: of the law.
        setting: "robot", with noise and one random calibration, or "simulator", where the
            measurements are perfect, as in section 7.2.
    """
    setup = setup_of_test(number, cable_model=cable_model, max_step=MAX_STEP, seed=number)
    if setting == "robot":
        setup = setup.replace(believed=misjudged(setup.robot, CalibrationErrors(), number))
    else:
        setup = setup.replace(noise=False)
    return lines_of(run(setup))


def lines_of(done: Run) -> Result:
    """Return what figures show of a run, at some `POINTS` instants.

    Args:
        done: the run.

    Returns:
        time (n,) [s]; error (n, 6), s_t and s_w as the controller sees them [mm, deg];
        tension (n, k) at the winches as the load cells give it, filtered [N]; dbeta (n, k) [deg];
        velocity (n, 3) of the platform, a central difference [mm/s]; gain [1/s].
    """
    record = done.record
    shown = slice(0, None, max(1, len(record.time) // POINTS))
    seen = record["pose_error_seen"]
    velocity = np.gradient(1e3 * record["pose"][:, 3:], record.time, axis=0)
    return {
        "time": record.time[shown],
        "error": np.hstack([1e3 * seen[shown, 3:], np.degrees(seen[shown, :3])]),
        "tension": record["measured_tension"][shown],
        "dbeta": np.degrees(record["dbeta"][shown]),
        "velocity": velocity[shown],
        "gain": done.setup.gain,
    }


# --- numbers of a run


def sizes(result: Result) -> Array:
    """Return the norms (n, 2) of position [mm] and orientation error [deg].

    Args:
        result: of `trace`.
    """
    return np.linalg.norm(result["error"].reshape(-1, 2, 3), axis=2)


def rate(result: Result) -> float:
    """Return the rate [1/s] of the exponential that fits the position error best.

    From a tenth of the run, when the start is over, to where 2 % of the error is left.

    Args:
        result: of `trace`.
    """
    time, size = result["time"], sizes(result)[:, 0]
    end = int(np.argmax(size < 0.02 * size[0])) or len(size)
    begin = min(len(size) // 10, end - 2)
    return -float(np.polyfit(time[begin:end], np.log(size[begin:end]), 1)[0])


def difference(result: Result, other: Result) -> float:
    """Return the largest distance of two runs' position errors over the first error's size [-].

    Args:
        result: of `trace`.
        other: the same, at the same instants.
    """
    apart = np.linalg.norm(result["error"][:, :3] - other["error"][:, :3], axis=1)
    return float(apart.max() / sizes(result)[0, 0])


# --- panels


def error_panels(runs: Mapping[str, Result], title: str = "") -> tuple[Panel, Panel]:
    """Return the panels of position and orientation errors; runs differ in their dashes.

    Args:
        runs: by what they are; a single one needs no name.
        title: of both.
    """
    return (
        Panel(
            title=title or "position error",
            y_label="position error [mm]",
            lines=tuple(_components(runs, "error", ERRORS, range(3))),
        ),
        Panel(
            title=title or "orientation error",
            y_label="orientation error [deg]",
            lines=tuple(_components(runs, "error", ERRORS, range(3, 6))),
        ),
    )


def velocity_panel(runs: Mapping[str, Result], title: str = "velocity") -> Panel:
    """Return the panel of the platform's velocity; runs differ in their dashes.

    Args:
        runs: by what they are.
        title: of the panel.
    """
    names = ("$v_x$", "$v_y$", "$v_z$")
    lines = _components(runs, "velocity", names, range(3))
    return Panel(title=title, y_label="velocity [mm/s]", lines=tuple(lines))


def cable_panel(result: Result, signal: str, title: str, y_label: str) -> Panel:
    """Return the panel of a quantity of each cable.

    Args:
        result: of `trace`.
        signal: "tension" or "dbeta".
        title: of the panel.
        y_label: quantity and unit.
    """
    values = np.asarray(result[signal])
    lines = tuple(
        Line(label=f"cable {i + 1}", x=result["time"], y=values[:, i], colour=i)
        for i in range(values.shape[1])
    )
    return Panel(title=title, y_label=y_label, lines=lines)


def _components(
    runs: Mapping[str, Result], signal: str, names: Sequence[str], which: Iterable[int]
) -> Iterable[Line]:
    for column in which:
        for dash, (run_name, result) in enumerate(runs.items()):
            yield Line(
                label=f"{names[column]} {run_name}".strip(),
                x=result["time"],
                y=_column(result[signal], column),
                colour=column % 3,
                dash=dash,
            )


def _column(values: Any, column: int) -> Array:
    return np.asarray(values)[:, column]
