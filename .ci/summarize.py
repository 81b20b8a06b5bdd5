"""Print one line on a test run: usage `summarize.py NAME JUNIT_FILE`, by the Python that ran it."""

from __future__ import annotations

import platform
import sys
import xml.etree.ElementTree as ElementTree
from importlib.metadata import version


def summary(junit_file: str) -> str:
    """Return the counts of a pytest JUnit report, e.g. `12 passed, 1 skipped, 0 failed`."""
    suites = ElementTree.parse(junit_file).getroot().findall("testsuite")
    tests, skipped, failures, errors = (
        sum(int(suite.get(kind, 0)) for suite in suites)
        for kind in ("tests", "skipped", "failures", "errors")
    )
    failed = failures + errors
    return f"{tests - skipped - failed} passed, {skipped} skipped, {failed} failed"


if __name__ == "__main__":
    name, junit_file = sys.argv[1:]
    print(
        f"{name}: {summary(junit_file)} "
        f"(Python {platform.python_version()}, Drake {version('drake')})"
    )
