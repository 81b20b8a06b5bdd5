"""The sentences of the report: templates in a `texts.yaml` beside the code that has the numbers."""

from __future__ import annotations

import functools
import re
import string
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any

import numpy as np
import yaml  # type: ignore[import-untyped]

from reproduction.section import Claim, Figure, Kind, Panel, Section, Table, kind_by

KINDS = ("sections", "claims", "tables", "figures", "words")
"""What there is in a file of texts, each by names."""

SPEC = re.compile(r"(%?)([^a-zA-Z]*[a-zA-Z]?)(.*)", re.DOTALL)
"""A format: whether it is a percentage, the format of `str.format`, what comes after."""


class Texts:
    """The texts of one folder, with places for numbers.

    A place is one of `str.format`, `{error:.1f} mm`. Beyond that, the entries of a list are
    formatted one by one, with commas in between, and "none" if there are none; those of a mapping
    come after their names. "%" before a format multiplies by 100, and what is after it,
    `{rates:.4f 1/s}`, follows each entry.

    Args:
        folder: of this application, with a file `texts.yaml`.

    Raises:
        ValueError: of all methods, if a place has no number or a number no place.
        KeyError: of all methods, if there is no text of a name.
    """

    def __init__(self, folder: str) -> None:
        self._folder = folder
        self._content = contents(folder)

    def section(
        self,
        name: str,
        *,
        tables: Sequence[Table] = (),
        claims: Sequence[Claim] = (),
        fitted: Mapping[str, Any] | None = None,
        figures: Sequence[Figure] = (),
        **numbers: Any,
    ) -> Section:
        """Return a section.

        Args:
            name: as `--only` takes it.
            tables: of it.
            claims: of it.
            fitted: what was fitted or assumed, by name.
            figures: of it.
            numbers: for the places of its text, by name.
        """
        texts = self._filled("sections", name, numbers)
        return Section(
            name=name,
            title=texts["title"],
            text=tuple(texts.get("text", ())),
            tables=tuple(tables),
            claims=tuple(claims),
            fitted=fitted or {},
            figures=tuple(figures),
        )

    def claim(
        self,
        name: str,
        *,
        agrees: bool | np.bool_,
        kind: Kind | None = None,
        null_rate: float | None = None,
        **numbers: Any,
    ) -> Claim:
        """Return a claim.

        Args:
            name: of its texts.
            agrees: whether it holds here.
            kind: of `Claim`; what `kind_by` says of the null rate if None.
            null_rate: of `Claim`.
            numbers: for the places of its texts, by name.
        """
        texts = self._filled("claims", name, numbers)
        if kind is None:
            kind = kind_by(1.0 if null_rate is None else null_rate)
        return Claim(**texts, agrees=bool(agrees), kind=kind, null_rate=null_rate)

    def table(self, name: str, rows: Sequence[Sequence[Any]], **numbers: Any) -> Table:
        """Return a table.

        Args:
            name: of its texts.
            rows: of numbers and texts.
            numbers: for the places of its texts, by name.
        """
        texts = self._filled("tables", name, numbers)
        headings = tuple(texts.pop("headings"))
        return Table(**texts, headings=headings, rows=tuple(tuple(row) for row in rows))

    def figure(self, name: str, panels: Sequence[Sequence[Panel]], **numbers: Any) -> Figure:
        """Return a figure.

        Args:
            name: of its texts.
            panels: row by row.
            numbers: for the places of its texts, by name.
        """
        texts = self._filled("figures", name, numbers)
        return Figure(**texts, panels=tuple(tuple(row) for row in panels))

    def words(self, name: str, **numbers: Any) -> dict[str, str]:
        """Return some words by their names.

        Args:
            name: of them all.
            numbers: for their places, by name.
        """
        return self._filled("words", name, numbers)

    def _filled(self, kind: str, name: str, numbers: Mapping[str, Any]) -> dict[str, Any]:
        return filled(self._content[kind][name], numbers, f"{self._folder}, {kind}, {name}")


@functools.cache
def contents(folder: str) -> dict[str, Any]:
    """Return what is in a folder's file of texts.

    Args:
        folder: of this application.

    Raises:
        ValueError: it has something else than texts.
    """
    file = resources.files(__package__) / folder / "texts.yaml"
    content: dict[str, Any] = yaml.safe_load(file.read_text(encoding="utf-8"))
    if unknown := set(content) - set(KINDS):
        raise ValueError(f"{folder}/texts.yaml: {', '.join(sorted(unknown))}")
    return content


def filled(templates: Mapping[str, Any], numbers: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return texts, or lists of texts, with numbers in their places.

    Args:
        templates: by name.
        numbers: each for at least one place, by name.
        where: they stand, for an error.

    Raises:
        ValueError: a place has no number, or a number has no place.
    """
    places = _Places(where)
    found = {
        name: [places.vformat(one, (), numbers) for one in text]
        if isinstance(text, list)
        else places.vformat(text, (), numbers)
        for name, text in templates.items()
    }
    if without := set(numbers) - places.filled:
        raise ValueError(f"{where}: no place for {', '.join(sorted(without))}")
    return found


class _Places(string.Formatter):
    """What fills places, and knows which it has filled."""

    def __init__(self, where: str) -> None:
        self.where = where
        self.filled: set[str] = set()

    def get_value(self, key: int | str, args: Any, kwargs: Mapping[str, Any]) -> Any:
        if key not in kwargs:
            raise ValueError(f"{self.where}: nothing for {{{key}}}")
        self.filled.add(str(key))
        return kwargs[str(key)]

    def format_field(self, value: Any, format_spec: str) -> str:
        if isinstance(value, Mapping):
            entries = ((key, self.format_field(v, format_spec)) for key, v in value.items())
            return ", ".join(f"{key} {entry}".strip() for key, entry in entries)
        if isinstance(value, list | tuple | np.ndarray):
            return ", ".join(self.format_field(v, format_spec) for v in value) or "none"
        found = SPEC.fullmatch(format_spec)
        assert found is not None
        percent, plain, after = found.groups()
        return super().format_field(100.0 * value if percent else value, plain) + after
