"""Runs the notebooks of the tutorials, and stores what their cells print and draw.

python -m tools.tutorials           # all of docs/tutorials; needs the extras `viz` and `study`
python -m tools.tutorials algorithm --check    # says whether a notebook prints what it did
"""

import argparse
import base64
import io
import json
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from IPython.core.displayhook import DisplayHook
from IPython.core.interactiveshell import InteractiveShell
from IPython.utils.capture import capture_output

os.environ["MPLBACKEND"] = "agg"  # no windows
NOTEBOOKS = Path(__file__).parents[1] / "docs" / "tutorials"
MOST_TEXT = 4_000  # characters of an output
FORMATS = ("image/png", "text/plain")


class Shown(DisplayHook):
    """Keeps what a cell's last expression shows, and prints nothing."""

    kept: list[dict[str, Any]] = []
    source = ""

    def quiet(self) -> bool:
        """Return whether the cell ends in a semicolon, which shows nothing."""
        return bool(self.semicolon_at_end_of_expression(self.source))

    def write_output_prompt(self) -> None:
        """Print no prompt."""

    def write_format_data(self, format_dict: Any, md_dict: Any = None) -> None:
        """Keep the value in all formats that it has."""
        self.kept.append(format_dict)

    def finish_displayhook(self) -> None:
        """Print no end of line."""


def main() -> int:
    """Run notebooks, and store or compare their outputs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="notebooks, without the suffix; default: all")
    parser.add_argument("--check", action="store_true")
    arguments = parser.parse_args()
    paths = [NOTEBOOKS / f"{name}.ipynb" for name in arguments.names]
    differ = []
    shell = InteractiveShell.instance(displayhook_class=Shown)
    for path in paths or sorted(NOTEBOOKS.glob("*.ipynb")):
        notebook = json.loads(path.read_text(encoding="utf-8"))
        before = texts_of(notebook)
        run(notebook, shell)
        if arguments.check:
            differ += differences(path, before, texts_of(notebook))
        else:
            path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", "utf-8")
    if differ:
        print("\n".join(differ))
    return bool(differ)


def run(notebook: dict[str, Any], shell: InteractiveShell) -> None:
    """Run the cells of a notebook in an empty folder, and put their outputs into it."""
    before = Path.cwd()
    shell.reset()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        sys.path.insert(0, folder)
        try:
            for cell in notebook["cells"]:
                if cell["cell_type"] == "code":
                    cell["outputs"] = outputs_of("".join(cell["source"]), shell)
        finally:
            sys.path.remove(folder)
            os.chdir(before)


def outputs_of(source: str, shell: InteractiveShell) -> list[dict[str, Any]]:
    """Return the outputs of a cell, as notebooks store them; an error ends the program."""
    Shown.kept.clear()
    Shown.source = source
    with capture_output() as captured:
        result = shell.run_cell(source)
    result.raise_error()
    outputs: list[dict[str, Any]] = []
    if captured.stdout:
        text = lines_of(captured.stdout[:MOST_TEXT])
        outputs.append({"output_type": "stream", "name": "stdout", "text": text})
    for shown in (*(output.data for output in captured.outputs), *Shown.kept, *open_figures()):
        data = {kind: stored(shown[kind]) for kind in FORMATS if kind in shown}
        outputs.append({"output_type": "display_data", "metadata": {}, "data": data})
    return outputs


def open_figures() -> Iterator[dict[str, Any]]:
    """Yield the figures that a cell left open, and close them, as notebooks show them."""
    if (pyplot := sys.modules.get("matplotlib.pyplot")) is not None:
        for number in pyplot.get_fignums():
            picture = io.BytesIO()
            pyplot.figure(number).savefig(picture, format="png", metadata={"Software": None})
            pyplot.close(number)
            yield {"image/png": picture.getvalue(), "text/plain": "a figure"}


def stored(value: Any) -> str | list[str]:
    """Return an output as JSON has it: pictures in base64, texts by lines."""
    if isinstance(value, bytes):
        return base64.b64encode(value).decode()
    return value if value.startswith("iVBOR") else lines_of(value[:MOST_TEXT])


def lines_of(text: str) -> list[str]:
    """Return the lines of a text, each with its end."""
    return text.splitlines(keepends=True)


def texts_of(notebook: dict[str, Any]) -> list[str]:
    """Return the text of all outputs of each cell of code."""
    return [
        "".join(text for output in cell["outputs"] for text in text_of(output))
        for cell in notebook["cells"]
        if cell["cell_type"] == "code"
    ]


def text_of(output: dict[str, Any]) -> list[str]:
    """Return the lines of an output; a picture is that there is one."""
    data = output.get("data", {"text/plain": output.get("text")})
    return ["a picture\n"] if "image/png" in data else data["text/plain"]


def differences(path: Path, before: list[str], after: list[str]) -> list[str]:
    """Return the cells that print something else than before."""
    pairs = enumerate(zip(before, after, strict=True))
    return [
        f"{path.name}, cell {number}: stored\n{old}\nnow\n{new}"
        for number, (old, new) in pairs
        if old != new
    ]


if __name__ == "__main__":
    sys.exit(main())
