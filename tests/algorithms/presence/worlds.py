"""Small simulated homes for the tests of presence: a person who is a Markov chain, robots that look."""

from datetime import datetime
from types import SimpleNamespace
from typing import cast

import numpy as np

from fleet2d.algorithms.evidence import Evidence, PatchEvidence, SightingCounts, times_of_bins
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.rooms.room import Room
from fleet2d.runtime.clock import Clock

MONDAY = datetime(2026, 1, 5)
SUNDAY_LATE = datetime(2026, 1, 4, 23, 40)
DAY = 1440
DETECTION = 0.95


def home_of(rooms):
    """A home of rooms of 3 by 4 m in a row, of the kinds that most homes have."""
    kinds = ["bedroom", "kitchen", "living_room", "bathroom", "hallway", "office"]
    boxes = [
        Room(
            i,
            f"room_{i}",
            kinds[i % 6],
            (),
            4800,
            12.0,
            (3 * i + 1.5, 2.0),
            (3 * i, 0, 3 * i + 3, 4),
        )
        for i in range(rooms)
    ]
    return cast("Home", SimpleNamespace(rooms=tuple(boxes)))


def transitions(rooms, seed, dwell=40.0):
    """How a Markov person goes on: rooms and last away, of different popularity and dwell."""
    random = np.random.default_rng(seed)
    popularity = random.dirichlet(np.full(rooms + 1, 1.5))
    stay = 1 - 1 / (dwell * random.uniform(0.4, 2.0, rooms + 1))
    rows = np.tile(popularity, (rooms + 1, 1)) * (1 - stay)[:, None]
    rows[np.arange(rooms + 1), np.arange(rooms + 1)] += stay
    return rows


def person(bins, rooms, seed, dwell=40.0):
    """Where a Markov person is in each bin: a room, or `rooms` for away."""
    sums = transitions(rooms, seed, dwell).cumsum(axis=1)
    uniform = np.random.default_rng([seed, 2]).random(bins)
    where, now = np.empty(bins, np.int64), 0
    for t in range(bins):
        now = min(int(np.searchsorted(sums[now], uniform[t])), rooms)
        where[t] = now
    return where


def evidence(where, rooms, policy, seed):
    """What a robot that sees the whole room it is in, and nothing else, watched and saw."""
    random = np.random.default_rng([seed, 1])
    bins = len(where)
    watched, seen = np.zeros((bins, rooms)), np.zeros((bins, 2, rooms), np.int64)
    sightings, at, sees_person = np.zeros(rooms, np.int64), 0, False
    for t in range(bins):
        at = policy(t, at, sees_person, sightings, random)
        watched[t, at] = 1
        sees_person = where[t] == at and random.random() < DETECTION
        if sees_person:
            seen[t, :, at] = 1
            sightings[at] += 1
    return evidence_of(watched, seen)


def patrol(t, at, sees_person, sightings, random):
    """Ten bins in a room, then another at random."""
    return int(random.integers(len(sightings))) if t % 10 == 0 else at


def hangout(t, at, sees_person, sightings, random):
    """Every half hour to the room with the most sightings, one time in ten to any."""
    if t % 30:
        return at
    explore = random.random() < 0.1
    return int(random.integers(len(sightings))) if explore else int(np.argmax(sightings))


def follow(t, at, sees_person, sightings, random):
    """Stay while the person is seen, else go from room to room."""
    return at if sees_person else (at + 1) % len(sightings)


def counts_of(seen):
    """The counts in an array (bins, users + 1, places)."""
    by_user = seen.transpose(1, 0, 2)
    user, seen_bin, place = np.nonzero(by_user)
    bins, users, places = seen.shape
    return SightingCounts(
        user, seen_bin, place, by_user[user, seen_bin, place], (bins, users, places)
    )


def evidence_of(
    watched,
    seen,
    start=MONDAY,
    bin_steps=1,
    by_patch=None,
    begin=0,
):
    """Evidence in bins of a minute; without patches, each room is one."""
    bins, rooms = watched.shape
    sightings = counts_of(seen)
    clock = Clock(start, 60_000_000 // bin_steps, begin + bins * bin_steps)
    day, minute = times_of_bins(clock, begin, bin_steps, bins)
    by_patch = by_patch or patch_evidence(np.arange(rooms), np.ones(rooms, int), watched, seen)
    return Evidence(day, minute, bin_steps, watched, sightings, by_patch, begin)


def patch_evidence(room, cells, shown, seen):
    """Evidence by patches that are watched for whole bins."""
    shown_255 = np.rint(255 * np.minimum(shown, 1)).astype(np.uint8)
    return PatchEvidence(room, cells, shown, shown, shown_255, counts_of(seen))


def pieces(evidence, length=60):
    """The same evidence in pieces, as updates bring it."""
    begins = range(0, len(evidence), length)
    return [evidence.between(i, min(i + length, len(evidence))) for i in begins]


def shares_at_home(where, rooms):
    """The realised shares of rooms, given at home."""
    counts = np.bincount(where, minlength=rooms + 1)[:rooms]
    return counts / counts.sum()


def any_evidence(seed, bins=40, users=2, rooms=3, steps=6):
    """Random evidence, from Sunday 23:40 on, so that it has two days."""
    random = np.random.default_rng(seed)
    watched = random.choice([0.0, 0.3, 0.3, 0.7, 1.0], (bins, rooms))
    hit = (random.random((bins, users + 1, rooms)) < 0.15) & (watched[:, None] > 0)
    seen = np.where(hit, random.integers(1, steps + 1, hit.shape), 0)
    seen[:, -1] = np.maximum(seen[:, -1], seen[:, :-1].max(axis=1, initial=0))
    return evidence_of(watched, seen, SUNDAY_LATE, steps)
