"""Validation of fitted personas: how well their days match held-back days of a log."""

from bisect import bisect_right
from collections.abc import Sequence
from datetime import date
from typing import NamedTuple

import numpy as np

from fleet2d.kernels import I16
from fleet2d.learning.fit.persona import FittedPersona, fit_persona
from fleet2d.learning.fit.privacy import Repeats, repeats
from fleet2d.learning.fit.timeline import (
    LivedDay,
    RoutineDistances,
    Timeline,
    by_minute,
    distances,
    find_days,
    sleep_states,
)
from fleet2d.logs.log import LogError
from fleet2d.routines.life import Life
from fleet2d.routines.planner import RecordedDay
from fleet2d.runtime.clock import DAY_S
from fleet2d.runtime.determinism import Draws, stream_key

# The date of the first sampled day, a Monday.
MONDAY = date(2017, 1, 2).toordinal()
MODELS = (
    "the persona", "copies of whole days", "a first-order Markov chain",
    "the days they were fitted on",
)  # fmt: skip
# Two distances that differ by less than this count as equal.
EQUAL = 0.0005
FOLDS = 3
SAMPLED = 700  # the number of days drawn from a persona, whole weeks
CHAIN_DAYS = 140  # the number of days drawn from the chain
# The numbers of days from the persona and from the chain where seconds are compared.
SAMPLED_BY_SECOND = 140
CHAIN_DAYS_BY_SECOND = 7


def sample_persona(
    fitted: FittedPersona, timeline: Timeline, days: int, seed: int = 0, *, to_second: bool = False
) -> tuple[I16, I16]:
    """Return days drawn from a persona: for each minute, or second, a state and a place.

    Returns:
        Indices of `timeline.states`, and of `timeline.places`; int16 (days, 1440) each, or
        (days, 86400) to the second.
    """
    life = Life(fitted.persona, seed, "fit")
    places = timeline.places
    place_of = {}
    for activity, state in fitted.states.items():
        place_of[activity] = places.index(timeline.states[state].place)
    states = np.zeros((days + 2) * DAY_S, np.int16)
    rooms = np.zeros((days + 2) * DAY_S, np.int16)
    for day in range(days + 1):  # the first one is for the night before the first day
        ordinal = MONDAY - 1 + day
        for episode in life.day(ordinal):
            begin = day * DAY_S + episode.begin
            end = day * DAY_S + episode.end
            states[begin:end] = fitted.states[episode.activity]
            rooms[begin:end] = place_of[episode.activity]
    whole_days = slice(DAY_S, (days + 1) * DAY_S)
    states = states[whole_days]
    rooms = rooms[whole_days]
    if to_second:
        return states.reshape(days, -1), rooms.reshape(days, -1)
    return by_minute(states, len(timeline.states)), by_minute(rooms, len(places))


def sample_days(labels: I16, days: int, seed: int = 0) -> I16:
    """Return copies of whole days, drawn with replacement, int16 (days, n)."""
    draws = Draws(stream_key(seed, "fit", "whole days"), 0)
    return labels[[draws.below(len(labels)) for _ in range(days)]]


def sample_markov(labels: I16, count: int, days: int, seed: int = 0) -> I16:
    """Return days of the first-order Markov chain of some days' labels, int16 (days, n).

    Its transition probabilities are the relative frequencies of the next label. The first label is
    drawn by the frequency of the labels.
    """
    follows = np.zeros((count, count), np.int64)
    before = labels[:, :-1]
    after = labels[:, 1:]
    known = (before >= 0) & (after >= 0)
    np.add.at(follows, (before[known], after[known]), 1)
    share = np.bincount(labels[labels >= 0], minlength=count)
    for label in range(count):
        if not follows[label].any():
            follows[label] = share
    limits: list[list[int]] = follows.cumsum(axis=1).tolist()
    draws = Draws(stream_key(seed, "fit", "markov"), 0)
    out = np.empty(days * labels.shape[1], np.int16)
    at = bisect_right(share.cumsum().tolist(), draws.below(int(share.sum())))
    for i in range(len(out)):
        out[i] = at
        at = bisect_right(limits[at], draws.below(limits[at][-1]))
    return out.reshape(days, -1)


def simulated_repeats(fitted: FittedPersona, days: int = 140, seed: int = 0) -> Repeats:
    """Return how much of its log the simulated days of a persona repeat."""
    life = Life(fitted.persona, seed, "fit")
    lived = []
    for ordinal in range(MONDAY, MONDAY + days):
        day = life.day(ordinal)
        names = tuple(episode.activity for episode in day)
        lived.append(RecordedDay(tuple(e.begin for e in day), names, day[-1].end))
    return repeats(lived, fitted.log)


class Validation(NamedTuple):
    """Distances to held-back days, averaged over the folds.

    Attributes:
        days: The number of days, each held back once.
        folds: The number of parts that were held back in turn.
        rooms: The distances of rooms by minutes, for each model of MODELS.
        activities: The distances of activities by minutes, for each model of MODELS.
        seconds: The distances of rooms by seconds, for each model of MODELS.
    """

    days: int
    folds: int
    rooms: tuple[RoutineDistances, ...]
    activities: tuple[RoutineDistances, ...]
    seconds: tuple[RoutineDistances, ...]

    def worse_than_copying(self) -> list[str]:
        """Return a line for each measure in which the persona is worse than days copied from a log.

        The measures compare the rooms by minutes with those of the days held back.
        """
        keys = {
            "dwell times (KS)": "ks", "hours": "hours", "time shares": "share",
            "transitions": "transitions",
        }  # fmt: skip
        lines = []
        for unit, (persona, copies, *_) in (("", self.rooms), (" to the second", self.seconds)):
            for name, key in keys.items():
                own = getattr(persona, key)
                copied = getattr(copies, key)
                if own > copied + EQUAL:
                    lines.append(f"{name}{unit} {own:.3f}, copies {copied:.3f}")
        return lines


def validate(
    timeline: Timeline, folds: int = FOLDS, seed: int = 0, *, private: bool = False
) -> Validation:
    """Fit a persona to a part of the days and compare it with the others, for each part in turn.

    With three parts, every third day is held back, so that each part has early and late days.

    Raises:
        LogError: There are too few days to hold any back.
    """
    days = find_days(timeline)
    asleep = sleep_states(timeline)
    if not asleep or len(asleep) == len(timeline.states):
        what = "sleep alone" if asleep else "no sleep, and no room that is a bedroom"
        raise LogError(
            f"the log has {what}: nights and days can't be told apart; log other rooms or"
            " activities, too, or name what a sensor stands in: --rooms LABEL=bedroom"
        )
    if len(days) < 3:
        raise LogError(
            f"{len(days)} of the {len(timeline.minutes)} days of the log are whole, with a night"
            f" before and after: log {3 - len(days)} more, as a persona is fitted to two at least,"
            " and a third tells how well"
        )
    folds = min(folds, len(days))
    by_fold = []
    for fold in range(folds):
        held = days[fold::folds]
        rest = [day for day in days if day not in held]
        fitted = fit_persona(timeline, rest, private=private)
        by_fold.append(_fold(timeline, fitted, rest, held, seed))
    means = map(_mean, zip(*by_fold, strict=True))
    return Validation(len(days), folds, *means)


def _fold(
    timeline: Timeline,
    fitted: FittedPersona,
    rest: Sequence[LivedDay],
    held: Sequence[LivedDay],
    seed: int,
) -> list[tuple[RoutineDistances, ...]]:
    """Return how far the days of each model are from days held back.

    Rooms and activities are compared by minutes, and rooms also by seconds.
    """
    states, rooms = sample_persona(fitted, timeline, SAMPLED, seed)
    rooms_by_second = sample_persona(fitted, timeline, SAMPLED_BY_SECOND, seed, to_second=True)[1]
    rest_days = [day.number for day in rest]
    held_days = [day.number for day in held]
    places = len(timeline.places)
    activities = len(timeline.states)
    seconds = timeline.places_of(timeline.seconds)
    result = []
    for sampled, of_log, count, chain_days in (
        (rooms, timeline.rooms, places, CHAIN_DAYS),
        (states, timeline.minutes, activities, CHAIN_DAYS),
        (rooms_by_second, seconds, places, CHAIN_DAYS_BY_SECOND),
    ):
        known = of_log[rest_days]
        copies = sample_days(known, len(sampled), seed)
        chain = sample_markov(known, count, chain_days, seed)
        models = (sampled, copies, chain, known)
        result.append(tuple(distances(of_log[held_days], other, count) for other in models))
    return result


def _mean(folds: Sequence[tuple[RoutineDistances, ...]]) -> tuple[RoutineDistances, ...]:
    """Return the mean distances of each model over the folds."""
    means = np.mean(np.array(folds), axis=0)
    return tuple(map(RoutineDistances._make, means.tolist()))
