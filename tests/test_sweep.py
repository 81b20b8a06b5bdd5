"""Sweeps: the same results on every executor, none lost and none twice, whatever dies."""

from __future__ import annotations

import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from sweep_functions import deadly, noisy, nothing, picky, slow

from cdpr_drake.batch.job import ARRAY, plain
from cdpr_drake.batch.store import fingerprint, read_parts, write_part
from cdpr_drake.batch.sweeps import Sweep, case_seed, sweep
from cdpr_drake.errors import SweepError

CASES = [{"x": float(i)} for i in range(7)]


@pytest.fixture
def threads() -> Iterator[Executor]:
    """Two threads."""
    with ThreadPoolExecutor(2) as executor:
        yield executor


def same(a: Any, b: Any) -> bool:
    """Whether two results are the same to the bit."""
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and np.array_equal(a, b)
    if isinstance(a, Mapping):
        return list(a) == list(b) and all(same(a[name], b[name]) for name in a)
    if isinstance(a, list):
        return len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and a == b


def without_place(done: Sweep) -> list[dict[str, Any]]:
    """Return the results without what says where they came from."""
    return [{n: v for n, v in r.items() if n not in ("process", "threads")} for r in done if r]


def wait_until(condition: Callable[[], bool], seconds: float = 30.0) -> None:
    """Wait until a condition holds, and fail if it does not."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.02)


def busy(folder: Path) -> list[int]:
    """Return the processes that began a slow case."""
    return [int(path.name.removeprefix("process-")) for path in folder.glob("process-*")]


def is_running(pid: int) -> bool:
    """Whether a process is there, and not merely unburied."""
    try:
        return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False


# --- results


def test_results_do_not_depend_on_executor_order_or_batch(threads: Executor) -> None:
    in_threads = sweep(noisy, CASES, executor=threads, batch=3)
    in_one = sweep(noisy, CASES, executor=lambda: ThreadPoolExecutor(1), batch=1)
    in_processes = sweep(noisy, CASES, jobs=2, batch=1)
    assert same(without_place(in_threads), without_place(in_processes))
    assert same(without_place(in_threads), without_place(in_one))
    assert os.getpid() not in in_processes.column("process")
    assert set(in_processes.column("threads")) == {"1"}
    assert "OMP_NUM_THREADS" not in os.environ or os.environ["OMP_NUM_THREADS"] != "1"
    assert in_threads.column("y").tolist() == [x * x for x in range(7)]
    assert len(set(in_threads.column("seed"))) == len(in_threads) == 7
    assert in_threads.cpu_time < 1.0 and not in_threads.errors and in_threads.wall_time > 0.0


def test_seeds_follow_from_the_sweep_seed_and_the_number_of_the_case(threads: Executor) -> None:
    expected = [np.random.SeedSequence(5, spawn_key=(i,)).generate_state(1)[0] for i in range(7)]
    done = sweep(noisy, CASES, executor=threads, seed=5)
    assert done.column("seed").tolist() == expected
    assert done.outcomes[2].arguments == {"x": 2.0, "seed": case_seed(5, 2)}
    # The seeds of the first cases stay when others are added.
    assert sweep(noisy, CASES[:3], executor=threads, seed=5).column("seed").tolist() == expected[:3]


def test_an_error_is_kept_as_that_of_its_case(threads: Executor, tmp_path: Path) -> None:
    cases = [{"x": float(x), "log": str(tmp_path / "log")} for x in range(5)]
    done = sweep(picky, cases, executor=threads, seed=None, batch=2)
    assert done.errors == {3: ("ValueError", "not three")}
    assert done[3] is None and done.outcomes[3].result is None
    assert [r and r["y"] for r in done] == [0.0, 1.0, 2.0, None, 4.0]
    y, vector = done.column("y"), done.column("vector")
    assert np.isnan(y[3]) and y[4] == 4.0
    assert vector.shape == (5, 2) and np.isnan(vector[3]).all() and vector[4].tolist() == [4, 4]
    assert done.column("text").tolist() == ["a", "a", "a", "", "a"]
    assert np.isnan(done.column("flag")[3]) and done.column("flag")[0] == 1.0
    with pytest.raises(KeyError, match="no_such"):
        done.column("no_such")
    with pytest.raises(SweepError, match="a case failed: ValueError: not three"):
        sweep(picky, cases, executor=threads, seed=None, stop_at_error=True)
    with pytest.raises(ValueError, match="no case has a result"):
        sweep(picky, cases[3:4], executor=threads, seed=None).column("y")


def test_a_result_that_is_no_mapping_is_an_error_of_its_case(threads: Executor) -> None:
    done = sweep(nothing, [{"x": 1.0}], executor=threads, seed=None)
    assert done.errors == {0: ("TypeError", "the result is no mapping but a NoneType")}


def test_equal_cases_without_seeds_run_once(threads: Executor, tmp_path: Path) -> None:
    log = tmp_path / "log"
    cases = [{"x": x, "log": str(log)} for x in (1.0, 2.0, 1.0)]
    counts: list[tuple[int, int]] = []
    done = sweep(picky, cases, executor=threads, seed=None, progress=lambda *c: counts.append(c))
    assert done.column("y").tolist() == [1.0, 2.0, 1.0]
    assert sorted(log.read_text().split()) == ["1", "2"]
    assert counts[0] == (0, 3) and counts[-1] == (3, 3) and len(counts) == 3


# --- what is kept


def test_what_is_kept_comes_back_to_the_bit(threads: Executor, tmp_path: Path) -> None:
    fresh = sweep(noisy, CASES, executor=threads, folder=tmp_path / "new" / "folder", batch=2)
    again = sweep(noisy, CASES, executor=threads, folder=tmp_path / "new" / "folder", resume=True)
    assert again.resumed == 7 and fresh.resumed == 0
    assert same(list(fresh), list(again))
    assert fresh.cpu_time == again.cpu_time
    files = sorted(path.name for path in (tmp_path / "new" / "folder").iterdir())
    assert len(files) == 4 and all(name.endswith(".npz") for name in files)


def test_a_sweep_goes_on_after_an_interruption(threads: Executor, tmp_path: Path) -> None:
    log, folder = tmp_path / "log", tmp_path / "kept"
    cases = [{"x": float(x), "log": str(log)} for x in (0, 1, 2, 4, 5, 6)]

    def interrupt(done: int, total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(
            picky, cases, executor=threads, seed=None, folder=folder, jobs=1, batch=1,
            progress=interrupt,
        )  # fmt: skip
    assert len(log.read_text().split()) == 2
    with pytest.raises(ValueError, match="earlier sweep"):
        sweep(picky, cases, executor=threads, seed=None, folder=folder)
    done = sweep(picky, cases, executor=threads, seed=None, folder=folder, resume=True)
    assert done.resumed == 2
    assert done.column("y").tolist() == [0, 1, 2, 4, 5, 6]
    assert sorted(log.read_text().split()) == ["0", "1", "2", "4", "5", "6"]


def test_only_results_of_the_same_case_seed_and_version_are_taken(
    threads: Executor, tmp_path: Path
) -> None:
    def resumed(cases: list[dict[str, Any]], **changes: Any) -> int:
        settings = {"executor": threads, "folder": tmp_path, "resume": True, **changes}
        return sweep(noisy, cases, **settings).resumed

    assert resumed(CASES) == 0
    assert resumed([*CASES, {"x": 8.0}]) == 7
    assert resumed(CASES, version="2") == 0
    assert resumed(CASES, seed=1) == 0
    assert resumed(CASES[1:]) == 0  # a case has its seed from its number
    assert resumed(CASES, version="2") == 7


def test_failed_cases_run_again_when_resumed(threads: Executor, tmp_path: Path) -> None:
    log = tmp_path / "log"
    cases = [{"x": float(x), "log": str(log)} for x in (2, 3)]
    settings: dict[str, Any] = {"executor": threads, "seed": None, "folder": tmp_path / "kept"}
    assert sweep(picky, cases, **settings).errors
    done = sweep(picky, cases, resume=True, **settings)
    assert done.resumed == 1 and done.errors
    assert sorted(log.read_text().split()) == ["2", "3", "3"]


def test_a_success_counts_more_than_a_failure(tmp_path: Path) -> None:
    good = {"result": {"y": 1}, "error": None, "cpu_time": 0.0, "wall_time": 0.0}
    bad = {"result": None, "error": ["E", "m"], "cpu_time": 0.0, "wall_time": 0.0}
    write_part(tmp_path, {"a": good, "b": bad})
    write_part(tmp_path, {"a": bad})
    write_part(tmp_path, {"b": good})
    (tmp_path / "part-x.unfinished").write_bytes(b"half")
    assert read_parts(tmp_path) == {"a": good, "b": good}


def test_a_damaged_file_is_named(threads: Executor, tmp_path: Path) -> None:
    sweep(noisy, CASES[:1], executor=threads, folder=tmp_path)
    (path,) = tmp_path.iterdir()
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(SweepError, match=r"part-\w+\.npz: damaged"):
        sweep(noisy, CASES[:1], executor=threads, folder=tmp_path, resume=True)


def test_values_become_plain() -> None:
    value = {1: (np.float64(2.0), np.int32(3)), "b": np.bool_(True)}
    assert same(plain(value), {"1": [2.0, 3], "b": True})
    for wrong in (object(), {ARRAY: 1}, np.array([object()]), [1j], {"f": print}):
        with pytest.raises(TypeError):
            plain(wrong)


def test_fingerprints_tell_cases_apart() -> None:
    different: list[Any] = [
        1, 1.0, "1", True, None, [1], {"a": 1}, {"a": 2}, np.array([1]), np.array([1.0]),
        np.array([[1.0]]), np.array([1.0 + 0j]), noisy, picky,
    ]  # fmt: skip
    assert len({fingerprint(v) for v in different}) == len(different)
    assert fingerprint({"a": 1, "b": (2,)}) == fingerprint({"b": [2], "a": np.int64(1)})
    assert json.dumps(fingerprint(1)).isascii()


# --- executors that break


def test_a_case_that_kills_its_process_costs_no_other(tmp_path: Path) -> None:
    cases = [{"x": x, "folder": str(tmp_path)} for x in (0, 1, 2, 4)]
    done = sweep(deadly, cases, jobs=1, batch=2, seed=None)
    assert list(done.errors) == [3]
    assert done.errors[3][0] == "BrokenProcessPool"
    assert [r and r["y"] for r in done] == [0, 10, 20, None]


class Breaking(Executor):
    """Works `good` times, then is broken; the calls that work are made at once."""

    def __init__(self, good: int) -> None:
        self.good = good

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Call a function, or fail."""
        if self.good == 0:
            raise BrokenExecutor("gone")
        self.good -= 1
        future: Future[Any] = Future()
        future.set_result(function(*args, **kwargs))
        return future


def test_a_given_executor_that_breaks_ends_the_sweep_and_the_done_is_kept(tmp_path: Path) -> None:
    with pytest.raises(SweepError, match="the executor broke: BrokenExecutor: gone"):
        sweep(noisy, CASES, executor=Breaking(3), folder=tmp_path, batch=1)
    with pytest.raises(SweepError, match="the executor broke"):
        sweep(noisy, CASES, executor=Breaking(2), folder=tmp_path, batch=1, resume=True)
    done = sweep(noisy, CASES, executor=Breaking(2), folder=tmp_path, batch=1, resume=True)
    assert done.resumed == 5 and not done.errors


def test_a_made_executor_that_breaks_is_made_again() -> None:
    made = []

    def make() -> Executor:
        made.append(Breaking(2))
        return made[-1]

    done = sweep(noisy, CASES, executor=make, batch=1, jobs=2)
    assert not done.errors and len(made) == 4
    with pytest.raises(SweepError, match="a new executor is broken"):
        sweep(noisy, CASES, executor=lambda: Breaking(0))


class Cancelling(Breaking):
    """Cancels all it gets."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return a cancelled future."""
        future: Future[Any] = Future()
        future.cancel()
        future.set_running_or_notify_cancel()
        return future


def test_an_executor_that_was_closed_ends_the_sweep() -> None:
    with pytest.raises(SweepError, match="closed"):
        sweep(noisy, CASES, executor=Cancelling(0))


class Losing(Breaking):
    """Loses a case with x = 3 and all that is in a batch with it."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Call a function, or fail."""
        if any(case["x"] == 3.0 for case in args[1]):
            future: Future[Any] = Future()
            future.set_exception(RuntimeError("killed"))
            return future
        return super().submit(function, *args, **kwargs)


def test_what_an_executor_loses_is_one_case_only() -> None:
    done = sweep(noisy, CASES, executor=Losing(-1), batch=4)
    assert done.errors == {3: ("RuntimeError", "killed")}


# --- a process that is killed


SCRIPT = """
import sys
from sweep_functions import slow
from cdpr_drake.batch import sweep
if __name__ == "__main__":
    folder = sys.argv[1]
    cases = [{"x": x, "folder": folder} for x in range(40)]
    sweep(slow, cases, jobs=1, batch=1, folder=folder + "/kept")
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="no /proc to look at")
def test_a_killed_sweep_leaves_no_process_and_goes_on_where_it_was(
    threads: Executor, tmp_path: Path
) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    paths = os.pathsep.join([str(Path(__file__).parent), *filter(None, sys.path)])
    process = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path)], env={**os.environ, "PYTHONPATH": paths}
    )
    kept = tmp_path / "kept"
    try:
        wait_until(lambda: len(list(kept.glob("part-*.npz"))) >= 4)
    finally:
        process.kill()
        process.wait()
    wait_until(lambda: not any(map(is_running, busy(tmp_path))))
    count = len(list(kept.glob("part-*.npz")))
    cases = [{"x": x, "folder": str(tmp_path)} for x in range(8)]
    done = sweep(slow, cases, executor=threads, folder=kept, resume=True)
    assert 4 <= done.resumed <= count < 40
    assert done.column("y").tolist() == list(range(8))
    assert done.column("seed").tolist() == [case_seed(0, x) for x in range(8)]
    for x in range(min(done.resumed, 8)):
        assert (tmp_path / f"runs-of-{x}").read_text() == "x"


# --- what cannot be used


def test_what_cannot_be_used_is_refused_before_anything_runs(
    threads: Executor, tmp_path: Path
) -> None:
    def local(x: float) -> dict[str, Any]:
        return {}

    for function in (local, lambda x: {}):
        with pytest.raises(ValueError, match="top level"):
            sweep(function, CASES, executor=threads)
    with pytest.raises(ValueError, match="case 0 has a seed"):
        sweep(noisy, [{"x": 1.0, "seed": 1}], executor=threads)
    with pytest.raises(TypeError, match="case 1: a object"):
        sweep(noisy, [{"x": 1.0}, {"x": object()}], executor=threads)
    for changes in ({"jobs": 0}, {"batch": 0}):
        with pytest.raises(ValueError, match="at least 1"):
            sweep(noisy, CASES, **changes)
    assert list(sweep(noisy, [], executor=threads)) == []


def test_a_function_of_an_interpreter_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    path = tmp_path / "typed.py"
    path.write_text("def typed(x):\n    return {}\n")
    spec = importlib.util.spec_from_file_location("typed", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.typed.__module__ = "__main__"
    monkeypatch.setitem(sys.modules, "__main__", ModuleType("__main__"))
    with pytest.raises(ValueError, match="import it from a file"):
        sweep(module.typed, CASES, seed=None)


# --- a cluster


@pytest.mark.needs("distributed")
def test_a_cluster_that_loses_a_worker_loses_no_case(tmp_path: Path) -> None:
    from distributed import Client, LocalCluster

    cases = [{"x": x, "folder": str(tmp_path)} for x in range(24)]
    killed: list[int] = []
    settings: dict[str, Any] = {"dashboard_address": None, "host": "127.0.0.1"}
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, processes=True, **settings) as cluster,
        Client(cluster) as client,
    ):
        client.wait_for_workers(2, timeout=60)
        workers = client.run(os.getpid).values()

        def kill_one(done: int, total: int) -> None:
            if done >= 4 and not killed:
                killed.extend([pid for pid in workers if pid in busy(tmp_path)][:1])
                os.kill(killed[0], signal.SIGKILL)

        done = sweep(
            slow, cases, executor=client.get_executor(), batch=1, folder=tmp_path / "kept",
            progress=kill_one,
        )  # fmt: skip
    assert killed and not is_running(killed[0])
    assert not done.errors
    assert done.column("y").tolist() == list(range(24))
    assert done.column("seed").tolist() == [case_seed(0, x) for x in range(24)]
    stored = read_parts(tmp_path / "kept")
    assert len(stored) == 24 == len(list((tmp_path / "kept").glob("part-*.npz")))
    assert sorted(record["result"]["y"] for record in stored.values()) == list(range(24))
    wait_until(lambda: not any(map(is_running, busy(tmp_path))))
