"""Parts of a home as a file of another program has them, and sources that read them in a child."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from shapely import MultiPolygon, Polygon

from fleet2d.bounds import FILE_BYTES, Bound
from fleet2d.floorplan.files import in_file, read_file
from fleet2d.floorplan.placed_objects import PlacedObject
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.rooms.division import RegionKind
from fleet2d.floorplan.rooms.doorways import DoorLine
from fleet2d.floorplan.rooms.room import LabelledRegion
from fleet2d.floorplan.source import FloorPlanSource
from fleet2d.homes.formats.apart import apart


@dataclass(frozen=True, kw_only=True)
class PlanParts:
    """The arguments of `FloorPlan.build`, which has their meanings."""

    name: str
    free: Polygon | MultiPolygon
    regions: tuple[LabelledRegion, ...] = ()
    cell: float
    source: str
    entrance: tuple[float, float] | None = None
    doorways: tuple[DoorLine, ...] | None = None
    regions_are: RegionKind
    objects: tuple[PlacedObject, ...] = ()
    no_go: tuple[Polygon, ...] = ()
    glass: tuple[Polygon, ...] = ()
    notes: tuple[str, ...]
    scale: float | None = None

    def plan(self) -> FloorPlan:
        """Build the floor plan.

        Raises:
            FloorPlanError: As of `FloorPlan.build`.
        """
        return FloorPlan.build(**vars(self))


class ForeignSource(FloorPlanSource):
    """A source in a format of another program, which a child process reads; see `apart`."""

    bound: ClassVar[Bound] = FILE_BYTES
    """The size of a file."""

    if TYPE_CHECKING:
        path: Path

    @abstractmethod
    def read(self, files: Mapping[Path, bytes]) -> PlanParts:
        """Return the parts of the home in some files, by their paths; in the child.

        Raises:
            FloorPlanError: They can't be read, or hold no home.
        """

    def load(self) -> FloorPlan:
        """Read the floor plan.

        Raises:
            FloorPlanError: As of `read`, or it takes too much time or memory.
            InputError: A package that reads the format is not installed.
        """
        parts = apart(self.path, self.read, self.contents())
        with in_file(self.path):
            return parts.plan()

    def contents(self) -> dict[Path, bytes]:
        """Return the content of the files, as the child opens none.

        Raises:
            FloorPlanError: One can't be read.
        """
        return {path: read_file(path, self.bound) for path in self.files()}
