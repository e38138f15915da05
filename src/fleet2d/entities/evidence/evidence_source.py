"""The base of what robots perceive without simulated sight."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from fleet2d.configuration.components import Component
from fleet2d.kernels import I64, SightingColumn

if TYPE_CHECKING:
    from fleet2d.entities.behavior import Actor

SIGHTING = len(SightingColumn)


class EvidenceSource(Component):
    """Base of what a robot perceives in place of what its cameras would see.

    A source returns sightings as the sight kernel does, int64 (n, len(SightingColumn)) by step,
    with UNKNOWN_TRUTH for the true user. What the robot watched still follows from its poses and
    cameras.

    Attributes:
        besides_cameras: Whether this comes in addition to what its cameras see, as false positives
            that are known in advance do; else in place of it.

    After `start` it has `notes`, lines about its log: what was left out, and what doesn't fit.
    """

    kind: ClassVar[str] = "evidence_source"

    besides_cameras: bool = False

    @property
    def relative(self) -> bool:
        """Whether positions are in the robot's frame: x ahead, y to the left."""
        return False

    def files(self) -> Sequence[Path]:
        """Return the files that it reads."""
        return ()

    def start(self, actor: "Actor", users: Sequence[str]) -> None:
        """Prepare for a run of a robot among users."""
        self.notes: tuple[str, ...] = ()

    def sightings(self, first: int, end: int) -> I64:
        """Return the sightings that become known in the steps from `first` to `end` - 1."""
        raise NotImplementedError
