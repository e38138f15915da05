"""Write the picture of the packages in CONTRIBUTING.md, from the contract that import-linter keeps.

python tools/package_map.py          # write
python tools/package_map.py --check  # say whether it is as it should be
"""

import argparse
import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "CONTRIBUTING.md"
TOP_OF_HEART = "__main__"
BEGIN, END = "<!-- packages: made by tools/package_map.py -->\n", "<!-- end of packages -->\n"


def main() -> int:
    """Write the picture, or compare it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true")
    text = PAGE.read_text(encoding="utf-8")
    page = with_map(text)
    if parser.parse_args().check:
        return int(page != text)
    PAGE.write_text(page, encoding="utf-8")
    return 0


def with_map(text: str) -> str:
    """Return a page with the picture as it should be."""
    head, rest = text.split(BEGIN)
    return f"{head}{BEGIN}{picture()}{END}{rest.split(END)[1]}"


def picture() -> str:
    """Return the layers of the contract from top to bottom, each package with what it is.

    Example:
        >>> picture().splitlines()[1]
        'LIMBS: each can be taken away'
    """
    lines = ["```", "LIMBS: each can be taken away"]
    for number, layer in enumerate(layers()):
        lines += ["  │"] if number else []
        lines += ["HEART: it imports no limb"] if layer == TOP_OF_HEART else []
        lines += [f"{name:<15} {summary(name)}" for name in packages_of(layer)]
    return "\n".join([*map(_shown, lines), "```"]) + "\n"


def limbs() -> list[str]:
    """Return the packages above the heart, in the order of the contract."""
    above = layers()[: layers().index(TOP_OF_HEART)]
    return [name for layer in above for name in packages_of(layer)]


def packages_of(layer: str) -> list[str]:
    """Return the packages that stand side by side in a layer."""
    return re.split(r" [|:] ", layer)


def _shown(line: str) -> str:
    name = line.split(" ")[0]
    is_package = name and (ROOT / "src" / "fleet2d" / name).is_dir()
    return f"{name + '/':<15}{line[15:]}" if is_package else line


def layers() -> list[str]:
    """Return the layers of `fleet2d`, as pyproject.toml has them."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    found = next(one for one in contracts if one.get("containers") == ["fleet2d"])
    names: list[str] = found["layers"]
    return names


def summary(name: str) -> str:
    """Return the first sentence of a package or module."""
    path = ROOT / "src" / "fleet2d" / name
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    docs = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return docs.splitlines()[0].rstrip(".")


def modules() -> Iterator[tuple[str, Path]]:
    """Yield each module of the package, with its file."""
    source = ROOT / "src"
    for file in sorted((source / "fleet2d").rglob("*.py")):
        parts = file.relative_to(source).with_suffix("").parts
        yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), file


if __name__ == "__main__":
    sys.exit(main())
