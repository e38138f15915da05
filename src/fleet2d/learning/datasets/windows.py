"""Windows: evidence of a person up to a moment as features, and where the person was then."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import timedelta
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pyarrow as pa

from fleet2d.algorithms.evidence import steps_of_bin
from fleet2d.algorithms.presence.belief import ANYONE, AWAY
from fleet2d.algorithms.presence.estimator import natural_log
from fleet2d.algorithms.presence.learned import GAP, PlaceFacts, Weights
from fleet2d.bounds import ENTRIES, TABLE_BYTES
from fleet2d.errors import InputError
from fleet2d.kernels import (
    F64,
    I64,
    TRACE_FEATURES,
    Bool,
    TracedEvidence,
    trace_evidence,
    trace_size,
)
from fleet2d.learning.datasets.specification import BELIEF, EVIDENCE, STAYS, PlannedRun
from fleet2d.learning.datasets.tables import tables_of
from fleet2d.runtime.clock import DAY_MINUTES, DAY_US

if TYPE_CHECKING:
    from fleet2d.runs.run import Run

MIN_BELIEF = 1e-6
PRIOR = "routine"  # the model whose belief is corrected
FIRST_DAY = np.datetime64("0001-01-01", "D")
MICROSECOND = np.timedelta64(1, "us")


class Windows(NamedTuple):
    """Windows of one person in one run.

    Attributes:
        run: The number of the run.
        home: The name of its home.
        labels: Its household and varied values, such as "robot=hangout".
        user: The user.
        places: float64 (places, PLACE_FEATURES), the constant features of each place, away last.
        features: float32 (windows, places, TRACE_FEATURES), the evidence on each place.
        truth: int64 (windows,), the place where the user was; the last is away.
        step: int64 (windows,), the step of each window.
        day: int64 (windows,), its day, as `date.toordinal` counts.
        beliefs: The stored beliefs of models, by name: float64 (windows, places).
    """

    run: int
    home: str
    labels: tuple[str, ...]
    user: str
    places: F64
    features: Any
    truth: I64
    step: I64
    day: I64
    beliefs: Mapping[str, F64]

    @property
    def gap(self) -> F64:
        """Minutes since the newest sighting, at most 2,880, also for never: float64 (windows,)."""
        return np.expm1(self.features[:, -1, GAP].astype(np.float64)).round(1)

    def rows(self, own: Bool | slice) -> "Windows":
        """Return some of the windows: a mask, bool (windows,), or a slice."""
        return self._replace(
            features=self.features[own],
            truth=self.truth[own],
            step=self.step[own],
            day=self.day[own],
            beliefs={model: belief[own] for model, belief in self.beliefs.items()},
        )


def windows_of(tables: Mapping[str, pa.Table]) -> Iterator[Windows]:
    """Yield the windows of each person in the tables of a data set, in order of runs.

    There is a window for each stored belief of `routine` that has a label. Its features use
    evidence up to that step only.

    Raises:
        InputError: There are no beliefs of `routine`.
    """
    columns = {name: _by_run(table) for name, table in tables.items()}
    for number, run in columns["runs"].items():
        rooms = columns["rooms"][number]
        evidence = columns["evidence"].get(number)
        labelled = columns["labels"].get(number)
        beliefs = columns["beliefs"].get(number)
        if labelled is None or evidence is None:
            continue
        if beliefs is None or PRIOR not in beliefs["model"]:
            raise InputError(f"run {number} has no beliefs of {PRIOR}: list it under beliefs")
        names = rooms["room"].tolist()
        ENTRIES.check(len(names), f"the home of run {number}")
        xy = np.stack([rooms["x"], rooms["y"]], axis=1).tolist()
        facts = PlaceFacts.of(rooms["kind"].tolist(), rooms["area_m2"], xy)
        start = np.datetime64(run["start"][0], "us")
        dense = _Dense(evidence, labelled, beliefs, names, facts, start)
        labels = (run["household"][0], *filter(None, run["varied"][0].split("; ")))
        for user in run["users"][0]:
            yield dense.windows(number, run["home"][0], labels, user)


def windows_of_run(run: "Run") -> list[Windows]:
    """Return the windows of a run that stored its evidence, stays, and beliefs of `routine`.

    Raises:
        InputError: A table is missing; the message says what to add to the scenario.
    """
    lacking = [name for name in (EVIDENCE, STAYS, f"{BELIEF}{PRIOR}") if name not in run.tables]
    if lacking:
        raise InputError(
            f"the run has no table {lacking[0]!r}: run it with algorithms: {{{EVIDENCE}: {{type:"
            f" evidence_table}}, {BELIEF}{PRIOR}: {{type: real_time_presence, model: {PRIOR}}}}}"
            f" and metrics: {{{STAYS}: {{}}}}"
        )
    labels = {"home": "", "household": ""}
    planned = PlannedRun(0, "", labels, {"simulation": {"seed": run.manifest["seed"]}})
    return list(windows_of(tables_of(run, planned, timedelta(minutes=1))))


class _Dense:
    """The evidence of a run as arrays by bin and room, and the facts of its home."""

    def __init__(
        self,
        evidence: Mapping[str, Any],
        labels: Mapping[str, Any],
        beliefs: Mapping[str, Any],
        rooms: Sequence[str],
        facts: PlaceFacts,
        start: np.datetime64,
    ) -> None:
        self.labels = labels
        self.beliefs = beliefs
        self.facts = facts
        first_us = int((labels["time"][0] - start) / MICROSECOND)
        step_us = first_us // max(int(labels["step"][0]), 1)
        self.bin_steps = steps_of_bin(step_us)
        last = max(int(evidence["step"].max(initial=0)), int(labels["step"].max()))
        count = (last + 1) // self.bin_steps
        size = count * (len(rooms) + 1) * TRACE_FEATURES * np.float64().itemsize
        TABLE_BYTES.check(size, "the evidence of a run")
        self.rooms = {name: k for k, name in enumerate(rooms)}
        self.step = (np.arange(count) + 1) * self.bin_steps - 1
        bin_ = (evidence["step"] + 1) // self.bin_steps - 1
        room = np.array([self.rooms[name] for name in evidence["room"]], np.int64)
        self.watched = np.zeros((count, len(rooms)))
        self.watched[bin_, room] = evidence["watched"]
        self.seen: dict[str, F64] = {}
        for user in set(evidence["user"].tolist()):
            own = evidence["user"] == user
            self.seen[user] = np.zeros(self.watched.shape)
            self.seen[user][bin_[own], room[own]] = evidence["seen"][own]
        nobody = np.zeros(self.watched.shape)
        known = sum((seen for user, seen in self.seen.items() if user != ANYONE), nobody)
        self.unknown = (self.seen.get(ANYONE, nobody) > known).astype(np.uint8)
        midnight = start.astype("datetime64[D]")
        since_us = (start - midnight) / MICROSECOND
        time = int(since_us) + (self.step + 1 - self.bin_steps) * step_us
        # The clock may have been changed since the start.
        own = labels["user"] == labels["user"][0]
        steps = labels["step"][own].astype(np.int64)
        read_us = (labels["time"][own] - start).astype("m8[us]").astype(np.int64)
        shift_us = read_us - steps * step_us
        time += shift_us[np.searchsorted(steps, self.step).clip(0, len(steps) - 1)]
        ordinal = int((midnight - FIRST_DAY) / np.timedelta64(1, "D")) + 1
        self.day = ordinal + time // DAY_US
        self.minute = time // 60_000_000 % DAY_MINUTES

    def of(self, user: str) -> TracedEvidence:
        """Return the evidence of a user, with a belief that is filled in later."""
        bins, rooms = self.watched.shape
        seen = self.seen.get(user, np.zeros((bins, rooms))) / self.bin_steps
        belief = np.ones((bins, rooms + 1))
        return TracedEvidence(self.day, self.minute, self.watched, seen, self.unknown, belief)

    def windows(self, number: int, home: str, of_run: tuple[str, ...], user: str) -> Windows:
        """Return the windows of a user of the run."""
        labels = self.labels
        beliefs = self.beliefs
        rooms = self.facts.rooms
        own = labels["user"] == user
        place_of = {**self.rooms, AWAY: len(self.rooms)}
        truth = np.full(len(self.step), -1)
        bins = (labels["step"][own] + 1) // self.bin_steps - 1
        truth[bins] = [place_of[name] for name in labels["place"][own]]
        stored: dict[str, F64] = {}
        kept: I64 | None = None
        for model in dict.fromkeys(beliefs["model"].tolist()):
            rows = (beliefs["user"] == user) & (beliefs["model"] == model)
            belief = beliefs["probability"][rows].reshape(-1, len(place_of)).astype(np.float64)
            at = (beliefs["step"][rows][:: len(place_of)] + 1) // self.bin_steps - 1
            if kept is None:
                kept = at[truth[at] >= 0]
            stored[model] = belief[np.isin(at, kept)]
        assert kept is not None, "there are beliefs"
        traced = trace_evidence(np.zeros(trace_size(rooms)), rooms, self.of(user))
        features = traced[kept]
        features[..., -1] = natural_log(np.maximum(stored[PRIOR], MIN_BELIEF))
        return Windows(
            number,
            home,
            of_run,
            user,
            self.facts.features,
            features.astype(np.float32),
            truth[kept],
            self.step[kept],
            self.day[kept],
            stored,
        )


def _by_run(table: pa.Table) -> dict[int, dict[str, Any]]:
    """Return the columns of each run as arrays; runs are in order, and each in one piece."""
    run = table["run"].to_numpy()
    first = np.flatnonzero(np.diff(run, prepend=-1))
    columns = {name: _array(table[name]) for name in table.column_names if name != "run"}
    by_run = {}
    for begin, end in pairwise([*first.tolist(), len(run)]):
        by_run[int(run[begin])] = {name: values[begin:end] for name, values in columns.items()}
    return by_run


def _array(column: Any) -> Any:
    if pa.types.is_list(column.type):
        return np.array([*column.to_pylist(), None], object)[:-1]
    if pa.types.is_string(column.type):
        column = column.dictionary_encode()
    if not pa.types.is_dictionary(column.type):
        return column.to_numpy()
    whole = column.combine_chunks()
    names = np.array([*whole.dictionary.to_pylist(), None], object)  # the index -1 is null
    return names[whole.indices.fill_null(-1).to_numpy()]


def joined(parts: Iterable[Windows]) -> dict[int, list[Windows]]:
    """Return windows by their number of places."""
    groups: dict[int, list[Windows]] = {}
    for part in parts:
        if len(part.truth):
            groups.setdefault(len(part.places), []).append(part)
    return groups


def predict(weights: Weights, windows: Windows) -> F64:
    """Return the belief of a network in each window: float64 (windows, places), away last."""
    places = weights.of_places(windows.places)
    return weights.probabilities(places, windows.features.astype(np.float64))
