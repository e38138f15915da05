"""Days for a persona to share: like those of a log, with none of its times.

A day is drawn from the recorded ones, and each of its stays gets another length. What remains of
the log is the order of activities within a part of a day, about when they are, and about how long.
"""

from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from fleet2d.routines.planner import (
    SLEEP,
    Episode,
    RecordedDay,
    draw_recorded,
    draw_source,
    to_recording,
)
from fleet2d.runtime.determinism import Draws, stream_key

# An activity on fewer days is left out, as it would give these days away.
MIN_DAYS = 2
# The largest changes of waking and of the length of a stay: [s], and relative to the length.
WAKE_SHIFT_S = 600
LENGTH_SHIFT_S = 600
LENGTH_SHIFT = 0.25
# Beyond this shift of a day's times, lengths are changed in the direction that reduces it [s].
MAX_SHIFT_S = 900
DAYS_PER_DAY = 2  # days that are made for each recorded day
TRIES = 20  # draws of a day, of which the least repetitive is taken


class Repeats(NamedTuple):
    """Lengths of runs of changes of activity, to the minute, that days share with those of a log.

    Attributes:
        mean: The mean of the days' longest runs of such changes.
        longest: The longest of all.
    """

    mean: float
    longest: int

    def __str__(self) -> str:
        """Return a text like '1.4 on average, 3 at most'."""
        return f"{self.mean:.1f} on average, {self.longest} at most"


def repeats(days: Sequence[RecordedDay], log: Sequence[RecordedDay]) -> Repeats:
    """Return how much of a log some days repeat; no day is compared with itself.

    >>> from fleet2d.routines.planner import parse_day
    >>> one = parse_day("07:00 wash, 07:20:10 work, 12:00 tv, 23:00 sleep, 31:00 end")
    >>> two = parse_day("06:55 wash, 07:20:40 work, 12:00 tv, 22:00 sleep, 31:00 end")
    >>> print(repeats([one, two], [one, two]))
    2.0 on average, 2 at most
    """
    longest = []
    for day in days:
        runs = [_longest_run(day, other) for other in log if other is not day]
        longest.append(max(runs, default=0))
    return Repeats(sum(longest) / max(len(longest), 1), max(longest, default=0))


def _longest_run(day: RecordedDay, other: RecordedDay) -> int:
    """Return the number of successive changes that are in both days, to the minute."""
    after = {change: i for i, change in enumerate(_changes(other))}
    run = 0
    longest = 0
    last = -1
    for change in _changes(day):
        at = after.get(change, -1)
        if at < 0:
            run = 0
        elif at == last + 1:
            run += 1
        else:
            run = 1
        longest = max(longest, run)
        last = at
    return longest


def _changes(day: RecordedDay) -> list[tuple[int, str]]:
    return [(at // 60, name) for at, name in zip(day.begins, day.activities, strict=True)]


def private_days(days: Sequence[RecordedDay], seed: int, kind: str = "") -> list[RecordedDay]:
    """Return new days that are like recorded ones.

    New days repeat no recorded time, and no more of a recorded day than recorded days repeat of
    each other.

    Args:
        days: The recorded days of a kind.
        seed: The seed of all draws.
        kind: The name of their kind.
    """
    recording = to_recording(_without_rare(days))
    limit = max(1, repeats(days, days).longest)
    made = []
    for number in range(DAYS_PER_DAY * len(days)):
        best: tuple[int, RecordedDay] | None = None
        for attempt in range(TRIES):
            key = stream_key(seed, "fit", f"private {kind} {attempt}")
            day = _draw(recording.days, Draws(key, number))
            found = repeats([day], days).longest
            if best is None or found < best[0]:
                best = found, day
            if found <= limit // 2:  # simulated days join two, and repeat more
                break
        assert best is not None
        if best[0] <= limit:
            made.append(best[1])
    return made


def _without_rare(days: Sequence[RecordedDay]) -> list[RecordedDay]:
    """Return days without activities of too few days; the activity before goes on."""
    counts = Counter(name for day in days for name in {*day.activities})
    rare = {name for name, count in counts.items() if count < MIN_DAYS and name != SLEEP}
    result = []
    for day in days:
        kept = [
            (begin, name)
            for begin, name in zip(day.begins, day.activities, strict=True)
            if name not in rare
        ]
        merged = [kept[0], *(b for a, b in pairwise(kept) if a[1] != b[1])]
        begins, names = zip(*merged, strict=True)
        result.append(RecordedDay((day.begins[0], *begins[1:]), names, day.end))
    return result


def _draw(days: Sequence[RecordedDay], draws: Draws) -> RecordedDay:
    recording = to_recording(days)
    first = draw_source(recording, draws)
    end = days[draw_source(recording, draws)].end
    episodes = draw_recorded(recording, first, draws, end)
    if episodes[-1].activity != SLEEP:
        episodes.append(Episode(SLEEP, episodes[-1].end, end))
    now = episodes[0].begin + _random_shift(draws, WAKE_SHIFT_S)
    begins = []
    names = []
    for episode in episodes:
        begins.append(now)
        names.append(episode.activity)
        now += _length(episode, now - episode.begin, draws)
    return RecordedDay(tuple(begins), tuple(names), now)


def _length(episode: Episode, shift: int, draws: Draws) -> int:
    """Return another length [s] of an episode that begins `shift` seconds later than recorded."""
    length = episode.end - episode.begin
    most = max(1, min(LENGTH_SHIFT_S, int(LENGTH_SHIFT * length)))
    change = _random_shift(draws, most)
    if abs(shift) > MAX_SHIFT_S:
        change = -abs(change) if shift > 0 else abs(change)
    return max(1, length + change)


def _random_shift(draws: Draws, most: int) -> int:
    """Draw a whole number from -most to most, but 0."""
    value = draws.below(2 * most) - most
    return value + 1 if value >= 0 else value
