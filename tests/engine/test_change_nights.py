"""Runs over nights in which clocks change: each minute is as the standard library has it."""

from datetime import UTC, datetime, time

import pytest
from tests.change_nights import CHANGED_RULES, MINUTE, ZONES, nights
from tests.thorough import some

import fleet2d
from fleet2d.logs.layout import read_log
from fleet2d.logs.log import in_run

HOURS = 26
STEPS = HOURS * 60
NIGHTS = [night for zone in ZONES for night in nights(zone)]
NIGHTS += [night for zone, year in CHANGED_RULES for night in nights(zone, year)]
ITEMS = [f"{hour:02}:{minute:02}" for hour in range(24) for minute in (0, 15, 30, 45)]


def scenario(night, log):
    """Return a home whose schedule, door, script, log and expectations name times of the night."""
    spot = [16.6, 9.6]
    items = [{"at": at, "place": spot, "activity": f"n{k}"} for k, at in enumerate(ITEMS)]
    turns = [{"at": at, "open": k % 2 == 0} for k, at in enumerate(ITEMS)]
    sensor = {"type": "replay_sensor", "path": str(log), "room": "hallway", "day": "date"}
    return {
        "simulation": {
            "start": night.reading(0).isoformat(),
            "duration": f"{HOURS} h",
            "step": "1 min",
            "seed": 1,
            "time_zone": night.zone,
        },
        "floorplan": {"type": "bundled", "furnish": True},
        "users": {"ana": {"start": spot, "type": "schedule", "days": [{"items": items}]}},
        "objects": {
            "door": {"type": "door", "doorway": "dining_room_1-hallway_1", "schedule": turns},
            "log": sensor,
        },
        "expect": {"night": "never(during(02:10-02:50))"},
    }


def due(night):
    """Return the steps at which the clock first reads each of `ITEMS`, or is put past it, in order."""
    readings = [night.reading(step).replace(tzinfo=None) for step in range(STEPS)]
    first = {reading: step for step, reading in reversed(list(enumerate(readings)))}
    put_past = [k for k in range(1, STEPS) if readings[k] - readings[k - 1] > MINUTE]
    steps = []
    for day in sorted({reading.date() for reading in readings}):
        for k, at in enumerate(ITEMS):
            wanted = datetime.combine(day, time.fromisoformat(at))
            later = [step for step in put_past if readings[step - 1] < wanted < readings[step]]
            steps += [(step, wanted, k) for step in ([first[wanted]] if wanted in first else later)]
    return [(step, k) for step, _, k in sorted(steps) if step > 0]


@pytest.mark.parametrize("night", some(NIGHTS, 6), ids=str)
def test_schedule_door_log_and_expectation_are_in_local_time(night, tmp_path):
    """Over forty time zones, and some in the year in which their rules changed."""
    log = tmp_path / "log.csv"
    # In UTC, a change at each 13th minute; it lands where it belongs.
    toggles = range(0, STEPS, 13)
    stamps = [(night.begin + step * MINUTE).isoformat() for step in toggles]
    rows = [f"{stamp},{'ON' if k % 2 else 'OFF'}" for k, stamp in enumerate(stamps)]
    log.write_text("\n".join(["time,state", *rows]))
    run = fleet2d.run(scenario(night, log))
    events = run.arrow("events").to_pylist()
    expected = due(night)
    for row in events:
        moment = night.begin + row["step"] * MINUTE
        assert row["time"].astimezone(UTC) == moment
        assert row["time"].utcoffset() == night.reading(row["step"]).utcoffset()
    done = sorted(
        (e["step"], e["detail"]) for e in events if e["event"] == "activity" and e["step"]
    )
    assert done == sorted((step, f"n{k}") for step, k in expected)
    turned = [(e["step"], e["event"]) for e in events if e["entity"] == "door" and e["step"]]
    words = [(step, "shut" if k % 2 else "opened") for step, k in expected]
    assert turned == [each for i, each in enumerate(words) if not i or each[1] != words[i - 1][1]]
    readings = run.arrow("sensors").to_pylist()
    assert [r["step"] for r in readings] == [step for step in toggles if step]
    [verdict] = run.manifest["expectations"].values()
    reads = [night.reading(step).time() for step in range(STEPS)]
    inside = [time(2, 10) <= reading < time(2, 50) for reading in reads]
    begins = [k for k in range(STEPS) if inside[k] and not (k and inside[k - 1])]
    assert (verdict["holds"] is False) == bool(begins)
    violations = run.arrow("violations").to_pylist() if "violations" in run.tables else []
    ends = [k for k in range(STEPS) if inside[k] and not (k + 1 < STEPS and inside[k + 1])]
    assert [(v["step"], v["last_step"]) for v in violations] == list(zip(begins, ends, strict=True))


ROOMS = "2011-{0}-26 07:00:00 Kitchen K ON Cook\n2011-{0}-27 09:00:00 Bedroom B ON Sleep\n"
FIXES = "time,x,y\n2011-{0}-26 07:00:00,1,1\n2011-{0}-27 09:00:00,2,2\n"


@pytest.mark.parametrize("start", ["2026-03-28", "2026-10-24", "2026-06-01"])
@pytest.mark.parametrize("month", ["01", "03", "06"])  # on 27 March 2011 clocks were put forward
@pytest.mark.parametrize(("name", "text"), [("log.txt", ROOMS), ("log.csv", FIXES)])
def test_a_log_of_other_days_keeps_what_its_clock_read(name, text, month, start, tmp_path):
    path = tmp_path / name
    path.write_text(text.format(month))
    settings = {"start": start, "duration": "2 d", "time_zone": "Europe/Berlin"}
    loaded = fleet2d.load_scenario({"simulation": settings, "floorplan": "bundled"})
    clock = loaded.simulation.clock
    log, begin_us, _ = in_run(read_log(path, time_zone=clock.zone), 0, clock)
    elapsed = (log.moments()[0] - begin_us) // clock.step_us
    assert [f"{clock.time(int(step)):%d %H:%M}" for step in elapsed] == [
        f"{start[-2:]} 07:00",
        f"{int(start[-2:]) + 1:02} 09:00",
    ]
