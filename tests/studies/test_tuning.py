"""Tuning: what is searched, on what, that it goes on where it stopped, and how it is judged."""

from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest
from tests.studies.scenes import SPEED, base, small

from fleet2d.errors import InputError, ScenarioError
from fleet2d.studies.axes import Parameter
from fleet2d.studies.driver import check_study
from fleet2d.studies.execution.local import LocalExecutor
from fleet2d.studies.executors import Event, SerialExecutor, TaskSchedule, WorkerJob
from fleet2d.studies.simulator import StagedRun
from fleet2d.studies.tuning import TrialJob, TrialSchedule, TrialTask, TuneResult, tune

pytest.importorskip("optuna")
pytestmark = pytest.mark.filterwarnings("ignore::optuna.exceptions.ExperimentalWarning")


class Spy(SerialExecutor):
    """Remembers tasks, and is interrupted after some."""

    def __init__(self, most: int = 1000) -> None:
        self.most, self.tasks = most, list[Any]()

    def run(self, job: WorkerJob, tasks: TaskSchedule) -> Generator[Event]:
        for event in super().run(job, tasks):
            if len(self.tasks) == self.most:
                raise KeyboardInterrupt
            self.tasks.append(event.task)
            yield event

    @property
    def trials(self) -> list[TrialTask]:
        return [task for task in self.tasks if isinstance(task, TrialTask)]


def search(**keys: Any) -> dict[str, Any]:
    settings = {
        "search": {"speed": {"key": SPEED, "low": 0.2, "high": 1.0}},
        "objectives": {"distance.astro": "maximize"},
        "trials": 6,
        "held_out": {"radius": [0.15]},
        **keys,
    }
    axes = {"radius": {"key": "robots.astro.radius", "values": [0.1, 0.15]}}
    return small(
        base=base("4 min", robots={"astro": {"type": "patrol", "dwell": 0, "speed": 0.2}}),
        axes=axes,
        replicates=2,
        tune=settings,
    )


def tuned(tmp_path: Path, executor: Any = None, **keys: Any) -> TuneResult:
    return tune(search(**keys), tmp_path / "tune", executor or SerialExecutor())


def test_it_finds_what_is_better_on_homes_it_has_not_seen(tmp_path: Path) -> None:
    result = tuned(tmp_path)
    assert 0.2 <= result.settings["tuned"][SPEED] <= 1.0
    (row,) = result.held_out.paired("distance.astro", {"setting": "as it was"}).to_dicts()
    assert row["difference"] > 0
    assert {0.15} == set(result.held_out.variants["radius"])


def test_it_runs_on_training_homes_only(tmp_path: Path) -> None:
    spy = Spy()
    tuned(tmp_path, spy)
    assert {0, 1} == {task.index for task in spy.trials}
    assert 6 == len({task.trial for task in spy.trials})


def test_it_goes_on_where_it_was_interrupted(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        tuned(tmp_path, Spy(5))
    spy = Spy()
    result = tuned(tmp_path, spy)
    assert 6 == result.trials["complete"]
    assert 4 == len({task.trial for task in spy.trials})  # two were complete
    again = Spy()
    assert tuned(tmp_path, again).settings == result.settings
    assert [] == again.trials


def test_what_does_badly_is_given_up_at_simulated_times(tmp_path: Path) -> None:
    spy = Spy()
    result = tuned(tmp_path, spy, trials=12, prune_at=["1 min", "2 min"])
    assert result.trials["pruned"] > 0
    assert 12 == result.trials["pruned"] + result.trials["complete"]
    assert {60.0, 120.0, None} == {task.until_s for task in spy.trials}


def test_what_goes_on_is_not_begun_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    starts = []

    class Counted(StagedRun):
        def __init__(self, scenario: Any) -> None:
            starts.append(scenario)
            super().__init__(scenario)

    monkeypatch.setattr("fleet2d.studies.tuning.StagedRun", Counted)
    spy = Spy()
    tuned(tmp_path, spy, trials=8, prune_at=["1 min", "2 min"])
    runs = {(task.trial, task.index) for task in spy.trials}
    assert len(runs) == len(starts) < len(spy.trials)


def test_a_run_that_goes_on_comes_to_what_one_from_the_start_does() -> None:
    checked = check_study(search())
    parameters = {"speed": Parameter(key=SPEED, low=0.2, high=1.0)}
    objectives = ("distance.astro", "sightings.ana")

    def answers(*stages: float | None) -> list[bytes]:
        job = TrialJob(checked.plan.design, parameters, objectives)
        return [job(TrialTask(0, 0, "", "", 0, {"speed": 0.5}, stage)) for stage in stages]

    minute_1, minute_2, end = answers(60.0, 120.0, None)
    assert [minute_2] == answers(120.0)
    assert [end] == answers(None)
    assert minute_1 != minute_2


def test_a_variant_goes_on_with_the_worker_that_keeps_it() -> None:
    optuna = pytest.importorskip("optuna")
    study = optuna.create_study(pruner=optuna.pruners.NopPruner())
    variants = [(0, "home"), (1, "home")]
    parameters = {"speed": Parameter(key=SPEED, low=0.2, high=1.0)}
    schedule = TrialSchedule(study, parameters, variants, (60.0, None), 1)
    task_a, task_b = schedule.take("one"), schedule.take("two")
    assert isinstance(task_a, TrialTask)
    assert isinstance(task_b, TrialTask)
    assert schedule.take("one") is None
    schedule.finish(task_a, [1.0], None)
    schedule.finish(task_b, [1.0], None)
    next_tasks = schedule.take("two"), schedule.take("one")
    assert [task_b.index, task_a.index] == [task.index for task in next_tasks if task]
    schedule.put_back(next_tasks[1])  # type: ignore[arg-type]
    schedule.leave("one")
    task = schedule.take("two")
    assert task is not None
    assert task_a.index == task.index


def test_several_objectives_end_in_several_settings(tmp_path: Path) -> None:
    objectives = {"distance.astro": "maximize", "sightings.ana": "maximize"}
    result = tuned(tmp_path, objectives=objectives)
    assert all(name.startswith("trial ") for name in result.settings)
    assert all(len(values) == 2 for values in result.values.values())


def test_it_runs_in_worker_processes(tmp_path: Path) -> None:
    assert 3 == tuned(tmp_path, LocalExecutor(1), trials=3).trials["complete"]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"search": {"speed": {"key": "robots.astro.sped", "low": 1, "high": 2}}}, "'speed'"),
        ({"search": {"speed": {"key": SPEED, "low": -3, "high": 2}}}, "tune.search.speed"),
        ({"held_out": {"radius": [0.1, 0.15]}}, "none to run on"),
        ({"held_out": {"radius": [0.3]}}, "no variant has 0.3"),
        ({"prune_at": ["2 min", "1 min"]}, "ascending"),
        (
            {"prune_at": ["1 min"], "objectives": {"a": "minimize", "b": "minimize"}},
            "one objective",
        ),
    ],
)
def test_wrong_searches_are_refused(tmp_path: Path, keys: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        tuned(tmp_path, **keys)


def test_a_study_without_a_search_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="has no section `tune`"):
        tune(small(), tmp_path, SerialExecutor())


def test_an_objective_that_no_run_has_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no trial succeeded.*no metric 'happiness'"):
        tuned(tmp_path, objectives={"happiness": "maximize"}, trials=1)
