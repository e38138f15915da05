"""What arrives from outside, as interventions: detections, readings; recorded and repeated."""

import numpy as np
import pytest

import fleet2d
from fleet2d.errors import InputError

LIVE = {
    "extends": "bundled:paper",
    "simulation": {"duration": "10 min", "seed": 4},
    "users": {"ana": {"type": "live"}},
    "robots": {"astro": {"perceives": "live"}},
    "objects": {"front_door": {"type": "live_sensor", "room": "hallway"}},
}


def place(room):
    return next(r.anchor_xy for r in fleet2d.load_floorplan().rooms if r.name == room)


def drive(simulation):
    x, y = place("kitchen_1")
    simulation.do({"put": "ana", "to": [x, y]})
    for k in range(3):
        seen = [{"user": "ana", "x": x, "y": y}, {"user": "unknown", "x": x + 0.1, "y": y}]
        simulation.do({"perceive": "astro", "detections": seen[: 1 + k]})
        simulation.do({"report": "front_door", "says": "off" if k == 1 else "on"})
        simulation.advance(10)


def test_what_arrives_is_stored_at_its_step_and_repeated(tmp_path):
    simulation = fleet2d.Simulation(LIVE, out=tmp_path / "live")
    drive(simulation)
    run = simulation.run()

    seen = run.pandas("observations")
    assert seen["step"].tolist() == [0, 10, 10, 20, 20]
    assert seen["user"].isna().tolist() == [False, False, True, False, True]
    assert set(seen["room"]) == {"kitchen_1"}
    assert not seen["truth_known"].any()
    said = run.pandas("sensors")
    assert said["step"].tolist() == [0, 10, 20]
    assert said["state"].tolist() == ["ON", "OFF", "ON"]
    way = run.path("ana")
    assert place("kitchen_1") == pytest.approx((way.x[0], way.y[0]), abs=0.01)
    assert (np.ptp(way.x), np.ptp(way.y)) == (0, 0)
    assert fleet2d.reproduce(tmp_path / "live").digest == run.digest


@pytest.mark.parametrize(
    ("act", "message"),
    [
        ({"perceive": "astro", "detections": []}, "at least 1"),
        ({"perceive": "astro", "detections": [{"user": "anna", "x": 1, "y": 1}]}, "anna"),
        ({"perceive": "ana", "detections": [{"x": 1, "y": 1}]}, "ana"),
        (
            {"report": "front_dor", "says": "on"},
            "there is no sensor 'front_dor': did you mean 'front_door'",
        ),
    ],
)
def test_what_is_wrong_is_refused(act, message):
    simulation = fleet2d.Simulation(LIVE)

    with pytest.raises(InputError) as caught:
        simulation.do(act)
    assert message in str(caught.value)


def test_simulated_robots_and_sensors_refuse_what_arrives():
    content = LIVE | {
        "robots": {},
        "objects": {"front_door": {"type": "motion_sensor", "at": place("kitchen_1")}},
    }
    simulation = fleet2d.Simulation(content)

    with pytest.raises(InputError, match=r"robots\.astro\.perceives=live"):
        simulation.do({"perceive": "astro", "detections": [{"x": 1, "y": 1}]})
    with pytest.raises(InputError, match="front_door is simulated"):
        simulation.do({"report": "front_door", "says": "on"})
