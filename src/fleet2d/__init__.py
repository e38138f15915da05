"""Fleet2D: weeks of a home in a fraction of a second, exactly reproducible.

The public names are those of this package and of `fleet2d.testing`. They are imported when they
are first used; `__init__.pyi` has them for editors and type checkers.
"""

import sys
from contextlib import suppress
from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_NAMES = {
    "fleet2d.algorithms.algorithm": ("Algorithm", "Present", "RoomDistribution"),
    "fleet2d.algorithms.history": ("History",),
    "fleet2d.configuration.units": ("Duration", "InputPath", "Length", "Share"),
    "fleet2d.learning.datasets.generate": ("dataset",),
    "fleet2d.learning.datasets.reader": ("Dataset", "open_dataset"),
    "fleet2d.engine.interrupt": ("Interrupt", "SpanView"),
    "fleet2d.engine.repeat": ("branch", "judge", "reproduce", "resume"),
    "fleet2d.engine.simulation": ("Simulation", "run"),
    "fleet2d.entities.behavior": ("Actor", "Behavior", "Situation"),
    "fleet2d.entities.drive": ("Drive", "Leg", "Moment", "Route"),
    "fleet2d.entities.plan": ("Plan",),
    "fleet2d.errors": ("ComponentError", "Fleet2DError", "InputError"),
    "fleet2d.floorplan.home": ("Home", "HomeChange", "HomeChanges"),
    "fleet2d.floorplan.load": ("load_floorplan",),
    "fleet2d.floorplan.plan": ("FloorPlan", "LabelledRegion"),
    "fleet2d.metrics.metric": ("Metric",),
    "fleet2d.live.exporters": ("export",),
    "fleet2d.runs.run": ("Run", "open_run"),
    "fleet2d.scenario.load": ("load_scenario",),
    "fleet2d.scenario.model": ("Scenario",),
    "fleet2d.sight.fov": ("FieldOfView", "VisibleRegion"),
    "fleet2d.sight.perception_error": ("CameraSightings", "PerceptionError"),
    "fleet2d.studies.api": ("map_runs", "study"),
    "fleet2d.studies.reader": ("Study", "open_study"),
    "fleet2d.viewing.notebook": ("draw", "view"),
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names}

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
            with suppress(ModuleNotFoundError):  # the limb is not installed
                shell.extension_manager.load_extension(entry.value)


_join_notebook()
