"""Lights of rooms: switched by scripts and by people, and what a camera misses in the dark."""

import pytest
from tests.scenes import digests, run, scenario, table

import fleet2d
from fleet2d.errors import InputError
from fleet2d.interventions import HoldStill, SwitchLights

CAMERA = {"range": [0.2, 6], "angle_deg": 360}
NIGHT = {"start": "2026-01-05T22:00"}


def watched(*script, ana=None, **sections):
    """A run in which Ana sits in the kitchen, where a robot stands and sees her."""
    days = [{"items": [{"at": "00:00", "place": [6.5, 3.1], "activity": "read"}]}]
    return run(
        scenario(
            "20 min",
            simulation=NIGHT | sections.pop("simulation", {}),
            users={"ana": {"type": "schedule", "days": days, **(ana or {})}},
            robots={"astro": {"start": [5.6, 1.0], "camera": CAMERA, **sections.pop("astro", {})}},
            script=list(script),
            **sections,
        )
    )


def seen(stored, first, last):
    """Return at how many steps the robot saw Ana between two times after 22 o'clock."""
    steps = table(stored, "observations")["step"]
    begin, end = (60 * int(t[3:]) for t in (first, last))
    return int(((steps >= begin) & (steps < end)).sum())


def switched(stored, kind):
    """Return at which steps which rooms were switched."""
    rows = table(stored, "events", event=kind)
    return rows["step"].tolist(), rows["detail"].tolist()


def test_lights_off_people_in_the_room_are_noticed_a_fifth_as_often():
    stored = watched(
        {"at": "22:05", "lights": "kitchen", "turn": "off"},
        {"at": "22:15", "lights": "kitchen_1", "turn": "on"},
    )
    assert seen(stored, "22:00", "22:05") == 300
    assert 80 < seen(stored, "22:05", "22:15") < 160
    assert seen(stored, "22:15", "22:20") == 300
    off, on = ([300], ["kitchen_1"]), ([900], ["kitchen_1"])
    assert (off, on) == (switched(stored, "light_off"), switched(stored, "light_on"))


def unlit(share):
    """A robot that notices so large a share of those who are in the dark."""
    return {"perception": {"detection": {"unlit": share}}}


def evening(day, time="19:00"):
    """Dark in December and light in June; the default of `unlit` says dark."""
    return {"start": f"2026-{day}T{time}", "daylight": {"latitude": 52.52, "noon": "12:06:23"}}


@pytest.mark.parametrize(
    ("rooms", "simulation", "astro", "least", "most"),
    [
        ("bedroom", {}, {}, 1200, 1200),
        ("all", {"start": "2026-01-05T12:00"}, {}, 1200, 1200),
        ("all", {}, unlit(0.0), 0, 0),
        ("all", {}, unlit(1.0), 1200, 1200),
        ("all", evening("06-21"), {}, 1200, 1200),
        ("all", evening("12-21"), {}, 150, 330),
        ("all", evening("12-21"), unlit(0.0), 0, 0),
    ],
    ids=[
        "elsewhere",
        "by day",
        "blind in the dark",
        "as good in the dark",
        "in summer",
        "in winter",
        "a curve of its own goes before daylight",
    ],
)
def test_how_many_of_1200_looks_notice_ana_in_a_room_without_light(
    rooms, simulation, astro, least, most
):
    off = {"at": "0 s", "lights": rooms, "turn": "off"}
    stored = watched(off, simulation=simulation, astro=astro)

    assert least <= seen(stored, "22:00", "22:20") <= most


@pytest.mark.parametrize(
    ("day", "time", "expected"),
    [("06-21", "19:00", []), ("12-21", "19:00", [1]), ("12-21", "15:50", range(180, 300))],
    ids=["light", "dark", "sunset is at 15:54"],
)
def test_lights_in_the_dark_are_on_from_sunset_to_sunrise(day, time, expected):
    stored = watched(ana={"lights": "dark"}, simulation=evening(day, time))
    steps, _ = switched(stored, "light_on")

    assert len(steps) == bool(expected)
    assert all(step in expected for step in steps)


DAY = [
    {"at": "22:00", "place": "living_room"},
    {"at": "22:05", "place": "kitchen", "dwell": "3 min"},
    {"place": "bedroom", "activity": "sleep"},
]


def people(**simulation):
    """An evening of Ana, who switches lights, and Ben, who is in the kitchen from 22:06 on."""
    ben = [{"at": "21:00", "place": "living_room"}, {"at": "22:06", "place": "kitchen"}]
    user = {"type": "schedule", "lights": "18:00-23:30"}
    return scenario(
        "30 min",
        simulation=NIGHT | simulation,
        users={
            "ana": {**user, "days": [{"items": DAY}]},
            "ben": {**user, "lights": "22:20-07:00", "days": [{"items": ben}]},
        },
        robots={"astro": {"camera": CAMERA, "type": "patrol"}},
    )


def test_people_have_the_light_on_where_they_are_awake_and_off_where_they_leave():
    """Ben, for whom it isn't dark before 22:20, leaves the light on that Ana switched on."""
    simulation = fleet2d.Simulation(people())
    simulation.run_until("22:03")
    assert (
        simulation.home.rooms[min({0, 1, 2, 3, 4} - simulation.home.unlit)].name == "living_room_1"
    )
    stored = simulation.run()
    on, off = (list(zip(*switched(stored, f"light_{turn}"), strict=True)) for turn in ("on", "off"))
    assert {"bedroom_1", "living_room_1", "kitchen_1"} <= {room for _, room in on}
    assert (306, "kitchen_1") in on
    assert "kitchen_1" not in {room for _, room in off}, "Ben is still there"


def test_people_sleep_in_the_dark_and_lie_in_the_light_after_a_fall():
    home = {"type": "bundled", "furnish": True}
    evening = {"start": "2026-01-05T21:00", "duration": "3 h", "seed": 4}
    ana = {"type": "routine", "persona": "works_outside", "lights": "17:00-08:00"}
    simulation = fleet2d.Simulation(
        {"simulation": evening, "floorplan": home, "users": {"ana": ana}}
    )
    simulation.run_until("21:10")
    simulation.do(HoldStill("ana", duration="30 min", posture="lie"))
    simulation.run_until("21:30")
    here = simulation.actors["ana"].home.plan.room(simulation.state["ana"]["room"]).index
    lit = {room.index for room in simulation.home.rooms} - simulation.home.unlit
    assert {here} == lit, "she had it on when she fell"
    simulation.run_until("23:50")  # she sleeps
    assert len(simulation.home.unlit) == len(simulation.home.rooms)


def test_lights_are_switched_by_hand_and_a_note_says_where_events_are_not_stored():
    simulation = fleet2d.Simulation(people())
    simulation.run_until("22:10")
    simulation.do(SwitchLights("kitchen", "off"))
    assert switched(simulation.run(), "light_off")[0][-1] == 600
    alone = fleet2d.Simulation(scenario(users={"ana": "meander"}))
    alone.do(SwitchLights("kitchen", "off"))
    stored = alone.run()
    assert [] == switched(stored, "light_off")[0]
    assert any("announce them, like script:" in note for note in stored.manifest["notes"])


def test_lights_are_the_same_for_every_span_and_after_resuming(tmp_path):
    content = people(daylight={"latitude": 52.5})
    content["users"]["ana"]["lights"] = "dark"
    whole = digests(run(content))
    assert whole == digests(run(content, max_span=7))
    simulation = fleet2d.Simulation(content)
    simulation.run_until("22:07")
    simulation.save(tmp_path / "half")
    assert whole == digests(fleet2d.Simulation.load(tmp_path / "half").run())
    resolved = fleet2d.load_scenario(fleet2d.load_scenario(content).resolved())
    assert fleet2d.load_scenario(content).users["ana"].lights == resolved.users["ana"].lights


def test_light_of_a_room_or_kind_is_an_expectation():
    stored = watched(
        {"at": "22:05", "lights": "kitchen", "turn": "off"},
        expect={
            "dark": "after(events(light_off), not light(kitchen), within=1 s)",
            "lit": "always(light(kitchen_1))",
            "any": "always(light(bedroom))",
        },
    )
    verdicts = stored.manifest["expectations"]
    assert [True, False, True] == [verdicts[name]["holds"] for name in ("dark", "lit", "any")]


@pytest.mark.parametrize(
    ("script", "ana", "message"),
    [
        ([{"lights": "kitchn", "turn": "off"}], {}, "no room 'kitchn': did you mean 'kitchen'"),
        ([{"lights": "kitchen"}], {}, "turn"),
        ([{"lights": "kitchen", "turn": "dim"}], {}, "turn"),
        ([], {"lights": "dark"}, r"lights.*simulation\.daylight"),
        ([], {"lights": "darkness"}, r"lights.*17:00-08:00', or dark"),
    ],
)
def test_unknown_rooms_turns_and_hours_are_refused(script, ana, message):
    with pytest.raises(InputError, match=message):
        watched(*({"at": "22:05", **change} for change in script), ana=ana)
