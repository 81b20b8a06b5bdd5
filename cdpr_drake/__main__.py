"""The command line, `cdpr-drake` or `python -m cdpr_drake`: its exit status, errors on one line."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence

from cdpr_drake.commands import UsageError
from cdpr_drake.commands.parsing import Call, parse
from cdpr_drake.commands.terminal import print_message, warnings_on_one_line


def main(argv: Sequence[str] | None = None) -> int:
    """Carry out a command line and return its exit status, 0 if all went well.

    Args:
        argv: the arguments, without the program's name; those of the process if None.

    Raises:
        SystemExit: after --help and --version.
    """
    return carry_out(lambda: parse(sys.argv[1:] if argv is None else argv))


def carry_out(parsed: Callable[[], Call]) -> int:
    """Carry out a command and return its exit status, what went wrong in one line on stderr.

    Args:
        parsed: returns the command and its options.
    """
    try:
        command, options = parsed()
        with warnings_on_one_line():
            status = command.work(options)
        sys.stdout.flush()
        return status
    except UsageError as error:
        print_message(f"error: {error}")
        return 2
    except KeyboardInterrupt:
        print_message("interrupted, nothing written")
        return 130
    except BrokenPipeError:  # whoever read the output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


if __name__ == "__main__":
    sys.exit(main())
