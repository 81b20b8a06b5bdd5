"""Write docs/performance.md and its picture from what the benchmarks left in out/bench.

    make bench
    python docs/make_performance.py [--folder out/bench]

No number in the page is typed by hand.
"""

from __future__ import annotations

import argparse
import json
import sys
import textwrap
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.harness import FOLDER, cell, describe, number, wanted  # noqa: E402
from cdpr_drake.show.style import REFERENCE, RUN_COLOURS  # noqa: E402

PAGE = ROOT / "docs" / "performance.md"
PICTURE = ROOT / "docs" / "images" / "performance.png"

ORDER = ("peers_loop", "peers_cable", "peers_equilibrium", "peers_linearize", "scale", "sweep")

INTRODUCTION = """\
# Performance

How fast, beside other programs and with the error beside each time. The contestants of a benchmark
take turns in one run; times are CPU times on one thread, except for work in several processes.
Ratios are formed round by round: the median of the rounds, and in brackets the lowest and highest.

`make bench` makes the numbers on your machine, `python docs/make_performance.py` this page."""

PICTURE_TEXT = """\
![Times of the peers over ours, and simulated time over computing time of the loop of \
Test 4](images/performance.png)"""

Reports = dict[str, dict[str, Any]]


def read(folder: Path) -> Reports:
    """Return the benchmarks' reports by name, in the page's order."""
    found = {p.stem: json.loads(p.read_text(encoding="utf-8")) for p in folder.glob("*.json")}
    names = [n for n in ORDER if n in found] + sorted(set(found) - set(ORDER))
    return {name: found[name] for name in names}


def machine_text(reports: Reports) -> str:
    """Return a sentence on each machine that the reports come from."""
    texts: dict[str, list[str]] = {}
    for name, report in reports.items():
        m = report["machine"]
        versions = [
            f"{package} {m[package]}"
            for package in ("python", "drake", "numpy", "scipy", "numba", "moorpy", "mujoco")
            if m[package] != "none"
        ]
        text = f"{m['cores']} cores ({m['processor']}), {m['system']}; {', '.join(versions)}"
        texts.setdefault(text, []).append(name)
    if len(texts) == 1:
        return wrapped(f"The machine: {next(iter(texts))}.")[0]
    return "\n".join(f"* {', '.join(names)}: {text}." for text, names in texts.items())


def wrapped(text: str) -> list[str]:
    """Return a text as paragraphs, one or none, in lines as long as the page's others."""
    lines = textwrap.wrap(text, 100, break_long_words=False, break_on_hyphens=False)
    return ["\n".join(lines)] if lines else []


def markdown_table(rows: list[list[str]]) -> str:
    """Return a table of text, its first row the heading, its first column to the left."""
    rule = ["---", *["---:"] * (len(rows[0]) - 1)]
    lines = [rows[0], rule, *rows[1:]]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def with_spread(row: dict[str, Any]) -> str:
    """Return the value of a ratio or figure."""
    text = number(row["median"])
    if "low" in row:
        text += f" ({number(row['low'])} to {number(row['high'])})"
    return f"{text} {row.get('unit', '')}".strip()


def summary(reports: Reports) -> str:
    """Return what is measured against what is wanted."""
    rows = [["benchmark", "ratio of times, or error", "measured", "wanted", ""]]
    for name, report in reports.items():
        for row in (*report["ratios"], *report["figures"]):
            if goal := wanted(row):
                verdict = "met" if row["met"] else "**missed**"
                rows.append([name, row["name"], with_spread(row), goal, verdict])
    return markdown_table(rows)


def section(report: dict[str, Any]) -> str:
    """Return the part of the page on one benchmark."""
    parts = [f"## {report['title'].rstrip('.')}", *wrapped(report["about"])]
    parts.append(f"`{report['command']}`")
    for table in report["tables"]:
        keys = list(table["rows"][0])
        rows = [keys, *([cell(row[key]) for key in keys] for row in table["rows"])]
        parts += [f"{table['title'][0].upper()}{table['title'][1:]}:", markdown_table(rows)]
    lines = [f"* {describe(row)}" for row in (*report["ratios"], *report["figures"])]
    lines += [f"* left out: {why}" for why in report["skipped"]]
    return "\n\n".join([*parts, "\n".join(lines)])


def page(reports: Reports) -> str:
    """Return the page."""
    parts = [INTRODUCTION, machine_text(reports), PICTURE_TEXT, summary(reports)]
    return "\n\n".join([*parts, *map(section, reports.values())]) + "\n"


def draw(reports: Reports, path: Path) -> None:
    """Draw how much longer the peers take, and how the loop compares with real time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
    ratios = [
        {**row, "what": report["title"].partition(":")[0]}
        for report in reports.values()
        for row in report["ratios"]
        if " / ours" in row["name"] and "one by one" not in row["name"]
    ]
    bars(left, [(f"{r['what']}\n{r['name'].partition(' / ours')[0]}", r) for r in ratios])
    for i, row in enumerate(ratios):
        if "at_least" in row:
            left.plot([row["at_least"]] * 2, [i - 0.4, i + 0.4], color="black", lw=1.5)
    left.axvline(1.0, color=REFERENCE, lw=1.0)
    left.set_xlabel("its time over ours (black mark: wanted at least)")
    loop = reports.get("peers_loop", {"tables": [{"rows": []}]})["tables"][0]["rows"]
    bars(right, [(r["Test 4"], r["x real time"]) for r in loop])
    right.set_xlabel("Test 4: simulated time over CPU time")
    figure.savefig(path, dpi=100)


def bars(axes: Any, rows: list[tuple[str, dict[str, float]]]) -> None:
    """Draw a bar with its spread for each row, the first on top, on a logarithmic scale."""
    if not rows:
        axes.set_axis_off()
        return
    medians = [row["median"] for _, row in rows]
    spread = [
        [row["median"] - row["low"] for _, row in rows],
        [row["high"] - row["median"] for _, row in rows],
    ]
    axes.barh(range(len(rows)), medians, xerr=spread, color=RUN_COLOURS[0], alpha=0.8, height=0.6,
              error_kw={"ecolor": RUN_COLOURS[1], "capsize": 3})  # fmt: skip
    axes.set_yticks(range(len(rows)), [label for label, _ in rows], fontsize=8)
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    for i, (median, (_, row)) in enumerate(zip(medians, rows, strict=True)):
        axes.text(row["high"] * 1.15, i, f"{number(median)} x", va="center", fontsize=9)
    axes.set_xlim(min(0.5, 0.5 * min(medians)), 5.0 * max(row["high"] for _, row in rows))
    axes.spines[["top", "right"]].set_visible(False)


def main() -> None:
    """Write page and picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=FOLDER, help="of the benchmarks' JSON files")
    options = parser.parse_args()
    reports = read(options.folder)
    if not reports:
        parser.error(f"no benchmark left anything in {options.folder}: run make bench first")
    PAGE.write_text(page(reports), encoding="utf-8")
    PICTURE.parent.mkdir(exist_ok=True)
    draw(reports, PICTURE)


if __name__ == "__main__":
    main()
