"""The usual drive: in Python the same as in the core, which computes it in runs."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from tests.entities.drives.drives import driven

from fleet2d.entities.drives.differential import Differential
from fleet2d.entities.drives.drive import breakpoints
from fleet2d.kernels import TURN, time_route

POINTS = st.lists(st.tuples(*[st.integers(-5000, 5000)] * 2), min_size=1, max_size=6)


def test_it_turns_on_the_spot_and_then_drives() -> None:
    assert [
        (6.0, 3.0, 0.0, 0.0),
        (7.0, 3.0, 0.0, 90.0),
        (11.0, 3.0, 2.0, 90.0),
    ] == driven(Differential())


@given(POINTS, st.integers(0, TURN - 1), st.floats(1, 5000), st.floats(1, TURN))
def test_it_is_the_same_as_in_the_core(
    points: list[tuple[int, int]], heading: int, speed: float, turn_rate: float
) -> None:
    route = np.array(points, np.int64)
    core = time_route(route, 0, heading, speed, turn_rate)[1:]
    rows = breakpoints(Differential(), route, heading, (speed, turn_rate), 1280.0)

    assert core[:, 1:].tolist() == rows[:, 1:4].tolist()
    late = core[:, 0] - rows[:, 0]  # the core rounds the time of each turn and leg up
    assert ((late >= -1) & (late <= 1 + np.arange(len(late)))).all()
