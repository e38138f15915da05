"""A run is the same, watched or not; orders are obeyed or refused with a reason."""

import json
from datetime import timedelta

import pytest
from starlette.testclient import TestClient

import fleet2d
from fleet2d.errors import InputError
from fleet2d.viewing.contract import LIVE_ORDER, read_body
from fleet2d.viewing.live import LiveRun
from fleet2d.viewing.live_runs import LiveRuns
from fleet2d.viewing.page_data import PageData
from fleet2d.viewing.page_server import page_app
from fleet2d.viewing.served_runs import ServedRuns

PORT = 8765
OWN = f"http://127.0.0.1:{PORT}"
DOOR = "objects.bath_door={type: door, doorway: bathroom_1}"


def simulation(duration="8 h"):
    return fleet2d.Simulation("bundled:paper", f"simulation.duration={duration}", DOOR, seed=4)


def order(action, target="", value=0, x=0, y=0):
    content = {"action": action, "target": target, "value": value, "x": x, "y": y}
    return read_body(json.dumps({**content, "key": "", "text": ""}).encode(), LIVE_ORDER, "")


@pytest.fixture
def live():
    watched = LiveRun(simulation(), paused=True)
    watched.start()
    yield watched
    watched.end()


def frames_of(watched):
    """Let a run begin and go on to its end; return its frames."""
    batches = watched.frames()
    frames = [*next(batches)]
    watched.start()
    while not (frames and frames[-1]["done"]):
        frames += next(batches)
    watched.end()
    return frames


def test_watched_run_has_the_digest_of_one_that_nobody_watches_and_frames_its_events_once():
    watched = LiveRun(simulation())
    frames = frames_of(watched)
    steps = [frame["step"] for frame in frames]
    assert simulation().run().digest == watched.run.digest
    assert steps == sorted(steps)
    assert len(steps) > 8 * 60 * 0.9
    assert [] == watched.run.notes
    events = [(e["step"], e["entity"], e["event"]) for frame in frames for e in frame["events"]]
    rows = watched.run.tables["events"].to_pylist()
    assert sorted((r["step"], r["entity"], r["event"]) for r in rows) == sorted(events)


def test_beliefs_in_frames_sum_to_one_and_are_of_everybody():
    own = "algorithms.share={type: 'tests.own_components:Share'}"
    watched = LiveRun(fleet2d.Simulation("bundled:paper", "simulation.duration=13 h", own, seed=4))
    beliefs = [frame["beliefs"] for frame in frames_of(watched) if frame["beliefs"]]
    assert {"ana", "anyone"} == set(beliefs[-1]["ltp"])
    assert {"ana"} == set(beliefs[-1]["share"])
    sums = [sum(s) for each in beliefs for users in each.values() for s in users.values()]
    assert sums == pytest.approx([1.0] * len(sums))
    assert max(users["ana"][-1] for each in beliefs for users in each.values()) > 0  # away


def test_body_is_put_somewhere_and_the_run_says_so(live):
    live.submit(order("step", value=600))
    home = live.engine.simulation.home
    x, y = home.plan.room("living_room_1").anchor_xy
    assert "" == live.submit(order("place", "ana", x=x, y=y))
    live.submit(order("step", value=1))
    state = live.engine.simulation.state["ana"]
    assert (x, y) == pytest.approx((state["x"], state["y"]), abs=1.5)
    live.end()
    assert ["put"] == [entry["do"] for entry in live.run.manifest["interventions"]]
    path = live.run.path("ana", timedelta(seconds=1))
    assert len(path.x) == live.run.manifest["steps"]


def test_robot_that_is_called_comes_and_stays(live):
    live.submit(order("step", value=60))
    x, y = live.engine.simulation.home.plan.room("kitchen_1").anchor_xy
    assert "" == live.submit(order("call", "astro", x=x, y=y))
    live.submit(order("step", value=120))
    state = live.engine.simulation.state["astro"]
    assert "kitchen_1" == state["room"]
    assert "" == live.submit(order("call", "astro", x=x + 0.5, y=y))
    live.submit(order("step", value=1))
    live.end()
    actions = [entry["do"] for entry in live.run.manifest["interventions"]]
    assert ["send", "send"] == actions


MARKS = [(300, "shut bath_door"), (300, "replan astro")]


def test_steered_run_is_reproduced_from_its_manifest(tmp_path):
    run_dir = tmp_path / "steered"
    watched = LiveRun(
        fleet2d.Simulation("bundled:paper", "simulation.duration=3 h", DOOR, seed=4, out=run_dir),
        paused=True,
    )
    watched.start()
    watched.submit(order("step", value=300))
    for command in (order("door", "bath_door", value=0), order("replan", "astro")):
        assert "" == watched.submit(command)
    watched.submit(order("resume"))
    watched.wait()
    watched.end()
    assert fleet2d.reproduce(run_dir).same
    marks = PageData(fleet2d.open_run(run_dir)).facts["marks"]
    assert MARKS == [(mark["step"], mark["label"]) for mark in marks]


def test_frames_have_every_intervention_once(live):
    frames = live.frames()
    next(frames)
    live.submit(order("step", value=300))
    for command in (order("door", "bath_door", value=0), order("replan", "astro")):
        assert "" == live.submit(command)
    live.submit(order("step", value=5))
    marks = [mark for frame in next(frames) for mark in frame["marks"]]
    assert MARKS == [(mark["step"], mark["label"]) for mark in marks]


def test_door_is_shut_from_the_next_step_on(live):
    walls = live.engine.walls()
    assert "" == live.submit(order("door", "bath_door", value=0))
    live.submit(order("step", value=2))
    assert {"bath_door": False} == live.engine.doors()
    assert walls != live.engine.walls()


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (order("place", "zoe"), "nobody named"),
        (order("replan", "zoe"), "nobody named"),
        (order("door", "attic_door"), "attic_door"),
        (order("speed", value=-1), "speed"),
    ],
)
def test_impossible_order_is_refused_with_a_reason(live, command, words):
    assert words in live.submit(command)


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"[]",
        b'{"action": "pause"}',
        b'{"action": "fly", "target": "", "value": 0, "x": 0, "y": 0, "key": "", "text": ""}',
        b'{"action": "place", "target": 3, "value": 0, "x": 0, "y": 0, "key": "", "text": ""}',
        b'{"action": "place", "target": "a", "value": 0, "x": NaN, "y": 0, "key": "", "text": ""}',
        b'{"action": "place", "target": "a", "value": 0, "x": 1e9, "y": 0, "key": "", "text": ""}',
        b'{"action": "place", "target": "a", "value": 0, "x": 0, "y": "1", "key": "", "text": ""}',
        b" " * 5000,
    ],
)
def test_what_is_no_order_is_refused(body):
    with pytest.raises(InputError, match="not a valid order"):
        read_body(body, LIVE_ORDER, "it is not a valid order")


@pytest.fixture
def client(live):
    served = ServedRuns([])
    return TestClient(page_app(served, "token", PORT, LiveRuns(served, live)), base_url=OWN)


def test_orders_need_the_page_s_origin_and_json(live, client):
    body = json.dumps(order("step", value=1))
    own_headers = {"Origin": OWN, "Content-Type": "application/json"}
    for wrong in (
        {"Content-Type": "application/json"},
        {"Origin": "http://evil.example", "Content-Type": "application/json"},
        {**own_headers, "Host": "evil.example"},
        {**own_headers, "Sec-Fetch-Site": "cross-site"},
    ):
        assert 403 == client.post("/token/live/0/order", content=body, headers=wrong).status_code
    form = {"Origin": OWN, "Content-Type": "text/plain"}
    assert 415 == client.post("/token/live/0/order", content=body, headers=form).status_code
    assert 403 == client.post("/wrong/live/0/order", content=body, headers=own_headers).status_code
    assert 0 == live.engine.simulation.step
    assert 200 == client.post("/token/live/0/order", content=body, headers=own_headers).status_code
    assert 1 == live.engine.simulation.step


def test_facts_of_a_run_under_way_name_home_and_bodies(client):
    facts = client.get("/token/live/0/facts.json").json()
    assert ["ana", "astro"] == [body["name"] for body in facts["bodies"]]
    assert ["bath_door"] == [door["name"] for door in facts["home"]["doors"]]
    assert client.get("/token/live/0/walls/0.json").json()["triangles"]
    assert 422 == client.get("/token/live/0/walls/99.json").status_code
