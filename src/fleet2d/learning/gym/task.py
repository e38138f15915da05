"""Tasks: the scenarios that an agent lives in, as a distribution of homes and people, and rewards.

A task is one YAML file: a scenario with a robot whose first behavior is `policy`, what to vary in
it at each reset, apart for each split, and the weights of the reward.
"""

import json
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import Field, ValidationError, field_validator

from fleet2d.configuration.components import Settings
from fleet2d.configuration.documents import Document, read_document
from fleet2d.configuration.problems import check_known, problem, suggest
from fleet2d.entities.robots.policy import LearnedBehavior
from fleet2d.errors import InputError, ScenarioError
from fleet2d.floorplan.home import HOME_CACHE
from fleet2d.floorplan.source import PLAN_CACHE
from fleet2d.metrics.household import TERMS
from fleet2d.scenario.load import explain, load_scenario
from fleet2d.scenario.model import Scenario
from fleet2d.studies.axes import check_count

FOLDER = Path(__file__).with_name("tasks")
Split = Literal["train", "validation", "test"]
# The numbers of scenarios and of homes that are kept for a task.
KEPT = 512
HOMES = 128

METRIC = "household"
"""The metric of every life, which measures the terms of rewards: see `HouseholdReward`."""


class Values(Settings):
    """The values of one key of the scenario, for training, for choosing a policy, and for testing.

    Attributes:
        train: The values, or {range: [first, end]}, for training.
        validation: The values for choosing among policies; left out: those for training.
        test: The values for testing; left out: those for training.
    """

    train: tuple[Any, ...] = Field(min_length=1)
    validation: tuple[Any, ...] = ()
    test: tuple[Any, ...] = ()

    @field_validator("train", "validation", "test", mode="before")
    @classmethod
    def _spell_out(cls, value: Any) -> Any:
        if not isinstance(value, Mapping):
            return value
        match value:
            case {"range": [int(first), int(end)], **others} if first < end and not others:
                check_count(end - first)
                return tuple(range(first, end))
        raise problem(
            "expected a list of values, or {range: [first, end]} with whole numbers, first < end"
        )


class LearningTask(Settings):
    """The scenarios and the rewards from which an agent learns.

    Attributes:
        scenario: The scenario, or the file of one.
        vary: Values of keys of the scenario, such as floorplan.seed, drawn anew at each reset.
        reward: Weights of the reward's terms; see `fleet2d.metrics.household.TERMS`.
    """

    scenario: dict[str, Any] | str = "bundled:paper"
    vary: dict[str, Values] = Field(default={})
    reward: dict[str, float] = Field(default={"near_min": 1.0}, min_length=1)

    @field_validator("reward")
    @classmethod
    def _is_known(cls, value: dict[str, float]) -> dict[str, float]:
        for name in value:
            check_known(name, "term", TERMS, problem)
        return value

    def draw(self, random: np.random.Generator, split: Split) -> dict[str, Any]:
        """Draw a value of each key that varies."""
        values = {key: getattr(each, split) or each.train for key, each in self.vary.items()}
        return {key: items[int(random.integers(len(items)))] for key, items in values.items()}


class LifeScenario(NamedTuple):
    """A scenario of a task.

    Attributes:
        scenario: The scenario.
        robots: The names of its robots whose first behavior is a policy without a file.
    """

    scenario: Scenario
    robots: tuple[str, ...]


class Variants:
    """The scenarios of a task; the newest ones are kept."""

    def __init__(self, task: LearningTask, overrides: tuple[str, ...] = ()) -> None:
        self.task = task
        self.overrides = overrides
        PLAN_CACHE.grow(HOMES)
        HOME_CACHE.grow(HOMES)
        self._load: Callable[[tuple[str, ...]], LifeScenario] = lru_cache(KEPT)(self._read)

    def __reduce__(self) -> Any:
        """Keep no scenario in a pickled copy."""
        return Variants, (self.task, self.overrides)

    def load(self, values: Mapping[str, Any]) -> LifeScenario:
        """Return the scenario with some values of its keys.

        Raises:
            InputError: The scenario is wrong, or no robot has a policy.
        """
        return self._load(tuple(f"{key}={json.dumps(value)}" for key, value in values.items()))

    def first(self, split: Split) -> LifeScenario:
        """Return one of the scenarios, always the same; see `load`."""
        return self.load(self.task.draw(np.random.default_rng(0), split))

    def _read(self, changes: tuple[str, ...]) -> LifeScenario:
        metric = f"metrics.{METRIC}.type={METRIC}"
        scenario = load_scenario(self.task.scenario, *self.overrides, *changes, metric)
        robots = tuple(
            name
            for name, robot in scenario.robots.items()
            if robot.behaviors and isinstance(robot.behaviors[0], LearnedBehavior)
        )
        if not robots:
            raise ScenarioError(
                "no robot's first behavior is a policy: give one, as in robots: {astro: {behaviors:"
                " [{type: policy, task: hangout}]}}"
            )
        return LifeScenario(scenario, robots)


def load_task(source: str | Path | Mapping[str, Any] | LearningTask) -> LearningTask:
    """Return a task: one of ours by name, a file of a task or a scenario, or its content.

    Raises:
        InputError: There is no such task, or it is wrong.

    Example:
        >>> load_task("hangout").reward["near_min"]
        1.0
    """
    if isinstance(source, LearningTask):
        return source
    names = [path.stem for path in sorted(FOLDER.glob("*.yaml"))]
    if isinstance(source, str) and source in names:
        source = FOLDER / f"{source}.yaml"
    if isinstance(source, Mapping):
        document = Document(dict(source), {})
    else:
        path = Path(source)
        if path.suffix not in (".yaml", ".yml"):
            raise InputError(f"there is no task {str(source)!r}{suggest(str(source), names)}")
        document = read_document(path)
    if "scenario" not in document.data:
        return LearningTask(scenario=document.data if isinstance(source, Mapping) else str(source))
    return checked(document)


def checked(document: Document) -> LearningTask:
    """Return the task of a document.

    Raises:
        ScenarioError: The task is wrong.
    """
    try:
        return LearningTask.model_validate(document.data)
    except ValidationError as error:
        raise explain(error, document) from None
