"""Copies of a run, in memory and in files: each goes on to the digest of an undisturbed run."""

import copy
import hashlib
import hmac
import io
import json
import os
import pickle
import random
from contextlib import nullcontext
from functools import cache, partial

import numpy as np
import pytest
from tests.engine.test_cameras_perceiving import full
from tests.scenes import digests, every_step, everything, process, run, scenario
from tests.thorough import THOROUGH, some

from fleet2d import Algorithm, Simulation
from fleet2d.engine import checkpoint
from fleet2d.engine.simulation import PURPOSE
from fleet2d.engine.snapshot import MAGIC, open_snapshot
from fleet2d.errors import ArtifactError, ComponentError, InputError
from fleet2d.interventions import OpenDoor, Put, Replan
from fleet2d.storage.secret_files import signature

HOUSE = {
    "hall": {"type": "door", "doorway": "living_room_1-bedroom_1", "closes_after": "20 s"},
    "bath": {"type": "door", "doorway": "kitchen_1-bathroom_1"},
    "eye": {"type": "motion_sensor", "at": [2.5, 2.5], "range": 4, "hold": "20 s"},
    "switch": {"type": "contact_sensor", "of": "bath"},
}


def house(duration="5 min"):
    """Doors, sensors, layers, people who react, robots that give way and don't know their place."""
    content = everything(duration, objects=HOUSE)
    content["script"] = [
        {"at": "2 min", "shut": "bath"},
        {"at": "3 min", "lock": "hall"},
        {"at": "4 min", "unlock": "hall"},
    ]
    seen = {name: {"store": True} for name in ("explored", "last_seen")}
    content["floorplan"]["layers"] = {**seen, "costmap": {"store": True, "every": "2 min"}}
    content["users"]["cleo"] = {"behaviors": ["reactions", "meander"]}
    content["robots"]["astro"] |= {"gives_way": {}, "localization": {}}
    content["robots"]["zed"] = {"type": "find", "user": "ana", "every": "2 min", "source": "rtp"}
    on = {"type": "tests.engine.test_events:Heard", "on": ["sensor", "user_lost"]}
    content["algorithms"] |= {
        "rtp": {"type": "real_time_presence"},
        "ltp": {"type": "long_term_presence"},
        "heard": on,
    }
    content["expect"] = {"sees": "eventually(seen(ben, by=astro))", "off": "never(moving(zed))"}
    content["metrics"] |= {"rtp_score": {"of": "rtp"}, "detections": {}, "coverage": {}}
    return content


def routine():
    """The bundled home, with people of a household and a robot that learns where they are."""
    member = {"type": "routine", "household": {"members": {"ana": "works_from_home"}}}
    return {
        "simulation": {"start": "2026-01-05T06:00", "duration": "4 h", "seed": 4},
        "floorplan": {"type": "bundled", "furnish": True},
        "users": {"ana": member},
        "robots": {"astro": {"type": "patrol", "dwell": "1 min"}},
        "sight": {"method": {"type": "flashlight"}},
        "algorithms": {"rtp": {"type": "real_time_presence", "model": "routine"}},
    }


def markov():
    return {
        "simulation": {"start": "2026-01-05T06:00", "duration": "6 h", "seed": 4},
        "floorplan": {"type": "bundled"},
        "users": {"ana": {"type": "room_sampling", "shares": {"kitchen": 0.4, "bedroom": 0.6}}},
        "robots": {"astro": {"behaviors": [{"type": "hangout", "source": "rtp"}]}},
        "algorithms": {
            "rtp": {"type": "real_time_presence", "model": "semi_markov", "period": "5 min"}
        },
    }


LONG = "40 min" if THOROUGH else "20 min"
SCENES = {
    "every behavior": partial(everything, LONG),
    "cameras that err": partial(full, LONG),
    "doors, sensors, layers": house,
    "after every step": partial(every_step, "4 min"),
    "no users": lambda: scenario(LONG, robots={"astro": {"type": "patrol"}}),
    "no robots": lambda: scenario(LONG, users={"ana": {"type": "meander"}}),
    "nobody": lambda: scenario(LONG),
    "a household": routine,
    "chains": markov,
}


@cache
def undisturbed(scene):
    """Return the digests of a run, and its metrics."""
    stored = run(SCENES[scene]())
    return digests(stored), json.dumps(stored.metrics, sort_keys=True)


def result(simulation):
    """Run to the end, and return the same."""
    stored = simulation.run()
    return digests(stored), json.dumps(stored.metrics, sort_keys=True)


def through_a_stream(simulation):
    file = io.BytesIO()
    simulation.save(file)
    file.seek(0)
    return Simulation.load(file)


WAYS = {
    "deepcopy": copy.deepcopy,
    "pickle": lambda simulation: pickle.loads(pickle.dumps(simulation)),
    "save": through_a_stream,
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "way"),
    [
        (scene, way)
        for i, scene in enumerate(SCENES)
        for j, way in enumerate(WAYS)
        if THOROUGH or j in (2, i % 3)
    ],
)
def test_a_copy_made_at_any_step_goes_on_to_the_same_run(scene, way):
    content, draws = SCENES[scene](), random.Random(f"{scene} {way}")
    simulation = Simulation(content)
    steps = sorted(draws.randrange(simulation.clock.steps) for _ in range(2 if THOROUGH else 1))
    for step in [0, *steps] if THOROUGH else steps:
        simulation.run_until(step)
        twin = WAYS[way](simulation)
        assert (step, simulation.seed) == (twin.step, twin.seed)
        assert simulation.state == twin.state
        assert undisturbed(scene) == result(twin), step
    assert undisturbed(scene) == result(simulation)


def test_a_copy_of_a_copy_of_a_copy_goes_on_to_the_same_run():
    scene = "cameras that err"
    simulation, ways = Simulation(SCENES[scene]()), random.Random(scene)
    while not simulation.done:
        simulation.advance(ways.choice([1, 7, 300, 611]))
        simulation = WAYS[ways.choice(list(WAYS))](simulation)
    assert undisturbed(scene) == result(simulation)


@pytest.mark.slow
def test_copies_can_be_changed_without_the_other_noticing():
    simulation = Simulation(house())
    simulation.advance(130)
    twin = copy.deepcopy(simulation)
    twin.do(Put("ana", "kitchen"))
    twin.do(OpenDoor("bath"))
    twin.advance(150)
    assert simulation.state != twin.state
    assert undisturbed("doors, sensors, layers") == result(simulation)
    assert undisturbed("doors, sensors, layers") != result(twin)


@pytest.mark.parametrize("way", WAYS)
def test_a_copy_keeps_what_was_done_and_what_is_still_to_be_done(way):
    content = everything("20 min")
    later = [{"do": "put", "step": 900, "entity": "ben", "to": "kitchen", "heading_deg": 5}]
    simulation = Simulation(content, interventions=later)
    simulation.advance(100)
    simulation.do(Replan("astro"))
    simulation.advance(100)
    twin = WAYS[way](simulation)
    assert ["replan", "put"] == [i["do"] for i in twin.run().manifest["interventions"]]
    assert result(simulation)[0]["run"] == twin.finish().digest


def test_copies_in_memory_share_what_never_changes():
    simulation = Simulation(everything("20 min"))
    simulation.advance(600)
    twin = copy.deepcopy(simulation)
    assert simulation.home.plan is twin.home.plan
    assert simulation.scenario is twin.scenario
    assert simulation.home.walls is twin.home.walls
    ana, copied = (each.actors["ana"] for each in (simulation, twin))
    assert (ana.entity, ana.space) == (copied.entity, copied.space)
    assert ana is not copied


def test_copies_in_memory_share_rows_that_are_not_stored_yet_and_add_their_own():
    simulation = Simulation("bundled:paper", "simulation.duration=1 d", seed=4)
    simulation.run_until("08:00")
    copied = copy.deepcopy(simulation)
    simulation.run_until("10:00")

    rows, others = (s._state.recorder._events for s in (simulation, copied))
    assert len(rows) > len(others) > 0
    assert all(row is other for row, other in zip(rows, others, strict=False))


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("breaks", "words"), [(True, "run failed"), (False, "finished")])
def test_a_run_that_is_over_does_not_go_on_in_a_copy(way, breaks, words):
    bad = {"bad": {"type": "tests.own_components:Bad", "period": "1 min"}}
    simulation = Simulation(scenario("10 min", algorithms=bad if breaks else {}))
    with pytest.raises(ComponentError) if breaks else nullcontext():
        simulation.advance(600)
        simulation.finish()
    with pytest.raises(InputError, match=words):
        WAYS[way](simulation).advance(1)


# --- Files -------------------------------------------------------------------------------------

LOAD = """
import sys, fleet2d
print(fleet2d.Simulation.load(sys.argv[1]).run().digest)
"""


def saved(path, content=None, steps=500):
    """Save a run on its way."""
    simulation = Simulation(everything("20 min") if content is None else content)
    simulation.advance(steps)
    simulation.save(path)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("scene", some(["doors, sensors, layers", "cameras that err"], 2))
def test_another_process_goes_on_from_a_file(scene, tmp_path):
    path = saved(tmp_path / "run.fleet2d", SCENES[scene](), 155)
    done = process("-c", LOAD, str(path), timeout=300, PYTHONHASHSEED="3")
    assert 0 == done.returncode, done.stderr
    assert undisturbed(scene)[0]["run"] == done.stdout.strip()


OWN = """
from fleet2d import Algorithm


class Steps:
    def __init__(self):
        self.count = 0


class Looks(Algorithm):
    def start(self, home):
        self.steps = Steps()

    def update(self, history, state):
        self.steps.count += len(history)
        return {"steps": self.steps.count}
"""

SAVE = """
import json, sys, fleet2d
if sys.argv[2] == "imported before":
    import looks
simulation = fleet2d.Simulation(json.loads(sys.argv[3]))
simulation.advance(300)
simulation.save(sys.argv[1])
print(simulation.run().digest)
"""


@pytest.mark.slow
@pytest.mark.parametrize("module", some(["from the folder", "imported before"], 2))
def test_a_module_may_be_imported_in_one_process_and_from_the_folder_in_the_other(module, tmp_path):
    """The state spoke of looks.Looks, the other process of its own name for the folder's looks."""
    (tmp_path / "looks.py").write_text(OWN)
    path = tmp_path / "run.fleet2d"
    content = json.dumps(scenario(algorithms={"looks": {"type": "looks:Looks"}}))
    whole = process("-c", SAVE, str(path), module, content, cwd=tmp_path)
    assert 0 == whole.returncode, whole.stderr
    done = process("-c", LOAD, str(path), cwd=tmp_path)
    assert 0 == done.returncode, done.stderr
    assert whole.stdout == done.stdout


def test_a_file_of_the_same_state_is_the_same_in_any_process(tmp_path):
    """But for the time that it took until then."""
    one, other = (open_snapshot(saved(tmp_path / name), PURPOSE) for name in "ab")
    assert one[0].keys() == other[0].keys()
    assert one[1].read() == other[1].read()


def test_saving_replaces_a_file_and_leaves_nothing_else(tmp_path):
    path = tmp_path / "run.fleet2d"
    path.write_text("old")
    simulation = Simulation(everything("20 min"))
    simulation.save(path)
    simulation.advance(100)
    simulation.save(str(path))
    assert [path] == list(tmp_path.iterdir())
    assert 100 == Simulation.load(path).step


def test_a_simulation_that_stores_in_a_directory_is_not_saved(tmp_path):
    simulation = Simulation(scenario("2 min"), out=tmp_path / "run")
    for way in WAYS.values():
        with pytest.raises(ArtifactError, match="stores in"):
            way(simulation)
    simulation.finish()


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("nowhere/run", "run can't be written: No such file"),
        ("", "can't be written: Is a directory"),
        ("/", "can't be written: Is a directory"),
    ],
)
def test_a_place_where_nothing_can_be_written_or_read_is_an_error_in_words(tmp_path, name, why):
    with pytest.raises(ArtifactError, match=why):
        Simulation(scenario("2 min")).save(tmp_path / name)
    with pytest.raises(ArtifactError, match=why.replace("written", "read")):
        Simulation.load(tmp_path / name)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\n",
        b"hello",
        b"PK\3\4 a zip",
        MAGIC[:-1] + b"\n\n\n",
        pickle.dumps({"a": 1}),
        bytes(99),
    ],
)
def test_a_foreign_file_is_refused_in_plain_words(tmp_path, content):
    path = tmp_path / "other"
    path.write_bytes(content)
    with pytest.raises(ArtifactError, match="other is not a saved simulation"):
        Simulation.load(path)


def test_a_damaged_file_is_refused_wherever_it_is_damaged(tmp_path):
    path = saved(tmp_path / "run")
    whole, draws = path.read_bytes(), random.Random(5)
    cuts = [1, len(MAGIC) + 1, len(MAGIC) + 99, *(draws.randrange(len(whole)) for _ in range(50))]
    damaged = [whole[:length] for length in cuts]
    places = (draws.randrange(len(whole)) for _ in range(200))
    for place in (0, len(MAGIC), len(MAGIC) + 5, *places):
        content = bytearray(whole)
        content[place] ^= 1 << draws.randrange(8)
        damaged.append(bytes(content))
    for content in (*damaged, whole + b"more"):
        path.write_bytes(content)
        with pytest.raises(ArtifactError, match=r"is damaged|is not a saved simulation"):
            Simulation.load(path)


def file_of(body, seal=None, **changes):
    """Return a file that this user has signed, or that has another seal, whatever is in it."""
    saved = io.BytesIO()
    Simulation(scenario("2 min")).save(saved)
    saved.seek(0)
    header = open_snapshot(saved, PURPOSE)[0] | changes
    content = b"\n".join((MAGIC, json.dumps(header).encode(), body))
    seal = signature(PURPOSE) if seal is None else seal
    seal.update(content)
    return io.BytesIO(content + seal.hexdigest().encode())


def test_a_file_of_another_version_says_which():
    with pytest.raises(ArtifactError, match=r"written by Fleet2D 0\.0\.7, and this is"):
        Simulation.load(file_of(b"", fleet2d="0.0.7"))


@pytest.mark.parametrize(
    "body",
    [b"", b"garbage", pickle.dumps(None), pickle.dumps([1, 2]), pickle.dumps({"a": np.float64})],
)
def test_a_file_without_a_state_is_refused_in_plain_words(body):
    with pytest.raises(ArtifactError, match="no state of a run"):
        Simulation.load(file_of(body))


class Calls:
    """What a pickle makes of it: a call."""

    def __init__(self, function, *arguments):
        self.call = function, arguments

    def __reduce__(self):
        return self.call


SEALS = {
    "a digest": hashlib.sha256,
    "another user's key": lambda: hmac.new(b"another", f"{PURPOSE}\n".encode(), "sha256"),
    "no key": lambda: hmac.new(b"", f"{PURPOSE}\n".encode(), "sha256"),
    "a signature of a checkpoint": lambda: signature(checkpoint.PURPOSE),
}


@pytest.mark.parametrize("seal", SEALS)
def test_a_file_that_this_user_has_not_saved_is_not_unpickled(tmp_path, monkeypatch, seal):
    monkeypatch.chdir(tmp_path)
    body = pickle.dumps(Calls(os.system, "touch made"))
    with pytest.raises(ArtifactError, match="not signed by this user"):
        Simulation.load(file_of(body, SEALS[seal]()))
    assert [] == list(tmp_path.iterdir())


def test_without_a_key_a_simulation_is_not_saved_and_can_be_pickled(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    simulation = Simulation(scenario("2 min"))
    with pytest.raises(ArtifactError, match="no folder for the secrets of this user"):
        simulation.save(tmp_path / "run")
    assert not (tmp_path / "run").exists()
    assert result(pickle.loads(pickle.dumps(simulation))) == result(simulation)


# --- Components that keep things ---------------------------------------------------------------


class Keeps(Algorithm):
    """Keeps something of its own from update to update."""

    what: str

    def start(self, home):
        kept = {
            "file": lambda: open(os.devnull),  # noqa: PTH123, SIM115
            "generator": lambda: (i for i in range(3)),
            "lambda": lambda: lambda: 3,
            "random": lambda: np.random.default_rng(3),
            "plain": lambda: {"a": [1, (2.5, "x")], "b": np.arange(3), "c": {4, 5}, "d": None},
            "objects": lambda: np.array([{"a": 1}, None], object),
            "home": lambda: home,
            "itself": lambda: self,
            "method": lambda: self.update,
        }
        self.kept, self.count = kept[self.what](), 0

    def update(self, history, state):
        self.count += 1
        return {"count": self.count}


def keeping(what):
    own = {"type": f"{__name__}:Keeps", "what": what, "period": "1 min"}
    return scenario("10 min", algorithms={"mine": own}, users={"ana": {"type": "meander"}})


@pytest.mark.parametrize("what", ["plain", "objects", "random", "home", "itself", "method"])
@pytest.mark.parametrize("way", WAYS)
def test_what_a_component_keeps_goes_with_it(what, way):
    simulation = Simulation(keeping(what))
    simulation.advance(301)
    twin = WAYS[way](simulation)
    mine, original = (each.algorithms["mine"] for each in (twin, simulation))
    assert 5 == mine.count
    assert mine is not original
    expected = {"home": twin.home, "itself": mine, "method": mine.update}
    if what in expected:
        assert mine.kept == expected[what]
    if what == "plain":
        assert repr(mine.kept) == repr(original.kept)
    assert simulation.run().digest == twin.run().digest


@pytest.mark.parametrize("what", ["file", "generator", "lambda"])
def test_what_can_not_be_written_is_an_error_in_words(what, tmp_path):
    simulation = Simulation(keeping(what))
    simulation.advance(301)
    with pytest.raises(ArtifactError, match="the state of the run can't be written: "):
        simulation.save(tmp_path / "run")
    assert [] == list(tmp_path.iterdir())
    if what == "file":
        simulation.algorithms["mine"].kept.close()
