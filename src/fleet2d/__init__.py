"""Fleet2D: weeks of a home in a fraction of a second, exactly reproducible.

Heavy parts load when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from fleet2d.leaves import Judges, Views, register_judges, register_views
from fleet2d.memory import library_imports
from fleet2d.version import __version__ as __version__

if TYPE_CHECKING:
    from fleet2d.algorithms.algorithm import Algorithm as Algorithm
    from fleet2d.algorithms.algorithm import Present as Present
    from fleet2d.algorithms.algorithm import RoomDistribution as RoomDistribution
    from fleet2d.algorithms.history import History as History
    from fleet2d.configuration.components import register as register
    from fleet2d.configuration.units import Duration as Duration
    from fleet2d.configuration.units import Length as Length
    from fleet2d.configuration.units import Share as Share
    from fleet2d.engine.encounters import Interrupt as Interrupt
    from fleet2d.engine.encounters import SpanView as SpanView
    from fleet2d.engine.reproduce import reproduce as reproduce
    from fleet2d.engine.resume import resume as resume
    from fleet2d.engine.run import run as run
    from fleet2d.engine.simulation import Simulation as Simulation
    from fleet2d.entities.behavior import Actor as Actor
    from fleet2d.entities.behavior import Behavior as Behavior
    from fleet2d.entities.behavior import Situation as Situation
    from fleet2d.entities.drives.drive import Drive as Drive
    from fleet2d.entities.drives.drive import Leg as Leg
    from fleet2d.entities.drives.drive import Moment as Moment
    from fleet2d.entities.drives.drive import Route as Route
    from fleet2d.entities.plan import Plan as Plan
    from fleet2d.errors import ComponentError as ComponentError
    from fleet2d.errors import Fleet2DError as Fleet2DError
    from fleet2d.errors import InputError as InputError
    from fleet2d.floorplan.home.change import HomeChange as HomeChange
    from fleet2d.floorplan.home.change import HomeChanges as HomeChanges
    from fleet2d.floorplan.home.home import Home as Home
    from fleet2d.floorplan.load import load_floorplan as load_floorplan
    from fleet2d.floorplan.plan import FloorPlan as FloorPlan
    from fleet2d.floorplan.plan import LabelledRegion as LabelledRegion
    from fleet2d.metrics.metric import Metric as Metric
    from fleet2d.runs.run import Run as Run
    from fleet2d.runs.run import open_run as open_run
    from fleet2d.scenario.model import Scenario as Scenario
    from fleet2d.scenario.model import load_scenario as load_scenario
    from fleet2d.sight.fov import FieldOfView as FieldOfView
    from fleet2d.sight.fov import VisibleRegion as VisibleRegion
    from fleet2d.sight.perception_error import CameraSightings as CameraSightings
    from fleet2d.sight.perception_error import PerceptionError as PerceptionError
    from fleet2d.studies.api import map_runs as map_runs
    from fleet2d.studies.api import study as study
    from fleet2d.studies.reader import Study as Study
    from fleet2d.studies.reader import open_study as open_study

_HOME_OF = {
    "Actor": "entities.behavior",
    "Algorithm": "algorithms.algorithm",
    "Behavior": "entities.behavior",
    "CameraSightings": "sight.perception_error",
    "ComponentError": "errors",
    "Drive": "entities.drives.drive",
    "Duration": "configuration.units",
    "FieldOfView": "sight.fov",
    "Fleet2DError": "errors",
    "FloorPlan": "floorplan.plan",
    "History": "algorithms.history",
    "Home": "floorplan.home.home",
    "HomeChange": "floorplan.home.change",
    "HomeChanges": "floorplan.home.change",
    "InputError": "errors",
    "Interrupt": "engine.encounters",
    "LabelledRegion": "floorplan.plan",
    "Leg": "entities.drives.drive",
    "Length": "configuration.units",
    "Metric": "metrics.metric",
    "Moment": "entities.drives.drive",
    "PerceptionError": "sight.perception_error",
    "Plan": "entities.plan",
    "Present": "algorithms.algorithm",
    "RoomDistribution": "algorithms.algorithm",
    "Route": "entities.drives.drive",
    "Run": "runs.run",
    "Scenario": "scenario.model",
    "Share": "configuration.units",
    "Simulation": "engine.simulation",
    "Situation": "entities.behavior",
    "SpanView": "engine.encounters",
    "Study": "studies.reader",
    "VisibleRegion": "sight.fov",
    "load_floorplan": "floorplan.load",
    "load_scenario": "scenario.model",
    "map_runs": "studies.api",
    "open_run": "runs.run",
    "open_study": "studies.reader",
    "register": "configuration.components",
    "reproduce": "engine.reproduce",
    "resume": "engine.resume",
    "run": "engine.run",
    "study": "studies.api",
}

__all__ = sorted([*_HOME_OF, "__version__"])


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used."""
    if name not in _HOME_OF:
        raise AttributeError(f"module 'fleet2d' has no attribute {name!r}")
    with library_imports():
        module = import_module(f"fleet2d.{_HOME_OF[name]}")
    value = getattr(module, name)
    globals()[name] = value
    return value


def _notebook() -> Views:
    from fleet2d.viewer import notebook

    return notebook


def _judges() -> Judges:
    from fleet2d.engine import reproduce as reproducing

    return reproducing


register_views(_notebook)
register_judges(_judges)


def __dir__() -> list[str]:
    """List the public names."""
    return __all__
