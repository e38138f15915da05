"""Robots that act on what they learn: the same run however it is computed, and nobody else changed.

The paper's scenario (long-term presence, and a robot that hangs out by it), with real-time presence and
a search by it on top: what is learned decides where the robot goes, and that what is learned.
"""

import json
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from functools import cache

import pytest
from tests.scenes import digests, process, scenario, table
from tests.thorough import some

import fleet2d

LEARNS = (
    "simulation.start=2026-01-05T06:00",
    "simulation.duration=10 h",
    "artifacts.trajectories=5 min",
    "algorithms.rtp={type: real_time_presence, model: hmm, period: 5 min}",
    "metrics.rtp_score={of: rtp}",
    "robots.astro.behaviors=[{type: find, user: ana, source: rtp, every: 5 h}, {type: hangout,"
    " source: ltp, near: view, explore: 20 %}]",
)


def lived(*overrides, **settings):
    return fleet2d.run("bundled:paper", *LEARNS, *overrides, **settings)


@cache
def base():
    return lived()


def test_the_loop_is_closed():
    """Without it the robot is somewhere else: what it learns moves it."""
    events = table(base(), "events", entity="astro")["event"]
    assert {"relocates", "explores"} <= set(events)
    naive = lived("algorithms.ltp.estimator=sighting_share")
    assert digests(base())["key_frames"] != digests(naive)["key_frames"]


@pytest.mark.parametrize("span", some([61, 997], 2))
def test_every_table_is_the_same_for_every_max_span(span):
    other = lived(max_span=span)
    assert digests(base()) == digests(other)
    assert base().metrics == other.metrics


def test_every_table_is_the_same_step_by_step():
    users = {"ana": {"type": "meander"}}
    robots = {
        "astro": {
            "camera": {"range": [0.3, 4], "detection": 0.8},
            "behaviors": [
                {"type": "find", "user": "ana", "source": "rtp", "every": "20 min"},
                {"type": "hangout", "source": "ltp", "period": "7 min", "explore": 0.5},
            ],
        }
    }
    algorithms = {
        "ltp": {"type": "long_term_presence", "period": "5 min"},
        "rtp": {"type": "real_time_presence"},
    }
    metrics = {"ltp_error": {"of": "ltp", "period": "10 min"}, "rtp_score": {"of": "rtp"}}
    content = scenario("1 h", users=users, robots=robots, algorithms=algorithms, metrics=metrics)
    whole, *others = (fleet2d.run(content, max_span=span) for span in (None, 60, 1))
    for other in others:
        assert digests(whole) == digests(other)
        assert whole.metrics == other.metrics


def test_users_live_the_same_whatever_the_robot_does():
    other = lived("robots.astro.behaviors=[{type: follow}, {type: patrol}]")
    assert digests(base())["key_frames"] != digests(other)["key_frames"]
    for name in ("key_frames", "trajectories", "events"):
        mine, theirs = (
            {column: list(map(str, values)) for column, values in rows.items()}
            for rows in (table(stored, name, entity="ana") for stored in (base(), other))
        )
        assert len(mine["step"]) > 20
        assert mine == theirs


def digest_of(seed):
    """The digest of a run, in a worker."""
    stored = lived(f"simulation.seed={seed}")
    return str(stored.digest)


@pytest.mark.slow
@pytest.mark.parametrize("workers", some([1, 2, 3], 3))
def test_runs_in_any_number_of_processes_are_those_of_one(workers):
    expected = [base().digest, digest_of(5)]
    assert expected[0] != expected[1]
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        assert expected == list(pool.map(digest_of, (4, 5)))


SCRIPT = """
import json, sys, fleet2d
print(fleet2d.run("bundled:paper", *json.loads(sys.argv[1])).digest)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "environment",
    some(
        [
            {
                "OMP_NUM_THREADS": "4",
                "OPENBLAS_NUM_THREADS": "4",
                "PYTHONHASHSEED": "8",
                "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3",
                "PYTHONWARNINGS": "ignore",
            },
            {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONHASHSEED": "7"},
        ],
        2,
    ),
    ids=lambda environment: f"{environment['OMP_NUM_THREADS']} threads",
)
def test_another_process_learns_the_same(environment, tmp_path):
    """What is learned is worked out from floats: their sums may depend on nothing but the data."""
    done = process("-c", SCRIPT, json.dumps(LEARNS), timeout=300, cwd=tmp_path, **environment)
    assert 0 == done.returncode, done.stderr
    assert base().digest == done.stdout.strip()
