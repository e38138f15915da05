"""Layouts of published smart homes: generated logs equal their truth, real ones are read whole."""

import json
import random
import sqlite3
from bisect import bisect_right
from datetime import date, datetime, timedelta

import pytest
from tests.thorough import some

import fleet2d
from fleet2d.logs.layout import read_log
from fleet2d.logs.layouts.aras import ACTIVITIES
from fleet2d.logs.log import AWAY, ActivityLog, LogError
from fleet2d.logs.placement import map_rooms

S = 1_000_000
DAY = datetime(2026, 3, 2)
Stay = tuple[int, int, str, str]  # begin and end [s since midnight of DAY], room, activity
ROOMS = ("kitchen", "bedroom", "bathroom", "living_room")
DOINGS = {"kitchen": "Cook", "bedroom": "Sleep", "bathroom": "Wash", "living_room": "Read"}


# A few lines of each.
EVENTS = """\
2026-03-02 08:00:00.5 bedroom ON Sleep begin
2026-03-02 09:00:00 bedroom OFF Sleep end
2026-03-02 09:10:00 T001 21.5
2026-03-02 09:12:00 kitchen ON
"""
KASTEREN = """\
02-Mar-2026 08:00:00\t02-Mar-2026 08:00:03\t24
02-Mar-2026 08:10:00\t02-Mar-2026 09:00:03\t5
"""
MIT = """\
Toileting,3/2/2026,08:00:00,08:10:00
100,68
Toilet Flush,Kitchen light
08:01:00,08:02:00
08:01:10,08:09:00
"""
OPENSHS = """\
kitchenCarp,bedroomLight,Activity,timestamp
0,1,sleep,2026-03-02 08:00:00
1,0,eat,2026-03-02 08:00:01
"""
HISTORY = """\
[[{"entity_id": "binary_sensor.kitchen", "state": "on", "last_changed": "2026-03-02T08:00:00+00:00"},
  {"state": "off", "last_changed": "2026-03-02T08:01:00+00:00"}],
 [{"entity_id": "person.ana", "state": "not_home", "last_changed": "2026-03-02T09:00:00+00:00"}]]
"""
STATES = """\
entity_id,state,last_changed
binary_sensor.kitchen,on,2026-03-02 08:00:00
person.ana,not_home,2026-03-02 09:00:00
binary_sensor.kitchen,unavailable,2026-03-02 10:00:00
"""


def lives(seed, days=2):
    """Return the truth: stays in rooms and out of the home, one after the other."""
    draw = random.Random(seed)
    stays = []
    at = draw.randrange(600)
    room = ""
    while at < days * 86_400:
        end = min(at + draw.randrange(120, 7200), days * 86_400)
        if draw.random() < 0.15 and room != AWAY:
            stays.append((at, end, AWAY, "Leave_Home"))
            room = AWAY
        else:
            room = draw.choice([name for name in ROOMS if name != room])
            stays.append((at, end, room, DOINGS[room]))
        at = end
    return stays


def stamp(second, text="%Y-%m-%d %H:%M:%S"):
    return (DAY + timedelta(seconds=second)).strftime(text)


def casas(stays, path):
    lines = []
    for begin, end, room, doing in stays:
        if room == AWAY:
            continue
        mark = f" {doing} begin"
        for second in range(begin, end, 60):
            lines.append(f"{stamp(second)}.25 {room} ON{mark}")
            lines.append(f"{stamp(min(second + 5, end - 1))}.5 {room} OFF")
            mark = ""
        lines.append(f"{stamp(end - 1)}.75 {room} OFF {doing} end")
    return written(path / "data", lines)


def kasteren(stays, path):
    text = "%d-%b-%Y %H:%M:%S"
    names = {room: k for k, room in enumerate(ROOMS, 5)}
    doings = {doing: k for k, doing in enumerate([*DOINGS.values(), "leave-house"], 14)}
    sensors, activities = [], []
    for begin, end, room, doing in stays:
        number = doings["leave-house" if room == AWAY else doing]
        activities.append(f"{stamp(begin, text)}\t{stamp(end, text)}\t{number}")
        if room != AWAY:
            sensors.append(f"{stamp(begin, text)}\t{stamp(end - 1, text)}\t{names[room]}\t")
    written(path / "kast_houseB-as.txt", activities)
    written(path / "kast_sensorMapB-ids.txt", [f"{n},pressure mat {r},x" for r, n in names.items()])
    written(path / "kast_actionMapB.txt", [f"{n},{doing}" for doing, n in doings.items()])
    return written(path / "kast_houseB-ss.txt", sensors)


def mit(stays, path):
    rows = []
    for begin, end, room, doing in stays:
        times = [stamp(second, "%H:%M:%S") for second in range(begin, min(end, begin + 600), 60)]
        name = "Leave home" if room == AWAY else doing
        day = f"{(DAY + timedelta(seconds=begin)):%-m/%-d/%Y}"
        rows.append(f"{name},{day},{stamp(begin, '%H:%M:%S')},{stamp(end, '%H:%M:%S')}")
        number = "0" if room == AWAY else str(100 + ROOMS.index(room))
        switches = times[:1] if room == AWAY else times
        rows.append(",".join([number] * len(switches)))
        rows += [",".join(["thing"] * len(switches)), ",".join(switches), ",".join(switches)]
    rooms = [f"{100 + k},{room},thing" for k, room in enumerate(ROOMS)]
    written(path / "sensors.csv", [*rooms, "0,door,Door"])
    return written(path / "activities_data.csv", rows)


CODES = {"Cook": 3, "Sleep": 11, "Wash": 14, "Read": 18, "Leave_Home": 2}


def aras(stays, path):
    codes = [1] * (2 * 86_400)
    for begin, end, _, doing in stays:
        codes[begin:end] = [CODES[doing]] * (end - begin)
    for day in range(2):
        seconds = codes[day * 86_400 : (day + 1) * 86_400]
        written(path / f"DAY_{day + 1}.txt", [f"{'0 ' * 20}27 {code}" for code in seconds])
    return path


def openshs(stays, path):
    head = [*(f"{room}Carp" for room in ROOMS), "mainDoor", "Activity", "timestamp"]
    rows = []
    for begin, end, room, doing in stays:
        for second in range(begin, end, 10):
            on = ["1" if room == name else "0" for name in ROOMS]
            rows.append(",".join([*on, "0", doing, stamp(second)]))
    return written(path / "d1.csv", [",".join(head), *rows])


def table_of_states(stays, path):
    rows = ["entity_id;state;last_changed"]
    for begin, end, room, _ in stays:
        if room == AWAY:
            rows.append(f"person.ana;not_home;{stamp(begin)}")
            rows.append(f"person.ana;home;{stamp(end)}")
            continue
        for second in range(begin, end, 60):
            rows.append(f"binary_sensor.{room}_motion;on;{stamp(second)}")
            rows.append(f"binary_sensor.{room}_motion;off;{stamp(min(second + 5, end - 1))}")
    return written(path / "history.csv", rows)


def room_sensor(stays, path):
    """Write what a sensor tells of Ana's room, beside one of Ben's and a light."""
    rows = ["entity_id,state,last_changed"]
    for begin, _, room, _ in stays:
        rows.append(f"sensor.ana_room,{'not_home' if room == AWAY else room},{stamp(begin)}")
        rows.append(f"sensor.ben_room,{ROOMS[0]},{stamp(begin)}")
        rows.append(f"light.hall,on,{stamp(begin)}")
    return written(path / "history.csv", rows)


def database(stays, path, *, is_old=False):
    """Write the database of Home Assistant; old ones name the entity in each row."""
    file = path / "home-assistant_v2.db"
    lines = table_of_states(stays, path).read_text().splitlines()[1:]
    rows = [line.split(";") for line in lines]
    with sqlite3.connect(file) as db:
        if is_old:
            db.execute(
                "CREATE TABLE states (state_id INTEGER PRIMARY KEY, entity_id, state, last_changed, last_updated)"
            )
            db.executemany("INSERT INTO states VALUES (NULL, ?, ?, NULL, ? || '.000000')", rows)
        else:
            db.execute(
                "CREATE TABLE states_meta (metadata_id INTEGER PRIMARY KEY, entity_id UNIQUE)"
            )
            db.execute(
                "CREATE TABLE states (state_id INTEGER PRIMARY KEY, metadata_id, state, last_changed_ts, last_updated_ts)"
            )
            db.executemany(
                "INSERT OR IGNORE INTO states_meta VALUES (NULL, ?)", [row[:1] for row in rows]
            )
            db.executemany(
                "INSERT INTO states SELECT NULL, metadata_id, ?2, NULL, unixepoch(?3)"
                " FROM states_meta WHERE entity_id = ?1",
                rows,
            )
    db.close()
    (path / "history.csv").unlink()
    return file


def old_database(stays, path):
    return database(stays, path, is_old=True)


def as_history(stays, path):
    """Return the states of each entity with their times, in UTC."""
    rows = [row.split(";") for row in table_of_states(stays, path).read_text().splitlines()[1:]]
    states = {}
    for entity, state, time in rows:
        states.setdefault(entity, []).append((state, datetime.fromisoformat(f"{time}+00:00")))
    return states


def rest_history(stays, path):
    """Write what the REST API answers: of the states between, entity and attributes are left out."""
    content = []
    for entity, states in as_history(stays, path).items():
        times = [{"state": state, "last_changed": time.isoformat()} for state, time in states]
        for end in (0, -1):
            times[end] |= {"entity_id": entity, "attributes": {"friendly_name": "motion"}}
        content.append(times)
    return written(path / "history.json", [json.dumps(content)])


def socket_history(stays, path):
    """Write the message of the WebSocket API; states were updated later than they changed."""
    content = {}
    for entity, states in as_history(stays, path).items():
        content[entity] = [
            {"s": state, "a": {}, "lu": time.timestamp() + 1, "lc": time.timestamp()}
            for state, time in states
        ]
        content[entity][0] = {"s": states[0][0], "lu": states[0][1].timestamp()}
    message = {"id": 2, "type": "result", "success": True, "result": content}
    return written(path / "history.txt", [json.dumps(message, indent=2)])


def written(path, lines):
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


LAYOUTS = {
    "casas": (casas, {}),
    "kasteren": (kasteren, {}),
    "mit": (mit, {}),
    "aras": (aras, {"id": "2"}),
    "openshs": (openshs, {}),
    "states": (table_of_states, {}),
    "room sensor": (room_sensor, {"id": "sensor.ana_room"}),
    "database": (database, {"time_zone": "UTC"}),
    "old database": (old_database, {"time_zone": "UTC"}),
    "REST history": (rest_history, {"time_zone": "UTC"}),
    "WebSocket history": (socket_history, {"time_zone": "UTC"}),
}
# What stands in each layout for the rooms: labels of sensors, or activities.
OF_ACTIVITY = {doing: room for room, doing in DOINGS.items()} | {
    ACTIVITIES[CODES[doing] - 1]: room for room, doing in DOINGS.items()
}


def room_of(label):
    named = (room for room in ROOMS if room in label)
    return OF_ACTIVITY.get(label) or next(named, label)


def at(log, second):
    """Return the room and activity that a log shows last up to a moment."""
    last = log.readings[bisect_right(log.readings, second * S, key=lambda r: r.begin_us) - 1]
    return room_of(last.room), last.activity


@pytest.mark.parametrize("name", LAYOUTS)
@pytest.mark.parametrize("seed", some(range(3), 2))
def test_rooms_stays_and_activities_equal_the_truth(name, seed, tmp_path):
    write, keys = LAYOUTS[name]
    stays = lives(seed)
    log = read_log(write(stays, tmp_path), **keys)

    layout = name if name in ("casas", "kasteren", "mit", "aras", "openshs") else "states"
    assert log.layout == layout
    assert log.first_day in (None, date(2026, 3, 2))
    for begin, end, room, doing in stays:
        if room == AWAY and name == "casas":  # it knows of no absence
            continue
        found, activity = at(log, begin + min(30, (end - begin) // 2))
        assert found == room, (begin, end)
        if log.layout not in ("states", "aras") and room != AWAY:
            assert activity == doing


def test_the_area_of_an_entity_is_its_room_and_one_without_keeps_its_name(tmp_path):
    lines = [
        "entity_id,area,state,last_changed",
        "binary_sensor.0x00158d,Kitchen,on,2026-03-02 08:00:00",
        "binary_sensor.hall_motion,,on,2026-03-02 08:05:00",
    ]
    log = read_log(written(tmp_path / "history.csv", lines))
    assert isinstance(log, ActivityLog)
    assert [reading.room for reading in log.readings] == ["Kitchen", "binary_sensor.hall_motion"]
    rooms = fleet2d.load_floorplan().rooms
    assert map_rooms(log.rooms, {}, rooms) == {
        "Kitchen": ("kitchen",),
        "binary_sensor.hall_motion": ("hallway",),
    }


def test_layouts_are_recognized_by_content_and_folders_by_their_files(tmp_path):
    for name in ("kasteren", "mit", "aras"):
        folder = tmp_path / name
        folder.mkdir()
        write, keys = LAYOUTS[name]
        write(lives(5), folder)
        assert read_log(folder, **keys).layout == name


def test_an_end_before_its_beginning_is_told_of_sensors_and_activities(tmp_path):
    """It was taken for an instant without a note."""
    for kind in ("ss", "as"):
        row = "02-Mar-2026 08:00:00\t02-Mar-2026 07:00:00\t1"
        written(tmp_path / f"kast_houseB-{kind}.txt", [row])

    log = read_log(tmp_path, "kasteren")

    ignored = "an end before the beginning is ignored, in line 1"
    assert log.notes == tuple(f"kast_houseB-{kind}.txt: {ignored}" for kind in ("ss", "as"))
    assert {(r.begin_us, r.end_us) for r in log.readings} == {(8 * 3600 * S, 8 * 3600 * S)}


def test_a_number_with_two_names_is_refused(tmp_path):
    row = "02-Mar-2026 08:00:00\t02-Mar-2026 09:00:00\t1"
    path = written(tmp_path / "kast_houseB-ss.txt", [row])
    written(tmp_path / "kast_sensorMapB.txt", ["1,Fridge,x", "2,Door,x", "1,Fridge,y", "1,Bath,x"])

    with pytest.raises(LogError, match=r"kast_sensorMapB\.txt, line 4: 1 is 'Fridge' already"):
        read_log(path)


def test_an_absence_of_days_is_normal(tmp_path):
    lines = ["02-Mar-2026 08:00:00\t06-Mar-2026 20:00:00\t1"]
    written(tmp_path / "kast_actionMapB.txt", ["1,leave-house"])
    log = read_log(written(tmp_path / "kast_houseB-as.txt", lines))
    assert isinstance(log, ActivityLog)
    assert [(r.room, (r.end_us - r.begin_us) // (3600 * S)) for r in log.readings] == [(AWAY, 108)]


@pytest.mark.parametrize(
    ("name", "line", "message"),
    [
        ("data", "2026-03-02 08:00:00 M001 ON\n2026-03-02 08:00 M001", "line 2: expected date, time"),
        ("data", "2026-03-02 08:00:00Z M001 ON", "line 1: .* has an offset"),
        ("data", "2026-03-02 08:00:00 M001 1\n2026-03-02 08:00:09 M001 0", "expected ON and OFF, got 0, 1"),
        ("data", "2026-03-02 08:00:00 M001 OFF", "no sensor switches on in it; expected ON and OFF$"),
        ("a-ss.txt", "25-Feb-2008 00:19:32\t25-Feb-2008 00:21:24\t17\nx", "line 2: expected a begin"),
        ("a-ss.txt", "25-Fib-2008 00:19:32\t25-Feb-2008 00:21:24\t17", "is not a time"),
        ("a.csv", "Toileting,4/1/2003,17:30:36,17:46:41\n100,68\nFlush,Light\n17:39:37", "block of five"),
        ("a.csv", "Eat,14/1/2003,17:30:36,17:46:41\n1\nx\n17:39:37\n17:39:38", "no such time"),
        ("a.txt", f"{'0 ' * 20}28 1", "two activities from 1 to 27"),
        ("a.csv", "bedCarp,Activity,timestamp\n2,sleep,2016-04-01 08:00:00", "0 or 1 for sensors"),
        ("a.csv", "bedCarp,Activity,timestamp\n1,sleep,2016-04-01 08:00:00+02:00", "has an offset"),
        ("a.csv", "entity_id,state,last_changed\na,on", "line 2: expected 3 values, got 2"),
        ("a.csv", "entity_id,state,last_changed\na,on,yesterday", "expected a time like"),
        ("a.csv", "entity_id,state,last_changed\na,on,2026-03-02T08:00:00Z", "name the home's time_zone"),
        ("a.json", '[[{"entity_id": "a"', "not JSON: .* in line 2, column 1"),
        ("a.json", "[" * 100_000, "can't be read"),
        ("a.json", '{"message": "Not found."}', "expected a history of Home Assistant"),
        ("a.json", '[["on"]]', "state 1: expected a history"),
        ("a.json", '[[{"state": "on", "last_changed": "2026-03-02"}]]', "state 1: expected a history"),
        ("a.json", '{"a.b": [{"s": "on", "lu": 1e300}]}', "state 1: 1e.300 is not a time"),
        ("a.json", '{"a.b": [{"s": "on", "lu": 9}, {"s": "on", "lu": 1}]}', "state 2: the time of a.b"),
        (
            "a.csv",
            "device,value,time\nperson.a,home,2026-03-02 08:00\nperson.b,home,2026-03-02 08:00",
            "several people: choose one by id: person.a, person.b",
        ),
    ],
)  # fmt: skip
def test_a_damaged_log_is_refused_with_the_line(tmp_path, name, line, message):
    keys = {"id": "1"} if "28 1" in line else {}
    if name.endswith(".json"):
        keys = {"time_zone": "UTC"}
    with pytest.raises(LogError, match=message):
        read_log(written(tmp_path / name, line.split("\n")), **keys)


def test_two_residents_are_chosen_by_id(tmp_path):
    aras(lives(1), tmp_path)
    with pytest.raises(LogError, match="two people live there"):
        read_log(tmp_path)
    other = read_log(tmp_path, id="1")
    assert isinstance(other, ActivityLog)
    assert set(other.rooms) == {"Changing Clothes"}


def test_local_times_of_a_history_follow_the_time_zone_through_the_end_of_summer(tmp_path):
    states = [
        {"entity_id": "binary_sensor.hall", "state": state, "last_changed": time}
        for state, time in [
            ("unavailable", "2026-10-24T21:00:00+00:00"),
            ("on", "2026-10-24T23:30:00+00:00"),
            ("unknown", "2026-10-25T00:10:00+00:00"),
            ("on", "2026-10-25T05:30:00+00:00"),
        ]
    ]
    log = read_log(written(tmp_path / "h.json", [json.dumps(states)]), time_zone="Europe/Berlin")
    assert isinstance(log, ActivityLog)
    assert [r.begin_us // (60 * S) for r in log.readings] == [25 * 60 + 30, 30 * 60 + 30]
    assert log.first_day == date(2026, 10, 24)
    assert log.notes == ("left out as unavailable or unknown: 2 states",)


def test_sensors_whose_states_are_rooms_are_named_where_no_id_chooses_one(tmp_path):
    """Ana was nowhere all day: the rooms of her phone were left out, as neither on nor off."""
    rows = ["entity_id,state,last_changed", "sensor.ana_room,kitchen,2026-03-02 08:00:00"]
    path = written(tmp_path / "history.csv", [*rows, "person.ana,home,2026-03-02 08:00:00"])

    words = r"it has sensor\.ana_room: if one tells the room of a person, name it by id"
    with pytest.raises(LogError, match=words):
        read_log(path)


def test_a_sensor_of_a_room_that_is_unavailable_is_a_gap_that_a_note_tells(tmp_path):
    states = [("kitchen", "08:00"), ("unavailable", "09:00"), ("hall", "10:00"), ("hall", "11:00")]
    rows = [f"sensor.ana_room,{state},2026-03-02 {time}:00" for state, time in states]
    path = written(tmp_path / "history.csv", ["entity_id,state,last_changed", *rows])

    log = read_log(path, id="sensor.ana_room")

    assert [("kitchen", 8, 9), ("hall", 10, 11)] == [
        (r.room, r.begin_us // (3600 * S), r.end_us // (3600 * S)) for r in log.readings[:2]
    ]
    assert log.notes == ("left out as unavailable or unknown: 1 state",)


def test_a_stay_that_a_sensor_tells_lasts_until_the_end_of_the_log_days_later(tmp_path):
    rows = ["entity_id,state,last_changed", "sensor.ana_room,kitchen,2026-03-02 08:00:00"]
    path = written(tmp_path / "history.csv", [*rows, "light.hall,on,2026-03-04 09:00:00"])

    readings = read_log(path, id="sensor.ana_room").readings

    assert ["kitchen"] * 3 == [reading.room for reading in readings]
    assert (8 * 3600 * S, 57 * 3600 * S) == (readings[0].begin_us, readings[-1].end_us)


def test_a_database_of_something_else_is_refused(tmp_path):
    """A view could be any query: this one never ends."""
    endless = "WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n)"
    for number, statement in enumerate(
        (
            "CREATE TABLE other (x)",
            f"CREATE VIEW states AS {endless} SELECT k AS entity_id, 'on' AS state,"
            " k AS last_changed, k AS last_updated, k AS state_id FROM n",
        )
    ):
        file = tmp_path / f"{number}.db"
        with sqlite3.connect(file) as db:
            db.execute(statement)
        db.close()
        with pytest.raises(LogError, match="has no table of states"):
            read_log(file)
    broken = tmp_path / "broken.db"
    broken.write_bytes(b"SQLite format 3\0" + bytes(200))
    with pytest.raises(LogError, match="can't be read"):
        read_log(broken)


@pytest.mark.parametrize(
    ("label", "room"),
    [
        ("binary_sensor.kitchen_motion", "kitchen"),
        ("Hall-Bedroom door", "bedroom"),
        ("door", "door"),
        ("Groceries Cupboard", "kitchen"),
        ("livingCarp", "living_room"),
        ("sensor.office_3_presence", "office"),
        ("Washing machine", "laundry"),
    ],
)
def test_labels_are_taken_for_the_rooms_that_their_words_name(label, room):
    (choice,) = map_rooms({label: 1}, {}, fleet2d.load_floorplan().rooms)[label]
    assert choice.startswith(room)


@pytest.mark.parametrize("label", ["M003", "sensor.x"])
def test_labels_without_such_words_are_asked_for(label):
    with pytest.raises(LogError, match="no room of this home stands for"):
        map_rooms({label: 1}, {}, fleet2d.load_floorplan().rooms)


@pytest.mark.parametrize(("home", "days", "absences"), [("A", 28, 33), ("C", 20, 47)])
def test_real_homes_of_kasteren_are_read_whole(shared_data, home, days, absences):
    log = read_log(shared_data / "activity" / "kasteren" / f"kast_house{home}-ss.txt")
    assert isinstance(log, ActivityLog)
    assert (log.days, log.rooms[AWAY]) == (days, absences)
    assert {"sleeping", "take-shower", "prep-dinner"} <= {r.activity for r in log.readings}


def test_a_person_at_work_is_away_until_home(tmp_path):
    places = ["home", "not_home", "Work", "not_home", "home"]
    rows = [f"person.ana,{place},2026-03-02 {8 + k:02}:00:00" for k, place in enumerate(places)]
    path = tmp_path / "states.csv"
    path.write_text("\n".join(["entity_id,state,last_changed", *rows]))

    spans = [(r.begin_us / 3.6e9, r.end_us / 3.6e9) for r in read_log(path).readings]

    assert [(9, 10), (10, 11), (11, 12)] == spans
