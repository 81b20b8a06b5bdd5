"""The tables and figures of the paper that are made again, in the order of the report."""

from __future__ import annotations

from typing import cast

from reproduction.cable_modes import section as cable_modes
from reproduction.figure16 import section as figure16
from reproduction.figures import section as figures
from reproduction.section import Reproduction
from reproduction.slips import section as slips
from reproduction.table4 import section as table4
from reproduction.table5 import section as table5
from reproduction.table6 import section as table6
from reproduction.table7 import section as table7


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
