"""What each reproduced table or figure consists of: work to do, then tables and claims to read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, get_args

Result = Mapping[str, Any]
"""What a case gives: numbers, texts, lists, mappings of these, and NumPy arrays, by name."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """A piece of work that depends on no other.

    Args:
        key: its name among the cases of a section, fit for a file's name.
        function: what does it, at the top level of a module; it returns a `Result`.
        arguments: of the function, plain values by name.
    """

    key: str
    function: Callable[..., Result]
    arguments: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table to read.

    Args:
        title: what it shows.
        headings: of the columns, with units.
        rows: of numbers and texts; None is an empty cell.
        note: what one has to know to read it.
    """

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]
    note: str = ""


def rounded(values: Iterable[float], digits: int = 2) -> list[float]:
    """Return numbers for the cells of a table, none of them a negative zero.

    Args:
        values: the numbers.
        digits: after the point.
    """
    return [round(float(v), digits) + 0.0 for v in values]


Kind = Literal["tested", "fitted", "by construction"]
"""Of a claim: only what is tested could have come out otherwise, whatever was fitted or assumed."""

MOST = 0.95
"""What a null model meets more often than this could hardly have come out otherwise."""


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A statement of the paper beside what we get.

    Args:
        text: the statement.
        printed: the paper's number or words.
        ours: the number we get.
        agrees: whether it holds here.
        kind: "tested"; "fitted", if what it hangs on was chosen by it; or "by construction", if it
            could hardly have come out otherwise.
        null: what could have come out otherwise: a null model, a permutation, the choices open.
        null_rate: the share of that, from 0 to 1, which would agree; None if nothing could have
            come out otherwise.
        parameters: the free parameters behind it, fitted, assumed or chosen.
        reason: why it does not hold, or what the agreement rests on.

    Raises:
        ValueError: an unknown kind; nothing said of a null model; a rate that is missing, is no
            share, or is too high for a test.
    """

    text: str
    printed: str
    ours: str
    agrees: bool
    kind: Kind
    null: str
    null_rate: float | None = None
    parameters: str = "none"
    reason: str = ""

    def __post_init__(self) -> None:
        if self.kind not in get_args(Kind):
            raise ValueError(f'{self.text}: unknown kind "{self.kind}"')
        if not self.null:
            raise ValueError(f"{self.text}: what could have come out otherwise is not said")
        if self.null_rate is None:
            if self.kind != "by construction":
                raise ValueError(f"{self.text}: {self.kind}, but no rate of a null model")
        elif not 0.0 <= self.null_rate <= (MOST if self.kind == "tested" else 1.0):
            raise ValueError(f"{self.text}: {self.kind}, but a null rate of {self.null_rate:g}")


def kind_by(null_rate: float) -> Kind:
    """Return "tested", or "by construction" for what hardly anything else would miss.

    Args:
        null_rate: of the claim; whether it agrees does not count.
    """
    return "by construction" if null_rate > MOST else "tested"


@dataclass(frozen=True, kw_only=True, eq=False)
class Line:
    """A line of a panel.

    Args:
        label: what it is, for the legend; "" for none.
        x: (n,).
        y: (n,).
        colour: which colour, counting from 0; lines of one kind share it across panels.
        dash: which dashes, counting from 0, the first being none.
    """

    label: str
    x: Any
    y: Any
    colour: int = 0
    dash: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """One pair of axes of a figure.

    Args:
        title: what it shows.
        y_label: quantity and unit.
        lines: to draw.
        x_label: quantity and unit.
    """

    title: str
    y_label: str
    lines: tuple[Line, ...]
    x_label: str = "time [s]"


@dataclass(frozen=True, kw_only=True, eq=False)
class Figure:
    """A figure to look at.

    Args:
        title: what it shows.
        panels: row by row, all rows of one length.
        caption: what one has to know to read it.
    """

    title: str
    panels: tuple[tuple[Panel, ...], ...]
    caption: str = ""


@dataclass(frozen=True, kw_only=True)
class Section:
    """A table or figure of the paper, made again.

    Args:
        name: as `--only` takes it, e.g. "table4".
        title: what it is.
        text: paragraphs: what was done, what is assumed.
        tables: to read.
        claims: of the paper.
        fitted: each value that was fitted or assumed, by its name in the file of assumptions.
        figures: to look at.
    """

    name: str
    title: str
    text: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    claims: tuple[Claim, ...] = ()
    fitted: Mapping[str, Any] = field(default_factory=dict)
    figures: tuple[Figure, ...] = ()


class Reproduction(Protocol):
    """What a module of this package offers: `cases` first, then `section` of their results."""

    name: str

    def cases(self) -> Sequence[Case]:
        """Return the work to do."""

    def section(self, results: Mapping[str, Result]) -> Section:
        """Return what came of it, from the `results` of all cases."""
