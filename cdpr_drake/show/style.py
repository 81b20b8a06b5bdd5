"""Colours and lines: told apart by the colour-blind, in print too, and the same in every figure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

# M. Okabe and K. Ito's palette (2008), its yellow darkened to be seen on white.
RUN_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000")
RUN_DASHES = ("-", (0, (5, 1.5)), (0, (1, 1.2)), "-.", (0, (7, 2, 1, 2)))
CABLE_COLOURS = (
    "#000000", "#D55E00", "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#A89A00",
)  # fmt: skip
REFERENCE = "#9A9A9A"


def run_styles(labels: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Return the colour and dashes of each run, by its label.

    Args:
        labels: of the runs, in the order of the legend.
    """
    return {
        label: {
            "color": RUN_COLOURS[i % len(RUN_COLOURS)],
            "linestyle": RUN_DASHES[i % len(RUN_DASHES)],
            "label": label,
        }
        for i, label in enumerate(labels)
    }


def cable_colour(index: int) -> str:
    """Return the colour of a cable.

    Args:
        index: counting from 0.
    """
    return CABLE_COLOURS[index % len(CABLE_COLOURS)]


def cable_style(index: int) -> dict[str, Any]:
    """Return the colour of a cable, and dashes that tell it from others of that colour.

    Args:
        index: counting from 0.
    """
    dashes = RUN_DASHES[index // len(CABLE_COLOURS) % len(RUN_DASHES)]
    return {"color": cable_colour(index), "linestyle": dashes}
