"""Replay: where the log says kitchen, the body is in the kitchen at that second."""

import re
from datetime import datetime, timedelta

import numpy as np
import pytest
from tests.scenes import OWN, each_step, path, run, scenario, table

from fleet2d.engine.simulation import Simulation
from fleet2d.errors import InputError
from fleet2d.interventions import Replan
from fleet2d.logs.layout import read_log

# 2020-03-02, and the run of scenario() begins at 07:00 of a day.
DAY = "2020-03-02"


def events(folder, rows):
    """Write a CASAS log: time of day, room, activity."""
    file = folder / "events.txt"
    file.write_text("".join(f"{DAY} {t} {room} {room} ON {what}\n" for t, room, what in rows))
    return file


def adls(folder, rows):
    """Write a UCI ADL log of activities: begin, end, activity."""
    file = folder / "Home_ADLs.txt"
    file.write_text("".join(f"{DAY} {a}\t{DAY} {b}\t{what}\n" for a, b, what in rows))
    return file


def replay(path, duration="30 min", **keys):
    simulation = {"start": keys.pop("start", f"{DAY}T07:00"), **keys.pop("simulation", {})}
    user = {"type": "replay", "path": str(path), **keys}
    return scenario(duration, users={"ben": user}, simulation=simulation)


def at(clock):
    hours, minutes, seconds = (int(part) for part in clock.split(":"))
    return (hours - 7) * 3600 + minutes * 60 + seconds


def rooms_of(content):
    """The kind of room at each step, None while away."""
    columns = each_step(content, "ben")
    rooms = [str(room).rpartition("_")[0] for room in columns["room"]]
    return [None if gone else room for room, gone in zip(rooms, columns["away"], strict=True)]


def notes(stored):
    return [str(detail) for detail in table(stored, "events", event="replay")["detail"]]


def events_named(stored, *names):
    rows = table(stored, "events", entity="ben")
    columns = (rows[name] for name in ("step", "event", "detail"))
    return [row for row in zip(*columns, strict=True) if row[1] in names]


MORNING = [
    ("07:00:00.4", "Bedroom", "Sleep"),
    ("07:05:00", "Bedroom", "Sleep"),
    ("07:05:12", "Kitchen", "Cook"),
    ("07:06:00", "Kitchen", "Eat"),
    ("07:06:01", "LivingRoom", "Relax"),
    ("07:06:01.9", "Bathroom", "Wash"),
    ("07:20:00", "Bathroom", "Wash"),
]


def test_at_each_reading_the_body_is_in_its_room(tmp_path):
    rooms = rooms_of(replay(events(tmp_path, MORNING)))
    assert {"bedroom"} == set(rooms[: at("07:05:00") + 1])
    assert "kitchen" == rooms[at("07:05:12")] == rooms[at("07:06:00")]
    # Of two rooms in one second the later reading counts.
    assert {"bathroom"} == set(rooms[at("07:06:01") : at("07:20:00") + 1])
    assert {None} == set(rooms[at("07:20:01") :])


def test_the_report_says_what_was_mapped_dropped_hurried_and_is_unknown(tmp_path):
    content = replay(events(tmp_path, MORNING), rooms={"LivingRoom": None})
    assert [
        "events.txt, layout casas: 7 readings of 1 day from 2020-03-02",
        "Bathroom: taken for bathroom, 2 readings",
        "Bedroom: taken for bedroom, 2 readings",
        "Kitchen: taken for kitchen, 2 readings",
        "LivingRoom: left out, 1 readings",
        "nobody knows where it is in 1 gaps, 0.2 h in all",
    ] == notes(run(content))[:6]
    assert re.match("1 of 2 walks are faster than the body walks", notes(run(content))[6])
    yielded = "1 readings yield to later ones of another room in their step"
    assert yielded in notes(run(replay(events(tmp_path, MORNING))))


def test_it_walks_at_its_own_speed_where_the_log_leaves_time(tmp_path):
    content = replay(
        events(tmp_path, [("07:00:00", "Bedroom", ""), ("07:04:00", "Kitchen", "")]), "5 min"
    )
    poses = path(run(content), "ben")
    move = np.sqrt(np.diff(poses.x) ** 2 + np.diff(poses.y) ** 2)
    moving = np.flatnonzero(move > 0)
    assert 0.9 < move[moving].max() < 1.001
    assert moving[-1] + 1 in (239, 240)  # there just in time
    assert moving[-1] - moving[0] < 40


def test_intervals_that_abut_are_left_early_and_begin_on_time(tmp_path):
    log = adls(
        tmp_path,
        [
            ("07:00:00", "07:10:00", "Sleeping"),
            ("07:10:00", "07:20:00", "Breakfast"),
            ("07:20:00", "07:25:00", "Leaving"),
            ("07:26:00", "07:30:00", "Showering"),
        ],
    )
    stored = run(replay(log))
    rooms = rooms_of(replay(log))
    assert "bathroom" == rooms[at("07:26:00")]
    assert {"bedroom"} == set(rooms[: at("07:09:20")])
    assert {"kitchen"} == set(rooms[at("07:10:00") : at("07:19:20")])
    assert [
        (at("07:20:00"), "left_home", ""),
        (at("07:25:00"), "came_home", ""),
    ] == events_named(stored, "left_home", "came_home")


def test_who_begins_last_holds_and_what_outlasts_it_holds_again(tmp_path):
    log = adls(
        tmp_path, [("07:00:00", "07:30:00", "Sleeping"), ("07:10:00", "07:15:00", "Toileting")]
    )
    rooms = rooms_of(replay(log))
    assert ["bedroom", "bathroom", "bathroom", "bedroom", "bedroom"] == [
        rooms[at(clock)] for clock in ("07:09:00", "07:10:00", "07:14:30", "07:15:00", "07:29:59")
    ]


GAP = [("07:00:00", "Bedroom", "Sleep"), ("07:12:00", "Kitchen", "Cook")]


def test_a_gap_is_unknown_and_not_made_up(tmp_path):
    content = replay(events(tmp_path, GAP), "15 min")
    rooms = rooms_of(content)
    assert [
        (1, "unknown", ""),
        (at("07:12:00"), "known", "kitchen"),
        (at("07:12:01"), "unknown", ""),
    ] == events_named(run(content), "unknown", "known", "left_home", "came_home")
    assert ["bedroom", None, "kitchen", None] == [
        rooms[k] for k in (0, at("07:11:59"), at("07:12:00"), at("07:12:01"))
    ]


@pytest.mark.parametrize(("gaps", "middle"), [("hold", "bedroom"), ("walk", "kitchen")])
def test_a_gap_is_filled_only_if_asked(tmp_path, gaps, middle):
    rooms = rooms_of(replay(events(tmp_path, GAP), "13 min", gaps=gaps))
    assert middle == rooms[at("07:05:00")]
    assert None not in rooms[: at("07:12:00") + 1]


def test_silence_in_one_room_is_no_gap_up_to_a_limit(tmp_path):
    log = events(tmp_path, [("07:00:00", "Bedroom", "Sleep"), ("07:25:00", "Bedroom", "Sleep")])
    assert "bedroom" == rooms_of(replay(log))[at("07:12:00")]
    assert rooms_of(replay(log, still="20 min"))[at("07:12:00")] is None


def test_silence_after_the_front_door_until_it_opens_again_is_being_out(tmp_path):
    log = events(
        tmp_path,
        [
            ("07:00:00", "Bedroom", ""),
            ("07:02:00", "OutsideDoor", ""),
            ("07:02:05", "OutsideDoor", ""),
            ("07:20:00", "OutsideDoor", ""),
            ("07:21:00", "Kitchen", ""),
        ],
    )
    stored = run(replay(log))
    assert [
        (at("07:02:06"), "left_home", ""),
        (at("07:20:00"), "came_home", ""),
        (at("07:21:01"), "unknown", ""),
    ] == events_named(stored, "unknown", "known", "left_home", "came_home")


@pytest.mark.parametrize(
    ("day", "start", "kitchen"),
    [
        (0, "2026-01-05T07:00", True),
        (1, "2026-01-05T07:00", False),
        ("date", "2020-03-03T07:00", False),
        ("weekday", "2026-01-05T07:00", True),  # both are Mondays
        ("weekday", "2026-01-06T07:00", False),
    ],
)
def test_the_run_begins_on_the_day_of_the_log_that_is_asked_for(tmp_path, day, start, kitchen):
    file = tmp_path / "events.txt"
    file.write_text(
        "2020-03-02 07:00:00 Kitchen Kitchen ON Cook\n2020-03-03 07:00:00 Bedroom Bedroom ON Sleep\n"
    )
    rooms = rooms_of(replay(file, "1 min", day=day, start=start))
    assert ("kitchen" if kitchen else "bedroom") == rooms[0]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"rooms": {"Bedrom": "kitchen"}}, "has no room 'Bedrom': did you mean 'Bedroom'"),
        ({"rooms": {"Bedroom": "kichen"}}, "no such room: did you mean 'kitchen'"),
        ({"rooms": {"Bedroom": "storage"}}, "'storage' can't be reached"),
        ({"day": 3}, "day 3 of the log, which has the days 0 to 0"),
        ({"day": "date", "start": "2026-01-05T07:00"}, "which has the days 0 to 0"),
        ({"path": "nowhere.txt"}, "no such file or folder"),
        ({"gaps": "guess"}, "unknown.*hold.*walk"),
    ],
)
def test_what_does_not_fit_is_refused_with_what_would(tmp_path, keys, message):
    content = replay(events(tmp_path, MORNING))
    content["users"]["ben"] |= {k: v for k, v in keys.items() if k != "start"}
    content["simulation"]["start"] = keys.get("start", f"{DAY}T07:00")
    with pytest.raises(InputError, match=message):
        run(content)


def test_a_label_that_no_room_stands_for_is_refused_by_name(tmp_path):
    log = events(tmp_path, [("07:00:00", "Sauna", "Relax")])
    message = (
        r"users.ben: no room of this home stands for 'Sauna' \(readings in the log: 1\); choose"
    )
    with pytest.raises(InputError, match=message):
        run(replay(log))


@pytest.mark.parametrize("layout", ["rooms", "positions"])
def test_no_span_and_no_step_length_changes_what_is_replayed(tmp_path, layout):
    log = events(tmp_path, MORNING) if layout == "rooms" else fixes(tmp_path, ZIGZAG)
    one = run(replay(log, "10 min"))
    assert one.digest == run(replay(log, "10 min"), "simulation.max_span=1").digest
    assert one.digest == run(replay(log, "10 min"), "simulation.max_span=37").digest
    coarse = run(replay(log, "10 min", simulation={"step": "7 s"}), "artifacts.trajectories=7 s")
    assert "complete" == coarse.manifest["status"]


def test_after_another_behavior_it_walks_to_where_the_log_has_it(tmp_path):
    content = replay(events(tmp_path, MORNING))
    detour = {"type": f"{OWN}:Scripted", "script": ["living_room", 320]}
    user = content["users"]["ben"]
    content["users"]["ben"] = {"behaviors": [detour, user], "start": "living_room"}
    rooms = rooms_of(content)
    assert "living_room" == rooms[at("07:05:12")]
    assert ["kitchen", "bathroom"] == [rooms[at("07:06:00")], rooms[at("07:06:01")]]
    poses = path(run(content), "ben")
    leave = slice(at("07:05:15"), at("07:05:50"))
    assert np.hypot(np.diff(poses.x), np.diff(poses.y))[leave].max() < 1.01


def test_asked_anew_in_the_middle_it_goes_on_as_the_log_says(tmp_path):
    simulation = Simulation(replay(events(tmp_path, MORNING)))
    for minute in (2, 5.25, 6, 12):
        simulation.run_until(timedelta(minutes=minute))
        simulation.do(Replan("ben"))
    simulation.run_until(timedelta(minutes=20))
    assert "bathroom_1" == simulation.state["ben"]["room"]


# Real logs


KINDS = {
    "Bedroom": "bedroom", "Kitchen": "kitchen", "Bathroom": "bathroom", "Living": "living_room",
    "LivingRoom": "living_room", "LoungeChair": "living_room", "WorkArea": "living_room",
    "bedroom": "bedroom", "bathroom": "bathroom", "dining_room": "kitchen",
    "home_office": "living_room", "away": None,
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("log", "start"),
    [
        ("casas_al/events_10_days.txt", "2011-06-15"),
        ("uci_adl_a", "2011-11-28"),
        ("homer_plus_a", "2026-01-05"),
    ],
)
def test_at_each_reading_of_a_real_log_the_user_is_in_its_room(shared_data, log, start):
    file = shared_data / "activity" / log
    rooms = {"dining_room": "kitchen", "home_office": "living_room"} if "homer" in log else {}
    visited = rooms_of(replay(file, "10 d", start=start, rooms=rooms))
    # Of two rooms in one second the later reading counts.
    last = {reading.begin_us // 10**6: reading.room for reading in read_log(file).readings}
    known = {step: room for step, room in last.items() if step < len(visited) and room in KINDS}
    wrong = [step for step, room in known.items() if visited[step] != KINDS[room]]
    assert len(known) > 150
    assert [] == wrong


# Positions


def fixes(folder, rows, name="rtls.csv"):
    """Write fixes: seconds since 07:00, x, y."""
    file = folder / name
    text = "".join(
        f"{datetime(2020, 3, 2, 7) + timedelta(seconds=t)},{x},{y}\n" for t, x, y in rows
    )
    file.write_text("time,x,y\n" + text)
    return file


ZIGZAG = [(0, 1, 1), (10, 3.9, 1), (20, 1, 3), (30, 4, 3), (90, 7, 3), (100, 7, 1)]


def test_it_is_at_each_fix_when_the_log_says_and_straight_between(tmp_path):
    poses = path(run(replay(fixes(tmp_path, ZIGZAG), "3 min")), "ben")
    for t, x, y in [*ZIGZAG, (60, 5.5, 3.0)]:
        assert (x, y) == pytest.approx((poses.x[t], poses.y[t]), abs=1e-3)
    assert not poses.away[:101].any()
    assert poses.away[101:].all()  # what comes after the last fix, nobody knows


def test_between_two_fixes_with_a_wall_between_it_goes_through_the_door(tmp_path):
    kitchen, living = (6.0, 1.0), (4.0, 1.0)
    stored = run(replay(fixes(tmp_path, [(0, *living), (20, *kitchen)]), "1 min"))
    poses = path(stored, "ben")
    assert (kitchen, living) == ((poses.x[20], poses.y[20]), (poses.x[0], poses.y[0]))
    crossing = int(np.flatnonzero(poses.x[:21] > 5.0)[0])
    assert 2.6 < poses.y[crossing] < 3.6  # the door
    assert "1 legs go around a wall" in notes(stored)[-1]


def test_fixes_in_walls_are_moved_off_and_those_outside_the_home_left_out(tmp_path):
    log = fixes(tmp_path, [(0, 4.98, 1), (10, 4, 1), (20, 40, 1), (30, 2, 3)])
    stored = run(replay(log, "40 s"))
    poses = path(stored, "ben")
    assert 4.7 < poses.x[0] < 4.81
    assert poses.x.max() < 5
    lines = notes(stored)
    assert "1 fixes are outside the home and left out" in lines
    assert "1 fixes are moved to the nearest place where the body fits" in lines


def test_a_log_of_positions_most_of_which_are_outside_the_home_is_refused(tmp_path):
    centimetres = fixes(tmp_path, [(0, 400, 100), (10, 200, 300), (20, 2, 3)])

    with pytest.raises(
        InputError, match=r"2 of 3 fixes are more than 1 m outside.*correct 'frame'"
    ):
        run(replay(centimetres, "40 s"))


def test_a_gap_between_fixes_is_unknown_held_or_walked(tmp_path):
    log = fixes(tmp_path, [(0, 1, 1), (5, 1, 1), (600, 4, 1)])
    stored = run(replay(log, "11 min"))
    assert [(6, "unknown"), (600, "known")] == [
        row[:2] for row in events_named(stored, "unknown", "known")
    ]
    assert path(stored, "ben").away[6:600].all()
    for gaps, expected in (("hold", [1, 1, 4]), ("walk", [2.5, 3.95, 4])):
        poses = path(run(replay(log, "11 min", gaps=gaps)), "ben")
        assert expected == pytest.approx(poses.x[[302, 590, 600]].tolist(), abs=0.05)


def test_a_frame_of_its_own_gives_the_same_life(tmp_path):
    plain = run(replay(fixes(tmp_path, ZIGZAG), "2 min"))
    # In feet, turned by a quarter, from another corner.
    rows = [(t, (y - 2) / 0.3048, -(x - 1) / 0.3048) for t, x, y in ZIGZAG]
    log = fixes(tmp_path, rows, "other.csv")
    told_by = {"scale": 0.3048, "rotation_deg": 90, "origin": [1, 2]}
    matches = [
        {"log": [u, v], "plan": [x, y]}
        for (_, u, v), (_, x, y) in zip(rows[:3], ZIGZAG[:3], strict=True)
    ]
    for frame in (told_by, {"matches": matches}):
        same = run(replay(log, "2 min", frame=frame))
        a, b = path(plain, "ben"), path(same, "ben")
        assert a.x == pytest.approx(b.x, abs=2e-3)
        assert a.y == pytest.approx(b.y, abs=2e-3)
    assert any("fits its 3 matches to 0.00 m" in note for note in notes(same))


def test_legs_too_fast_to_be_true_are_reported_and_still_on_time(tmp_path):
    log = fixes(tmp_path, [(0, 1, 1), (0.5, 1, 1.1), (1, 4.5, 1), (10, 4.5, 1)])
    stored = run(replay(log, "20 s"))
    assert 4.5 == pytest.approx(path(stored, "ben").x[1], abs=1e-3)
    assert "1 fixes are left out: one in a step is enough" in notes(stored)
    assert "1 legs are too fast to be true, up to 3.5 m/s: check the frame and the times" in notes(
        stored
    )
