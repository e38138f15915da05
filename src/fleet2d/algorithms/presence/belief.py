"""Presence: the probabilities of where people are, the output of presence algorithms."""

from collections.abc import Sequence
from datetime import datetime, timedelta
from functools import lru_cache
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.algorithm import Present, RoomDistribution
from fleet2d.algorithms.history import History
from fleet2d.configuration.problems import suggest
from fleet2d.errors import ComponentError
from fleet2d.kernels import F64, I64, Bool
from fleet2d.runtime.clock import DAY_S

ANYONE = "anyone"
AWAY = "away"
# The hours of a week, from Monday 00:00.
HOURS = 168
SUM_ERROR = 1e-6  # largest deviation of a distribution's sum from one


class BeliefSeries(NamedTuple):
    """Room probabilities at the end of each bin of a period, given the evidence up to then.

    Attributes:
        begin: First step of the first bin.
        bin_steps: Steps of a bin.
        home: float64 (bins, users + 1, rooms), as `Presence.share`.
        away: float64 (bins, users + 1), as `Presence.away`.
    """

    begin: int
    bin_steps: int
    home: F64
    away: F64


class Presence:
    """For each user, and for anyone, the probability of each room given at home, and of away.

    It is immutable. *Anyone* is in every room with at least one user: `share("anyone")` is the time
    during which each room has somebody in it, divided by the sum over rooms, and `away("anyone")`
    is the share of time with nobody at home.

    Attributes:
        users: Names of the users.
        names: Names of the rows: the users, and anyone.
        time: The local time that it describes.
        track: For real-time presence, the belief at the end of each bin; else None.

    Raises:
        ComponentError: Shapes don't fit, a value isn't finite, or rooms don't sum to one.

    Example:
        >>> from datetime import datetime
        >>> home = np.array([[0.75, 0.25], [0.75, 0.25]])
        >>> presence = Presence(("ana",), home, np.array([0.5, 0.5]), datetime(2026, 1, 5))
        >>> presence.share("ana"), presence.away("ana"), presence.with_away("ana")
        (array([0.75, 0.25]), 0.5, array([0.375, 0.125, 0.5  ]))
    """

    def __init__(
        self,
        users: Sequence[str],
        home: F64,
        away: F64,
        time: datetime,
        interval: tuple[F64, F64] | None = None,
        track: BeliefSeries | None = None,
    ) -> None:
        """Keep the arrays, which become read-only.

        Args:
            users: Names of the users.
            home: float64 (users + 1, rooms), each row sums to one; the last row is anyone.
            away: float64 (users + 1,).
            time: The local time that it describes.
            interval: Lower and upper ends, float64 (users + 1, rooms + 1) each, away last.
            track: The belief at the end of each bin of the period.
        """
        self.users = tuple(users)
        self.time = time
        self.track = track
        self.names = (*self.users, ANYONE)
        self._home = home
        self._away = away
        self._interval = interval
        rows = len(self.names)
        if home.ndim != 2 or home.shape[0] != rows or away.shape != (rows,):
            raise ComponentError(
                f"presence of {rows - 1} users and anyone needs shares of shape ({rows}, rooms) and"
                f" away of shape ({rows},), got {home.shape} and {away.shape}"
            )
        check_distributions(home, away, self.names)
        for array in (home, away, *(interval or ())):
            array.setflags(write=False)

    @property
    def arrays(self) -> tuple[F64, F64]:
        """Shares of everybody, float64 (users + 1, rooms), and of away, float64 (users + 1,)."""
        return self._home, self._away

    def row(self, user: str) -> int:
        """Return the row of a user in the arrays.

        Raises:
            ComponentError: There is no such user.
        """
        if user not in self.names:
            raise ComponentError(
                f"no presence estimate for user {user!r}{suggest(user, self.names)}"
            )
        return self.names.index(user)

    def share(self, user: str = ANYONE) -> F64:
        """Return the probability of each room, given at home: float64 (rooms,), sums to one."""
        return self._home[self.row(user)]

    def away(self, user: str = ANYONE) -> float:
        """Return the probability that a user is away, or that nobody is at home."""
        return float(self._away[self.row(user)])

    def with_away(self, user: str = ANYONE) -> F64:
        """Return the probability of each room, and last that of away: float64 (rooms + 1,)."""
        away = self.away(user)
        return np.append(self.share(user) * (1 - away), away)

    def low(self, user: str = ANYONE) -> F64 | None:
        """Return the lower ends of the intervals of `share`, (rooms,); None if there are none."""
        return None if self._interval is None else self._interval[0][self.row(user), :-1]

    def high(self, user: str = ANYONE) -> F64 | None:
        """Return the upper ends of the intervals of `share`, (rooms,); None if there are none."""
        return None if self._interval is None else self._interval[1][self.row(user), :-1]

    def at(self, time: datetime) -> "Presence":
        """Return the presence at another time: itself, unless it depends on time."""
        return self

    def by_hour_of_week(self, user: str = ANYONE) -> F64:
        """Return `share` at each hour of the week from Monday 00:00: float64 (168, rooms)."""
        return np.broadcast_to(self.share(user), (HOURS, self._home.shape[1]))

    def to_columns(self, rooms: Sequence[str]) -> dict[str, NDArray[Any]]:
        """Return a row for each user and room, and for each user one of away.

        The shares of rooms are given at home and sum to one; that of away is a share of all time.

        Raises:
            ComponentError: The home has another number of rooms.
        """
        places = [*rooms, AWAY]
        if len(rooms) != self._home.shape[1]:
            raise ComponentError(
                f"presence has {self._home.shape[1]} rooms, but the home has {len(rooms)}"
            )
        columns: dict[str, NDArray[Any]] = {
            **belief_labels(self.names, tuple(places)),
            "share": np.concatenate([self._home, self._away[:, None]], axis=1).ravel(),
        }
        if self._interval is not None:
            columns |= {"low": self._interval[0].ravel(), "high": self._interval[1].ravel()}
        return columns

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        """Return itself: it never changes."""
        return self

    def __repr__(self) -> str:
        """Return the class name and the shares of anyone."""
        rounded = self.share().round(3).tolist()
        return f"{type(self).__name__}({self.time.isoformat()}, anyone: {rounded})"


@lru_cache(64)
def belief_labels(names: tuple[str, ...], places: tuple[str, ...]) -> dict[str, NDArray[Any]]:
    """Return the columns that are the same each time: a row for each name and place."""
    user = np.repeat(np.array(names, dtype=object), len(places))
    room = np.tile(np.array(places, dtype=object), len(names))
    for labels in (user, room):
        labels.setflags(write=False)
    return {"user": user, "room": room}


def are_distributions(home: F64, away: F64) -> Bool:
    """Return whether shares (..., rooms) sum to one and away (...) is from 0 to 1: bool (...).

    NaN is not a distribution.

    Example:
        >>> are_distributions(np.array([[0.5, 0.5], [0.5, 0.6], [np.nan, 1]]), np.zeros(3)).tolist()
        [True, False, False]
    """
    is_share = (np.abs(home.sum(axis=-1) - 1) <= SUM_ERROR) & (home >= 0).all(axis=-1)
    return is_share & (away >= 0) & (away <= 1)


def check_distributions(home: F64, away: F64, names: Sequence[str], source: str = "") -> None:
    """Refuse a belief that is no distribution.

    Args:
        home: float64 (rows, rooms), or (bins, rows, rooms), shares of rooms.
        away: float64 (rows,), or (bins, rows).
        names: The names of the rows.
        source: The beginning of the message.

    Raises:
        ComponentError: Shares don't sum to one, or one is below 0, above 1 or NaN.
    """
    is_valid = are_distributions(home, away)
    if not is_valid.all():
        at = tuple(np.argwhere(~is_valid)[0].tolist())
        in_bin = f" in bin {at[0]} of {len(home)}" if len(at) == 2 else ""
        raise ComponentError(
            f"{source}presence of {names[at[-1]]!r}{in_bin} is not a distribution: shares"
            f" {home[at].tolist()}, which sum to {home[at].sum():g}, away {away[at]:g}"
        )


class WeeklyPresence(Presence):
    """Presence that depends on the hour of the week."""

    def __init__(
        self,
        users: Sequence[str],
        week: tuple[F64, F64],
        time: datetime,
        track: BeliefSeries | None = None,
    ) -> None:
        """Keep the probabilities for each slot of the week.

        Args:
            users: Names of the users.
            week: Shares float64 (slots, users + 1, rooms), and away float64 (slots, users + 1), for
                slots of equal length that divide the week from Monday 00:00.
            time: The local time that it describes.
            track: The belief at the end of each bin of the period.
        """
        self._week = week
        slot = slot_of_week(time, len(week[1]))
        super().__init__(users, week[0][slot], week[1][slot], time, track=track)

    def at(self, time: datetime) -> "WeeklyPresence":
        """Return the presence at another time."""
        return WeeklyPresence(self.users, self._week, time)

    def by_hour_of_week(self, user: str = ANYONE) -> F64:
        """Return `share` at each hour of the week from Monday 00:00: float64 (168, rooms)."""
        slots = np.arange(HOURS) * len(self._week[1]) // HOURS
        return self._week[0][slots, self.row(user)]


def slot_of_week(time: datetime, slots: int = HOURS) -> int:
    """Return the index of the slot of the week that a time is in.

    Example:
        >>> slot_of_week(datetime(2026, 1, 5, 7, 30)), slot_of_week(datetime(2026, 1, 11, 23, 59))
        (7, 167)
    """
    seconds = ((time.weekday() * 24 + time.hour) * 60 + time.minute) * 60 + time.second
    return seconds * slots // (7 * DAY_S)


def with_anyone(chains: list[F64], unknown: Bool | None = None) -> F64:
    """Add the row of anyone to the probabilities of the users' places.

    A room is empty if each user, independently of the others, is somewhere else; it certainly has
    somebody in it where an unknown person was perceived; None: nowhere.

    Args:
        chains: Each user's probability of each place, float64 (bins, rooms + 1).
        unknown: bool (bins, rooms), where an unknown person was perceived; None: nowhere.

    Returns:
        float64 (bins, users + 1, rooms + 1).
    """
    if unknown is None:
        unknown = np.zeros_like(chains[0][:, :-1], np.bool_)
    empty = np.where(unknown, 0.0, 1.0)
    all_away = np.where(unknown.any(axis=1), 0.0, 1.0)
    for places in chains:
        empty = empty * (1 - np.minimum(places[:, :-1], 1))
        all_away = all_away * places[:, -1]
    anyone = np.concatenate([1 - empty, all_away[:, None]], axis=1)
    return np.stack([*chains, anyone], axis=1)


def presence_of(name: str, state: Present) -> Presence | None:
    """Return an algorithm's newest output as presence; None before the first.

    A RoomDistribution counts for every user and for anyone, who are never away.

    Raises:
        ComponentError: The output is neither a Presence nor a RoomDistribution.
    """
    output: Any = state.outputs.get(name)
    if output is None or isinstance(output, Presence):
        return output
    if isinstance(output, RoomDistribution):
        rows = len(state.users) + 1
        home = np.tile(output.share, (rows, 1))
        return Presence(state.users, home, np.zeros(rows), state.time)
    raise ComponentError(
        f"algorithms.{name} returned a {type(output).__name__}; this metric measures presence:"
        " a Presence or a RoomDistribution"
    )


class BeliefReader:
    """Reads the belief of an algorithm at the end of each bin of a period.

    That is the output's `track`; for an output without one, it is the forecast of the newest output
    before the period.

    Attributes:
        name: Name of the algorithm.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._previous: Presence | None = None

    def at(self, history: History, state: Present, ends: I64) -> tuple[F64, F64] | None:
        """Return shares of rooms (bins, users + 1, rooms) and of away (bins, users + 1).

        Args:
            history: The period.
            state: The present, with the algorithm's newest output.
            ends: The last step of each whole bin of the period.

        Returns:
            None if the algorithm has no output for these bins.

        Raises:
            ComponentError: The algorithm has another period than the metric.
        """
        previous = self._previous
        presence = presence_of(self.name, state)
        self._previous = presence if presence is not None else previous
        if not len(ends):
            return None
        track = None if presence is None else presence.track
        if track is None:
            if previous is None:
                return None
            times = [state.start + timedelta(seconds=(int(e) + 1) * history.step_s) for e in ends]
            home, away = zip(*(previous.at(time).arrays for time in times), strict=True)
            return np.array(home), np.array(away)
        last = track.begin + len(track.away) * track.bin_steps - 1
        begin = int(ends[0]) + 1 - track.bin_steps
        if last < history.first:  # an output of an earlier period: this one had no whole bin
            return None
        if track.begin != begin or last != ends[-1]:
            raise ComponentError(
                f"the output of algorithms.{self.name} is about the steps {track.begin} to {last},"
                f" but this metric needs steps {begin} to {int(ends[-1])}, the whole bins of its"
                " period: give both the same period"
            )
        return track.home, track.away
