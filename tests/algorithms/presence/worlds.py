"""Small simulated homes for the tests of presence: a person who is a Markov chain, robots that look."""

from collections.abc import Callable
from datetime import datetime
from types import SimpleNamespace
from typing import cast

import numpy as np

from fleet2d.algorithms.evidence import Evidence, PatchEvidence, SightingCounts, times_of_bins
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.rooms.room import Room
from fleet2d.kernels import F64, I64
from fleet2d.runtime.clock import Clock

MONDAY = datetime(2026, 1, 5)
SUNDAY_LATE = datetime(2026, 1, 4, 23, 40)
DAY = 1440
DETECTION = 0.95

Policy = Callable[[int, int, bool, I64, np.random.Generator], int]
"""From bin, room now, whether the person was seen, sightings per room so far, to the next room."""


def home_of(rooms: int) -> Home:
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


def transitions(rooms: int, seed: int, dwell: float = 40.0) -> F64:
    """How a Markov person goes on: rooms and last away, of different popularity and dwell."""
    random = np.random.default_rng(seed)
    popularity = random.dirichlet(np.full(rooms + 1, 1.5))
    stay = 1 - 1 / (dwell * random.uniform(0.4, 2.0, rooms + 1))
    rows = np.tile(popularity, (rooms + 1, 1)) * (1 - stay)[:, None]
    rows[np.arange(rooms + 1), np.arange(rooms + 1)] += stay
    return rows


def person(bins: int, rooms: int, seed: int, dwell: float = 40.0) -> I64:
    """Where a Markov person is in each bin: a room, or `rooms` for away."""
    sums = transitions(rooms, seed, dwell).cumsum(axis=1)
    uniform = np.random.default_rng([seed, 2]).random(bins)
    where, now = np.empty(bins, np.int64), 0
    for t in range(bins):
        now = min(int(np.searchsorted(sums[now], uniform[t])), rooms)
        where[t] = now
    return where


def evidence(where: I64, rooms: int, policy: Policy, seed: int) -> Evidence:
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


def patrol(t: int, at: int, sees_person: bool, sightings: I64, random: np.random.Generator) -> int:
    """Ten bins in a room, then another at random."""
    return int(random.integers(len(sightings))) if t % 10 == 0 else at


def hangout(t: int, at: int, sees_person: bool, sightings: I64, random: np.random.Generator) -> int:
    """Every half hour to the room with the most sightings, one time in ten to any."""
    if t % 30:
        return at
    explore = random.random() < 0.1
    return int(random.integers(len(sightings))) if explore else int(np.argmax(sightings))


def follow(t: int, at: int, sees_person: bool, sightings: I64, random: np.random.Generator) -> int:
    """Stay while the person is seen, else go from room to room."""
    return at if sees_person else (at + 1) % len(sightings)


def counts_of(seen: I64) -> SightingCounts:
    """The counts in an array (bins, users + 1, places)."""
    by_user = seen.transpose(1, 0, 2)
    user, seen_bin, place = np.nonzero(by_user)
    bins, users, places = seen.shape
    return SightingCounts(
        user, seen_bin, place, by_user[user, seen_bin, place], (bins, users, places)
    )


def evidence_of(
    watched: F64,
    seen: I64,
    start: datetime = MONDAY,
    bin_steps: int = 1,
    by_patch: PatchEvidence | None = None,
    begin: int = 0,
) -> Evidence:
    """Evidence in bins of a minute; without patches, each room is one."""
    bins, rooms = watched.shape
    sightings = counts_of(seen)
    clock = Clock(start, 60_000_000 // bin_steps, begin + bins * bin_steps)
    day, minute = times_of_bins(clock, begin, bin_steps, bins)
    by_patch = by_patch or patch_evidence(np.arange(rooms), np.ones(rooms, int), watched, seen)
    return Evidence(day, minute, bin_steps, watched, sightings, by_patch, begin)


def patch_evidence(room: I64, cells: I64, shown: F64, seen: I64) -> PatchEvidence:
    """Evidence by patches that are watched for whole bins."""
    shown_255 = np.rint(255 * np.minimum(shown, 1)).astype(np.uint8)
    return PatchEvidence(room, cells, shown, shown, shown_255, counts_of(seen))


def pieces(evidence: Evidence, length: int = 60) -> list[Evidence]:
    """The same evidence in pieces, as updates bring it."""
    begins = range(0, len(evidence), length)
    return [evidence.between(i, min(i + length, len(evidence))) for i in begins]


def shares_at_home(where: I64, rooms: int) -> F64:
    """The realised shares of rooms, given at home."""
    counts = np.bincount(where, minlength=rooms + 1)[:rooms]
    return counts / counts.sum()


def any_evidence(
    seed: int, bins: int = 40, users: int = 2, rooms: int = 3, steps: int = 6
) -> Evidence:
    """Random evidence, from Sunday 23:40 on, so that it has two days."""
    random = np.random.default_rng(seed)
    watched = random.choice([0.0, 0.3, 0.3, 0.7, 1.0], (bins, rooms))
    hit = (random.random((bins, users + 1, rooms)) < 0.15) & (watched[:, None] > 0)
    seen = np.where(hit, random.integers(1, steps + 1, hit.shape), 0)
    seen[:, -1] = np.maximum(seen[:, -1], seen[:, :-1].max(axis=1, initial=0))
    return evidence_of(watched, seen, SUNDAY_LATE, steps)


def main() -> None:
    """Print the mean total variation of each estimator under each robot, over six runs of 30 days."""
    from fleet2d.algorithms.presence.estimator import SightingShare
    from fleet2d.algorithms.presence.exposure_ratio import ExposureRatio
    from fleet2d.algorithms.presence.likelihood import Likelihood
    from fleet2d.metrics.ltp_error import total_variation

    for policy in (patrol, hangout, follow):
        errors = []
        for seed in range(6):
            where = person(30 * DAY, 5, seed)
            bins, row = evidence(where, 5, policy, seed), []
            for estimator in (SightingShare(), ExposureRatio(), Likelihood()):
                estimator.begin(5, 1)
                for part in pieces(bins, 240):
                    estimator.observe(part)
                share = estimator.presence(["u0"], MONDAY).share("u0")
                row.append(total_variation(shares_at_home(where, 5), share))
            errors.append(row)
        print(policy.__name__, np.mean(errors, axis=0).round(3))


if __name__ == "__main__":
    main()
