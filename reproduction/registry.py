"""The tables and figures of the paper that are made again, in the order of the report."""

from __future__ import annotations

from typing import cast

from reproduction import cable_modes, figure16, figures, slips, table4, table5, table6, table7
from reproduction.section import Reproduction


def reproductions() -> dict[str, Reproduction]:
    """Return all of them by name."""
    of_tests = {part.name: part for part in figures.FIGURES}
    parts = (
        table4,
        *(of_tests[name] for name in ("figure10", "figure11", "figure12")),
        table5,
        *(of_tests[name] for name in ("figure13", "figure14", "figure15")),
        table6,
        table7,
        figure16,
        slips,
        cable_modes,
    )
    return {part.name: part for part in cast(tuple[Reproduction, ...], parts)}
