"""Detections of a real robot as they arrive, by the intervention `perceive`."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from fleet2d.configuration.components import register
from fleet2d.configuration.units import PeerAddress
from fleet2d.entities.evidence.evidence_source import SIGHTING, EvidenceSource
from fleet2d.kernels import I64
from fleet2d.kernels import SightingColumn as Column

if TYPE_CHECKING:
    from fleet2d.entities.behavior import Actor


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
