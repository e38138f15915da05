"""Random spellings of one log: each is read as what it says, or refused; none silently wrong."""

import json
import random
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import fleet2d
from fleet2d.errors import InputError
from fleet2d.logs.layout import read_log
from fleet2d.logs.log import PositionLog, begin_of_run

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


class Variant(NamedTuple):
    """A file, the keys with which it is read, and what it says."""

    path: Path
    keys: str
    times: list[datetime]
    plan: np.ndarray


def spelled_times(draw: random.Random, times: list[datetime]) -> tuple[list[Any], str, bool]:
    """Return times in a spelling, the end of their column's name, and whether they have a zone."""
    utc = [(time - BERLIN).replace(tzinfo=UTC) for time in times]
    epoch_us = [round(time.timestamp() * 1e6) for time in utc]
    kind = draw.choice(["iso", "T", "Z", "offset", "s", "ms", "us", "ns", "dots", "slash", "us12", "utc", "rounded", "clock"])  # fmt: skip
    if kind in ("s", "ms", "us", "ns"):
        unit = {"s": 1e6, "ms": 1e3, "us": 1, "ns": 1e-3}[kind]
        values = [round(us / unit, 6) if kind == "s" else round(us / unit) for us in epoch_us]
        return values, draw.choice(["", f"_{kind}", f" [{kind}]"]), True
    if kind == "rounded":
        return [f"{us / 1e6:.5E}" for us in epoch_us], "", True
    if kind == "utc":
        return [f"{t:%Y-%m-%d %H:%M:%S.%f}" for t in utc], " (UTC)", True
    form = {
        "iso": "%Y-%m-%d %H:%M:%S.%f", "T": "%Y-%m-%dT%H:%M:%S.%f",
        "Z": "%Y-%m-%dT%H:%M:%S.%fZ", "offset": "%Y-%m-%d %H:%M:%S.%f+02:00",
        "dots": "%d.%m.%Y %H:%M:%S.%f", "slash": "%d/%m/%Y %H:%M:%S.%f",
        "us12": "%m/%d/%Y %I:%M:%S.%f %p", "clock": "%H:%M:%S.%f",
    }[kind]  # fmt: skip
    said = utc if kind == "Z" else times
    return [t.strftime(form) for t in said], "", kind in ("Z", "offset")


def variant(draw: random.Random, folder: Path) -> Variant:
    """Write a log of two tags in a random spelling."""
    start = datetime(2026, 4, draw.randint(1, 28), 8)
    times = [start + timedelta(seconds=s) for s in (0.0, 1.5, 3.0, 10.25)]
    plan = np.array([[draw.uniform(1, 12), draw.uniform(1, 9)] for _ in times])
    unit, rotation = draw.choice(list(METRES)), draw.choice([0, 90, 180, 270, 33.0])
    flip, origin = draw.random() < 0.5, (draw.uniform(-5, 5), draw.uniform(-5, 5))
    turn = np.deg2rad(rotation)
    back = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    log = (back @ (plan - origin).T).T / METRES[unit] * (1, -1 if flip else 1)
    tag, other = draw.choice(IDS)
    named_unit = draw.choice(["", f" [{unit}]", f" ({unit})", f"_{unit}"])
    values, end, has_zone = spelled_times(draw, times)
    digits = draw.choice([3, 6])
    cells: dict[str, list[Any]] = {"time": [], "id": [], "x": [], "y": []}
    for row, (x, y) in enumerate(log.tolist()):
        for who, off in ((tag, 0.0), (other, 7.0)):
            for name, value in zip(cells, (values[row], who, round(x + off, digits), round(y - off, digits)), strict=True):  # fmt: skip
                cells[name].append(value)
    order = draw.sample(list(cells), 4)
    heads = {
        name: draw.choice(NAMES[name]) + {"time": end, "id": ""}.get(name, named_unit)
        for name in order
    }
    path, decimal = write(draw, folder, {heads[n]: cells[n] for n in order}, heads["id"])
    keys = {"type": "replay", "path": path.name, "day": "date"}
    frame: dict[str, Any] = {"rotation_deg": rotation, "flip_y": flip, "origin": list(origin)}
    if not named_unit or draw.random() < 0.1:
        frame["scale"] = METRES[unit]
    keys["frame"] = frame
    if has_zone and draw.random() < 0.95:
        keys["time_zone"] = "Europe/Berlin"
    if decimal and draw.random() < 0.5:
        keys["decimal_comma"] = decimal == ","
    if draw.random() < 0.5 and "/" in str(values[0]):
        keys["day_first"] = "M" not in str(values[0])
    text = json.dumps(keys)[:-1]
    quote = draw.choice(['"', '"', "'", ""])
    text += "}" if draw.random() < 0.05 else f", id: {quote}{tag}{quote}}}"
    return Variant(path, text, times, plan)


def write(
    draw: random.Random, folder: Path, columns: dict[str, list[Any]], id_name: str
) -> tuple[Path, str]:
    """Write a table in a random format; return it and the decimal mark, if it is of CSV."""
    form = draw.choice(["csv", "csv", "csv", "csv", "tsv", "parquet", "jsonl"])
    path = folder / f"log.{form}"
    if form == "parquet":
        ids = columns[id_name]
        if all(text == str(int(text)) for text in ids if text.isdigit()) and "".join(ids).isdigit():
            columns = {**columns, id_name: [int(text) for text in ids]}
        pq.write_table(pa.table(columns), path)
        return path, ""
    if form == "jsonl":
        rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
        path.write_text("".join(json.dumps(row) + "\n" for row in rows))
        return path, ""
    decimal = draw.choice([".", ",", ","])
    delimiter = "\t" if form == "tsv" else draw.choice([",", ";", ";", "\t"])
    quoted, thousands = draw.random() < 0.8, draw.random() < 0.1

    def cell(value: Any) -> str:
        text = str(value)
        if isinstance(value, int | float):
            text = f"{value:,}" if thousands else repr(value)
            text = text.translate(str.maketrans(".,", ",.")) if decimal == "," else text
        return f'"{text}"' if quoted and delimiter in text else text

    lines = [[cell(name) for name in columns]]
    lines += [[cell(value) for value in row] for row in zip(*columns.values(), strict=True)]
    if draw.random() < 0.3:
        lines = [[*row, '"seen\nby a"' if number else "note"] for number, row in enumerate(lines)]
    text = "\n".join(delimiter.join(row) for row in lines) + "\n"
    if draw.random() < 0.2:
        text = f"sep={delimiter}\n{text}"
    if draw.random() < 0.5:
        text = text.replace("\n", "\r\n")
    path.write_bytes(text.encode(draw.choice(["utf-8", "utf-8-sig", "utf-16", "cp1252"])))
    return path, decimal


def verdict(variant: Variant) -> str:
    """Return whether a variant is read as it is meant, wrong, or refused and why."""
    scenario = variant.path.with_name("home.yaml")
    scenario.write_text(
        f"extends: bundled:paper\nsimulation: {{start: {variant.times[0]:%Y-%m-%dT%H:%M}, duration:"
        f" 30 s}}\nusers:\n  ana: {variant.keys}\n"
    )
    try:
        loaded = fleet2d.load_scenario(scenario)
        replay: Any = loaded.users["ana"].behaviors[0]
        log = read_log(
            replay.path, replay.format, id=replay.id, **replay.reading(loaded.simulation.clock)
        )
        assert isinstance(log, PositionLog)
        plan = replay.frame.in_unit(log.unit_m).to_plan(log.xy)
        begin_us, _ = begin_of_run(log, replay.day, loaded.simulation.clock)
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
