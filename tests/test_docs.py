"""README and docs say what is true: code runs, scenarios and commands are valid, links lead on."""

import re
import shlex
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest
import typer
from tests.pages import PAGES, ROOT, text_of
from tests.pages import page as page_of
from typer.testing import CliRunner

from fleet2d.cli.__main__ import app
from fleet2d.engine.simulation import Simulation
from fleet2d.scenario.load import load_scenario
from fleet2d.viewing.tutorials import notebook_of

FENCE = re.compile(r"^```(\w+)(?: title=(\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
OWN_PAGE = re.compile(r"(?<![\w/])docs/[a-z_/-]+\.md")
TEXTS = [
    pytest.param(page, id=str(page.relative_to(ROOT)))
    for page in sorted({*PAGES, *ROOT.glob("*.md")})
]
"""README, docs, and the other texts of the repository."""


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    page: Path
    line: int
    language: str
    title: str | None
    text: str

    @property
    def where(self):
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def blocks(page: Path, language: str | None = None) -> list[Block]:
    text = page.read_text(encoding="utf-8")
    found = [
        Block(page, text.count("\n", 0, match.start()) + 1, *match.groups())
        for match in FENCE.finditer(text)
    ]
    return [block for block in found if language in (None, block.language)]


def pages_with(language) -> list[object]:
    pages = [page for page in PAGES if blocks(page, language)]
    return [pytest.param(page, id=str(page.relative_to(ROOT))) for page in pages]


def scenarios() -> list[object]:
    found = [block for page in PAGES for block in blocks(page, "yaml")]
    whole = [
        block
        for block in found
        if re.search(r"^(simulation:|extends: \w+\.yaml)", block.text, re.MULTILINE)
    ]
    return [pytest.param(block, id=block.where) for block in whole]


def commands() -> list[object]:
    found = []
    for block in (block for page in PAGES for block in blocks(page, "sh")):
        text = block.text.replace("\\\n", " ")  # a command may go on in the next line
        lines = (words for line in text.splitlines() for words in split_commands(line))
        ours = [words[1:] for words in lines if Path(words[0]).name == "fleet2d"]
        found += [pytest.param(words, id=f"{block.where} {' '.join(words)}") for words in ours]
    return found


def split_commands(line) -> list[list[str]]:
    """Split a shell line at `&&` into the words of each command, without what follows a `>`."""
    parts = [[]]
    for word in shlex.split(line.partition(" > ")[0], comments=True):
        if word == "&&":
            parts.append([])
        else:
            parts[-1].append(word)
    return [part for part in parts if part]


def write_titled_blocks(page: Path, folder: Path):
    for block in blocks(page):
        if block.title:
            (folder / block.title).write_text(block.text, encoding="utf-8")


def run_notebook(page: Path):
    """Run the cells that a page has as a notebook, in order, in the present folder."""
    names = {"__name__": "docs"}
    for number, cell in enumerate(notebook_of(page.read_text(encoding="utf-8"))["cells"]):
        first, _, rest = cell["source"].partition("\n")
        if first.startswith("%%writefile "):
            Path(first.split()[1]).write_text(rest, encoding="utf-8")
        elif cell["cell_type"] == "code":
            if "fleet2d.learning.datasets.training" in cell["source"]:
                pytest.importorskip("torch", reason="needs the extra ml")
            exec(compile(cell["source"], f"{page}, cell {number}", "exec"), names)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("page", pages_with("python"))
def test_python_of_a_page_runs_in_an_empty_folder(page, folder, monkeypatch):
    if page.stem == "gym":
        pytest.importorskip("gymnasium", reason="needs the extra gym")
        pytest.importorskip("pettingzoo", reason="needs the extra gym")
    monkeypatch.syspath_prepend(folder)  # as Python's prompt has its folder
    run_notebook(page)
    for block in blocks(page):
        sys.modules.pop(Path(block.title or "").stem, None)  # another page may have one, too


@pytest.mark.slow
@pytest.mark.parametrize("block", scenarios())
def test_scenario_of_a_page_can_be_simulated(block, folder):
    write_titled_blocks(block.page, folder)
    if block.page.name == "floorplans.md":
        run_notebook(block.page)  # writes the plan that the scenario names
    file = folder / "scenario.yaml"
    file.write_text(block.text, encoding="utf-8")
    simulation = Simulation(file)
    simulation.advance(60)
    assert 60 == simulation.step


@pytest.mark.parametrize("words", commands())
def test_command_of_a_page_exists_with_its_options(words):
    group = typer.main.get_command(app)
    command = group.get_command(typer.Context(group), words[0])  # of entry points, too
    assert command is not None
    assert command.make_context(words[0], words[1:]) is not None
    overrides = [word for word in words[1:] if "=" in word and not word.startswith("floorplan.")]
    if words[0] == "run":  # what a page changes in its home.yaml, the paper's scenario has, too
        has_file = any(word.endswith(".yaml") and "=" not in word for word in words)
        bundled = [word for word in words if word.startswith("bundled:")]
        scenario = "bundled:paper" if has_file else next(iter(bundled), None)
        assert load_scenario(scenario, *overrides) is not None


def test_pages_that_files_name_exist():
    """Pages were moved into folders, and eight files still named them by their old paths."""
    names = ("src", "tests", "docs", "examples", "tools", "benchmarks")
    files = [file for name in names for file in (ROOT / name).rglob("*.*")]
    read = [file for file in files if file.suffix in (".py", ".md", ".yaml", ".toml")]
    named = {name for file in read for name in OWN_PAGE.findall(file.read_text(encoding="utf-8"))}

    assert {"docs/design.md"} == {
        name for name in named if not (ROOT / name).exists()
    }  # of Zenoh's


@pytest.mark.parametrize("page", TEXTS)
def test_links_of_a_page_lead_somewhere(page):
    links = LINK.findall(page.read_text(encoding="utf-8"))
    local = [link for link in links if not link.startswith(("http:", "https:"))]
    assert [] == [link for link in local if not (page.parent / link).exists()]


@pytest.mark.parametrize("page", TEXTS)
def test_anchors_of_a_page_are_headings(page):
    links = re.findall(r"\]\(([^)#\s]*\.md)?#([^)\s]+)\)", page.read_text(encoding="utf-8"))
    wrong = [
        (name, anchor)
        for name, anchor in links
        if anchor not in anchors(page.parent / name if name else page)
    ]
    assert [] == wrong


@cache
def anchors(page: Path):
    """The anchors of a page's headings, as GitHub and the site make them."""
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    plain = [re.sub(r"[`*]|\]\([^)]*\)|\[", "", heading) for heading in headings]
    return {re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-") for title in plain}


def test_who_does_better_than_the_last_sighting_is_as_the_paper_page_says():
    """Up to a quarter of an hour nobody by more than 0.03, of people simulated or real."""
    text = text_of("paper")
    tables = [part.split("\n\n")[0] for part in re.split(r"(?=\| learned \| 0\.9)", text)[1:]]
    assert 2 == len(tables)
    for table in tables:
        rows = {row.split("|")[1].strip(): row.split("|")[2:5] for row in table.splitlines()}
        naive = [float(cell) for cell in rows.pop("naive")]
        best = [max(float(row[i]) for row in rows.values()) for i in range(3)]
        assert best[0] <= naive[0]
        assert all(0 <= round(best[i] - naive[i], 2) <= 0.03 for i in (1, 2))


# They need files of the user, a browser, a minute, or a month.
NOT_RUN = {"view", "fit", "convert"}


@pytest.mark.slow
def test_commands_of_the_command_line_page_run_in_its_folder(folder):
    """All that need nothing but the page's own file, in order, at a day instead of sixty."""
    commands = page_of("cli")
    write_titled_blocks(commands, folder)
    lines = [line for block in blocks(commands, "sh") for line in block.text.splitlines()]
    ran = 0
    for words in (words[1:] for line in lines for words in split_commands(line)):
        if words[0] in NOT_RUN or (words[0] == "run" and "home.yaml" not in words):
            continue
        words = [word.replace("days=60", "days=1") for word in words]
        result = CliRunner().invoke(app, words)
        assert result.exception is None, (words, result.exception)
        assert 0 == result.exit_code, (words, result.output)
        ran += 1
    assert ran >= 12
