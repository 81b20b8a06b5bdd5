"""The table of reference values, tests/oracle.toml, read once; the file says what each row is.

ORACLE["C1"]["l_ecm_4"], ORACLE["robot"]["cable_1"]["D_s_row"], ...
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

ORACLE: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
)
CABLES = {name: row for name, row in ORACLE.items() if name.startswith("C")}
IRVINE_CABLES = {name: row for name, row in ORACLE.items() if name.startswith("I")}
