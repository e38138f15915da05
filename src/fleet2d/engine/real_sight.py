"""Sight of robots with real perception: detections from a log, or as they arrive."""

from collections.abc import Sequence

import numpy as np

from fleet2d.algorithms.observations import SightingTable
from fleet2d.engine.cameras import Cameras, Look, SightSetup, end_of_span, newest_of
from fleet2d.engine.sighting_errors import sight_events
from fleet2d.entities.body import Bodies
from fleet2d.entities.entity import SIGHTING, EvidenceSource, LiveDetections
from fleet2d.errors import blame
from fleet2d.kernels import I64, NOBODY, TURN, UNKNOWN_TRUTH, SightMemory, rounded, turned
from fleet2d.kernels import SightingColumn as Column
from fleet2d.sight.camera import FalseSighting

# A look that may end a span sees only this far ahead, so that many events in a row cost little.
MAX_AHEAD = 1 << 12


class RealSight(Cameras):
    """The cameras of a robot that perceives the sightings of a source of evidence.

    The cameras tell which area was watched; sightings come from the source, or also from it.
    """

    def __init__(self, row: int, shared: SightSetup, source: EvidenceSource) -> None:
        """Set up the cameras of the body in a row, and start its source.

        Raises:
            ScenarioError: See `Cameras`.
        """
        super().__init__(row, shared)
        self.source = source.model_copy()
        self.knows_truth = source.besides_cameras
        self.expect_disturbances()
        with blame(f"{self.owner.path}.perceives", None):
            self.source.start(self.owner, self.other_names)
        self.notes = self.source.notes

    def receive(self, step: int, sightings: Sequence[FalseSighting]) -> None:
        """Add the perceptions of a real robot at a step without a look yet."""
        source = self.source
        lattice = self.owner.home.lattice
        assert isinstance(source, LiveDetections)
        index = self.identities
        rows = np.zeros((len(sightings), SIGHTING), np.int64)
        places = np.array([(sighting.x, sighting.y) for sighting in sightings])
        if source.relative:
            points = rounded(places * lattice.units_per_m)
        else:
            points = lattice.to_lattice(places)
        rows[:, Column.STEP] = step
        rows[:, Column.USER] = UNKNOWN_TRUTH
        rows[:, Column.IDENTITY] = [index[sighting.user] for sighting in sightings]
        rows[:, Column.HEADING] = [sighting.heading for sighting in sightings]
        rows[:, [Column.X, Column.Y]] = points
        rows[:, [Column.TRUE_X, Column.TRUE_Y]] = points
        source.receive(rows)

    def _look(self, bodies: Bodies, end: int, *, stop: bool = True) -> Look:
        first = self.next_step
        old_memory = [array.copy() for array in self.memory] if stop else []
        looked = min(end, first + MAX_AHEAD) if stop else end
        if self.source.besides_cameras:
            old_memory = [array.copy() for array in self.memory]
            seen = super()._look(bodies, looked, stop=stop)
            looked = seen.looked
            self.memory.noticed[:], self.memory.seen[:] = old_memory[:2]
        with blame(f"{self.owner.path}.perceives", first):
            rows = self.source.sightings(first, looked)
        if self.owner.is_off:
            rows = rows[:0]
        if self.source.relative and len(rows):
            rows = self._on_map(rows, bodies, first, looked)
        if self.source.besides_cameras:
            rows = np.concatenate([seen.sightings.rows(), rows])
            rows[len(seen.sightings) :, Column.USER] = NOBODY  # no simulated person
            rows = rows[np.argsort(rows[:, Column.STEP], kind="stable")]
        patience = self.rule.patience
        events = sight_events(rows, SightMemory(*self.memory), patience, first, looked)
        stops = self.ends if stop else (False, False)
        ends_at = end_of_span(events, stops, looked)
        newest = newest_of(rows, len(self.memory.seen))
        return Look(looked, ends_at, SightingTable.of_rows(rows), newest, events, old_memory)

    def _on_map(self, rows: I64, bodies: Bodies, first: int, end: int) -> I64:
        """Return sightings in the frame of the robot as sightings in the floor plan."""
        rows = rows.copy()
        x, y, heading = bodies.window(first, end).dense(self.row, first, end)[:3]
        at = rows[:, Column.STEP] - first
        turn = heading[at]
        dx, dy = turned(rows[:, Column.X], rows[:, Column.Y], 2 * turn)
        faces: I64 = np.mod(rows[:, Column.HEADING] + turn, TURN)
        rows[:, Column.X] = rows[:, Column.TRUE_X] = x[at] + dx
        rows[:, Column.Y] = rows[:, Column.TRUE_Y] = y[at] + dy
        rows[:, Column.HEADING] = rows[:, Column.TRUE_HEADING] = faces
        return rows
