"""What there is to say about Table 7 and Fig. 16, from the results of `table7`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from cdpr_drake.model.rotations import Array
from reproduction.assumptions import assumptions
from reproduction.table7.large_robot import DURATION, GOAL, MODELS, printed_errors
from reproduction.section import Result, Section, Table
from reproduction.table7.claims import (
    ALONG,
    FAST_RAMP,
    FRACTIONS,
    claims,
    delta_t,
    errors_of,
    excursions,
    printed_delta_t,
)
from reproduction.table7.variations import variations


def section(results: Mapping[str, Result]) -> Section:
    """Return the section on Table 7.

    Args:
        results: of all cases, by their keys.
    """
    given = assumptions("table7")
    fitted = [n for n, a in given.items() if a.kind == "fitted"]
    ours = errors_of(results, "move")
    distance = float(np.linalg.norm(GOAL.translation()))
    implied = np.log(1e3 * distance / (3.0 * printed_errors()[0, 0])) / DURATION
    return Section(
        name="table7",
        title="Table 7, Fig. 16: 20 m across a room of 75 x 98 x 38.9 m",
        text=(
            "From E = (0, 0, 0) to (20, 0, 0) m, level, 105 s, with perfect measurements; the "
            "vision-based law with four cable models, the plant always on elastic catenaries. The "
            "goal is given in F_b, errors are the true ones: in position those of the target "
            "frame's origin along the axes of F_b, in orientation the rotation vector.",
            "The printed final errors are no accuracies but the end of a transient: the mean over "
            f"three axes of {distance:g} m exp(-λ {DURATION:g} s) is the ECM's "
            f"{printed_errors()[0, 0]:g} mm at λ = {implied:.4f} 1/s. Mass, cable, modulus, size "
            f"of the platform and calibration error are not printed. {len(fitted)} values are "
            f"fitted ({', '.join(fitted)}) to the 8 printed errors, from a coarse start and "
            "without dynamics; the table below is from the simulation with all dynamics and drag.",
            f"The ECM's orientation error of {printed_errors()[0, 1]:g}° cannot be a transient: "
            f"coupling leaves {_degrees(results, 'target_angle_low')} without calibration error, "
            f"and {_degrees(results, 'points')} with A and B as badly known as is likely. A target "
            f"frame turned by {given['target_angle'].value:.2f}° about each axis gives it, the "
            "same for all models.",
            _unstable(results),
        ),
        tables=(
            _comparison(results, ours),
            _delta_t_table(results),
            _excursion_table(results),
            _stability_table(results),
            _set_table(results),
            _variation_table(results),
        ),
        claims=claims(results),
        fitted={n: a.value for n, a in given.items()},
    )


def _comparison(results: Mapping[str, Result], ours: Array) -> Table:
    theirs, slow = printed_errors(), np.asarray(results["vary_none"]["errors"])
    return Table(
        title="Final errors, means of three axes",
        headings=(
            "model", "paper [mm]", "ours [mm]", "ours over paper", "paper, above ECM [mm]",
            "ours, above ECM [mm]", "paper [deg]", "ours [deg]", "ours over paper",
            "ours without dynamics [mm]",
        ),
        rows=tuple(
            (
                model, theirs[i, 0], ours[i, 0], ours[i, 0] / theirs[i, 0],
                theirs[i, 0] - theirs[0, 0], ours[i, 0] - ours[0, 0],
                theirs[i, 1], ours[i, 1], ours[i, 1] / theirs[i, 1], slow[i, 0],
            )
            for i, model in enumerate(MODELS)
        ),
    )  # fmt: skip


def _delta_t_table(results: Mapping[str, Result]) -> Table:
    rows = [
        (model, wanted, *(delta_t(results, model, f) for f in FRACTIONS))
        for model, wanted in zip(MODELS, printed_delta_t(), strict=False)
    ]
    left = (f"{100 * f:.0f} % left [s]" for f in FRACTIONS)
    return Table(
        title="Δt to the SLSM",
        headings=("model", "paper [s]", *left),
        rows=tuple(rows),
        note="Times at which the distance to the goal comes below a part of the first, to stay.",
    )


def _excursion_table(results: Mapping[str, Result]) -> Table:
    rows: list[tuple[Any, ...]] = []
    for key, text in [(f"move_{m}", m) for m in MODELS] + [
        (f"fast_{m}", f"{m}, ramp {FAST_RAMP:g} s") for m in MODELS
    ]:
        result = results[key]
        speed = np.abs(np.asarray(result["velocity"])).max(axis=0)
        tension = np.asarray(result["tension"])
        side = 1e3 * float(np.abs(np.asarray(result["position_error"])[:, 1]).max())
        z, turn = excursions(result)
        rows.append((text, z, side, turn, *speed.tolist(), tension.min(), tension.max()))
    return Table(
        title="Excursions, linear velocities, tensions",
        headings=(
            "run", "z [mm]", "y [mm]", "orientation [deg]", "largest vx [m/s]", "vy [m/s]",
            "vz [m/s]", "least tension [N]", "largest [N]",
        ),
        rows=tuple(rows),
        note="With a gain that rises within 1 s the platform swings, whatever the model.",
    )  # fmt: skip


def _unstable(results: Mapping[str, Result]) -> str:
    given = assumptions("table7")
    found = [results[f"stable_{x}"] for x in ALONG]
    growth = [r["growth"] for r in found]
    least = max(r["drag"] for r in found)
    return (
        f"With the damping assumed of the cables ({1e3 * given['damping_time'].value:g} ms times "
        f"their stiffness) this loop is unstable at λ = {given['gain'].value:g} 1/s: the "
        f"platform's lowest mode grows by {min(growth):.3f} to {max(growth):.3f} 1/s, half of λ, "
        "as an undamped mode does. Cables that sag so much hardly stretch, and only their stretch "
        f"is damped. A drag on the platform of {least:.3f} 1/s is the least with which it is "
        f"stable all along the move ({_percent(found)} of damping in that mode); the simulations "
        f"have {given['drag'].value:g} 1/s. What damps the paper's simulator, and its timing, are "
        "not printed, and nothing is claimed of them."
    )


def _percent(found: list[Result]) -> str:
    damping = [100.0 * r["damping"] for r in found]
    return f"{min(damping):.1f} to {max(damping):.1f} %"


def _stability_table(results: Mapping[str, Result]) -> Table:
    rows = []
    for x in ALONG:
        r = results[f"stable_{x}"]
        time = f"{r['damping_time']:.2f}" if math.isfinite(r["damping_time"]) else "more than 10"
        rows.append((x, r["growth"], r["frequency"], r["drag"], 100.0 * r["damping"], time))
    return Table(
        title="What keeps the loop stable at a goal on the way",
        headings=(
            "x [m]", "growth without drag [1/s]", "frequency [Hz]", "least drag [1/s]",
            "damping of the mode by it [%]", "or least damping time of the cables [s]",
        ),
        rows=tuple(rows),
    )  # fmt: skip


def _set_table(results: Mapping[str, Result]) -> Table:
    found = results["fit"]["values"]
    return Table(
        title="The set",
        headings=("value", "unit", "taken", "fit from a coarse start", "range", "kind"),
        rows=tuple(
            (n, a.unit, _text(a.value), found.get(n), _text(a.range or ""), a.kind)
            for n, a in assumptions("table7").items()
        ),
    )


def _text(value: Any) -> str:
    if isinstance(value, list | tuple):
        return " to ".join(f"{x:g}" for x in value) if len(value) == 2 else str(value)
    return f"{value:g}" if isinstance(value, float | int) else str(value)


def _variation_table(results: Mapping[str, Result]) -> Table:
    rows: list[tuple[Any, ...]] = []
    for key, (text, _) in variations().items():
        errors = np.asarray(results[f"vary_{key}"]["errors"])
        if results[f"vary_{key}"]["failed"]:
            rows.append((text, *[None] * 8))
            continue
        ordered = "yes" if np.all(np.diff(errors[:, 0]) > 0.0) else "no"
        rows.append(
            (text, *errors[:, 0].tolist(), errors[0, 1], errors[2, 1], errors[3, 1], ordered)
        )
    return Table(
        title="How the final errors depend on each value, without dynamics",
        headings=(
            "change", "ECM [mm]", "CMWE [mm]", "SCMWE [mm]", "SLSM [mm]", "ECM [deg]",
            "SCMWE [deg]", "SLSM [deg]", "order kept",
        ),
        rows=tuple(rows),
    )  # fmt: skip


def _degrees(results: Mapping[str, Result], key: str) -> str:
    return f"{np.asarray(results[f'vary_{key}']['errors'])[0, 1]:.4f}°"
