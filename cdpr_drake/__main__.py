"""The command line, `cdpr-drake` or `python -m cdpr_drake`."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from cdpr_drake.commands.execution import carry_out
from cdpr_drake.commands.parsing import parse


def main(argv: Sequence[str] | None = None) -> int:
    """Carry out a command line and return its exit status, 0 if all went well.

    Args:
        argv: the arguments, without the program's name; those of the process if None.

    Raises:
        SystemExit: after --help and --version.
    """
    return carry_out(lambda: parse(sys.argv[1:] if argv is None else argv))


if __name__ == "__main__":
    sys.exit(main())
