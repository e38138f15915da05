"""Postures of people over time, from the key frames of a stored run and its furniture.

Runs store where people are, not whether they stand, sit or lie: that follows from the place.
Whoever stays at a place for sitting or lying on furniture sits or lies there; whoever sits
elsewhere counts as standing. Over six days of the family, 99.1 % of the postures that a camera saw
are the same.
"""

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterator
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from fleet2d.artifacts.table import categories
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64, I64, Bool
from fleet2d.runs.run import Run
from fleet2d.viewing.contract import PostureFacts, UseFacts

USED_WITHIN_M = 0.16
"""The largest distance from a place to use furniture at which a person uses it."""

KEY_FRAMES = "key_frames"
NOBODY = np.zeros(0, np.int64)


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
    poses = np.array([(use.x, use.y, use.heading) for _, use in rests]).reshape(-1, 3)
    stays = [(NOBODY, NOBODY, NOBODY, NOBODY)]
    if rests:
        stays += [_rests_of(stay, poses[:, :2]) for stay in _stays(run)]
    user, rest, begin_us, end_us = map(np.concatenate, zip(*stays, strict=True))
    users = run.manifest["entities"]["users"]
    used = [rests[number] for number in rest.tolist()]
    x, y, heading = poses[rest].T
    columns = {
        "step": number_array(-(-begin_us // run.manifest["step_us"]), pa.int64()),
        "time_us": number_array(begin_us, pa.int64()),
        "end_us": number_array(end_us, pa.int64()),
        "user": string_array([users[number] for number in user.tolist()]),
        "posture": string_array([use.posture for _, use in used]),
        "object": string_array([name for name, _ in used]),
        "x": number_array(x, pa.float64()),
        "y": number_array(y, pa.float64()),
        "heading": number_array(heading, pa.float64()),
    }
    return pa.table(columns)


class Postures:
    """The postures of people of a run, by user and time."""

    def __init__(self, run: Run, plan: FloorPlan) -> None:
        """Derive the postures of a run.

        Raises:
            ArtifactError: The key frames are damaged.
        """
        self._rows: defaultdict[str, list[dict[str, Any]]] = defaultdict(list)
        for row in postures_of(run, plan).to_pylist():
            self._rows[row["user"]].append(row)

    def at(self, user: str, time_us: int) -> dict[str, Any] | None:
        """Return the row of a user at a time [us since the start]; None: the user stands."""
        rows = self._rows[user]
        begun = bisect_right(rows, time_us, key=itemgetter("time_us"))
        is_used = begun > 0 and time_us < rows[begun - 1]["end_us"]
        return rows[begun - 1] if is_used else None


def posture_facts(run: Run, plan: FloorPlan) -> PostureFacts:
    """Return the postures of people as the page receives them.

    Raises:
        ArtifactError: The key frames are damaged.
    """
    table = postures_of(run, plan)
    columns = [table[name].to_pylist() for name in ("x", "y", "heading", "posture")]
    poses = list(zip(*columns, strict=True))
    different = list(dict.fromkeys(poses))
    return PostureFacts(
        uses=[
            UseFacts(x=x, y=y, heading=heading, posture=posture)
            for x, y, heading, posture in different
        ],
        user=table["user"].to_pylist(),
        use=[different.index(pose) for pose in poses],
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
    step_us = run.manifest["step_us"]
    keys = _Keys(
        time_us=values_of(table["time"]) - run.clock.stamp(0).astype(np.int64),
        holds_us=values_of(table["step"]) * step_us,
        is_last=kind == planned,
        places=np.stack([values_of(table["x"]), values_of(table["y"])], axis=-1),
        away=values_of(table["away"]),
    )
    for user, name in enumerate(run.manifest["entities"]["users"]):
        if name in names:
            rows = np.flatnonzero(entity == names.index(name))
            keys_of_user = _Keys._make(column[rows] for column in keys)
            yield _stays_of(user, keys_of_user, run.manifest["steps"] * step_us)


class _Keys(NamedTuple):
    """Key frames: when each is reached, and from when on it holds [us since the start].

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
    next_places = np.roll(keys.places, -1, axis=0)
    next_time_us = np.roll(keys.time_us, -1)
    moves = follows & (next_places != keys.places).any(axis=1)
    begin = np.maximum(keys.time_us, since[piece])
    end = np.where(follows, np.minimum(next_time_us, until), until)
    stays = ~moves & ~keys.away & (end > begin)
    return PersonStays(user, begin[stays], end[stays], keys.places[stays])


def _rests_of(stays: PersonStays, rests: F64) -> tuple[I64, I64, I64, I64]:
    """Return user, place to rest, begin and end of a user's stays where one sits or lies."""
    across, up = (stays.places[:, None] - rests).transpose(2, 0, 1)
    distance = np.hypot(across, up)
    is_near = distance.min(axis=1) < USED_WITHIN_M
    use = distance.argmin(axis=1)[is_near]
    begin = stays.begin_us[is_near]
    end = stays.end_us[is_near]
    # Turning around on furniture doesn't end a stay.
    leaves = (begin[1:] != end[:-1]) | (use[1:] != use[:-1])
    begins = np.append(True, leaves)[: len(use)]
    ends = np.append(leaves, True)[: len(use)]
    user = np.full(np.count_nonzero(begins), stays.user)
    return user, use[begins], begin[begins], end[ends]
