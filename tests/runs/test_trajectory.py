"""The path rebuilt from key frames is the path that was simulated, at every step and exactly."""

from dataclasses import fields
from datetime import timedelta
from functools import cache

import numpy as np
import pyarrow.parquet as pq
import pytest
from tests.thorough import some

import fleet2d
from fleet2d import Behavior, Simulation
from fleet2d.entities.entity import Robot
from fleet2d.errors import ArtifactError
from fleet2d.interventions import Put
from fleet2d.runs.trajectory import PathReader, Trajectory

TWO_ROOMS = {"order": "random", "dwell": "20 s", "rooms": ["living_room", "kitchen", "hallway"]}
COMMUTER = {
    "type": "schedule",
    "days": [
        {
            "items": [
                {"at": "00:00:07", "place": "kitchen", "dwell": "3 min"},
                {"at": "00:10", "away": True, "activity": "work"},
                {"at": "00:19:59.3", "place": "living_room"},
                {"at": "00:30", "away": True},
                {"at": "00:30:30", "place": "bathroom", "dwell": "1 min"},
                {"at": "11:58", "away": True},
                {"at": "12:05", "place": "kitchen", "dwell": "2 min"},
                {"at": "12:15", "place": "bedroom"},
                {"at": "23:50", "away": True},
            ]
        }
    ],
}


class Greeter(Behavior):
    """Go from room to room; turn to whoever comes into view, and stay while somebody is."""

    rooms: tuple[str, ...] = ("living_room", "kitchen", "bathroom", "office")

    def start(self, actor):
        self.round = 0

    def decide(self, now):
        if any(event.event == "user_seen" for event in now.events):
            event = now.events[-1]
            return now.plan().go_to((event.x, event.y)).interrupt_on("user_lost")
        self.round += 1
        plan = now.plan().interrupt_on("user_seen", "user_lost")
        for ahead in range(3):
            plan.go_to(self.rooms[(self.round + ahead) % len(self.rooms)]).stay(
                timedelta(seconds=9)
            )
        return plan


class Startled(Behavior):
    """Wander at random, and stand still for a moment when somebody comes into view."""

    def start(self, actor):
        self.walk = actor.entity.behaviors[1].model_copy()
        self.walk.start(actor)

    def decide(self, now):
        if now.events:
            return now.plan().turn_by(0.4).stay(timedelta(seconds=4.5))
        plan = now.plan().meander(self.walk.rule)
        return plan.interrupt_on("user_seen") if isinstance(now.actor.entity, Robot) else plan


class Stranger(Startled):
    """Wander by a rule that no behavior of its body has."""

    def start(self, actor):
        self.walk = actor.entity.behaviors[1].model_copy(update={"turn_std_deg": 60.0})
        self.walk.start(actor)


GREETER = {"behaviors": [{"type": f"{__name__}:Greeter"}]}
STARTLED = {"behaviors": [{"type": f"{__name__}:Startled"}, {"type": "meander"}]}
BODIES = {
    "schedule with away": ({"ana": COMMUTER}, {}),
    "schedule, seen on patrol": ({"ana": COMMUTER}, {"astro": {"type": "patrol", **TWO_ROOMS}}),
    "patrol without looking around": (
        {},
        {"astro": {"type": "patrol", "dwell": "0 s", "look_around": False}},
    ),
    "meander": ({"ana": {"type": "meander"}}, {"astro": {"type": "meander"}}),
    "meander in two bodies of a kind": (
        {"ana": {"type": "meander"}, "bo": {"type": "meander", "turn_std_deg": 60}},
        {},
    ),
    "interrupted by sight": ({"ana": {"type": "meander"}, "bo": COMMUTER}, {"astro": GREETER}),
    "random walk interrupted": ({"ana": {"type": "meander"}}, {"astro": STARTLED}),
    "nothing to do": ({"ana": {"behaviors": []}}, {"astro": {"behaviors": [], "camera": None}}),
}
MOMENTS = {"midnight": "2026-01-05", "midday": "2026-01-05T11:57:03", "evening": "2026-01-05T23:44"}


@cache
def run_of(bodies, start="midnight", step="1 s", *more):
    """Run two hours and a bit, every step of it stored."""
    users, robots = BODIES[bodies]
    scenario = {
        "simulation": {"start": MOMENTS[start], "duration": "2.2 h", "step": step, "seed": 11},
        "floorplan": {"type": "bundled"},
        "users": users,
        "robots": robots,
        "artifacts": {"trajectories": "every step"},
    }
    return fleet2d.run(scenario, *more)


def assert_rebuilt(run, stride=1):
    """Compare the rebuilt path of every body with the stored poses."""
    every = timedelta(microseconds=stride * run.manifest["step_us"])
    stored = run.pandas("trajectories")
    for name, truth in stored[stored["step"] % stride == 0].groupby("entity", observed=True):
        path = run.path(name, every=every)
        for column in ("step", "time", "away", "heading"):
            np.testing.assert_array_equal(truth[column], getattr(path, column), name)
        np.testing.assert_array_equal(truth["room"].cat.codes, path.room, name)
        for column in ("x", "y"):
            result = np.where(path.away, np.nan, getattr(path, column))
            np.testing.assert_array_equal(truth[column], result, name)


@pytest.mark.parametrize("bodies", BODIES)
@pytest.mark.parametrize("step", some(["1 s", "0.5 s", "7 s"], 3))
def test_every_step_is_rebuilt(bodies, step):
    assert_rebuilt(run_of(bodies, step=step))


@pytest.mark.parametrize("bodies", BODIES)
@pytest.mark.parametrize("start", ["midday", "evening"])
def test_run_that_starts_within_a_day_is_rebuilt(bodies, start):
    assert_rebuilt(run_of(bodies, start))


@pytest.mark.parametrize("bodies", BODIES)
@pytest.mark.parametrize("stride", [7, 60, 10_000])
def test_every_so_many_steps_is_rebuilt(bodies, stride):
    assert_rebuilt(run_of(bodies), stride)


@pytest.mark.parametrize("bodies", BODIES)
@pytest.mark.parametrize(("stride", "part"), [(1, 1000), (7, 999), (60, 61), (10_000, 500)])
def test_parts_of_a_path_are_those_of_the_whole(bodies, stride, part):
    run = run_of(bodies)
    every = timedelta(seconds=stride)
    for name in [*run.manifest["entities"]["users"], *run.manifest["entities"]["robots"]]:
        reader = PathReader(run, run.plan, name)

        parts = [reader.read(k, k + part, every) for k in range(0, reader.clock.steps, part)]

        whole = run.path(name, every)
        for field in fields(Trajectory):
            joined = np.concatenate([getattr(path, field.name) for path in parts])
            np.testing.assert_array_equal(getattr(whole, field.name), joined, field.name)


@pytest.mark.parametrize("bodies", BODIES)
@pytest.mark.parametrize("span", some([13, 1], 2))
def test_spans_do_not_show(bodies, span):
    run = run_of(bodies, "midnight", "1 s", f"simulation.max_span={span}")
    assert_rebuilt(run)
    assert run_of(bodies).digest == run.digest


def test_interruptions_happened_and_were_recorded():
    run = run_of("interrupted by sight")
    keys = run.pandas("key_frames")
    assert (keys["kind"] == "planned").sum() > 10
    walks = run_of("random walk interrupted").pandas("key_frames")
    assert {"walk", "track"} <= set(walks["kind"])


@pytest.mark.parametrize("bodies", BODIES)
@pytest.mark.parametrize("steps", [1, 1234])
def test_run_that_was_cut_short_is_rebuilt(bodies, steps):
    users, robots = BODIES[bodies]
    simulation = Simulation(
        {
            "simulation": {"start": MOMENTS["midday"], "duration": "2 h", "seed": 3},
            "floorplan": {"type": "bundled"},
            "users": users,
            "robots": robots,
            "artifacts": {"trajectories": "every step"},
        }
    )
    simulation.advance(steps)
    run = simulation.finish()
    assert steps == run.manifest["steps"]
    assert_rebuilt(run)


@pytest.mark.parametrize(
    ("entity", "every", "message"),
    [
        ("bob", 60.0, "there is no 'bob'"),
        ("ana", 0.5, "not a multiple of simulation.step"),
        ("ana", 0.0, "not a multiple of simulation.step"),
    ],
)
def test_what_can_not_be_rebuilt_is_told(entity, every, message):
    run = run_of("schedule with away")
    with pytest.raises(ArtifactError, match=message):
        run.path(entity, every=timedelta(seconds=every))


def test_run_without_key_frames_says_so():
    run = run_of("schedule with away", "midnight", "1 s", "artifacts.key_frames=false")
    with pytest.raises(ArtifactError, match="no key frames"):
        run.path("ana")


def test_walk_by_unknown_rules_is_refused_not_guessed():
    simulation = {"duration": "3 h", "seed": 1}
    stranger = {"behaviors": [{"type": f"{__name__}:Stranger"}, {"type": "meander"}]}
    scenario = {"simulation": simulation, "floorplan": {"type": "bundled"}}
    run = fleet2d.run({**scenario, "users": {"ana": stranger}})
    with pytest.raises(ArtifactError, match="ana from step 0 on can't be rebuilt"):
        run.path("ana")


@pytest.mark.parametrize("objects", [{}, {"door": {"type": "door", "doorway": "bathroom_1"}}])
@pytest.mark.parametrize("at", [(1,), (3600,), (300, 300, 4000)])
def test_a_person_who_walks_at_random_can_be_put_elsewhere(objects, at):
    """Before, the stored run couldn't be rebuilt, and so had no picture."""
    simulation = Simulation(
        {
            "simulation": {"start": "2026-01-05T08:00", "duration": "90 min", "seed": 1},
            "floorplan": "bundled",
            "users": {"ana": "meander", "ben": "meander"},
            "objects": objects,
            "artifacts": {"trajectories": "every step"},
        }
    )
    for step, room in zip(at, ("kitchen", "bathroom", "office"), strict=False):
        simulation.run_until(timedelta(seconds=step))
        simulation.do(Put("ana", room))
    run = simulation.run()
    assert_rebuilt(run)
    room = run.plan.rooms[int(run.path("ana", every=timedelta(seconds=1)).room[at[0]])]
    assert "kitchen" == room.type or len(at) > 1


def test_key_frames_out_of_order_are_damaged(tmp_path):
    """The kernel's refusal was shown as a traceback."""
    fleet2d.run("bundled:paper", "simulation.duration=2 h", seed=4, out=tmp_path / "run")
    path = tmp_path / "run" / "key_frames.parquet"
    table = pq.read_table(path)
    pq.write_table(table.take(np.random.default_rng(1).permutation(table.num_rows)), path)
    with pytest.raises(ArtifactError, match=r"can't be followed .* it is damaged"):
        fleet2d.open_run(tmp_path / "run").path("astro")


def test_times_between_poses_are_durations_or_texts():
    run = fleet2d.run("bundled:paper", "simulation.duration=10 min", seed=4)

    apart = run.path("ana", every="10 s")
    assert apart.x.tolist() == run.path("ana", timedelta(seconds=10)).x.tolist()
    for text, message in (("often", "expected a duration"), ("1.5 s", "not a multiple")):
        with pytest.raises(ArtifactError, match=message):
            run.path("ana", every=text)
