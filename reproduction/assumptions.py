"""The data files of the reproduction: what the paper prints, and what it does not and we assume."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from importlib import resources
from typing import Any

import yaml  # type: ignore[import-untyped]

KINDS = ("fitted", "assumed")


@dataclass(frozen=True, kw_only=True)
class Assumption:
    """A value that the paper does not print.

    Args:
        name: as in the data file.
        value: a number, a list of numbers or a text.
        unit: of the value and its range.
        range: the least and the largest plausible value; None where there is no such range.
        kind: "fitted" to printed numbers, or "assumed".
        source: of range or value.

    Raises:
        ValueError: an unknown kind, no source, or a number outside of its own range.
    """

    name: str
    value: Any
    unit: str
    range: tuple[float, float] | None
    kind: str
    source: str

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f'{self.name}: unknown kind "{self.kind}"')
        if not self.source:
            raise ValueError(f"{self.name}: no source")
        if self.range is not None:
            low, high = self.range
            object.__setattr__(self, "range", (float(low), float(high)))
            values = self.value if isinstance(self.value, list) else [self.value]
            if not all(low <= value <= high for value in values):
                raise ValueError(f"{self.name}: {self.value} is outside of {low} to {high}")

    @property
    def low(self) -> float:
        """The least plausible value."""
        return self._bounds()[0]

    @property
    def high(self) -> float:
        """The largest plausible value."""
        return self._bounds()[1]

    def _bounds(self) -> tuple[float, float]:
        if self.range is None:
            raise ValueError(f"{self.name} has no range")
        return self.range


@dataclass(frozen=True, kw_only=True)
class Printed:
    """A number that the paper prints.

    Args:
        name: as in the data file.
        value: a number, or a list of numbers.
        unit: of the value.
        where: it stands in the paper.
    """

    name: str
    value: Any
    unit: str
    where: str


def assumptions(section: str) -> dict[str, Assumption]:
    """Return what a section of the reproduction assumes or fits, by name.

    Args:
        section: e.g. "table4".

    Raises:
        KeyError: there is no such section in the data file.
        ValueError: an entry is not valid.
    """
    entries = _read("assumptions.yaml")[section]
    return {name: Assumption(name=name, **fields) for name, fields in entries.items()}


def assumed(section: str) -> dict[str, Any]:
    """Return the bare values of `assumptions` by name.

    Args:
        section: e.g. "table4".
    """
    return {name: entry.value for name, entry in assumptions(section).items()}


def printed(section: str) -> dict[str, Printed]:
    """Return what the paper prints about a section of the reproduction, by name.

    Args:
        section: e.g. "table4".

    Raises:
        KeyError: there is no such section in the data file.
    """
    entries = _read("printed.yaml")[section]
    return {name: Printed(name=name, **fields) for name, fields in entries.items()}


@functools.cache
def _read(file: str) -> dict[str, Any]:
    text = (resources.files(__package__) / file).read_text(encoding="utf-8")
    content: dict[str, Any] = yaml.safe_load(text)
    return content
