"""Scalar code over cables, compiled by numba where it is installed and plain Python where not.

Modules of this folder are imported when first used, so that `import cdpr_drake` does not pay for
numba. Set CDPR_DRAKE_NUMBA=0 to run them uncompiled.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any


def jit(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile `function` with numba, cached on disk, or return it as it is."""
    if not is_compiled():
        return function
    import numba

    return numba.njit(cache=True, error_model="numpy")(function)


def is_compiled() -> bool:
    """Whether kernels are compiled: numba is installed and CDPR_DRAKE_NUMBA is not 0."""
    if os.environ.get("CDPR_DRAKE_NUMBA", "1") == "0":
        return False
    try:
        import numba  # noqa: F401
    except ImportError:
        return False
    return True
