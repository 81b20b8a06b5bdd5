"""All tables and figures of the paper made again: their cases run, their sections collected."""

from __future__ import annotations

import platform
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from cdpr_drake import __version__
from cdpr_drake.analysis import StepWarning
from cdpr_drake.batch import Sweep, plain, sweep
from reproduction.assumptions import Assumption, assumptions
from reproduction.section import Case, Reproduction, Result, Section
from reproduction.sources import source_of


@dataclass(frozen=True, kw_only=True)
class Reproduced:
    """A table or figure that was made again.

    Attributes:
        name: of the section.
        section: None if a case failed.
        errors: class and message of what was raised, by the key of the case.
        cases: how many there were.
        cpu_time: of all its cases [s].
        assumptions: what it took from the file of assumptions.
    """

    name: str
    section: Section | None
    errors: Mapping[str, tuple[str, str]]
    cases: int
    cpu_time: float
    assumptions: tuple[Assumption, ...]


def reproduce(
    wanted: Mapping[str, Reproduction],
    folder: Path,
    *,
    jobs: int | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[list[Reproduced], float]:
    """Return what came of each table and figure, and the processor time of it all [s].

    Cases of equal function and arguments run once, and not at all if the folder has their results
    by the same code.

    Args:
        wanted: by name.
        folder: where results of cases are kept.
        jobs: processes; as many as cores if None.
        executor: to run cases on in place of processes.
        progress: called with the number of cases done and of all.

    Raises:
        OSError: the folder cannot be written.
        SweepError: the folder has a damaged file, or processes do not start.
    """
    cases = {name: list(reproduction.cases()) for name, reproduction in wanted.items()}
    flat = [case for part in cases.values() for case in part]
    done = sweep(
        carry_out,
        [
            {
                "function": case.function,
                "arguments": dict(case.arguments),
                "source": source_of(case.function),
            }
            for case in flat
        ],
        seed=None,
        jobs=jobs,
        executor=executor,
        batch=1,
        folder=folder,
        resume=True,
        progress=progress,
    )
    found, first = [], 0
    for name, reproduction in wanted.items():
        part = range(first, first + len(cases[name]))
        first = part.stop
        found.append(_collect(name, reproduction, cases[name], done, part))
    return found, _cpu_time(done)


def carry_out(function: Callable[..., Result], arguments: Mapping[str, Any], source: str) -> Result:
    """Return function(**arguments); in a worker.

    Args:
        function: of a case.
        arguments: of a case.
        source: which makes cases of changed code different ones.
    """
    with warnings.catch_warnings():
        # The sections choose their steps for what they look at, and say how exact that is.
        warnings.simplefilter("ignore", StepWarning)
        return function(**arguments)


def _collect(
    name: str, reproduction: Reproduction, cases: Sequence[Case], done: Sweep, part: range
) -> Reproduced:
    outcomes = [done.outcomes[i] for i in part]
    pairs = list(zip(cases, outcomes, strict=True))
    errors = {case.key: o.error for case, o in pairs if o.error is not None}
    results = {case.key: o.result for case, o in pairs if o.result is not None}
    return Reproduced(
        name=name,
        section=None if errors else reproduction.section(results),
        errors=errors,
        cases=len(cases),
        cpu_time=sum(o.cpu_time for o in outcomes),
        assumptions=_assumptions(name),
    )


def _assumptions(name: str) -> tuple[Assumption, ...]:
    try:
        return tuple(assumptions(name).values())
    except KeyError:
        return ()


def _cpu_time(done: Sweep) -> float:
    """Return the processor time of all cases, equal ones counted once."""
    return sum({id(o.result): o.cpu_time for o in done.outcomes}.values())


# --- the report


def report_of(found: Sequence[Reproduced], cpu_time: float) -> dict[str, Any]:
    """Return all that was found as plain values, as JSON takes them; figures by title only.

    Args:
        found: of each table and figure.
        cpu_time: of all cases [s].
    """
    return {
        "paper": "Dallej, Gouttefarde, Andreff, Hervé, Martinet: Modeling and vision-based "
        "control of large-dimension cable-driven parallel robots using a multiple-camera setup, "
        "Mechatronics 61 (2019)",
        "cdpr_drake": __version__,
        "drake": version("drake"),
        "python": platform.python_version(),
        "cpu_time_s": round(cpu_time, 1),
        "made": time.strftime("%Y-%m-%d", time.gmtime()),
        "sections": [_entry(part) for part in found],
    }


def _entry(part: Reproduced) -> dict[str, Any]:
    """Return a section; of one that failed, only its errors."""
    section = part.section or Section(name=part.name, title=part.name)
    used = dict(section.fitted)
    known = part.assumptions if part.section is not None else ()
    values = [{**vars(a), "value": used.pop(a.name, a.value)} for a in known]
    return {
        "name": part.name,
        "title": section.title,
        "cases": part.cases,
        "cpu_time_s": round(part.cpu_time, 1),
        "errors": {key: list(error) for key, error in part.errors.items()},
        "text": list(section.text),
        "claims": [_tree(vars(claim)) for claim in section.claims],
        "tables": [_tree(vars(table)) for table in section.tables],
        "figures": [{"title": f.title, "caption": f.caption} for f in section.figures],
        "assumptions": _tree([*values, *({"name": n, "value": v} for n, v in used.items())]),
    }


def _tree(value: Any) -> Any:
    """Return a value with arrays as lists, and what is no number as None."""
    if isinstance(value, np.ndarray):
        return _tree(value.tolist())
    if isinstance(value, Mapping):
        return {str(name): _tree(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_tree(entry) for entry in value]
    value = plain(value)
    return None if isinstance(value, float) and not np.isfinite(value) else value
