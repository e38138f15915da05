"""Logs of all layouts: what is read, and what is refused with the line that is wrong."""

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pytest

from fleet2d.logs.layout import read_log
from fleet2d.logs.log import ActivityLog, LogError, PositionLog

S = 1_000_000
H = 3600 * S

CASAS = """\
2020-03-02 07:00:00.5 Bedroom Bedroom ON Sleep
2020-03-02 07:00:02.25 Bedroom Bedroom OFF Sleep
2020-03-02 07:00:09 Kitchen Kitchen ON Cook
2020-03-03 00:10:00 Kitchen Fridge OPEN Cook
"""
SENSORS = """\
Start time             End time               Location  Type  Place
---------------------  ---------------------  --------  ----  -----
2020-03-02 07:00:00    2020-03-02 08:00:00    Bed       Pressure  Bedroom
2020-03-02 08:05:00    2020-03-02 08:06:00    Fridge    Magnetic  Kitchen
2020-03-02 09:00:00    2020-03-02 09:00:05    Maindoor  Magnetic  Entrance
"""
ADLS = """\
Start time             End time               Activity
---------------------  ---------------------  --------
2020-03-02 07:00:00    2020-03-02 08:00:00    Sleeping
2020-03-02 08:04:00    2020-03-02 08:20:00    Breakfast
2020-03-02 09:00:00    2020-03-02 10:00:00    Leaving
"""
HOMER = """\
showering (06:10 - 06:30)
sleep (22:00 - 1day - 02:00)

### showering-07.txt

[FIND] <shower> (16) [1]
375.5
## Take Shower until 06:15

[GRAB] <towel> (1205) [2]
[WALK] <bedroom> (162) [3]
380.0
[WALK] <bathroom> (1) [4]
380.0
[FIND] <bath> (18) [5]
390.0

### sleep-00.txt

[WALK] <bedroom> (162) [1]
1560.0
"""


def write(folder, name, text):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def activity_log(*arguments, **settings):
    log = read_log(*arguments, **settings)
    assert isinstance(log, ActivityLog)
    return log


def position_log(*arguments, **settings):
    log = read_log(*arguments, **settings)
    assert isinstance(log, PositionLog)
    return log


@pytest.mark.parametrize("named", ["A_Sensors.txt", "A_ADLs.txt", ""])
def test_uci_adl_joins_both_files_of_a_home_whichever_is_named(tmp_path, named):
    write(tmp_path, "A_Sensors.txt", SENSORS)
    write(tmp_path, "A_ADLs.txt", ADLS)
    log = activity_log(tmp_path / named)
    assert [
        ("Bedroom", "Sleeping", 7 * H, 8 * H),
        ("Kitchen", "Breakfast", 8 * H + 300 * S, 8 * H + 360 * S),
        ("Entrance", "Leaving", 9 * H, 9 * H + 5 * S),
        ("away", "Leaving", 9 * H, 10 * H),
    ] == [(r.room, r.activity, r.begin_us, r.end_us) for r in log.readings]


def test_uci_adl_of_activities_alone_takes_them_for_rooms(tmp_path):
    log = activity_log(write(tmp_path, "adl.txt", ADLS))
    assert ["Sleeping", "Breakfast", "away"] == [r.room for r in log.readings]


def test_homer_finds_the_room_of_things_by_their_numbers_and_sleeps_into_the_next_day(tmp_path):
    write(tmp_path, "day_000.txt", HOMER)
    write(tmp_path, "day_001.txt", HOMER)
    log = activity_log(tmp_path)
    m = 60 * S
    day = [
        ("bathroom", "showering", 370 * m, 375.5 * m),
        ("bedroom", "showering", 375.5 * m, 380 * m),
        ("bathroom", "showering", 380 * m, 390 * m),
        ("bedroom", "sleep", 22 * 60 * m, 26 * 60 * m),
    ]
    assert (None, 2) == (log.first_day, log.days)
    assert day == [(r.room, r.activity, r.begin_us, r.end_us) for r in log.readings[:4]]
    assert [begin + 24 * H for _, _, begin, _ in day] == [r.begin_us for r in log.readings[4:]]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.txt", CASAS.replace("ON Cook", ""), r"a.txt, line 3: expected date, .*, got '2020-03-02 07:00:09"),
        ("a.txt", CASAS.replace("07:00:09", "27:00:09"), r"line 3: '2020-03-02 27:00:09' is not a time"),
        ("a.txt", CASAS.replace("07:00:09", "06:00:09"), r"line 3: the time runs backwards"),
        ("a.txt", "hello\nworld\n", "has no known layout: give 'format'"),
        ("A_ADLs.txt", ADLS.replace("02 08:20:00", "03 14:04:00"), r"line 4: it lasts 30.0 h"),
        ("A_ADLs.txt", ADLS.replace("2020-03-02 08:20:00", "later"), r"line 4: expected"),
        ("A_ADLs.txt", "\n".join(ADLS.splitlines()[:2]), "holds no reading"),
        ("d.txt", HOMER.replace("(06:10 - 06:30)", "(30:10 - 30:30)"), "line 1: expected a time within 24 hours"),
        ("d.txt", HOMER.replace("06:10 - 06:30", "06:30 - 06:10"), "line 1: it ends before"),
        ("d.txt", HOMER.replace("### sleep-00", "### dinner-00"), "line 18: the script of dinner"),
    ],
)  # fmt: skip
def test_damaged_logs_are_refused_with_the_line(tmp_path, name, text, message):
    with pytest.raises(LogError, match=message):
        read_log(write(tmp_path, name, text))


def test_lines_that_run_backwards_are_sorted_if_asked_and_counted(tmp_path):
    path = write(tmp_path, "a.txt", CASAS.replace("07:00:09", "06:00:09"))
    log = activity_log(path, sort=True)
    assert ["Kitchen", "Bedroom", "Kitchen"] == [r.room for r in log.readings]
    assert ("1 line ran backwards in time and were sorted in",) == log.notes


def test_an_end_before_the_begin_leaves_an_instant_and_a_note(tmp_path):
    log = activity_log(write(tmp_path, "a_ADLs.txt", ADLS.replace("02 08:20", "01 08:20")))
    assert log.readings[1].end_us == log.readings[1].begin_us
    assert "line 4" in log.notes[0]


def test_the_real_logs_are_read_whole(shared_data):
    folder = shared_data / "activity"
    casas = activity_log(folder / "casas_al" / "events_10_days.txt")
    text = (folder / "casas_al" / "events_10_days.txt").read_text()
    assert (10, ()) == (casas.days, casas.notes)
    assert text.count(" ON ") + text.count(" OPEN ") == len(casas.readings)
    uci = activity_log(folder / "uci_adl_a")
    assert (14, "72, 81, 83") == (uci.rooms["away"], uci.notes[0].rpartition("line ")[2])
    homer = activity_log(folder / "homer_plus_a")
    assert (10, {"bedroom", "bathroom", "dining_room", "home_office"}) == (
        homer.days,
        set(homer.rooms),
    )


# Positions


def csv(folder, text):
    return write(folder, "rtls.csv", text)


TWO = "time,id,x,y,heading_deg\n2020-03-02 07:00:00,a,1,2,90\n2020-03-02 07:00:01,b,9,9,0\n2020-03-02 07:00:02,a,3,4,\n"


def test_positions_of_one_tag_with_headings_in_degrees(tmp_path):
    log = position_log(csv(tmp_path, TWO), id="a")
    assert [7 * H, 7 * H + 2 * S] == log.time_us.tolist()
    assert [[1, 2], [3, 4]] == log.xy.tolist()
    assert np.pi / 2 == log.heading[0]
    assert np.isnan(log.heading[1])
    assert ("1 fixes of other ids were left out",) == log.notes


def test_summer_time_ends_the_repeated_hour_is_left_out_and_begins_with_an_hour_missing(tmp_path):
    autumn = [f"2020-10-25T0{h}:30:00Z,1,2" for h in range(4)]  # 02:30, 02:30 again, 03:30, 04:30
    log = position_log(csv(tmp_path, "time,x,y\n" + "\n".join(autumn)), time_zone="Europe/Berlin")
    assert [2.5, 3.5, 4.5] == (log.time_us / H).tolist()
    assert "1 fixes of the hour that the end of summer time repeats" in log.notes[0]
    spring = [f"2020-03-29T0{h}:30:00Z,1,2" for h in range(2)]
    log = position_log(csv(tmp_path, "time,x,y\n" + "\n".join(spring)), time_zone="Europe/Berlin")
    assert [1.5, 3.5] == (log.time_us / H).tolist()


def test_drop_outs_and_equal_times_are_left_out_and_counted(tmp_path):
    log = position_log(csv(tmp_path, "time,x,y\n1,1,1\n2,,\n3,2,2\n3,4,4\n"))
    assert [[1, 1], [4, 4]] == log.xy.tolist()
    assert (
        "1 fixes without a position were left out",
        "of 1 fixes at equal times the last counts",
    ) == log.notes


@pytest.mark.parametrize(
    ("text", "settings", "message"),
    [
        (TWO, {}, "holds 2 ids: a, b: select one by 'id'"),
        (TWO, {"id": "c"}, "has no id 'c'"),
        (TWO, {"id": "a", "columns": {"x": "east"}}, "has no column 'east'"),
        ("when,x,y\n1,2,3\n", {}, r"no column 'time'; it has: when, x, y. .* columns: \{time"),
        ("time,x,y\n1,two,3\n", {}, r"line 2: expected a number in column 'x', got 'two'"),
        ("time,x,y\n2,1,3\n1,1,3\n", {}, "line 3: the time runs backwards"),
        ("time,x,y\n", {}, "holds no position"),
        ("time,x,y\n1,,\n", {}, "has no row with a position"),
        ("time,x,y\n1,2,3,4\n", {}, "can't be read: CSV parse error"),
        ("time,x,y\n2020-13-02 07:00,1,2\n", {}, "line 2: '2020-13-02 07:00' is not a time"),
        ("time,x,y\n2020-03-02T06:00:00Z,1,2\n", {}, "say which local time"),
        ("time,x,y\n2020-03-02T06:00:00Z,1,2\n", {"time_zone": "Europe/Berlln"}, "did you mean 'Europe/Berlin'"),
    ],
)  # fmt: skip
def test_damaged_positions_are_refused_with_what_to_do(tmp_path, text, settings, message):
    with pytest.raises(LogError, match=message):
        position_log(csv(tmp_path, text), **settings)


def test_settings_of_positions_are_refused_for_other_layouts(tmp_path):
    with pytest.raises(LogError, match="takes no time_zone: that is for positions"):
        read_log(write(tmp_path, "a.txt", CASAS), time_zone="UTC")


def test_a_csv_written_by_arrow_reads_back(tmp_path):
    times = pa.array([1583132400 * S, 1583132401 * S], pa.timestamp("us"))
    pacsv.write_csv(pa.table({"time": times, "x": [1.5, 2.5], "y": [0, 1]}), tmp_path / "a.csv")
    log = position_log(tmp_path / "a.csv")
    assert [[1.5, 0], [2.5, 1]] == log.xy.tolist()
