"""Tuning: what is searched, on what, that it goes on where it stopped, and how it is judged."""

from pathlib import Path

import pytest
from tests.studies.scenes import SPEED, CountingExecutor, base, small
from tests.thorough import THOROUGH, some

from fleet2d.errors import InputError, RunDirectoryError, ScenarioError
from fleet2d.studies.driver import check_study
from fleet2d.studies.executors import Crew, LocalExecutor, SerialExecutor
from fleet2d.studies.tuning import (
    TRIALS,
    TrialTask,
    TuneResult,
    tune,
)

pytest.importorskip("optuna")
pytestmark = pytest.mark.filterwarnings("ignore::optuna.exceptions.ExperimentalWarning")


class Spy(CountingExecutor):
    """Remembers trials, and is interrupted after some tasks."""

    @property
    def trials(self) -> list[TrialTask]:
        return [task for task in self.tasks if isinstance(task, TrialTask)]


RADIUS = "robots.astro.radius"
PATROL = {"astro": {"type": "patrol", "dwell": 0, "speed": 0.2}}


def search(**keys):
    settings = {
        "search": {"speed": {"key": SPEED, "low": 0.2, "high": 1.0}},
        "objective": {"distance.astro": "maximize"},
        "trials": 6,
        "held_out": {"radius": [0.15]},
        **keys,
    }
    axes = {"radius": {"key": RADIUS, "values": [0.1, 0.15]}}
    return small(
        base=base("4 min", robots=PATROL),
        axes=axes,
        replicates=2,
        tune=settings,
    )


def tuned(tmp_path: Path, executor=None, **keys) -> TuneResult:
    options = {name: keys.pop(name) for name in ("changed",) if name in keys}
    workers = keys.pop("workers", 1)
    return tuned_study(search(**keys), tmp_path / "tune", executor, workers, **options)


def tuned_study(study, folder: Path, executor=None, workers=1, **options) -> TuneResult:
    crew = Crew(executor or SerialExecutor(), workers, batch_s=0.0)
    with crew.executor:
        return tune(study, folder, crew, **options)


def test_it_finds_what_is_better_on_homes_it_has_not_seen(tmp_path):
    spy = Spy()
    result = tuned(tmp_path, spy)
    assert {0, 1} == {task.index for task in spy.trials}
    assert 6 == len({task.trial for task in spy.trials})
    assert 0.2 <= result.settings[SPEED] <= 1.0
    (row,) = result.held_out.paired("distance.astro", {"setting": "base"}).to_dicts()
    assert row["difference"] > 0
    assert {0.15} == set(result.held_out.variants["radius"])


def test_it_goes_on_where_it_was_interrupted(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        tuned(tmp_path, Spy(5))
    spy = Spy()
    result = tuned(tmp_path, spy)
    assert 6 == result.trials["complete"]
    assert 4 == len({task.trial for task in spy.trials})  # two were complete
    again = Spy()
    assert tuned(tmp_path, again).settings == result.settings
    assert [] == again.trials


def parameters(tmp_path: Path):
    """State, settings and values of all trials of a search, in the order of their suggestion."""
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend

    storage = JournalStorage(JournalFileBackend(str(tmp_path / "tune" / TRIALS)))
    (study,) = storage.get_all_studies()
    trials = storage.get_all_trials(study._study_id)
    return [(trial.state.name, trial.params, trial.values) for trial in trials]


@pytest.mark.slow
def test_trials_are_the_same_with_any_number_of_workers(tmp_path):
    """Each worker that became free asked for a trial, so that their number decided on it."""
    keys = {"trials": 6, "batch": 3}
    tuned(tmp_path / "one", SerialExecutor(), **keys)
    workers = 3 if THOROUGH else 2
    tuned(tmp_path / "several", LocalExecutor(workers), workers=workers, **keys)
    assert parameters(tmp_path / "one") == parameters(tmp_path / "several")


CHANGES = {
    "held_out": ({"held_out": {"radius": [0.1]}}, {}, "the held-out part changed"),
    "homes": ({}, {"axes": {"radius": {"key": RADIUS, "values": [0.1, 0.12, 0.15]}}}, "homes"),
    "base": ({}, {"base": base("3 min", robots=PATROL)}, "base scenario"),
    "replicates": ({}, {"replicates": 1}, "seeds"),
    "search": ({"search": {"speed": {"key": SPEED, "low": 0.2, "high": 0.9}}}, {}, "parameters"),
    "objective": ({"objective": {"distance.ana": "maximize"}}, {}, "the objective changed"),
    "direction": ({"objective": {"distance.astro": "minimize"}}, {}, "the objective changed"),
    "seed": ({"seed": 1}, {}, "the seed of the search changed"),
    "batch": ({"batch": 2}, {}, "the batch changed"),
    "sampler": ({"sampler": "RandomSampler"}, {}, "the sampler changed"),
}


@pytest.mark.slow
@pytest.mark.parametrize("change", some([*CHANGES], 3))
def test_another_search_never_gets_the_trials_of_this_one(tmp_path, change):
    """Trials on a home that was held out afterwards counted, and were reported for homes unseen.

    So did values of another objective. Now such a folder is refused; redone, it starts anew.
    """
    settings, keys, message = CHANGES[change]
    first = Spy()
    tuned(tmp_path, first, trials=2)
    other = {**search(trials=2, **settings), **keys}
    with pytest.raises(RunDirectoryError, match=f"{message}.*--changed redo"):
        tuned_study(other, tmp_path / "tune")
    spy = Spy()
    result = tuned_study(other, tmp_path / "tune", spy, changed="redo")
    assert 2 == result.trials["complete"]
    assert 2 == len({task.trial for task in spy.trials})
    design = check_study(other).plan.design
    trained = {design.parameters(task.index)["radius"] for task in spy.trials}
    assert not trained & set(result.held_out.variants["radius"])
    # The old trials are still there, under a name of their own.
    again = Spy()
    tuned(tmp_path, again, trials=2, changed="redo")
    assert [] == again.trials


def test_more_trials_continue_a_search_and_judge_the_new_best(tmp_path):
    """If more trials found better settings, their study was refused as one of other scenarios."""
    tuned(tmp_path, trials=1)
    spy = Spy()
    result = tuned(tmp_path, spy, trials=8)
    assert 7 == len({task.trial for task in spy.trials})
    assert (8, 4) == (result.trials["complete"], result.held_out.counts.complete)


def test_trials_of_unknown_origin_are_refused(tmp_path):
    """Earlier versions stored trials without what they are of."""
    tuned(tmp_path, trials=1)
    (tmp_path / "tune" / "search.json").unlink()
    with pytest.raises(RunDirectoryError, match="holds another search"):
        tuned(tmp_path, trials=1)


def test_an_axis_that_applies_to_some_variants_only_is_not_held_out(tmp_path):
    """Variants without the axis were trained on, and were shown as held out."""
    study = search(held_out={"dwell": ["2 s"]})
    study["axes"]["dwell"] = {
        "key": "robots.astro.dwell", "values": ["1 s", "2 s"], "when": {"radius": 0.1},
    }  # fmt: skip
    with pytest.raises(ScenarioError, match="doesn't apply to all variants"):
        tuned_study(study, tmp_path / "tune")


def test_the_sampler_can_be_chosen(tmp_path):
    (tmp_path / "mine.py").write_text(
        "import optuna\n"
        "class Middle(optuna.samplers.BaseSampler):\n"
        "    def infer_relative_search_space(self, *_): return {}\n"
        "    def sample_relative(self, *_): return {}\n"
        "    def sample_independent(self, study, trial, name, distribution):\n"
        "        return (distribution.low + distribution.high) / 2\n"
    )
    own = tuned(tmp_path / "own", trials=2, sampler=f"{tmp_path}/mine:Middle")
    assert {SPEED: 0.6} == own.settings
    sampler = {"type": "QMCSampler", "qmc_type": "halton"}
    assert 5 == tuned(tmp_path / "halton", trials=5, sampler=sampler).trials["complete"]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"search": {"speed": {"key": "robots.astro.sped", "low": 1, "high": 2}}}, "'speed'"),
        ({"search": {"speed": {"key": SPEED, "low": -3, "high": 2}}}, "tune.search.speed"),
        ({"held_out": {"radius": [0.1, 0.15]}}, "none to run on"),
        ({"held_out": {"radius": [0.3]}}, "no variant has 0.3"),
        ({"sampler": "TPSampler"}, "did you mean 'TPESampler'"),
        ({"sampler": {"seed": 1}}, "name the type of the sampler"),
        ({"sampler": {"type": "TPESampler", "speed": 1}}, "can't be used.*speed"),
        ({"objective": {"a": "minimize", "b": "minimize"}}, "length 1 or less"),
    ],
)
def test_wrong_searches_are_refused(tmp_path, keys, message):
    with pytest.raises(ScenarioError, match=message):
        tuned(tmp_path, **keys)


def test_a_study_without_a_search_is_refused(tmp_path):
    with pytest.raises(ScenarioError, match="has no section `tune`"):
        tuned_study(small(), tmp_path)


def test_an_objective_that_no_variant_can_have_is_refused(tmp_path):
    """It showed only when all trials had failed."""
    with pytest.raises(
        ScenarioError, match=r"tune\.objective\.happiness: no variant has .*'happiness'"
    ):
        tuned(tmp_path, objective={"happiness": "maximize"}, trials=1)
    assert not (tmp_path / "tune").exists()


def test_an_objective_that_no_run_has_is_named(tmp_path):
    with pytest.raises(InputError, match=r"no trial succeeded.*no metric 'distance.happiness'"):
        tuned(tmp_path, objective={"distance.happiness": "maximize"}, trials=1)


def test_a_copy_of_a_home_is_not_held_out_of_a_search_on_the_home(tmp_path):
    home = Path(__file__).parents[2] / "examples" / "small_flat.json"
    paths = [tmp_path / name for name in ("first.json", "second.json", "third.json")]
    for path in paths[:2]:
        path.write_bytes(home.read_bytes())
    paths[2].write_text(home.read_text() + "\n")
    study = search(held_out={"home": ["second"]})
    study["axes"] = {"home": {"floorplans": [str(path) for path in paths]}}
    with pytest.raises(ScenarioError, match="the same but for the names of files"):
        tuned_study(study, tmp_path / "tune")
    assert not (tmp_path / "tune").exists()
    study["axes"]["home"]["floorplans"] = [str(path) for path in paths[1:]]
    assert 1 == tuned_study(study, tmp_path / "tune").held_out.variants["home"].n_unique()
