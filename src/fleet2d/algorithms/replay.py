"""Replay: what an algorithm on a real robot believed, from its own log."""

from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from pydantic import Field

from fleet2d.algorithms.algorithm import Algorithm, Present, RoomDistribution
from fleet2d.algorithms.history import History
from fleet2d.configuration.components import register
from fleet2d.configuration.problems import suggest
from fleet2d.configuration.units import InputPath, micros
from fleet2d.floorplan.home import Home
from fleet2d.logs.log import AWAY, LogError
from fleet2d.logs.positions import Stamps, columns_of, local_times, numbers_of, read_table, times_of
from fleet2d.runtime.clock import midnight_of

NAMES = {
    "time": ("time", "timestamp", "t", "datetime", "time_s"),
    "room": ("room", "place"),
    "share": ("share", "probability", "p"),
    "user": ("user", "person"),
}
"""The names that a column may have, if the user gives none."""


@register("algorithm", "replay")
class ReplayedOutput(Algorithm):
    """Put out what an algorithm believed according to a table: shares of rooms at some times.

    A table of a stored run, such as its `ltp.parquet`, is one; shares are given at home, so rows of
    `away` are left out. At each update the newest shares count that aren't later; before the first
    there is no output.

    Attributes:
        path: The table (.csv, .parquet, .jsonl): a row for each time and room.
        columns: Names of its columns time, room, share and user, as {share: belief}.
        user: The person whose shares count, if the table has several.
        time_zone: The time zone of the home, if its times have one or count from 1970.
    """

    path: InputPath
    columns: dict[str, str] = Field(default={})
    user: str | None = None
    time_zone: str | None = None

    def files(self) -> list[Path]:
        """Return the file that it reads."""
        return [self.path]

    def start(self, home: Home) -> None:
        """Read the table.

        Raises:
            LogError: It can't be read, lacks a column, or names rooms or people of another home.
        """
        table = read_table(self.path)
        named = columns_of(table, self.columns, self.path, NAMES, ("time", "room", "share"))
        if "user" in named:
            table = self._of_user(table, named["user"])
        rooms = [room.name for room in home.rooms]
        table = table.filter(pc.not_equal(pc.cast(table[named["room"]], pa.string()), AWAY))
        texts = pc.cast(table[named["room"]], pa.string()).combine_chunks()
        for name in pc.unique(texts).to_pylist():
            if name not in rooms:
                raise LogError(f"{self.path}: there is no room {name!r}{suggest(str(name), rooms)}")
        room = pc.index_in(texts, value_set=pa.array(rooms)).to_numpy(zero_copy_only=False)
        line = np.arange(table.num_rows) + (2 if self.path.suffix.lower() == ".csv" else 1)
        share = numbers_of(table, named["share"], self.path, line)
        time_us, has_date, has_zone = times_of(table[named["time"]], self.path, line)
        stamps = Stamps(time_us, line, has_date=has_date, has_zone=has_zone)
        local = local_times(
            self.path, "shares", stamps, np.isfinite(share), [], time_zone=self.time_zone, sort=True
        )
        begins = np.flatnonzero(np.append(True, np.diff(local.time_us) > 0))
        self._times = local.time_us[begins]
        self._day = local.first_day
        row_of = np.cumsum(np.append(True, np.diff(local.time_us) > 0)) - 1
        self._shares = np.zeros((len(begins), len(rooms)))
        np.add.at(self._shares, (row_of, room[local.row]), share[local.row])

    def update(self, history: History, state: Present) -> Any:
        """Return the newest shares; None before the first."""
        midnight = midnight_of(state.start)
        if self._day is not None:
            midnight = datetime.combine(self._day, datetime.min.time())
        row = int(np.searchsorted(self._times, micros(state.time - midnight), side="right")) - 1
        return None if row < 0 else RoomDistribution(self._shares[row])

    def _of_user(self, table: pa.Table, column: str) -> pa.Table:
        """Return the rows of one person."""
        users = pc.cast(table[column], pa.string())
        known = sorted(str(name) for name in pc.unique(users).to_pylist())
        name = known[0] if self.user is None and len(known) == 1 else self.user
        if name not in known:
            which = f"has nobody named {name!r}{suggest(name, known)}" if name else "has several"
            raise LogError(f"{self.path} {which}: select one by 'user': {', '.join(known)}")
        return table.filter(pc.equal(users, name))
