"""Figures of the reproduction: as one picture in the paper's layout, or panel by panel."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from cdpr_drake.show import number_cables, style
from reproduction.section import Figure as PaperFigure
from reproduction.section import Panel

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PANEL = (4.6, 3.3)
"""Width and height of a panel [inch]."""


def paper_figure(figure: PaperFigure) -> Figure:
    """Return a figure as one picture.

    Args:
        figure: the figure.
    """
    from matplotlib.figure import Figure

    rows, columns = len(figure.panels), len(figure.panels[0])
    drawn = Figure(figsize=(PANEL[0] * columns, PANEL[1] * rows), layout="constrained")
    grid = drawn.subplots(rows, columns, squeeze=False)
    for axes, panel in zip(
        grid.flat, (panel for row in figure.panels for panel in row), strict=True
    ):
        _draw(axes, panel)
    drawn.suptitle(figure.title)
    return drawn


def panel_svg(panel: Panel, salt: str) -> str:
    """Return a panel as an SVG element, to be put into a page.

    Args:
        panel: the panel.
        salt: makes the names within differ from those of other pictures of the page.
    """
    import matplotlib
    from matplotlib.figure import Figure

    drawn = Figure(figsize=PANEL, layout="constrained")
    _draw(drawn.subplots(), panel)
    file = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": salt, "svg.fonttype": "path"}):
        drawn.savefig(
            file,
            format="svg",
            transparent=True,
            metadata={"Date": None, "Creator": None, "Format": None, "Type": None},
        )
    text = file.getvalue()
    return _with_own_names(text[text.index("<svg") :].strip(), salt)


def _with_own_names(svg: str, salt: str) -> str:
    """Return an SVG element with only the names that it refers to, and those made its own."""
    used = set(re.findall(r"(?:href=\"#|url\(#)([^\")]+)", svg))

    def name(found: re.Match[str]) -> str:
        return f' id="{salt}-{found[1]}"' if found[1] in used else ""

    svg = re.sub(r' id="([^"]+)"', name, svg)
    return re.sub(r'(href="#|url\(#)', rf"\g<1>{salt}-", svg)


def _draw(axes: Any, panel: Panel) -> None:
    of_cables = any(line.label.startswith("cable ") for line in panel.lines)
    for line in panel.lines:
        axes.plot(
            np.asarray(line.x),
            np.asarray(line.y),
            linewidth=1.2,
            color=style.cable_colour(line.colour) if of_cables else _run_colour(line.colour),
            linestyle=style.RUN_DASHES[line.dash % len(style.RUN_DASHES)],
            label=line.label or None,
        )
    axes.axhline(0.0, color=style.REFERENCE, linewidth=0.8, zorder=0)
    axes.grid(True, color="0.85", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.margins(x=0.01)
    axes.set_title(panel.title, fontsize=10)
    axes.set_xlabel(panel.x_label, fontsize=9)
    axes.set_ylabel(panel.y_label, fontsize=9)
    axes.tick_params(labelsize=8)
    if of_cables:
        axes.set_ylim(*axes.get_ylim())
        number_cables(axes)
    elif any(line.label for line in panel.lines):
        axes.legend(fontsize=8, frameon=False, ncols=1 + (len(panel.lines) > 4))


def _run_colour(index: int) -> str:
    return style.RUN_COLOURS[index % len(style.RUN_COLOURS)]
