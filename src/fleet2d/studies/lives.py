"""Lives: homes with their own people, settings and seeds, each drawn by its number.

Lives are drawn one after the other, so a larger population begins with the same lives.
"""

import io
import math
import re
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from pydantic import Field

from fleet2d.bounds import FILE_BYTES, read_bytes
from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import did_you_mean, suggest
from fleet2d.configuration.units import InputPath
from fleet2d.errors import ScenarioError, errors_as, extra
from fleet2d.runtime.determinism import Draws, stream_key
from fleet2d.studies.axes import (
    AnyAxis,
    Axis,
    Choice,
    Label,
    SyntheticAxis,
    key_path,
)
from fleet2d.studies.conditions import Condition, Range, condition_words, fulfils, read_condition
from fleet2d.studies.households import bedrooms_needed, members_of, personas_of
from fleet2d.studies.lazy import LazySequence

if TYPE_CHECKING:
    import polars as pl

MAX_SEED = 1 << 31
# The distance between the seeds of two populations, larger than a population.
SEED_STEP = 1_000_003
FEATURES = ("people", "rooms", "bedrooms", "area_m2")
"""Columns of what a home and its household are."""
HOME = "home"
HOUSEHOLD = "household"
HAS = "has"
BEDROOMS = "bedrooms"
AREA = "area_m2"
FIT = "fit"
SIZE_UNITS = ((BEDROOMS, "bedrooms"), (AREA, "m2"))
# Bedrooms beyond those that a household needs, and of how many households in a hundred: in England
# and Wales in 2011, 26 % had as many as the bedroom standard asks for and 5 % fewer, counted as 0;
# 37 % had two or more, counted as 2 (Census 2011, and English Housing Survey 2010-11).
SPARE_BEDROOMS = ((0, 31), (1, 32), (2, 37))
# How many programs of homes are drawn to find one with a number of bedrooms.
MAX_PROGRAMS = 200


class HomeFeatures(NamedTuple):
    """The features of a home that conditions may ask for.

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
    """The homes, households and table from which lives are drawn.

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
        changes = list(self.home.changes)
        if self.household is not None:
            changes.append((("users",), members_of(self.household)))
        for choice in self.varied:
            changes += choice.changes
        changes += [(key_path(key), value) for key, value in self.row.items() if "." in key]
        return tuple(changes)

    @property
    def labels(self) -> dict[str, Label]:
        """The labels drawn for it: home, household, and columns of `vary` and of the table."""
        (home,) = self.home.labels.values()
        people = None if self.household is None else " + ".join(personas_of(self.household))
        labels: dict[str, Label] = {HOME: home, HOUSEHOLD: people}
        for choice in self.varied:
            labels |= choice.labels
        return labels | {k: v for k, v in self.row.items() if k not in (*labels, *FEATURES)}


class HomeList(LazySequence[Choice]):
    """The homes of axes, one after the other; those of synthetic axes are made when needed."""

    def __init__(self, axes: Sequence[Axis]) -> None:
        """List the homes of folders and lists."""
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

    def item(self, index: int) -> Choice:
        """Return a home."""
        if not 0 <= index < len(self):
            raise IndexError(index)
        number = bisect_right(self._ends, index)
        part = self._parts[number]
        place = index - ([0, *self._ends][number])
        return (
            part.choice(HOME, part.seeds[place]) if isinstance(part, SyntheticAxis) else part[place]
        )


class Draw:
    """Draws lives, each by its number alone.

    Attributes:
        homes: The homes.
        facts: Facts of homes that aren't synthetic, by their places; a life whose row or household
            asks for bedrooms gets one that fits.
        table_columns: The columns of the table, without the weights.
        columns: The columns of labels beside home, household and features.
    """

    def __init__(
        self, settings: DrawSettings, vary: Mapping[str, Axis], seed: int, path: str
    ) -> None:
        """Read the table, and list the homes.

        Args:
            settings: The sources of lives.
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
        self._rows, self._ends, self._columns = _read_table(settings)
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

    @property
    def table_households(self) -> list[Any]:
        """The households that the table names."""
        named = dict.fromkeys(row.get(HOUSEHOLD) for row in self._rows)
        return [_members(household) for household in named if household]

    @property
    def files(self) -> list[Path]:
        """The table, and the files that it names, such as logs."""
        table = self._settings.table
        if table is None:
            return []
        named = {str(v) for row in self._rows for key, v in row.items() if "." in key}
        return [table, *filter(_is_file, map(Path, sorted(named)))]

    @property
    def notes(self) -> list[str]:
        """Remarks on columns of the table that only label lives, but may be misspelt features."""
        meant = [
            column
            for column in (HOME, HOUSEHOLD, *FEATURES, self._settings.weight)
            if column not in self._columns
        ]
        hints = {c: did_you_mean(c, meant) for c in self.table_columns if c in self.columns}
        return [
            f"{self._settings.table}: the column {column!r} only labels lives{hint}"
            for column, hint in hints.items()
            if hint != "." and "." not in column
        ]

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
        settings = self._settings
        asked = {*settings.where, *self.table_columns}
        has_households = bool(settings.households) or HOUSEHOLD in self.table_columns
        return not asked.isdisjoint((*FEATURES, HAS)) or (settings.fits and has_households)

    def seed_of(self, number: int) -> int:
        """Return the seed of a life."""
        return (self._seed * SEED_STEP + number) % MAX_SEED

    def share_of(self, number: int) -> float:
        """Return a life's random number from 0 to 1, by which it joins a rollout."""
        key = stream_key(self._seed, "population", "rollout")
        return Draws(np.uint64(key), number).uniform()

    def life(self, number: int) -> FleetLife:
        """Draw a life; homes are taken in turn unless its row or household asks for another."""
        draws = Draws(np.uint64(self._key), number)
        place = -1
        row: Mapping[str, Any] = {}
        if self._rows:
            place = bisect_right(self._ends, draws.uniform() * self._ends[-1])
            row = self._rows[place]
        household: Any = None
        if row.get(HOUSEHOLD):
            household = _members(row[HOUSEHOLD])
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
        return FleetLife(number, _sized_home(home, row, needed, of_home), household, varied, row)

    def _fitting(self, row: int, needed: int) -> list[int]:
        """Return the places of homes that a row of the table and a household can have.

        Raises:
            ScenarioError: There is none.
        """
        key = row, needed
        if key not in self._eligible:
            listed = self._rows[row].items() if row >= 0 else ()
            asked = {column: value for column, value in listed if column in FEATURES}
            places = range(len(self.homes))
            self._eligible[key] = [p for p in places if self._may_fit(p, needed, asked)]
            if not self._eligible[key]:
                words = ", ".join(f"{column} {value}" for column, value in asked.items())
                words = words or f"{needed} bedrooms, as a household needs"
                where = f"{self._settings.table}, row {row + 1}: " if asked else ""
                raise ScenarioError(f"{where}no home has {words}")
        return self._eligible[key]

    def _may_fit(self, place: int, needed: int, asked: Mapping[str, Any]) -> bool:
        """Return whether a home may have the bedrooms needed and the features asked for."""
        facts = self.facts.get(place)
        if facts is None:
            return True
        are_like = (_meets_row(name, getattr(facts, name), value) for name, value in asked.items())
        return facts.bedrooms >= needed and all(are_like)

    def left_out(self, life: FleetLife, facts: HomeFeatures | None) -> str:
        """Return the condition that a life doesn't meet, empty if it meets all.

        Args:
            life: The life.
            facts: The features of its home; None: conditions on homes aren't checked.
        """
        labels = life.labels | ({} if facts is None else feature_labels(life.household, facts))
        for column, condition in self._settings.where.items():
            if facts is not None and column == HAS:
                kinds = condition if isinstance(condition, tuple) else (condition,)
                if lacking := [kind for kind in kinds if kind not in facts.kinds]:
                    return f"no {lacking[0]}"
            elif column in labels and condition != FIT and not fulfils(labels[column], condition):
                return f"{column} is not {condition_words(condition)}"
        # The program of a synthetic home has the bedrooms and the area of its row, and no more.
        for column in ("people", "rooms"):
            condition = read_condition(life.row.get(column))
            is_asked = condition is not None and labels.get(column) is not None
            if is_asked and not fulfils(labels[column], condition):
                return f"{column} is not {condition_words(condition)}, as their rows say"
        return ""


def _members(household: object) -> list[str]:
    """Return the personas of a household as tables write it, such as "retired + child"."""
    return [name.strip() for name in str(household).split("+")]


def _meets_row(column: str, fact: Any, asked: Any) -> bool:
    """Return whether a home is as a row of the table asks; no home has exactly a single area."""
    condition = read_condition(asked)
    is_area = column == AREA and not isinstance(condition, Range)
    return asked is None or is_area or fulfils(fact, condition)


def _sized_home(home: Choice, row: Mapping[str, Any], needed: int, draws: Draws) -> Choice:
    """Return a synthetic home with the bedrooms and area of its row, or fit for its household."""
    if not home.changes:
        return home
    (keys, plan), *others = home.changes
    if keys != ("floorplan",) or plan.get("type") != "synthetic":
        return home
    new: dict[str, Any] = {}
    for key in (BEDROOMS, AREA):
        if row.get(key) is not None:
            value = _drawn_number(read_condition(row[key]), draws)
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
    return Choice({HOME: f"{label} ({size})"}, changes)  # the seed has homes of other sizes, too


def _drawn_number(condition: Any, draws: Draws) -> float:
    """Draw a number from a range; return a single number as it is."""
    if not isinstance(condition, Range):
        return float(condition)
    if condition.low.is_integer() and condition.high.is_integer():
        return condition.low + draws.below(int(condition.high - condition.low) + 1)
    return condition.low + draws.uniform() * (condition.high - condition.low)


def _program(bedrooms: int, plan: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """Return settings of a synthetic home: its bedrooms, and an area usual for so many."""
    from fleet2d.homes.synthetic.program import (
        MAX_ROOMS_PER_TYPE,
        Choices,
        Style,
        Wishes,
        settle_wishes,
    )

    beds = min(bedrooms, MAX_ROOMS_PER_TYPE)
    wishes = Wishes(bathrooms=plan.get("bathrooms"), garage=plan.get("garage"))
    for number in range(MAX_PROGRAMS):
        settled = settle_wishes(wishes, Choices(seed, f"program {number}"), Style())
        if settled.bedrooms == beds:
            return {BEDROOMS: beds, AREA: settled.area_m2}
    return {BEDROOMS: beds}


def _read_table(settings: DrawSettings) -> tuple[list[dict[str, Any]], list[float], list[str]]:
    """Return the rows of a table without their weights, the running sums of these, and the columns.

    Raises:
        InputError: The table can't be read, lacks a column, or has impossible weights.
    """
    if settings.table is None:
        return [], [], []
    path = settings.table
    frame = _frame_of(path)
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
            if isinstance(value, str) and "." in key and _is_file(file := path.parent / value):
                row[key] = str(file.absolute())  # the file of a log
    return rows, ends, frame.columns


def _frame_of(path: Path) -> "pl.DataFrame":
    """Return a table as a data frame; CSV may have the separators of any language."""
    with extra("study", "tables of a population need polars"):
        import polars as pl
    content = read_bytes(path, FILE_BYTES)
    with errors_as(ScenarioError, str(path), of=pl.exceptions.PolarsError):
        if path.suffix == ".parquet":
            return pl.read_parquet(io.BytesIO(content))
        head, _, body = content.partition(b"\n")
        separator = max(",;\t", key=lambda mark: head.count(mark.encode()))
        has_comma = separator != "," and re.search(rb"\d,\d", body) is not None
        return pl.read_csv(io.BytesIO(content), separator=separator, decimal_comma=has_comma)


def _is_file(path: Path) -> bool:
    """Return whether a path is that of a file; a text too long for a name isn't."""
    try:
        return path.is_file()
    except OSError:
        return False


def feature_labels(household: Any, facts: HomeFeatures) -> dict[str, Label]:
    """Return the labels of the features of a life."""
    people = None if household is None else len(members_of(household))
    return {
        "people": people,
        "rooms": facts.rooms,
        BEDROOMS: facts.bedrooms,
        AREA: facts.area_m2,
    }
