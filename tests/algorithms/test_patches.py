"""Patches: rooms cut into boxes, and evidence by them, in bundled and synthetic homes."""

from collections.abc import Set
from typing import ClassVar

import numpy as np
import pytest
from tests.scenes import TESTS, everything, run

import fleet2d
from fleet2d import Algorithm
from fleet2d.algorithms.evidence import MAX_PATCHES, SIDE_M, patches_of, whole_rooms
from fleet2d.algorithms.observations import NOWHERE

HERE = f"{TESTS.as_posix()}/algorithms/test_patches"


def plans(shared_data):
    expo = shared_data / "houseexpo" / "7e80c5f4c9905bc273560854d8abe916.json"
    return [fleet2d.load_floorplan(of) for of in ("family_home", "synthetic:7", expo)]


def test_patches_divide_the_floor_of_each_room(shared_data):
    for plan in plans(shared_data):
        patches, rooms = patches_of(plan), plan.room_of_cell
        assert np.array_equal(patches.of_cell == NOWHERE, rooms == NOWHERE)
        inside = rooms != NOWHERE
        assert np.array_equal(patches.room[patches.of_cell[inside]], rooms[inside])
        counts = np.bincount(patches.of_cell[inside], minlength=len(patches.room))
        assert counts.tolist() == patches.cells.tolist()
        assert (np.diff(patches.room) >= 0).all()
        assert list(range(len(plan.rooms))) == patches.room[patches.first].tolist()


def test_patches_are_boxes_of_about_a_metre_or_a_dozenth_of_the_room(shared_data):
    for plan in plans(shared_data):
        patches = patches_of(plan)
        for patch, room in enumerate(patches.room.tolist()):
            side = max(SIDE_M / plan.lattice.cell, (plan.rooms[room].cells / MAX_PATCHES) ** 0.5)
            extent = np.ptp(np.argwhere(patches.of_cell == patch), axis=0) + 1
            assert (extent <= 1.5 * side + 2).all()


def test_whole_rooms_are_patches_by_themselves(shared_data):
    for plan in plans(shared_data):
        patches = whole_rooms(plan)
        assert patches.of_cell is plan.room_of_cell
        assert [room.cells for room in plan.rooms] == patches.cells.tolist()


@pytest.mark.slow
def test_rooms_that_nothing_joins_are_on_islands_of_their_own(shared_data):
    expo = shared_data / "houseexpo"
    plan = fleet2d.load_floorplan(next(expo.glob("69c2ebf7*.json")))
    island = patches_of(plan).island
    assert island is not None
    apart = [room.name for room in plan.rooms if island[room.index] != island[0]]
    assert ["bedroom_3", "unknown_3"] == apart
    assert whole_rooms(plan).island is not None
    assert all(patches_of(plan).island is None for plan in plans(shared_data))


class PatchSums(Algorithm):
    """Puts out by how much evidence by patches differs from that by rooms."""

    needs: ClassVar[Set[str]] = {"evidence"}

    def update(self, history, state):
        evidence, patches = history.evidence, history.evidence.by_patch
        first = np.flatnonzero(np.diff(patches.room, prepend=-1))
        cells = np.add.reduceat(patches.cells, first)
        watched = np.add.reduceat(patches.watched * patches.cells, first, axis=1) / cells
        seen = np.add.reduceat(patches.seen, first, axis=2)
        return {
            "watched": float(np.abs(watched - evidence.watched).max()),
            "seen": int((seen - evidence.seen).min()),
            "less": float((patches.shown - patches.watched).min()),
            "most": float(patches.shown.max()),
            "sightings": int(patches.seen.sum()),
        }


@pytest.mark.parametrize("max_span", [7, None])
def test_evidence_by_patches_sums_up_to_that_by_rooms(max_span):
    content = everything("1 h")
    content["robots"] = {"astro": content["robots"]["astro"]}
    content["algorithms"] = {"tell": {"type": f"{HERE}:PatchSums", "period": "10 min"}}
    rows = run(content, max_span=max_span).tables["tell"].to_pandas()
    assert rows["watched"].max() < 1e-12
    assert 0 == rows["seen"].min()  # who is taken to be in two patches at once counts in both
    assert rows["less"].min() > -1e-12  # at one step at most as much as on average, or more
    assert 0.5 < rows["most"].max() <= 1
    assert rows["sightings"].sum() > 0
