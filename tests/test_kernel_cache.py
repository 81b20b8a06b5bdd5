"""Compiled kernels are made anew when one that they call has changed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cdpr_drake.model import kernels


@pytest.mark.needs("numba")
def test_a_changed_kernel_is_noticed_by_those_that_call_it(tmp_path: Path) -> None:
    folder = tmp_path / "their_kernels"
    folder.mkdir()
    shutil.copy(kernels.__file__, folder / "__init__.py")
    (folder / "outer.py").write_text(
        "from their_kernels import jit\nfrom their_kernels.inner import inner\n"
        "@jit\ndef outer(x):\n    return 10.0 * inner(x)\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "CDPR_DRAKE_NUMBA": "1"}

    def outer() -> tuple[float, int]:
        """Return its value in a new process, and how often the cache had it."""
        text = subprocess.run(
            [
                sys.executable, "-c",
                "from their_kernels.outer import outer; "
                "print(outer(1.0), sum(outer.stats.cache_hits.values()))",
            ],
            env=environment, cwd=tmp_path, capture_output=True, text=True, check=True,
        ).stdout.split()  # fmt: skip
        return float(text[0]), int(text[1])

    for factor in (2.0, 3.0):
        (folder / "inner.py").write_text(
            f"from their_kernels import jit\n@jit\ndef inner(x):\n    return {factor} * x\n"
        )
        assert outer() == (10.0 * factor, 0)
        assert outer() == (10.0 * factor, 1)
