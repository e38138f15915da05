"""The page's types and its bundle are those of the sources."""

import gzip
import hashlib
from pathlib import Path

import pytest
from tools.contract_types import contract_source

from fleet2d.viewing.page_server import PAGE

SOURCES = Path(__file__).parents[2] / "page"
FILES = ("index.html", "package.json", "package-lock.json", "tsconfig.json", "vite.config.ts")

pytestmark = pytest.mark.skipif(not SOURCES.exists(), reason="the page's sources are not here")


def test_types_of_the_page_are_written_from_those_of_python():
    assert contract_source() == (SOURCES / "src" / "contract.ts").read_text(encoding="utf-8")


def test_bundle_is_small():
    content = b"".join((PAGE / name).read_bytes() for name in ("page.js", "page.css"))
    assert len(gzip.compress(content)) < 150_000


def test_bundle_was_built_from_these_sources():
    inside = [path.relative_to(SOURCES).as_posix() for path in (SOURCES / "src").rglob("*")]
    names = [*FILES, *(name for name in inside if (SOURCES / name).is_file())]
    content = hashlib.sha256()
    for name in sorted(names):
        content.update(f"{name}\n".encode())
        content.update((SOURCES / name).read_bytes())
    stamp = (PAGE / "sources.sha256").read_text(encoding="utf-8").strip()
    assert content.hexdigest() == stamp, "run `npm run build` in page/"
