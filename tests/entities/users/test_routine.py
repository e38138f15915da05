"""Routine: a persona lives in a home, alone and with others."""

import copy
import itertools
import json

import numpy as np
import pytest
from tests.routines.days import MONDAY
from tests.scenes import OWN, digests, path, run, scenario, table
from tests.thorough import some

import fleet2d
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import InputError
from fleet2d.routines.activity import catalogue
from fleet2d.routines.persona import bundled_names

HOME = {"floorplan": {"type": "bundled", "furnish": True}}
FAMILY = {
    "members": {"ana": "works_outside", "ben": "works_from_home", "cleo": "child"},
    "couples": [["ana", "ben"]],
    "together": {"dinner": {"at": "18:45", "spread": "10 min", "on": "daily", "takes": "35 min"}},
}
# Everybody is up at night, and often.
RESTLESS = {
    "sleep": {
        **catalogue()["sleep"].model_dump(mode="json", exclude_none=True),
        "fetches": "1 h 30 min",
        "fetches_from": ["bathroom", "toilet", "any"],
        "fetch_takes": "4 min",
    }
}
SHORT = {
    "needs": {},
    "errands": {},
    "days": {
        "any_day": {
            "on": "daily",
            "wake": {"at": "07:00", "spread": "1 min"},
            "do": {
                "breakfast": {"on_waking": True, "takes": "20 min"},
                "errand": {"at": "08:00", "fixed": True, "takes": {"law": "fixed", "mean": "1 h"}},
            },
            "leisure": {"read": 1},
        }
    },
}


def lives(persona="works_outside", duration="1 d", **more):
    """A scenario with one user who has a routine."""
    sections = {k: more.pop(k) for k in ("simulation", "robots", "floorplan") if k in more}
    user = {"type": "routine", "persona": persona, **more}
    return scenario(duration, users={"ana": user}, **sections)


def family(duration="2 d", **household):
    shared = {**FAMILY, **household}
    users = {name: {"type": "routine", "household": shared} for name in shared["members"]}
    return {**scenario(duration, users=users), **HOME}


@pytest.mark.parametrize("name", bundled_names())
def test_every_persona_that_comes_along_lives_in_a_small_flat(name):
    details = table(run(lives(name, "2 d")), "events", event="activity")["detail"]
    assert {"sleep"} < set(details)


@pytest.mark.parametrize("span", some([7, 1], 2))
def test_every_table_is_the_same_for_every_max_span(span):
    content = family("45 min", away=[["2026-01-05T07:30", "2026-01-05T07:36"]])
    content["users"]["rex"] = {"type": "pet"}
    content["users"]["dan"] = {"type": "population"}
    content["users"]["eve"] = {
        "type": "room_sampling",
        "shares": {"kitchen": 1, "bedroom": 2, "away": 1},
    }
    content["robots"] = {"astro": {"type": "patrol", "dwell": "1 min"}}
    content["simulation"]["start"] = "2026-01-05T07:00"
    assert digests(run(content)) == digests(run(content, max_span=span))


def test_a_life_does_not_depend_on_who_else_there_is():
    alone = lives()
    crowd = copy.deepcopy(alone)
    crowd["users"]["ben"] = {"type": "routine", "persona": "student"}
    crowd["robots"] = {"astro": {"type": "patrol"}}
    one, other = path(run(alone), "ana"), path(run(crowd), "ana")
    assert (one.x == other.x).all()
    assert (one.heading == other.heading).all()


def test_it_does_what_its_day_says_when_it_says_so():
    stored = run(lives(SHORT, "3 h", simulation={"start": "2026-01-05T06:30"}))
    done = table(stored, "events", entity="ana", event="activity")["detail"]
    assert ["sleep", "breakfast"] == done[:2].tolist()
    gone = np.flatnonzero(path(stored, "ana").away)
    leave, back = 90 * 60, 150 * 60  # 08:00 to 09:00, and the way to the door
    assert leave < gone[0] < leave + 30
    assert back - 1 == gone[-1]


@pytest.mark.parametrize("pace", [0.5, 2.0])
def test_it_walks_at_the_pace_of_its_persona(pace):
    start = {"start": "2026-01-05T06:30"}
    poses = path(run(lives({**SHORT, "pace": pace}, "1 h", simulation=start)), "ana")
    moved = np.hypot(np.diff(poses.x), np.diff(poses.y))
    assert pace == pytest.approx(moved.max(), rel=0.04)


def test_small_moves_can_be_switched_off():
    still, restless = (
        run(lives({"extends": "retired", "leisure": {"read": 1}}, "1 d", small_moves=moves))
        for moves in (False, True)
    )

    def stirs(stored):
        heading = path(stored, "ana").heading
        return int((np.diff(heading) != 0).sum())

    assert stirs(still) < stirs(restless)
    details = [list(table(s, "events", event="activity")["detail"]) for s in (still, restless)]
    assert details[0] == details[1]


def test_an_activity_is_done_at_its_furniture_in_its_posture():
    stored = run({**lives("works_from_home", "2 d"), **HOME})
    used = table(stored, "events", event="uses")["detail"]
    assert {"bed", "desk", "stove", "sofa"} <= {name.rpartition("_")[0] for name in used}


def test_a_couple_shares_a_bed_and_the_child_has_its_own():
    simulation = Simulation(family())
    beds = {n: a.behaviors[0].venues["sleep"].seats for n, a in simulation.actors.items()}
    assert beds["ana"][0].thing == beds["ben"][0].thing != beds["cleo"][0].thing
    assert beds["ana"] != beds["ben"]


def test_each_bathroom_is_used_by_one_at_a_time():
    simulation = Simulation(
        family(members={f"user_{i}": "works_outside" for i in range(4)}, couples=[])
    )
    actors = list(simulation.actors.values())
    waited = {}
    for ordinal in range(MONDAY, MONDAY + 60):
        busy = sorted(
            (episode.room, episode.begin, episode.end, actor.name)
            for actor in actors
            for episode in actor.behaviors[0].day(ordinal)
            if episode.activity in ("wash", "shower", "toilet", "wash_hands")
        )
        for (room, _, end, name), (other_room, begin, _, other) in itertools.pairwise(busy):
            if room == other_room:
                assert end <= begin
                waited[room] = waited.get(room, 0) + (end == begin and name != other)
    bathrooms = {r.index for r in simulation.home.rooms if r.type == "bathroom"}
    assert bathrooms == set(waited)  # each of the two has a queue of its own
    assert sum(waited.values()) > 10  # or nobody was ever in the way


def test_on_holiday_nobody_is_at_home_and_a_visitor_only_when_visiting():
    content = family("2 d", away=[["2026-01-05T08:00", "2026-01-06T06:00"]])
    visit = ["2026-01-05T12:00", "2026-01-05T20:00"]
    content["users"]["eve"] = {"type": "routine", "persona": "retired", "visits": [visit]}
    stored = run(content)
    hour = np.arange(48 * 3600) / 3600 + 7
    for name in FAMILY["members"]:
        assert path(stored, name).away[(hour > 8.1) & (hour < 30)].all()
    eve = path(stored, "eve").away
    assert eve[(hour < 12) | (hour > 20.1)].all()
    assert not eve[(hour > 12.01) & (hour < 13)].all()


def test_after_another_behavior_had_its_turn_it_goes_on_with_its_day():
    detour = {"type": f"{OWN}:Scripted", "script": ["kitchen", 60]}
    routine = {"type": "routine", "persona": SHORT}
    content = scenario(
        "20 min", users={"ana": {"start": "bathroom", "behaviors": [detour, routine]}}
    )
    details = table(run(content), "events", entity="ana", event="activity")["detail"]
    assert "breakfast" in details


@pytest.mark.parametrize(
    ("user", "words"),
    [
        ({"persona": "retierd"}, ["persona", "retierd", "did you mean 'retired'"]),
        ({"persona": 3}, ["persona", "works_outside"]),
        ({"persona": {"extends": "retired", "activities": {"read": {"rooms": ["sauna"]}}}}, ["sauna", "The rooms are"]),
        ({"persona": "retired", "household": FAMILY}, ["household", "persona"]),
        ({"household": FAMILY, "own_places": True}, ["own", "leave out own_places"]),
        ({"household": FAMILY, "away": [["2026-01-06", "2026-01-07"]]}, ["'trips' and 'visits'"]),
        ({"household": {**FAMILY, "members": {"ben": "retired"}, "couples": []}}, ["no member", "ben"]),
        ({"household": {**FAMILY, "together": {"dinner": {"at": "18:00"}}}}, ["dinner", "'on' or 'dates'"]),
    ],
)  # fmt: skip
def test_settings_without_a_possible_day_are_refused(user, words):
    content = scenario(users={"ana": {"type": "routine", **user}})
    with pytest.raises(InputError) as caught:
        Simulation(content)
    for word in ["users.ana", *words]:
        assert word in str(caught.value)


def test_a_persona_comes_from_a_file_beside_the_scenario_and_is_stored_whole(tmp_path):
    (tmp_path / "ana.yaml").write_text("extends: retired\npace: 0.5\ndays: {sunday: null}\n")
    (tmp_path / "home.yaml").write_text(
        "extends: bundled:paper\nusers: {ana: {type: routine, persona: ana.yaml}}\n"
    )
    loaded = fleet2d.load_scenario(tmp_path / "home.yaml", "simulation.duration=1 h")
    persona = loaded.users["ana"].behaviors[0].persona
    assert (0.5, ["every_day"]) == (persona.pace, list(persona.days))
    (tmp_path / "ana.yaml").unlink()
    assert loaded == fleet2d.load_scenario(loaded.resolved())


def test_a_bundled_persona_is_stored_by_its_name():
    resolved = fleet2d.load_scenario(lives("child")).resolved()
    assert "child" == resolved["users"]["ana"]["behaviors"][0]["persona"]


@pytest.mark.parametrize(("hour", "away"), [("03:00", False), ("11:00", True)])
def test_it_begins_where_the_hour_of_a_working_day_suggests(hour, away):
    content = lives(simulation={"start": f"2026-01-07T{hour}"})
    assert away == Simulation(content).state["ana"]["away"]


def test_nobody_comes_into_the_bathroom_while_another_is_there():
    persona = {"extends": "works_outside", "activities": RESTLESS}
    members = dict.fromkeys(("ana", "ben", "cleo", "dan"), persona)
    users = {n: {"type": "routine", "household": {"members": members}} for n in members}
    stored = run(scenario("7 d", users=users))
    bathroom = stored.plan.room_at(6, 5.5).index
    inside = np.stack([path(stored, name).room == bathroom for name in members])
    night = (np.arange(inside.shape[1]) // 3600 + 7) % 24 < 6
    assert inside[:, night].any(axis=1).all()
    together = inside.sum(axis=0) > 1
    # One leaves as the other enters: ways through the door, of some seconds.
    edges = np.flatnonzero(np.diff(together, prepend=False, append=False))
    assert max(np.diff(edges)[::2], default=0) < 30


def test_a_plan_goes_on_over_midnight_without_telling_it_twice():
    once = {"extends": "works_outside", "needs": {"pick_up": None}}  # twice in a row, if at all
    stored = run(lives(once, duration="4 d"))
    details = table(stored, "events", entity="ana", event="activity")
    assert all(a != b for a, b in itertools.pairwise(details["detail"].tolist()))
    assert not (details["step"] % 86400 == 17 * 3600).any()  # it begins at 07:00: that is midnight


def test_nobody_goes_through_a_wall_to_furniture_out_of_reach(tmp_path):
    outline = [[0, 0], [4, 0], [4, 1], [4.1, 1], [4.1, 0], [6, 0], [6, 3], [4.1, 3], [4.1, 1.3],
               [4, 1.3], [4, 3], [0, 3]]  # fmt: skip
    sofa = {"type": "sofa", "footprint": [[4.8, 0.5], [5.6, 0.5], [5.6, 2.5], [4.8, 2.5]]}
    seat = {"x": 5.0, "y": 1.5, "heading": 3.14, "posture": "sit"}
    flat = {"format": "fleet2d-floorplan", "version": 1, "free": [{"outline": outline}],
            "rooms": [{"type": "living_room", "polygon": outline}],
            "objects": [{**sofa, "uses": [seat, {**seat, "x": 4.5, "posture": "stand"}]}]}  # fmt: skip
    (tmp_path / "flat.json").write_text(json.dumps(flat))
    plan = {"type": "native", "path": str(tmp_path / "flat.json")}
    stored = run({**lives("retired"), "floorplan": plan})
    way = path(stored, "ana")
    assert np.nanmax(way.x) < 4.1


def test_what_is_done_behind_a_locked_door_is_left_out_until_it_is_unlocked():
    """A day of somebody who works in an office, whose door is locked from 07:10 to 11:00."""
    door = {"type": "door", "doorway": "office_1"}
    script = [{"at": "10 min", "shut": "office"}, {"at": "10 min", "lock": "office"}]
    script.append({"at": "4 h", "unlock": "office"})
    life = {**lives("works_from_home"), **HOME, "objects": {"office": door}, "script": script}
    events = run(life).pandas("events")
    blocked = events[events["event"] == "way_blocked"]
    assert {"work_at_home"} == set(blocked["detail"])
    assert len(blocked) < 30
    assert blocked["time"].dt.hour.max() < 11
    done = events[events["event"] == "activity"]
    assert {"breakfast", "lunch", "dinner"} <= set(done["detail"])
    assert done["time"][done["detail"] == "work_at_home"].dt.hour.min() >= 11


def test_people_without_a_household_are_told_once_that_they_share_seats():
    """Two users of one flat stood on one place for 140 minutes a day, without a word."""
    users = {name: {"type": "routine"} for name in ("ana", "ben", "cleo")}
    alike = fleet2d.run(scenario("1 min", users=users)).manifest["notes"]
    assert [note for note in alike if "household" in note] == [
        "users.ben.household: none, and ana has none either: they may use the same seat or spot at"
        " the same time. People who live together have, in place of a persona, household: {members:"
        " {ana: works_outside, ben: works_outside}}; who only shares a home has own_places: true"
    ]
    apart = {name: {**user, "own_places": True} for name, user in users.items()}
    for content in (family("1 h"), scenario("1 h", users=apart)):
        assert not any("household" in note for note in Simulation(content).notes)
