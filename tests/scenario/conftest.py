"""Stand-in components: the scenario layer is tested without what it will configure."""

from datetime import timedelta
from importlib.metadata import EntryPoints
from typing import ClassVar

import pytest

from fleet2d.configuration import components
from fleet2d.configuration.built_in import COMPONENTS
from fleet2d.configuration.components import Component, OneOf
from fleet2d.configuration.units import Duration, InputPath, Length, Share
from fleet2d.entities.behavior import Behavior
from fleet2d.entities.drive import Differential
from fleet2d.entities.right_of_way import Listed
from fleet2d.sight.fov import LineOfSight


class Plan(Component):
    """Base of the stand-in floor plans."""

    kind: ClassVar[str] = "floorplan"
    cell: Length = 0.05


class File(Plan):
    """A plan in a file."""

    path: InputPath
    border: int = 4


class Empty(Plan):
    """A plan without walls."""

    width: Length = 5.0


class Drift(Behavior):
    """Moves at random."""

    sigma: Length = 0.1
    pause: Duration = timedelta(0)


class Tour(Behavior):
    """Moves from stop to stop."""

    stops: tuple[str, ...] = ()
    dwell: Duration = timedelta(minutes=1)


class Computation(Component):
    """Base of the stand-in algorithms."""

    kind: ClassVar[str] = "algorithm"


class Count(Computation):
    """Counts what it sees."""

    margin: Share = 0.5


class Smooth(Computation):
    """Smooths another algorithm."""

    inner: OneOf[Computation]


class Tally(Component):
    """Records a count."""

    kind: ClassVar[str] = "metric"
    of: str


STAND_INS = {
    "sight": {"line_of_sight": LineOfSight},  # defaults that every scenario has
    "drive": {"differential": Differential},
    "right_of_way": {"listed": Listed},
    "floorplan": {"houseexpo": File, "empty": Empty},
    "behavior": {"drift": Drift, "tour": Tour},
    "algorithm": {"count": Count, "smooth": Smooth},
    "metric": {"tally": Tally},
}


@pytest.fixture
def stand_ins(monkeypatch):
    """Let the stand-ins be all the components that there are."""
    monkeypatch.setattr(components, "_plugins", lambda kind: EntryPoints())
    for kind in COMPONENTS:
        types = STAND_INS.get(kind, {})
        paths = {name: f"{cls.__module__}:{cls.__qualname__}" for name, cls in types.items()}
        monkeypatch.setitem(COMPONENTS, kind, paths)
        for name in reversed(types):  # of two names of a class the first is its own
            monkeypatch.setattr(types[name], "type_name", name)
