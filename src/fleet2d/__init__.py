"""Fleet2D: weeks of a home in a fraction of a second, exactly reproducible.

The public names are those of this package, which `__init__.pyi` lists with their modules, and of
`fleet2d.testing`. They are imported when they are first used.
"""

import re
import sys
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

__version__ = "0.1.0"

_STUB = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_MODULES = {name: module for module, name in re.findall(r"^from (\S+) import (\w+)", _STUB, re.M)}

__all__ = sorted([*_MODULES, "__version__"])


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name not in _MODULES:
        raise AttributeError(f"module 'fleet2d' has no attribute {name!r}")
    from fleet2d.runtime.memory import library_imports

    with library_imports():
        value = getattr(import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names."""
    return __all__


def _join_notebook() -> None:
    """Load the extensions of IPython that limbs register, if this is a session of IPython."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    if shell is not None:
        from importlib.metadata import entry_points  # slow to import, and only needed here

        for entry in entry_points(group="fleet2d.notebook"):
            with suppress(ModuleNotFoundError):  # a limb that was taken away
                shell.extension_manager.load_extension(entry.value)


_join_notebook()
