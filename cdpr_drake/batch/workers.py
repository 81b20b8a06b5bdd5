"""Where the work of a sweep is done: an executor, replaced when it breaks if that is possible."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from typing import Any

from cdpr_drake.batch.job import nothing, obey_parent
from cdpr_drake.errors import SweepError

MANY = 1000
"""Batches that an executor gets at a time when its number of workers is not known."""

THREAD_LIMITS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMBA_NUM_THREADS",
)
"""Variables that tell numerical libraries, when they are loaded, how many threads to use."""


def usable_cores() -> int:
    """Return how many processor cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Workers:
    """An executor and how many batches it gets at a time.

    Args:
        executor: as `sweep` takes it: None for processes of our own, an executor, or a function
            that makes one.
        jobs: batches at a time; as many as cores, or `MANY` for a given executor, if None.

    Attributes:
        jobs: batches at a time.
        are_processes: whether they are processes of our own.
    """

    def __init__(
        self, executor: Executor | Callable[[], Executor] | None, jobs: int | None
    ) -> None:
        self.are_processes = executor is None
        self._executor: Executor | None = None
        self._make: Callable[[], Executor] | None = None
        if isinstance(executor, Executor):
            self._executor = executor
            self.jobs = jobs or MANY
        else:
            self._make = executor or self._processes
            self.jobs = jobs or usable_cores()
        self._have_worked = False

    def submit(self, function: Callable[..., Any], *args: Any) -> Future[Any]:
        """Return the future of function(*args).

        Args:
            function: what to call.

        Raises:
            BrokenExecutor: the executor broke since it was made.
            SweepError: it was broken from the start.
        """
        if self._executor is not None:
            return self._executor.submit(function, *args)
        assert self._make is not None
        self._executor = self._make()
        try:
            return self._executor.submit(function, *args)
        except BrokenExecutor as error:
            raise SweepError(f"a new executor is broken: {error}") from error

    def have_worked(self) -> None:
        """Note that a batch came back."""
        self._have_worked = True

    def replace(self, error: BaseException) -> None:
        """Do away with a broken executor, so that the next submission makes another.

        Args:
            error: what it said.

        Raises:
            SweepError: it was given, not made here; or workers do not even start.
        """
        if self._make is None:
            raise SweepError(f"the executor broke: {type(error).__name__}: {error}") from error
        self._shut_down()
        if self._have_worked or not self.are_processes:
            return
        try:
            self.submit(nothing).result()
        except BrokenExecutor:
            raise SweepError(
                "worker processes do not start; a script must call this below "
                '`if __name__ == "__main__":`'
            ) from error
        self._have_worked = True

    def close(self, at_once: bool = False) -> None:
        """Stop the executor, unless it was given.

        Args:
            at_once: end processes of our own in the middle of their work.
        """
        if self._make is None:
            return
        if at_once and self.are_processes:
            for process in list((getattr(self._executor, "_processes", None) or {}).values()):
                process.terminate()
        self._shut_down()

    def _shut_down(self) -> None:
        if self._executor is not None:
            self._executor.shutdown(wait=True, cancel_futures=True)
            self._executor = None

    def _processes(self) -> Executor:
        # Started anew, not forked: the threads of Drake and BLAS do not survive a fork.
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self.jobs, mp_context=context, initializer=obey_parent)


@contextlib.contextmanager
def one_thread_each() -> Iterator[None]:
    """Let processes started within use one thread each, unless the environment says otherwise."""
    added = [name for name in THREAD_LIMITS if name not in os.environ]
    os.environ.update(dict.fromkeys(added, "1"))
    try:
        yield
    finally:
        for name in added:
            os.environ.pop(name, None)


def check_importable(function: Callable[..., Any]) -> None:
    """Refuse a function that a new process would not find.

    Args:
        function: what it shall call.

    Raises:
        ValueError: it cannot be found.
    """
    if function.__module__ == "__main__" and not hasattr(sys.modules["__main__"], "__file__"):
        raise ValueError(
            f"{function.__name__}: other processes do not find what was typed into a notebook or "
            "an interpreter; import it from a file"
        )
    try:
        pickle.dumps(function)
    except (pickle.PicklingError, AttributeError) as error:
        raise ValueError(f"{function.__name__}: {error}") from None
