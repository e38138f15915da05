"""Interventions: changes of a run from outside, as data; one module for each subject.

Their classes, which `__init__.pyi` lists, are imported when they are first used.
"""

from typing import Any


def __getattr__(name: str) -> Any:
    """Import an intervention when it is first used."""
    from fleet2d.configuration.components import components

    for cls in components("intervention").values():
        if cls.__name__ == name:
            return cls
    raise AttributeError(f"module 'fleet2d.interventions' has no attribute {name!r}")
