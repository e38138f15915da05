"""The tutorials and guides of the documentation as notebooks, also without the repository."""

import json
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from fleet2d.configuration.problems import check_known
from fleet2d.errors import InputError, os_errors_as
from fleet2d.inputs import PACKAGE
from fleet2d.storage.files import write_atomically

FENCE = re.compile(r"^```(\w+)(?: title=(\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"!?\[([^\]]*)\]\((?!https?:)[^)]*\)")
JUPYTER = ("jupyterlab", "notebook")
NOT_RUN: dict[str, Any] = {"execution_count": None, "outputs": []}


def sources() -> dict[str, Path]:
    """Return the notebooks of tutorials and the pages of guides with Python, by name."""
    clone = PACKAGE.parents[1] / "docs"
    folder = clone if (clone / "tutorials").is_dir() else PACKAGE / "docs"
    guides = [
        page
        for page in sorted((folder / "how-to").glob("*.md"))
        if "\n```python\n" in page.read_text("utf-8")
    ]
    return {path.stem: path for path in (*sorted((folder / "tutorials").glob("*.ipynb")), *guides)}


def write_notebook(name: str) -> Path:
    """Write a tutorial or a guide as a notebook, unless it is there already.

    The notebook gets a folder, as its cells write files: two may have files of the same name.

    Raises:
        InputError: There is no such tutorial or guide, or the file can't be written.
    """
    known = sources()
    check_known(name, "tutorial", known, InputError)
    path = Path(name, f"{name}.ipynb")
    if not path.exists():
        with os_errors_as(InputError, f"{path} can't be written"):
            path.parent.mkdir(exist_ok=True)
            write_atomically(path, json.dumps(notebook(known[name]), indent=1).encode())
    return path


def notebook(source: Path) -> dict[str, Any]:
    """Return a tutorial or a guide as a notebook, without links to other pages."""
    text = source.read_text("utf-8")
    found: dict[str, Any] = json.loads(text) if source.suffix == ".ipynb" else notebook_of(text)
    for cell in found["cells"]:
        if cell["cell_type"] == "markdown":
            cell["source"] = LINK.sub(r"\1", "".join(cell["source"]))
    return found


def title(source: Path) -> str:
    """Return the heading of a tutorial or a guide."""
    text: str = notebook(source)["cells"][0]["source"]
    return text.partition("\n")[0].strip("# ")


def notebook_of(page: str) -> dict[str, Any]:
    r"""Return a page in Markdown as a notebook: its Python runs, its files are written.

    >>> page = "Store it:\n```yaml title=a.yaml\nseed: 1\n```\n"
    >>> [cell["source"] for cell in notebook_of(page)["cells"]]
    ['Store it:', '%%writefile a.yaml\nseed: 1']
    """
    cells = []
    end = 0
    for fence in FENCE.finditer(page):
        language, file, code = fence.groups()
        if file or language == "python":
            cells.append(_cell("markdown", page[end : fence.start()]))
            cells.append(_cell("code", f"%%writefile {file}\n{code}" if file else code, **NOT_RUN))
            end = fence.end()
    cells.append(_cell("markdown", page[end:]))
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return {
        "cells": [cell for cell in cells if cell["source"]],
        "metadata": {"kernelspec": kernel},
        "nbformat": 4,
        "nbformat_minor": 4,
    }


def _cell(kind: str, source: str, **more: Any) -> dict[str, Any]:
    """Return a cell of a notebook."""
    return {"cell_type": kind, "metadata": {}, "source": source.strip("\n"), **more}


def open_in_jupyter(path: Path) -> bool:
    """Open a notebook in Jupyter, and wait until it is shut down; return whether all went well."""
    program = next((module for module in JUPYTER if find_spec(module)), None)
    if program is None:
        return False
    command = [sys.executable, "-m", program, str(path)]
    done = subprocess.run(command, check=False)  # noqa: S603 - it is Python, and a file of ours
    return done.returncode == 0
