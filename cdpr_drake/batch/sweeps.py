"""One function over many cases, on any executor, without losing a case or running one twice."""

from __future__ import annotations

import contextlib
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cdpr_drake.batch.runner import Runner, Work
from cdpr_drake.batch.store import fingerprint, name_of, part_files, read_parts, write_part
from cdpr_drake.batch.workers import Workers, check_importable
from cdpr_drake.errors import SweepError

LARGEST_BATCH = 1000
BATCHES_PER_WORKER = 16
"""So many batches for each worker keep all of them busy to the end."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of one case.

    Attributes:
        arguments: of the function, the seed among them if there is one.
        result: what the function returned; None if it failed.
        error: class and message of what it raised, None if it did not.
        cpu_time: of the processor [s].
        wall_time: [s].
    """

    arguments: Mapping[str, Any]
    result: Mapping[str, Any] | None
    error: tuple[str, str] | None
    cpu_time: float
    wall_time: float


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """What came of all cases, in their order.

    Iterating gives the results, None for a case that failed.

    Attributes:
        outcomes: one for each case.
        resumed: how many of them an earlier sweep left.
        wall_time: of this one [s].
    """

    outcomes: tuple[Outcome, ...]
    resumed: int
    wall_time: float

    def __len__(self) -> int:
        """Return the number of cases."""
        return len(self.outcomes)

    def __iter__(self) -> Iterator[Mapping[str, Any] | None]:
        """Yield the results in the order of the cases."""
        return (outcome.result for outcome in self.outcomes)

    def __getitem__(self, index: int) -> Mapping[str, Any] | None:
        """Return the result of one case."""
        return self.outcomes[index].result

    @property
    def errors(self) -> dict[int, tuple[str, str]]:
        """Class and message of what was raised, by the number of the case, counting from 0."""
        return {i: o.error for i, o in enumerate(self.outcomes) if o.error is not None}

    @property
    def cpu_time(self) -> float:
        """Processor time of all cases [s], of an earlier sweep too where that left them."""
        return sum(outcome.cpu_time for outcome in self.outcomes)

    def column(self, name: str) -> np.ndarray:
        """Return one entry of all results, (cases, ...); NaN, or "", where a case failed.

        Args:
            name: of the entry.

        Raises:
            KeyError: a result has no such entry.
            ValueError: the entries differ in shape, or no case succeeded.
        """
        done = np.array([outcome.result is not None for outcome in self.outcomes], dtype=bool)
        values = np.array([result[name] for result in self if result is not None])
        if len(values) == 0:
            raise ValueError(f"no case has a result, so none has {name!r}")
        if done.all():
            return values
        if values.dtype.kind in "biu":
            values = values.astype(float)
        column = np.full((len(done), *values.shape[1:]), _missing(values.dtype), values.dtype)
        column[done] = values
        return column


_Record = Mapping[str, Any]


def sweep(
    function: Callable[..., Mapping[str, Any]],
    cases: Sequence[Mapping[str, Any]],
    *,
    executor: Executor | Callable[[], Executor] | None = None,
    jobs: int | None = None,
    seed: int | None = 0,
    folder: str | Path | None = None,
    resume: bool = False,
    batch: int | None = None,
    version: str = "",
    stop_at_error: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Sweep:
    """Return what a function gives for each case: `function(**case, seed=...)`.

    The seed of a case follows from `seed` and the number of the case, so that results depend
    neither on the executor nor on the order in which cases come to run. What a case raises is kept
    as its error. When a worker dies, its cases run again; a case that ends every process in which
    it runs, alone at last, gets that as its error. Equal cases without seeds run once.

    Args:
        function: at the top level of a module; it returns numbers, texts, lists and mappings of
            these, and arrays, by name.
        cases: the arguments by name; numbers, texts, lists and mappings of these, arrays, and
            functions at the top level of a module.
        executor: a `concurrent.futures.Executor`, which is left running, e.g. that of a Dask
            cluster, `distributed.Client(address).get_executor()`; or a function without arguments
            that makes one, which is shut down, and replaced when it breaks; processes of one
            thread each if None.
        jobs: batches that run, or wait in an executor, at a time; the number of processes.
        seed: from which the cases' seeds follow, 32 bits each; None if the function takes none.
        folder: where results are kept as they arrive; made if need be. Nowhere if None.
        resume: take what the folder has of these cases, and run the others and those that failed.
        batch: cases that a worker gets, and that a file holds, at a time.
        version: of whatever the results depend on besides the cases: those in the folder of
            another version are not taken.
        stop_at_error: raise when a case fails.
        progress: called with the number of cases done and of all, at the start and at each batch.

    Raises:
        ValueError: function, cases, jobs or batch cannot be used, or the folder has results and
            `resume` is not asked for.
        TypeError: a case holds what is no plain value.
        OSError: the folder cannot be written.
        SweepError: a case failed and `stop_at_error`, the given executor broke, worker processes
            do not start, or a file in the folder is damaged. What was done is kept.
    """
    begun = time.perf_counter()
    for name, value in (("jobs", jobs), ("batch", batch)):
        if value is not None and value < 1:
            raise ValueError(f"{name} must be at least 1, got {value}")
    works = _works(function, cases, seed, version)
    path = None if folder is None else Path(folder)
    records = _earlier(path, resume)
    todo = {key: arguments for key, arguments in works if _is_open(records.get(key))}
    repeats = Counter(key for key, _ in works)
    done = resumed = len(works) - sum(repeats[key] for key in todo)
    workers = Workers(executor, jobs)
    if workers.are_processes:
        check_importable(function)
    batches = _batches(list(todo.items()), batch, workers.jobs)
    if progress is not None:
        progress(done, len(works))
    with contextlib.closing(Runner(function, batches, workers).records()) as parts:
        for part in parts:
            if path is not None:
                write_part(path, part)
            records.update(part)
            done += sum(repeats[key] for key in part)
            if progress is not None:
                progress(done, len(works))
            if stop_at_error:
                _raise_first_error(part)
    outcomes = tuple(_outcome(a, records[key]) for key, a in works)
    return Sweep(outcomes=outcomes, resumed=resumed, wall_time=time.perf_counter() - begun)


def case_seed(seed: int, index: int) -> int:
    """Return the seed of a case, 32 bits that nothing but the arguments decides.

    Args:
        seed: of the sweep.
        index: of the case, counting from 0.
    """
    return int(np.random.SeedSequence(seed, spawn_key=(index,)).generate_state(1)[0])


def _works(
    function: Callable[..., Any], cases: Sequence[Mapping[str, Any]], seed: int | None, version: str
) -> list[Work]:
    name = name_of(function)
    works: list[Work] = []
    for index, case in enumerate(cases):
        arguments = dict(case)
        if seed is not None:
            if "seed" in case:
                raise ValueError(f"case {index} has a seed; then the sweep needs seed=None")
            arguments["seed"] = case_seed(seed, index)
        try:
            key = fingerprint([name, version, arguments])
        except (TypeError, ValueError) as error:
            raise type(error)(f"case {index}: {error}") from None
        works.append((key, arguments))
    return works


def _earlier(folder: Path | None, resume: bool) -> dict[str, Any]:
    if folder is None:
        return {}
    folder.mkdir(parents=True, exist_ok=True)
    if not resume and any(True for _ in part_files(folder)):
        raise ValueError(f"{folder} has results of an earlier sweep; resume it, or take another")
    return read_parts(folder) if resume else {}


def _is_open(record: _Record | None) -> bool:
    return record is None or record["error"] is not None


def _batches(todo: Sequence[Work], batch: int | None, jobs: int) -> list[Sequence[Work]]:
    size = batch or min(max(1, len(todo) // (BATCHES_PER_WORKER * jobs)), LARGEST_BATCH)
    return [todo[i : i + size] for i in range(0, len(todo), size)]


def _outcome(arguments: Mapping[str, Any], record: _Record) -> Outcome:
    error = record["error"]
    return Outcome(
        arguments=arguments,
        result=record["result"],
        error=None if error is None else (error[0], error[1]),
        cpu_time=record["cpu_time"],
        wall_time=record["wall_time"],
    )


def _raise_first_error(part: Mapping[str, _Record]) -> None:
    for record in part.values():
        if record["error"] is not None:
            raise SweepError(f"a case failed: {': '.join(record['error'])}")


def _missing(dtype: np.dtype) -> Any:
    return "" if dtype.kind == "U" else np.nan
