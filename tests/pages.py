"""The pages of the documentation, by their names."""

from pathlib import Path

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]


def page(name: str) -> Path:
    """Return the page of a name, in whichever folder it stands; names are unique."""
    (found,) = [page for page in PAGES if page.stem == name]
    return found


def text_of(name: str) -> str:
    """Return the text of the page of a name."""
    return page(name).read_text(encoding="utf-8")
