"""Populations: lives that meet conditions, found for studies and data sets."""

import itertools
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter

from fleet2d.configuration.components import OneOf
from fleet2d.configuration.documents import Document
from fleet2d.errors import Fleet2DError, NoLayoutError, ScenarioError
from fleet2d.floorplan.source import FloorPlanSource
from fleet2d.scenario.compose import apply_changes, assignment
from fleet2d.studies.axes import (
    KINDS,
    AnyAxis,
    Axis,
    Choice,
    Count,
    axis_of,
)
from fleet2d.studies.executors import Crew, SerialExecutor, TaskQueue, WorkerTask, run_tasks
from fleet2d.studies.households import members_of
from fleet2d.studies.lazy import LazySequence
from fleet2d.studies.lives import (
    AREA,
    BEDROOMS,
    FEATURES,
    FIT,
    HOME,
    HOUSEHOLD,
    Draw,
    DrawSettings,
    FleetLife,
    HomeFeatures,
)

# The number of lives drawn for each to keep, above which conditions are too narrow.
MAX_DRAWS = 20
# The number of homes up to which starting workers costs more than it saves.
FEW_HOMES = 8
# The number of reasons in one report.
MAX_PROBLEMS = 10
# The number of lives or variants named for a reason, after the first.
MAX_NAMED = 5
# The reason to leave out a life whose synthetic home isn't found, though others are.
NO_LAYOUT = "no layout of its home was found"


class PopulationAxis(Axis, DrawSettings):
    """Lives: homes with people, settings of robots and logs, drawn together, each with its seed.

    Synthetic homes have bedrooms and an area that fit their households, unless the table or the
    conditions set the bedrooms, or the homes have settings for them.

    Attributes:
        population: The number of lives.
        vary: Axes of which each life has one value, drawn with equal chances.
        seed: The seed of all draws.
    """

    is_population: ClassVar[bool] = True

    population: Count = Field(ge=1)
    vary: dict[str, AnyAxis] = Field(default={})
    seed: int = Field(default=0, ge=0)

    @property
    def fits(self) -> bool:
        """Whether homes must have the bedrooms that their households need."""
        return self.where.get(BEDROOMS, FIT) == FIT

    @cached_property
    def draw(self) -> "Draw":
        """The draw of its lives.

        Raises:
            InputError: The table can't be read, or is wrong.
        """
        return Draw(self, self.vary, self.seed, "population")

    @property
    def replaces_people(self) -> bool:
        """Whether the users of the base are replaced."""
        return bool(self.households) or HOUSEHOLD in self.draw.table_columns

    def columns(self, name: str) -> tuple[str, ...]:
        """Return the columns of its labels: the number of the life, and what was drawn."""
        return tuple(dict.fromkeys((name, HOME, HOUSEHOLD, *FEATURES, *self.draw.columns)))

    def populations(self, name: str) -> tuple[str, ...]:
        """Return the units over which intervals hold: homes, and lives in them."""
        return HOME, name

    def choices(self, name: str) -> list[Choice]:
        """Refuse a population within another axis.

        Raises:
            ScenarioError: Always: lives are found by `find_lives`.
        """
        raise ScenarioError("a population can't be drawn within another axis, or as one of `vary`")


def _study_axis(value: Any) -> Any:
    return axis_of(value, {**KINDS, "population": PopulationAxis})


StudyAxis = Annotated[Axis, BeforeValidator(_study_axis)]
"""A field that takes an axis of any kind, also a population."""


@dataclass(frozen=True)
class FactsJob:
    """Builds homes in workers, and returns facts of them.

    Attributes:
        base: The scenario that all lives share.
    """

    base: Document

    def __call__(self, task: "HomeTask") -> "HomeFeatures | UnbuiltHome":
        """Return the facts of a home, or why it can't be built."""
        try:
            return facts_of(self.base, task.changes)
        except Fleet2DError as error:
            return UnbuiltHome(str(error), isinstance(error, NoLayoutError))


class UnbuiltHome(NamedTuple):
    """A home that can't be built.

    Attributes:
        reason: Why it can't be built.
        by_chance: Whether another synthetic home of as many rooms might be found.
    """

    reason: str
    by_chance: bool


@dataclass(frozen=True)
class HomeTask(WorkerTask):
    """A home to build.

    Attributes:
        changes: The (key path, value) pairs that make it.
    """

    changes: tuple[tuple[tuple[str, ...], Any], ...] = ()


_FLOORPLAN: TypeAdapter[FloorPlanSource] = TypeAdapter(OneOf[FloorPlanSource])


def facts_of(base: Document, changes: Sequence[tuple[tuple[str, ...], Any]]) -> HomeFeatures:
    """Build the home of a scenario with changes; return facts of it.

    Raises:
        InputError: It can't be built.
    """
    composed = apply_changes(base, [assignment(keys, value, "home") for keys, value in changes])
    plan = _FLOORPLAN.validate_python(composed.data.get("floorplan") or {}).plan()
    kinds = frozenset(kind for room in plan.rooms for kind in (room.type, *room.labels))
    bedrooms = len(plan.rooms_of_type("bedroom"))
    return HomeFeatures(len(plan.rooms), bedrooms, round(plan.area_m2, 1), kinds)


@dataclass
class FleetLives(LazySequence[Choice]):
    """The lives of a population that meet its conditions, each drawn again when it is needed.

    Attributes:
        column: The column of their numbers.
        draw: The draw of the lives.
        numbers: The numbers of those that are kept: int32 (lives,).
        features: The features of their homes, by column.
        left_out: The number of lives left out, by the first condition that they don't meet.
    """

    column: str
    draw: Draw
    numbers: Any
    features: Mapping[str, Any]
    left_out: Mapping[str, int] = field(default_factory=dict)

    def __len__(self) -> int:
        """Return the number of lives."""
        return len(self.numbers)

    def item(self, index: int) -> Choice:
        """Return a life."""
        number = int(self.numbers[index])
        life = self.draw.life(number)
        people = None if life.household is None else len(members_of(life.household))
        features = {name: values[index].item() for name, values in self.features.items()}
        labels = {self.column: number, **life.labels, "people": people, **features}
        return Choice(labels, life.changes, self.draw.seed_of(number))

    @property
    def words(self) -> str:
        """The number of lives left out, and why, in words."""
        return left_out_words(self.column, self.left_out)


def find_lives(
    axis: PopulationAxis,
    column: str,
    base: Document,
    crew: Crew | None = None,
    on_progress: Callable[[int, int], None] = lambda *_: None,
) -> FleetLives:
    """Draw the lives of a population until there are as many as it asks for; build each home.

    Args:
        axis: The population.
        column: The column of the numbers of its lives.
        base: The scenario that all lives share.
        crew: Where homes are built; None: in this process.
        on_progress: Receives how many homes are built, of how many.

    Raises:
        ScenarioError: Homes can't be built, or hardly any life meets the conditions.
    """
    finder = LifeFinder(axis.draw, base, crew, on_progress)
    numbers = finder.find(axis.population, needs_facts=True)
    facts = [finder.facts_of(number) for number in numbers]
    features = {
        "rooms": np.array([each.rooms for each in facts], np.int32),
        BEDROOMS: np.array([each.bedrooms for each in facts], np.int32),
        AREA: np.array([each.area_m2 for each in facts], np.float64),
    }
    kept = np.array(numbers, np.int32)
    return FleetLives(column, axis.draw, kept, features, finder.left_out)


def first_life(axis: PopulationAxis, column: str) -> FleetLives:
    """Return the first life of a population, whose home isn't built yet."""
    number = np.zeros(1, np.int32)
    features = {"rooms": number, BEDROOMS: number, AREA: np.zeros(1)}
    return FleetLives(column, axis.draw, number, features)


class LifeFinder:
    """Finds lives that meet the conditions of their draw.

    Attributes:
        left_out: The number of lives left out, by the first condition that they don't meet.
    """

    def __init__(
        self,
        draw: Draw,
        base: Document,
        crew: Crew | None = None,
        on_progress: Callable[[int, int], None] = lambda *_: None,
    ) -> None:
        """Build the homes that aren't synthetic, as lives choose among them."""
        self.left_out = Counter[str]()
        self._draw = draw
        self._base = base
        self._crew = crew or Crew(SerialExecutor())
        self._on_progress = on_progress
        self._facts: dict[str, HomeFeatures] = {}
        self._unbuilt = set[str]()
        self._found: dict[int, HomeFeatures] = {}  # the facts of the homes of lives
        if draw.asks_homes:
            listed = draw.homes.listed
            changes = [draw.homes[place].changes for place in listed]
            self._build(changes, [f"home {draw.homes[place].words}" for place in listed])
            draw.facts = {p: self._facts[repr(c)] for p, c in zip(listed, changes, strict=True)}

    def facts_of(self, number: int) -> HomeFeatures:
        """Return the facts of the home of a life that was found."""
        return self._found[number]

    def find(self, count: int, *, needs_facts: bool) -> list[int]:
        """Return the numbers of the first lives that meet the conditions.

        Raises:
            ScenarioError: Homes can't be built, or hardly any life meets the conditions.
        """
        kept: list[int] = []
        drawn = 0
        while len(kept) < count:
            if drawn >= MAX_DRAWS * count:
                raise ScenarioError(
                    f"of {drawn:,} lives that were drawn {len(kept):,} meet the conditions, too few"
                    f" for {count:,}; {left_out_words('where', self.left_out)}"
                )
            lives = [self._draw.life(drawn + i) for i in range(count - len(kept))]
            drawn += len(lives)
            lives = [life for life in lives if not self._is_left_out(life, None)]
            if needs_facts:
                changes = [_home_changes(life) for life in lives]
                self._build(changes, [f"life {life.number} ({life.home.words})" for life in lives])
                homes = [self._facts.get(repr(change)) for change in changes]
                pairs = list(zip(lives, homes, strict=True))
                self._found |= {life.number: facts for life, facts in pairs if facts is not None}
                lives = [life for life, facts in pairs if not self._is_left_out(life, facts)]
            kept += [life.number for life in lives]
        return kept

    def _is_left_out(self, life: FleetLife, facts: HomeFeatures | None) -> bool:
        is_unbuilt = repr(_home_changes(life)) in self._unbuilt
        reason = NO_LAYOUT if is_unbuilt else self._draw.left_out(life, facts)
        if reason:
            self.left_out[reason] += 1
        return bool(reason)

    def _build(self, changes: Sequence[Any], names: Sequence[str]) -> None:
        """Build homes, unless they are known.

        Raises:
            ScenarioError: Some can't be built, other than by chance, or none can.
        """
        new = {repr(c): (c, name) for c, name in zip(changes, names, strict=True)}
        keys = [key for key in new if key not in self._facts and key not in self._unbuilt]
        tasks = [HomeTask(i, i, "", "", new[key][0]) for i, key in enumerate(keys)]
        homes = ((1, iter([task])) for task in tasks)
        crew = self._crew
        if len(keys) <= FEW_HOMES:
            crew = Crew(SerialExecutor(), plans=crew.plans)
        problems: dict[int, str] = {}
        by_chance = set[int]()
        done = 0
        with closing(run_tasks(crew, FactsJob(self._base), TaskQueue(homes))) as rounds:
            for ends in rounds:
                done += len(ends)
                self._on_progress(done, len(keys))
                for end in ends:
                    number = end.task.number
                    key = keys[number]
                    if isinstance(end.payload, HomeFeatures):
                        self._facts[key] = end.payload
                        continue
                    unbuilt = end.payload or UnbuiltHome(str(end.loss), by_chance=False)
                    problems[number] = f"{new[key][1]}: {unbuilt.reason}"
                    if unbuilt.by_chance:
                        by_chance.add(number)
        if self._facts:
            self._unbuilt |= {keys[number] for number in by_chance}
            problems = {n: text for n, text in problems.items() if n not in by_chance}
        raise_problems([problems[number] for number in sorted(problems)])


def left_out_words(name: str, left_out: Mapping[str, int]) -> str:
    """Return how many lives are left out, and why; empty if none is.

    >>> left_out_words("robot", {"rooms is not 3..9": 28})
    'robot: 28 left out: 28 (rooms is not 3..9)'
    """
    reasons = ", ".join(f"{count:,} ({reason})" for reason, count in left_out.items())
    return f"{name}: {sum(left_out.values()):,} left out: {reasons}" if left_out else ""


def _home_changes(life: FleetLife) -> tuple[tuple[tuple[str, ...], Any], ...]:
    """Return the changes of a life that its home depends on."""
    return tuple((keys, value) for keys, value in life.changes if keys[0] == "floorplan")


def raise_problems(problems: Sequence[str]) -> None:
    """Raise an error that lists problems; those that differ only in subject and numbers are one.

    Raises:
        ScenarioError: There are problems.
    """
    groups: dict[str, list[str]] = {}
    for text in problems:
        reason = text.partition("): ")[2] or text
        groups.setdefault(re.sub(r"\d+(\.\d+)?", "#", reason), []).append(text)
    lines = []
    for first, *others in itertools.islice(groups.values(), MAX_PROBLEMS):
        names = ", ".join(text.partition(" (")[0] for text in others[:MAX_NAMED])
        more = f"; {len(others)} more likewise: {names}" if others else ""
        lines.append(first + more + (", …" if len(others) > MAX_NAMED else ""))
    if len(groups) > MAX_PROBLEMS:
        lines.append(f"… these are the first {MAX_PROBLEMS} of {len(groups)} reasons")
    if lines:
        raise ScenarioError("\n".join(lines))
