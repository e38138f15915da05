"""Links between rooms: doorways, and borders without a wall."""

import numpy as np
import shapely

from fleet2d.floorplan.lattice import Lattice
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.floorplan.rooms.doorways import DoorLine, open_borders

LATTICE = Lattice(0.5, (0.0, 0.0), 6, 6)


def rooms(*rows):
    return np.array([[int(c) if c != "." else -1 for c in row] for row in rows], np.int16)


def test_open_border_is_as_long_as_its_longer_side():
    links = open_borders(LATTICE, rooms("0011", "0011", "0000"), ())
    assert [((0, 1), "open", 1.0)] == [(link.rooms, link.kind, link.width_m) for link in links]


def test_single_pair_of_touching_cells_is_no_link():
    assert () == open_borders(LATTICE, rooms("00..", "0011", "...1"), ())


def test_room_graph_has_doorways_first_and_gives_the_neighbors():
    free = shapely.box(0, 0, 6, 3) - shapely.box(4, 1, 4.1, 3)
    labels = [
        LabelledRegion((kind,), shapely.box(x0, 0, x1, 3))
        for kind, x0, x1 in (("kitchen", 0, 2), ("living_room", 2, 4.05), ("bedroom", 4.05, 6))
    ]
    plan = FloorPlan.build("flat", free, labels, doorways=[DoorLine((4.05, 0.0), (4.05, 1.0))])
    assert [("doorway", (1, 2)), ("open", (0, 1))] == [(w.kind, w.rooms) for w in plan.room_graph]
    assert ["kitchen_1", "bedroom_1"] == [room.name for room in plan.neighbors("living_room_1")]
    assert ["living_room_1"] == [room.name for room in plan.neighbors("kitchen_1")]
