"""Using objects: the way there, the last step onto them, postures, and getting up again."""

import numpy as np
import pytest
import shapely

import fleet2d
from fleet2d import Behavior, ComponentError
from fleet2d.floorplan.native import native_document
from fleet2d.floorplan.placed_objects import PlacedObject, UsePlace
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.floorplan.space import Space

BED = PlacedObject(
    "bed",
    "bed",
    shapely.box(3, 1, 5, 2.6),
    uses=(UsePlace(4, 2.2, np.pi, "lie", approach=(4, 2.9)), UsePlace(4, 1.4, 0, "lie")),
)
RUG = PlacedObject("rug", "rug", shapely.box(0.5, 0.5, 1, 1), "nothing")


class Rest(Behavior):
    """Use the bed, and then go to a corner."""

    thing: str = "bed"
    place: int = 0

    def decide(self, now):
        from datetime import timedelta

        plan = now.plan().use(self.thing, self.place).stay(timedelta(seconds=60))
        return plan.go_to([0.5, 3.5]).stay()


def simulation(tmp_path, **behavior):
    import json

    room = [LabelledRegion(("bedroom",), shapely.box(0, 0, 6, 4))]
    plan = FloorPlan.build("bedroom", shapely.box(0, 0, 6, 4), room, objects=[BED, RUG])
    path = tmp_path / "bedroom.json"
    path.write_text(json.dumps(native_document(plan)))
    return fleet2d.Simulation(
        {
            "simulation": {"duration": "2 min", "seed": 1},
            "floorplan": {"type": "native", "path": str(path)},
            "users": {"ana": {"type": f"{__name__}:Rest", "start": [0.5, 0.5], **behavior}},
        }
    )


def where(sim):
    state = sim.state["ana"]
    return state["x"], state["y"]


def test_sleeper_lies_on_the_bed_and_faces_as_one_does_there(tmp_path):
    sim = simulation(tmp_path)
    sim.advance(30)
    assert where(sim) == pytest.approx((4, 2.2), abs=1e-3)
    assert sim.state["ana"]["heading"] == pytest.approx(np.pi, abs=0.002)
    plan = sim.actors["ana"].plan
    assert [0, 2] == [plan.posture_at(time_us) for time_us in (0, 30_000_000)]


def test_body_has_the_posture_of_the_moment_in_a_plan_that_ends_standing(tmp_path):
    sim = simulation(tmp_path)
    sim.advance(30)
    ana = sim.actors["ana"]

    assert [0, 2, 0] == [ana.posture_code(seconds * 10**6) for seconds in (0, 30, 119)]


def test_way_to_the_bed_goes_round_it(tmp_path):
    sim = simulation(tmp_path)
    sim.advance(1)
    track = sim.actors["ana"].plan.finish().breakpoints
    lattice = sim.home.plan.lattice
    points = lattice.to_metres(np.stack([track.x, track.y], axis=1))
    arrives = int(np.flatnonzero((np.abs(points - (4, 2.9)) < 0.001).all(axis=1))[0])
    way = shapely.LineString(points[: arrives + 1])
    assert way.distance(BED.footprint) >= 0.2


def test_place_without_an_approach_is_stepped_to_from_beside_the_object(tmp_path):
    sim = simulation(tmp_path, place=1)
    sim.advance(30)
    assert where(sim) == pytest.approx((4, 1.4), abs=1e-3)
    sim.advance(89)
    assert where(sim) == pytest.approx((0.5, 3.5), abs=1e-3)


def test_use_is_told_in_the_events(tmp_path):
    run = simulation(tmp_path).run()
    rows = run.tables["events"].to_pylist()
    assert [("uses", "bed")] == [(row["event"], row["detail"]) for row in rows]


def test_object_without_a_place_is_refused(tmp_path):
    with pytest.raises(ComponentError, match="rug has no place to use it from"):
        simulation(tmp_path, thing="rug").run()


def test_place_moves_with_an_object_that_blocks_nothing(tmp_path):
    """Places were kept as long as the free space stayed the same, which a mat doesn't change."""
    ana = simulation(tmp_path).actors["ana"]
    for x in (0.75, 2.0):
        uses = (UsePlace(x, 0.75, 0, "stand"),)
        mat = PlacedObject("rug", "rug", shapely.box(x, 0.5, x + 0.5, 1), "nothing", uses=uses)
        ana.home.put(mat)
        place = ana.place_at("rug", 0)
        assert (place.x, place.y) == ana.home.plan.lattice.point_at((x, 0.75))


def test_unknown_object_is_refused_with_those_there_are(tmp_path):
    with pytest.raises(ComponentError, match=r"no object 'bad': did you mean 'bed'\?.*bed, rug"):
        simulation(tmp_path, thing="bad").run()


def test_ways_of_one_step_equal_those_of_several(monkeypatch):
    """Where a body may pay costs, the core doesn't find the way: the plan is the same."""
    quick = fleet2d.run("bundled:paper", "simulation.duration=1 d", seed=4)
    monkeypatch.setattr(Space, "shortest", None)

    assert quick.digest == fleet2d.run("bundled:paper", "simulation.duration=1 d", seed=4).digest
