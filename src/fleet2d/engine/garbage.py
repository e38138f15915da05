"""Look for garbage rarely while a run is under way.

What a run makes either lives on or is freed at once, for next to nothing of it is in a cycle. To
search it after every 700 new objects, as Python does, takes up to a quarter of the time of a run
with many people.
"""

import gc
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from threading import Lock

# New objects between two searches.
OBJECTS = 100_000

_lock = Lock()
_runs = 0
_usual = gc.get_threshold()


@contextmanager
def rare_collections() -> Iterator[None]:
    """Let Python look for garbage rarely; as before once no run in this process needs it so.

    Example:
        >>> with rare_collections():
        ...     gc.get_threshold()[0]
        100000
    """
    global _runs, _usual
    with _lock:
        _runs += 1
        if _runs == 1:
            _usual = gc.get_threshold()
            if 0 < _usual[0] < OBJECTS:  # 0: the user wants none
                gc.set_threshold(OBJECTS, *_usual[1:])
    try:
        yield
    finally:
        with _lock:
            _runs -= 1
            if _runs == 0:
                gc.set_threshold(*_usual)


def free_bodies(actors: Iterable[object]) -> None:
    """Free the bodies of a run that is over, and with them all of it but its results.

    A body and its plan refer to each other, and would stay until Python looks for garbage.
    """
    for actor in actors:
        vars(actor).clear()
