"""Studies and maps from Python."""

import multiprocessing
import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from typing import ClassVar

import pytest
from tests.scenes import OWN
from tests.studies.scenes import SPEED, CountingExecutor, base, small

import fleet2d
from fleet2d.errors import ComponentError, InputError
from fleet2d.runs.run import Run
from fleet2d.studies.api import default_location, map_runs

SEEDED = [base("1 min", simulation={"seed": seed}) for seed in range(4)]


def digest_of(run: Run):
    return run.digest


def seed_of(run: Run):
    return int(run.manifest["seed"])


def fail_on_seed_two(run: Run):
    if run.manifest["seed"] == 2:
        raise ValueError("two")
    return int(run.manifest["seed"])


def end_the_process(run: Run):
    os._exit(3)


def test_a_study_is_run_and_opened(tmp_path):
    study = fleet2d.study(small(replicates=1), tmp_path / "study", executor="serial")
    assert f"<Study {tmp_path / 'study'}: 2 of 2 variants complete>" == repr(study)
    assert [0.3, 0.6] == study.variants[SPEED].to_list()


@pytest.mark.slow
def test_a_study_of_ones_own_components_runs_in_workers(tmp_path):
    own = {"share": {"type": f"{OWN}:Share", "period": "1 min"}}
    study = fleet2d.study(small(base=base(algorithms=own), replicates=1), tmp_path / "s", workers=1)
    assert 2 == study.counts.complete


@pytest.mark.slow
def test_a_map_returns_results_in_the_order_of_the_scenarios():
    expected = [fleet2d.run(scenario).digest for scenario in SEEDED]
    assert expected == map_runs(digest_of, SEEDED, workers=2)


def test_a_map_of_nothing_is_empty():
    assert [] == map_runs(digest_of, [])


class Reads:
    """A function that notes how often it was read from its pickle."""

    count: ClassVar[int] = 0

    def __setstate__(self, state):
        Reads.count += 1

    def __getstate__(self):
        return "anything"

    def __call__(self, run: Run):
        return Reads.count


def test_a_worker_reads_the_function_once():
    reads = map_runs(Reads(), SEEDED, executor="serial")
    assert 1 == len(set(reads))


@pytest.mark.slow
def test_a_lambda_can_be_mapped():
    pytest.importorskip("cloudpickle")
    assert [0, 1, 2, 3] == map_runs(lambda run: run.manifest["seed"], SEEDED, workers=1)


@pytest.mark.slow
@pytest.mark.parametrize("executor", ["local", "serial"])
def test_what_a_function_raises_is_raised_with_its_scenario(executor):
    with pytest.raises(ValueError, match="two") as caught:
        map_runs(fail_on_seed_two, SEEDED, workers=1, executor=executor)
    assert ["in scenario 2"] == caught.value.__notes__


@pytest.mark.slow
def test_a_function_that_ends_its_process_is_given_up():
    with pytest.raises(ComponentError, match=r"exit code 3.*in each of 3 attempts"):
        map_runs(end_the_process, SEEDED[:1], workers=1)


@pytest.mark.slow
def test_a_script_needs_no_guard_around_its_main_code(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import fleet2d\n"
        "def seed(run):\n    return run.manifest['seed']\n"
        "print(fleet2d.map_runs(seed, [fleet2d.load_scenario('simulation.duration=1 min', seed=s)"
        " for s in (3, 5)], workers=1))\n"
    )
    process = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=False, timeout=120,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )  # fmt: skip
    assert ("[3, 5]\n", 0) == (process.stdout, process.returncode), process.stderr


@pytest.mark.slow
def test_the_process_pool_of_python_runs_scenarios():
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as executor:
        assert [0, 1] == map_runs(seed_of, SEEDED[:2], executor=executor)


def test_an_unknown_executor_is_refused():
    with pytest.raises(InputError, match="give local or serial"):
        map_runs(seed_of, SEEDED, executor="cloud")


def test_a_study_is_stored_by_its_name():
    assert "studies/which-robot" == default_location("which robot?")


def test_runs_in_one_home_follow_each_other_and_results_keep_their_order():
    noting = CountingExecutor()
    homes = [{"type": "synthetic", "seed": home} for home in (1, 2, 1, 2)]
    scenarios = [{**one, "floorplan": home} for one, home in zip(SEEDED, homes, strict=True)]
    order = []
    results = map_runs(seed_of, scenarios, workers=1, executor=noting, on_result=order.append)
    assert [0, 1, 2, 3] == results
    assert [0, 2, 1, 3] == order
