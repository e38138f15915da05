"""Runs in a time zone: spans, stored offsets, exports, logs, daylight, and what is refused."""

import json
from datetime import UTC, datetime, timedelta
from io import BytesIO

import pytest
from tests.change_nights import nights
from tests.thorough import some

import fleet2d
from fleet2d import InputError, Simulation
from fleet2d.engine.repeat import reproduce
from fleet2d.logs.layout import read_log
from fleet2d.runs.moments import step_of
from fleet2d.runtime import local_time
from fleet2d.runtime.clock import Sun
from fleet2d.scenario.load import load_scenario

BERLIN = "simulation.time_zone=Europe/Berlin"
AUTUMN = "simulation.start=2026-10-24T23:00"
SPRING = "simulation.start=2026-03-28T23:00"


@pytest.mark.parametrize("start", [AUTUMN, SPRING])
def test_household_lives_through_both_nights_the_same_for_every_span(start):
    """With all that a robot learns, and darkness."""
    overrides = [BERLIN, start, "simulation.duration=5 h", "simulation.step=5 s"]
    overrides += ["users.pat={type: population}", "simulation.daylight={latitude: 52.5}"]
    overrides += ["algorithms.learned={type: real_time_presence, model: learned, period: 10 min}"]
    digests = {
        span: fleet2d.run("bundled:family", *overrides, seed=4, max_span=span).digest
        for span in (None, *some([77, 1], 2))
    }
    assert len(set(digests.values())) == 1


@pytest.mark.parametrize("zone", ["UTC", "Asia/Tokyo", "Etc/GMT+12"])
def test_zone_without_changes_is_a_run_without_zone_but_for_its_stamps(zone):
    """Over New Year, also twelve hours behind UTC."""
    overrides = ["simulation.start=2026-12-31T20:00", "simulation.duration=6 h"]
    plain = fleet2d.run("bundled:family", *overrides, seed=4)
    zoned = fleet2d.run("bundled:family", *overrides, f"simulation.time_zone={zone}", seed=4)
    assert plain.tables.keys() == zoned.tables.keys()
    for name in plain.tables:
        frame = zoned.pandas(name)
        frame["time"] = frame["time"].dt.tz_localize(None)
        assert frame.equals(plain.pandas(name)), name
    assert zoned.clock.time(4 * 3600).isoformat()[:19] == "2027-01-01T00:00:00"


def test_rules_of_another_year_and_of_a_clock_put_back_over_midnight_run():
    """In Newfoundland, the second half past eleven belongs to the day before."""
    night = nights("America/St_Johns", 2010)[1]
    zone = ["simulation.time_zone=America/St_Johns", f"simulation.start={night.begin.isoformat()}"]
    overrides = [*zone, "simulation.duration=2 d", "simulation.step=10 s"]
    run = fleet2d.run("bundled:family", *overrides, seed=4)
    asleep = [e["time"] for e in run.arrow("events").to_pylist() if e["detail"] == "sleep"]
    assert len({time.date() for time in asleep}) >= 2


def test_run_is_repeated_and_read_by_the_offsets_that_it_stored(tmp_path, monkeypatch):
    """On a machine with other rules, or none."""
    overrides = [BERLIN, AUTUMN, "simulation.duration=5 h"]
    run = fleet2d.run("bundled:family", *overrides, seed=4, out=tmp_path / "run")
    stored = run.manifest["scenario"]["simulation"]["time_zone"]
    assert stored["changes"] == [["2026-10-25T01:00:00Z", 3600]]

    def no_rules(*_):
        raise KeyError("Europe/Berlin")

    monkeypatch.setattr(local_time, "_zone_of", no_rules)
    again = fleet2d.open_run(tmp_path / "run")
    assert again.clock.time(4 * 3600).isoformat() == "2026-10-25T02:00:00+01:00"
    assert reproduce(tmp_path / "run").digest == run.digest
    with pytest.raises(InputError, match="there is no time zone 'Europe/Berlin'"):
        load_scenario("bundled:family", *overrides)


def test_damaged_offsets_of_a_manifest_are_refused(tmp_path):
    """With the key that is wrong."""
    fleet2d.run("bundled:paper", BERLIN, "simulation.duration=1 min", out=tmp_path / "run")
    path = tmp_path / "run" / "manifest.json"
    content = json.loads(path.read_text())
    content["scenario"]["simulation"]["time_zone"]["changes"] = [["soon", 3600]]
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match=r"scenario\.simulation\.time_zone does not fit the start"):
        fleet2d.open_run(tmp_path / "run")


def test_state_saved_in_the_second_hour_goes_on_in_it():
    """As a copy, and as a file."""
    simulation = Simulation("bundled:family", BERLIN, AUTUMN, "simulation.duration=6 h", seed=4)
    simulation.run_until("2026-10-25T02:30+01:00")
    assert simulation.time.isoformat() == "2026-10-25T02:30:00+01:00"
    file = BytesIO()
    simulation.save(file)
    file.seek(0)
    loaded = Simulation.load(file)
    assert loaded.time.isoformat() == "2026-10-25T02:30:00+01:00"
    assert loaded.run().digest == simulation.run().digest


def test_exports_have_offsets(tmp_path):
    """CSV and JSON Lines in local time; Parquet and Arrow in instants with the zone."""
    run = fleet2d.run("bundled:family", BERLIN, AUTUMN, "simulation.duration=5 h", seed=4)
    from fleet2d.live.exporters import Selection
    from fleet2d.live.exporters.texts import export_csv, export_jsonl

    part = Selection.of(run, every="1 h")
    export_csv(run, tmp_path / "a.csv", part)
    lines = (tmp_path / "a.csv").read_text().splitlines()
    times = [*dict.fromkeys(line.split(",")[1] for line in lines)]
    assert times[-2:] == ['"2026-10-25T02:00:00+02:00"', '"2026-10-25T02:00:00+01:00"']
    export_jsonl(run, tmp_path / "a.jsonl", part)
    begin = datetime(2026, 10, 24, 21, tzinfo=UTC)
    for line in (tmp_path / "a.jsonl").read_text().splitlines():
        row = json.loads(line)
        if row["time"]:
            moment = datetime.fromisoformat(row["time"])
            assert begin + timedelta(seconds=row["step"]) == moment
    assert str(run.arrow("events").schema.field("time").type) == "timestamp[us, tz=Europe/Berlin]"


def test_stamps_of_ros_are_utc(tmp_path):
    """Also of a run that begins in the second hour."""
    pytest.importorskip("rosbags")
    start = "simulation.start=2026-10-25T02:10+01:00"
    run = fleet2d.run("bundled:paper", BERLIN, start, "simulation.duration=1 min", seed=4)
    from fleet2d.live.exporters import Records, Selection
    from fleet2d.live.exporters.ros import RosMessages

    first = next(iter(RosMessages(Records(run, Selection.of(run)))))
    assert first.time == 1792890600 * 10**9


def sensor(folder, rows, **keys):
    """Return a home in Berlin in the night of 25 hours, with a door that is logged."""
    path = folder / "door.csv"
    path.write_text(f"time,state\n{rows}")
    log = {"type": "replay_sensor", "path": str(path), "room": "hallway", "day": "date", **keys}
    return {
        "simulation": {
            "start": "2026-10-24T22:00",
            "duration": "11 h",
            "time_zone": "Europe/Berlin",
        },
        "floorplan": {"type": "bundled"},
        "objects": {"door": log},
    }


UTC_ROWS = """2026-10-24T20:00:00Z,CLOSE
2026-10-25T00:50:00Z,OPEN
2026-10-25T01:10:00Z,CLOSE
2026-10-25T06:00:00Z,OPEN
2026-10-25T06:05:00Z,CLOSE
"""
LOCAL_ROWS = """2026-10-24 22:00,CLOSE
2026-10-25 02:50,OPEN
2026-10-25 02:10,CLOSE
2026-10-25 07:00,OPEN
2026-10-25 07:05,CLOSE
"""


@pytest.mark.parametrize("rows", [UTC_ROWS, UTC_ROWS.replace("Z", "+00:00"), LOCAL_ROWS])
def test_door_that_is_open_for_twenty_minutes_in_the_doubled_hour_reads_so(tmp_path, rows):
    """With offsets, and without where readings run backwards."""
    run = fleet2d.run(sensor(tmp_path, rows))
    rows_of_run = run.arrow("sensors").to_pylist()
    assert [f"{r['time'].isoformat()} {r['state']}" for r in rows_of_run] == [
        "2026-10-25T02:50:00+02:00 ON", "2026-10-25T02:10:00+01:00 OFF",
        "2026-10-25T07:00:00+01:00 ON", "2026-10-25T07:05:00+01:00 OFF",
    ]  # fmt: skip


def test_reading_of_which_nobody_knows_the_hour_is_told(tmp_path):
    """It counts as of the first."""
    rows = LOCAL_ROWS.replace("2026-10-25 02:10,CLOSE\n", "")
    run = fleet2d.run(sensor(tmp_path, rows))
    assert run.arrow("sensors")["time"][0].as_py().isoformat() == "2026-10-25T02:50:00+02:00"
    assert any(
        "which the clock reads twice, count as of the first" in n for n in run.manifest["notes"]
    )


def test_log_of_another_time_zone_than_the_home_is_refused(tmp_path):
    """Its name may be said again, but not another one."""
    same = fleet2d.run(sensor(tmp_path, UTC_ROWS, time_zone="Europe/Berlin"))
    assert same.arrow("sensors").num_rows == 4
    with pytest.raises(InputError, match=r"the home is in Europe/Berlin, as simulation\.time_zone"):
        fleet2d.run(sensor(tmp_path, UTC_ROWS, time_zone="Europe/Paris"))


def test_log_of_a_summer_is_replayed_in_winter_by_the_local_time_of_its_own_date(tmp_path):
    """The rules of its own date count, not those of the run."""
    content = sensor(tmp_path, "2026-07-01T20:30:00Z,OPEN\n2026-07-01T20:31:00Z,CLOSE\n", day=0)
    content["simulation"]["start"] = "2026-12-01T22:00"
    run = fleet2d.run(content)
    [on, _] = run.arrow("sensors").to_pylist()
    assert on["time"].isoformat() == "2026-12-01T22:30:00+01:00"


def read(folder, layout, rows, **keys):
    """Read a log of the night of 25 hours; each row begins with its time."""
    path = folder / "log.txt"
    begin = [] if layout == "casas" else ["time,x,y,id"]
    path.write_text("\n".join([*begin, *(f"2026-10-25 {row}" for row in rows)]) + "\n")
    zone = load_scenario("bundled:paper", BERLIN, AUTUMN).simulation.clock.zone
    return read_log(path, layout, time_zone=zone, **keys)


@pytest.mark.parametrize(
    ("rows", "minutes", "is_told"),
    [
        (["00:30:00 kitchen", "02:30:00 bedroom", "04:30:00 kitchen"], [30, 150, 330], True),
        (
            ["00:30:00 kitchen", "02:30:00 bedroom", "02:10:00 bedroom", "04:30:00 kitchen"],
            [30, 150, 190, 330],
            False,
        ),
    ],
)
def test_rooms_of_a_smart_home_are_in_local_time_on_both_sides_of_the_change(
    tmp_path, rows, minutes, is_told
):
    """CASAS writes no offsets: the second time begins where readings run backwards, else it is told."""
    log = read(tmp_path, "casas", [f"{row} M1 ON" for row in rows])
    assert minutes == [reading.begin_us / 60e6 for reading in log.readings]
    note = "1 readings of 2026-10-25 02:00 on, which the clock reads twice"
    assert is_told == any(note in text for text in log.notes)


@pytest.mark.parametrize(
    ("rows", "keys", "minutes"),
    [
        # Of one tag, then of the other: the other's rows run backwards, not this one's.
        (["02:50:00 a", "03:10:00 a", "02:10:00 b", "03:20:00 b"], {"id": "b"}, [130, 260]),
        # The clock of the receiver jitters.
        (["02:10:00.5 a", "02:10:00.3 b", "02:40:00 b", "03:20:00 a"], {"id": "b"}, [130, 160]),
        (["02:10:00.5 a", "02:10:00.3 a", "02:40:00 a"], {"sort": True}, [130, 130, 160]),
        (["02:10:00.5 a", "02:10:00.3 a", "02:40:00 a"], {}, None),
    ],
)
def test_rows_of_other_tags_and_jitter_begin_no_second_hour(tmp_path, rows, keys, minutes):
    rows = [row.replace(" ", ",1,1,") for row in rows]
    if minutes is None:
        with pytest.raises(InputError, match=r"line 3: the time runs backwards there .* 0\.2 s"):
            read(tmp_path, "positions", rows, **keys)
        return
    log = read(tmp_path, "positions", rows, **keys)
    assert [t // 60_000_000 for t in log.time_us.tolist()] == minutes


def test_questions_about_a_run_are_in_local_time():
    """Of an assistant, by DuckDB."""
    pytest.importorskip("duckdb")
    from fleet2d.live.questions import answer

    run = fleet2d.run("bundled:family", BERLIN, AUTUMN, "simulation.duration=5 h", seed=4)
    query = "SELECT step, time FROM key_frames WHERE hour(time) = 2 ORDER BY step"
    rows = answer(dict(run.tables), query, 500)["shown"]
    assert rows
    assert all(str(row["time"]).replace("T", " ").startswith("2026-10-25 02:") for row in rows)


def test_beliefs_of_a_run_are_replayed_at_their_moments(tmp_path):
    """Its own table has instants, which need no time zone."""
    keys = [BERLIN, AUTUMN, "simulation.duration=5 h", "algorithms.ltp.period=30 min"]
    first = fleet2d.run("bundled:family", *keys, seed=4, out=tmp_path / "run")
    again = "algorithms.old={type: replay, path: %s, user: anyone, period: 30 min}"
    table = tmp_path / "run" / "ltp.parquet"
    run = fleet2d.run("bundled:family", *keys, again % table, seed=4)

    old = {(row["step"], row["room"]): row["share"] for row in run.arrow("old").to_pylist()}
    rows = [row for row in first.arrow("ltp").to_pylist() if row["user"] == "anyone"]
    assert rows
    assert {row["step"] for row in rows} == {step for step, _ in old}
    for row in rows:
        if row["room"] != "away":
            assert old[row["step"], row["room"]] == pytest.approx(row["share"])


@pytest.mark.parametrize(
    ("zone", "month", "hours"),
    [
        ("Europe/Berlin", "01", 0),
        ("Europe/Berlin", "07", 1),
        ("Australia/Sydney", "01", 1),
        ("Australia/Sydney", "07", 0),
    ],
)
def test_sun_rises_and_sets_an_hour_later_by_the_clock_in_summer_time(zone, month, hours):
    keys = [f"simulation.start=2026-{month}-20", f"simulation.time_zone={zone}"]
    keys += ["simulation.daylight={latitude: 50, noon: '12:06'}"]
    clock = load_scenario("bundled:paper", *keys).simulation.clock
    ordinal = clock.start.toordinal()
    ends = Sun(50, timedelta(hours=12, minutes=6)).day(ordinal)
    assert list(clock.sun.day(ordinal)) == [end + timedelta(hours=hours) for end in ends]


@pytest.mark.parametrize(("offset", "is_noted"), [("", True), ("+02:00", False), ("+01:00", False)])
def test_a_start_that_the_clock_reads_twice_is_noted(offset, is_noted):
    keys = [BERLIN, f"simulation.start=2026-10-25T02:30{offset}", "simulation.duration=1 h"]
    note = "simulation.start: the clock reads 2026-10-25 02:30 twice"

    notes = fleet2d.Simulation("bundled:paper", *keys).notes

    assert is_noted == any(text.startswith(note) for text in notes)


def test_dated_moment_that_is_not_one_is_noted_and_one_with_an_offset_is_exact():
    """In a script and in changes of the home."""
    script = '[{at: "2026-10-25T02:30", put: ana, to: kitchen}, {at: "2026-10-25T02:30+01:00", put: ana, to: hallway}]'
    keys = [BERLIN, AUTUMN, "simulation.duration=6 h", f"script={script}"]
    run = fleet2d.run("bundled:family", *keys, seed=4)
    assert run.manifest["notes"][0] == (
        "script.0.at: the clock reads 2026-10-25 02:30 twice in Europe/Berlin: the first counts,"
        " 2026-10-25T02:30:00+02:00; write 2026-10-25T02:30:00+01:00 for the second"
    )
    moved = [act["step"] for act in run.manifest["interventions"]]
    assert moved == [3.5 * 3600, 4.5 * 3600]
    spring = script.replace("10-25", "03-29").replace("+01:00", "")
    keys = [BERLIN, SPRING, "simulation.duration=6 h", f"script={spring}"]
    run = fleet2d.run("bundled:family", *keys, seed=4)
    assert "2026-03-29 02:30 doesn't exist in Europe/Berlin" in run.manifest["notes"][0]
    assert [act["step"] for act in run.manifest["interventions"]] == [3 * 3600, 3 * 3600]


@pytest.mark.parametrize(
    ("overrides", "text"),
    [
        (["simulation.time_zone=Europe/Berln"], "no time zone 'Europe/Berln': did you mean 'Europe/Berlin'"),
        (["simulation.time_zone=../etc/passwd"], "there is no time zone '../etc/passwd'"),
        (["simulation.time_zone={name: Own/Zone, standard_s: 0, offset_s: 0, changes: []}"], "there is no time zone 'Own/Zone'"),
        ([BERLIN, "simulation.start=2026-03-29T02:10"], "2026-03-29 02:10 doesn't exist in Europe/Berlin"),
        (["simulation.start=2026-03-29T02:10Z"], "say where the home is, by simulation.time_zone"),
        (['script=[{at: "2026-01-05T02:10Z", open: x}]'], "as there is no simulation.time_zone"),
        (["simulation.time_zone={name: Europe/Berlin, offset_s: 1}"], "give standard_s, offset_s and changes"),
    ],
)  # fmt: skip
def test_wrong_time_zone_or_offset_is_refused(overrides, text):
    """With what is wrong and what to do."""
    with pytest.raises(InputError) as error:
        load_scenario("bundled:paper", *overrides)
    assert text in str(error.value)


def test_offset_in_a_call_without_time_zone_is_refused():
    """Of a program that watches a run."""
    simulation = Simulation("bundled:paper", "simulation.duration=1 h", seed=4)
    with pytest.raises(InputError, match="has an offset, and the home has no time zone"):
        simulation.run_until("2026-01-05T00:10+01:00")


@pytest.mark.parametrize(
    ("start", "expected"),
    [
        (AUTUMN, ["02:30:00+02:00 pill ana", "02:00:00+01:00 pill ana", "03:00:00+01:00 chat ben"]),
        (SPRING, ["03:00:00+02:00 pill ana", "03:30:00+02:00 pill ana", "05:00:00+02:00 chat ben"]),
    ],
)
def test_what_robots_want_at_a_time_is_once_a_night_and_intervals_are_of_real_time(start, expected):
    """A reminder at 02:30, its deadline half an hour later, and a greeting every five hours."""
    wants = "{pill: {do: remind, to: ana, at: ['02:30'], within: 30 min}, chat: {do: greet, to: ben, every: 5 h, within: 10 min}}"
    keys = [BERLIN, start, "simulation.duration=7 h", f"interactions={wants}"]
    run = fleet2d.run("bundled:family", *keys, seed=4)
    rows = [r for r in run.arrow("events").to_pylist() if r["step"] > 3600]
    told = [(r, r["event"]) for r in rows if r["event"] in ("due", "expired")]
    texts = [
        f"{r['time'].isoformat()[11:]} {r['detail']}"
        for r, event in told
        if r["detail"] != "chat ben" or event == "due"
    ]
    assert [text for text in texts if "vitamins" not in text] == expected


def test_moments_of_commands_are_local_or_exact():
    """As `--from` and `--at` take them, in words, in local time, and with an offset."""
    clock = load_scenario(
        "bundled:paper", BERLIN, AUTUMN, "simulation.duration=2 d"
    ).simulation.clock
    words = {
        "day 2 02:30": 3.5,
        "2026-10-25T02:30": 3.5,
        "2026-10-25T02:30+01:00": 4.5,
        "2026-10-25T01:30Z": 4.5,
        "day 2 03:00": 5,
        "day 3": 26,
        "26 h": 26,
    }
    for text, hours in words.items():
        assert step_of(text, clock) == hours * 3600, text
