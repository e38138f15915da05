"""The charge of a battery along tracks: the core against plain Python, rate by rate."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from tests.reference import battery as slow

from fleet2d.kernels import (
    BatteryState,
    Breakpoints,
    charge_at,
    charge_falls_to,
    charge_pieces,
)

MINUTE = 60_000_000
DRIVING, STANDING, CHARGING = -1 / (60 * MINUTE), -1 / (300 * MINUTE), 1 / (90 * MINUTE)
rows = st.tuples(st.integers(0, 30), st.integers(0, 1), st.integers(0, 1), st.integers(0, 1))
tracks = st.lists(rows, max_size=9)
charges = st.floats(0, 1)


def track_of(legs):
    """Return a track of places and headings, each so many minutes after the last one."""
    minutes, x, y, heading = np.array(legs, np.int64).reshape(-1, 4).T.copy()
    time = np.cumsum(minutes) * MINUTE
    return Breakpoints(time - time[:1].sum(), x, y, heading, np.zeros(len(x), np.uint8))


def battery(level, since=0, *, is_broken=False):
    """Return a battery whose charger is at (0, 0)."""
    return BatteryState(level, since, DRIVING, STANDING, CHARGING, 0, 0, is_broken=is_broken)


@given(tracks, charges, st.integers(0, 90), st.integers(0, 300), charges, st.booleans())
def test_charge_along_a_track_equals_the_slow_twin(legs, level, since, wait, target, is_broken):
    track, state = track_of(legs), battery(level, since * MINUTE, is_broken=is_broken)
    moment = (since + wait) * MINUTE

    assert slow.levels_of(track, state) == list(
        zip(*(column.tolist() for column in charge_pieces(track, state)), strict=True)
    )
    assert slow.charge_at(track, state, moment) == charge_at(track, state, moment)
    assert slow.falls_to(track, state, target) == charge_falls_to(track, state, target)
