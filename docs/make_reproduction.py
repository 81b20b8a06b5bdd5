"""Write what the reproduction found into README.md and docs/reproduction.md, between their marks.

    python -m reproduction --output DIR
    python docs/make_reproduction.py DIR

Without DIR, the report kept in docs/reproduction.json is taken, and the pictures stay.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from reproduction.report.words import (
    count_of_claims,
    fitted_and_assumed,
    how_often,
    in_words,
    tested,
    verdict,
)

DOCS = Path(__file__).resolve().parent
REPORT = DOCS / "reproduction.json"
PAGES = (DOCS.parent / "README.md", DOCS / "reproduction.md")

CLAIM_HEADINGS = (
    "claim", "paper", "here", "", "kind", "what could have come out otherwise",
    "of that would agree", "free parameters", "why, or on what terms",
)  # fmt: skip

MARK = re.compile(r"(<!-- begin (\w+) -->\n)(.*?)(<!-- end \2 -->)", re.DOTALL)


def filled(page: str, report: Mapping[str, Any]) -> str:
    """Return a page with what is between its marks made anew.

    Args:
        page: Markdown, with lines `<!-- begin NAME -->` and `<!-- end NAME -->`; a name is that of
            a section, or summary, headline, parameters or effort.
        report: as `python -m reproduction` writes it.

    Raises:
        KeyError: there is nothing by the name of a mark.
        ValueError: a mark without its fellow.
    """
    if page.count("<!-- begin ") != len(MARK.findall(page)):
        raise ValueError("a mark has no end")
    parts = {section["name"]: section for section in report["sections"]}
    whole = {
        "summary": _summary,
        "headline": _headline,
        "parameters": _parameters,
        "effort": _effort,
    }

    def content(found: re.Match[str]) -> str:
        name = found[2]
        lines = whole[name](report) if name in whole else _section(parts[name])
        return found[1] + "\n".join(lines) + "\n" + found[4]

    return MARK.sub(content, page)


def _summary(report: Mapping[str, Any]) -> Iterable[str]:
    """Yield a table with a line for each claim that could have failed."""
    rows = [
        (title, c["text"], c["printed"], c["ours"], verdict(c), how_often(c))
        for section in report["sections"]
        for title in [section["title"].partition(":")[0]]
        for c in tested(section["claims"])
    ]
    yield from _headline(report)
    yield ""
    yield from _table(("", "tested claim", "paper", "here", "", "null model agrees"), rows)


def _headline(report: Mapping[str, Any]) -> Iterable[str]:
    """Yield how many claims agree."""
    yield count_of_claims(report)


def _parameters(report: Mapping[str, Any]) -> Iterable[str]:
    """Yield a table of how many values each section takes that the paper does not print."""
    rows = []
    for section in report["sections"]:
        fitted, assumed = fitted_and_assumed(section)
        if fitted or assumed:
            rows.append((section["title"], fitted, assumed))
    yield from _table(("", "values fitted to printed numbers", "values assumed"), rows)


def _effort(report: Mapping[str, Any]) -> Iterable[str]:
    """Yield what the report took to make."""
    yield (
        f"Made with cdpr_drake {report['cdpr_drake']} and Drake {report['drake']} in "
        f"{report['cpu_time_s'] / 60.0:.0f} minutes of processor time:"
    )
    yield ""
    rows = [(s["title"], s["cases"], s["cpu_time_s"]) for s in report["sections"]]
    yield from _table(("", "cases", "processor time [s]"), rows)
    yield ""
    yield "Cases that several sections have in common run once; each section counts them."


def _section(section: Mapping[str, Any]) -> Iterable[str]:
    """Yield the text, the claims and the tables of a section."""
    yield from "\n\n".join(map(_escaped, section["text"])).split("\n")
    rows = [
        (*(c[of] for of in ("text", "printed", "ours")), verdict(c), c["kind"], c["null"],
         how_often(c), c["parameters"], c["reason"])
        for c in section["claims"]
    ]  # fmt: skip
    if rows:
        yield ""
        yield from _table(CLAIM_HEADINGS, rows)
    for number in range(len(section["figures"])):
        file = section["name"] + (f"-{number + 1}" if number else "")
        yield ""
        yield f"![{section['figures'][number]['title']}](images/{file}.png)"
    for table in section["tables"]:
        yield ""
        yield f"{_escaped(table['title'])}:"
        yield ""
        yield from _table(table["headings"], table["rows"])
        if table["note"]:
            yield ""
            yield _escaped(table["note"])


def _table(headings: Sequence[str], rows: Iterable[Sequence[Any]]) -> Iterable[str]:
    rows = list(rows)
    numeric = [all(_is_number(row[i]) for row in rows) for i in range(len(headings))]
    yield "| " + " | ".join(map(_escaped, headings)) + " |"
    yield "|" + "|".join("---:" if right else "---" for right in numeric) + "|"
    for row in rows:
        yield "| " + " | ".join(_escaped(in_words(value)) for value in row) + " |"


def _is_number(value: Any) -> bool:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool))


def _escaped(text: str) -> str:
    """Return text that Markdown leaves as it is."""
    return re.sub(r"([|*_<>\[\]`\\])", r"\\\1", " ".join(text.split()))


def main(folder: Path | None) -> None:
    """Take a report and its pictures from a folder, if one is given, and fill the pages."""
    if folder is not None:
        shutil.copy(folder / "report.json", REPORT)
        for picture in folder.glob("*.png"):
            shutil.copy(picture, DOCS / "images" / picture.name)
    report = json.loads(REPORT.read_text(encoding="utf-8"))
    for page in PAGES:
        page.write_text(filled(page.read_text(encoding="utf-8"), report), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
