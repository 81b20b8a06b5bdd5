"""Every notebook is a lesson: prose, pictures kept in the file, exercises; and it runs."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path
from typing import Any

import pytest

import cdpr_drake

FOLDER = Path(__file__).parents[1] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
MAX_BYTES = 1.5e6
TIME_LIMIT = 150  # s, of one cell: only for what would never end

# Runs before the notebook. A warning may be laid to the notebook that called us, so our
# own kinds of warning count as well as those raised in our files.
WARNINGS_ARE_ERRORS = """
import warnings
from pydrake.common.deprecation import DrakeDeprecationWarning
from cdpr_drake.model.robot import RobotFileWarning
from cdpr_drake.study.linear import LinearizationWarning
warnings.filterwarnings("error", module=r"cdpr_drake($|\\.)")
for kind in (DrakeDeprecationWarning, RobotFileWarning, LinearizationWarning):
    warnings.filterwarnings("error", category=kind)
"""

pytestmark = [pytest.mark.needs("jupyter")]
each_notebook = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def read(path: Path) -> Any:
    """Return a notebook."""
    import nbformat

    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    return notebook


def code_cells(notebook: Any) -> list[Any]:
    """Return the cells of code that are not empty."""
    return [c for c in notebook.cells if c.cell_type == "code" and c.source.strip()]


def may_raise(cell: Any) -> bool:
    """Whether a cell is one that fails on purpose."""
    return "raises-exception" in cell.metadata.get("tags", [])


def outputs(notebook: Any, kind: str) -> list[tuple[Any, Any]]:
    """Return (cell, output) for all outputs of a kind: stream, error, display_data, ..."""
    return [(c, o) for c in code_cells(notebook) for o in c.outputs if o.output_type == kind]


def check_outputs(notebook: Any) -> None:
    """No error but on purpose, and there one; nothing on stderr, where warnings go."""
    for cell, error in outputs(notebook, "error"):
        assert may_raise(cell), f"{error.ename}: {error.evalue}\nin\n{cell.source}"
    for cell in filter(may_raise, code_cells(notebook)):
        assert any(o.output_type == "error" for o in cell.outputs), f"no error in\n{cell.source}"
    for cell, stream in outputs(notebook, "stream"):
        assert stream.name == "stdout", f"{stream.text}\nfrom\n{cell.source}"


def count_pictures(notebook: Any) -> int:
    """Return how many PNG pictures a notebook holds."""
    shown = outputs(notebook, "display_data") + outputs(notebook, "execute_result")
    return sum("image/png" in output.data for _, output in shown)


def test_there_are_notebooks_and_the_readme_lists_them() -> None:
    assert NOTEBOOKS
    text = (FOLDER / "README.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"\]\((\w+\.ipynb)\)", text))
    assert listed == {path.name for path in NOTEBOOKS}


@each_notebook
def test_is_a_lesson(path: Path) -> None:
    notebook = read(path)
    prose = [cell.source for cell in notebook.cells if cell.cell_type == "markdown"]
    assert notebook.cells[0].cell_type == "markdown"
    assert notebook.cells[0].source.startswith("# ")
    assert len(notebook.cells[0].source.split()) >= 40, "begins with too little prose"
    last = prose[-1]
    assert "## Exercises" in last
    exercises = last.partition("## Exercises")[2]
    assert re.findall(r"^(\d)\. ", exercises, flags=re.MULTILINE) == ["1", "2", "3"]


@each_notebook
def test_is_kept_with_what_it_printed_and_drew(path: Path) -> None:
    notebook = read(path)
    check_outputs(notebook)
    assert count_pictures(notebook) >= 2
    counts = [cell.execution_count for cell in code_cells(notebook)]
    assert counts == list(range(1, len(counts) + 1)), "not run once from top to bottom"
    assert path.stat().st_size < MAX_BYTES


@each_notebook
def test_holds_nothing_of_the_machine_it_ran_on(path: Path) -> None:
    notebook = read(path)
    for cell in notebook.cells:
        assert "execution" not in cell.metadata, "holds times"
    texts = [cell.source for cell in notebook.cells]
    texts += [stream.text for _, stream in outputs(notebook, "stream")]
    texts += ["\n".join(error.traceback) for _, error in outputs(notebook, "error")]
    for kind in ("display_data", "execute_result"):
        texts += [str(output.data.get("text/plain", "")) for _, output in outputs(notebook, kind)]
    for text in texts:
        found = re.search(r"(?<![\w.:/)\]}])(/[\w.-]+){2,}|[A-Z]:\\\\?\w+|0x[0-9a-f]{6,}", text)
        assert not found, f"{found[0]!r} in\n{text[-400:]}" if found else ""


@pytest.mark.slow
@pytest.mark.notebook
@each_notebook
def test_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import nbformat
    from nbclient import NotebookClient

    for file in FOLDER.iterdir():  # a notebook may write beside itself
        if file.is_file() and file.suffix != ".ipynb":
            shutil.copy(file, tmp_path)
    package = str(Path(cdpr_drake.__file__).parents[1])
    python_path = os.pathsep.join(filter(None, [package, os.environ.get("PYTHONPATH")]))
    monkeypatch.setenv("PYTHONPATH", python_path)  # the kernel imports what the tests do
    monkeypatch.delenv("MPLBACKEND", raising=False)  # Jupyter's, which makes pictures

    notebook = read(path)
    kept = count_pictures(notebook)
    for cell in code_cells(notebook):
        cell.outputs = []
    notebook.cells.insert(0, nbformat.v4.new_code_cell(WARNINGS_ARE_ERRORS))
    client = NotebookClient(
        notebook,
        timeout=TIME_LIMIT,
        kernel_name="python3",
        resources={"metadata": {"path": str(tmp_path)}},
    )
    client.execute()
    check_outputs(notebook)
    drawn = count_pictures(notebook)
    assert drawn == kept or (shutil.which("dot") is None and 0 < drawn < kept)
    for file in tmp_path.iterdir():
        kept_file = FOLDER / file.name
        assert kept_file.is_file(), f"{file.name} is left behind"
        assert file.read_bytes() == kept_file.read_bytes(), f"{file.name} is not what it writes"
