"""What a stereo pair sees of its two cables, with the edges detected in its images."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from cdpr_drake.model.rotations import Array
from cdpr_drake.model.vision.cable_drawing import StereoImage
from cdpr_drake.show.style import cable_colour

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ZOOM = 7.0
"""A magnified piece reaches this far from its middle [px]."""

INSET = 0.3
"""Its width in the figure, as part of the image's."""


def stereo_view_figure(images: StereoImage, edges: Mapping[int, Array]) -> Figure:
    """Return the two images of a pair with the edges detected in them.

    Circles mark where a cable was found. A piece of one cable in each image is magnified, so that
    its pixels show, and the edges between them: of that next to the side with room for it.

    Args:
        images: left and right one, of 8 bits.
        edges: of each cable by its number, (2, 2, n, 2) [px] by camera, edge and station, as
            `CableLines` gives them; NaN where not seen.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.5, 4.7), dpi=100, layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for side, (axes, image) in enumerate(zip(panels, images, strict=True)):
        height, width = image.shape
        axes.imshow(image, cmap="gray", vmin=0, vmax=255, interpolation="antialiased")
        for cable, seen in edges.items():
            _draw_cable(axes, cable, seen[side], cable == min(edges))
        _magnify(axes, image, {c: e[side] for c, e in edges.items()}, prefer_left=side == 0)
        axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), xlabel="u [px]")
        axes.set_title(("left camera", "right camera")[side], fontsize=11)
    panels[0].set_ylabel("v [px]")
    return figure


def _draw_cable(axes: Axes, cable: int, seen: Array, on_the_left: bool) -> None:
    """Mark where a cable's edges (2, n, 2) were found, and number it."""
    middle = seen.mean(axis=0)
    middle = middle[np.isfinite(middle[:, 0])]
    if not len(middle):
        return
    colour = cable_colour(cable - 1)
    axes.plot(*middle.T, "o", markersize=7, fillstyle="none", color=colour, markeredgewidth=1.0)
    axes.annotate(
        f"cable {cable}",
        middle[np.argmax(middle[:, 1])],
        (-9 if on_the_left else 9, -3),
        textcoords="offset points",
        ha="right" if on_the_left else "left",
        color=colour,
    )


def _magnify(axes: Axes, image: np.ndarray, edges: dict[int, Array], prefer_left: bool) -> None:
    """Show a piece of a cable large, where it hides no cable."""
    found = {c: np.isfinite(e).all(axis=(0, 2)) for c, e in edges.items()}
    spans = {
        c: (e[:, found[c], 0].min(), e[:, found[c], 0].max())
        for c, e in edges.items()
        if found[c].any()
    }
    if not spans:
        return
    height, width = image.shape
    first = min(spans, key=lambda c: spans[c][0])
    last = max(spans, key=lambda c: spans[c][1])
    room, other = spans[first][0], width - spans[last][1]
    left = room > (INSET + 0.05) * width if prefer_left else other < (INSET + 0.05) * width
    cable = first if left else last
    seen, there = edges[cable], found[cable]
    station = np.flatnonzero(there)[np.count_nonzero(there) // 2]
    u, v = np.round(seen[:, station].mean(axis=0))
    size = (INSET, INSET * width / height)
    inset = axes.inset_axes((0.02 if left else 0.98 - INSET, 0.55 - 0.5 * size[1], *size))
    inset.imshow(image, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
    colour = cable_colour(cable - 1)
    for edge in seen[:, there]:
        inset.plot(*edge.T, color=colour, linewidth=1.8, marker="o", markersize=6)
    inset.set(xlim=(u - ZOOM, u + ZOOM), ylim=(v + ZOOM, v - ZOOM), xticks=[], yticks=[])
    inset.set_title(f"{2 * ZOOM:.0f} px across cable {cable}", fontsize=9, color=colour)
    axes.indicate_inset_zoom(inset, edgecolor="black", linewidth=1.0, alpha=1.0)
