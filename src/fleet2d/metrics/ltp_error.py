"""Errors of long-term presence: distances of the estimate from the true occupancy of rooms."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.algorithms.observations import NOWHERE
from fleet2d.algorithms.presence.belief import ANYONE, HOURS, Presence, presence_of
from fleet2d.algorithms.presence.estimator import LN_2, natural_log
from fleet2d.configuration.units import PositiveDuration
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.plan import read_only
from fleet2d.floorplan.space import Space
from fleet2d.kernels import F64, I64, Bool
from fleet2d.kernels import earth_mover as minimal_cost
from fleet2d.metrics.metric import Metric
from fleet2d.runtime.clock import DAY_US, HOUR_US
from fleet2d.runtime.local_time import EPOCH, even_parts

# Clearance that a person needs to walk from room to room [m].
RADIUS = 0.2
# Total variation at which burn-in ends.
BURN_IN = 0.1
MEAN = "mean"
# From the Monday before the epoch to the epoch.
MONDAY_US = EPOCH.weekday() * DAY_US


def total_variation(truth: F64, estimate: F64) -> F64:
    """Return 1/2 sum |p - q|: the largest difference in probability of any set of rooms, 0 to 1.

    Like the other distances, it sums over the last axis.

    Example:
        >>> float(total_variation(np.array([0.5, 0.5]), np.array([0.75, 0.25])))
        0.25
    """
    return np.abs(truth - estimate).sum(axis=-1) / 2


def kl_divergence(truth: F64, estimate: F64, alpha: float = 1e-3) -> F64:
    """Return sum p ln(p / q') in nats, with q' = (q + alpha) / (1 + alpha rooms).

    p is the truth and q the estimate; the smoothing by `alpha` keeps it finite where an estimate
    has ruled out a room. Rooms with p = 0 add nothing. At least 0 up to rounding, and above 0
    even where p = q, by less than alpha times the number of rooms.

    Example:
        >>> float(kl_divergence(np.array([1.0, 0.0]), np.array([0.5, 0.5])).round(4))
        0.6931
    """
    smoothed = (estimate + alpha) / (1 + alpha * estimate.shape[-1])
    return _relative_entropy(truth, smoothed)


def jensen_shannon(truth: F64, estimate: F64) -> F64:
    """Return 1/2 KL(p || m) + 1/2 KL(q || m) with m = (p + q) / 2, to base 2: from 0 to 1.

    Example:
        >>> float(jensen_shannon(np.array([1.0, 0.0]), np.array([0.0, 1.0])))
        1.0
    """
    both = _relative_entropy(np.stack([truth, estimate]), (truth + estimate) / 2).sum(axis=0)
    return np.clip(both / (2 * LN_2), 0.0, 1.0)


def _relative_entropy(p: F64, q: F64) -> F64:
    is_positive = p > 0
    ratio = np.where(is_positive, p, 1) / np.where(is_positive, q, 1)
    return (p * natural_log(ratio)).sum(axis=-1)


def room_gaps(truth: F64, estimate: F64) -> F64:
    """Return |p - q| of each room."""
    return np.abs(truth - estimate)


def earth_mover(truth: F64, estimate: F64, cost: F64) -> F64:
    """Return the earth mover's distance between two distributions.

    The minimum of sum f_ij cost_ij over flows f >= 0 from room to room that turn q into p. Solved
    exactly, by successive shortest paths; mass that both have in a room stays.

    Args:
        truth: float64 (..., rooms), each sums to one.
        estimate: float64 (..., rooms), each sums to one.
        cost: float64 (rooms, rooms), finite, distances on foot [m]; 0 on the diagonal, and the
            triangle inequality holds.

    Example:
        >>> metres = np.array([[0.0, 4, 9], [4, 0, 5], [9, 5, 0]])
        >>> float(earth_mover(np.array([0.5, 0.5, 0]), np.array([0.5, 0, 0.5]), metres))
        2.5
    """
    rooms = len(cost)
    moved = minimal_cost(estimate.reshape(-1, rooms), truth.reshape(-1, rooms), cost)
    return moved.reshape(truth.shape[:-1])


def rank_correlation(truth: F64, estimate: F64) -> F64:
    """Return the rank correlation of the rooms: Kendall's tau, -1 to 1.

    (concordant - discordant) / pairs, over the pairs of rooms that differ in truth; pairs tied in
    the estimate are neither (Somers' D of the estimate given the truth: without ties Kendall's
    tau). So it can be 1 with rooms that are never used. It is 1 if no rooms differ in truth.

    Example:
        >>> float(rank_correlation(np.array([0.6, 0.4, 0, 0]), np.array([0.5, 0.3, 0.2, 0])))
        1.0
        >>> float(rank_correlation(np.array([0.5, 0.3, 0.2]), np.array([0.5, 0.2, 0.3])).round(4))
        0.3333
    """
    true = np.sign(truth[..., :, None] - truth[..., None, :])
    signs = true * np.sign(estimate[..., :, None] - estimate[..., None, :])
    pairs = np.abs(true).sum(axis=(-2, -1))
    balance = signs.sum(axis=(-2, -1))
    return np.where(pairs > 0, balance / np.maximum(pairs, 1), 1.0)


def steps_in_places(history: History, state: Present) -> I64:
    """Return the number of steps that each user was in each place: int64 (users + 1, rooms + 1).

    The last column is away. The last row is for anyone: steps with somebody in the room, and last
    with nobody at home.
    """
    users = [history.poses(user) for user in state.users]
    rows = [poses.time_in_rooms for poses in users]
    if len(users) == 1:
        return np.array(rows * 2)
    visits = [*(poses.visits for poses in users), _nobody(history)]
    begin, end, room = (np.concatenate(column) for column in zip(*visits, strict=True))
    at, is_there = _occupied(begin, end, room, len(state.home.rooms))
    lengths = np.diff(at, append=len(history))
    return np.array([*rows, (is_there * lengths[:, np.newaxis]).sum(axis=0)])


def _nobody(history: History) -> tuple[I64, I64, I64]:
    """Return a visit nowhere that lasts all the time: so there is one."""
    return np.array([0]), np.array([len(history)]), np.array([NOWHERE])


def _occupied(
    begin: I64, end: I64, room: I64, rooms: int, at: I64 | None = None
) -> tuple[I64, Bool]:
    """Return where stretches begin in which nobody changes room, and the places with somebody.

    Args:
        begin: The first step of each visit to a room, counted from the first step of all.
        end: One past the last step of each.
        room: The room of each; NOWHERE is -1, the last place.
        rooms: The number of rooms.
        at: Steps at which stretches begin, too.

    Returns:
        int64 (stretches,), and bool (stretches, rooms + 1), the last for nobody at home.
    """
    at = np.unique(begin if at is None else np.concatenate([at, begin]))
    change = np.zeros((len(at) + 1, rooms + 1), np.int64)
    np.add.at(change, (np.searchsorted(at, begin), room), 1)
    np.add.at(change, (np.searchsorted(at, end), room), -1)
    is_there = np.cumsum(change[:-1], axis=0) > 0
    is_there[:, -1] = ~is_there[:, :-1].any(axis=1)
    return at, is_there


def steps_by_hour(history: History, state: Present) -> I64:
    """Return the same by hour of the week: int64 (168, users + 1, rooms + 1)."""
    steps = len(history)
    step_us = round(history.step_s * 1e6)
    begin_us = history.first * step_us
    # Of each part between two changes of the clock: its hours, and the steps at which they begin.
    hours, hour_begins = np.zeros((2, 0), np.int64)
    for since, until, start_us in even_parts(state.start, begin_us, begin_us + steps * step_us):
        zero_us = start_us + MONDAY_US  # on the clock at the start, since a Monday
        of_part = np.arange((zero_us + since) // HOUR_US, -(-(zero_us + until) // HOUR_US))
        at_us = np.maximum(of_part * HOUR_US - zero_us, since) - begin_us
        hours = np.append(hours, of_part)
        hour_begins = np.append(hour_begins, -(-at_us // step_us))
    visits = [*(history.poses(user).visits for user in state.users), _nobody(history)]
    begin, end, room = (np.concatenate(column) for column in zip(*visits, strict=True))
    counts = np.zeros((HOURS, len(visits), len(state.home.rooms) + 1), np.int64)
    # Each visit is divided into the hours that it lasts: how many, and which of them a part is in.
    first = np.searchsorted(hour_begins, begin, side="right") - 1
    parts = np.searchsorted(hour_begins, end) - first
    visit = np.repeat(np.arange(len(begin)), parts)
    hour = np.arange(len(visit)) + np.repeat(first - np.cumsum(parts) + parts, parts)
    part_begin = np.maximum(begin[visit], hour_begins[hour])
    part_end = np.minimum(end[visit], np.append(hour_begins, steps)[hour + 1])
    row = np.repeat(np.arange(len(visits)), [len(begins) for begins, _, _ in visits])[visit]
    place = room[visit]  # NOWHERE is -1: the last column
    np.add.at(counts, (hours[hour] % HOURS, row, place), part_end - part_begin)
    # In these stretches the hour is the same, too.
    at, is_there = _occupied(begin, end, room, len(state.home.rooms), hour_begins)
    stretches = is_there * np.diff(at, append=steps)[:, np.newaxis]
    at_hour = np.searchsorted(at, hour_begins)
    counts[:, -1] = 0
    np.add.at(counts[:, -1], hours % HOURS, np.add.reduceat(stretches, at_hour, axis=0))
    return counts


def shares(counts: I64, steps: float) -> tuple[F64, F64]:
    """Return the shares of rooms in the time at home (NaN if there was none), and that of away."""
    rooms = counts[..., :-1].astype(np.float64)
    total = rooms.sum(axis=-1, keepdims=True)
    home = np.where(total > 0, rooms / np.where(total > 0, total, 1), np.nan)
    return home, counts[..., -1] / max(steps, 1)


def walking_distances(home: Home, space: Space) -> F64:
    """Return the distance on foot between the middles of each two rooms [m].

    Without a route between them it is twice the longest distance.

    Args:
        home: The home.
        space: Where people can walk in it.

    Returns:
        float64 (rooms, rooms), symmetric, read-only.
    """
    return home.cached(("walking distances", space), lambda: read_only(_distances(home, space)))


def _distances(home: Home, space: Space) -> F64:
    lattice = home.plan.lattice
    places = []
    for room in home.rooms:
        x, y = lattice.point_at(room.anchor_xy)
        places.append(space.nearest(x, y, None, room.index) or (x, y))
    points = np.array(places, np.int64).reshape(-1, 2)
    metres = np.array([space.distances(place, points) for place in places])
    metres = np.minimum(metres, metres.T)
    is_reachable = np.isfinite(metres)
    longest = float(metres[is_reachable].max(initial=0.0)) or 1.0
    metres = np.where(is_reachable, metres, 2 * longest)
    np.fill_diagonal(metres, 0)
    return metres


class LongTermMetric(Metric):
    """Base of metrics that compare long-term presence with the true occupancy of a window.

    The truth is the time that each user really was in each room, from the beginning of the run, or
    in the last `window`, up to now: not what the user's routine plans.

    Attributes:
        of: The algorithm whose presence is measured.
        window: Time over which the truth is counted, in whole periods; null: the whole run.
    """

    of: str
    window: PositiveDuration | None = None

    def reads(self) -> tuple[str, ...]:
        """Return the name of the algorithm that it measures."""
        return (self.of,)

    def start(self, home: Home) -> None:
        """Begin counting."""
        # Counts and steps of each period in the window; of all periods without one.
        self.periods: list[tuple[I64, int]] = []
        self.days = 0.0

    def count(self, counts: I64, history: History) -> tuple[I64, int]:
        """Add a period; return the counts of the window and its steps."""
        self.days += history.days
        self.periods.append((counts, len(history)))
        if self.window is not None:
            del self.periods[: -max(1, math.floor(self.window / self.period))]
        all_counts, steps = zip(*self.periods, strict=True)
        total = np.sum(all_counts, axis=0), sum(steps)
        if self.window is None:
            self.periods = [total]
        return total

    @classmethod
    def summary(cls, result: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the rows of users, and that of anyone, unless it is that of the only user."""
        rows = super().summary(result)
        return {user: row for user, row in rows.items() if len(rows) != 2 or user != ANYONE}


def as_columns(rows: Sequence[Mapping[str, float]]) -> dict[str, F64]:
    """Return rows of the same measures, at least one, as a column for each measure."""
    columns = zip(*(row.values() for row in rows), strict=True)
    return {name: np.array(column) for name, column in zip(rows[0], columns, strict=True)}


class LtpError(LongTermMetric):
    """Distance of long-term presence from the true occupancy, over time.

    Per period and user (and anyone), with p the true and q the estimated shares of rooms:

    - tv: total variation, 1/2 sum |p - q|, 0 to 1;
    - js: Jensen-Shannon divergence to base 2, 0 to 1;
    - kl: sum p ln(p / q'), q' being q smoothed by 0.001 [nats];
    - max_gap, mean_gap: greatest and mean |p - q| of a room;
    - tau: rank correlation of the rooms, Kendall's tau of the pairs that differ in truth, -1 to 1
      (`distances.rank_correlation`): it matters to a robot that goes to the likeliest rooms;
    - earth_mover_m: earth mover's distance on foot from q to p [m], between the middles
      of rooms; only with `given: home`;
    - inside: share of rooms whose p lies in the stated interval, if there is one and `given: home`.

    The shares are `given: home`; or of all time with away as one more room (`away`); or given at
    home at each hour of the week (`hour_of_week`), where distances are means over the hours,
    weighted by the time that the user was at home.

    The result has the values at the end; `flips`, the number of updates that changed the likeliest
    room at home; and `burn_in_day`: the first day n, from 1, from whose end on tv was at most
    0.1, left out if there is none. Users who were never at home are left out.

    Attributes:
        given: The shares that are compared.
    """

    hidden = frozenset({"js", "kl", "max_gap", "mean_gap", "tau", "flips"})
    unit = "at the end"
    units = {
        "tv": "share of time in wrong rooms",
        "earth_mover_m": "m on foot from the truth",
        "inside": "share of rooms in interval",
        "burn_in_day": "day from which tv is small",
    }
    least = {"": 0, "tau": -1}
    largest = {"js": 1, "tau": 1}
    better = {"": "lower", "inside": "higher", "tau": "higher"}

    given: Literal["home", "away", "hour_of_week"] = "home"

    def start(self, home: Home) -> None:
        """Begin counting."""
        super().start(home)
        self.home = home
        self.space = home.space(RADIUS)
        self.last: dict[str, dict[str, float]] = {}
        self.within: dict[str, float | None] = {}
        self.best: dict[str, tuple[int, int]] = {}  # the likeliest room, and its changes so far

    def update(self, history: History, state: Present) -> Any:
        """Compare the presence with the truth so far; return a row for each user."""
        count_steps = steps_by_hour if self.given == "hour_of_week" else steps_in_places
        counts, steps = self.count(count_steps(history, state), history)
        presence = presence_of(self.of, state)
        if presence is None:
            return None
        everybody = (*state.users, ANYONE)
        was_home = counts[..., :-1].any(axis=-1).reshape(-1, len(everybody))
        rows = np.flatnonzero(was_home.any(axis=0))
        users = [everybody[row] for row in rows.tolist()]
        if not users:
            return None
        columns = self._compare(presence, users, counts[..., rows, :], steps)
        self._note(users, columns, presence)
        return {"user": np.array(users, dtype=object), **columns}

    def _compare(
        self, presence: Presence, users: Sequence[str], counts: I64, steps: int
    ) -> dict[str, F64]:
        """Return each measure of the error, by its name: float64 (users,)."""
        if self.given == "hour_of_week":
            return as_columns(
                [self._by_hour(presence, u, counts[:, row]) for row, u in enumerate(users)]
            )
        home, away = shares(counts, steps)
        if self.given == "away":
            truth = np.concatenate([home * (1 - away)[:, None], away[:, None]], axis=1)
            return self._distances(truth, np.array([presence.with_away(user) for user in users]))
        estimate = np.array([presence.share(user) for user in users])
        columns = self._distances(home, estimate)
        metres = walking_distances(self.home, self.space)
        columns["earth_mover_m"] = earth_mover(home, estimate, metres)
        if presence.low() is not None and presence.high() is not None:
            low = np.array([presence.low(user) for user in users])
            high = np.array([presence.high(user) for user in users])
            columns["inside"] = ((low <= home) & (home <= high)).mean(axis=1)
        return columns

    def _by_hour(self, presence: Presence, user: str, counts: I64) -> dict[str, float]:
        home, _ = shares(counts, 1)
        weight = counts[:, :-1].sum(axis=1).astype(np.float64)
        some = weight > 0
        weight = weight[some] / weight.sum()
        estimate = presence.by_hour_of_week(user)[some]
        columns = self._distances(home[some], estimate)
        return {name: float((values * weight).sum()) for name, values in columns.items()}

    def _distances(self, truth: F64, estimate: F64) -> dict[str, F64]:
        """Return distances of shares (n, rooms), float64 (n,) each."""
        gaps = room_gaps(truth, estimate)
        return {
            "tv": total_variation(truth, estimate),
            "js": jensen_shannon(truth, estimate),
            "kl": kl_divergence(truth, estimate),
            "max_gap": gaps.max(axis=-1),
            "mean_gap": gaps.mean(axis=-1),
            "tau": rank_correlation(truth, estimate),
        }

    def _note(self, users: Sequence[str], columns: Mapping[str, F64], presence: Presence) -> None:
        """Store the newest rows, days since which tv is small, and changes of the best room."""
        today = max(1, math.ceil(round(self.days, 9)))
        rows = zip(*(values.tolist() for values in columns.values()), strict=True)
        for user, row in zip(users, rows, strict=True):
            self.last[user] = dict(zip(columns, row, strict=True))
            best = int(presence.share(user).argmax())
            last_best, flips = self.best.get(user, (best, 0))
            self.best[user] = best, flips + (best != last_best)
            if self.last[user]["tv"] > BURN_IN:
                self.within[user] = None
            elif self.within.get(user) is None:
                self.within[user] = today

    def result(self) -> dict[str, Any]:
        """Return {user: {tv, js, …, flips, burn_in_day}} at the end."""
        results = {user: {**row, "flips": self.best[user][1]} for user, row in self.last.items()}
        for user, day in self.within.items():
            if day is not None:
                results[user]["burn_in_day"] = day
        return results


class LtpGap(LongTermMetric):
    """Gap of long-term presence per room, over time: |p - q|, given at home.

    p is the user's true share of time at home in the room so far, or in the last `window`, q the
    estimate. Stored per period, user (and anyone) and room: both, the gap, and the ends of the
    interval, if there is one. The result has the gaps at the end, and their mean for each user.
    Users who were never at home are left out.
    """

    unit = "share of time, gap at the end"
    better = {"": "lower"}

    def start(self, home: Home) -> None:
        """Begin counting."""
        super().start(home)
        self.rooms = [room.name for room in home.rooms]
        self.last: dict[str, F64] = {}

    def update(self, history: History, state: Present) -> Any:
        """Compare the presence with the truth so far; return a row for each user and room."""
        counts, steps = self.count(steps_in_places(history, state), history)
        presence = presence_of(self.of, state)
        is_known = counts[:, :-1].any(axis=1)
        users = np.array([*state.users, ANYONE], dtype=object)[is_known]
        if presence is None or not len(users):
            return None
        truth, _ = shares(counts[is_known], steps)
        estimate = np.array([presence.share(user) for user in users])
        gaps = room_gaps(truth, estimate)
        self.last |= dict(zip(users.tolist(), gaps, strict=True))
        columns = {
            "user": np.repeat(users, len(self.rooms)),
            "room": np.tile(np.array(self.rooms, dtype=object), len(users)),
            "true_share": truth.ravel(),
            "share": estimate.ravel(),
            "gap": gaps.ravel(),
        }
        for name, end in (("low", presence.low), ("high", presence.high)):
            if end() is not None:
                columns[name] = np.array([end(user) for user in users]).ravel()
        return columns

    def result(self) -> dict[str, Any]:
        """Return {user: {room: gap, "mean": of all rooms}} at the end."""
        return {
            user: {MEAN: float(gaps.mean()), **dict(zip(self.rooms, gaps.tolist(), strict=True))}
            for user, gaps in self.last.items()
        }

    @classmethod
    def summary(cls, result: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return each user's mean gap, and the largest gap with its room."""
        summary = {}
        for user, gaps in super().summary(result).items():
            rooms = {room: gap for room, gap in gaps.items() if room != MEAN}
            worst = max(rooms, key=lambda room: rooms[room])
            summary[user] = {MEAN: gaps[MEAN], worst: rooms[worst]}
        return summary
