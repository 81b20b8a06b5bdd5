"""Figures of modes: where their eigenvalues lie, how they move the platform, when they grow.

Every function returns a matplotlib Figure that belongs to no window.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from cdpr_drake.analysis.stability import StabilityMap
from cdpr_drake.model.kinematics import cable_ends
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.room import room_of
from cdpr_drake.model.rotations import as_pose, pose_to_vector, vector_to_pose
from cdpr_drake.model.signals import POSE
from cdpr_drake.show.plots import _figure, _legend_below, spread
from cdpr_drake.show.scene import LEAST
from cdpr_drake.show.style import REFERENCE, RUN_COLOURS, cable_style
from cdpr_drake.study.modes import Mode, Modes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SLOW = 1e-2
"""Rates below this [1/s] are drawn on a linear scale, those above on a logarithmic one."""

MARKERS = ("x", "+", "o", "^", "s")
MARKER_OF_MODE = ("o", "s", "^", "D", "v", "P")

ALIKE = 3.0
"""Real poles of one name whose rates differ by less than this factor share a label."""

POLE_HEIGHT = 5.2
"""Height of a pole map [inch]."""

ENLARGED = 0.35
"""How far the drawn platform moves at most, as a share of its size."""


def pole_figure(found: Mapping[str, Modes] | Modes, title: str = "") -> Figure:
    """Return the pole map of one or more linear models, each mode named by what takes part.

    The rate Re(s) on a logarithmic scale, so that servo (0.1 per s), winches (0.2 per s) and cables
    (50 per s) all show; the frequency Im(s) / 2 pi of the upper half plane. Sampled loops are
    mapped by s = ln(z) / T, and their z are shown beside, with the unit circle.

    Args:
        found: modes, by label.
        title: of the figure.

    Raises:
        ValueError: no modes.
    """
    models = {"modes": found} if isinstance(found, Modes) else dict(found)
    if not any(len(modes) for modes in models.values()):
        raise ValueError("no modes to draw")
    sampled = {label: modes for label, modes in models.items() if modes.period is not None}
    figure = _figure(12.0 if sampled else 8.0, POLE_HEIGHT)
    ratios = (1.75, 1.0) if sampled else (1.0,)
    panels = figure.subplots(1, len(ratios), width_ratios=ratios, squeeze=False)[0]
    for axes in panels:
        axes.grid(True, color="0.9", linewidth=0.7)
        axes.set_axisbelow(True)
    _draw_rates(panels[0], models)
    if sampled:
        _draw_circle(panels[1], models)
    if title:
        figure.suptitle(title, fontsize=11)
    _legend_below(figure, panels[0])
    return figure


def mode_shape_figure(
    found: Modes,
    mode: Mode,
    robot: CableRobot,
    pose: RigidTransform | ArrayLike,
) -> Figure:
    """Return a mode's shape: the platform through a cycle, and the states that take part.

    The platform is drawn at its rest and at the two ends of the motion, enlarged to be seen, with
    the ways of the attachment points. The bars are the participation factors of `study.modes`.

    Args:
        found: the modes.
        mode: one of them.
        robot: the robot.
        pose: X_WP at rest, or [roll, pitch, yaw, x, y, z] (rad, m).

    Raises:
        ValueError: the platform's pose is not among the states.
    """
    shape = _platform_shape(found, mode)
    figure = _figure(10.5, 4.6)
    left, right = figure.subfigures(1, 2, width_ratios=(1.2, 1.0))
    _draw_motion(left.add_subplot(projection="3d"), shape, robot, as_pose(pose))
    axes = right.add_subplot()
    groups = found.participants(mode, 6)[::-1]
    names = ["/".join(name.split("/")[-2:]) for name, _ in groups]
    axes.barh(names, [100.0 * share for _, share in groups], color=RUN_COLOURS[0], height=0.6)
    axes.set_ylim(len(groups) - max(len(groups), 5) - 0.6, len(groups) - 0.4)
    axes.set_xlabel("participation [%]")
    axes.set_xlim(0.0, 100.0)
    axes.grid(True, axis="x", color="0.9", linewidth=0.7)
    axes.set_axisbelow(True)
    figure.suptitle(_describe(found, mode), fontsize=11)
    return figure


def stability_figure(
    found: StabilityMap, at: tuple[float, float] | None = None, title: str = ""
) -> Figure:
    """Return the map of stability over latency and gain, with the limit and the mode it is due to.

    Colours tell how fast the mode that decays least decays (blue) or grows (red). The line is the
    limit, the smallest unstable gain, its markers the mode that goes unstable there; gains that are
    stable above it, or unstable again, are islands, outlined in black.

    Args:
        found: from `stability_map`.
        at: (gain [1/s], latency [s]) to mark; nothing if None.
        title: of the figure.
    """
    from matplotlib.colors import SymLogNorm

    figure = _figure(9.0, 5.2)
    axes = figure.subplots()
    milliseconds = 1e3 * found.latencies
    norm = SymLogNorm(linthresh=0.02, vmin=-3.0, vmax=3.0)
    mesh = axes.pcolormesh(
        milliseconds, found.gains, found.growth.T, shading="nearest", cmap="RdBu_r", norm=norm,
        rasterized=True,
    )  # fmt: skip
    figure.colorbar(mesh, ax=axes, label="growth of the least damped mode [1/s]", pad=0.01,
                    ticks=[-1, -0.1, 0, 0.1, 1], extend="both")  # fmt: skip
    if min(found.growth.shape) > 1 and found.growth.min() < 0.0 < found.growth.max():
        axes.contour(milliseconds, found.gains, found.growth.T, levels=[0.0], colors="black",
                     linewidths=0.8)  # fmt: skip
    _draw_limits(axes, found)
    if at is not None:
        axes.plot(1e3 * at[1], at[0], "*", color="black", markersize=13, mec="white", clip_on=False,
                  label=f"$\\lambda$ = {at[0]:g} 1/s, {1e3 * at[1]:g} ms")  # fmt: skip
    axes.set_yscale("log")
    axes.set_ylim(found.gains.min(), found.gains.max())
    axes.set_xlabel("latency [ms]")
    axes.set_ylabel("gain $\\lambda$ [1/s]")
    if title:
        axes.set_title(title, fontsize=10.5)
    handles, labels = axes.get_legend_handles_labels()
    if labels:
        figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _draw_rates(axes: Axes, models: Mapping[str, Modes]) -> None:
    """Draw Re(s), symmetric logarithmic, over Im(s) / 2 pi; unstable half plane shaded."""
    axes.set_xscale("symlog", linthresh=SLOW)
    places = {label: _places(modes) for label, modes in models.items()}
    every = np.concatenate(list(places.values()))
    for i, label in enumerate(models):
        axes.plot(
            *places[label].T, MARKERS[i % len(MARKERS)], color=RUN_COLOURS[i % len(RUN_COLOURS)],
            label=label, markersize=7, mew=1.5, fillstyle="none", linestyle="none",
        )  # fmt: skip
    low = 4.0 * min(float(every[:, 0].min()), -1.0)
    high = 4.0 * max(float(every[:, 0].max()), SLOW)
    highest = max(float(every[:, 1].max()), 1.0)
    halves = {0.5 / modes.period for modes in models.values() if modes.period is not None}
    top = 1.12 * max([highest, *(half for half in halves if half < 2.0 * highest)])
    axes.axvspan(0.0, high, color="#F6DED5", zorder=0, linewidth=0)
    axes.axvline(0.0, color="black", linewidth=0.8)
    axes.axhline(0.0, color="black", linewidth=0.8, zorder=0)
    axes.set_xlim(low, high)
    axes.set_ylim(-0.36 * top, top)  # room below for the names of the real poles
    axes.set_yticks([tick for tick in axes.get_yticks() if 0.0 <= tick <= top])
    for i, modes in enumerate(models.values()):
        shown = [m for m in modes.modes if i == 0 or m in modes.unstable]
        _name_real_poles(axes, modes, shown)
        _name_oscillations(axes, modes, shown, top)
    for half in halves:
        if half < top:
            axes.axhline(half, color=REFERENCE, linewidth=0.8, linestyle=(0, (6, 3)))
            axes.text(0.98 * low, half, " half the sampling rate: folded down above",
                      fontsize=7.5, color="0.35", va="bottom")  # fmt: skip
    axes.set_xlabel("rate Re $s$ [1/s], linear below 0.01")
    axes.set_ylabel("frequency Im $s$ / 2$\\pi$ [Hz]")


def _places(modes: Modes) -> np.ndarray:
    """Return rate [1/s] and frequency [Hz] of each mode (n, 2), zero if neutral."""
    s = [0.0 if mode.is_neutral else mode.eigenvalue for mode in modes.modes]
    values = np.array(s, complex)
    return np.column_stack([values.real, values.imag / (2.0 * math.pi)])


def _name_real_poles(axes: Axes, modes: Modes, shown: list[Mode]) -> None:
    """Write names and numbers of the real poles below them, those alike together."""
    groups: list[tuple[str, list[float]]] = []
    for mode in shown:
        if mode.eigenvalue.imag and not mode.is_neutral:
            continue
        rate, name = (0.0 if mode.is_neutral else mode.eigenvalue.real), modes.name(mode)
        for known, rates in groups:
            if known == name and (rate == rates[0] or 0.0 < rate / (rates[0] or rate) < ALIKE):
                break
        else:
            groups.append((name, rates := []))
        # Zeros that round-off has made a complex pair are two all the same.
        rates += [rate, rate] if mode.eigenvalue.imag else [rate]
    for name, rates in groups:
        count = f"{len(rates)} × " if len(rates) > 1 else ""
        axes.annotate(
            count + name, (float(np.median(rates)), 0.0), xytext=(4, -7),
            textcoords="offset points", fontsize=8, color="0.3", rotation=40, ha="right", va="top",
            rotation_mode="anchor",
        )  # fmt: skip


def _name_oscillations(axes: Axes, modes: Modes, shown: list[Mode], top: float) -> None:
    """Write name and frequency beside each oscillating mode, equal names at one place once."""
    groups: dict[tuple[str, int], list[Mode]] = {}
    for mode in shown:
        if mode.eigenvalue.imag and not mode.is_neutral:
            folded = mode.eigenvalue.imag / (2.0 * math.pi)
            groups.setdefault((modes.name(mode), round(folded)), []).append(mode)
    if not groups:
        return
    middle = [np.median(_places(Modes(modes=tuple(g), states=())), axis=0) for g in groups.values()]
    heights = top * spread(np.array([y for _, y in middle]) / top, 0.045)
    for (name, _), group, (x, y), height in zip(
        groups, groups.values(), middle, heights, strict=True
    ):
        count = f"{len(group)} × " if len(group) > 1 else ""
        frequency = np.median([mode.eigenvalue.imag for mode in group]) / (2.0 * math.pi)
        side = -1 if x > -SLOW else 1
        axes.annotate(
            f"{count}{name}, {frequency:.3g} Hz", (x, y), va="center", textcoords="offset points",
            xytext=(8 * side, _points(axes, height - y)), fontsize=8, color="0.3",
            ha="right" if side < 0 else "left", zorder=1.5,
        )  # fmt: skip


def _points(axes: Axes, height: float) -> float:
    """Return a height in data in points, as nearly as it can be told before the figure is drawn."""
    low, high = axes.get_ylim()
    return 60.0 * POLE_HEIGHT * height / (high - low)


def _draw_circle(axes: Axes, models: Mapping[str, Modes]) -> None:
    """Draw the eigenvalues z of sampled loops in the unit circle, frequencies around it."""
    angle = np.linspace(0.0, 2.0 * math.pi, 361)
    axes.fill(1.6 * np.array([-1, 1, 1, -1]), 1.6 * np.array([-1, -1, 1, 1]), color="#F6DED5",
              zorder=0, linewidth=0)  # fmt: skip
    axes.fill(np.cos(angle), np.sin(angle), color="white", zorder=0.1)
    axes.plot(np.cos(angle), np.sin(angle), color="black", linewidth=0.8)
    for i, modes in enumerate(models.values()):
        if modes.period is None:
            continue
        z = np.array([mode.z for mode in modes.modes], complex)
        z = np.concatenate([z, z[z.imag != 0.0].conj()])
        axes.plot(
            z.real, z.imag, MARKERS[i % len(MARKERS)], color=RUN_COLOURS[i % len(RUN_COLOURS)],
            markersize=7, mew=1.5, fillstyle="none", linestyle="none",
        )  # fmt: skip
    period = next(modes.period for modes in models.values() if modes.period is not None)
    for share in (0.25, 0.5, 0.75, 1.0):
        turn = math.pi * share
        axes.text(1.13 * math.cos(turn), 1.13 * math.sin(turn), f"{0.5 * share / period:.3g} Hz",
                  fontsize=8, color="0.35", ha="center", va="center")  # fmt: skip
    axes.set_aspect("equal")
    axes.set_xlim(-1.3, 1.3)
    axes.set_ylim(-1.3, 1.3)
    axes.set_xlabel("Re $z$")
    axes.set_ylabel("Im $z$")


def _platform_shape(found: Modes, mode: Mode) -> np.ndarray:
    """Return a mode's six entries of the platform's pose."""
    where = [
        i
        for name in POSE
        for i, state in enumerate(found.states)
        if state.split("/")[-2:] == ["platform", name]
    ]
    if len(where) != 6:
        raise ValueError("the platform's pose is not among the states of these modes")
    return mode.shape[where]


def _moved(X_WP: RigidTransform, change: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return where points of the platform (n, 3) are after a change of its pose (6,)."""
    X = vector_to_pose(pose_to_vector(X_WP) + change)
    return np.asarray((X @ points.T).T, float)


def _draw_motion(axes: Any, values: np.ndarray, robot: CableRobot, X_WP: RigidTransform) -> None:
    """Draw the platform at rest, at the ends of its motion, and the ways of its corners."""
    B = robot.attachment_points
    low, high = B.min(axis=0), B.max(axis=0)
    size = max(float(np.linalg.norm(high - low)), LEAST * room_of(robot).size)
    reach = np.linalg.norm(values[3:]) + 0.5 * size * np.linalg.norm(values[:3])
    scale = ENLARGED * size / reach if reach > 0.0 else 0.0
    values = values * np.exp(-1j * np.angle(values[np.argmax(np.abs(values))]))  # ends at 0 and pi
    cycle = values * np.exp(1j * np.linspace(0.0, 2.0 * math.pi, 61))[:, None]
    way = np.array([_moved(X_WP, scale * x.real, B) for x in cycle])
    corners = np.array(list(itertools.product(*zip(low, high, strict=True))))
    ends = [np.zeros(6), scale * cycle[0].real, scale * cycle[30].real]
    for change, colour, width in zip(
        ends, ("0.45", RUN_COLOURS[0], RUN_COLOURS[1]), (1.0, 1.6, 1.6), strict=True
    ):
        box = _moved(X_WP, change, corners)
        for i, j in itertools.combinations(range(8), 2):
            if (i ^ j).bit_count() == 1:
                axes.plot(*box[[i, j]].T, color=colour, linewidth=width)
    cables = cable_ends(robot, X_WP)
    for i, (rest, chord) in enumerate(zip(cables.p_WB, cables.chord, strict=True)):
        stub = np.array([rest, rest - 0.6 * size * chord / max(np.linalg.norm(chord), 1e-9)])
        axes.plot(*stub.T, linewidth=0.9, **cable_style(i))
        axes.plot(*way[:, i].T, linewidth=1.4, **cable_style(i))
    middle = (X_WP @ (0.5 * (low + high))).ravel()
    for name, m in zip("xyz", middle, strict=True):
        getattr(axes, f"set_{name}lim")(m - 0.75 * size, m + 0.75 * size)
        getattr(axes, f"set_{name}label")(f"{name} [m]", fontsize=8)
        getattr(axes, f"{name}axis").set_tick_params(labelsize=7)
    axes.set_box_aspect((1, 1, 1))
    axes.view_init(elev=18, azim=-60)
    axes.set_title("the motion, enlarged, at its two ends; rest in grey", fontsize=9, color="0.35")


def _describe(found: Modes, mode: Mode) -> str:
    """Return a mode's name, frequency, damping and time constant."""
    if mode.is_neutral:
        return "neutral"
    parts = [found.name(mode)]
    if mode.frequency > 0.0:
        parts += [f"{mode.frequency:.3g} Hz", f"damping {100.0 * mode.damping:.2g} %"]
    word = "time constant" if mode.is_stable else "grows by a factor e in"
    return ", ".join([*parts, f"{word} {abs(mode.time_constant):.3g} s"])


def _draw_limits(axes: Axes, found: StabilityMap) -> None:
    """Draw the limits over the latency, a colour for each mode that goes unstable there."""
    rows = [(L, x) for L, x in zip(found.latencies, found.limits, strict=True) if x.unstable]
    names = list(dict.fromkeys(limit.mode for _, limit in rows))
    axes.plot([1e3 * L for L, _ in rows], [x.gain for _, x in rows], color="black", linewidth=1.0)
    for i, name in enumerate(names):
        mine = [(1e3 * L, x.gain, x.frequency) for L, x in rows if x.mode == name]
        latency, gain, frequency = np.array(mine).T
        span = f"{frequency.min():.2g}"
        if f"{frequency.max():.2g}" != span:
            span += f" to {frequency.max():.2g}"
        axes.plot(latency, gain, MARKER_OF_MODE[i % len(MARKER_OF_MODE)], markersize=6, mec="black",
                  color=RUN_COLOURS[i % len(RUN_COLOURS)], linestyle="none",
                  label=f"{name}, {span} Hz")  # fmt: skip
