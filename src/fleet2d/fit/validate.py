"""Is a fit any good: days that it wasn't fitted on, beside a Markov chain's."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fleet2d.fit.compare import Distances, distances
from fleet2d.fit.days import Day, find_days
from fleet2d.fit.persona import Model, fit_persona
from fleet2d.fit.sample import sample_days, sample_markov, sample_persona
from fleet2d.fit.timeline import I16, Timeline
from fleet2d.logs.log import LogError

MODELS = (
    "the persona", "whole days drawn anew", "a first-order Markov chain",
    "the days they were fitted on",
)  # fmt: skip
# Nearer than that, two distances of so few days are equal.
EQUAL = 0.0005
FOLDS = 3
SAMPLED = 700  # days: whole weeks
CHAIN_DAYS = 140  # of the chain, minute by minute


class Validation(NamedTuple):
    """Distances to held-back days, averaged over the folds.

    Attributes:
        days: The number of days, each held back once.
        folds: How many times a part of them was held back.
        rooms: Of rooms: the distances of the models, in the order of MODELS.
        activities: The same of activities.
    """

    days: int
    folds: int
    rooms: tuple[Distances, ...]
    activities: tuple[Distances, ...]

    def worse_than_copying(self) -> list[str]:
        """Return in what the persona is farther from days held back than whole days drawn anew."""
        persona, copies = self.rooms[0], self.rooms[1]
        what = {"dwell times (KS)": "ks", "hours": "hours", "time shares": "share"}
        return [
            f"{name} {getattr(persona, key):.3f}, copies {getattr(copies, key):.3f}"
            for name, key in what.items()
            if getattr(persona, key) > getattr(copies, key) + EQUAL
        ]


def validate(
    timeline: Timeline, folds: int = FOLDS, seed: int = 0, *, model: Model = "recorded"
) -> Validation:
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
        found = _fold(timeline, rest, held, seed, model)
        rooms.append(found[0])
        activities.append(found[1])
    return Validation(len(days), folds, _mean(rooms), _mean(activities))


def _fold(
    timeline: Timeline, rest: Sequence[Day], held: Sequence[Day], seed: int, model: Model
) -> tuple[tuple[Distances, ...], tuple[Distances, ...]]:
    fitted = fit_persona(timeline, rest, model=model)
    states, rooms = sample_persona(fitted, timeline, SAMPLED, seed)
    mine, yours = ([day.number for day in part] for part in (rest, held))
    place_count, state_count = len(timeline.places), len(timeline.states)
    found = []
    for sampled, labels, count in (
        (rooms, timeline.rooms, place_count),
        (states, timeline.minutes, state_count),
    ):
        real: I16 = labels[yours]
        copies = sample_days(labels[mine], SAMPLED, seed)
        chain = sample_markov(labels[mine], count, CHAIN_DAYS, seed)
        models = (sampled, copies, chain, labels[mine])
        found.append(tuple(distances(real, other, count) for other in models))
    return found[0], found[1]


def _mean(found: Sequence[tuple[Distances, ...]]) -> tuple[Distances, ...]:
    return tuple(Distances(*row) for row in np.mean(np.array(found), axis=0).tolist())
