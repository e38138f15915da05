"""Postures of people over time, from the key frames of a stored run and its furniture.

Runs store where people are, and not whether they stand, sit or lie: that follows from the place.
Somebody who stays at the place where furniture is sat or lain on sits or lies there. Who sits where
there is no furniture for it counts as standing: over six days of the family, 99.1 % of the postures
that a camera saw are the same.
"""

from bisect import bisect_right
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from fleet2d.artifacts.table import categories
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64, I64, Bool
from fleet2d.runs.run import Run
from fleet2d.viewing.contract import PostureFacts, UseFacts

USED_WITHIN_M = 0.16
"""Somebody who is farther from a place to use furniture than this doesn't use it."""

KEY_FRAMES = "key_frames"


NAMES = ("step", "time_us", "end_us", "user", "posture", "object", "x", "y", "heading")


class PersonStays(NamedTuple):
    """The stretches of time [us since the start] that a user spends at one place [m] at home."""

    user: int
    begin_us: I64
    end_us: I64
    places: F64


def postures_of(run: Run, plan: FloorPlan) -> Any:
    """Return a table of the stretches of time in which people sit or lie, by user and time.

    Its columns are `step`, the first one; `time_us` and `end_us`, microseconds since the start;
    `user`; `posture`, sit or lie; `object`, the piece of furniture; `x` and `y` [m] and `heading`
    [rad], where and how the user is on it. At all other times people stand, walk or are away.
    Furniture counts as it is when the run starts.

    Raises:
        ArtifactError: The key frames are damaged.

    Example:
        >>> import fleet2d
        >>> run = fleet2d.run("bundled:paper", "simulation.duration=1 h")
        >>> postures_of(run, run.plan)["posture"].to_pylist()
        ['lie']
    """
    import pyarrow as pa

    from fleet2d.artifacts.arrow import number_array, string_array

    rests = [
        (item.name, use) for item in plan.objects for use in item.uses if use.posture != "stand"
    ]
    places = np.array([(use.x, use.y) for _, use in rests]).reshape(-1, 2)
    users = run.manifest["entities"]["users"]
    stays = [_rests_of(stay, places) for stay in _stays(run)] if rests else []
    user, use, begin_us, end_us = (
        np.concatenate([np.zeros(0, np.int64), *(stay[i] for stay in stays)]) for i in range(4)
    )
    names, uses = zip(*rests, strict=True) if rests else ((), ())
    poses = np.array([(use.x, use.y, use.heading) for use in uses]).reshape(-1, 3)[use].T
    arrays = [
        number_array(-(-begin_us // run.manifest["step_us"]), pa.int64()),
        number_array(begin_us, pa.int64()),
        number_array(end_us, pa.int64()),
        string_array([users[number] for number in user.tolist()]),
        string_array([uses[number].posture for number in use.tolist()]),
        string_array([names[number] for number in use.tolist()]),
        *(number_array(values, pa.float64()) for values in poses),
    ]
    return pa.table(arrays, names=NAMES)


class Postures:
    """The postures of people of a run, by user and time."""

    def __init__(self, run: Run, plan: FloorPlan) -> None:
        """Derive the postures of a run.

        Raises:
            ArtifactError: The key frames are damaged.
        """
        self._begins: dict[str, list[int]] = {}
        self._rows: dict[str, list[dict[str, Any]]] = {}
        for row in postures_of(run, plan).to_pylist():
            self._begins.setdefault(row["user"], []).append(row["time_us"])
            self._rows.setdefault(row["user"], []).append(row)

    def at(self, user: str, time_us: int) -> dict[str, Any] | None:
        """Return the row of a user at a time [us since the start]; None: the user stands."""
        number = bisect_right(self._begins.get(user, []), time_us) - 1
        row = self._rows[user][number] if number >= 0 else None
        return row if row is not None and time_us < row["end_us"] else None


def posture_facts(run: Run, plan: FloorPlan) -> PostureFacts:
    """Return the postures of people as the page receives them.

    Raises:
        ArtifactError: The key frames are damaged.
    """
    table = postures_of(run, plan)
    columns = (table[name].to_pylist() for name in ("x", "y", "heading", "posture"))
    keys = list(zip(*columns, strict=True))
    numbers = {key: number for number, key in enumerate(dict.fromkeys(keys))}
    return PostureFacts(
        uses=[
            UseFacts(x=x, y=y, heading=heading, posture=posture)
            for x, y, heading, posture in numbers
        ],
        user=table["user"].to_pylist(),
        use=[numbers[key] for key in keys],
        from_us=table["time_us"].to_pylist(),
        to_us=table["end_us"].to_pylist(),
    )


def _stays(run: Run) -> Iterator[PersonStays]:
    """Yield the stays of each user at home, in order."""
    if KEY_FRAMES not in run.tables:
        return
    from fleet2d.artifacts.arrow import values_of

    table = run.tables[KEY_FRAMES]
    entity, names = categories(table["entity"])
    kind, kinds = categories(table["kind"])
    planned = kinds.index("planned") if "planned" in kinds else len(kinds)
    start = run.clock.stamp(0).astype(np.int64)
    step_us = run.manifest["step_us"]
    columns = (values_of(table[name]) for name in ("time", "step", "x", "y", "away"))
    time, step, x, y, away = columns
    for user, name in enumerate(run.manifest["entities"]["users"]):
        if name not in names:
            continue
        rows = np.flatnonzero(entity == names.index(name))
        keys = _Keys(
            time_us=time[rows] - start,
            holds_us=step[rows] * step_us,
            is_last=kind[rows] == planned,
            places=np.stack([x[rows], y[rows]], axis=-1),
            away=away[rows],
        )
        yield _stays_of(user, keys, run.manifest["steps"] * step_us)


class _Keys(NamedTuple):
    """Key frames of a body: when each is reached, and from when on it holds [us since the start].

    `is_last` says which are the ends of movements that were interrupted: the next piece of key
    frames begins after them.
    """

    time_us: I64
    holds_us: I64
    is_last: Bool
    places: F64
    away: Bool


def _stays_of(user: int, keys: _Keys, end_us: int) -> PersonStays:
    """Return the stays of a user; a piece of key frames holds until the next one begins."""
    begins = np.append(True, keys.is_last[:-1])
    piece = np.cumsum(begins) - 1
    since = keys.holds_us[begins]
    until = np.append(since[1:], end_us)[piece]
    follows = ~np.append(begins[1:], True)
    moves = follows & (np.roll(keys.places, -1, axis=0) != keys.places).any(axis=1)
    begin = np.maximum(keys.time_us, since[piece])
    end = np.where(follows, np.minimum(np.roll(keys.time_us, -1), until), until)
    stays = ~moves & ~keys.away & (end > begin)
    return PersonStays(user, begin[stays], end[stays], keys.places[stays])


def _rests_of(stays: PersonStays, rests: F64) -> tuple[I64, I64, I64, I64]:
    """Return user, place to rest, begin and end of a user's stays where one sits or lies."""
    far = np.hypot(*(stays.places[:, None] - rests).transpose(2, 0, 1))
    use = far.argmin(axis=1)
    near = far.min(axis=1) < USED_WITHIN_M
    use = use[near]
    begin = stays.begin_us[near]
    end = stays.end_us[near]
    # Who turns around on furniture stays on it.
    begins = np.append(True, (begin[1:] != end[:-1]) | (use[1:] != use[:-1]))[: len(use)]
    ends = np.append(begins[1:], True)[: len(use)]
    return np.full(np.count_nonzero(begins), stays.user), use[begins], begin[begins], end[ends]
