"""The file of a data set: homes, households and splits; and the runs that are drawn from it."""

import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from datetime import timedelta
from itertools import chain, combinations, takewhile
from pathlib import Path
from typing import Any, Literal, NamedTuple

from pydantic import Field, ValidationError, field_validator

from fleet2d.algorithms.evidence import steps_of_bin
from fleet2d.configuration.components import Settings
from fleet2d.configuration.documents import Document, read_document
from fleet2d.configuration.problems import problem, shown
from fleet2d.configuration.units import PositiveDuration, micros, parse_duration
from fleet2d.errors import InputError, ScenarioError, errors_as
from fleet2d.routines.persona import origins_of
from fleet2d.scenario.compose import apply_changes, assignment
from fleet2d.scenario.load import explain, load_scenario
from fleet2d.studies.axes import AnyAxis, Choice
from fleet2d.studies.design import content_hash, file_hash, input_hash, scenario_content
from fleet2d.studies.executors import Crew
from fleet2d.studies.households import members_of, personas_of
from fleet2d.studies.lives import (
    MAX_SEED,
    SEED_STEP,
    Draw,
    DrawSettings,
    FleetLife,
)
from fleet2d.studies.population import LifeFinder, left_out_words

# The folders of a data set beside those of its splits.
PARTS = "unfinished"
PICTURES = "pictures"
EVIDENCE = "evidence"
STAYS = "stays"
BELIEF = "belief_"
MAX_PERIOD = timedelta(days=1)


class SplitSettings(DrawSettings):
    """The runs of one split, and the source of their draws.

    Attributes:
        runs: The number of runs.
    """

    runs: int = Field(ge=1, le=1_000_000)

    def model_post_init(self, _: object, /) -> None:
        """Require people: the users of the base are replaced."""
        if not self.households and self.table is None:
            raise problem("give households: a list of the personas of each")


class DatasetFile(Settings):
    """A data set: the sources of its runs, and the tables that are stored of them.

    Attributes:
        name: Its name, the title of the data card.
        description: Its purpose.
        licence: The licence of its content, stated on the data card.
        base: A scenario: a file, bundled:NAME, or its sections. Its users are replaced.
        seed: The seed of all draws.
        splits: The splits by name: train, validation, test.
        vary: Axes of which each run has one value, drawn with equal chances.
        beliefs: Models of real-time presence whose belief is stored, by name.
        every: Time between stored beliefs.
        labels: Time between labels.
        runs_per_shard: The number of runs in a file.
        skip: unfit: leave out and count runs whose people don't fit into their home; left out: they
            are an error.
    """

    name: str = "data set"
    description: str = ""
    licence: str = "CC0-1.0"
    base: Any = None
    seed: int = Field(default=0, ge=0)
    splits: dict[str, SplitSettings] = Field(min_length=1)
    vary: dict[str, AnyAxis] = Field(default={})
    beliefs: tuple[str, ...] = ()
    every: PositiveDuration = timedelta(minutes=7)
    labels: PositiveDuration = timedelta(minutes=1)
    runs_per_shard: int = Field(default=16, ge=1)
    skip: Literal["unfit"] | None = None

    @field_validator("splits")
    @classmethod
    def _check_names(cls, splits: dict[str, SplitSettings]) -> dict[str, SplitSettings]:
        for name in splits:
            if not re.fullmatch(r"\w+", name, re.ASCII) or name in (PARTS, PICTURES):
                raise problem(
                    f"{shown(name)} can't be the name of a split, which has a folder: use letters,"
                    f" digits and _, and neither {PARTS!r} nor {PICTURES!r}"
                )
        return splits


@dataclass(frozen=True)
class PlannedRun:
    """A run of a data set.

    Attributes:
        number: Its number, from 0 on.
        split: The split.
        labels: The labels drawn for it: home, household, and the columns of `vary`.
        scenario: The scenario, as plain data.
    """

    number: int
    split: str
    labels: Mapping[str, Any]
    scenario: Mapping[str, Any]

    @property
    def seed(self) -> int:
        """The seed of the run, which no other run of the data set has."""
        return int(self.scenario["simulation"]["seed"])


class Shard(NamedTuple):
    """Runs of a split that are stored in one file of each table.

    Attributes:
        split: The split.
        number: Its number in the split, from 0 on.
        runs: The numbers in the split of its runs.
    """

    split: str
    number: int
    runs: Sequence[int]


@dataclass(frozen=True)
class DatasetPlan:
    """A data set that is checked. Its runs are drawn when they are needed, however many there are.

    Attributes:
        file: The settings.
        base: The scenario that all runs share.
        draws: The draws of the lives of each split.
        numbers: The numbers of the lives of each split that meet its conditions.
        left_out: How many lives were left out, and why, and remarks on tables, a line for each.
        unfit: The runs that are left out, as they can't be set up, and why, by number.
        inputs: Hashes of the other files that it is made from, in order.
    """

    file: DatasetFile
    base: Document
    draws: Mapping[str, Draw]
    numbers: Mapping[str, Sequence[int]]
    left_out: Sequence[str] = ()
    unfit: Mapping[int, str] = field(default_factory=dict)
    inputs: Sequence[str] = ()

    @property
    def digest(self) -> str:
        """SHA-256 of all inputs on which its content depends, without the code of Fleet2D."""
        homes = {}
        for name, draw in self.draws.items():
            homes[name] = [home.changes for home in draw.homes]
        file = self.file.model_dump(mode="json", exclude={"base"})
        content = [file, self.base.data, homes, self.inputs]
        text = json.dumps(content, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()

    def runs(self, split: str) -> Iterator[PlannedRun]:
        """Draw the runs of a split."""
        return (self.run(split, k) for k in range(self.file.splits[split].runs))

    def runs_of(self, shard: Shard) -> list[PlannedRun]:
        """Draw the runs of a shard."""
        return [self.run(shard.split, k) for k in shard.runs]

    def shards(self) -> Iterator[Shard]:
        """Yield the shards of all splits, except those without any fit run."""
        size = self.file.runs_per_shard
        for split, settings in self.file.splits.items():
            offset = self._first_number(split)
            for number, first in enumerate(range(0, settings.runs, size)):
                runs: Sequence[int] = range(first, min(first + size, settings.runs))
                if self.unfit:
                    runs = tuple(k for k in runs if offset + k not in self.unfit)
                if runs:
                    yield Shard(split, number, runs)

    def count(self, split: str) -> int:
        """Return the number of runs of a split, without those left out."""
        return sum(len(shard.runs) for shard in self.shards() if shard.split == split)

    def run(self, split: str, k: int) -> PlannedRun:
        """Draw run k of a split: homes are taken in turn, the rest is drawn at random."""
        lives = self.numbers[split]
        # Fresh runs never end: they go on to further lives or, with conditions, repeat those found.
        drawn = lives[k % len(lives)] if self.file.splits[split].where else k
        life = self.draws[split].life(drawn)
        number = self._first_number(split) + k
        scenario = self._scenario(life)
        scenario["simulation"]["seed"] = (self.file.seed * SEED_STEP + number) % MAX_SEED
        labels = {name: str(label) for name, label in life.labels.items()}
        return PlannedRun(number, split, labels, scenario)

    def check(self) -> list[str]:
        """Check each household, home and varied value in a scenario, before the first run.

        Returns:
            Hashes of the content that files add to these scenarios, such as personas, in order.

        Raises:
            InputError: A scenario would be wrong.
        """
        varied = {name: axis.choices(name) for name, axis in self.file.vary.items()}
        usual = [choices[0] for choices in varied.values()]
        hashes = set[str]()
        for split, settings in self.file.splits.items():
            draw = self.draws[split]
            first = draw.life(self.numbers[split][0])
            people = [*settings.households] or [first.household, *draw.table_households]
            homes = [axis.choices("home")[0] for axis in settings.homes]
            homes += [draw.homes[place] for place in draw.homes.listed]
            cases = [(f"homes: {home.words}", home, people[0], usual) for home in homes]
            cases += [
                (f"households: {' + '.join(personas_of(each))}", first.home, each, usual)
                for each in people
            ]
            for k, (name, choices) in enumerate(varied.items()):
                for choice in choices:
                    values = [*usual[:k], choice, *usual[k + 1 :]]
                    cases.append((f"vary.{name}: {choice.words}", first.home, people[0], values))
            for words, home, household, values in cases:
                with errors_as(ScenarioError, f"{split}, {words}"):
                    life = FleetLife(0, home, household, tuple(values), first.row)
                    scenario = load_scenario(self._scenario(life))
                    hashes |= {content_hash(scenario_content(scenario)), input_hash(scenario)}
            hashes.update(map(file_hash, draw.files))
        return sorted(hashes)

    def _first_number(self, split: str) -> int:
        """Return the number of the first run of a split."""
        before = takewhile(lambda name: name != split, self.file.splits)
        return sum(self.file.splits[name].runs for name in before)

    def _scenario(self, life: FleetLife) -> dict[str, Any]:
        changes = [assignment(keys, value, life.home.words) for keys, value in life.changes]
        scenario = deepcopy(apply_changes(self.base, changes).data)
        every = f"{self.file.every.total_seconds()} s"
        period = f"{_period(scenario['simulation']).total_seconds()} s"
        scenario["algorithms"] = {
            **scenario.get("algorithms", {}),
            EVIDENCE: {"type": "evidence_table", "period": period},
            **{
                f"{BELIEF}{model}": {
                    "type": "belief_table",
                    "model": model,
                    "every": every,
                    "period": period,
                }
                for model in self.file.beliefs
            },
        }
        scenario["metrics"] = {STAYS: {}}
        return scenario


def plan_dataset(source: str | Path | Mapping[str, Any], crew: Crew | None = None) -> DatasetPlan:
    """Read the file of a data set, and check that its splits don't overlap.

    Args:
        source: A YAML file, or the same as a mapping.
        crew: Where homes are built, if there are conditions on them; None: in this process.

    Raises:
        ScenarioError: The file is wrong, or its base isn't a scenario.
        InputError: Splits overlap; the message names the homes, households or personas.
    """
    document = (
        Document(dict(source)) if isinstance(source, Mapping) else read_document(Path(source))
    )
    try:
        file = DatasetFile.model_validate(document.data)
    except ValidationError as error:
        raise explain(error, document) from None
    with errors_as(ScenarioError, "base", of=ScenarioError):
        base = load_scenario(file.base).resolved()
    base["users"] = {}
    draws = {
        name: Draw(split, file.vary, file.seed, f"datasets.{name}")
        for name, split in file.splits.items()
    }
    numbers: dict[str, Sequence[int]] = {}
    left_out = []
    for name, split in file.splits.items():
        numbers[name] = range(split.runs)
        with errors_as(ScenarioError, name):
            finder = LifeFinder(draws[name], Document(base), crew)
            if split.where:
                asks_homes = draws[name].asks_homes
                numbers[name] = finder.find(split.runs, needs_facts=asks_homes)
        left_out += [*draws[name].notes, left_out_words(name, finder.left_out)]
    plan = DatasetPlan(file, Document(base), draws, numbers, [*filter(None, left_out)])
    plan = replace(plan, inputs=plan.check())
    _check_splits(file, {name: list(draw.homes) for name, draw in draws.items()})
    return plan


def _period(simulation: Mapping[str, Any]) -> timedelta:
    """Return the longest time up to a day that divides a run into equal parts of whole bins.

    The tables of a data set are filled once in that time, which costs least; an hour if there is
    none.
    """
    duration, step = (parse_duration(simulation[name]) for name in ("duration", "step"))
    parts = -(-duration // MAX_PERIOD)
    is_even = duration % (parts * steps_of_bin(micros(step)) * step) == timedelta(0)
    return duration / parts if is_even else timedelta(hours=1)


def _origins(user: Any) -> set[str]:
    """Return the names of the personas and logs from which a user comes, however changed."""
    persona = user.get("persona") if isinstance(user, Mapping) else None
    return origins_of(persona) if persona else set(personas_of({"": user}))


def _check_splits(file: DatasetFile, homes: Mapping[str, list[Choice]]) -> None:
    """Refuse splits that share a home, a household or a persona.

    Raises:
        InputError: Splits overlap; the message names what they share.
    """
    people: dict[str, set[str]] = {}
    plans: dict[str, dict[str, str]] = {}
    for name, split in file.splits.items():
        users = chain.from_iterable(members_of(each).values() for each in split.households)
        people[name] = set().union(*map(_origins, users))
        plans[name] = {json.dumps(home.changes, default=str): home.words for home in homes[name]}
    problems = []
    for one, other in combinations(file.splits, 2):
        shared_homes = [plans[one][key] for key in plans[one] if key in plans[other]]
        shared_people = sorted(people[one] & people[other])
        for kind, shared in (("home", shared_homes), ("persona", shared_people)):
            if shared:
                names = ", ".join(shared[:5])
                if len(shared) > 5:
                    names += " …"
                problems.append(f"{one} and {other} share {len(shared)} {kind}(s): {names}")
    if problems:
        raise InputError(
            "the splits overlap, so what is learned on one would be known to the other: "
            + "; ".join(problems)
        )
