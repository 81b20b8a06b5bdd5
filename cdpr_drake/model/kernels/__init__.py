"""Scalar code over cables, compiled by numba where it is installed and plain Python where not.

Modules of this folder are imported when first used, so that `import cdpr_drake` does not pay for
numba. Set CDPR_DRAKE_NUMBA=0 to run them uncompiled.
"""

from __future__ import annotations

import functools
import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any


def jit(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile `function` with numba, cached on disk, or return it as it is.

    What is cached counts only as long as no kernel has changed: a compiled function holds those it
    calls, of which numba would not notice that they are others now.
    """
    if not is_compiled():
        return function
    import numba

    compiled: Any = numba.njit(cache=True, error_model="numpy")(function)
    compiled._cache._cache_file._source_stamp = _sources()
    return compiled


@functools.cache
def _sources() -> str:
    """Return a digest of all kernels."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.blake2b(b"".join(file.read_bytes() for file in files)).hexdigest()


def is_compiled() -> bool:
    """Whether kernels are compiled: numba is installed and CDPR_DRAKE_NUMBA is not 0."""
    if os.environ.get("CDPR_DRAKE_NUMBA", "1") == "0":
        return False
    try:
        import numba  # noqa: F401
    except ImportError:
        return False
    return True
