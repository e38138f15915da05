"""Replayed sensors: the readings of a real sensor, from a table."""

from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from fleet2d.configuration.components import register
from fleet2d.configuration.problems import suggest
from fleet2d.configuration.units import InputPath
from fleet2d.entities.objects.home_object import Sensor, SensorView
from fleet2d.floorplan.home import Home
from fleet2d.kernels import I64
from fleet2d.logs.log import Day, LogError, PositionLog, begin_of_run
from fleet2d.runtime.clock import Clock

NAMES = {
    "time": ("time", "timestamp", "t", "datetime", "time_s"),
    "sensor": ("sensor", "id", "name", "entity"),
    "state": ("state", "value", "message", "on"),
}
"""The names that a column may have, if the user gives none."""
ON = frozenset({"on", "open", "true", "1", "1.0", "present", "opened", "motion"})
OFF = frozenset({"off", "close", "closed", "false", "0", "0.0", "absent", "clear", "none"})


@register("object", "replay_sensor")
class ReplaySensor(Sensor):
    """A real sensor, whose readings are replayed from a table.

    Attributes:
        path: The table (.csv, .parquet, .jsonl) with a row for each change of its state.
        room: The room that its readings name.
        columns: Names of the columns time, state and sensor, as {state: value}.
        sensor: The sensor, if the table has several.
        time_zone: The time zone of the home, if the times have one or count from 1970.
        sort: Sort rows whose time runs backwards; else they are refused.
        day: The day of the table that is the first of the run: a number from 0, its date, or the
            first of the same weekday.
    """

    path: InputPath
    room: str = Field(min_length=1)
    columns: dict[str, str] = Field(default={})
    sensor: str | None = None
    time_zone: str | None = None
    sort: bool = False
    day: Day = 0

    def files(self) -> tuple[Path, ...]:
        """Return the file that it reads."""
        return (self.path,)

    def read(self, clock: Clock) -> None:
        """Read the table.

        Raises:
            LogError: It can't be read, lacks a column, has no such sensor, or a state is unknown.
        """
        import pyarrow as pa
        import pyarrow.compute as pc

        from fleet2d.logs.positions import Stamps, columns_of, local_times, read_table, times_of

        table = read_table(self.path)
        named = columns_of(table, self.columns, self.path, NAMES, ("time", "state"))
        if "sensor" in named:
            names = pc.cast(table[named["sensor"]], pa.string())
            known = sorted(str(name) for name in pc.unique(names).to_pylist())
            name = known[0] if self.sensor is None and len(known) == 1 else self.sensor
            if name not in known:
                which = f"no sensor {name!r}{suggest(name, known)}" if name else "several sensors"
                raise LogError(f"{self.path} has {which}; select one by 'sensor'")
            table = table.filter(pc.equal(names, name))
        line = np.arange(table.num_rows) + (2 if self.path.suffix.lower() == ".csv" else 1)
        states = [_is_on(value, self.path) for value in table[named["state"]].to_pylist()]
        time_us, has_date, has_zone = times_of(table[named["time"]], self.path, line)
        stamps = Stamps(time_us, line, has_date=has_date, has_zone=has_zone)
        usable = np.ones(len(line), bool)
        local = local_times(
            self.path, "readings", stamps, usable, [], time_zone=self.time_zone, sort=self.sort
        )
        nothing = np.zeros((len(local.row), 2))
        log = PositionLog(
            self.path, "readings", local.first_day, local.time_us, nothing, nothing[:, 0]
        )
        self._steps = (local.time_us - begin_of_run(log, self.day, clock)) // clock.step_us
        self._on = np.array(states, bool)[local.row]

    def sense(self, view: SensorView, home: Home) -> tuple[I64, I64]:
        """Return the steps at which it is on, caused by nobody known."""
        steps = np.arange(view.first, view.first + view.steps, dtype=np.int64)
        row = np.searchsorted(self._steps, steps, side="right") - 1
        on = steps[(row >= 0) & self._on[row]]
        return on, np.full(len(on), -1, np.int64)


def _is_on(value: Any, path: Path) -> bool:
    """Return whether a state means on.

    Raises:
        LogError: It is no known word.
    """
    word = str(value).strip().lower()
    if word not in ON | OFF:
        raise LogError(f"{path}: the state {value!r} is unknown: expected ON or OFF, OPEN or CLOSE")
    return word in ON
