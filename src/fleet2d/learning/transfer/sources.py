"""The days that models learn from: real ones, and simulated ones, stored as data sets."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

import fleet2d.routines.survey as survey
from fleet2d.errors import ScenarioError
from fleet2d.kernels import I64
from fleet2d.learning.datasets.generate import check_dataset, dataset
from fleet2d.learning.datasets.reader import open_dataset
from fleet2d.learning.datasets.tasks import windows
from fleet2d.learning.datasets.windows import Windows
from fleet2d.learning.fit.persona import to_yaml
from fleet2d.learning.transfer.learners import OWN_WEIGHT, ForecastMoments, moments, pooled
from fleet2d.learning.transfer.specification import Cell, HomeEntry, TransferFile, TransferPlan
from fleet2d.learning.transfer.traces import (
    MinuteTrace,
    copied,
    known_midnight,
    markov,
    traces_of_data,
    write_log,
)
from fleet2d.storage.files import write_atomically
from fleet2d.studies.executors import Crew

ROBOT = {"behaviors": [{"type": "patrol", "order": "random", "dwell": "10 min"}]}
MONDAY = "2026-01-05"
PRESENCE = "presence"


class Sources:
    """The people that models learn from, by name; each is simulated once.

    Attributes:
        file: The settings.
        homes: The real homes.
        folder: Where data sets and files of people are.
    """

    def __init__(self, plan: TransferPlan, folder: Path) -> None:
        """Prepare the sources; none is simulated yet."""
        self.file: TransferFile = plan.file
        self.homes: Mapping[str, HomeEntry] = plan.homes
        self.tested: Mapping[str, I64] = plan.tested
        self.folder = folder
        self._moments: dict[tuple[str, str], ForecastMoments] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Leave out caches, which a worker computes anew."""
        kept = {k: v for k, v in self.__dict__.items() if k != "plans"}
        return {**kept, "_moments": {}}

    @cached_property
    def plans(self) -> int:
        """The number of homes in which simulated people live."""
        return sum(len(axis.choices("home")) for axis in self.file.plans)

    @property
    def copied_days(self) -> int:
        """The number of copied days of a home, equal to that of a simulated person."""
        return self.file.lived_days * self.plans

    def names(self, cells: list[Cell]) -> list[str]:
        """Return the data sets that cells need."""
        return list(dict.fromkeys(chain.from_iterable(map(self.needed, cells))))

    def needed(self, cell: Cell) -> Iterator[str]:
        """Yield the data sets that a cell needs."""
        if cell.arm in ("simulated", "tuned", "both"):
            yield "simulated"
        if cell.arm == "survey":
            yield "survey"
        if cell.arm == "fitted":
            yield f"fitted-{cell.home}-{cell.days}"
        if cell.task == PRESENCE:
            yield f"log-{cell.home}"
            if cell.arm in ("real", "both"):
                yield from (f"log-{name}" for name in self.homes)
            if cell.arm in ("markov", "copied"):
                yield f"{cell.arm}-{cell.home}-{cell.days}"

    def make(self, names: list[str], crew: Crew) -> dict[str, str]:
        """Simulate the missing data sets; all are checked before the first run.

        Returns:
            Why data sets can't be made at all, by name, if `skip` allows it.

        Raises:
            ScenarioError: People don't fit into homes, and `skip` is left out.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        contents = {name: self._content(name) for name in names}
        problems = {}
        for name, content in contents.items():
            try:
                check_dataset(
                    content, self.folder / name, workers=crew.workers, executor=crew.executor
                )
            except ScenarioError as error:
                problems[name] = f"{name}: {error}"
        if problems and self.file.skip is None:
            raise ScenarioError("\n".join(problems.values()))
        for name, content in contents.items():
            if name in problems:
                continue
            dataset(content, self.folder / name, workers=crew.workers, executor=crew.executor)
        return problems

    def _content(self, name: str) -> dict[str, Any]:
        """Return the file of a data set."""
        kind, _, rest = name.partition("-")
        start = MONDAY
        days = self.file.lived_days
        people: list[dict[str, Any]]
        if kind == "simulated":
            people = [{"type": "routine", "persona": persona} for persona in self.file.personas]
        elif kind == "survey":
            people = [{"type": "population", "group": group} for group in survey.groups()]
        elif kind == "log":
            home = self.homes[rest]
            start = known_midnight(home.log).isoformat()
            days = home.log.days
            keys = home.settings.model_dump(
                include={"path", "format", "id", "time_zone", "sort"},
                exclude_defaults=True,
                mode="json",
            )
            rooms = {label: kind or None for label, kind in home.settings.rooms.items()}
            people = [{"type": "replay", **keys, "rooms": rooms}]
        else:
            home_name, _, count = rest.rpartition("-")
            people = [self._derived(kind, name, self.homes[home_name], int(count))]
        return {
            "name": name,
            "base": {
                "extends": "bundled:paper",
                "simulation": {"start": start, "duration": f"{days} d"},
                "robots": {"astro": ROBOT},
                "algorithms": {"ltp": None},
            },
            "seed": self.file.seed,
            "splits": {
                "train": {
                    "runs": self.plans * len(people),
                    "homes": [axis.model_dump(exclude_defaults=True) for axis in self.file.plans],
                    "households": [{"ana": person} for person in people],
                }
            },
            "beliefs": ["routine"] if PRESENCE in self.file.tasks else [],
            "skip": self.file.skip,
        }

    def _derived(self, kind: str, name: str, home: HomeEntry, days: int) -> dict[str, Any]:
        """Write a persona or a log derived from a home's own days; return its user."""
        if kind == "fitted":
            path = self.folder / f"{name}.yaml"
            write_atomically(path, to_yaml(home.fitted(days).document).encode())
            return {"type": "routine", "persona": str(path.absolute())}
        path = self.folder / f"{name}.txt"
        trace = self._copies(kind, home, days, self.file.lived_days)
        write_log(trace, known_midnight(home.log), path)
        return {"type": "replay", "path": str(path.absolute())}

    def _copies(self, kind: str, home: HomeEntry, days: int, count: int) -> MinuteTrace:
        make = markov if kind == "markov" else copied
        return make(home.trace, home.own(days), count, self.file.seed)

    def moments_of(self, name: str, task: str) -> ForecastMoments:
        """Return the moments of a source: a data set, or `real-HOME`."""
        key = name, task
        if key not in self._moments:
            kind, _, rest = name.partition("-")
            if kind == "real":
                traces = [self.homes[rest].trace]
            elif kind in ("markov", "copied"):
                home, _, days = rest.rpartition("-")
                traces = [self._copies(kind, self.homes[home], int(days), self.copied_days)]
            else:
                traces = list(traces_of_data(open_dataset(self.folder / name)))
            self._moments[key] = pooled([moments(t, task) for t in traces], 10**9, 0)
        return self._moments[key]

    def training(self, cell: Cell) -> ForecastMoments:
        """Return the moments that the model of a cell learns from."""
        task = cell.task
        parts = []
        if cell.arm in ("real", "both") and len(self.homes) > 1:
            others = [f"real-{name}" for name in self.homes if name != cell.home]
            parts.append(self._pooled(others, task))
        if cell.arm in ("markov", "copied"):
            parts.append(self._pooled([f"{cell.arm}-{cell.home}-{cell.days}"], task))
        elif sets := list(self.needed(cell)):
            parts.append(self._pooled(sets, task))
        if cell.days and cell.arm in ("real", "own", "tuned", "both"):
            own = self.of_days(cell, self.homes[cell.home].own(cell.days))
            parts.append(own.weighted(OWN_WEIGHT if cell.arm != "own" else 1.0))
        return pooled(parts, 10**9, 0)

    def _pooled(self, names: list[str], task: str) -> ForecastMoments:
        key = "+".join(names), task
        if key not in self._moments:
            parts = [self.moments_of(name, task) for name in names]
            self._moments[key] = pooled(parts, self.file.rows, self.file.seed)
        return self._moments[key]

    def of_days(self, cell: Cell, days: I64) -> ForecastMoments:
        """Return the moments of some days of the home of a cell."""
        own = self.moments_of(f"real-{cell.home}", cell.task)
        return own.where(np.isin(own.day, days))

    def windows_of(self, name: str) -> list[Windows]:
        """Return the windows of a data set."""
        return list(windows(open_dataset(self.folder / name), "train"))
