"""Sources that read files of floor plans in a child process with limits."""

from abc import abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from fleet2d.bounds import FILE_BYTES, Bound
from fleet2d.floorplan.files import read_file
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.source import FloorPlanSource


class FileSource(FloorPlanSource):
    """A source that reads files in a child process; see `apart`."""

    bound: ClassVar[Bound] = FILE_BYTES
    """The size of a file."""

    small_bytes: ClassVar[int] = 0
    """Files of fewer bytes are read in the process itself, which starts no child for them."""

    if TYPE_CHECKING:
        path: Path

    @abstractmethod
    def read(self, files: Mapping[Path, bytes]) -> FloorPlan:
        """Return the home in the content of some files, by their paths; in the child.

        Raises:
            FloorPlanError: They can't be read, or hold no home.
        """

    def load(self) -> FloorPlan:
        """Read the floor plan.

        Raises:
            FloorPlanError: As of `read`, or it takes too much time or memory.
            InputError: A package that reads the format is not installed.
        """
        contents = self.contents()
        if sum(map(len, contents.values())) < self.small_bytes:
            return self.read(contents)
        from fleet2d.storage.apart import apart  # most homes are small

        return apart(self.path, self.read, contents)

    def contents(self) -> dict[Path, bytes]:
        """Return the content of the files, as the child opens none.

        Raises:
            FloorPlanError: One can't be read.
        """
        return {path: read_file(path, self.bound) for path in self.files()}


SMALL_BYTES = 64 << 10
"""Most homes in plain outlines are smaller, and any file that is smaller is read in seconds."""
