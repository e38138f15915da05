"""Is a fit any good: days that it wasn't fitted on, beside a Markov chain's."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fleet2d.fit.compare import Distances, distances
from fleet2d.fit.days import Day, find_days
from fleet2d.fit.persona import fit_persona
from fleet2d.fit.sample import sample_markov, sample_persona
from fleet2d.fit.timeline import I16, Timeline
from fleet2d.logs.log import LogError

FOLDS = 3
SAMPLED = 140  # days: whole weeks


class Validation(NamedTuple):
    """Distances to held-back days, averaged over the folds.

    Attributes:
        days: The number of days, each held back once.
        folds: How many times a part of them was held back.
        rooms: Of rooms: the persona's distance, the Markov chain's, and that of the days it was
            fitted on, which no model can be expected to beat.
        activities: The same of activities.
    """

    days: int
    folds: int
    rooms: tuple[Distances, Distances, Distances]
    activities: tuple[Distances, Distances, Distances]


def validate(timeline: Timeline, folds: int = FOLDS, seed: int = 0) -> Validation:
    """Fit to some of the days and compare with the others, for each of some parts in turn.

    Every third day is held back, so that each part has early and late ones.

    Raises:
        LogError: There are too few days to hold any back.
    """
    days = find_days(timeline)
    if len(days) < 3:
        raise LogError(
            f"the log has {len(days)} whole days, with a night before and after: three are needed"
            " at least, to hold one back"
        )
    folds = min(folds, len(days))
    rooms, activities = [], []
    for fold in range(folds):
        held = days[fold::folds]
        rest = [day for day in days if day not in held]
        found = _fold(timeline, rest, held, seed)
        rooms.append(found[0])
        activities.append(found[1])
    return Validation(len(days), folds, _mean(rooms), _mean(activities))


def _fold(
    timeline: Timeline, rest: Sequence[Day], held: Sequence[Day], seed: int
) -> tuple[tuple[Distances, ...], tuple[Distances, ...]]:
    states, rooms = sample_persona(fit_persona(timeline, rest), timeline, SAMPLED, seed)
    mine, yours = ([day.number for day in part] for part in (rest, held))
    place_count, state_count = len(timeline.places), len(timeline.states)
    found = []
    for sampled, labels, count in (
        (rooms, timeline.rooms, place_count),
        (states, timeline.minutes, state_count),
    ):
        real: I16 = labels[yours]
        chain = sample_markov(labels[mine], count, SAMPLED, seed)
        found.append(
            tuple(distances(real, other, count) for other in (sampled, chain, labels[mine]))
        )
    return found[0], found[1]


def _mean(
    found: Sequence[tuple[Distances, ...]],
) -> tuple[Distances, Distances, Distances]:
    mean = np.mean(np.array(found), axis=0).tolist()
    return Distances(*mean[0]), Distances(*mean[1]), Distances(*mean[2])
