"""What holds for the whole compiled core: its stub, its docstrings, and the checks of its border."""

import ast
import copy
import pickle
import re
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.kernels.calls import (
    CALLS,
    KEY,
    MESH,
    POINTS,
    SECOND,
    USERS,
    corners,
    day_plan,
    leaf,
    leaves,
    named,
    needs_and_errands,
    put,
    timelines,
    track,
    window,
)

import fleet2d
from fleet2d import _core, kernels
from fleet2d.kernels import (
    WalkRule,
    new_memory,
)

ROOT = Path(__file__).parents[2]
PACKAGE = Path(fleet2d.__file__).parent
SOURCES = sorted(PACKAGE.rglob("*.py"))
PUBLIC = {name: value for name, value in vars(_core).items() if not name.startswith("_")}
FUNCTIONS = {name for name, value in PUBLIC.items() if type(value).__name__ == "nb_func"}
CLASSES = {name for name, value in PUBLIC.items() if isinstance(value, type)}


# --- What is written about it ------------------------------------------------------------------


@pytest.mark.slow
def test_the_stub_equals_the_output_of_nanobind():
    """Of spaces and line breaks, other versions of nanobind think otherwise."""
    stubs = pytest.importorskip("nanobind.stubgen", reason="nanobind isn't installed")
    generator = stubs.StubGen(_core, quiet=True)
    generator.put(_core)
    stub = (PACKAGE / "_core.pyi").read_text()
    assert ast.dump(ast.parse(stub)) == ast.dump(ast.parse(generator.get())), (
        "the stub is of another core: tools/make_stub"
    )


def parts(name):
    """Yield a public name of the core, and if it is a class its own public members."""
    yield name, PUBLIC[name]
    if name in CLASSES and type(PUBLIC[name]).__name__ != "EnumType":
        for member, value in vars(PUBLIC[name]).items():
            if not member.startswith("_"):
                yield f"{name}.{member}", value


@pytest.mark.parametrize("name", sorted(FUNCTIONS | CLASSES))
def test_every_name_has_a_docstring(name):
    for part, value in parts(name):
        text = (value.__doc__ or "").strip()
        # A function's begins with its signature; what follows is what it does.
        described = (
            text.partition("\n\n")[2] if type(value).__name__ in ("nb_func", "nb_method") else text
        )
        assert described[:1].isalnum(), part


# What the core exports for its tests alone: the parts of which what others import consists.
PARTS = [
    "BELL_MEAN",
    "BUCKET",
    "Bits",
    "OUTSIDE",
    "POSTURES",
    "WHOLE_PATCH",
    "build_fans",
    "camera_pose",
    "contains_triangle",
    "distance",
    "distance_bin",
    "hides",
    "in_wedge",
    "leg_cost",
    "length",
    "near_wedge",
    "notice_chance",
    "orient",
    "perceived_offset",
    "perceived_posture",
    "persistence_chance",
    "pick",
    "points_in_view",
    "random_bits",
    "random_share",
    "region_contains",
    "smooth",
    "steady_chance",
    "step_cost",
    "turn_and_stretch",
    "vertices_seen_from_point",
    "vertices_seen_from_vertex",
]


@pytest.mark.slow
def test_the_core_is_imported_by_kernels_only_and_exports_only_what_is_used():
    used = set(PARTS)
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                names = {alias.name for alias in node.names}
                of_core = node.module == "fleet2d._core" or "_core" in names
                assert path.name == "kernels.py" or not of_core, path
                used |= names if node.module in ("fleet2d._core", "fleet2d.kernels") else set()
            elif isinstance(node, ast.Attribute) and ast.unparse(node.value) == "kernels":
                used.add(node.attr)

    assert set() == PUBLIC.keys() - used


# Structs of the core with other names than their named tuples.
NAMED_TUPLES = {
    "KnownMoments": "Moments",
    "PeopleModel": "StayModel",
    "PeopleMoments": "Moments",
    "PosesToFill": "Poses",
    "UserPoses": "PoseBlock",
}


def members_declared_in(core, name):
    """The members of a struct of the core, in the order of their declaration."""
    content = re.search(rf"struct {name}(?: : [\w:, ]+)? \{{\n(.*?)\n\}};", core, re.S)
    assert content is not None
    lines = re.sub(r" *//[^\n]*", "", content[1]).splitlines()
    declared = [line for line in lines if re.match(r"    \w", line) and "(" not in line]
    names = [re.sub(r"^ *(?:const )?[\w:]+(?:<[^;]*>)? ", "", line) for line in declared]
    return tuple(re.match(r" *(\w+)", name)[1] for line in names for name in line.split(","))


def test_named_tuples_have_the_members_of_their_structs_in_order():
    """Tuples become structs by position, so two fields in another order would be taken for each other."""
    texts = [path.read_text(encoding="utf-8") for path in (ROOT / "src" / "core").rglob("*.[ch]pp")]
    core = "\n".join(texts)
    members = {}
    for name, count in re.findall(r"members_of<(\w+)> = (\d+);", core):
        members[name] = members_declared_in(core, name)
        assert len(members[name]) == int(count)
    del members["Chains"]  # plain tuples of the probabilities, bins and offsets of `PeoplePlaces`
    fields = {
        name: value._fields for name, value in vars(kernels).items() if hasattr(value, "_fields")
    }

    assert len(members) > 15
    assert {name: fields[NAMED_TUPLES.get(name, name)] for name in members} == members


# --- Calls that are right, and wrong --------------------------------------------------------------


def test_every_function_and_method_is_called_here():
    callable_ = set(FUNCTIONS)
    for name in CLASSES:
        if type(PUBLIC[name]).__name__ != "EnumType":
            members = vars(PUBLIC[name]).items()
            callable_ |= {f"{name}.{m}" for m, v in members if m[0] != "_" and callable(v)} | {name}
    assert callable_ == CALLS.keys()


@pytest.mark.parametrize("name", CALLS)
def test_a_call_that_is_right_is_answered(name):
    named(name)(*CALLS[name]())


ARRAYS = [(name, at) for name, args in CALLS.items() for at in leaves(args(), np.ndarray)]
INTEGERS = [(name, at) for name, args in CALLS.items() for at in leaves(args(), (int, np.integer))]


def each(cases):
    """Parametrize a test by the name of a call, with all places in its arguments."""
    places = {}
    for name, at in cases:
        places.setdefault(name, []).append(at)
    return pytest.mark.parametrize(("name", "places"), places.items(), ids=places)


@each(ARRAYS)
def test_arrays_of_another_type_are_refused(name, places):
    for at in places:
        if name == "encode_arrays":  # takes arrays of many types
            continue
        array = leaf(CALLS[name](), at)
        other = np.int32 if array.dtype != np.int32 else np.int64
        wrong = [
            array.astype(other),
            array.astype(np.float64 if array.dtype == np.float32 else np.float32),
            array.astype(array.dtype.newbyteorder()) if array.itemsize > 1 else object(),
            array[None],
            array.ravel() if array.ndim > 1 else array.reshape(-1, 1),
            array.tolist(),
            object()
            if name == "detect" and at in ((8,), (9,))
            else None,  # there, it may be left out
            memoryview(array),
        ]
        for value in wrong:
            with pytest.raises(TypeError, match="incompatible function arguments"):
                named(name)(*put(CALLS[name](), at, value))


@each(INTEGERS)
def test_numbers_that_are_none_or_too_large_are_refused(name, places):
    for at in places:
        for value in ("1", None, 2**64, -(2**63) - 1, 1.5):
            with pytest.raises(TypeError, match="incompatible function arguments"):
                named(name)(*put(CALLS[name](), at, value))


@pytest.mark.parametrize(
    "name", [n for n, args in CALLS.items() if any(map(len, args() and [args()]))]
)
def test_too_few_and_too_many_arguments_are_refused(name):
    args = CALLS[name]()
    bound = 1 if "." in name else 0
    for wrong in [(*args, 1, 2, 3)] + [args[:bound]] * (len(args) > bound):
        with pytest.raises(TypeError):
            named(name)(*wrong)


PARENTS = sorted({(name, at[:-1]) for name, at in [*ARRAYS, *INTEGERS] if len(at) > 1})
TUPLES = [(name, at) for name, at in PARENTS if isinstance(leaf(CALLS[name](), at), tuple)]


@each(TUPLES)
def test_named_tuples_of_another_length_are_refused(name, places):
    for at in places:
        value = leaf(CALLS[name](), at)
        parts_ = tuple(value)
        longer_and_shorter = [(), parts_[:-1], (*parts_, parts_[0])]
        if hasattr(value, "_fields") and name != "points_in_reach":
            longer_and_shorter.append(list(value))
        for wrong in longer_and_shorter:
            with pytest.raises(TypeError, match="incompatible function arguments"):
                named(name)(*put(CALLS[name](), at, wrong))


WRITTEN = {
    "mark_spans": [(1,)],
    "record_coverage": [*((5, i) for i in range(7)), *((6, i) for i in range(6))],
    "settle_coverage": [*((1, i) for i in range(7)), (2,)],
    "trace_track": [(3, i) for i in range(4)],
    "remember": [(6, i) for i in range(3)],
    "show_memory": [*((0, i) for i in range(3)), (7,)],
    "trace_meander": [(5, i) for i in range(4)],
    "detect": [(7, i) for i in range(5)],
    "follow": [(2,), (3,)],
    "smooth": [(4, i) for i in range(5)],
    "follow_people": [(3,)],
    "trace_evidence": [(0,)],
    "smooth_people": [(5, i) for i in range(5)],
}
"""The arrays that are written to, by function."""


@each([(n, at) for n, places in WRITTEN.items() for at in places])
def test_arrays_to_be_written_to_must_be_so_and_lie_in_one_piece(name, places):
    for at in places:
        array = leaf(CALLS[name](), at)
        fixed, apart = array.copy(), np.repeat(array, 2, axis=-1)[..., ::2]
        fixed.setflags(write=False)
        assert array.shape == apart.shape
        for wrong in (fixed, apart) if array.shape[-1] > 1 else (fixed,):
            with pytest.raises(TypeError, match="incompatible function arguments"):
                named(name)(*put(CALLS[name](), at, wrong))


def answer(name, args):
    """Return what a call gives, with all that it has written to."""
    result = named(name)(*args)
    return [result, *(leaf(args, at) for at in WRITTEN.get(name, ()))]


def same(one, other):
    if isinstance(one, tuple | list):
        return all(same(a, b) for a, b in zip(one, other, strict=True))
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other)
    unlike = _core.Mesh | _core.Window | _core.Routes | _core.Timelines | _core.Waits
    return type(one) is type(other) and (one == other or isinstance(one, unlike))


READ = [(name, at) for name, at in ARRAYS if at not in WRITTEN.get(name, ())]


@each(READ)
def test_arrays_that_are_read_may_lie_in_memory_as_they_like(name, places):
    for at in places:
        expected = answer(name, CALLS[name]())
        array = leaf(CALLS[name](), at)
        fixed = array.copy()
        fixed.setflags(write=False)
        bytes_ = np.zeros(array.nbytes + 1, np.uint8)
        bytes_[1:] = array.ravel().view(np.uint8)
        unaligned = np.frombuffer(bytes_.data, array.dtype, array.size, 1).reshape(array.shape)
        for other in (
            fixed,
            np.asfortranarray(array),
            np.repeat(array, 2, axis=-1)[..., ::2],
            np.repeat(array, 3, axis=0)[::3],
            array[::-1].copy()[::-1],
            unaligned,
        ):
            assert np.array_equal(array, other)
            assert same(expected, answer(name, put(CALLS[name](), at, other))), other.flags


def test_an_optional_array_that_has_to_be_copied_lives_as_long_as_the_call():
    """The copy of `shown` was freed before it was read: found with numpy's cache of memory off."""
    steps = 1_100_000  # memory of above 32 MiB is unmapped when it is freed
    still, away = np.full((USERS + 1, steps), 300), np.ones((USERS + 1, steps), np.uint8)
    bodies = _core.Window(0, still, still, still, away, away.astype(np.int8))
    shown = np.ones((steps, USERS, 2), np.uint64).T
    end, *_ = _core.detect(*CALLS["detect"]()[:4], bodies, 0, 1, new_memory(2, USERS, steps), shown)
    assert end == steps


EXTREME = [-(2**63), -(2**62), -(2**31), -2, -1, 0, 1, 2, 3, 1000, 2**31, 2**40, 2**62, 2**63 - 1]


@st.composite
def damaged(draw):
    """A call with one or two of its arguments damaged: numbers, lengths, or both."""
    name = draw(st.sampled_from(sorted(CALLS)))
    args = CALLS[name]()
    arrays = list(leaves(args, np.ndarray))
    numbers = [at for at in leaves(args, (int, float, np.integer)) if (name, at) not in COUNTS]
    for _ in range(draw(st.integers(1, 2))):
        if not arrays and not numbers:
            break
        at = draw(st.sampled_from([*arrays, *numbers]))
        value = leaf(args, at)
        if isinstance(value, np.ndarray):
            args = put(args, at, draw(damaged_array(value.copy())))
        elif isinstance(value, float):
            args = put(args, at, draw(st.floats()))
        else:
            most = 2**64 if isinstance(value, np.uint64) else 2**63
            new = draw(st.sampled_from(EXTREME))
            args = put(args, at, type(value)(max(0, new) if most == 2**64 else new))
    return name, args


@st.composite
def damaged_array(draw, array):
    """An array with some other numbers in it, or of another length."""
    how = draw(
        st.sampled_from(["numbers", "all numbers", "shorter", "longer", "empty", "no columns"])
    )
    if how == "shorter":
        return array[: draw(st.integers(0, max(0, len(array) - 1)))]
    if how == "longer":
        return np.concatenate([array, array])
    if how == "empty":
        return array[:0]
    if how == "no columns":
        return array[..., :0]
    if array.dtype.kind == "f":
        new = draw(st.sampled_from([0.0, -1.0, np.nan, np.inf, -np.inf, 1e300, 5e-324]))
    elif array.dtype == bool:
        new = draw(st.booleans())
    else:
        info = np.iinfo(array.dtype)
        new = min(max(draw(st.sampled_from(EXTREME)), int(info.min)), int(info.max))
    if how == "all numbers" or not array.size:
        array[...] = new
    else:
        array.ravel()[draw(st.integers(0, array.size - 1))] = new
    return array


COUNTS = {
    ("advance", (2,)),
    ("resampled", (2,)),
    ("rasterize_cells", (1,)),
    ("rasterize_cells", (2,)),
    ("cells_in_view", (5,)),
    ("cells_in_view", (6,)),
    ("label_frames", (1,)),
    ("sum_places", (2,)),
    ("list_sightings", (5,)),
    ("list_sightings", (6,)),
    ("list_sightings", (7,)),
    ("Resident.live", (6, 0, 2)),
    ("Resident.live", (6, 1, 2)),
    ("Timelines", (0,)),
    ("Timelines.pose", (2,)),
    ("Timelines.poses", (1,)),
    ("Timelines.standing", (2,)),
    ("Timelines.window", (2,)),
    ("Timelines.runs", (3,)),
}
"""How much there is to do: with large numbers, that takes for ever, or all memory."""


# The same cases every time: some damage makes a call long, and no run may hang on a new one.
@settings(
    max_examples=150,
    derandomize=True,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
)
@given(damaged())
def test_no_damage_does_more_than_raise_an_error(call):
    """A number that would lead outside an array is refused: what isn't refused is worked out."""
    name, args = call
    with suppress(TypeError, ValueError, MemoryError):
        named(name)(*args)


# --- States ------------------------------------------------------------------------------------


def use_all_methods(instance):
    """Ask an object for all that it may be asked."""
    if isinstance(instance, _core.Mesh):
        for x, y in POINTS.tolist():
            _core.visible_region(instance, x, y)
        _core.build_fans(instance)
    elif isinstance(instance, _core.Routes):
        instance.find(100, 500, 1000, 500)
    elif isinstance(instance, _core.Legs):
        instance.rows()
        instance.track()
    elif isinstance(instance, _core.StepDraws):
        instance.below(10)
    elif isinstance(instance, _core.LastStint):
        args = CALLS["Resident.live"]()
        _core.Resident.live(*args[:-2], True, instance)
    elif isinstance(instance, _core.DayPlanner):
        instance.plan(_core.StepDraws(7, 3), 25_000, 110_000)
    elif isinstance(instance, _core.Interruptions):
        instance.interrupt(_core.StepDraws(7, 3), [(0, 0, 30_000, -1), (2, 30_000, 60_000, -1)])
    elif isinstance(instance, _core.Window):
        for body in range(len(instance.start) - 1):
            instance.dense(body, instance.first, min(instance.end, instance.first + 99))
    else:
        for step in (0, 4, 30):
            instance.poses(np.array([step]))
            instance.window(step, step + 20)
        instance.forget(10)
        instance.window(10, 40)
        instance.walk(1, 12, MESH, MESH, WalkRule(np.uint64(5), 9000, 40_000, 500), (100, 100, 0))
        copy.deepcopy(instance).window(11, 40)


def grown():
    """Return timelines with several pieces, some of which are forgotten."""
    result = timelines()
    result.window(0, 20)
    result.forget(6)
    result.follow(0, 8, track(), np.array([5]), np.array([0, 1], np.int8))
    result.walk(0, 15, MESH, MESH, WalkRule(np.uint64(5), 9000, 40_000, 500), (100, 100, 0))
    result.window(6, 30)
    return result


def legs():
    """Return legs of every kind."""
    result = _core.Legs()
    result.mark(5, 100, 100, 7, 0)
    result.turn(5, 100, 100, 7, 0, 300, 500.0)
    result.walk(SECOND, 7, POINTS[:2].copy(), 1000.0, 500.0)
    return result


def last_stint():
    """Return what was done last by somebody who was interrupted."""
    args = CALLS["Resident.live"]()
    _core.Resident.live(*args)
    return args[-1]


STATES = {
    "DayPlanner": lambda: _core.DayPlanner(*day_plan()),
    "Interruptions": lambda: _core.Interruptions(*needs_and_errands()),
    "LastStint": last_stint,
    "Legs": legs,
    "Mesh": lambda: _core.Mesh(MESH.vertices, MESH.triangles, MESH.neighbors),
    "Routes": lambda: _core.Routes(MESH, corners()),
    "Window": window,
    "StepDraws": lambda: _core.StepDraws(KEY, 4),
    "Timelines": grown,
}


def restored(name, state):
    """Return what is read from a state."""
    result = PUBLIC[name].__new__(PUBLIC[name])
    result.__setstate__(state)
    return result


@pytest.mark.parametrize("name", STATES)
def test_restored_objects_have_the_same_state(name):
    state = STATES[name]().__getstate__()
    again = restored(name, state)
    for path in leaves(state, (np.ndarray, int, np.integer)):
        assert np.array_equal(leaf(state, path), leaf(again.__getstate__(), path)), path
    with suppress(ValueError):  # what is forgotten
        use_all_methods(again)
    assert pickle.dumps(STATES[name]()) == pickle.dumps(pickle.loads(pickle.dumps(STATES[name]())))


def test_every_class_that_can_be_written_is_read_here():
    assert {n for n in CLASSES if "__setstate__" in vars(PUBLIC[n])} == STATES.keys()


@pytest.mark.parametrize("name", STATES)
def test_a_state_of_something_else_is_refused(name):
    others = [STATES[n]().__getstate__() for n in STATES if n != name]
    state = STATES[name]().__getstate__()
    wrong = [(), (1,), None, 3, "state", (None,) * len(state)]
    if isinstance(state, tuple):
        wrong += [state[:-1], (*state, 1)]
    for other in [*others, *wrong]:
        with pytest.raises((TypeError, ValueError)):
            restored(name, other)


@pytest.mark.slow
@settings(
    max_examples=600, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
@given(st.data(), st.sampled_from(sorted(STATES)))
def test_a_damaged_state_is_refused_or_can_be_worked_with(data, name):
    state = STATES[name]().__getstate__()
    for _ in range(data.draw(st.integers(1, 2))):
        places = list(leaves(state, (np.ndarray, int, np.integer)))
        if not places:
            break
        at = data.draw(st.sampled_from(places))
        value = leaf(state, at)
        if data.draw(st.integers(0, 9)) == 0:
            state = put(state, at, data.draw(st.sampled_from([None, "x", np.zeros(3)])))
        elif isinstance(value, np.ndarray):
            state = put(state, at, data.draw(damaged_array(value.copy())))
        else:
            state = put(state, at, data.draw(st.sampled_from(EXTREME)))
    with suppress(TypeError, ValueError, MemoryError):
        use_all_methods(restored(name, state))


@pytest.mark.parametrize("name", STATES)
@pytest.mark.filterwarnings("ignore")
def test_an_object_without_a_state_is_no_crash(name):
    with pytest.raises((TypeError, RuntimeError)):
        PUBLIC[name].__new__(PUBLIC[name]).__getstate__()
