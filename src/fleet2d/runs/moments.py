"""Moments and parts of a run: steps from times in words, and positions between two steps."""

import re
from contextlib import suppress
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from fleet2d.artifacts.manifest import Manifest
from fleet2d.artifacts.table import categories
from fleet2d.configuration.units import micros, parse_duration
from fleet2d.errors import ArtifactError, InputError
from fleet2d.kernels import I64
from fleet2d.runs.run import Run
from fleet2d.runtime.clock import Clock, midnight_of

_DAY = re.compile(r"day (\d+)(?:[ ,]+(\d{1,2}):(\d{2})(?::(\d{2}))?)?", re.IGNORECASE)
_STEP = re.compile(r"step (\d+)", re.IGNORECASE)


def step_of(text: str, clock: Clock, option: str = "--at") -> int:
    """Return the step that a text names; the end of the run is the number of its steps.

    Args:
        text: ``day 3 18:30`` (day 1 is the date of the start), a local time, a time since the
            start, or ``step 5000``.
        clock: The clock of the run.
        option: The option that has the text as its value, for messages.

    Raises:
        InputError: The text names no moment, or one outside the run.

    Example:
        >>> clock = Clock(datetime(2026, 1, 5, 6), 1_000_000, 10 * 86_400)
        >>> step_of("day 1 06:00:30", clock), step_of("2026-01-05T07:00", clock)
        (30, 3600)
        >>> step_of("2 h", clock), step_of("step 9", clock)
        (7200, 9)
    """
    elapsed = _elapsed_us(text.strip(), clock)
    if elapsed is None:
        raise InputError(
            f"{option} {text!r} names no moment: write 'day 3 18:30', '2026-01-07T18:30', a time"
            " since the start such as '2 d 14 h', or 'step 5000'"
        )
    step = clock.step_at_or_after(elapsed)
    if not 0 <= step <= clock.steps:
        begin = clock.start
        end = clock.time(clock.steps)
        raise InputError(
            f"{option} {text!r} is not within the run, which lasts from {begin:%Y-%m-%d %H:%M} to"
            f" {end:%Y-%m-%d %H:%M}"
        )
    return step


def steps_of(run: Run, begin: str | None, end: str | None) -> tuple[int, int]:
    """Return the first step of a part of a run, and the step before which it ends.

    Args:
        run: The run.
        begin: A text as for `step_of`; None for the start of the run.
        end: A text as for `step_of`; None for the end of the run.

    Raises:
        InputError: A text names no moment of the run, or the part is empty.
    """
    clock = run.clock
    first = 0 if begin is None else step_of(begin, clock, "--from")
    last = clock.steps if end is None else step_of(end, clock, "--to")
    if first >= last:
        raise InputError(f"--from {begin} is not before --to {end}: there is nothing to show")
    return first, last


def _elapsed_us(text: str, clock: Clock) -> int | None:
    if step := _STEP.fullmatch(text):
        return int(step[1]) * clock.step_us
    if day := _DAY.fullmatch(text):
        number, *parts = day.groups()
        hour, minute, second = (int(part or 0) for part in parts)
        if hour > 24 or minute > 59 or second > 59 or len(number) > 6:
            return None
        midnight = midnight_of(clock.start)
        since = timedelta(days=int(number) - 1, hours=hour, minutes=minute, seconds=second)
        return clock.elapsed(midnight + since)
    with suppress(ValueError):
        moment = datetime.fromisoformat(text)
        return None if moment.tzinfo and not clock.zone else clock.elapsed(moment)
    with suppress(ValueError):
        return micros(parse_duration(text))
    return None


KEY_FRAMES = "key_frames"


def part_of_run(run: Run, first: int, end: int) -> Run:
    """Return the part of a run from step `first` to before step `end`, in memory.

    Its steps count from 0, it has no metrics, and it can't be reproduced. Random walks become
    positions.

    Args:
        run: The run.
        first: Its first step.
        end: The step before which it ends.

    Raises:
        ArtifactError: A table is damaged.
    """
    clock = run.clock
    if (first, end) == (0, clock.steps):
        return run
    content = {
        **run.manifest,
        "start": clock.time(first).isoformat(),
        "steps": end - first,
        "simulated_s": (end - first) * clock.step_us / 1e6,
        "metrics": {},
        "tables": {},
        "digest": None,
    }
    names = [name for name in run.tables if not name.startswith("layer.")]
    tables = {name: _cut(run, name, first, end) for name in names}
    part = Run(None, Manifest(**content), names, tables.__getitem__)
    part.plan = run.plan
    return part


def key_frame_rows(table: Any, first: int, end: int) -> I64:
    """Return the rows of a table of key frames that define the poses between two steps."""
    step = table["step"].to_numpy()
    entity, names = categories(table["entity"])
    kind, kinds = categories(table["kind"])
    planned = kinds.index("planned") if "planned" in kinds else len(kinds)
    reached = kind != planned
    selected = np.zeros(len(step), np.bool_)
    for code in range(len(names)):
        rows = np.flatnonzero(entity == code)
        rows_before = rows[(step[rows] <= first) & reached[rows]]
        rows_after = rows[step[rows] >= end]
        low = rows_before[-1] if len(rows_before) else rows[0]
        high = rows_after[0] if len(rows_after) else rows[-1]
        is_between = (rows >= low) & (rows <= high)
        selected[rows[is_between]] = True
    return np.flatnonzero(selected)


def _cut(run: Run, name: str, first: int, end: int) -> Any:
    """Return the rows of a table within a part of a run, with steps relative to its first step."""
    table = run.tables[name]
    if name == KEY_FRAMES:
        table = expand_walks(run)
        table = table.take(key_frame_rows(table, first, end))
    else:
        step = table["step"].to_numpy()
        is_within = (step >= first) & (step < end)
        table = table.take(np.flatnonzero(is_within))
    import pyarrow as pa

    step = np.maximum(table["step"].to_numpy() - first, 0)
    index = table.schema.get_field_index("step")
    return table.set_column(index, table.schema.field(index), pa.array(step))


def expand_walks(run: Run) -> Any:
    """Return the key frames of a run with random walks replaced by a position for each step.

    Raises:
        ArtifactError: A walk can't be rebuilt.
    """
    import pyarrow as pa

    table = run.tables[KEY_FRAMES]
    entity, kind = (table[name].cast("string").to_numpy(False) for name in ("entity", "kind"))
    walkers = list(dict.fromkeys(entity[kind == "walk"].tolist()))
    if not walkers:
        return table
    interval = timedelta(microseconds=run.manifest["step_us"])
    parts = [table.take(np.flatnonzero(~np.isin(entity, walkers)))]
    parts += [positions(run, name, interval) for name in walkers]
    # Plain strings without metadata are the form of a new table.
    texts = {"entity": pa.string(), "kind": pa.string()}
    fields = [(field.name, texts.get(field.name, field.type)) for field in table.schema]
    schema = pa.schema(fields)
    return pa.concat_tables([part.cast(schema) for part in parts])


def positions(run: Run, name: str, interval: timedelta) -> Any:
    """Return the positions of a body at equal intervals, in the columns of key_frames.

    Raises:
        ArtifactError: The run stored no key frames, or the path can't be rebuilt.
    """
    import pyarrow as pa

    if KEY_FRAMES not in run.tables:
        raise ArtifactError("the run stored no key frames: run it with artifacts.key_frames=true")
    path = run.path(name, interval)
    count = len(path.step)
    return pa.table(
        {
            "step": path.step,
            "time": run.clock.stamps(path.step),
            "entity": pa.array([name] * count, pa.string()),
            "kind": pa.array(["track"] * count, pa.string()),
            "x": path.x,
            "y": path.y,
            "heading": path.heading,
            "away": path.away,
        }
    )
