"""What a robot remembers of people in rooms: the core against plain Python."""

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st
from tests.reference import room_memory as slow

from fleet2d.kernels import RoomMemory, ShownMemory, remember, show_memory

PEOPLE, ROOMS, COLUMNS, START_S = 2, 3, 8, 5 * 3600
SECOND = 1_000_000
sightings = st.lists(
    st.tuples(st.integers(0, 200_000), st.integers(-1, PEOPLE - 1), st.integers(-1, ROOMS - 1)),
    max_size=30,
)


def empty():
    """Return a memory without sightings."""
    shape = PEOPLE + 2, ROOMS
    return RoomMemory(
        np.full(shape, -1), np.zeros((*shape, 24), np.int64), np.zeros(shape, np.int64)
    )


def remembered(seen):
    """Return a memory of sightings."""
    memory, rows = empty(), np.array(seen, np.int64).reshape(-1, 3)
    step, distinct, index = rows[:, 0].copy(), *np.unique(rows[:, 1:], axis=0, return_inverse=True)
    identity, room = distinct[:, 0].copy(), distinct[:, 1].astype(np.int16)
    index = index.ravel().astype(np.int32)
    remember(step, index, identity, room, START_S * SECOND, SECOND, memory)
    return memory


@given(sightings)
@example([(step, 0, 1) for step in range(3590, 3611)])  # over an hour, and the next ones again
@example([(3599, 0, 1), (3600, 0, 1), (3600, 0, 1), (10, 0, 1)])
def test_memory_of_sightings_equals_the_slow_twin(seen):
    expected = slow.memory_of(seen, PEOPLE, ROOMS, START_S)
    assert expected == tuple(part.tolist() for part in remembered(seen))


@given(sightings, st.lists(st.integers(-1, 300_000), min_size=ROOMS, max_size=ROOMS))
def test_observation_of_a_memory_equals_the_slow_twin(seen, visited):
    memory = remembered(seen)
    columns = ShownMemory(
        np.array([-1, 0, PEOPLE, PEOPLE + 1]),
        np.array([0, 3, 4, 5]),
        np.array([60.0, 1800.0, 7.0, 1e6]),
        np.array([PEOPLE + 1, 0]),
        np.array([1, 7]),
    )
    table = np.full((ROOMS + 1, COLUMNS), 7, np.float32)
    expected = slow.shown(memory, columns, visited, 300_000, 9, table)
    expected[:, 6:] = 0.25, -3
    show_memory(memory, columns, np.array(visited), 300_000, 9, 1.0, [0.25, -3], table)

    assert expected.tobytes() == table.tobytes()
