"""Trace events have the structure that Perfetto and Chrome read, and what the run stored."""

import itertools
import json
from pathlib import Path

from tests.runs.test_robot_log import stored

from fleet2d.live.exporters import Selection, export
from fleet2d.live.exporters.perfetto import TRACKS, export_perfetto
from fleet2d.runs.robot_log import rows_of

# What each phase of the Trace Event Format has to have.
FIELDS = {
    "X": {"ph", "ts", "dur", "pid", "tid", "name", "args"},
    "i": {"ph", "ts", "pid", "tid", "name", "args", "s"},
    "C": {"ph", "ts", "pid", "tid", "name", "args"},
    "M": {"ph", "ts", "pid", "tid", "name", "args"},
}


def trace(tmp_path: Path, first=0, end: int | None = None):
    file = tmp_path / "trace.json"
    line = export(stored(), file, "perfetto", first=first, end=end)
    content = json.loads(file.read_text())
    events = content["traceEvents"]
    assert {"displayTimeUnit", "otherData", "traceEvents"} == content.keys()
    assert content["displayTimeUnit"] in ("ms", "ns")
    assert line == f"{len(events):,} trace events in {file}"
    return events


def test_each_event_has_the_fields_of_its_phase(tmp_path):
    events = trace(tmp_path)

    assert FIELDS.keys() == {event["ph"] for event in events}
    for event in events:
        assert FIELDS[event["ph"]] <= event.keys(), event
        assert all(type(event[key]) is int for key in ("ts", "pid", "tid"))
        assert isinstance(event["name"], str)
        assert isinstance(event["args"], dict)
        assert event.get("dur", 0) >= 0
        assert event["ph"] != "i" or event["s"] in ("t", "p", "g")
        values = event["args"].values()
        assert event["ph"] != "C" or all(isinstance(value, float) for value in values)


def test_each_body_is_a_process_and_each_part_of_it_a_named_track(tmp_path):
    events = trace(tmp_path)
    names = [e for e in events if e["name"] == "process_name"]
    tracks = [e for e in events if e["name"] == "thread_name" and e["pid"] == 2]

    assert {1: "ana (person)", 2: "astro (robot)"} == {e["pid"]: e["args"]["name"] for e in names}
    assert list(enumerate(TRACKS, 1)) == [(e["tid"], e["args"]["name"]) for e in tracks]


def test_slices_of_a_track_do_not_overlap(tmp_path):
    events = trace(tmp_path)
    for pid in (1, 2):
        for tid in range(1, len(TRACKS) + 1):
            own = [e for e in events if (e["ph"], e["pid"], e["tid"]) == ("X", pid, tid)]
            spans = [(e["ts"], e["ts"] + e["dur"]) for e in own]
            assert all(a[1] <= b[0] for a, b in itertools.pairwise(spans)), (pid, tid)


def test_times_are_microseconds_since_the_start(tmp_path):
    power = [e for e in trace(tmp_path) if e.get("cat") == "power"]

    spans = [(e["ts"], e["dur"], e["name"]) for e in power]
    assert [(300_000_000, 120_000_000, "power_off crash"), (3_000_000_000, 600_000_000, "power_off off")] == spans  # fmt: skip


def test_events_are_instants_and_the_charge_is_a_counter(tmp_path):
    events = trace(tmp_path, 600, 7200)
    rows = rows_of(stored().tables["events"], "astro", 600, 7200)
    instants = [e for e in events if e["ph"] == "i" and e["pid"] == 2]
    charges = [e["args"]["charge"] for e in events if e["ph"] == "C"]

    assert [row["step"] for row in rows] == [e["args"]["step"] for e in instants]
    assert [row["event"] for row in rows] == [e["args"]["event"] for e in instants]
    assert [float(row["detail"][:-2]) for row in rows if row["detail"].endswith(" %")] == charges


def test_plans_come_from_the_repeated_run_if_decisions_were_not_stored(tmp_path):
    without = stored(decisions=False)
    export_perfetto(without, tmp_path / "without.json", Selection.of(without))
    trace(tmp_path)

    assert (tmp_path / "trace.json").read_text() == (tmp_path / "without.json").read_text()
