"""Questions in SQL: right answers, or an error that names what is there; and nothing else is read."""

from datetime import datetime, timedelta

import pyarrow as pa
import pytest

from fleet2d.errors import InputError
from fleet2d.live import questions
from fleet2d.live.questions import answer

pytest.importorskip("duckdb", minversion="2.0", reason="the extra study is not installed")

START = datetime(2026, 1, 5, 7)
SEEN = [
    (0, "astro", "user_seen", "kitchen_1"),
    (60, "astro", "user_lost", "kitchen_1"),
    (90, "rover", "user_seen", "hall"),
    (100, "astro", "user_seen", "kitchen_1"),
    (400, "astro", "user_lost", "hall"),
]


@pytest.fixture(scope="module")
def tables():
    step, entity, event, room = zip(*SEEN, strict=True)
    events = pa.table(
        {
            "step": pa.array(step),
            "time": pa.array([START + timedelta(seconds=s) for s in step], pa.timestamp("us")),
            "entity": pa.array(entity).dictionary_encode(),
            "event": pa.array(event).dictionary_encode(),
            "room": pa.array(room),
        }
    )
    return {"events": events, "layer.heat": pa.table({"cell": [1, 2], "heat": [0.5, float("nan")]})}


def rows(tables: dict[str, pa.Table], query):
    """Return the values of all rows of an answer."""
    return [list(row.values()) for row in answer(tables, query)["shown"]]


@pytest.mark.parametrize(
    ("condition", "count"),
    [
        ("event == user_seen", 3),
        ("event = 'user_seen'", 3),
        ('event = "user_seen"', 3),
        ("event == 'user_seen' and entity == 'astro'", 2),
        ("EVENT = 'user_seen' OR Room = 'hall'", 4),
        ("not event = 'user_seen'", 2),
        ("event IN ('user_seen', user_lost) AND step > 60", 3),
        ("'hall' = room", 2),
        ("room <> 'hall' AND step BETWEEN 1 AND 99", 1),
        ("time >= '2026-01-05 07:01:40'", 2),
        ("room LIKE 'kitchen%' -- of the home", 3),
        ("room = ''", 0),
        ("room IS NULL", 0),
    ],
)
def test_conditions_select_rows(tables, condition, count):
    found = answer(tables, f"SELECT * FROM events WHERE {condition}", 1)

    assert (found["rows"], len(found["shown"])) == (count, min(count, 1))


def test_groups_have_sums_counts_and_durations(tables):
    """How long in each room; its first, last and longest stay."""
    stays = (
        "WITH stays AS (SELECT entity, room, time, lead(time) OVER (PARTITION BY entity ORDER BY"
        " step) - time AS stay FROM events) SELECT room, sum(epoch(stay)), count(*), min(time),"
        " max(time), max(epoch(stay)) FROM stays WHERE entity = 'astro' GROUP BY room ORDER BY ALL"
    )

    assert rows(tables, stays) == [
        ["hall", None, 1, "2026-01-05 07:06:40", "2026-01-05 07:06:40", None],
        ["kitchen_1", 400.0, 3, "2026-01-05 07:00:00", "2026-01-05 07:01:40", 300.0],
    ]
    counts = "SELECT count(*) FILTER (WHERE event = 'user_seen'), count(DISTINCT room) FROM events"
    assert rows(tables, counts) == [[3, 2]]


def test_tables_are_joined_nested_and_ordered(tables):
    pairs = "SELECT a.step, b.step FROM events a JOIN events b USING (room) WHERE a.step < b.step"

    assert sorted(rows(tables, pairs)) == [[0, 60], [0, 100], [60, 100], [90, 400]]
    assert answer(tables, pairs)["shown"][0].keys() == {"step", "step_1"}
    last = "SELECT step FROM events WHERE room IN (SELECT room FROM events) ORDER BY step DESC"
    assert rows(tables, last) == [[400], [100], [90], [60], [0]]
    assert rows(tables, 'SELECT heat FROM "layer.heat"') == [[0.5], ["nan"]]


@pytest.mark.parametrize(
    ("query", "message"),
    [
        ("SELECT * FROM event", "no table 'event': did you mean 'events'"),
        ("SELECT evnt FROM events", "no column 'evnt': did you mean 'event'"),
        ("SELECT * FROM events WHERE usr = 'ana'", "no column 'usr'"),
        ("SELECT * FROM events WHERE step > soon", "no column 'soon'"),
        ("SELECT * FROM events WHERE event = 'usr_seen'", "did you mean 'user_seen'"),
        ("SELECT * FROM events WHERE event == usr_seen", "did you mean 'user_seen'"),
        ("SELECT * FROM events WHERE room = 'kichen'", "did you mean 'kitchen_1'"),
        ("SELECT * FROM events WHERE room != 'kitchen'", "did you mean 'kitchen_1'"),
        ("SELECT * FROM events WHERE room NOT IN ('hall', 'hal')", "did you mean 'hall'"),
        ("SELECT * FROM events e WHERE 'rovr' = e.entity", "did you mean 'rover'"),
        ("SELECT * FROM (SELECT room AS r FROM events) WHERE r = 'hal'", "did you mean 'hall'"),
        ("SELECT count(*) FILTER (WHERE room = 'hal') FROM events", "did you mean 'hall'"),
        ("SELECT CASE room WHEN 'hal' THEN 1 END FROM events", "did you mean 'hall'"),
        ("SELECT 1 FROM events GROUP BY room HAVING room = 'hal'", "did you mean 'hall'"),
        ("WITH s AS (SELECT * FROM events WHERE room = 'hal') FROM s", "did you mean 'hall'"),
        ("SELECT avrg(step) FROM events", "no function 'avrg'"),
        ("SELECT * FROM events WHERE step = 'x'", "Could not convert string 'x'"),
        ("SELECT * FRM events", "expected one SELECT, as DuckDB reads it: syntax error"),
        ("", "got 0 statements"),
        ("SELECT '" + "x" * 10_000 + "'", "the query has 10009 characters"),
    ],
)
def test_what_is_not_there_is_an_error(tables, query, message):
    with pytest.raises(InputError, match=message) as caught:
        answer(tables, query)
    assert "\n" not in str(caught.value)


def test_a_text_of_the_query_itself_is_no_value_of_the_table(tables):
    kinds = "SELECT CASE room WHEN 'hall' THEN 'way' ELSE 'room' END AS room FROM events"

    assert answer(tables, f"SELECT * FROM ({kinds}) WHERE room = 'way'")["rows"] == 2


@pytest.mark.parametrize(
    "query",
    [
        "SELECT read_text('FILE')",
        "SELECT * FROM read_text('FILE')",
        "SELECT * FROM read_blob('FILE')",
        "SELECT * FROM read_csv('FILE')",
        "SELECT * FROM read_json('FILE')",
        "SELECT * FROM read_parquet('FILE')",
        "SELECT * FROM parquet_metadata('FILE')",
        "SELECT * FROM sniff_csv('FILE')",
        "SELECT * FROM glob('/*')",
        "SELECT * FROM 'FILE'",
        'SELECT * FROM "FILE"',
        "FROM 'FILE'",
        "SELECT * FROM query('SELECT * FROM read_text(''FILE'')')",
        "SELECT * FROM query_table('events')",
        "SELECT * FROM events, LATERAL read_text(room)",
        "SELECT (SELECT content FROM read_text('FILE'))",
        "WITH s AS (FROM read_text('FILE')) SELECT * FROM s",
        "WITH s AS MATERIALIZED (SELECT 1) FROM s UNION ALL FROM read_text('FILE')",
        "COPY (SELECT 1) TO 'OUT'",
        "COPY events TO 'OUT'",
        "COPY events FROM 'FILE'",
        "EXPORT DATABASE 'OUT'",
        "IMPORT DATABASE 'FILE'",
        "ATTACH 'OUT' AS other",
        "ATTACH 'FILE' (TYPE sqlite)",
        "DETACH memory",
        "USE memory",
        "INSTALL httpfs",
        "LOAD httpfs",
        "LOAD 'FILE'",
        "SET memory_limit = '100GB'",
        "SET enable_external_access = true",
        "RESET lock_configuration",
        "PRAGMA database_list",
        "PRAGMA enable_profiling",
        "CALL pragma_version()",
        "CREATE TABLE t AS SELECT 1",
        "CREATE MACRO f() AS TABLE SELECT * FROM read_text('FILE')",
        "CREATE SECRET s (TYPE s3)",
        "INSERT INTO events SELECT * FROM events",
        "DELETE FROM events",
        "DROP VIEW events",
        "PREPARE p AS SELECT 1",
        "EXPLAIN ANALYZE SELECT 1",
        "CHECKPOINT",
        "BEGIN",
        "DESCRIBE events",
        "SHOW ALL TABLES",
        "SUMMARIZE events",
        "PIVOT events ON event USING count(*)",
        "SELECT 1; SELECT 2",
        "SELECT 1; COPY events TO 'OUT'",
        "SELECT 1) ; COPY events TO 'OUT' --",
        "SELECT $1",
        "SELECT getenv('HOME')",
        "SELECT current_setting('threads')",
        "SELECT * FROM duckdb_settings()",
        "SELECT * FROM duckdb_secrets()",
        "SELECT * FROM pg_catalog.pg_class",
        "SELECT * FROM information_schema.tables",
        "SELECT * FROM sqlite_master",
        "SELECT * FROM memory.main.events",
        "SELECT * FROM tables",
        "SELECT * FROM local_frame",
        "SELECT nextval('s')",
        "SELECT sleep_ms(100000)",
        "SELECT repeat('x', 3000000000)",
        "SELECT lpad('x', 2000000000, 'y')",
        "SELECT format('{:>1000000000}', 'x')",
        "SELECT len(range(300000000))",
        "SELECT * FROM range(100000000000)",
        "SELECT list_resize([1], 3000000000)",
        "SELECT CAST(NULL AS INTEGER[100000][100000])",
        "SELECT " + "(" * 3000 + "1" + ")" * 3000,
        "SELECT " + "1 + " * 2000 + "1",
        "\ud800",
        "SELECT '\ud800'",
        "\0",
        "SELECT \x1b[2J",
    ],
)
def test_a_query_reads_and_changes_nothing_else(tables, tmp_path, query):
    local_frame = tables["events"]  # DuckDB would find a variable of the caller by its name
    (tmp_path / "secret.csv").write_text("password\n1234\n")
    query = query.replace("FILE", str(tmp_path / "secret.csv")).replace("OUT", str(tmp_path / "o"))

    with pytest.raises(InputError) as caught:
        answer(tables, query)

    assert local_frame.num_rows == 5
    assert [path.name for path in tmp_path.iterdir()] == ["secret.csv"]
    assert "1234" not in str(caught.value)
    assert str(caught.value).isprintable()


def test_long_answers_are_cut_and_say_so(tables):
    many = "SELECT a.step FROM events a, events b, events c, events d"

    found = answer(tables, many, 10_000)

    assert (found["rows"], len(found["shown"])) == (625, 200)
    assert found["left_out"].startswith("425 of 625 rows")
    assert "left_out" not in answer(tables, "SELECT * FROM events")
    text = f"SELECT '{'x' * 9000}' AS long, a.* FROM events a, events b, events c"
    found = answer(tables, text, 200)
    assert len(found["shown"][0]["long"]) == 501
    assert 40 < len(found["shown"]) < 60
    assert answer(tables, many, -1)["shown"] == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("query", "message"),
    [
        ("WITH RECURSIVE r AS (SELECT 1 AS x UNION ALL SELECT x + 1 FROM r) SELECT max(x) FROM r",
         "takes more than 0.5 s"),
        ("WITH RECURSIVE r AS (SELECT 'x' AS x UNION ALL SELECT x || x FROM r) SELECT x FROM r",
         "takes more than"),
        ("SELECT count(*) FROM " + ", ".join(f"events e{k}" for k in range(40)), "takes more than"),
    ],
)  # fmt: skip
def test_an_answer_takes_limited_time_and_memory(tables, monkeypatch, query, message):
    monkeypatch.setattr(questions, "MAX_S", 0.5)

    with pytest.raises(InputError, match=message):
        answer(tables, query)


@pytest.mark.parametrize(
    ("query", "message"),
    [
        ("SELECT * FROM read_text('FILE')", "disabled by configuration"),
        ("COPY frame TO 'OUT'", "disabled by configuration|does not exist"),
        ("SELECT * FROM frame", "frame does not exist"),
        ("SET threads = 9", "configuration has been locked"),
    ],
)
def test_the_database_itself_is_closed(tables, tmp_path, query, message):
    """Also if a query were not refused before."""
    import duckdb

    frame = tables["events"]  # which DuckDB would find by its name
    (tmp_path / "secret.csv").write_text("password\n1234\n")
    query = query.replace("FILE", str(tmp_path / "secret.csv")).replace("OUT", str(tmp_path / "o"))
    with duckdb.connect(config=questions._CLOSED) as database:
        limit = "SELECT current_setting('memory_limit'), current_setting('threads')"
        assert [("953.6 MiB", 2)] == database.execute(limit).fetchall()
        with pytest.raises(duckdb.Error, match=message):
            database.execute(query)
    assert frame.num_rows == 5
    assert ["secret.csv"] == [path.name for path in tmp_path.iterdir()]
