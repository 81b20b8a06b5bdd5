"""The running of a sweep: batches go out, records come back, whatever happens to the workers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from concurrent.futures import (
    ALL_COMPLETED,
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Future,
    wait,
)
from typing import Any

from cdpr_drake.batch.job import error_text, run_batch
from cdpr_drake.batch.workers import Workers, one_thread_each
from cdpr_drake.errors import SweepError

Work = tuple[str, Mapping[str, Any]]
"""A case's key and the function's arguments."""

Records = dict[str, dict[str, Any]]
"""By a case's key: result (None if it failed), error (None if not), cpu_time, wall_time [s]."""


class Runner:
    """Batches on their way through workers.

    Args:
        function: what to call.
        batches: of cases.
        workers: where.
    """

    def __init__(
        self,
        function: Callable[..., Mapping[str, Any]],
        batches: Iterable[Sequence[Work]],
        workers: Workers,
    ) -> None:
        self._function = function
        self._workers = workers
        self._waiting = deque(batches)
        self._running: dict[Future[Any], Sequence[Work]] = {}
        # Cases that were under way when an executor broke. One of them may be the reason, so each
        # goes alone: then the next time it is clear which.
        self._suspects: deque[Sequence[Work]] = deque()
        self._alone = False
        self._broken: BaseException | None = None

    def records(self) -> Generator[Records, None, None]:
        """Yield the records of each batch when it is done, in any order, each case once.

        Raises:
            SweepError: the executor broke and was given, or workers do not start.
        """
        is_complete = False
        try:
            with one_thread_each():
                while self._waiting or self._suspects or self._running:
                    yield from self._next()
            is_complete = True
        finally:
            for future in self._running:
                future.cancel()
            self._workers.close(at_once=not is_complete)

    def _next(self) -> list[Records]:
        """Give out what there is room for, and return what came back."""
        if self._broken is not None:  # only now, when all that it did is handed on
            self._workers.replace(self._broken)
        lost: list[Sequence[Work]] = []
        broken = self._give_out()
        wait(self._running, return_when=FIRST_COMPLETED)
        done, error = self._collect(lost)
        self._broken = broken = broken or error
        if broken is None:
            return done
        wait(self._running, return_when=ALL_COMPLETED)  # all that was given to it fails
        done += self._collect(lost)[0]
        if self._alone and lost:
            done.append({lost[0][0][0]: _failure(broken)})
        else:
            self._suspects.extend([work] for batch in lost for work in batch)
        return done

    def _give_out(self) -> BaseException | None:
        """Submit batches while there is room; return the error of a broken executor."""
        if not self._running:
            self._alone = bool(self._suspects)
        elif self._alone or self._suspects:
            return None
        queue, room = (self._suspects, 1) if self._alone else (self._waiting, self._workers.jobs)
        while queue and len(self._running) < room:
            arguments = [arguments for _, arguments in queue[0]]
            try:
                future = self._workers.submit(run_batch, self._function, arguments)
            except BrokenExecutor as error:
                return error
            self._running[future] = queue.popleft()
        return None

    def _collect(self, lost: list[Sequence[Work]]) -> tuple[list[Records], BaseException | None]:
        """Return what is done, and a broken executor's error; gather the batches it `lost`."""
        done: list[Records] = []
        broken = None
        for future in [future for future in self._running if future.done()]:
            batch = self._running.pop(future)
            try:
                records = future.result()
            except BrokenExecutor as error:
                broken = error
                lost.append(batch)
            except CancelledError as error:
                raise SweepError("the executor was closed, or cancelled the work") from error
            except Exception as error:  # not the function's, e.g. Dask's KilledWorker
                if len(batch) == 1:
                    done.append({batch[0][0]: _failure(error)})
                else:
                    self._waiting.extendleft([work] for work in batch)
            else:
                self._workers.have_worked()
                done.append({key: r for (key, _), r in zip(batch, records, strict=True)})
        return done, broken


def _failure(error: BaseException) -> dict[str, Any]:
    return {"result": None, "error": error_text(error), "cpu_time": 0.0, "wall_time": 0.0}
