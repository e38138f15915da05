"""Tables of logs: ids as they are written, numbers and times of any spelling, or a refusal."""

import json
from datetime import datetime, timedelta

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import fleet2d
from fleet2d.errors import InputError
from fleet2d.logs.layout import read_log
from fleet2d.logs.log import LogError, PositionLog
from fleet2d.logs.placement import LogFrame

MARCH = datetime(2026, 3, 4, 8, 0)
TAGS = """time,id,x,y
2026-01-05 08:00:00,007,9.0,4.0
2026-01-05 08:00:01,007,9.1,4.0
2026-01-05 08:00:02,7,12.0,2.0
2026-01-05 08:00:03,7,12.1,2.0
2026-01-05 08:00:10,007,9.2,4.0
"""


def positions(path, **settings):
    log = read_log(path, **settings)
    assert isinstance(log, PositionLog)
    return log


def csv(folder, text, encoding="utf-8", name="log.csv"):
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


def moments(log):
    assert log.first_day is not None
    midnight = datetime.combine(log.first_day, datetime.min.time())
    return [midnight + timedelta(microseconds=us) for us in log.time_us.tolist()]


@pytest.mark.parametrize(
    ("spelling", "tag", "x"),
    [
        ({}, "007", [9.0, 9.1, 9.2]),
        ({}, "7", [12.0, 12.1]),
        ({",007,": ",0x6733,"}, "0x6733", [9.0, 9.1, 9.2]),
    ],
)
def test_a_tag_is_named_as_in_the_file(tmp_path, spelling, tag, x):
    text = TAGS
    for old, new in spelling.items():
        text = text.replace(old, new)

    assert positions(csv(tmp_path, text), id=tag).xy[:, 0].tolist() == x


@pytest.mark.parametrize(
    ("tag", "message"),
    [(None, "holds 2 ids: 007, 7: select one by 'id'"), ("07", "There are: 007, 7")],
)
def test_tags_that_are_one_number_are_several(tmp_path, tag, message):
    with pytest.raises(LogError, match=message):
        read_log(csv(tmp_path, TAGS), id=tag)


@pytest.mark.parametrize(
    ("ids", "tag"), [([7, 7, 8], "7"), (["007", "007", "7"], "007"), ([True, True, False], "true")]
)
def test_ids_of_typed_tables_are_their_text(tmp_path, ids, tag):
    columns = {"time": [1, 2, 3], "id": ids, "x": [1.0, 2.0, 3.0]}
    columns["y"] = columns["x"]
    parquet, lines = tmp_path / "a.parquet", tmp_path / "a.jsonl"
    pq.write_table(pa.table(columns), parquet)
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    lines.write_text("".join(json.dumps(row) + "\n" for row in rows))

    for path in (parquet, lines):
        assert positions(path, id=tag).xy[:, 0].tolist() == [1.0, 2.0]


def test_ids_that_a_program_made_fractions_are_refused(tmp_path):
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"time": [1], "id": [7.0], "x": [1.0], "y": [1.0]}), path)

    with pytest.raises(LogError, match="column 'id' holds double: write names and ids as text"):
        read_log(path, id="7")


@pytest.mark.parametrize("text", ["7", "007", "0x10", "1e3", "true"])
def test_an_id_in_yaml_without_quotes_is_refused(tmp_path, text):
    csv(tmp_path, TAGS)
    scenario = csv(
        tmp_path,
        f"extends: bundled:paper\nusers: {{ana: {{type: replay, path: log.csv, id: {text}}}}}\n",
        name="s.yaml",
    )

    with pytest.raises(InputError, match=r"users\.ana\.id: expected text, .*in quotes"):
        fleet2d.load_scenario(scenario)


@pytest.mark.parametrize(
    ("name", "text", "settings"),
    [
        ("semicolons", "time;x;y\n2026-03-04 08:00:00;1,5;2\n2026-03-04 08:00:01;2,25;3\n", {}),
        ("tabs", "time\tx\ty\n2026-03-04 08:00:00\t1.5\t2\n2026-03-04 08:00:01\t2.25\t3\n", {}),
        ("excel", "sep=;\ntime;x;y\n2026-03-04 08:00:00;1,5;2\n2026-03-04 08:00:01;2,25;3\n", {}),
        ("quoted", 'time,x,y\n2026-03-04 08:00:00,"1,5",2\n2026-03-04 08:00:01,"2,25",3\n', {}),
        ("units", "time,x [mm],y (mm)\n2026-03-04 08:00:00,1500,2000\n2026-03-04 08:00:01,2250,3000\n", {}),
        ("suffixes", "time,X_cm,Y_cm\n2026-03-04 08:00:00,150,200\n2026-03-04 08:00:01,225,300\n", {}),
        ("german", "Time;x;y\n04.03.2026 08:00:00;1,5;2\n04.03.2026 08:00:01;2,25;3\n", {}),
        ("day first", "time,x,y\n04/03/2026 08:00:00,1.5,2\n04/03/2026 08:00:01,2.25,3\n", {"day_first": True}),
        ("month first", "time,x,y\n3/4/2026 8:00:00 AM,1.5,2\n3/4/2026 8:00:01 am,2.25,3\n", {"day_first": False}),
        ("utc", "Timestamp (UTC),x,y\n2026-03-04 07:00:00,1.5,2\n2026-03-04 07:00:01,2.25,3\n", {"time_zone": "Europe/Berlin"}),
        ("offsets", "time,x,y\n2026-03-04T07:00:00+0000,1.5,2\n2026-03-04 09:00:01 +02:00,2.25,3\n", {"time_zone": "Europe/Berlin"}),
        ("epoch", "time,x,y\n1772607600,1.5,2\n1772607601,2.25,3\n", {"time_zone": "Europe/Berlin"}),
        ("epoch us", "time,x,y\n1772607600000000,1.5,2\n1772607601000000,2.25,3\n", {"time_zone": "Europe/Berlin"}),
        ("epoch ns", "time_ns,x,y\n1772607600000000000,1.5,2\n1772607601000000000,2.25,3\n", {"time_zone": "Europe/Berlin"}),
    ],
)  # fmt: skip
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_every_dialect_has_the_same_fixes(tmp_path, name, text, settings, encoding):
    log = positions(csv(tmp_path, text.replace("\n", "\r\n"), encoding), **settings)

    assert moments(log) == [MARCH, MARCH + timedelta(seconds=1)], name
    plan = LogFrame().in_unit(log.unit_m).to_plan(log.xy)
    assert np.allclose(plan, [[1.5, 2.0], [2.25, 3.0]], atol=1e-9)


def test_a_day_above_twelve_decides_the_order_of_all_dates(tmp_path):
    text = "time,x,y\n12/03/2026 08:00,1,2\n13/03/2026 08:00,1,3\n"

    log = positions(csv(tmp_path, text))

    assert [moment.day for moment in moments(log)] == [12, 13]
    assert moments(log)[0].month == 3


def test_seconds_count_in_the_unit_that_the_column_names(tmp_path):
    log = positions(csv(tmp_path, "time_ms,x,y\n1500,1,2\n3000,1,3\n"))

    assert log.time_us.tolist() == [1_500_000, 3_000_000]


def test_seconds_in_the_range_of_days_of_a_spreadsheet_are_named_so(tmp_path):
    log = positions(csv(tmp_path, "time_s,x,y\n45383.3,1,2\n45383.4,1,3\n"))

    assert log.time_us.tolist() == [45_383_300_000, 45_383_400_000]


def test_headings_in_radians_or_degrees_as_the_column_names(tmp_path):
    head = "time,x,y,heading"
    degrees = positions(csv(tmp_path, f"{head} [deg]\n1,1,2,90\n"))
    radians = positions(csv(tmp_path, f"{head}\n1,1,2,1.5\n"))

    assert degrees.heading.tolist() == [np.pi / 2]
    assert radians.heading.tolist() == [1.5]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time;x;y\n1;9,000;4,125\n", "line 2: '9,000' may be a thousand times as much: .*decimal_comma: true"),
        ("time;x;y\n1;1.234,5;4,25\n", "line 2: expected a number in column 'x', got '1.234,5'"),
        ("time;x;y\n1;1.234;4,25\n", "line 2: expected a number in column 'x', got '1.234'"),
        ("time,x,y\n1,9,5,4,5\n", "CSV parse error"),
        ("time,x,y\n03/04/2026 08:00,1,2\n", "line 2: '03/04/2026 08:00' may begin .*day_first: true"),
        ("time,x,y\n13/04/2026 08:00,1,2\n04/13/2026 08:00,1,2\n", "some of the dates begin with the day"),
        ("time,x,y\n03.04.26 08:00,1,2\n", "expected a time like"),
        ("time,x,y\n13/04/2026 13:00 PM,1,2\n", "hour 13 of a clock of 12 hours"),
        ("time,x,y\n1.77261E+12,1,2\n1.77261E+12,1,3\n", "line 2: expected a time"),
        ("time,x,y\n080000,1,2\n080001,1,3\n", "line 2: expected a time"),
        ("time,x,y\n45383.33333,1,2\n45383.33403,1,3\n", "line 2: .* days of a spreadsheet, 2024-04-01 08:00:"),
        ("time,x,y\n45383.5,1,2\n45384.25,1,3\n", "the time 45383.5 may be days of a spreadsheet, 2024-04-01 12:00"),
        ("time,x,y\n08:00:00,1,2\n", "expected a time like"),
        ("time,x [mm],y\n1,1,2\n", "x and y have different units"),
        ("time,x [px],y [px]\n1,1,2\n", r"has no column 'x'; it has: time, x \[px\], y \[px\]"),
        ("time,x,y,heading\n1,1,2,90\n", "the heading 90 is more than a turn: .*heading_deg"),
        ("time,x [mm],x [m],y\n1,1,2,3\n", r"several columns of x, x \[mm\] and x \[m\]: say which"),
        ("time,x,x,y\n1,1,2,3\n", "has two columns 'x'"),
        ("time,id,x,y\n1,1.58E+12,2,3\n", "rounded by a spreadsheet"),
        ("time,id,x,y\n1,a,2,3\n2,,2,3\n", r"2 ids: \(none\), a"),
        ('time,note,x,y\n1,"a\nb",2,3\n\n2,c,two,3\n', "line 5: expected a number in column 'x'"),
    ],
)  # fmt: skip
def test_what_may_mean_two_things_is_refused_with_the_key(tmp_path, text, message):
    with pytest.raises(LogError, match=message):
        read_log(csv(tmp_path, text))


def test_text_that_is_not_unicode_is_refused(tmp_path):
    with pytest.raises(LogError, match="not text in UTF-8: save it as CSV in UTF-8"):
        read_log(csv(tmp_path, "time,x,y,Größe\n1,2,3,4\n", "cp1252"))


def test_the_key_decides_on_commas_of_three_digits(tmp_path):
    path = csv(tmp_path, "time;x;y\n1;9,000;4,125\n")

    assert positions(path, decimal_comma=True).xy.tolist() == [[9.0, 4.125]]
    with pytest.raises(LogError, match="expected a number in column 'x', got '9,000'"):
        read_log(path, decimal_comma=False)


def test_a_scale_that_contradicts_the_columns_is_refused(tmp_path):
    log = positions(csv(tmp_path, "time,x [mm],y [mm]\n1,1,2\n"))

    with pytest.raises(
        LogError, match=r"frame\.scale is 0\.01 m, but .* the unit of the log is 0\.001 m"
    ):
        LogFrame(scale=0.01).in_unit(log.unit_m)


def test_all_tags_of_a_file_begin_with_the_same_day(tmp_path):
    text = "time,id,x,y\n2026-01-05 08:00,a,1,2\n2026-01-06 08:00,b,1,2\n"

    log = positions(csv(tmp_path, text), id="b")

    assert moments(log) == [datetime(2026, 1, 6, 8)]
    assert log.first_day == datetime(2026, 1, 5).date()
