"""What a robot remembers of people in rooms, one sighting and one number at a time.

Sightings are (step, identity, room).
"""

import numpy as np


def memory_of(sightings, people, rooms, start_s):
    """Return `last`, `looks` and `total` of a `RoomMemory` as lists, with steps of a second."""
    last = [[-1] * rooms for _ in range(people + 2)]
    looks = [[[0] * 24 for _ in range(rooms)] for _ in range(people + 2)]
    total = [[0] * rooms for _ in range(people + 2)]
    for step, identity, room in sightings:
        for row in (people if identity < 0 else identity, people + 1):
            if room >= 0:
                last[row][room] = max(last[row][room], step)
                looks[row][room][(start_s + step) // 3600 % 24] += 1
                total[row][room] += 1
    return last, looks, total


def shown(memory, columns, visited, step, hour, table):
    """Return an observation with the columns that show a memory, with steps of a second."""
    table = table.copy()
    for row, at, scale in zip(*columns[:3], strict=True):
        for room, visit in enumerate(visited):
            last = visit if row < 0 else int(memory.last[row, room])
            share = scale / (scale + (step - last) * 1.0)
            table[room, at] = np.float32(0.0 if last < 0 else share)
    for number, (row, at) in enumerate(zip(*columns[3:], strict=True)):
        looks = memory.total[row] if number == 0 else memory.looks[row, :, hour]
        for room, count in enumerate(looks.tolist()):
            table[room, at] = np.float32(count / max(sum(looks.tolist()), 1))
    return table
