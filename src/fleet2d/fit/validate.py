"""Validation of fits: distances to days held back, compared with copies and a Markov chain."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fleet2d.fit.compare import Distances, distances
from fleet2d.fit.days import LivedDay, find_days
from fleet2d.fit.persona import Model, fit_persona
from fleet2d.fit.sample import sample_days, sample_markov, sample_persona
from fleet2d.fit.timeline import Timeline
from fleet2d.kernels import I16
from fleet2d.logs.log import LogError

MODELS = (
    "the persona", "copies of whole days", "a first-order Markov chain",
    "the days they were fitted on",
)  # fmt: skip
# Two distances that differ by less than this count as equal.
EQUAL = 0.0005
FOLDS = 3
SAMPLED = 700  # the number of days drawn from a persona, whole weeks
CHAIN_DAYS = 140  # the number of days drawn from the chain


class Validation(NamedTuple):
    """Distances to held-back days, averaged over the folds.

    Attributes:
        days: The number of days, each held back once.
        folds: The number of parts that were held back in turn.
        rooms: The distances of rooms, for each model of MODELS.
        activities: The distances of activities, for each model of MODELS.
    """

    days: int
    folds: int
    rooms: tuple[Distances, ...]
    activities: tuple[Distances, ...]

    def worse_than_copying(self) -> list[str]:
        """Return a line for each measure in which the persona is worse than days copied from a log.

        The measures compare in which rooms somebody is with the days held back.
        """
        persona, copies = self.rooms[0], self.rooms[1]
        keys = {"dwell times (KS)": "ks", "hours": "hours", "time shares": "share"}
        return [
            f"{name} {getattr(persona, key):.3f}, copies {getattr(copies, key):.3f}"
            for name, key in keys.items()
            if getattr(persona, key) > getattr(copies, key) + EQUAL
        ]


def validate(
    timeline: Timeline, folds: int = FOLDS, seed: int = 0, *, model: Model = "recorded"
) -> Validation:
    """Fit a persona to a part of the days and compare it with the others, for each part in turn.

    With three parts, every third day is held back, so that each part has early and late days.

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
        of_rooms, of_activities = _fold(timeline, rest, held, seed, model)
        rooms.append(of_rooms)
        activities.append(of_activities)
    return Validation(len(days), folds, _mean(rooms), _mean(activities))


def _fold(
    timeline: Timeline, rest: Sequence[LivedDay], held: Sequence[LivedDay], seed: int, model: Model
) -> tuple[tuple[Distances, ...], tuple[Distances, ...]]:
    """Return how far the days of each model are from days held back: in rooms, in activities."""
    fitted = fit_persona(timeline, rest, model=model)
    states, rooms = sample_persona(fitted, timeline, SAMPLED, seed)
    rest_days, held_days = ([day.number for day in part] for part in (rest, held))
    place_count, state_count = len(timeline.places), len(timeline.states)
    result = []
    for sampled, labels, count in (
        (rooms, timeline.rooms, place_count),
        (states, timeline.minutes, state_count),
    ):
        real: I16 = labels[held_days]
        copies = sample_days(labels[rest_days], SAMPLED, seed)
        chain = sample_markov(labels[rest_days], count, CHAIN_DAYS, seed)
        models = (sampled, copies, chain, labels[rest_days])
        result.append(tuple(distances(real, other, count) for other in models))
    return result[0], result[1]


def _mean(folds: Sequence[tuple[Distances, ...]]) -> tuple[Distances, ...]:
    """Return the mean distances of each model over the folds."""
    return tuple(Distances(*row) for row in np.mean(np.array(folds), axis=0).tolist())
