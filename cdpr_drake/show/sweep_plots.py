"""The figure of a sweep: how far errors, settling, excursions and tensions spread."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from cdpr_drake.batch.sweeps import Sweep
from cdpr_drake.show.plots import _dress, _figure
from cdpr_drake.show.style import REFERENCE, RUN_COLOURS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PANELS = (
    ("position_error", "final error [mm]"),
    ("orientation_error", "final error [deg]"),
    ("settled_after", "settled to 2 % after [s]"),
    ("position_excursion", "off the straight way [mm]"),
    ("lowest_tension", "lowest tension [N]"),
    ("highest_tension", "highest tension [N]"),
)
DRAWN = (("payload", "payload [kg]"), ("gain", "gain [1/s]"))


def sweep_figure(found: Sweep) -> Figure:
    """Return a panel for each metric: over what was drawn, or how many cases came how far.

    Payload or gain is the abscissa where one was drawn (the payload if both were); else a panel
    shows the share of cases up to a value, with the median and the middle 90 % marked.

    Args:
        found: of `batch.monte_carlo.run_case`.

    Raises:
        ValueError: no case succeeded.
    """
    figure = _figure(9.6, 5.6)
    grid = figure.subplots(2, 3)
    _dress(grid)
    first = next((result for result in found if result is not None), None)
    if first is None:
        raise ValueError("no case succeeded: nothing to draw")
    over = next(((name, label) for name, label in DRAWN if name in first), None)
    for axes, (name, label) in zip(grid.flat, PANELS, strict=True):
        values = found.column(name)
        if over is not None:
            axes.plot(found.column(over[0]), values, "o", color=RUN_COLOURS[0], ms=4, alpha=0.6)
            axes.set_xlabel(over[1])
            axes.set_ylabel(label)
            axes.set_ylim(bottom=0.0)
        else:
            _draw_shares(axes, values[np.isfinite(values)], label)
    for row in grid:
        if over is None:
            row[0].set_ylabel("share of cases [%]")
    figure.suptitle(f"{len(found) - len(found.errors)} of {len(found)} cases", fontsize=11)
    return figure


def _draw_shares(axes: Any, values: np.ndarray, label: str) -> None:
    axes.set_xlabel(label)
    if not values.size:
        axes.text(0.5, 0.5, "in no case", transform=axes.transAxes, ha="center", color=REFERENCE)
        axes.set(xticks=[], yticks=[])
        return
    shares = 100.0 * np.arange(1, values.size + 1) / values.size
    axes.step(np.sort(values), shares, where="post", color=RUN_COLOURS[0])
    low, median, high = np.quantile(values, (0.05, 0.5, 0.95))
    axes.axvspan(low, high, color=RUN_COLOURS[0], alpha=0.1, lw=0)
    axes.axvline(median, color=REFERENCE, lw=1)
    axes.annotate(f"{median:.3g}", (median, 3.0), textcoords="offset points", xytext=(4, 0))
    axes.set_ylim(0.0, 102.0)
