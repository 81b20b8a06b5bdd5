"""What the benchmarks share: contestants in turn, ratios with their spread, one JSON file each.

Contestants of one benchmark take turns, a call each a round, so that what else the machine does
falls on all of them alike. Times are CPU times of this process, and all contestants run on one
thread; only parallel work is timed by the clock on the wall. A ratio is formed within each round;
printed are the median of the rounds and the lowest and highest.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from cdpr_drake.commands.terminal import Column, print_wrapped, table

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "out" / "bench"

PACKAGES = ("drake", "numpy", "scipy", "numba", "moorpy", "mujoco")
"""Whose versions a result depends on."""


TIMES = ("us", "ms", "s")
"""Units of figures that hang on the machine."""


@dataclass(frozen=True, kw_only=True)
class Contestant:
    """One way to do the same work.

    Attributes:
        name: for the tables.
        call: does the work once.
        units: how many pieces of work that is.
        before: what has to be made anew for each call, off the clock; `call` then takes it.
    """

    name: str
    call: Callable[..., object]
    units: float = 1
    before: Callable[[], object] | None = None


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Median, lowest and highest of some rounds."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """Return the spread of some values."""
        return cls(median=statistics.median(values), low=min(values), high=max(values))

    def scaled(self, factor: float) -> Spread:
        """Return the spread in another unit."""
        return Spread(median=self.median * factor, low=self.low * factor, high=self.high * factor)


def interleave(
    contestants: Sequence[Contestant], rounds: int, warm: int = 1
) -> dict[str, list[float]]:
    """Return the CPU time [s] of a unit of each contestant's work, one for each round.

    There are `warm` rounds before, which compile what has to be compiled and fill the caches.
    """
    times: dict[str, list[float]] = {c.name: [] for c in contestants}
    for turn in range(-warm, rounds):
        for c in contestants:
            given = () if c.before is None else (c.before(),)
            begun = time.process_time()
            c.call(*given)
            took = time.process_time() - begun
            if turn >= 0:
                times[c.name].append(took / c.units)
    return times


def ratio(above: Sequence[float], below: Sequence[float]) -> Spread:
    """Return the spread of the ratios of two contestants' times, round by round."""
    return Spread.of([a / b for a, b in zip(above, below, strict=True)])


def positive(text: str) -> int:
    """Return a positive number of a command line."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"at least 1, not {value}")
    return value


def is_installed(package: str) -> bool:
    """Whether a peer is there."""
    return importlib.util.find_spec(package) is not None


def never_break() -> None:
    """Make `breakpoint()`, which MoorPy's solvers call where they fail, an error instead."""

    def refuse(*_args: Any, **_kwargs: Any) -> None:
        raise RuntimeError("breakpoint() called")

    sys.breakpointhook = refuse


def machine() -> dict[str, Any]:
    """Return what a result depends on: processor, system, versions; not whose machine it is."""
    versions = {}
    for package in PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "none"
    return {
        "cores": os.cpu_count(),
        "processor": _processor(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        **versions,
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or "unknown"
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def number(value: float) -> str:
    """Return a number as the tables show it."""
    if value == 0.0 or 1e-3 <= abs(value) < 1e6:
        return f"{value:.3g}" if abs(value) < 1e3 else f"{value:.0f}"
    return f"{value:.1e}"


@dataclass(kw_only=True)
class Report:
    """What a benchmark found, printed as it comes and kept in FOLDER/NAME.json.

    Attributes:
        name: of the benchmark.
        title: what is measured, a line.
        about: how, a paragraph.
        command: that makes it.
    """

    name: str
    title: str
    about: str
    command: str
    machine: dict[str, Any] = field(default_factory=machine)
    tables: list[dict[str, Any]] = field(default_factory=list)
    ratios: list[dict[str, Any]] = field(default_factory=list)
    figures: list[dict[str, Any]] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)

    def skip(self, why: str) -> None:
        """Say which peer is left out, and why."""
        self.skipped.append(why)
        print(f"left out: {why}", flush=True)

    def has(self, package: str) -> bool:
        """Whether a peer is installed; if not, it is left out."""
        if is_installed(package):
            return True
        self.skip(f"{package} is not installed (the `bench` extra)")
        return False

    def table(self, title: str, rows: list[dict[str, Any]]) -> None:
        """Print rows of equal keys as a table: numbers, texts, or a `Spread` of a time."""
        plain = [
            {k: asdict(v) if isinstance(v, Spread) else v for k, v in row.items()} for row in rows
        ]
        self.tables.append({"title": title, "rows": plain})
        print(f"\n{title}\n{text_table(plain)}", flush=True)

    def ratio(
        self, name: str, spread: Spread, at_least: float | None = None, at_most: float | None = None
    ) -> None:
        """Print a ratio beside what it should be at least or at most."""
        self._add(self.ratios, {"name": name, **asdict(spread)}, at_least, at_most)

    def figure(
        self,
        name: str,
        value: float,
        unit: str = "",
        at_least: float | None = None,
        at_most: float | None = None,
    ) -> None:
        """Print a figure beside what it should be at least or at most."""
        row = {"name": name, "median": float(value), "unit": unit}
        self._add(self.figures, row, at_least, at_most)

    def _add(
        self,
        rows: list[dict[str, Any]],
        row: dict[str, Any],
        at_least: float | None,
        at_most: float | None,
    ) -> None:
        value = row["median"]
        if at_least is not None:
            row |= {"at_least": at_least, "met": bool(value >= at_least)}
        if at_most is not None:
            row |= {"at_most": at_most, "met": bool(value <= at_most)}
        rows.append(row)
        print(f"  {describe(row)}", flush=True)

    def is_right(self) -> bool:
        """Whether all figures that are no times are as wanted."""
        return all(row.get("met", True) for row in self.figures if row["unit"] not in TIMES)

    def write(self, folder: Path = FOLDER) -> Path:
        """Write the JSON file and return its path."""
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{self.name}.json"
        path.write_text(json.dumps(vars(self), indent=1) + "\n", encoding="utf-8")
        return path


def describe(row: dict[str, Any]) -> str:
    """Return a ratio or figure of a report as a line."""
    text = f"{row['name']}: {number(row['median'])}"
    if "low" in row:
        text += f" ({number(row['low'])} to {number(row['high'])})"
    if row.get("unit"):
        text += f" {row['unit']}"
    if goal := wanted(row):
        text += f", wanted {goal}: {'met' if row['met'] else 'MISSED'}"
    return text


def wanted(row: dict[str, Any]) -> str:
    """Return what a ratio or figure of a report should be, or "" if anything will do."""
    for key, sign in (("at_least", ">="), ("at_most", "<=")):
        if key in row:
            return f"{sign} {number(row[key])}"
    return ""


def cell(value: Any) -> str:
    """Return an entry of a report's table as text."""
    if isinstance(value, dict):
        low, high = number(value["low"]), number(value["high"])
        return f"{number(value['median'])} ({low} to {high})"
    return number(value) if isinstance(value, float) else str(value)


def text_table(rows: list[dict[str, Any]]) -> str:
    """Return rows of equal keys as a table, its first column to the left."""
    columns = [
        Column(heading=(key, ""), cells=[cell(row[key]) for row in rows], to_the_left=i == 0)
        for i, key in enumerate(rows[0])
    ]
    return "\n".join(line for line in table(columns).splitlines() if line.strip())


def run(
    name: str,
    about: str,
    measure: Callable[[Report, argparse.Namespace], None],
    options: Callable[[argparse.ArgumentParser], None],
    arguments: Sequence[str] | None = None,
) -> Report:
    """Read the command line, measure, write the JSON file, and return the report.

    Args:
        name: of the benchmark, that of its script without bench_.
        about: its docstring: a line, and a paragraph.
        measure: fills a report.
        options: adds the benchmark's options to a parser.
        arguments: the command line; sys.argv if None.
    """
    never_break()
    first, _, rest = about.partition("\n")
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks {name}", description=first)
    options(parser)
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where the JSON file goes")
    given = list(sys.argv[1:] if arguments is None else arguments)
    chosen = parser.parse_args(given)
    shown = [a for i, a in enumerate(given) if "--folder" not in (a, *given[max(i - 1, 0) : i])]
    how = " ".join(rest.partition("    python")[0].split())
    report = Report(name=name, title=first, about=how, command=" ".join([parser.prog, *shown]))
    print_wrapped(f"{first} {how}")
    measure(report, chosen)
    report.write(chosen.folder)
    return report
