"""The tables and figures of the paper that are made again, in the order of the report."""

from __future__ import annotations

from typing import cast

from cdpr_drake.experiments.reproduction import figures
from cdpr_drake.experiments.reproduction.section import Reproduction


def reproductions() -> dict[str, Reproduction]:
    """Return all of them by name."""
    parts = (*figures.FIGURES,)
    return {part.name: part for part in cast(tuple[Reproduction, ...], parts)}
