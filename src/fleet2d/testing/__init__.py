"""Tests of robots and of algorithms: trials over many seeds, and checks of your own components.

Modules are loaded when they are first used: pytest imports this package at every start.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fleet2d.testing.checks import check_algorithm as check_algorithm
    from fleet2d.testing.checks import check_perception_error as check_perception_error
    from fleet2d.testing.claim import trial as trial
    from fleet2d.testing.trials import Trial as Trial

_MODULE_OF = {
    "Trial": "trials",
    "check_algorithm": "checks",
    "check_perception_error": "checks",
    "trial": "claim",
}

__all__ = ["Trial", "check_algorithm", "check_perception_error", "trial"]


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'fleet2d.testing' has no attribute {name!r}")
    value = getattr(import_module(f"fleet2d.testing.{_MODULE_OF[name]}"), name)
    globals()[name] = value
    return value
