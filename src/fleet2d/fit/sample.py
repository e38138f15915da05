"""Samples of days from a fitted persona and from a Markov chain, as minutes."""

from bisect import bisect_right
from datetime import date

import numpy as np

from fleet2d.fit.persona import FittedPersona
from fleet2d.fit.timeline import MINUTES, Timeline
from fleet2d.kernels import I16
from fleet2d.routines.activity import Activity, seconds
from fleet2d.routines.distributions import KNOTS, exponential
from fleet2d.routines.life import Life
from fleet2d.routines.planner import Doing
from fleet2d.runtime.clock import DAY_S
from fleet2d.runtime.determinism import Draws, stream_key

# The date of the first sampled day, a Monday.
MONDAY = date(2017, 1, 2).toordinal()


def sample_persona(
    fitted: FittedPersona, timeline: Timeline, days: int, seed: int = 0
) -> tuple[I16, I16]:
    """Return days drawn from a persona: for each minute a state and a place.

    Returns:
        Indices of `timeline.states`, and of `timeline.places`; int16 (days, 1440) each.
    """
    life = Life(fitted.persona, seed, "fit")
    key = stream_key(seed, "fit", "up at night")
    places = timeline.places
    place_of = {n: places.index(timeline.states[s].place) for n, s in fitted.states.items()}
    states = np.zeros((days + 2) * DAY_S, np.int16)
    rooms = np.zeros((days + 2) * DAY_S, np.int16)
    for day in range(days + 1):  # the first night is of the day before the first
        ordinal = MONDAY - 1 + day
        for i, doing in enumerate(life.day(ordinal)):
            begin, end = day * DAY_S + doing.begin, day * DAY_S + doing.end
            states[begin:end] = fitted.states[doing.activity]
            rooms[begin:end] = place_of[doing.activity]
            activity = fitted.persona.activity(doing.activity)
            if activity.fetches is not None and activity.fetches_from[0] in places:
                place = places.index(activity.fetches_from[0])
                for first, last in _fetches(activity, doing, Draws(key, ordinal * 1024 + i)):
                    rooms[day * DAY_S + first : day * DAY_S + last] = place
    sample = slice(DAY_S + 30, (days + 1) * DAY_S + 30, 60)  # the middles of the minutes
    return states[sample].reshape(-1, MINUTES), rooms[sample].reshape(-1, MINUTES)


def _fetches(activity: Activity, doing: Doing, draws: Draws) -> list[tuple[int, int]]:
    """Return begin and end [s] of each short trip during an activity, drawn as for residents."""
    assert activity.fetches is not None
    wait, takes = exponential(seconds(activity.fetches)), activity.fetch_takes.table()
    times = []
    now = doing.begin + wait.knots[draws.below(KNOTS)]
    while now < doing.end:
        end = now + takes.draw(draws)
        if end < doing.end:
            times.append((now, end))
        now = end + wait.knots[draws.below(KNOTS)]
    return times


def sample_days(labels: I16, days: int, seed: int = 0) -> I16:
    """Return copies of whole days, drawn with replacement, int16 (days, 1440)."""
    draws = Draws(stream_key(seed, "fit", "whole days"), 0)
    return labels[[draws.below(len(labels)) for _ in range(days)]]


def sample_markov(labels: I16, count: int, days: int, seed: int = 0) -> I16:
    """Return days of the first-order Markov chain of some days' minutes, int16 (days, 1440).

    Its transition probabilities are the relative frequencies of the label in the next minute. The
    first label is drawn by the frequency of the labels.
    """
    follows = np.zeros((count, count), np.int64)
    known = (labels[:, :-1] >= 0) & (labels[:, 1:] >= 0)
    np.add.at(follows, (labels[:, :-1][known], labels[:, 1:][known]), 1)
    share = np.bincount(labels[labels >= 0], minlength=count)
    for label in range(count):
        if not follows[label].any():
            follows[label] = share
    limits: list[list[int]] = follows.cumsum(axis=1).tolist()
    draws = Draws(stream_key(seed, "fit", "markov"), 0)
    out = np.empty(days * MINUTES, np.int16)
    at = bisect_right(share.cumsum().tolist(), draws.below(int(share.sum())))
    for minute in range(len(out)):
        out[minute] = at
        at = bisect_right(limits[at], draws.below(limits[at][-1]))
    return out.reshape(-1, MINUTES)
