"""Figure 16: the runs of Table 7 as lines, and the section of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cdpr_drake.model.rotations import Array
from reproduction.section import Case, Claim, Figure, Line, Panel, Result, Section
from reproduction.table7.large_robot import MODELS
from reproduction.table7.work import move
from reproduction.texts import Texts
from reproduction.traces import error_panels, velocity_panel

name = "figure16"

TEXTS = Texts(name)

SWUNG = 20.0
"""By then the swing of the start has died away [s]."""


def cases() -> Sequence[Case]:
    """Return one case for each model, the same as Table 7's."""
    return [Case(key=m, function=move, arguments={"cable_model": m}) for m in MODELS]


def section(results: Mapping[str, Result]) -> Section:
    """Return the figure, and what the paper says of it, from the `results` of all cases."""
    lines = {model: _lines(results[model]) for model in MODELS}
    panels = [
        (*error_panels({"": result}, model), velocity_panel({"": result}, model))
        for model, result in lines.items()
    ]
    return TEXTS.section(
        name,
        figures=(TEXTS.figure("errors", panels), _strays(lines)),
        claims=(_turns_away(lines), _overshoots_fade(results)),
    )


def _turns_away(lines: Mapping[str, Result]) -> Claim:
    growth = {}
    for model, result in lines.items():
        turn = np.linalg.norm(result["error"][:, 3:], axis=1)
        growth[model] = float(turn[np.asarray(result["time"]) > SWUNG].max() / turn[0])
    return TEXTS.claim(
        "turns_away",
        agrees=growth["SLSM"] > 1.0 > max(growth[model] for model in MODELS[:3]),
        kind="fitted",
        null_rate=1.0 / len(MODELS),
        growth=growth,
        swung=SWUNG,
    )


def _overshoots_fade(results: Mapping[str, Result]) -> Claim:
    z = {m: 1e3 * np.abs(np.asarray(results[m]["position_error"])[:, 2]) for m in MODELS}
    return TEXTS.claim(
        "overshoots_fade",
        agrees=all(error[-1] < 0.5 * error.max() for error in z.values()),
        kind="by construction",
        largest={model: error.max() for model, error in z.items()},
        last=[error[-1] for error in z.values()],
    )


def _lines(result: Result) -> Result:
    """Return a move as `traces.trace` gives a run."""
    turn = np.degrees(np.asarray(result["orientation_error_seen"]))
    return {
        "time": result["time"],
        "error": np.hstack([1e3 * np.asarray(result["position_error"]), turn]),
        "velocity": 1e3 * np.asarray(result["velocity"]),
    }


def _strays(lines: Mapping[str, Result]) -> Figure:
    errors = {model: np.asarray(result["error"]) for model, result in lines.items()}

    def panel(title: str, label: str, values: Mapping[str, Array]) -> Panel:
        drawn = tuple(
            Line(label=model, x=lines[model]["time"], y=y, colour=i, dash=i)
            for i, (model, y) in enumerate(values.items())
        )
        return Panel(title=title, y_label=label, lines=drawn)

    y, z = ({model: error[:, axis] for model, error in errors.items()} for axis in (1, 2))
    turns = {model: np.linalg.norm(error[:, 3:], axis=1) for model, error in errors.items()}
    row = (
        panel("$t_y$", "position error [mm]", y),
        panel("$t_z$", "position error [mm]", z),
        panel("orientation", "norm of $θu$ [deg]", turns),
    )
    return TEXTS.figure("strays", (row,))
