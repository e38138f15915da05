"""The files that a user's own module imports, read from its text: nothing is run."""

import ast
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path

from fleet2d.bounds import FILE_BYTES, read_bytes
from fleet2d.errors import InputError


def with_imports(files: Iterable[Path], folder: Path) -> list[Path]:
    """Return files of modules, and the files in their folder that they import, each once.

    An import by a computed name is not found, and neither is one by other code than the modules.

    Args:
        files: The files of the modules.
        folder: The folder in which imports are searched first.

    Example:
        >>> import tempfile
        >>> folder = Path(tempfile.mkdtemp())
        >>> _ = (folder / "mine.py").write_text("import numpy, helpers")
        >>> _ = (folder / "helpers.py").write_text("SPEED = 1")
        >>> [path.name for path in with_imports([folder / "mine.py"], folder)]
        ['mine.py', 'helpers.py']
    """
    known = dict.fromkeys(files)
    queue = list(known)
    while queue:
        new = dict.fromkeys(_imports_of(queue.pop(), folder)).keys() - known.keys()
        known |= dict.fromkeys(sorted(new))
        queue += sorted(new)
    return list(known)


def _imports_of(file: Path, folder: Path) -> Iterator[Path]:
    """Yield the existing files of the modules that a module may import."""
    for node in _nodes_of(file):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield from _files_of(folder, alias.name.split("."))
        elif isinstance(node, ast.ImportFrom):
            start = file.parents[node.level - 1] if 0 < node.level <= len(file.parents) else folder
            module = node.module.split(".") if node.module else []
            for alias in node.names:
                yield from _files_of(start, [*module, alias.name])


def _nodes_of(file: Path) -> Iterator[ast.AST]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # they are about the user's text
            tree = ast.parse(read_bytes(file, FILE_BYTES))
    except (SyntaxError, ValueError, RecursionError, MemoryError, OSError, InputError):
        return  # it can't be imported either
    yield from ast.walk(tree)


def _files_of(folder: Path, parts: list[str]) -> Iterator[Path]:
    """Yield the files of a module and of its packages, as far as they exist."""
    for part in parts:
        folder = folder / part
        yield from filter(Path.is_file, (folder / "__init__.py", folder.with_name(f"{part}.py")))
