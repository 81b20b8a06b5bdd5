"""Two tables of a paper that there is not, cheap to make again, for tests of the machinery."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from reproduction.section import Case, Claim, Figure, Line, Panel, Result, Section, Table


def square(x: float, log: str = "") -> Result:
    """Return x and its square, noting the call; refuse negative numbers."""
    if log:
        with open(log, "a") as file:
            file.write(f"{x:g} ")
    if x < 0.0:
        raise ValueError(f"{x:g} is negative")
    return {"x": x, "squares": np.array([x, x * x]), "none": None}


class FakeTable:
    """A table of squares.

    Args:
        name: of it.
        numbers: to square.
        log: of the calls; none if None.
    """

    def __init__(self, name: str, numbers: Sequence[float], log: Path | None = None) -> None:
        self.name, self.numbers = name, numbers
        self.arguments: dict[str, Any] = {} if log is None else {"log": str(log)}

    def cases(self) -> Sequence[Case]:
        """Return a case for each number."""
        return [
            Case(key=f"x{i}", function=square, arguments={"x": x, **self.arguments})
            for i, x in enumerate(self.numbers)
        ]

    def section(self, results: Mapping[str, Result]) -> Section:
        """Return a table, claims and a figure."""
        rows = tuple(
            (i, results[f"x{i}"]["x"], float(results[f"x{i}"]["squares"][1]), None, np.nan)
            for i in range(len(self.numbers))
        )
        time = np.linspace(0.0, 1.0, 20)
        lines = tuple(Line(label=f"cable {i + 1}", x=time, y=time * i, colour=i) for i in range(3))
        return Section(
            name=self.name,
            title=f"{self.name}: squares & <roots>",
            text=("One paragraph with <angles> & an ampersand.",),
            tables=(
                Table(
                    title="Squares",
                    headings=("number", "x [-]", "x^2 [-]", "nothing", "not a number"),
                    rows=rows,
                    note="A note.",
                ),
            ),
            claims=(
                Claim(
                    text="squares grow",
                    printed="1 < 4",
                    ours="0.5 °",
                    agrees=True,
                    kind="tested",
                    null="a <coin>",
                    null_rate=0.5,
                    parameters="a modulus",
                ),
                Claim(
                    text=f"{self.name} is <b>exact</b>",
                    printed="3.14",
                    ours="2.72",
                    agrees=False,
                    kind="tested",
                    null="another",
                    null_rate=0.125,
                    reason="because of “rounding” & noise",
                ),
                Claim(
                    text="one is one",
                    printed="1",
                    ours="1",
                    agrees=True,
                    kind="by construction",
                    null="nothing",
                ),
            ),
            fitted={"modulus": np.float64(60.0), "points": np.array([1.0, 2.0])},
            figures=(
                Figure(
                    title="Lines",
                    panels=(
                        (
                            Panel(title="of cables", y_label="tension [N]", lines=lines),
                            Panel(
                                title="of runs",
                                y_label="error [mm]",
                                lines=(Line(label="$t_x$", x=time, y=-time, dash=1),),
                            ),
                        ),
                    ),
                    caption="Made up.",
                ),
            ),
        )
