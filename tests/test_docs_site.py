"""The site of the documentation: every page has its place, a kind and few words; what it shows is of today."""

import importlib
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
import yaml
from tests.pages import DOCS, PAGES, ROOT
from tools import gallery, site, site_versions

from fleet2d.viewing.tutorials import sources

KINDS = {"tutorials", "how-to", "reference", "explanation", "results"}
NOTEBOOKS = sorted((DOCS / "tutorials").glob("*.ipynb"))
MOST_WORDS = 40_000


class Loader(yaml.SafeLoader):
    """Reads the configuration of the site, whose tags are of no interest."""


def nav():
    """The pages that the navigation names."""
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    return list(leaves(yaml.load(text, Loader)["nav"]))


def leaves(entry) -> Iterator[str]:
    if isinstance(entry, str):
        yield entry
        return
    for inner in entry.values() if isinstance(entry, dict) else entry:
        yield from leaves(inner)


@cache
def written() -> dict[str, str | bytes]:
    """The pages that people wrote, and the files beside them."""
    return site.written_pages()


def words(text):
    """The words of prose and tables that people wrote: no code, no links, nothing that a tool made."""
    text = re.sub(r"^```.*?^```$|`[^`\n]*`", "", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"<!-- \w+: made by.*?<!-- end of \w+ -->", "", text, flags=re.DOTALL)
    text = re.sub(r"\]\([^)]*\)", "]", text)
    return len(re.findall(r"[^\s|]*[^\W\d_][^\s|]*", text))


def test_words_are_counted_without_code_links_and_tables_of_tools():
    made = "<!-- licences: made by x -->\n| a | b |\n<!-- end of licences -->"
    text = f"Two [words](of/a/page.md), not `code`.\n```sh\nrun it\n```\n{made}\n| 1 | 2.5 |\n"
    assert 3 == words(text)


def test_people_wrote_no_more_words_than_a_reader_has_patience_for():
    made = {page for page in PAGES if "Made by `python" in page.read_text(encoding="utf-8")[:200]}
    pages = [page.read_text(encoding="utf-8") for page in {*PAGES[1:]} - made]
    cells = [cell for path in NOTEBOOKS for cell in json.loads(path.read_text("utf-8"))["cells"]]
    pages += ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown"]
    assert MOST_WORDS >= sum(map(words, pages))


def test_each_page_is_of_one_kind_and_has_a_place_in_the_navigation():
    pages = {page.relative_to(DOCS) for page in [*PAGES[1:], *NOTEBOOKS]}
    assert {"index.md", "gallery.md"} == {str(page) for page in pages if page.parts[0] not in KINDS}
    named = {page.removesuffix(".md") for page in nav()}
    assert set() == {page.with_suffix("").as_posix() for page in pages} - named


def test_navigation_names_no_page_twice():
    assert len(nav()) == len(set(nav()))


@pytest.mark.slow
def test_navigation_names_each_page_that_is_written_or_made():
    pages = {**written(), **site.generated_pages()}
    assert all(pages.values())
    assert set(nav()) == {uri for uri in pages if uri.endswith(".md")}


def test_site_has_a_notebook_of_each_tutorial_and_of_each_guide_with_python():
    pages = written()
    notebooks = {Path(uri).stem: uri for uri in pages if uri.endswith(".ipynb")}
    assert set(sources()) == set(notebooks)
    assert 11 < len(notebooks)
    for name, uri in notebooks.items():
        page = pages[f"{uri.removesuffix('.ipynb')}.md"]
        assert f"]({name}.ipynb)" in str(page).splitlines()[2]


@pytest.mark.slow
@pytest.mark.parametrize("path", [pytest.param(p, id=p.stem) for p in NOTEBOOKS])
def test_a_tutorial_prints_and_draws_what_it_stores(path):
    if path.stem == "model":
        pytest.importorskip("torch", reason="needs the extra ml")
    command = [sys.executable, "-m", "tools.tutorials", path.stem, "--check"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=environment())
    assert (0, "") == (done.returncode, done.stdout.strip()), done.stderr[-2000:]


def environment():
    """Numbers as on any machine, and no terminal that would change the width of tables."""
    return {**os.environ, "COLUMNS": "80", "POLARS_FMT_MAX_COLS": "8"}


def test_each_tutorial_shows_a_picture_and_is_for_a_role():
    assert 4 == len(NOTEBOOKS)
    for path in NOTEBOOKS:
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        outputs = [output for cell in cells for output in cell.get("outputs", ())]
        assert any("image/png" in output.get("data", {}) for output in outputs), path.name
        assert "".join(cells[0]["source"]).splitlines()[2].startswith("You "), path.name


# The gallery


def test_gallery_has_at_least_twelve_homes_and_scenarios():
    assert 12 <= len(gallery.PIECES)
    assert all((gallery.IMAGES / f"{piece.name}.webp").is_file() for piece in gallery.PIECES)


def test_page_of_the_gallery_is_that_of_its_pieces():
    page = (DOCS / "gallery.md").read_text(encoding="utf-8")
    assert gallery.page() == page, "run python -m tools.gallery"


def test_first_page_and_gallery_lead_to_each_day_of_the_gallery_live():
    days = [f"live/{piece.name}.html" for piece in gallery.PIECES if piece.at is not None]
    pages = {uri: str(text) for uri, text in written().items()}
    assert ["month.html", *days] == re.findall(r'<option value="([^"]*)"', pages["index.md"])
    assert days == re.findall(r"\]\((live/.*?)\)", pages["gallery.md"])


@pytest.mark.slow
@pytest.mark.parametrize("piece", [pytest.param(p, id=p.name) for p in gallery.PIECES])
def test_a_picture_of_the_gallery_shows_the_home_or_run_of_today(piece):
    digests = json.loads(gallery.DIGESTS.read_text(encoding="utf-8"))
    digest = gallery.digest_of(gallery.open_piece(piece))
    assert digest == digests[piece.name], "run python -m tools.gallery"


@pytest.mark.slow
@pytest.mark.parametrize("name", gallery.FIGURES)
def test_a_figure_of_a_page_shows_the_run_of_today(name):
    digests = json.loads(gallery.DIGESTS.read_text(encoding="utf-8"))
    assert gallery.run_figure(name).digest == digests[name], "run python -m tools.gallery"


def test_every_picture_is_shown_by_a_page():
    shown = {name for page in PAGES for name in re.findall(r"images/([\w./]+)\)", page.read_text())}
    files = {path.relative_to(DOCS / "images") for path in (DOCS / "images").rglob("*.*")}
    assert set() == {path.as_posix() for path in files if path.suffix != ".json"} - shown


# Tools


def test_examples_of_docstrings_become_code():
    pytest.importorskip("griffe", reason="needs the extra docs")
    docstrings = importlib.import_module("tools.docstrings")
    text = "Add.\n\n    >>> 1 + 1\n    2\n\nArgs:\n    a: [b]."
    assert docstrings.fenced(text) == (
        "Add.\n\n    ```pycon\n    >>> 1 + 1\n    2\n    ```\n\nArgs:\n    a: [b]."
    )


def test_a_version_of_the_site_joins_the_others_and_the_root_leads_to_the_newest(tmp_path):
    own, sites = tmp_path / "site", tmp_path / "sites"
    for folder in (own, sites):
        folder.mkdir()
    (own / "index.html").write_text("a page", encoding="utf-8")
    for version, newest in (("dev", "dev"), ("0.9.0", "0.9.0"), ("0.10.0", "0.10.0")):
        site_versions.add(own, sites, version)
        assert f"url={newest}/" in (sites / "index.html").read_text(encoding="utf-8")
    listed = json.loads((sites / "versions.json").read_text(encoding="utf-8"))
    assert ["0.10.0", "0.9.0", "dev"] == [entry["version"] for entry in listed]
