"""States of the core that somebody changed on purpose: refused, or of use, and never a crash."""

import copy
import io
import pickle
import random
from contextlib import suppress
from functools import cache

import numpy as np
import pytest
from tests.scenes import scenario

import fleet2d
from fleet2d import _core

CHANGES = 400
"""Changed states of each class that are tried."""

KINDS = ["Legs", "Mesh", "Routes", "Timelines", "Window"]
ODD = [0, 1, -1, 2, 7, 2**15, 2**29, -(2**29), 2**31 - 1, 2**40, 2**62, -(2**63), 2**63 - 1]


class _Finder(pickle.Pickler):
    """Collects the objects of the core in a state."""

    def __init__(self):
        super().__init__(io.BytesIO(), 5)
        self.objects = {}

    def persistent_id(self, obj):
        kind = type(obj)
        if kind.__module__ == "fleet2d._core" and kind.__name__ in KINDS:
            self.objects.setdefault(kind.__name__, obj)
        return


@cache
def originals():
    """An object of each class, of a run with tracks and random walks."""
    home = scenario("1 h", users={"ana": {"type": "meander"}}, robots={"astro": {"type": "patrol"}})
    run = fleet2d.Simulation(home)
    run.advance(600)
    finder = _Finder()
    finder.dump(run._state.bodies)
    space = next(iter(run.actors.values())).space
    finder.dump([space.mesh, space.routes])
    objects = finder.objects
    timelines = objects["Timelines"]
    objects["Window"] = timelines.window(500, 600)
    legs = _core.Legs()
    legs.mark(0, 5, 5, 0, 0)
    legs.walk(0, 0, np.array([[5, 5], [900, 5], [900, 900]], np.int64), 200.0, 1024.0)
    objects["Legs"] = legs
    return objects


def arrays_in(state, where=()):
    """Yield all places in a state, and what is there."""
    if isinstance(state, tuple | list):
        for index, entry in enumerate(state):
            yield (*where, index), entry
            yield from arrays_in(entry, (*where, index))


def with_value(state, where, value):
    """A state with another value at a place."""
    if not where:
        return value
    entries = list(state)
    entries[where[0]] = with_value(entries[where[0]], where[1:], value)
    return type(state)(entries)


def changed(value, rng):
    """Something else, in place of a part of a state."""
    if isinstance(value, np.ndarray):
        value = value.copy()
        how = rng.choice("vvvvvcrtse")
        if how == "v" and value.size:
            limits = np.iinfo(value.dtype) if value.dtype.kind in "iu" else None
            odd = [n for n in ODD if limits is None or limits.min <= n <= limits.max]
            for _ in range(rng.choice([1, 1, 3])):
                value.flat[rng.randrange(value.size)] = rng.choice(odd)
        elif how == "c":
            value = value[: rng.randrange(len(value) + 1)] if value.ndim else value
        elif how == "r":
            value = np.concatenate([value, value]) if value.ndim else value
        elif how == "t":
            value = value.astype(rng.choice(["int8", "float64", "uint64"]))
        elif how == "s":
            value = value.reshape(-1)
        else:
            value = value[:0]
        return value
    if isinstance(value, int):
        return rng.choice(ODD)
    return rng.choice([None, (), [], value, 3, "x", (value,), [value, value]])


def use(thing):
    """Do with an object what a run does with it."""
    kind = type(thing).__name__
    if kind == "Timelines":
        for step in (0, 599, 600, 650, 2000):
            with suppress(ValueError):
                thing.window(step, step + 50)
            with suppress(ValueError):
                thing.poses(np.array([step]))
        thing.forget(620)
    elif kind == "Window":
        for body in range(max(0, len(thing.start) - 1)):
            thing.dense(body, thing.first, min(thing.end, thing.first + 1000))
    elif kind == "Routes":
        thing.find(100, 100, 900, 500)
    elif kind == "Legs":
        thing.rows(), thing.track()
    else:
        _core.locate(thing, 500, 500)
        _core.rasterize_cells(thing, 20, 20)
    copy.deepcopy(thing)


@pytest.mark.parametrize("kind", KINDS)
def test_a_state_comes_back(kind):
    thing = originals()[kind]
    again = pickle.loads(pickle.dumps(thing))
    first, second = pickle.dumps(thing.__getstate__()), pickle.dumps(again.__getstate__())
    assert len(first) == len(second)
    use(again)


@pytest.mark.parametrize("kind", KINDS)
def test_a_changed_state_is_refused_or_of_use(kind):
    cls, rng = getattr(_core, kind), random.Random(7)
    state, refused = originals()[kind].__getstate__(), 0
    for _ in range(CHANGES):
        forged = state
        for _ in range(rng.choice([1, 1, 2])):
            where, value = rng.choice(list(arrays_in(forged)) or [((), forged)])
            forged = with_value(forged, where, changed(value, rng))
        thing = cls.__new__(cls)
        try:
            thing.__setstate__(forged)
        except (ValueError, TypeError, RuntimeError, IndexError, OverflowError):
            refused += 1
        else:
            with suppress(ValueError):
                use(thing)
    assert refused > CHANGES // 10


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.filterwarnings("ignore")
def test_an_object_without_a_state_is_no_crash(kind):
    cls = getattr(_core, kind)
    empty = cls.__new__(cls)
    with pytest.raises((TypeError, RuntimeError)):
        empty.__getstate__()
