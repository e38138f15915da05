"""Layers in runs: what robots have seen, whoever asks, however it is cut, and what is stored."""

import copy
import json
from collections.abc import Set
from datetime import timedelta
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from tests.meshed_homes import walls_of
from tests.reference import visible_cells as slow
from tests.scenes import TESTS, digests, everything, flat_document, path, run, scenario
from tests.thorough import some

import fleet2d
from fleet2d import Algorithm, Behavior, Metric
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import ArtifactError, Fleet2DError
from fleet2d.kernels import half_sine
from fleet2d.runs.layers import layer_names, layer_steps, read_layer

HERE = f"{TESTS.as_posix()}/engine/test_layers"
SINES = np.array([half_sine(half) for half in range(8192)], np.int64)
SEEN = {"explored": {}, "first_seen": {}, "last_seen": {}, "time_since_seen": {}}
CAMERA = {"range": [0.3, 3], "angle_deg": 120}


class Expose(Algorithm):
    """Puts out how much of each room each robot had in view."""

    needs: ClassVar[Set[str]] = {"exposure", "explored"}

    def update(self, history, state):
        robots, rooms = history.exposure.shape
        explored = [int(state.home.layers[f"explored.{name}"].values.sum()) for name in ("astro",)]
        return {
            "robot": np.repeat(np.arange(robots), rooms),
            "cells": history.exposure.ravel(),
            "explored": np.repeat(explored, robots * rooms),
        }


class NeedsMore(Metric):
    """Needs what there isn't."""

    needs: ClassVar[Set[str]] = {"exposed"}


class Dirt(Algorithm):
    """Dust falls on the kitchen, and is stored every now and then."""

    def start(self, home):
        every = timedelta(minutes=4)
        self.dust = home.layers.add("dust", unit="g", description="on the floor", every=every)
        self.kitchen = home.plan.room_of_cell == home.plan.room("kitchen_1").index

    def update(self, history, state):
        self.dust.values[self.kitchen] += 0.25


class Sweep(Behavior):
    """Clean where it stands."""

    def start(self, actor):
        self.dust = actor.home.layers.add("dust", unit="g", every=timedelta(minutes=4))

    def decide(self, now):
        self.dust.set_at(*now.xy, -1.0)
        return now.plan().go_to("any", "sweep").stay(timedelta(seconds=20))


def watched(duration="10 min", **more):
    """Two robots in the flat whose seen area is kept."""
    content = scenario(
        duration,
        robots={
            "astro": {"type": "patrol", "dwell": "20 s", "camera": CAMERA},
            "drift": {"type": "meander", "camera": {"range": [0, 2], "angle_deg": 200}},
            "blind": {"type": "meander", "camera": None},
        },
        **more,
    )
    content["floorplan"]["layers"] = copy.deepcopy(SEEN)
    return content


def by_brute_force(stored, robot, camera):
    """Return how often each cell was in view, and the first and the last step at which it was."""
    plan, poses = stored.plan, path(stored, robot)
    near, far = (round(limit * plan.lattice.units_per_m) for limit in camera["range"])
    half = round(camera["angle_deg"] / 360 * 4096)
    xy = plan.lattice.to_lattice(np.stack([poses.x, poses.y], axis=1))
    headings = np.rint(poses.heading / (2 * np.pi) * 4096) % 4096
    looks, number = np.unique(np.column_stack([xy, headings]), axis=0, return_inverse=True)
    seen = [
        slow.cells_in_view(walls_of(plan.polygons), plan.free.shape, look, near, far, half, SINES)
        for look in looks.astype(int).tolist()
    ]
    views = np.array(seen)[number.ravel()]
    times = views.sum(axis=0)
    first = np.where(times > 0, views.argmax(axis=0), -1)
    last = np.where(times > 0, len(views) - 1 - views[::-1].argmax(axis=0), -1)
    return times, first, last


@pytest.fixture(scope="module")
def stored():
    return run(watched("3 min"), metrics={})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "camera"), [("astro", CAMERA), ("drift", {"range": [0, 2], "angle_deg": 200})]
)
def test_explored_is_the_union_of_what_brute_force_sees_at_each_step(stored, robot, camera):
    times, first, last = by_brute_force(stored, robot, camera)

    assert np.array_equal(times > 0, read_layer(stored, f"explored.{robot}"))
    assert np.array_equal(first, read_layer(stored, f"first_seen.{robot}"))
    assert np.array_equal(last, read_layer(stored, f"last_seen.{robot}"))
    since = np.where(last < 0, np.nan, 179.0 - last)
    assert np.array_equal(since, read_layer(stored, f"time_since_seen.{robot}"), equal_nan=True)
    assert (times > 0).sum() > 500


def test_exposure_is_what_brute_force_counts_and_costs_nothing_else():
    content = watched("3 min", algorithms={"seen": {"type": f"{HERE}:Expose", "period": "1 min"}})
    content["floorplan"].pop("layers")
    stored = run(content)
    rows = stored.tables["seen"]
    robot, cells = rows["robot"].to_numpy(), rows["cells"].to_numpy()
    times, _, _ = by_brute_force(stored, "astro", CAMERA)
    rooms = stored.plan.room_of_cell
    expected = np.bincount(rooms[rooms >= 0], times[rooms >= 0], len(stored.plan.rooms))

    assert 3 * 3 * len(expected) == len(cells)
    assert expected.tolist() == cells[robot == 0].reshape(3, -1).sum(axis=0).tolist()
    assert cells[robot == 1].sum() > 0
    assert cells[robot == 2].sum() == 0  # it is blind
    assert (times > 0).sum() == rows["explored"].to_numpy()[-1]
    assert [] == layer_names(stored)  # nobody asked for them to be stored


@pytest.mark.parametrize("span", some([7, 1, 100], 3))
def test_layers_are_the_same_for_every_max_span(span):
    content = everything("20 min")
    content["floorplan"] = {
        **content["floorplan"],
        "layers": {**SEEN, "last_seen": {"every": "7 min"}},
    }
    content["algorithms"] = {"seen": {"type": f"{HERE}:Expose", "period": "5 min"}}
    content["robots"].pop("ego")

    assert digests(run(content)) == digests(run(content, max_span=span))


def test_run_with_layers_is_otherwise_the_run_without():
    plain, layered = everything("10 min"), everything("10 min")
    layered["floorplan"] = {**layered["floorplan"], "layers": SEEN}
    before, after = digests(run(plain)), digests(run(layered))

    assert {k: v for k, v in before.items() if k != "run"} == {
        k: v for k, v in after.items() if k != "run" and not k.startswith("layer.")
    }


def test_layer_is_stored_when_it_is_due_and_at_the_end():
    content = scenario("10 min", algorithms={"dirt": {"type": f"{HERE}:Dirt", "period": "1 min"}})
    stored = run(content)

    assert [239, 479, 599] == layer_steps(stored, "dust")
    kitchen = stored.plan.room_of_cell == stored.plan.room("kitchen_1").index
    for step, dust in ((239, 1.0), (479, 2.0), (None, 2.5)):
        values = read_layer(stored, "dust", step)
        assert {dust} == set(values[kitchen].tolist())
        assert {0.0} == set(values[~kitchen].tolist())
    empty = SimpleNamespace(tables={"layer.dust": stored.tables["layer.dust"].slice(0, 0)})
    for run_, name, step, words in (
        (stored, "dust", 5, "not stored at step 5; stored steps: 239, 479, 599"),
        (stored, "dusk", None, "no layer 'dusk': did you mean 'dust'"),
        (empty, "dust", None, "the layer 'dust' was never stored"),
    ):
        with pytest.raises(ArtifactError, match=words):
            read_layer(run_, name, step)


def test_entities_and_algorithms_write_to_one_layer_and_spans_do_not_show():
    content = scenario(
        "10 min",
        robots={"astro": {"type": f"{HERE}:Sweep"}},
        algorithms={"dirt": {"type": f"{HERE}:Dirt", "period": "1 min"}},
    )
    stored = run(content)

    dust = read_layer(stored, "dust")
    assert (dust == -1).any()
    assert (dust == 2.5).any()
    assert digests(stored) == digests(run(content, max_span=1))


def door_flat(folder, **more):
    """The flat with a doorway between living room and kitchen, and a robot that looks around."""
    document = flat_document()
    document["doorways"] = [{"name": "gate", "start": [5.05, 2.6], "end": [5.05, 3.6]}]
    (folder / "gated.json").write_text(json.dumps(document))
    robot = {"start": [2.5, 2.8], "camera": {"range": [0, 20], "angle_deg": 360}}
    content = scenario("6 min", robots={"astro": robot}, **more)
    layers = {"explored": {}, "first_seen": {}, "last_seen": {}}
    content["floorplan"] = {"type": "native", "path": f"{folder}/gated.json", "layers": layers}
    return content


def test_a_door_hides_while_it_is_shut_what_is_behind_it(tmp_path):
    gate = {"type": "door", "doorway": "gate"}
    turns = [{"at": "07:02", "open": True}, {"at": "07:04", "open": False}]
    opened, shut, turned = (
        run(door_flat(tmp_path, objects={"gate": gate | how}))
        for how in ({"open": True}, {"open": False}, {"open": False, "schedule": turns})
    )
    whole, part = (read_layer(one, "explored.astro") for one in (opened, shut))
    behind = whole & ~part

    assert np.array_equal(whole, read_layer(turned, "explored.astro"))
    assert behind.sum() > 100
    last = read_layer(turned, "last_seen.astro")
    assert {120} == set(read_layer(turned, "first_seen.astro")[behind].tolist())
    assert ({239}, {359}) == (set(last[behind].tolist()), set(last[part].tolist()))


def test_layers_of_a_stored_run_are_read_back(tmp_path):
    content = watched("2 min")
    in_memory = run(content)
    stored = fleet2d.run(content, out=tmp_path / "run")

    assert in_memory.digest == stored.digest
    assert set() == set(stored.verify())
    for name in layer_names(in_memory):
        expected, result = read_layer(in_memory, name), read_layer(stored, name)
        assert expected.dtype == result.dtype
        assert np.array_equal(expected, result, equal_nan=True)
    assert len(layer_names(stored)) == 8


def test_seen_area_at_some_steps_is_that_of_these_steps():
    content = watched("2 min")
    every = run(content)
    some = run(content, sight={"seen_every": "10 s"})
    first = read_layer(some, "first_seen.astro")

    assert (first[first >= 0] % 10 == 0).all()
    assert not (read_layer(some, "explored.astro") & ~read_layer(every, "explored.astro")).any()


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (
            {"floorplan": {"layers": {"explored": {"every": "1.5 s"}}}},
            "layers.explored.every is .* multiple",
        ),
        ({"floorplan": {"layers": {"dust": {"every": "0.5 s"}}}}, "layers.dust.every"),
        ({"sight": {"seen_every": "1.5 s"}}, "sight.seen_every is .* not a multiple"),
        (
            {"metrics": {"more": {"type": f"{HERE}:NeedsMore"}}},
            "NeedsMore needs 'exposed': did you mean",
        ),
    ],
)
def test_wrong_layers_are_an_error_before_the_run(change, why):
    content = watched()
    for key, value in change.items():
        content[key] = {**content.get(key, {}), **value}
    with pytest.raises(Fleet2DError, match=why):
        Simulation(content)


def test_nothing_is_watched_when_nobody_asks():
    content = watched()
    content["floorplan"].pop("layers")
    simulation = Simulation(content)

    assert [] == simulation._state.layers.areas
    assert {} == dict(simulation.home.layers)
