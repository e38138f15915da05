"""Words for learned values: numbers in the outputs of algorithms and in metrics."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from fleet2d.algorithms.algorithm import to_columns
from fleet2d.configuration.problems import suggest
from fleet2d.errors import ScenarioError
from fleet2d.expectations.expectation import WORDS, Trace, constant
from fleet2d.expectations.signals import (
    ANY_NUMBER,
    Gauge,
    Limits,
    MeasuredRun,
    NumberSignal,
    Outputs,
    Results,
    Scene,
    SignalBlock,
    WordSignal,
)
from fleet2d.floorplan.home import Home


class _Value(NumberSignal):
    """Base of numbers that algorithms or metrics update; missing before the first update."""

    path: str

    @property
    def name(self) -> str:
        """The name of the algorithm or metric."""
        return self.path.partition(".")[0]

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Return the home; there is no value before the first update."""
        return run.home

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return the latest value."""
        return constant(gauge.now, block.first, block.end)


class output(_Value):
    """A number of an algorithm's newest output, which counts from the next step on.

    `ltp.kitchen` is the probability of a room by `ltp`; `rtp.ana.kitchen` that for one user;
    `mine.sightings` a named number of an output. Missing before the first output.
    """

    def check(self, scene: Scene) -> None:
        """Refuse an unknown algorithm."""
        scene.check_name("algorithm", self.name, scene.names["algorithms"], self)
        if "." not in self.path:
            raise ScenarioError(
                f'{self}: select a number of the output, such as output("{self.path}.kitchen")'
            )

    def learn(self, outputs: Outputs, results: Results, gauge: Gauge) -> None:
        """Read the number from a new output of the algorithm."""
        if self.name in outputs:
            gauge.now = self._read(outputs[self.name], gauge.memory)

    def _read(self, value: Any, home: Home) -> float:
        """Return the number of an output.

        Raises:
            ScenarioError: There is no such number in the output, or there are several.
        """
        types = [room.type for room in home.rooms]
        names = {room.type: room.name for room in home.rooms if types.count(room.type) == 1}
        columns = to_columns(value, [room.name for room in home.rooms], f"algorithms.{self.name}")
        keep = np.ones(len(next(iter(columns.values()))), np.bool_)
        words = {n: c for n, c in columns.items() if c.dtype.kind == "O"}
        number = next((n for n, c in columns.items() if c.dtype.kind in "fiub"), None)
        for part in self.path.split(".")[1:]:
            if part in columns and part not in words:
                number = part
                continue
            meant = [part, names.get(part, part)]
            matches = [np.isin(column.astype(str), meant) for column in words.values()]
            rows = np.any(matches, axis=0) if matches else np.zeros_like(keep)
            if not rows.any():
                known = [*columns, *dict.fromkeys(w for c in words.values() for w in c.tolist())]
                raise ScenarioError(f"{self}: there is no {part!r} in it{suggest(part, known)}")
            keep &= rows
        if keep.sum() != 1 or number is None:
            how = "they have no names to select by"
            if words:
                how = f"select one by: {', '.join(words)}"
            raise ScenarioError(f"{self} matches {keep.sum()} rows; {how}")
        return float(columns[number][keep][0])


class _Probability(output):
    """A number of an output, from 0 to 1."""

    between = (0.0, 1.0)


def probability(algorithm: str, room: str, user: str | None = None) -> output:
    """Return an algorithm's probability of a room, for a user if it has one per user."""
    return _Probability(".".join(part for part in (algorithm, user, room) if part))


WORDS["probability"] = probability


class metric(_Value):
    """A number of a metric's result so far, by the names in its result.

    It changes when the metric is updated; at the last step it is the result of the whole run.
    Missing before the first update.
    """

    def check(self, scene: Scene) -> None:
        """Refuse an unknown metric."""
        scene.check_name("metric", self.name, scene.names["metrics"], self)

    def limits(self, scene: Scene) -> Limits:
        """Return the least and the largest value that the metric declares for the number."""
        limits_of = scene.limits.get(self.name)
        return ANY_NUMBER if limits_of is None else limits_of(self.path.rpartition(".")[2])

    def learn(self, outputs: Outputs, results: Results, gauge: Gauge) -> None:
        """Read the number from a new result of the metric."""
        if self.name in results:
            gauge.now = self._read(results[self.name]())

    def finish(self, results: Mapping[str, Any], gauge: Gauge) -> None:
        """Read the number from the result of the whole run."""
        if self.name in results:
            gauge.replace_last(self._read(results[self.name]))

    def _read(self, result: Any) -> float:
        """Return a result as a number; NaN while it is empty.

        Raises:
            ScenarioError: The path leads to no number.
        """
        for part in self.path.split(".")[1:]:
            if not isinstance(result, Mapping) or part not in result:
                if isinstance(result, Mapping) and not result:
                    return float("nan")
                known = list(result) if isinstance(result, Mapping) else []
                raise ScenarioError(f"{self}: there is no {part!r} in it{suggest(part, known)}")
            result = result[part]
        if isinstance(result, bool | int | float):
            return float(result)
        if isinstance(result, Mapping) and not result:
            return float("nan")
        keys = ", ".join(result) if isinstance(result, Mapping) else repr(result)
        raise ScenarioError(f"{self} is not a number: extend it by one of {keys}")


class likeliest(WordSignal):
    """The likeliest room by an algorithm's latest output, for one user or over all rows.

    No room before the first output.
    """

    algorithm: str
    user: str | None = None

    of = ("algorithm", "algorithms")
    noun = "room"

    def check(self, scene: Scene) -> None:
        """Refuse an unknown algorithm or user."""
        super().check(scene)
        if self.user is not None:
            scene.check_name("user", self.user, scene.names["users"], self)

    def check_word(self, word: str, scene: Scene) -> None:
        """Refuse an unknown room."""
        scene.check_room(word, self)

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Return the names of rooms; there is no value before the first update."""
        gauge.words = {room.index: (room.name, room.type) for room in run.home.rooms}
        gauge.now = -1.0
        return [room.name for room in run.home.rooms]

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return the number of the room."""
        return constant(gauge.now, block.first, block.end)

    def learn(self, outputs: Outputs, results: Results, gauge: Gauge) -> None:
        """Take the likeliest room from a new output of the algorithm, the first if tied.

        Raises:
            ScenarioError: The output has no numbers of rooms, or none for the user.
        """
        if self.algorithm not in outputs:
            return
        names = gauge.memory
        columns = to_columns(outputs[self.algorithm], names, f"algorithms.{self.algorithm}")
        number = next((c for c in columns.values() if c.dtype.kind == "f"), None)
        if "room" not in columns or number is None:
            raise ScenarioError(f"{self}: its output has no number for each room")
        rooms = columns["room"]
        keep = np.ones(len(number), np.bool_)
        if self.user is not None:
            if "user" not in columns:
                raise ScenarioError(
                    f"{self}: its output doesn't tell users apart: leave out the user"
                )
            keep = columns["user"].astype(str) == self.user
        keep &= np.isin(rooms.astype(str), names)
        if keep.any():
            best = int(np.argmax(np.where(keep, number, -np.inf)))
            gauge.now = float(names.index(str(rooms[best])))
