"""What a run stores: tables, digests, manifest, run directory."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fleet2d.artifacts.manifest import Manifest
    from fleet2d.artifacts.settings import ArtifactSettings
    from fleet2d.artifacts.store import RunStore
    from fleet2d.artifacts.table import Column, TableSpec

__all__ = [
    "ArtifactSettings",
    "Column",
    "Manifest",
    "RunStore",
    "TableSpec",
]

_HOME = {
    "ArtifactSettings": "settings",
    "Column": "table",
    "Manifest": "manifest",
    "RunStore": "store",
    "TableSpec": "table",
}


def __getattr__(name: str) -> Any:
    """Load the module of a name when the name is first used."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
