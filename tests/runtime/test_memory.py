"""Garbage is looked for rarely during a run, so a run must leave none behind that is large."""

import gc
import platform
import subprocess
import sys
import weakref

import numpy as np
import pytest
from tests.scenes import scenario

import fleet2d
from fleet2d.entities.behavior import Actor
from fleet2d.entities.plan import Plan
from fleet2d.runtime.memory import OBJECTS, library_imports, rare_collections, release_memory

PATROL = {"astro": {"type": "patrol", "dwell": "1 min"}}


@pytest.fixture
def no_collector():
    gc.collect()
    gc.disable()
    yield
    gc.enable()


@pytest.fixture
def usual():
    before = gc.get_threshold()
    yield before
    gc.set_threshold(*before)


def alive():
    return sum(isinstance(thing, Actor | Plan) for thing in gc.get_objects())


def test_what_a_run_was_made_of_is_freed_at_once(no_collector):
    """A process of many runs grew by half: bodies and plans referred to each other."""
    fleet2d.run(scenario("30 min", robots=PATROL))
    before = alive()
    fleet2d.run(scenario("30 min", robots=PATROL))
    assert before == alive()


def test_released_memory_is_that_of_garbage_too(no_collector):
    loop = [np.ones(10_000)]
    loop.append(loop)
    array = weakref.ref(loop[0])
    del loop
    release_memory()
    assert array() is None


def test_thresholds_are_as_before_once_no_run_needs_others(usual):
    with rare_collections():
        assert (OBJECTS, *usual[1:]) == gc.get_threshold()
        with rare_collections():
            pass
        assert (OBJECTS, *usual[1:]) == gc.get_threshold()
    assert usual == gc.get_threshold()


@pytest.mark.parametrize("own", [0, 2 * OBJECTS])
def test_a_user_who_wants_fewer_collections_keeps_them(usual, own):
    gc.set_threshold(own, 5, 5)
    with rare_collections():
        assert (own, 5, 5) == gc.get_threshold()
    assert (own, 5, 5) == gc.get_threshold()


def test_modules_are_left_out_of_collections_only_in_a_process_with_few_objects():
    code = """
import gc, sys
objects = [[] for _ in range(int(sys.argv[1]))]
import fleet2d
fleet2d.Home
print(gc.get_freeze_count() > 10_000, gc.get_threshold()[0])
"""
    for number, is_frozen in ((0, True), (30_000, False)):
        command = [sys.executable, "-c", code, str(number)]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        assert f"{is_frozen} 700" == done.stdout.strip()


def test_objects_of_a_failed_import_are_collected_as_usual(usual):
    frozen = gc.get_freeze_count()
    with pytest.raises(ImportError), library_imports():
        raise ImportError
    assert usual == gc.get_threshold()
    assert frozen == gc.get_freeze_count()


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another allocator")
def test_memory_of_freed_arrays_is_used_again_without_new_pages():
    code = """
import resource, sys
import numpy as np
from fleet2d.runtime.memory import keep_free_memory
if sys.argv[1] == "keep":
    keep_free_memory()
faults = [resource.getrusage(resource.RUSAGE_SELF).ru_minflt for _ in range(2) if np.ones(2_500_000).all()]
print(faults[1] - faults[0])
"""
    kept, usual = (
        int(subprocess.check_output([sys.executable, "-c", code, word])) for word in ("keep", "")
    )
    assert 10 * kept < usual


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="Linux counts the parent's memory, too")
def test_peak_memory_is_not_that_of_the_process_that_started_this_one():
    """Workers of a driver with much memory were replaced after each call."""
    code = """
import subprocess, sys
import numpy as np
held = np.ones(50_000_000)
child = "from fleet2d.runtime.memory import peak_memory_mb; print(peak_memory_mb())"
print(subprocess.check_output([sys.executable, "-c", child], text=True))
"""
    peak_mb = float(subprocess.check_output([sys.executable, "-c", code], text=True))
    assert 5 < peak_mb < 200


@pytest.mark.skipif(sys.platform != "linux", reason="Linux tells the name beside the memory")
def test_peak_memory_is_told_whatever_the_process_is_called():
    code = """
import ctypes
from fleet2d.runtime.memory import peak_memory_mb
ctypes.CDLL(None).prctl(15, "müller".encode())
print(peak_memory_mb())
"""
    assert float(subprocess.check_output([sys.executable, "-c", code], text=True)) > 5
