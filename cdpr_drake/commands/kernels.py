"""Compiling the kernels ahead, and telling the user when that is done or cannot be.

    python -m cdpr_drake.commands.kernels

compiles what the default run needs, so that the first run need not wait.
"""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Iterator
from typing import Any

from cdpr_drake.commands.terminal import print_message
from cdpr_drake.model.kernels import is_compiled

_PREFIX = "cdpr_drake.model.kernels."


@contextlib.contextmanager
def compilation_announced() -> Iterator[None]:
    """Say so on stderr as soon as numba compiles a kernel inside, rather than load it.

    Where there is no numba, say that at the end, unless an exception leaves the block.
    """
    if not is_compiled():
        yield
        print_message(
            "note: numba is not installed or off; runs take several times longer without it"
        )
        return
    finished = threading.Event()
    earlier = _compiled()

    def watch() -> None:
        while not finished.wait(0.1):
            if _compiled() > earlier:
                print_message("compiling kernels on their first use; this takes up to a minute ...")
                return

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield
    finally:
        finished.set()
        thread.join()


def compile_ahead() -> None:
    """Compile the kernels that the default run needs, unless that was done before."""
    from cdpr_drake.commands.parsing import parse
    from cdpr_drake.commands.run import plan
    from cdpr_drake.runs import prepare

    with compilation_announced():
        for setup in plan(parse(["run"]).options).setups:
            prepare(setup)


def _compiled() -> int:
    """Return how many kernels this process has compiled so far, rather than loaded."""
    return sum(sum(kernel.stats.cache_misses.values()) for kernel in _kernels())


def _kernels() -> Iterator[Any]:
    """Yield the compiled functions of the kernel modules imported so far."""
    for name, module in list(sys.modules.items()):
        if name.startswith(_PREFIX):
            for value in list(vars(module).values()):
                if hasattr(value, "py_func") and hasattr(value, "stats"):
                    yield value


if __name__ == "__main__":
    compile_ahead()
