"""The engine's main test: how a run is cut into spans, where, and beside what, never shows."""

import functools
import json
import os
from pathlib import Path

import pytest
from tests.scenes import OWN, digests, every_step, everything, process, run, table
from tests.thorough import some

import fleet2d
from fleet2d.artifacts.store import RunStore

GOLDEN = Path(__file__).parents[1] / "golden.json"
SPANS = [None, 3600, 7, 1]


@pytest.fixture(scope="module")
def whole():
    """Two hours with every behavior, in spans as long as they get."""
    return run(everything())


def test_the_scenario_of_these_tests_has_every_kind_of_row(whole):
    events = table(whole, "events")
    assert {
        "user_seen",
        "user_lost",
        "reacts",
        "obeys",
        "activity",
        "left_home",
        "came_home",
        "gives_way",
        "gives_up",
        "deadlock",
    } == set(events["event"])
    reactions = set(zip(events["entity"], [d.split(" ")[0] for d in events["detail"]], strict=True))
    assert {
        (robot, event) for robot in ("astro", "bolt") for event in ("user_seen", "user_lost")
    } <= reactions
    assert {"track", "planned", "walk"} == set(table(whole, "key_frames")["kind"])
    assert {"astro", "bolt", "curio", "drift"} == set(table(whole, "observations")["robot"])
    assert all(rows.num_rows for rows in whole.tables.values())


@pytest.mark.slow
@pytest.mark.parametrize("span", some(SPANS[1:], 2))
def test_every_table_is_the_same_for_every_max_span(whole, span):
    other = run(everything(), max_span=span)
    assert digests(whole) == digests(other)
    assert whole.metrics == other.metrics


@pytest.mark.parametrize(
    ("steps", "gathered", "rows"), some([(64, 50, 97), (1000, 1, 1), (7, 3000, 8)], 2)
)
def test_every_table_is_the_same_however_rows_are_gathered_and_stored(
    whole, monkeypatch, steps, gathered, rows
):
    """Blocks of poses, rows on their way to the store and row groups all end somewhere else."""
    monkeypatch.setattr("fleet2d.engine.state.MAX_STEPS", 1)
    monkeypatch.setattr("fleet2d.engine.state.MIN_STEPS", steps)
    monkeypatch.setattr("fleet2d.engine.recorder.MAX_ROWS", gathered)
    monkeypatch.setattr("fleet2d.engine.recorder.ROWS_PER_BODY", 0)
    store = functools.partial(RunStore, flush_rows=rows)
    monkeypatch.setattr("fleet2d.engine.simulation.RunStore", store)
    assert digests(whole) == digests(run(everything()))


def test_an_algorithm_after_every_step_sees_the_same_for_every_max_span():
    first, *others = (digests(run(every_step(), max_span=span)) for span in SPANS)
    assert "tick" in first
    for other in others:
        assert first == other


@pytest.mark.slow
def test_steps_longer_and_shorter_than_a_second_give_the_same_for_every_max_span():
    for step, duration in (("250 ms", "8 min"), ("7 s", "1 h 10 min"), ("1 min", "3 h")):
        content = everything(duration)
        content["simulation"]["step"] = step
        for robot in content["robots"].values():  # a multiple of each of these steps
            if robot.get("camera"):
                robot["camera"] = {**robot["camera"], "lost_after": "7 min"}
        content["artifacts"] = {"trajectories": "7 min"}
        content["metrics"]["distance"] = {"period": "7 min"}
        content["metrics"]["sightings"] = {"period": "14 min"}
        content["algorithms"] = {"share": {"type": f"{OWN}:Share", "period": "7 min"}}
        content["metrics"]["room_share"] = {"period": "35 min"}
        first, *others = (digests(run(content, max_span=span)) for span in (None, 7, 1))
        assert [first, first] == others, step


def test_chunks_of_any_size_add_up_to_the_same_run(whole):
    simulation = fleet2d.Simulation(everything())
    size = 1
    while not simulation.done:
        simulation.advance(size)
        size = size * 3 % 1009 + 1
    assert digests(whole) == digests(simulation.finish())


# --- Other processes ---------------------------------------------------------------------------

SCRIPT = """
import json, sys
import fleet2d
run = fleet2d.run(json.load(open(sys.argv[1])))
print(run.digest)
"""


def digest_elsewhere(content, folder, **environment):
    """The digest of a run in another process."""
    file = folder / "scenario.json"
    file.write_text(json.dumps(content))
    done = process("-c", SCRIPT, str(file), timeout=300, **environment)
    assert 0 == done.returncode, done.stderr
    return done.stdout.strip()


@pytest.mark.slow
@pytest.mark.parametrize(
    "environment",
    some(
        [
            {
                "OMP_NUM_THREADS": "4",
                "OPENBLAS_NUM_THREADS": "4",
                "PYTHONHASHSEED": "2",
                "TZ": "Asia/Tokyo",
            },
            {"OMP_NUM_THREADS": "1", "PYTHONHASHSEED": "1"},
        ],
        2,
    ),
    ids=lambda environment: f"{environment['OMP_NUM_THREADS']} threads",
)
def test_another_process_gets_the_same_run(whole, tmp_path, environment):
    assert whole.digest == digest_elsewhere(everything(), tmp_path, **environment)


@pytest.mark.slow
def test_numpy_for_an_older_processor_gives_the_same_run(whole, tmp_path):
    # What NumPy doesn't know, or has built in, it warns about; and NumPy on other machines has others.
    features = "AVX2 FMA3 AVX512F AVX512_SKX AVX512CD AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR X86_V3 X86_V4"
    environment = {"NPY_DISABLE_CPU_FEATURES": features, "PYTHONWARNINGS": "ignore"}
    assert whole.digest == digest_elsewhere(everything(), tmp_path, **environment)


# --- Who else is there -------------------------------------------------------------------------


def lives(stored, *names):
    """Everything that is stored of some bodies, by column."""
    result = []
    for name in names:
        for source in ("key_frames", "trajectories"):
            columns = table(stored, source, entity=name)
            result.append({column: values.tolist() for column, values in columns.items()})
            assert len(columns["step"])
    return json.loads(json.dumps(result, default=str))


def alone(duration):
    """The scenario of these tests, in which robots don't yield to anybody."""
    content = everything(duration)
    content["simulation"]["ghosts"] = True
    return content


def changed(**sections):
    """The scenario of these tests with entries added or replaced."""
    content = alone("40 min")
    for section, entries in sections.items():
        content[section] = {**entries, **content[section]}  # before the others
    return content


@pytest.fixture(scope="module")
def reference():
    """What the runs with somebody more are compared with."""
    return run(alone("40 min"))


EVERYBODY = ("ana", "ben", "astro", "bolt", "curio", "drift", "ego")


def test_a_robot_more_leaves_users_and_other_robots_as_they_were(reference):
    more = run(changed(robots={"zed": {"type": "meander"}, "yak": {"type": f"{OWN}:Greet"}}))
    # Ego acts on what all robots see.
    others = [name for name in EVERYBODY if name != "ego"]
    assert lives(reference, *others) == lives(more, *others)


def test_a_user_more_leaves_others_and_what_is_detected_of_them_as_they_were(reference):
    more = run(changed(users={"zoe": {"type": "meander"}}))
    bystanders = ("ana", "ben", "curio", "drift")
    assert lives(reference, *bystanders) == lives(more, *bystanders)
    for user in ("ana", "ben"):
        before, after = (
            table(stored, "observations", robot="curio", user=user) for stored in (reference, more)
        )
        assert len(before["step"])
        assert before["step"].tolist() == after["step"].tolist()
        assert before["x"].tolist() == after["x"].tolist()


def test_an_algorithm_and_a_metric_more_leave_everything_as_it_was(reference):
    more = run(
        changed(
            algorithms={"other": {"type": f"{OWN}:Tick", "period": "13 s"}},
            metrics={"spy": {"type": f"{OWN}:Spy", "period": "17 s"}},
        )
    )
    before, after = digests(reference), digests(more)
    assert {k: v for k, v in before.items() if k != "run"} == {
        k: v for k, v in after.items() if k not in ("run", "other")
    }


def test_another_seed_is_another_life(reference):
    other = run(everything("40 min"), seed=5)
    assert lives(reference, "ben") != lives(other, "ben")
    assert lives(reference, "ana") != lives(other, "ana")
    assert (
        table(reference, "observations")["step"].tolist()
        != table(other, "observations")["step"].tolist()
    )


# --- Pinned ------------------------------------------------------------------------------------


def test_digests_are_those_pinned(whole):
    result = {
        "paper, 1 day": fleet2d.run("bundled:paper", "simulation.duration=1 d").digest,
        "family, 1 day": fleet2d.run("bundled:family", "simulation.duration=1 d").digest,
        "rounds, 1 day": fleet2d.run("bundled:rounds", "simulation.duration=1 d").digest,
        "every behavior, 2 h": whole.digest,
    }
    if os.environ.get("FLEET2D_WRITE_GOLDEN") == "1":
        GOLDEN.write_text(json.dumps(result, indent=2) + "\n")
    pinned = json.loads(GOLDEN.read_text())
    assert pinned == result, (
        "the same scenario gives another run than before. If that is meant, say in CHANGELOG.md what"
        " changes for users and why, and pin the new digests: FLEET2D_WRITE_GOLDEN=1 pytest"
        " tests/engine/test_spans.py. If it is not, or only on this machine, it is a bug."
    )
