"""What robots perceive without simulated sight: the base of its sources, and a live one."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from fleet2d.configuration.components import Component, register
from fleet2d.configuration.units import PeerAddress
from fleet2d.kernels import I64, SightingColumn
from fleet2d.kernels import SightingColumn as Column

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


@register("evidence_source", "live")
class LiveDetections(EvidenceSource):
    """Perceive what arrives while the run goes on, from a real robot or another program.

    Each arrival is an intervention `perceive`, which `fleet2d live` or a script of your own makes,
    so that the run is repeated by its manifest.

    Attributes:
        relative_to: Whether positions are in the floor plan, or in the frame of the robot: x ahead,
            y to the left.
        source: The other program whose messages it takes, such as ws://127.0.0.1:8765, which
            `fleet2d live` opens; left out: any of `--with`.
    """

    relative_to: Literal["map", "robot"] = "map"
    source: PeerAddress | None = None

    @property
    def relative(self) -> bool:
        """Whether positions are in the robot's frame."""
        return self.relative_to == "robot"

    def start(self, actor: "Actor", users: Sequence[str]) -> None:
        """Begin without detections."""
        super().start(actor, users)
        self._rows: list[I64] = []

    def receive(self, rows: I64) -> None:
        """Add sightings of one step, not before that of any earlier call."""
        self._rows.append(rows)

    def sightings(self, first: int, end: int) -> I64:
        """Return the detections of the steps from `first` to `end` - 1, and drop earlier ones."""
        self._rows = [rows for rows in self._rows if rows[0, Column.STEP] >= first]
        rows = [rows for rows in self._rows if rows[0, Column.STEP] < end]
        return np.concatenate(rows) if rows else np.empty((0, SIGHTING), np.int64)
