"""Stand-in components: the scenario layer is tested without what it will configure."""

from datetime import timedelta
from importlib.metadata import EntryPoints
from typing import Annotated, ClassVar

import pytest

from fleet2d.configuration import components
from fleet2d.configuration.components import Component, OneOf, register
from fleet2d.configuration.units import Duration, InputPath, Length, Share
from fleet2d.entities.behavior import Behavior
from fleet2d.entities.drive import Differential
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

    inner: Annotated[Component, OneOf("algorithm")]


class Tally(Component):
    """Records a count."""

    kind: ClassVar[str] = "metric"
    of: str


@pytest.fixture
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the stand-ins be all the components that there are."""
    for kind in components.PACKAGES:
        components.components(kind)  # a built-in imported later would register among the stand-ins
    monkeypatch.setattr(components, "_REGISTRY", {})
    monkeypatch.setattr(components, "_ALIASES", {})
    monkeypatch.setattr(components, "_COMPLETE", set(components.PACKAGES))
    monkeypatch.setattr(components, "_plugins", lambda kind: EntryPoints())
    register("sight", "line_of_sight")(LineOfSight)  # defaults that every scenario has
    register("drive", "differential")(Differential)
    register("floorplan", "houseexpo", aliases=("he",))(File)
    register("floorplan", "empty")(Empty)
    register("behavior", "drift")(Drift)
    register("behavior", "tour")(Tour)
    register("algorithm", "count")(Count)
    register("algorithm", "smooth")(Smooth)
    register("metric", "tally")(Tally)
