"""Many runs: a function over many cases, the workers, what is kept on disk.

A worker imports `cdpr_drake.batch.job` and so this: it loads nothing until it is asked for.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cdpr_drake.batch.job import plain
    from cdpr_drake.batch.sweeps import Outcome, Sweep, sweep

__all__ = ["Outcome", "Sweep", "plain", "sweep"]


def __getattr__(name: str) -> Any:
    """Import what this offers by `name` when first asked for."""
    if name == "plain":
        return importlib.import_module("cdpr_drake.batch.job").plain
    if name in __all__:
        return getattr(importlib.import_module("cdpr_drake.batch.sweeps"), name)
    raise AttributeError(f"module 'cdpr_drake.batch' has no attribute '{name}'")
