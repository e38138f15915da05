"""Simulation in Python: step it, look at it, branch it, finish it."""

from pathlib import Path

import pytest
from tests.scenes import OWN, everything, run, scenario, table

import fleet2d
from fleet2d.errors import ComponentError, InputError, RunDirectoryError


def small(duration="10 min", **sections):
    return scenario(
        duration,
        users={"ana": {"type": "meander"}},
        robots={"astro": {"type": "patrol", "dwell": "30 s"}},
        **sections,
    )


def test_the_state_is_that_of_the_next_step():
    content = small("3 min")
    rows = table(run(content, "artifacts.trajectories=every step"), "trajectories", entity="ana")
    simulation = fleet2d.Simulation(content)
    for k in (0, 1, 2, 60, 61, 179):
        simulation.run_until(k)
        state = simulation.state["ana"]
        assert (rows["x"][k], rows["y"][k]) == (state["x"], state["y"])
        assert rows["heading"][k] == pytest.approx(state["heading"])
        assert rows["room"][k] == state["room"]
    assert not simulation.done
    simulation.advance()
    assert simulation.done


def test_advancing_beyond_the_end_stops_at_the_end():
    simulation = fleet2d.Simulation(small("1 min"))
    simulation.advance(1000)
    assert (60, True) == (simulation.step, simulation.done)
    simulation.advance()
    with pytest.raises(InputError, match="must be 0 or more"):
        simulation.advance(-3)
    with pytest.raises(TypeError):
        simulation.advance(1.5)
    assert 60 == simulation.step
    assert "complete" == simulation.finish().status


def test_a_run_finished_early_is_interrupted_and_whole_until_then():
    simulation = fleet2d.Simulation(small())
    simulation.advance(150)
    stored = simulation.finish()
    assert "interrupted" == stored.status
    assert (150, 150.0) == (stored.manifest["steps"], stored.manifest["simulated_s"])
    assert [0, 0, 60, 60, 120, 120] == table(stored, "trajectories")["step"].tolist()
    assert stored.digest == run(small("150 s")).digest
    assert [] == stored.verify()


def test_a_finished_run_can_not_go_on():
    simulation = fleet2d.Simulation(small())
    simulation.advance(1)
    stored = simulation.finish()
    for go_on in (simulation.run, simulation.advance):
        with pytest.raises(InputError, match="finished"):
            go_on()
    assert stored is simulation.finish()


def test_a_scenario_run_twice_runs_the_same_twice():
    content = small(algorithms={"keeper": {"type": f"{OWN}:Keeper", "period": "1 min"}})
    loaded = fleet2d.load_scenario(content)
    first, second = fleet2d.run(loaded), fleet2d.run(loaded)
    assert first.digest == second.digest == fleet2d.run(content).digest


def test_what_an_algorithm_put_out_does_not_change_with_its_own_arrays():
    both = {
        "keeper": {"type": f"{OWN}:Keeper", "period": "1 min"},
        "peek": {"type": f"{OWN}:Peek", "period": "1 min", "of": "keeper"},
    }
    result = []
    for order in (("keeper", "peek"), ("peek", "keeper")):
        stored = run(small(algorithms={name: both[name] for name in order}))
        result.append(stored.tables["peek"]["seen"].to_pylist())
    assert result[0] == result[1]
    assert [-1, 1, 2] == result[0][:3]


def test_nobody_writes_into_the_outputs():
    content = {**small(), "users": {"ben": {"type": f"{OWN}:Scribbler"}}}
    with pytest.raises(ComponentError, match="TypeError"):
        run(content)


def test_nothing_seen_yet_does_not_fix_the_columns():
    content = small(algorithms={"late": {"type": f"{OWN}:Late", "period": "1 min"}})
    table = run(content).tables["late"]
    assert {"ana"} == set(table["user"].to_pylist())


def test_without_a_seed_one_is_drawn_stored_and_repeats_the_run():
    content = small("2 min")
    del content["simulation"]["seed"]
    first, second = (run(content) for _ in range(2))
    assert first.manifest["seed"] != second.manifest["seed"]
    assert first.digest != second.digest
    seed = first.manifest["seed"]
    assert seed == first.manifest["scenario"]["simulation"]["seed"]
    assert first.digest == run(content, seed=seed).digest


def test_a_directory_that_holds_something_is_refused_before_anything_is_computed(tmp_path):
    (tmp_path / "mine.txt").write_text("precious")
    with pytest.raises(RunDirectoryError, match="not empty"):
        fleet2d.Simulation(small(), out=tmp_path)
    assert ["mine.txt"] == [path.name for path in tmp_path.iterdir()]


@pytest.mark.parametrize(
    "change",
    [
        {"users": {"ana": {"type": "meander", "start": [5.05, 1.0]}}},
        {"robots": {"astro": {"type": "patrol", "rooms": ["attic"]}}},
        {"algorithms": {"a": {"type": f"{OWN}:Share", "reads": ["b"]}}},
        {"metrics": {"distance": {"period": "1.5 s"}}},
        {"artifacts": {"trajectories": "1.5 s"}},
    ],
)
def test_wrong_input_leaves_no_directory(tmp_path, change):
    with pytest.raises(InputError):
        fleet2d.Simulation(small() | change, out=tmp_path / "deep" / "run")
    assert [] == list(tmp_path.iterdir())


def test_progress_is_told_now_and_then():
    told = []
    content = small("1 h", algorithms={"tick": {"type": f"{OWN}:Tick", "period": "1 s"}})
    fleet2d.Simulation(content).run(lambda simulation: told.append(simulation.step))
    assert told == sorted(told)
    assert told


def test_wall_times_add_up(tmp_path):
    import time

    began = time.perf_counter()
    stored = run(small("2 h"), out=tmp_path / "run")
    took = time.perf_counter() - began
    wall = stored.manifest["wall_s"]
    assert {"setup", "simulate", "save"} == set(wall)
    assert all(seconds > 0 for seconds in wall.values())
    assert sum(wall.values()) <= took


def test_the_manifest_tells_what_was_run():
    stored = run(small("90 s", simulation={"step": "500 ms"}))
    manifest = stored.manifest
    assert ("complete", 180, 90.0, 500_000) == (
        manifest["status"], manifest["steps"], manifest["simulated_s"], manifest["step_us"]
    )  # fmt: skip
    assert "2026-01-05T07:00:00" == manifest["start"]
    assert {"users": ["ana"], "robots": ["astro"]} == manifest["entities"]
    assert {"fleet2d", "numpy", "pyarrow", "shapely", "python"} <= set(manifest["versions"])
    (record,) = manifest["inputs"]
    assert record["path"].endswith("flat.json")
    assert 64 == len(record["sha256"])
    again = fleet2d.load_scenario(manifest["scenario"])
    assert stored.digest == run(again).digest


def test_the_files_of_own_components_are_among_the_inputs():
    stored = run(everything("1 min"))
    names = {Path(record["path"]).name for record in stored.manifest["inputs"]}
    assert {"flat.json", "own_components.py"} == names
