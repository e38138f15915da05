"""Random spellings of one log: each is read as what it says, or refused; none silently wrong."""

import json
import random
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl
import pytest

import fleet2d
from fleet2d.errors import InputError
from fleet2d.logs.layout import read_log
from fleet2d.logs.log import PositionLog, in_run

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048}
IDS = [
    ("007", "7"), ("7", "8"), ("0x6733", "0x6734"), ("1e3", "1000"), ("1.0", "1"), ("no", "yes"),
    ("12:30", "750"), ("-1", "1"), ("nan", "null"), ("true", "false"), ("4.2", "4,2"), ("ana", "Ana"),
]  # fmt: skip
NAMES = {
    "time": ["time", "Timestamp", "datetime", "t"],
    "id": ["id", "Tag", "tag_id", "TAG ID"],
    "x": ["x", "X", "pos_x", "Position X"],
    "y": ["y", "Y", "pos_y", "Position Y"],
}
BERLIN = timedelta(hours=2)  # in April


FORMS = [
    "%Y-%m-%d %H:%M:%S.%f", "%Y-%m-%dT%H:%M:%S.%f", "%Y-%m-%d %H:%M:%S.%f+02:00",
    "%d.%m.%Y %H:%M:%S.%f", "%d/%m/%Y %H:%M:%S.%f", "%m/%d/%Y %I:%M:%S.%f %p", "%H:%M:%S.%f",
]  # fmt: skip


class Variant(NamedTuple):
    """A file, the keys with which it is read, and what it says."""

    path: Path
    keys: str
    times: list[datetime]
    plan: np.ndarray


def spelled_times(draw, times):
    """Return times in a spelling, the end of their column's name, and whether they have a zone."""
    utc = [(time - BERLIN).replace(tzinfo=UTC) for time in times]
    kind = draw.choice(["local", "local", "local", "epoch", "epoch", "rounded", "Z", "utc"])
    if kind == "local":
        form = draw.choice(FORMS)
        return [time.strftime(form) for time in times], "", form.endswith("+02:00")
    if kind == "epoch":
        unit, digits = draw.choice([("s", 0), ("ms", 3), ("us", 6), ("ns", 9)])
        seconds = [time.timestamp() for time in utc]
        values = [round(s, 6) if unit == "s" else round(s * 10**digits) for s in seconds]
        return values, draw.choice(["", f"_{unit}", f" [{unit}]"]), True
    if kind == "rounded":
        return [f"{time.timestamp():.5E}" for time in utc], "", True
    form, end = {"Z": ("%Y-%m-%dT%H:%M:%S.%fZ", ""), "utc": (FORMS[0], " (UTC)")}[kind]
    return [time.strftime(form) for time in utc], end, True


def variant(draw, folder):
    """Write a log of two tags in a random spelling."""
    start = datetime(2026, 4, draw.randint(1, 28), 8)
    times = [start + timedelta(seconds=s) for s in (0.0, 1.5, 3.0, 10.25)]
    plan = np.array([[draw.uniform(1, 12), draw.uniform(1, 9)] for _ in times])
    unit = draw.choice(list(METRES))
    frame = {
        "rotation_deg": draw.choice([0, 90, 180, 270, 33.0]),
        "flip_y": draw.random() < 0.5,
        "origin": [draw.uniform(-5, 5), draw.uniform(-5, 5)],
    }
    z = (plan - frame["origin"]) @ [1, 1j] * np.exp(-1j * np.deg2rad(frame["rotation_deg"]))
    x, y = z.real / METRES[unit], z.imag / METRES[unit] * (-1 if frame["flip_y"] else 1)
    tag, other = draw.choice(IDS)
    named_unit = draw.choice(["", f" [{unit}]", f" ({unit})", f"_{unit}"])
    values, end, has_zone = spelled_times(draw, times)
    digits = draw.choice([3, 6])
    rows = pl.DataFrame({"time": values, "id": tag, "x": x, "y": y}, strict=False)
    both = pl.concat([rows, rows.with_columns(pl.lit(other).alias("id"), pl.col("x") + 7)])
    both = both.with_row_index("n").sort(pl.col("n") % len(times), "n").drop("n")
    heads = {
        name: draw.choice(NAMES[name]) + {"time": end, "id": ""}.get(name, named_unit)
        for name in draw.sample(list(NAMES), 4)
    }
    table = both.with_columns(pl.col("x", "y").round(digits)).select(*heads).rename(heads)
    path, decimal = write(draw, folder, table)
    keys = {"type": "replay", "path": path.name, "day": "date", "frame": frame}
    if not named_unit or draw.random() < 0.1:
        frame["scale"] = METRES[unit]
    if has_zone and draw.random() < 0.95:
        keys["time_zone"] = "Europe/Berlin"
    if decimal and draw.random() < 0.5:
        keys["decimal_comma"] = decimal == ","
    if draw.random() < 0.5 and "/" in str(values[0]):
        keys["day_first"] = "M" not in str(values[0])
    quote = draw.choice(['"', '"', "'", ""])
    name = "" if draw.random() < 0.05 else f", id: {quote}{tag}{quote}"
    return Variant(path, json.dumps(keys)[:-1] + name + "}", times, plan)


def write(draw, folder, table):
    """Write a table in a random format; return it and the decimal mark, if it is of CSV."""
    form = draw.choice(["csv", "csv", "csv", "csv", "tsv", "parquet", "jsonl"])
    path = folder / f"log.{form}"
    if form == "parquet":
        table.write_parquet(path)
    elif form == "jsonl":
        table.write_ndjson(path)
    if form in ("parquet", "jsonl"):
        return path, ""
    decimal = draw.choice([".", ",", ","])
    delimiter = "\t" if form == "tsv" else draw.choice([",", ";", ";", "\t"])
    quoted, thousands = draw.random() < 0.8, draw.random() < 0.1

    def cell(value):
        text = str(value)
        if isinstance(value, int | float):
            text = f"{value:,}" if thousands else repr(value)
            text = text.translate(str.maketrans(".,", ",.")) if decimal == "," else text
        return f'"{text}"' if quoted and delimiter in text else text

    lines = [delimiter.join(map(cell, row)) for row in [table.columns, *table.iter_rows()]]
    if draw.random() < 0.3:
        note = f'{delimiter}"seen\nby a"'
        lines = [f"{lines[0]}{delimiter}note", *(line + note for line in lines[1:])]
    if draw.random() < 0.2:
        lines.insert(0, f"sep={delimiter}")
    text = draw.choice(["\n", "\r\n"]).join([*lines, ""])
    path.write_bytes(text.encode(draw.choice(["utf-8", "utf-8-sig", "utf-16", "cp1252"])))
    return path, decimal


def verdict(variant):
    """Return whether a variant is read as it is meant, wrong, or refused and why."""
    scenario = variant.path.with_name("home.yaml")
    scenario.write_text(
        f"extends: bundled:paper\nsimulation: {{start: {variant.times[0]:%Y-%m-%dT%H:%M}, duration:"
        f" 30 s}}\nusers:\n  ana: {variant.keys}\n"
    )
    try:
        loaded = fleet2d.load_scenario(scenario)
        replay = loaded.users["ana"].behaviors[0]
        log = read_log(
            replay.path, replay.format, id=replay.id, **replay.reading(loaded.simulation.clock)
        )
        assert isinstance(log, PositionLog)
        plan = replay.frame.in_unit(log.unit_m).to_plan(log.xy)
        log, begin_us, _ = in_run(log, replay.day, loaded.simulation.clock)
    except InputError as error:
        return f"refused: {error}"
    seconds = [(time - variant.times[0]).total_seconds() for time in variant.times]
    # Epochs of seconds are rounded to microseconds.
    is_right = len(plan) == len(seconds) and np.allclose(
        (log.time_us - begin_us) / 1e6, seconds, atol=2e-6
    )
    return "right" if is_right and np.allclose(plan, variant.plan, atol=2e-3) else "wrong"


@pytest.mark.parametrize(
    ("first", "count"), [(0, 25), pytest.param(1000, 500, marks=pytest.mark.slow)]
)
def test_no_spelling_of_a_log_is_silently_wrong(tmp_path, first, count):
    verdicts = {}
    for seed in range(first, first + count):
        folder = tmp_path / str(seed)
        folder.mkdir()
        verdicts[seed] = verdict(variant(random.Random(seed), folder))

    assert [seed for seed, said in verdicts.items() if said == "wrong"] == []
    assert list(verdicts.values()).count("right") > count / 3
