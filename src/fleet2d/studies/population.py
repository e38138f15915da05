"""Populations: homes, their people and robots, drawn together, for studies and data sets.

A *life* is one home with its own people, settings and seed. Lives are drawn one after the other, so
a larger population begins with the same lives.
"""

import io
import itertools
import math
import re
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate
from typing import Annotated, Any, ClassVar, NamedTuple, overload

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter

from fleet2d.bounds import FILE_BYTES, read_bytes
from fleet2d.configuration.components import OneOf, Settings
from fleet2d.configuration.documents import Document
from fleet2d.configuration.problems import problem, suggest
from fleet2d.configuration.units import InputPath
from fleet2d.errors import Fleet2DError, InputError, ScenarioError, errors_as, extra
from fleet2d.floorplan.source import FloorPlanSource
from fleet2d.runtime.determinism import Draws, stream_key
from fleet2d.scenario.compose import apply_changes, assignment
from fleet2d.studies.axes import (
    KINDS,
    AnyAxis,
    Axis,
    Choice,
    Count,
    Label,
    SyntheticAxis,
    axis_of,
    key_path,
)
from fleet2d.studies.executors import Crew, SerialExecutor, TaskQueue, WorkerTask, run_tasks

NAMES = ("ana", "ben", "cleo", "dan", "eva", "finn", "gina", "hugo")
MAX_SEED = 1 << 31
SEED_STEP = 1_000_003  # between the seeds of two populations, larger than a population
FEATURES = ("people", "rooms", "bedrooms", "area_m2")
"""Columns of what a home and its household are."""
HOME, HOUSEHOLD, HAS, BEDROOMS, AREA = "home", "household", "has", "bedrooms", "area_m2"
FIT = "fit"
SIZE_UNITS = ((BEDROOMS, "bedrooms"), (AREA, "m2"))
# Bedrooms beyond those that a household needs, and of how many households in a hundred: in England
# and Wales in 2011, 26 % had as many as the bedroom standard asks for and 5 % fewer, counted as 0;
# 37 % had two or more, counted as 2 (Census 2011, and English Housing Survey 2010-11).
SPARE_BEDROOMS = ((0, 31), (1, 32), (2, 37))
MAX_PROGRAMS = 200  # programs of homes that are drawn for a number of bedrooms
CHILD = "child"  # the persona of those of whom two share a bedroom
MAX_DRAWS = 20  # lives that are drawn for each that is kept, before conditions are too narrow
FEW_HOMES = 8  # up to here starting workers costs more than it saves
MAX_PROBLEMS = 10  # reasons in one report
MAX_NAMED = 5  # lives or variants that are named beside the first one of a reason


class Range(NamedTuple):
    """Numbers from `low` to `high`."""

    low: float
    high: float

    def __str__(self) -> str:
        """Return it as conditions write it."""
        low, high = (f"{end:g}" if math.isfinite(end) else "" for end in self)
        return f"{low}..{high}"


def _condition(value: Any) -> Any:
    """Read `3..15` as a range; numbers, texts and lists stay what they are."""
    if isinstance(value, list | tuple) and not isinstance(value, Range):
        return tuple(value)
    if not isinstance(value, str) or ".." not in value:
        return value
    try:
        low, high = (float(text or end) for text, end in zip(value.split(".."), ENDS, strict=True))
    except ValueError:
        raise problem(f"expected a range like 3..15, 3.. or ..15, got {value!r}") from None
    if not low <= high:
        raise problem(f"the range {value} is empty: the smaller number comes first")
    return Range(low, high)


ENDS = ("-inf", "inf")
Condition = Annotated[Any, BeforeValidator(_condition)]
"""A value that a feature must have, one of a list, or a range like 3..15."""


def fulfils(value: Any, condition: Any) -> bool:
    """Return whether a value meets a condition.

    >>> fulfils(4, Range(3, 15)), fulfils("north", ("north", "west")), fulfils(None, 3)
    (True, True, False)
    """
    if isinstance(condition, Range):
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        return is_number and condition.low <= value <= condition.high
    if isinstance(condition, tuple):
        return any(fulfils(value, each) for each in condition)
    return bool(value == condition)


class HomeFeatures(NamedTuple):
    """What conditions ask of a home.

    Attributes:
        rooms: The number of its rooms.
        bedrooms: The number of its bedrooms.
        area_m2: Its free floor.
        kinds: The types of its rooms.
    """

    rooms: int
    bedrooms: int
    area_m2: float
    kinds: frozenset[str]


class DrawSettings(Settings):
    """What lives are drawn from.

    Attributes:
        homes: Homes, as axes of a study have them: {synthetic: 40, first: 100}, {floorplans: …}.
        households: Households: a list of the personas of their members, or of users by name; left
            out: the users of the base.
        table: A CSV or Parquet file; each life has a row of it. Its columns are `home` (the label
            of one), `household` (as works_outside + child), features of a home (bedrooms, rooms,
            area_m2: a number or a range like 50..80), key paths like robots.astro.speed, and
            others, which only label a life.
        weight: The column of the table with the weights of its rows; all are equal if it has no
            column `weight`.
        where: Conditions on home, household, people, rooms, bedrooms, area_m2, has (types of
            rooms), and columns of the table: a value, a list, a range like 3..15. `bedrooms: fit`:
            enough for the household.
    """

    homes: tuple[AnyAxis, ...] = Field(min_length=1)
    households: tuple[tuple[Any, ...] | dict[str, Any], ...] = ()
    table: InputPath | None = None
    weight: str = "weight"
    where: dict[str, Condition] = Field(default={})

    @property
    def fits(self) -> bool:
        """Whether homes must have the bedrooms that their households need."""
        return self.where.get(BEDROOMS) == FIT


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
        """What its lives are drawn from.

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
        """Return all lives, found in this process."""
        raise ScenarioError("a population can't be drawn within another axis, or as one of `vary`")


def _study_axis(value: Any) -> Any:
    return axis_of(value, {**KINDS, "population": PopulationAxis})


StudyAxis = Annotated[Axis, BeforeValidator(_study_axis)]
"""A field that takes an axis of any kind, also a population."""


@dataclass(frozen=True)
class FleetLife:
    """A home with its people and settings.

    Attributes:
        number: Its number, from 0 on.
        home: Its home.
        household: Its people, as the settings list them; None: those of the base.
        varied: The values of `vary`.
        row: Its row of the table.
    """

    number: int
    home: Choice
    household: Any
    varied: tuple[Choice, ...]
    row: Mapping[str, Any]

    @property
    def changes(self) -> tuple[tuple[tuple[str, ...], Any], ...]:
        """The (key path, value) pairs that it sets in the scenario."""
        people = () if self.household is None else ((("users",), members_of(self.household)),)
        own = tuple((key_path(key), value) for key, value in self.row.items() if "." in key)
        return (*self.home.changes, *people, *(c for v in self.varied for c in v.changes), *own)

    @property
    def labels(self) -> dict[str, Label]:
        """What was drawn for it: home, household, and columns of `vary` and of the table."""
        (home,) = self.home.labels.values()
        people = None if self.household is None else " + ".join(personas_of(self.household))
        labels: dict[str, Label] = {HOME: home, HOUSEHOLD: people}
        for choice in self.varied:
            labels |= choice.labels
        return labels | {k: v for k, v in self.row.items() if k not in (*labels, *FEATURES)}


class HomeList(Sequence[Choice]):
    """The homes of axes, one after the other; those of synthetic axes are made when needed."""

    def __init__(self, axes: Sequence[Axis]) -> None:
        """Read what folders and lists hold."""
        self._parts: list[SyntheticAxis | list[Choice]] = [
            axis if isinstance(axis, SyntheticAxis) else axis.choices(HOME) for axis in axes
        ]
        counts = (len(p.seeds if isinstance(p, SyntheticAxis) else p) for p in self._parts)
        self._ends = list(accumulate(counts))

    def __len__(self) -> int:
        """Return the number of homes."""
        return self._ends[-1]

    @property
    def listed(self) -> list[int]:
        """The places of the homes that aren't synthetic: no settings make them fit a household."""
        starts = [0, *self._ends]
        return [
            place
            for part, start in zip(self._parts, starts, strict=False)
            if not isinstance(part, SyntheticAxis)
            for place in range(start, start + len(part))
        ]

    @overload
    def __getitem__(self, index: int) -> Choice: ...
    @overload
    def __getitem__(self, index: slice) -> list[Choice]: ...
    def __getitem__(self, index: int | slice) -> Choice | list[Choice]:
        """Return a home."""
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        if not 0 <= index < len(self):
            raise IndexError(index)
        number = bisect_right(self._ends, index)
        part = self._parts[number]
        place = index - ([0, *self._ends][number])
        return (
            part.choice(HOME, part.seeds[place]) if isinstance(part, SyntheticAxis) else part[place]
        )


class Draw:
    """Draws lives, each by its number, whatever was drawn before.

    Attributes:
        homes: The homes.
        facts: Facts of homes that aren't synthetic, by their places; a life whose row or household
            asks for bedrooms has one of those that fit.
        table_columns: The columns of the table, without the weights.
        columns: The columns of labels beside home, household and features.
    """

    def __init__(
        self, settings: DrawSettings, vary: Mapping[str, Axis], seed: int, path: str
    ) -> None:
        """Read the table, and list the homes.

        Args:
            settings: What lives are drawn from.
            vary: Axes of which each life has one value.
            seed: The seed of all draws.
            path: The name of their random stream.

        Raises:
            InputError: The table can't be read, or is wrong, or there are no homes.
        """
        self._settings = settings
        self._seed = seed
        self._key = int(stream_key(seed, path, "run"))
        self._home_key = int(stream_key(seed, path, HOME))
        self.homes = HomeList(settings.homes)
        self.facts: dict[int, HomeFeatures] = {}
        self._eligible: dict[tuple[int, int], list[int]] = {}
        self._varied = {name: axis.choices(name) for name, axis in vary.items()}
        self._rows, self._ends = _read_table(settings)
        self.table_columns = tuple(self._rows[0]) if self._rows else ()
        varied = [column for name, axis in vary.items() for column in axis.columns(name)]
        own = [c for c in self.table_columns if c not in (HOME, HOUSEHOLD, *FEATURES)]
        self.columns = (*varied, *own)
        known = (HOME, HOUSEHOLD, HAS, *FEATURES, *self.columns)
        for column in settings.where:
            if column not in known:
                hint = suggest(column, known, "There are")
                raise ScenarioError(f"where: lives have no {column!r}{hint}")
        self._places = self._places_of_rows()

    def _places_of_rows(self) -> dict[str, int]:
        """Return the place of each home that the table names, by its label.

        Raises:
            ScenarioError: There is no such home.
        """
        if HOME not in self.table_columns:
            return {}
        places = {str(next(iter(c.labels.values()))): i for i, c in enumerate(self.homes)}
        for number, row in enumerate(self._rows, 1):
            label = str(row[HOME])
            if label not in places:
                hint = suggest(label, sorted(places))
                table = self._settings.table
                raise ScenarioError(f"{table}, row {number}: there is no home {label!r}{hint}")
        return places

    @property
    def asks_homes(self) -> bool:
        """Whether the facts of homes matter for what is drawn."""
        return bool({*self._settings.where, *self.table_columns} & {*FEATURES, HAS}) or (
            self._settings.fits
            and (bool(self._settings.households) or HOUSEHOLD in self.table_columns)
        )

    def seed_of(self, number: int) -> int:
        """Return the seed of a life."""
        return (self._seed * SEED_STEP + number) % MAX_SEED

    def share_of(self, number: int) -> float:
        """Return a random number from 0 to 1 of a life, by which it joins a rollout."""
        key = stream_key(self._seed, "population", "rollout")
        return Draws(np.uint64(key), number).uniform()

    def life(self, number: int) -> FleetLife:
        """Draw a life; without a reason for another one, homes are taken in turn."""
        draws = Draws(np.uint64(self._key), number)
        place = -1
        row: Mapping[str, Any] = {}
        if self._rows:
            place = bisect_right(self._ends, draws.uniform() * self._ends[-1])
            row = self._rows[place]
        household: Any = None
        if row.get(HOUSEHOLD):
            household = [name.strip() for name in str(row[HOUSEHOLD]).split("+")]
        elif self._settings.households:
            household = draws.choice(self._settings.households)
        varied = tuple(draws.choice(choices) for choices in self._varied.values())
        needed = 0
        if self._settings.fits and household is not None and BEDROOMS not in row:
            needed = bedrooms_needed(household)
        of_home = Draws(np.uint64(self._home_key), number)
        if HOME in row:
            home = self.homes[self._places[str(row[HOME])]]
        elif self.facts and (needed or {*row} & {*FEATURES}):
            home = self.homes[of_home.choice(self._fitting(place, needed))]
        else:
            home = self.homes[number % len(self.homes)]
        return FleetLife(number, _settled(home, row, needed, of_home), household, varied, row)

    def _fitting(self, row: int, needed: int) -> list[int]:
        """Return the places of homes that a row of the table and a household can have.

        Raises:
            ScenarioError: There is none.
        """
        key = row, needed
        if key not in self._eligible:
            asked = {c: v for c, v in self._rows[row].items() if c in FEATURES} if row >= 0 else {}
            self._eligible[key] = [
                place
                for place in range(len(self.homes))
                if place not in self.facts
                or (
                    self.facts[place].bedrooms >= needed
                    and all(_is_like(c, getattr(self.facts[place], c), v) for c, v in asked.items())
                )
            ]
            if not self._eligible[key]:
                words = ", ".join(f"{column} {value}" for column, value in asked.items())
                words = words or f"{needed} bedrooms, as a household needs"
                where = f"{self._settings.table}, row {row + 1}: " if asked else ""
                raise ScenarioError(f"{where}no home has {words}")
        return self._eligible[key]

    def left_out(self, life: FleetLife, facts: HomeFeatures | None) -> str:
        """Return the condition that a life doesn't meet, empty if it meets all.

        Args:
            life: The life.
            facts: Those of its home; None: conditions on homes aren't asked.
        """
        labels = life.labels | ({} if facts is None else feature_labels(life.household, facts))
        for column, condition in self._settings.where.items():
            if facts is not None and column == HAS:
                kinds = condition if isinstance(condition, tuple) else (condition,)
                if lacking := [kind for kind in kinds if kind not in facts.kinds]:
                    return f"no {lacking[0]}"
            elif column in labels and condition != FIT and not fulfils(labels[column], condition):
                return f"{column} is not {_words(condition)}"
        return ""


def _is_like(column: str, fact: Any, asked: Any) -> bool:
    """Return whether a home is as a row of the table says; a single area is rounded too finely."""
    condition = _condition(asked)
    is_area = column == AREA and not isinstance(condition, Range)
    return asked is None or is_area or fulfils(fact, condition)


def _settled(home: Choice, row: Mapping[str, Any], needed: int, draws: Draws) -> Choice:
    """Return a synthetic home with the bedrooms and the area of its row, or for its household."""
    if not home.changes:
        return home
    (keys, plan), *others = home.changes
    if keys != ("floorplan",) or plan.get("type") != "synthetic":
        return home
    new: dict[str, Any] = {}
    for key in (BEDROOMS, AREA):
        if row.get(key) is not None:
            value = _within(_condition(row[key]), draws)
            new[key] = int(value) if key == BEDROOMS else round(value, 1)
    if needed and not {BEDROOMS, AREA} & {*plan, *new}:
        weights = [weight for _, weight in SPARE_BEDROOMS]
        spare = bisect_right(list(accumulate(weights)), draws.below(sum(weights)))
        new = _program(needed + SPARE_BEDROOMS[spare][0], plan, draws.below(MAX_SEED - 1))
    if not new:
        return home
    (label,) = home.labels.values()
    size = ", ".join(f"{new[key]:g} {unit}" for key, unit in SIZE_UNITS if key in new)
    changes = ((keys, {**plan, **new}), *others)
    return Choice({HOME: f"{label} ({size})"}, changes)  # another home of that seed is another one


def _within(condition: Any, draws: Draws) -> float:
    """Draw a number of a range; a number is itself."""
    if not isinstance(condition, Range):
        return float(condition)
    if condition.low.is_integer() and condition.high.is_integer():
        return condition.low + draws.below(int(condition.high - condition.low) + 1)
    return condition.low + draws.uniform() * (condition.high - condition.low)


def _program(bedrooms: int, plan: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """Return the bedrooms of a synthetic home, and an area that homes of so many have."""
    from fleet2d.homes.synthetic.program import (
        MAX_ROOMS_PER_TYPE,
        Choices,
        Style,
        Wishes,
        settle_wishes,
    )

    beds = min(bedrooms, MAX_ROOMS_PER_TYPE)
    style = Style(edition=plan.get("edition", 1))
    wishes = Wishes(bathrooms=plan.get("bathrooms"), garage=plan.get("garage"))
    for number in range(MAX_PROGRAMS):
        settled = settle_wishes(wishes, Choices(seed, f"program {number}"), style)
        if settled.bedrooms == beds:
            return {BEDROOMS: beds, AREA: settled.area_m2}
    return {BEDROOMS: beds}


def _words(condition: Any) -> str:
    if isinstance(condition, tuple) and not isinstance(condition, Range):
        return " or ".join(map(str, condition))
    return str(condition)


def _read_table(settings: DrawSettings) -> tuple[list[dict[str, Any]], list[float]]:
    """Return the rows of a table without their weights, and the running sums of these.

    Raises:
        InputError: It can't be read, has no such column, or weights that can't be.
    """
    if settings.table is None:
        return [], []
    with extra("study", "tables of a population need polars"):
        import polars as pl
    path = settings.table
    content = io.BytesIO(read_bytes(path, FILE_BYTES))
    read = pl.read_parquet if path.suffix == ".parquet" else pl.read_csv
    with errors_as(ScenarioError, str(path), of=pl.exceptions.PolarsError):
        frame = read(content)
    weight = settings.weight
    if weight not in frame.columns and "weight" in settings.model_fields_set:
        raise ScenarioError(f"{path} has no column {weight!r}{suggest(weight, frame.columns)}")
    if not len(frame):
        raise ScenarioError(f"{path} has no rows")
    rows = frame.drop(weight, strict=False).to_dicts()
    weights = frame[weight].to_list() if weight in frame.columns else [1.0] * len(rows)
    for number, value in enumerate(weights, 1):
        is_number = isinstance(value, int | float) and math.isfinite(value)
        if not is_number or value < 0:
            raise ScenarioError(
                f"{path}, row {number}: the {weight} is {value!r}: expected 0 or a positive number"
            )
    ends = list(accumulate(map(float, weights)))
    if not 0 < ends[-1] < math.inf:
        raise ScenarioError(
            f"{path}: the {weight} of all rows is {ends[-1]:g}: no row can be drawn"
        )
    for row in rows:
        for key, value in row.items():
            if isinstance(value, str) and "." in key and (path.parent / value).is_file():
                row[key] = str((path.parent / value).absolute())  # such as a log
    return rows, ends


def members_of(household: Any) -> dict[str, Any]:
    """Return the section `users` of a household: a list of personas, or users by name.

    Example:
        >>> members_of(["retired"])
        {'ana': {'type': 'routine', 'persona': 'retired'}}
    """
    if isinstance(household, Mapping):
        return dict(household)
    if len(household) > len(NAMES):
        raise InputError(
            f"a household of {len(household)} personas: name its users, as in {{ana: …}}, where"
            f" there are more than {len(NAMES)}"
        )
    pairs = zip(NAMES, household, strict=False)
    return {name: {"type": "routine", "persona": persona} for name, persona in pairs}


def personas_of(household: Any) -> list[str]:
    """Return what tells the people of a household: their personas, logs, or types."""
    return [_persona_of(name, user) for name, user in members_of(household).items()]


def _persona_of(name: str, user: Any) -> str:
    if not isinstance(user, Mapping):
        return str(user)
    members = (user.get("household") or {}).get("members") or {}
    persona = user.get("persona") or members.get(name) or user.get("path") or user.get("type")
    extended = persona.get("extends") if isinstance(persona, Mapping) else None
    return str(extended or persona)


def bedrooms_needed(household: Any) -> int:
    """Return how many bedrooms a household needs: one per couple, other adult, and two children.

    >>> bedrooms_needed(["works_outside", "child", "child"])
    2
    """
    people = members_of(household)
    couples: set[frozenset[str]] = set()
    for user in people.values():
        if isinstance(user, Mapping):
            pairs = (user.get("household") or {}).get("couples") or ()
            couples |= {frozenset(pair) for pair in pairs if {*pair} <= people.keys()}
    children = personas_of(household).count(CHILD)
    return max(len(people) - children - len(couples) + math.ceil(children / 2), 1)


def feature_labels(household: Any, facts: HomeFeatures) -> dict[str, Label]:
    """Return the labels of the features of a life."""
    people = None if household is None else len(members_of(household))
    return {
        "people": people,
        "rooms": facts.rooms,
        BEDROOMS: facts.bedrooms,
        AREA: facts.area_m2,
    }


@dataclass(frozen=True)
class FactsJob:
    """Builds homes in workers, and returns facts of them.

    Attributes:
        base: The scenario that all lives share.
    """

    base: Document

    def __call__(self, task: "HomeTask") -> HomeFeatures | str:
        """Return the facts of a home, or why it can't be built."""
        try:
            return facts_of(self.base, task.changes)
        except Fleet2DError as error:
            return str(error)


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
class FleetLives(Sequence[Choice]):
    """The lives of a population that meet its conditions, each drawn again when it is needed.

    Attributes:
        column: The column of their numbers.
        draw: What they are drawn from.
        numbers: The numbers of those that are kept: int32 (lives,).
        features: What their homes are, by column.
        left_out: How many others were drawn, by the first condition that they don't meet.
    """

    column: str
    draw: Draw
    numbers: Any
    features: Mapping[str, Any]
    left_out: Mapping[str, int] = field(default_factory=dict)

    def __len__(self) -> int:
        """Return their number."""
        return len(self.numbers)

    @overload
    def __getitem__(self, index: int) -> Choice: ...
    @overload
    def __getitem__(self, index: slice) -> list[Choice]: ...
    def __getitem__(self, index: int | slice) -> Choice | list[Choice]:
        """Return a life."""
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        number = int(self.numbers[index])
        life = self.draw.life(number)
        people = None if life.household is None else len(members_of(life.household))
        features = {name: values[index].item() for name, values in self.features.items()}
        labels = {self.column: number, **life.labels, "people": people, **features}
        return Choice(labels, life.changes, self.draw.seed_of(number))

    @property
    def words(self) -> str:
        """How many are left out, and why."""
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
    features = {"rooms": np.zeros(1, np.int32), BEDROOMS: np.zeros(1, np.int32)}
    return FleetLives(column, axis.draw, np.zeros(1, np.int32), {**features, AREA: np.zeros(1)})


class LifeFinder:
    """Finds lives that meet the conditions of what they are drawn from.

    Attributes:
        left_out: How many don't, by the first condition that they don't meet.
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
        if draw.asks_homes:
            listed = draw.homes.listed
            changes = [draw.homes[place].changes for place in listed]
            self._build(changes, [f"home {draw.homes[place].words}" for place in listed])
            draw.facts = {p: self._facts[repr(c)] for p, c in zip(listed, changes, strict=True)}

    def facts_of(self, number: int) -> HomeFeatures:
        """Return the facts of the home of a life that was found."""
        return self._facts[repr(_home_changes(self._draw.life(number)))]

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
            for life in lives:
                facts = self._facts[repr(_home_changes(life))] if needs_facts else None
                if facts is None or not self._is_left_out(life, facts):
                    kept.append(life.number)
        return kept

    def _is_left_out(self, life: FleetLife, facts: HomeFeatures | None) -> bool:
        reason = self._draw.left_out(life, facts)
        if reason:
            self.left_out[reason] += 1
        return bool(reason)

    def _build(self, changes: Sequence[Any], names: Sequence[str]) -> None:
        """Build homes, unless they are known.

        Raises:
            ScenarioError: Some can't be built.
        """
        new = {repr(c): (c, name) for c, name in zip(changes, names, strict=True)}
        keys = [key for key in new if key not in self._facts]
        tasks = ((1, iter([HomeTask(i, i, "", "", new[k][0])])) for i, k in enumerate(keys))
        crew = (
            self._crew if len(keys) > FEW_HOMES else Crew(SerialExecutor(), plans=self._crew.plans)
        )
        problems: dict[int, str] = {}
        done = 0
        with closing(run_tasks(crew, FactsJob(self._base), TaskQueue(tasks))) as rounds:
            for ends in rounds:
                done += len(ends)
                self._on_progress(done, len(keys))
                for end in ends:
                    key = keys[end.task.number]
                    if isinstance(end.payload, HomeFeatures):
                        self._facts[key] = end.payload
                    else:
                        problems[end.task.number] = f"{new[key][1]}: {end.loss or end.payload}"
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
    """Raise an error about problems; those that differ by their subject and numbers are one.

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
