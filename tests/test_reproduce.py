"""The paper made again: registry, what is taken from an earlier run, report, command."""

from __future__ import annotations

import ast
import dataclasses
import html
import importlib
import importlib.util
import json
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor, ThreadPoolExecutor
from html.parser import HTMLParser
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from conftest import find_chromium
from fake_paper import FakeTable

from cdpr_drake.batch.store import fingerprint, name_of
from reproduction import reproduce as machinery
from reproduction import sources
from reproduction.__main__ import main
from reproduction.assumptions import printed
from reproduction.figure16 import section as figure16
from reproduction.figures import claims as figures_claims
from reproduction.figures import poses
from reproduction.figures import section as figures
from reproduction.null_models import chance_of_cables, chance_of_order, share, within
from reproduction.registry import reproductions
from reproduction.report.page import report_html
from reproduction.report.pictures import panel_svg, paper_figure
from reproduction.report.words import count_of_claims, in_words
from reproduction.reproduce import report_of, reproduce
from reproduction.section import Claim, Figure, Reproduction, kind_by
from reproduction.texts import contents, filled
from reproduction.traces import difference, rate, sizes

ROOT = Path(__file__).resolve().parents[1]
VOID = {"meta", "br", "hr", "img", "link", "input"}


@pytest.fixture
def threads() -> Iterator[Executor]:
    """Two threads."""
    with ThreadPoolExecutor(2) as executor:
        yield executor


@pytest.fixture
def fakes(tmp_path: Path) -> dict[str, Reproduction]:
    """Two tables that share a case."""
    log = tmp_path / "log"
    return {
        "one": FakeTable("one", [1.0, 2.0], log),
        "two": FakeTable("two", [2.0, 3.0], log),
    }


def made(
    wanted: Mapping[str, Reproduction], folder: Path, threads: Executor
) -> tuple[dict[str, Any], dict[str, tuple[Figure, ...]]]:
    """Return the report and the figures of what is wanted."""
    found, cpu_time = reproduce(wanted, folder, executor=threads)
    drawn = {part.name: part.section.figures for part in found if part.section is not None}
    return report_of(found, cpu_time), drawn


# --- the registry


def test_the_registry_has_the_papers_tables_and_figures() -> None:
    known = reproductions()
    assert [name for name in known if name.startswith("figure")] == [
        f"figure{n}" for n in (10, 11, 12, 13, 14, 15, 16)
    ]
    for name, part in known.items():
        assert part.name == name and re.fullmatch(r"[a-z]+(_[a-z]+|\d+)?", name)


@pytest.mark.parametrize("name", reproductions())
def test_cases_can_be_handed_to_other_processes_and_kept(name: str) -> None:
    cases = reproductions()[name].cases()
    keys = [case.key for case in cases]
    assert keys and len(set(keys)) == len(keys)
    assert all(re.fullmatch(r"[\w.+-]+", key) for key in keys)
    for case in cases:
        assert name_of(case.function).startswith("reproduction.")
        assert fingerprint(dict(case.arguments))
        json.dumps(dict(case.arguments))


# --- what it is made with

FOLDER = ROOT / "reproduction"


def not_offered(path: Path) -> list[str]:
    """Return what a file imports of the package and its own application that is not offered.

    A room offers what is in its `__all__`, a module of `model` and `errors` its public names.
    """
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [a.name for a in node.names if a.name.partition(".")[0] == "cdpr_drake"]
        if not isinstance(node, ast.ImportFrom):
            continue
        assert node.module and not node.level
        package, _, inner = node.module.partition(".")
        if package not in ("cdpr_drake", "reproduction"):
            continue
        names = {alias.name for alias in node.names}
        if package == "reproduction" or re.match(r"(model\.|errors$)", inner):
            wrong = {name for name in (*names, *inner.split(".")) if name.startswith("_")}
        elif "." in inner:
            wrong = names
        else:
            wrong = names - set(getattr(importlib.import_module(node.module), "__all__", ()))
        found += [f"{node.module}: {name}" for name in sorted(wrong)]
    return found


@pytest.mark.parametrize(
    "path", sorted(FOLDER.rglob("*.py")), ids=lambda path: str(path.relative_to(FOLDER))
)
def test_it_is_made_with_what_the_package_offers(path: Path) -> None:
    assert not_offered(path) == []


@pytest.mark.parametrize(
    ("line", "count"),
    [
        ("from cdpr_drake.runs.running import Setup", 1),
        ("from cdpr_drake.runs import Setup", 0),
        ("from cdpr_drake.runs import running", 1),
        ("from cdpr_drake.model.statics import wrench_matrix", 0),
        ("from cdpr_drake.model.statics import _wrench", 1),
        ("from cdpr_drake.model import statics", 1),
        ("from cdpr_drake import load_robot, __version__", 0),
        ("import cdpr_drake.runs.running", 1),
        ("from reproduction.sources import _tree", 1),
        ("def f():\n    from cdpr_drake.__main__ import main", 1),
    ],
)
def test_what_is_not_offered_is_found(line: str, count: int, tmp_path: Path) -> None:
    (tmp_path / "part.py").write_text(line)
    assert len(not_offered(tmp_path / "part.py")) == count


# --- the texts

WITH_TEXTS = [path.parent.name for path in sorted(FOLDER.glob("*/texts.yaml"))]


@pytest.mark.parametrize("folder", WITH_TEXTS)
def test_each_text_is_used(folder: str) -> None:
    content = contents(folder)
    code = [ast.parse(path.read_text("utf-8")) for path in (FOLDER / folder).glob("*.py")]
    named = {n.value for tree in code for n in ast.walk(tree) if isinstance(n, ast.Constant)}
    unused = [
        f"{kind}: {name}"
        for kind, texts in content.items()
        for name in texts
        if name not in named and name not in reproductions()
    ]
    assert unused == []


def test_every_folder_of_a_section_has_its_texts() -> None:
    titles = [name for folder in WITH_TEXTS for name in contents(folder)["sections"]]
    assert sorted(titles) == sorted(reproductions())


def test_places_are_filled() -> None:
    numbers = {
        "a": 1.234, "list": np.array([1.0, 2.0]), "by_name": {"ECM": 0.5, "": 2.0}, "empty": [],
        "share": 0.123,
    }  # fmt: skip
    templates = {
        "text": "{a:.1f} mm, {list:.0f}, {list[1]:g}; {by_name:.1f 1/s}; {empty}; {share:%.0f} %",
        "more": ["{a}", "none"],
    }
    assert filled(templates, numbers, "here") == {
        "text": "1.2 mm, 1, 2, 2; ECM 0.5 1/s, 2.0 1/s; none; 12 %",
        "more": ["1.234", "none"],
    }
    with pytest.raises(ValueError, match=r"here: nothing for \{b\}"):
        filled({"text": "{b:.1f}"}, numbers, "here")
    with pytest.raises(ValueError, match="here: no place for list"):
        filled({"text": "{a}"}, {"a": 1, "list": [1]}, "here")


# --- running


def test_equal_cases_of_two_sections_run_once(
    fakes: dict[str, Reproduction], threads: Executor, tmp_path: Path
) -> None:
    report, _ = made(fakes, tmp_path / "kept", threads)
    assert sorted((tmp_path / "log").read_text().split()) == ["1", "2", "3"]
    assert [section["name"] for section in report["sections"]] == ["one", "two"]
    assert [row[1:3] for row in report["sections"][1]["tables"][0]["rows"]] == [[2, 4], [3, 9]]
    assert report["sections"][1]["assumptions"] == [
        {"name": "modulus", "value": 60.0},
        {"name": "points", "value": [1.0, 2.0]},
    ]
    # Two tests are met at random by 0.5 each, one by 0.125, and so on: 1.2 of them, +- 0.8.
    assert count_of_claims(report) == (
        "2 of 4 tested claims agree; null models would meet 1.2 ± 0.8 of them, so this is no "
        "evidence for the model. 0 more claims follow fits or choices and 2 come out as they do "
        "by construction; these are not counted."
    )


def test_what_was_done_by_the_same_source_is_not_done_again(
    fakes: dict[str, Reproduction],
    threads: Executor,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log, folder = tmp_path / "log", tmp_path / "kept"
    made({"one": fakes["one"]}, folder, threads)
    assert sorted(log.read_text().split()) == ["1", "2"]
    made(fakes, folder, threads)
    assert sorted(log.read_text().split()) == ["1", "2", "3"]
    monkeypatch.setattr(machinery, "source_of", lambda function: "changed")
    made(fakes, folder, threads)
    assert sorted(log.read_text().split()) == ["1", "1", "2", "2", "3", "3"]


def test_a_source_changes_with_the_code_and_data_it_depends_on(tmp_path: Path) -> None:
    package = tmp_path / "reproduction"
    files = {
        "__init__.py": "",
        "runs.py": "from reproduction.model import robot\n"
        "def run(): return robot.mass, load('table4')\n",
        "model/__init__.py": "",
        "model/robot.py": "import numpy\nmass = 1\n",
        "model/other.py": "import reproduction.runs\nx = 1\n",
        "assumptions.yaml": "table4: {a: 1}\ntable5: {a: 1}\n",
        "robot.yaml": "mass: 1\n",
        "table4/texts.yaml": "words: {}\n",
    }
    changes = {
        "runs.py": files["runs.py"] + "y = 1\n",
        "model/__init__.py": "from reproduction.model import other\n",
        "model/robot.py": "import numpy\nmass = 2\n",
        "assumptions.yaml": "table4: {a: 2}\ntable5: {a: 1}\n",
        "robot.yaml": "mass: 2\n",
    }
    harmless = {
        "model/other.py": "x = 2\n",
        "model/robot.py": "import numpy  # a comment\n\nmass = 1\n",
        "assumptions.yaml": "table5: {a: 2}\ntable4: {a: 1}\n",
        "table4/texts.yaml": "claims: {}\n",
    }

    def source(number: int, changed: dict[str, str]) -> str:
        copy = package.parent / str(number) / "reproduction"
        for name, text in {**files, **changed}.items():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            (copy / name).write_text(text)
        return sources._source_of_module("reproduction.runs", copy.parent)

    first = source(0, {})
    number = 0
    for name, text in changes.items():
        number += 1
        assert source(number, {name: text}) != first, name
    for name, text in harmless.items():
        number += 1
        assert source(number, {name: text}) == first, name


def test_a_source_knows_all_that_comes_with_a_module() -> None:
    found = sources.imported_by("reproduction.traces")
    for name in ("runs.running", "model.kernels.catenary", "systems.servo", "analysis.stability"):
        assert f"cdpr_drake.{name}" in found
    assert "reproduction.figures" not in found
    assert not any(name.startswith("cdpr_drake.show") for name in found)
    code = (
        "import sys, reproduction.traces\n"
        "print(*(n for n in sys.modules if n.partition('.')[0] in ('cdpr_drake', 'reproduction')))"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert set(loaded.stdout.split()) <= found


def test_a_case_that_fails_costs_its_section_only(threads: Executor, tmp_path: Path) -> None:
    wanted = {"good": FakeTable("good", [1.0]), "bad": FakeTable("bad", [1.0, -1.0])}
    report, drawn = made(wanted, tmp_path, threads)
    good, bad = report["sections"]
    assert good["claims"] and not good["errors"]
    assert bad["errors"] == {"x1": ["ValueError", "-1 is negative"]} and not bad["claims"]
    page = report_html(report, drawn)
    assert "x1 failed: ValueError: -1 is negative" in page


# --- the report


class Page(HTMLParser):
    """What is in a page; fails on tags that do not match."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.counts: dict[str, int] = {}
        self.ids: list[str] = []
        self.links: list[str] = []
        self.text = ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note a tag and what it refers to."""
        self.counts[tag] = self.counts.get(tag, 0) + 1
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name == "id" and value:
                self.ids.append(value)
            if name in ("href", "src", "xlink:href", "srcset", "data", "action"):
                self.links.append(value or "")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note a tag that is closed at once."""
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        """Close a tag."""
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        """Note text."""
        self.text += data


@pytest.fixture
def page(fakes: dict[str, Reproduction], threads: Executor, tmp_path: Path) -> str:
    """A report of the two tables."""
    return report_html(*made(fakes, tmp_path / "kept", threads))


def test_the_page_needs_nothing_else(page: str) -> None:
    parsed = Page(page)
    assert all(link.startswith("#") for link in parsed.links)
    assert "link" not in parsed.counts and "script" not in parsed.counts
    addresses = set(re.findall(r"https?://[^\"' <]+", page))
    assert addresses <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert not re.search(r"@import|url\((?!#)", page)
    assert len(parsed.ids) == len(set(parsed.ids))
    assert {link[1:] for link in parsed.links} <= set(parsed.ids)


def test_the_page_has_all_claims_tables_and_figures(page: str) -> None:
    parsed = Page(page)
    text = " ".join(parsed.text.split())
    for part in (
        "2 of 4 tested claims agree; null", "Squares grow", "a <coin>: 50 % would agree",
        "free parameters: a modulus", "by construction", "1 < 4", "One is <b>exact</b>", "3.14",
        "2.72", "because of “rounding” & noise", "one: squares & <roots>", "A note.", "Made up.",
        "One paragraph with <angles> & an ampersand.", "x^2 [-]",
    ):  # fmt: skip
        assert part in text, part
    assert page.count('class="mark">agrees') == 4 and page.count('class="mark">differs') == 2
    assert parsed.counts["svg"] == 4 and parsed.counts["table"] == 4
    assert 'name="viewport"' in page and "prefers-color-scheme: dark" in page
    assert "nan" not in text.lower().split()


def test_the_same_results_give_the_same_page(
    fakes: dict[str, Reproduction], threads: Executor, tmp_path: Path, page: str
) -> None:
    again = report_html(*made(fakes, tmp_path / "kept", threads))
    assert again == page


@pytest.mark.render
@pytest.mark.needs("chromium")
def test_the_page_fits_a_phone(page: str, tmp_path: Path) -> None:
    outer = tmp_path / "outer.html"
    outer.write_text(
        f'<iframe id="f" width="390" height="800" srcdoc="{html.escape(page)}"></iframe>'
        '<p id="w"></p>'
        "<script>document.getElementById('f').onload = e => {"
        "const d = e.target.contentDocument.documentElement;"
        "const found = 'width ' + d.scrollWidth + ' of ' + d.clientWidth;"
        "document.getElementById('w').textContent = found};"
        "</script>",
        encoding="utf-8",
    )
    browser = find_chromium()
    assert browser is not None
    dump = subprocess.run(
        [
            browser, "--headless=new", "--no-sandbox", "--disable-gpu", "--dump-dom",
            "--host-resolver-rules=MAP * ~NOTFOUND", "--virtual-time-budget=3000",
            f"--user-data-dir={tmp_path / 'profile'}", outer.as_uri(),
        ],
        capture_output=True, text=True, timeout=120, check=True,
    ).stdout  # fmt: skip
    found = re.search(r">width (\d+) of (\d+)", dump)
    assert found is not None
    content, screen = map(int, found.groups())
    assert 300 < screen <= 390 and content <= screen


def test_numbers_in_words() -> None:
    cases = {
        31.6: "31.6", -31.62: "-31.6", 0.0123: "0.0123", 1234.5: "1234", 0.0: "0", 50.0: "50.0",
        4.35: "4.35", 0.08: "0.08", 1.0 / 3.0: "0.333", 120.0: "120", 1e-9: "1e-09", 7: "7",
        None: "", True: "yes", "a": "a",
    }  # fmt: skip
    for value, text in cases.items():
        assert in_words(value) == text
    assert in_words([1, 2.5]) == "1, 2.5" and in_words(float("nan")) == ""


def test_pictures_say_what_they_show(fakes: dict[str, Reproduction]) -> None:
    results = {f"x{i}": {"x": 1.0, "squares": np.ones(2)} for i in range(2)}
    (figure,) = fakes["one"].section(results).figures
    drawn = paper_figure(figure)
    cables, runs = drawn.axes
    assert cables.get_ylabel() == "tension [N]" and cables.get_xlabel() == "time [s]"
    assert [t.get_text() for t in cables.texts] == ["1", "2", "3"]
    legend = runs.get_legend()
    assert legend is not None and legend.get_texts()[0].get_text() == "$t_x$"
    text = panel_svg(figure.panels[0][0], "a")
    assert text.startswith("<svg") and text == panel_svg(figure.panels[0][0], "a")


# --- the paper's figures, from made-up runs


def test_figure_16_has_the_moves_of_four_models() -> None:
    time = np.linspace(0.0, 105.0, 421)
    error = np.exp(-0.06 * time)[:, None] * [20.0, 0.01, 0.05]
    turn = np.radians(np.exp(-0.06 * time)[:, None] * [0.3, 0.2, 0.1])

    def results(slsm: float) -> dict[str, Any]:
        move = {"time": time, "position_error": error, "velocity": -0.06 * error}
        found = {m: {**move, "orientation_error_seen": turn} for m in ("ECM", "CMWE", "SCMWE")}
        late = turn * np.where(time > 40.0, slsm, 1.0)[:, None]
        return {**found, "SLSM": {**move, "orientation_error_seen": late}}

    section = figure16.section(results(50.0))
    assert [claim.agrees for claim in section.claims] == [True, True]
    assert "ECM 0.30, CMWE 0.30, SCMWE 0.30, SLSM 4.47" in section.claims[0].ours
    assert [len(row) for row in section.figures[0].panels] == [3, 3, 3, 3]
    assert [claim.agrees for claim in figure16.section(results(1.0)).claims] == [False, True]


def decay(gain: float, tension: np.ndarray, noise: float = 0.0) -> dict[str, Any]:
    """Return a run whose error decays exponentially."""
    time = np.linspace(0.0, 6.0 / gain, 200)
    start = np.array([3000.0, -2000.0, 500.0, 5.0, -4.0, 1.0])
    error = np.exp(-gain * time)[:, None] * start
    error[:, :3] += noise
    ones = np.ones((200, 1))
    return {
        "time": time,
        "error": error,
        "tension": ones * tension,
        "dbeta": ones * 200.0 / tension,
        "velocity": -gain * error[:, :3],
        "gain": gain,
    }


def test_rates_and_differences_of_a_known_decay() -> None:
    result = decay(0.03, np.ones(8))
    assert rate(result) == pytest.approx(0.03, rel=1e-9)
    assert sizes(result)[0] == pytest.approx([np.sqrt(13.25e6), np.sqrt(42.0)])
    other = decay(0.03, np.ones(8), noise=10.0)
    assert difference(result, other) == pytest.approx(np.sqrt(300.0 / 13.25e6))


@pytest.mark.parametrize("part", figures.FIGURES, ids=lambda part: part.name)
def test_a_figure_is_made_of_its_runs(part: figures.PaperFigure) -> None:
    low, high = (np.array(t, float) for t in ([3, 3, 9, 9, 9, 9, 9, 9], [9, 9, 3, 3, 3, 3, 9, 9]))
    results = {
        case.key: decay(0.1, 100.0 * (high if case.arguments["number"] == 2 else low))
        for case in part.cases()
    }
    section = part.section(results)
    assert section.name == part.name and section.claims and len(section.figures) == 1
    verdicts = {claim.text: claim.agrees for claim in section.claims}
    for text, agrees in verdicts.items():
        if "exponentially" in text or "least tensed" in text or "most tensed" in text:
            assert agrees, text
        if "moves by" in text:
            assert agrees, text
        if "larger in the experiments" in text:
            assert not agrees, text
    tensions = [p for row in section.figures[0].panels for p in row if "tension" in p.y_label]
    assert all(len(panel.lines) == 8 for panel in tensions)
    slow = {key: {**result, "gain": 0.2} for key, result in results.items()}
    again = {claim.text: claim.agrees for claim in part.section(slow).claims}
    assert not any(agrees for text, agrees in again.items() if "exponentially" in text)


def test_what_holds_at_any_pose_of_the_tests_is_no_test() -> None:
    assert poses.share_of_rates(figures_claims.RATE_TOLERANCE) == 1.0
    assert poses.share_less_tensed() == 1.0
    assert poses.share_of_sag(*figures_claims.SMALL) == 1.0
    assert 0.0 < poses.share_of_sag(0.0, 0.5) < 1.0  # it could come out otherwise
    assert poses.share_of_rates(1e-4) == 0.0


def test_an_amplitude_that_is_not_the_printed_one_differs(monkeypatch: pytest.MonkeyPatch) -> None:
    part = figures.FIGURES[0]
    results = {part.cases()[0].key: decay(0.03, np.ones(8))}
    claim = part.section(results).claims[0]
    assert claim.agrees and claim.printed == "4.35 m, 8.0°" and claim.ours.startswith("4.35 m, 8.")
    entry = printed("figures")["amplitude_1"]
    others = {**printed("figures"), "amplitude_1": dataclasses.replace(entry, value=[4.37, 8.0])}
    monkeypatch.setattr(figures_claims, "printed", lambda section: others)
    assert not part.section(results).claims[0].agrees


# --- the command


@pytest.fixture
def screen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A screen of 80 columns and an empty working directory."""
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("screen")
def test_the_command_writes_a_report_and_tells_what_it_found(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    fakes = {"one": FakeTable("one", [1.0, 2.0]), "two": FakeTable("two", [-2.0])}
    monkeypatch.setattr("reproduction.registry.reproductions", lambda: fakes)
    assert main(["--only", "one", "--jobs", "1"]) == 0
    out, err = capfd.readouterr()
    assert "2 of 2 cases, in " in err
    lines = out.splitlines()
    assert max(map(len, lines)) <= 80
    assert "  agrees  squares grow" in lines
    assert "  differs  one is <b>exact</b>" in lines
    assert "          paper: 3.14; here: 2.72" in lines
    assert "          tested; a <coin>: 50 % would agree" in lines
    assert any(line.startswith("1 of 2 tested claims agree; null") for line in lines)
    assert lines[-1] == "In out/reproduction: report.html, report.json, one.png"
    folder = tmp_path / "out" / "reproduction"
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert [section["name"] for section in report["sections"]] == ["one"]
    assert (folder / "one.png").read_bytes().startswith(b"\x89PNG")

    assert main(["--json", "--jobs", "1"]) == 1  # the second has a case that fails
    out, err = capfd.readouterr()
    assert "3 of 3 cases, 2 of them earlier, in " in err
    assert [section["name"] for section in json.loads(out)["sections"]] == ["one", "two"]
    Page((folder / "report.html").read_text(encoding="utf-8"))


@pytest.mark.usefixtures("screen")
def test_an_interrupted_command_says_how_to_go_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*args: Any, progress: Any, **settings: Any) -> None:
        progress(1, 2)
        raise KeyboardInterrupt

    monkeypatch.setattr(machinery, "reproduce", interrupted)
    assert main([]) == 130
    err = capsys.readouterr().err
    assert "1 of 2 cases" in err and "the same command goes on" in err


@pytest.mark.usefixtures("screen")
@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["--only", "table99"], r'--only: no "table99"; there are .*figure10.*figure16'),
        (["--jobs", "0"], r"--jobs: '0' is no number of processes"),
        (["--jobs", "two"], r"--jobs: 'two' is no number of processes"),
        (["--output", "file"], r"--output file: "),
    ],
)
def test_bad_input_costs_one_line(
    argv: list[str], message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    assert main(argv) == 2
    out, err = capsys.readouterr()
    assert out == "" and len(err.splitlines()) == 1 and re.search(message, err)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


# --- the pages made from a report


@pytest.fixture(scope="module")
def pages() -> ModuleType:
    """The script that fills README and docs."""
    spec = importlib.util.spec_from_file_location("pages", ROOT / "docs" / "make_reproduction.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_readme_and_docs_say_what_the_kept_report_says(pages: ModuleType) -> None:
    report = json.loads(pages.REPORT.read_text(encoding="utf-8"))
    assert [section["name"] for section in report["sections"]] == list(reproductions())
    assert not any(section["errors"] for section in report["sections"])
    for page in pages.PAGES:
        text = page.read_text(encoding="utf-8")
        assert pages.MARK.search(text), f"{page.name} has no marks"
        assert pages.filled(text, report) == text, f"{page.name}: run docs/make_reproduction.py"
        for picture in re.findall(r"\]\((images/[^)]+)\)", text):
            assert (pages.DOCS / picture).is_file(), picture


def test_every_published_claim_states_what_could_have_come_out_otherwise(pages: ModuleType) -> None:
    report = json.loads(pages.REPORT.read_text(encoding="utf-8"))
    claims = [claim for section in report["sections"] for claim in section["claims"]]
    assert claims
    for claim in claims:
        Claim(**claim)  # refuses what is tested without the rate of a null model
    counted = [claim for claim in claims if claim["kind"] == "tested"]
    agree = sum(claim["agrees"] for claim in counted)
    headline = f"{agree} of {len(counted)} tested claims agree"
    assert count_of_claims(report).startswith(headline)
    assert headline in (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"kind": "tested"}, "no rate"),
        ({"kind": "tested", "null_rate": 0.96}, "null rate of 0.96"),
        ({"kind": "tested", "null_rate": float("nan")}, "null rate of nan"),
        ({"kind": "fitted"}, "no rate"),
        ({"kind": "fitted", "null_rate": 1.1}, "null rate of 1.1"),
        ({"kind": "by construction", "null": ""}, "otherwise is not said"),
        ({"kind": "believed", "null_rate": 0.1}, "unknown kind"),
    ],
)
def test_a_claim_without_its_null_model_is_refused(fields: dict[str, Any], message: str) -> None:
    claim = {"text": "t", "printed": "1", "ours": "1", "agrees": True, "null": "another"}
    with pytest.raises(ValueError, match=message):
        Claim(**{**claim, **fields})


def test_what_chance_would_meet() -> None:
    assert chance_of_order(3) == 1.0 / 6.0
    assert chance_of_cables([1, 2]) == 1.0 / 4.0 and chance_of_cables([1, 2, 7, 8]) == 1.0 / 6.0
    assert chance_of_cables([2, 3]) == 1.0 / 28.0
    assert share([True, False, False, False]) == 0.25
    assert within(1.0, 2.0, 2.0) and within(4.0, 2.0, 2.0) and not within(0.9, 2.0, 2.0)
    assert not within(-2.0, 2.0, 2.0) and not within(float("nan"), 2.0, 2.0)
    assert kind_by(0.95) == "tested" and kind_by(0.96) == "by construction"


def test_every_section_of_the_report_is_in_the_docs(pages: ModuleType) -> None:
    text = (pages.DOCS / "reproduction.md").read_text(encoding="utf-8")
    assert set(reproductions()) <= {mark[1] for mark in pages.MARK.findall(text)}


def test_pages_are_filled_between_their_marks_only(
    pages: ModuleType, fakes: dict[str, Reproduction], threads: Executor, tmp_path: Path
) -> None:
    report, _ = made(fakes, tmp_path / "kept", threads)
    page = (
        "A\n<!-- begin summary -->\nold\n<!-- end summary -->\nB\n"
        "<!-- begin two -->\n<!-- end two -->\n"
    )
    text = pages.filled(page, report)
    assert text.startswith("A\n<!-- begin summary -->\n2 of 4 tested claims agree")
    assert "\nold\n" not in text and "\n<!-- end summary -->\nB\n" in text
    assert r"| one | one is \<b\>exact\</b\> | 3.14 | 2.72 | differs | 12 % |" in text
    summary, _, section = text.partition("<!-- end summary -->")
    assert "one is one" not in summary  # only what is tested is in the table of the README
    assert "| one is one | 1 | 1 | agrees | by construction | nothing |  | none |" in section
    assert "| 0 | 2.0 | 4.0 |  |  |" in text and "![Lines](images/two.png)" in text
    assert pages.filled(text, report) == text
    with pytest.raises(KeyError, match="nobody"):
        pages.filled("<!-- begin nobody -->\n<!-- end nobody -->\n", report)
    with pytest.raises(ValueError, match="no end"):
        pages.filled("<!-- begin two -->\n<!-- end one -->\n", report)
