"""Schedule: who is where, to the step."""

from datetime import datetime

import numpy as np
import pytest
from tests.scenes import ENTRANCE, OWN, each_step, path, run, scenario, table

import fleet2d
from fleet2d.errors import InputError

START = datetime(2026, 1, 5, 7)  # a Monday


def agenda(*items, on="daily"):
    return {"on": on, "items": list(items)}


def one(*days, duration="1 h", **more):
    """A scenario with one user on a schedule."""
    simulation = more.pop("simulation", {})
    return scenario(
        duration,
        users={"ana": {"type": "schedule", "days": list(days), **more}},
        simulation=simulation,
    )


def rooms(stored):
    """The name of the room at every step, 'away' included."""
    names = [room.name for room in stored.plan.rooms]
    return [names[i] if i >= 0 else "away" for i in path(stored, "ana").room]


def step_of(text, step_s=1.0):
    """The step of a time of day on the first day."""
    moment = datetime.fromisoformat(f"2026-01-05T{text}")
    return round((moment - START).total_seconds() / step_s)


@pytest.fixture(scope="module")
def morning():
    """An hour with every kind of item."""
    return run(
        one(
            agenda(
                {"at": "06:30", "place": "bedroom"},
                {"at": "07:02", "place": "bathroom", "dwell": "4 min", "activity": "wash"},
                {"place": "kitchen", "dwell": "10 min", "activity": "breakfast"},
                {"at": "07:30", "away": True, "activity": "errand"},
                {"at": "07:45:30", "place": [1.0, 3.0], "activity": "read"},
            ),
            rest="living_room",
        )
    )


def departures(stored):
    """The steps after which the body begins to turn or walk."""
    poses = path(stored, "ana")
    moves = (np.diff([poses.x, poses.y, poses.heading]) != 0).any(axis=0)
    return (np.flatnonzero(moves[1:] & ~moves[:-1]) + 1).tolist()


def test_it_begins_where_the_item_before_the_run_leaves_it(morning):
    assert {"bedroom_1"} == set(rooms(morning)[: step_of("07:02") + 1])


def test_it_sets_out_exactly_when_an_item_begins_or_is_over(morning):
    expected = ["07:02", "07:06", "07:16", "07:30", "07:45:30"]
    assert [step_of(text) for text in expected] == departures(morning)


def test_after_a_dwell_with_nothing_due_it_rests(morning):
    assert {"living_room_1"} == set(rooms(morning)[step_of("07:17") : step_of("07:30")])


def test_away_and_back_is_at_one_and_the_same_place(morning):
    poses = path(morning, "ana")
    gone = np.flatnonzero(poses.away)
    assert gone[-1] == step_of("07:45:30") - 1
    assert step_of("07:30") < gone[0] < step_of("07:30:30")
    assert len(gone) == gone[-1] - gone[0] + 1
    before, back = gone[0] - 1, gone[-1] + 1
    assert (poses.x[back], poses.y[back]) == (poses.x[gone[0]], poses.y[gone[0]])
    assert (poses.x[back], poses.y[back]) == pytest.approx(ENTRANCE, abs=0.1)
    assert (poses.x[before], poses.y[before]) == pytest.approx(
        (poses.x[back], poses.y[back]), abs=1.0
    )


def test_events_tell_leaving_coming_home_and_activities_at_their_steps(morning):
    events = table(morning, "events", entity="ana")
    step_of_detail = dict(zip(events["detail"], events["step"], strict=True))
    poses = path(morning, "ana")
    gone = np.flatnonzero(poses.away)
    assert ["left_home", "came_home"] == [e for e in events["event"] if e.endswith("home")]
    assert gone[0] == step_of_detail["errand"]
    for time, activity in (("07:02", "wash"), ("07:06", "breakfast"), ("07:16", "rest")):
        leave, arrive = step_of(time), step_of_detail[activity]
        assert leave < arrive < leave + 30
        assert poses.x[arrive - 1] != poses.x[arrive] == poses.x[arrive + 60]


def test_a_step_that_does_not_divide_the_times_takes_effect_at_the_next_step():
    stored = run(
        one(
            agenda(
                {"at": "06:00", "place": "bedroom"},
                {"at": "07:10:03", "place": "kitchen", "activity": "cook"},
            ),
            simulation={"step": "7 s"},
            duration="20 min",
        ),
        "artifacts.trajectories=7 s",
    )
    # 603 s is between step 86 (602 s) and step 87 (609 s): the body is under way at step 87.
    assert [86] == departures(stored)


@pytest.mark.parametrize(
    ("start", "room"),
    [
        ("2026-01-05T07:30", "kitchen_1"),  # Monday
        ("2026-01-09T23:59", "kitchen_1"),  # Friday
        ("2026-01-10T08:30", "bathroom_1"),  # Saturday
        ("2026-01-11T08:30", "bedroom_1"),  # Sunday: a later entry of the list holds
        ("2026-01-12T06:59", "bedroom_1"),  # Monday before the first item: as on Sunday
    ],
)
def test_agendas_hold_on_their_days(start, room):
    content = one(
        agenda({"at": "07:00", "place": "kitchen"}, on="weekdays"),
        agenda({"at": "08:00", "place": "bathroom"}, on="weekend"),
        agenda({"at": "08:00", "place": "bedroom"}, on="sunday"),
        simulation={"start": start},
        duration="1 min",
    )
    assert room == fleet2d.Simulation(content).state["ana"]["room"]


def test_the_agenda_of_the_next_day_follows_at_midnight():
    stored = run(
        one(
            agenda({"at": "06:00", "place": "kitchen"}, on=["monday", "wednesday"]),
            agenda(
                {"at": "00:00", "place": "bedroom"},
                {"at": "12:00", "place": "bathroom"},
                on="tuesday",
            ),
            duration="3 d",
            simulation={"step": "1 min"},
        )
    )
    names = rooms(stored)

    def at(day, hour):
        return names[(day * 24 + hour - 7) * 60]

    assert ["kitchen_1", "kitchen_1"] == [at(0, 7), at(0, 23)]
    assert "kitchen_1" == at(1, 0)  # it sets out then
    assert ["bedroom_1", "bedroom_1", "bathroom_1"] == [at(1, 1), at(1, 12), at(1, 13)]
    assert ["bathroom_1", "kitchen_1"] == [at(2, 6), at(2, 7)]


@pytest.mark.parametrize(
    ("start", "room"),
    [
        ("2026-01-06T05:59", None),  # Tuesday: at work since Monday
        ("2026-01-06T06:30", "bathroom_1"),  # home, where it rests
        ("2026-01-06T14:30", "kitchen_1"),
        ("2026-01-10T06:30", "bedroom_1"),  # Saturday: an item is due before the work is over
        ("2026-01-11T19:30", None),  # Sunday: away since Saturday
        ("2026-01-11T21:30", "bathroom_1"),
    ],
)
def test_a_dwell_over_midnight_ends_on_a_later_day(start, room):
    content = one(
        agenda(
            {"at": "14:00", "place": "kitchen"},
            {"at": "22:00", "away": True, "dwell": "8 h"},
            on="weekdays",
        ),
        agenda(
            {"at": "05:00", "place": "bedroom"},
            {"at": "20:00", "away": True, "dwell": "1 d"},
            on="saturday",
        ),
        rest="bathroom",
        simulation={"start": start},
        duration="1 min",
    )

    assert room == fleet2d.Simulation(content).state["ana"]["room"]


@pytest.mark.parametrize(
    ("start", "events"),
    [
        ("2026-03-29T01:30", {"tea": "03:00+02:00", "rest": "04:00+02:00", "end": "05:00+02:00"}),
        ("2026-10-25T01:30", {"tea": "02:30+02:00", "rest": "02:30+01:00", "end": "05:00+01:00"}),
    ],
)
def test_a_dwell_lasts_as_long_when_clocks_change(start, events):
    content = one(
        agenda(
            {"at": "02:30", "place": [1.0, 3.0], "dwell": "1 h", "activity": "tea"},
            {"at": "05:00", "place": [1.0, 3.0], "activity": "end"},
        ),
        rest=[1.0, 3.0],
        start=[1.0, 3.0],
        simulation={"start": start, "time_zone": "Europe/Berlin", "step": "1 min"},
        duration="5 h",
    )
    rows = run(content, "artifacts.trajectories=1 min").pandas("events")
    activities = rows[rows["event"] == "activity"]

    times = [f"{time:%H:%M%z}"[:8] + ":00" for time in activities["time"]]
    assert events == dict(zip(activities["detail"], times, strict=True))


def test_a_rest_that_a_change_of_clocks_delays_past_the_next_item_is_left_out():
    content = one(
        agenda(
            {"at": "02:30", "place": [1.0, 3.0], "dwell": "1 h"},
            {"at": "03:45", "place": [1.0, 3.0], "activity": "end"},
        ),
        rest=[1.0, 3.0],
        start=[1.0, 3.0],
        simulation={"start": "2026-03-29T01:30", "time_zone": "Europe/Berlin", "step": "1 min"},
        duration="5 h",
    )
    rows = run(content, "artifacts.trajectories=1 min").pandas("events")

    assert {"end"} == set(rows[rows["event"] == "activity"]["detail"])


def test_an_agenda_that_later_ones_replace_on_each_of_its_days_is_refused():
    content = one(
        agenda({"at": "08:00", "place": "bathroom"}, on="weekend"),
        agenda({"at": "07:00", "place": "kitchen"}, on="daily"),
    )

    with pytest.raises(InputError, match=r"days\.0.*replace it on each of its days"):
        fleet2d.load_scenario(content)


def test_after_another_behavior_had_its_turn_it_goes_where_it_should_be_now():
    schedule = {"type": "schedule", "days": [agenda({"at": "06:00", "place": "kitchen"})]}
    detour = {"type": f"{OWN}:Scripted", "script": ["bedroom", 60]}
    content = scenario(
        "10 min", users={"ana": {"start": "bathroom", "behaviors": [detour, schedule]}}
    )
    names = rooms(run(content))
    assert "bedroom_1" in names
    assert "kitchen_1" == names[-1]


def test_it_does_not_move_when_it_begins_where_it_should_be():
    stored = run(one(agenda({"at": "06:00", "place": "kitchen"}), duration="30 min"))
    poses = path(stored, "ana")
    assert 1 == len(
        set(zip(poses.x.tolist(), poses.y.tolist(), poses.heading.tolist(), strict=True))
    )


def test_a_room_is_entered_at_another_spot_each_time():
    items = [
        {"at": f"07:{minute:02}", "place": ("kitchen", "bathroom")[minute % 4 // 2]}
        for minute in range(0, 60, 2)
    ]
    poses = path(run(one(agenda(*items))), "ana")
    spots = {(poses.x[k], poses.y[k]) for k in range(119, 3600, 120)}
    assert 30 == len(spots)


def test_a_run_may_begin_away():
    items = {"at": "06:00", "away": True}, {"at": "07:10", "place": "kitchen"}
    columns = each_step(one(agenda(*items), duration="30 min"), "ana")
    back = step_of("07:10")
    assert [*range(back)] == np.flatnonzero(columns["away"]).tolist()
    assert np.isnan(columns["x"][:back]).all()
    assert "kitchen_1" == columns["room"][-1]


@pytest.mark.parametrize(
    ("items", "words"),
    [
        ([{"place": "kitchen"}], ["items.0", "at"]),
        ([{"at": "08:00", "place": "kitchen"}, {"place": "bedroom"}], ["items.1", "dwell"]),
        (
            [{"at": "08:00", "place": "kitchen"}, {"at": "07:00", "place": "bedroom"}],
            ["items.1", "07:00", "08:00", "order"],
        ),
        (
            [
                {"at": "08:00", "place": "kitchen", "dwell": "1 h"},
                {"at": "08:30", "place": "bedroom"},
            ],
            ["items.1", "08:30", "09:00"],
        ),
        (
            [{"at": "23:30", "place": "kitchen", "dwell": "1 h"}, {"place": "bedroom"}],
            ["items.1", "24:30", "day"],
        ),
        ([{"at": "24:00", "place": "kitchen"}], ["items.0", "24:00", "day"]),
        ([{"at": "08:00"}], ["place", "away"]),
        ([{"at": "08:00", "place": "kitchen", "away": True}], ["place", "away", "both"]),
        ([], ["items"]),
    ],
)
def test_items_that_do_not_make_a_day_are_refused(items, words):
    with pytest.raises(InputError) as caught:
        fleet2d.load_scenario(one(agenda(*items)))
    for word in ["users.ana.days.0", *words]:
        assert word in str(caught.value)


@pytest.mark.parametrize("on", ["moonday", ["weekdays", "holidays"], []])
def test_days_that_are_none_are_refused(on):
    with pytest.raises(InputError, match="on"):
        fleet2d.load_scenario(one(agenda({"at": "08:00", "place": "kitchen"}, on=on)))


def test_an_unreachable_room_is_refused_before_the_run():
    item = {"at": "08:00", "place": "storage_1", "dwell": "1 h"}
    with pytest.raises(InputError, match=r"schedule\.days.*storage_1") as caught:
        fleet2d.Simulation(one(agenda(item), start="kitchen"))
    assert "users.ana" in str(caught.value)


def test_time_is_told_to_the_step_when_the_run_begins_within_a_minute():
    content = one(
        agenda({"at": "06:00", "place": "bedroom"}, {"at": "07:00:30", "place": "kitchen"}),
        simulation={"start": "2026-01-05T07:00:12"},
        duration="2 min",
    )
    assert [18] == departures(run(content))


def test_nobody_stirs_at_midnight():
    content = one(
        agenda({"at": "06:00", "place": "living_room"}, {"at": "22:00", "place": "bedroom"}),
        simulation={"start": "2026-01-05T23:50"},
        duration="20 min",
    )
    assert [] == departures(run(content))


def test_all_items_that_were_due_on_the_way_over_midnight_come_in_order():
    content = one(
        agenda(
            {"at": "00:00:01", "place": "bathroom", "activity": "first"},
            {"at": "00:00:02", "place": "kitchen", "activity": "second"},
            {"at": "20:00", "place": "living_room"},
            {"at": "23:59:58", "place": "bedroom", "activity": "bed"},
        ),
        simulation={"start": "2026-01-05T23:50"},
        duration="30 min",
        speed=0.2,
    )
    assert ["bed", "first", "second"] == table(run(content), "events")["detail"].tolist()


@pytest.mark.parametrize(("activity", "is_noted"), [("", True), ("cook", False)])
def test_an_activity_that_goes_on_where_an_item_has_none_is_noted(activity, is_noted):
    """Who slept until eight slept on in the kitchen, and nobody was told."""
    sleeps = {"at": "00:00", "place": "bedroom", "activity": "sleep"}
    cooks = {"at": "08:00", "place": "kitchen", "activity": activity}
    out = {"at": "09:00", "away": True}
    stored = run(one(agenda(sleeps, cooks, out)))

    notes = stored.manifest["notes"]
    assert is_noted == any("has no activity" in note for note in notes)


def test_an_activity_that_began_before_the_run_is_known_from_its_first_step():
    sleeps = {"at": "06:00", "place": "bedroom", "activity": "sleep"}
    stored = run(one(agenda(sleeps)))

    assert ["sleep"] == table(stored, "events", event="activity")["detail"].tolist()
