"""Leaves: packages that show and send what runs hold, and that nothing else builds on.

A few methods of central classes hand over to them for convenience. What is not there, or lacks a
library, is said in a message; everything else works without.
"""

from importlib import import_module
from types import ModuleType

from fleet2d.errors import InputError


def leaf(name: str) -> ModuleType:
    """Return a module of a leaf, such as ``viewer.notebook``.

    Raises:
        InputError: It is not installed.
    """
    try:
        return import_module(f"fleet2d.{name}")
    except ModuleNotFoundError as error:
        raise InputError(f"fleet2d.{name} needs {error.name}, which is not installed") from None
