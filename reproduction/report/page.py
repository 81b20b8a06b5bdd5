"""The report of the reproduction as one HTML page that needs nothing else."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib import resources
from string import Template
from typing import Any

from reproduction.report.pictures import panel_svg
from reproduction.report.words import (
    count_of_claims,
    fitted_and_assumed,
    in_words,
    tested,
    verdict,
    what_else,
)
from reproduction.section import Figure


def report_html(report: Mapping[str, Any], figures: Mapping[str, Sequence[Figure]]) -> str:
    """Return a page with all claims, tables and figures.

    Args:
        report: as `report_of` gives it.
        figures: of the sections, by their names.
    """
    folder, sections = resources.files(__package__), report["sections"]
    content = [*_overview(sections)]
    for section in sections:
        content += _section(section, figures.get(section["name"], ()))
    page = Template((folder / "page.html").read_text(encoding="utf-8"))
    return page.substitute(
        style=(folder / "page.css").read_text(encoding="utf-8"),
        paper=escape(report["paper"]),
        count=count_of_claims(report),
        made=report["made"],
        cdpr_drake=report["cdpr_drake"],
        drake=report["drake"],
        minutes=f"{report['cpu_time_s'] / 60.0:.1f}",
        content="\n".join(content),
    )


def _overview(sections: Sequence[Mapping[str, Any]]) -> Iterable[str]:
    yield '<nav aria-label="Overview">'
    for section in sections:
        counted = tested(section["claims"])
        agree = sum(claim["agrees"] for claim in counted)
        count = "failed" if section["errors"] else f"{agree} of {len(counted)}" if counted else ""
        yield (
            f'<a href="#{escape(section["name"])}"><span>{escape(section["title"])}</span>'
            f"<span>{count}</span></a>"
        )
    yield "</nav>"


def _section(section: Mapping[str, Any], figures: Sequence[Figure]) -> Iterable[str]:
    name = section["name"]
    yield f'<section id="{escape(name)}">'
    yield f"<h2>{escape(section['title'])}</h2>"
    for key, (kind, message) in section["errors"].items():
        yield f'<p class="error">{escape(f"{key} failed: {kind}: {message}")}</p>'
    if section["claims"]:
        yield '<div class="claims">'
        for claim in section["claims"]:
            yield from _claim(claim)
        yield "</div>"
    for paragraph in section["text"]:
        yield f"<p>{escape(paragraph)}</p>"
    for number, figure in enumerate(figures):
        yield from _figure(figure, f"{name}-{number}")
    for table in section["tables"]:
        yield from _table(table["title"], table["headings"], table["rows"], table["note"])
    if section["assumptions"]:
        yield from _assumptions(section)
    yield "</section>"


def _claim(claim: Mapping[str, Any]) -> Iterable[str]:
    word = verdict(claim)
    yield f'<article class="{word}">'
    text = escape(_capital(claim["text"]))
    yield f'<h3><span class="mark">{word}</span>{text}</h3>'
    yield (
        f"<dl><div><dt>paper</dt><dd>{escape(claim['printed'])}</dd></div>"
        f"<div><dt>here</dt><dd>{escape(claim['ours'])}</dd></div></dl>"
    )
    yield (
        f'<p class="quiet"><strong>{claim["kind"]}</strong>; what could have come out otherwise: '
        f"{escape(what_else(claim))}; free parameters: {escape(claim['parameters'])}.</p>"
    )
    if claim["reason"]:
        yield f'<p class="quiet">{escape(claim["reason"])}</p>'
    yield "</article>"


def _capital(text: str) -> str:
    """Return a sentence with a capital at its start, unless that is a symbol such as dβ."""
    is_word = text[:2].isascii() and text[:2].isalpha()
    return text[:1].upper() + text[1:] if is_word else text


def _figure(figure: Figure, salt: str) -> Iterable[str]:
    columns = len(figure.panels[0])
    yield f'<figure><div class="panels" style="--columns: {columns}">'
    for i, row in enumerate(figure.panels):
        for j, panel in enumerate(row):
            label = escape(f"{figure.title}: {panel.title}, {panel.y_label}", quote=True)
            picture = panel_svg(panel, f"{salt}-{i}-{j}")
            yield picture.replace("<svg", f'<svg role="img" aria-label="{label}"', 1)
    yield "</div>"
    caption = f"{figure.title}. {figure.caption}" if figure.caption else figure.title
    yield f"<figcaption>{escape(caption)}</figcaption></figure>"


def _table(
    title: str, headings: Sequence[str], rows: Sequence[Sequence[Any]], note: str = ""
) -> Iterable[str]:
    yield f'<h3>{escape(title)}</h3><div class="wide"><table>'
    columns = zip(*rows, strict=True) if rows else [()] * len(headings)
    kinds = [_kind(all(v is None or _is_number(v) for v in column)) for column in columns]
    head = (f"<th{kind}>{escape(h)}</th>" for h, kind in zip(headings, kinds, strict=True))
    yield f"<thead><tr>{''.join(head)}</tr></thead><tbody>"
    for row in rows:
        yield f"<tr>{''.join(map(_cell, row))}</tr>"
    yield "</tbody></table></div>"
    if note:
        yield f'<p class="quiet">{escape(note)}</p>'


def _cell(value: Any) -> str:
    return f"<td{_kind(value is None or _is_number(value))}>{escape(in_words(value))}</td>"


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _kind(is_number: bool) -> str:
    return ' class="number"' if is_number else ""


def _assumptions(section: Mapping[str, Any]) -> Iterable[str]:
    fitted, assumed = fitted_and_assumed(section)
    yield f"<details><summary>{fitted} values fitted, {assumed} assumed</summary>"
    fields = ("name", "value", "unit", "range", "kind", "source")
    rows = [
        [_range(entry.get("range")) if f == "range" else entry.get(f) for f in fields]
        for entry in section["assumptions"]
    ]
    yield from _table("", ("value of", "is", "unit", "range", "kind", "source"), rows)
    yield "</details>"


def _range(bounds: Sequence[float] | None) -> str | None:
    return None if bounds is None else " to ".join(map(in_words, bounds))
