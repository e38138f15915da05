"""The files of users' own components: where a class is, and what its module imports.

Modules are parsed, and never run.
"""

import ast
import hashlib
import warnings
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path

from fleet2d.bounds import FILE_BYTES, read_bytes
from fleet2d.errors import InputError

PREFIX = "fleet2d_scenario_"


def is_class_path(text: str) -> bool:
    """Whether a text has the form of a path of a user's own component: 'folder/module:Class'."""
    _, module, qualname = parts_of(text)
    return all(part.isidentifier() for part in (*module.split("."), *qualname.split(".")))


def parts_of(path: str) -> tuple[str, str, str]:
    """Return the folder, the module and the class of a path of a component.

    Example:
        >>> parts_of("home/mine.py:Share")
        ('home/', 'mine', 'Share')
    """
    file, _, qualname = path.rpartition(":")
    folder, slash, module = file.removesuffix(".py").rpartition("/")
    return folder + slash, module, qualname


def package_of(folder: Path) -> str:
    """Return the name of the package into which the modules of a scenario's folder are imported."""
    return f"{PREFIX}{hashlib.sha256(str(folder).encode()).hexdigest()[:16]}"


def source_of(folder: Path, name: str) -> Path | None:
    """Return the source file of a module in a folder, None if there is none."""
    path = folder.joinpath(*name.split("."))
    candidates = (path / "__init__.py", path.with_suffix(".py"))
    return next(filter(Path.is_file, candidates), None)


def files_of(folder: Path, parts: Sequence[str]) -> Iterator[Path]:
    """Yield the files of a module and of its packages, as far as they exist."""
    for part in parts:
        folder = folder / part
        yield from filter(Path.is_file, (folder / "__init__.py", folder.with_name(f"{part}.py")))


def with_imports(files: Iterable[Path], folder: Path) -> list[Path]:
    """Return files of modules, and the files in their folder that they import, each once.

    An import by a computed name is not found.

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
        imported = dict.fromkeys(_imports_of(queue.pop(), folder))
        new = sorted(imported.keys() - known.keys())
        known |= dict.fromkeys(new)
        queue += new
    return list(known)


def _imports_of(file: Path, folder: Path) -> Iterator[Path]:
    """Yield the existing files of the modules that a module may import."""
    try:
        imports = _imports_in(read_bytes(file, FILE_BYTES))
    except (OSError, InputError):
        return  # a file with wrong syntax can't be imported either
    for level, parts in imports:
        start = file.parents[level - 1] if 0 < level <= len(file.parents) else folder
        yield from files_of(start, parts)


@lru_cache(maxsize=64)  # a study's runs read the same files
def _imports_in(text: bytes) -> list[tuple[int, list[str]]]:
    """Return the level and the dotted name of each import in a module's text."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # they are about the user's text
            tree = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return []
    imports = list[tuple[int, list[str]]]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imports += [(0, alias.name.split(".")) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            module = node.module.split(".") if node.module else []
            imports += [(node.level, [*module, alias.name]) for alias in node.names]
    return imports
