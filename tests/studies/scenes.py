"""Small studies for the tests: some minutes in the flat of four rooms."""

import importlib
import os
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import pytest
from tests.scenes import scenario

from fleet2d.studies.directory import Counts
from fleet2d.studies.driver import check_study, run_study
from fleet2d.studies.executors import Crew, SerialExecutor
from fleet2d.studies.reader import Study, open_study

SPEED = "robots.astro.speed"


def base(duration="2 min", **sections):
    """A scenario of a person who meanders and a robot that patrols."""
    robots = {"astro": {"type": "patrol", "camera": {"range": [0, 4]}}}
    return scenario(
        duration,
        users={"ana": {"type": "meander"}},
        robots=sections.pop("robots", robots),
        metrics={"room_share": {"period": "1 min"}, "sightings": {}, "distance": {}},
        **sections,
    )


def small(**keys):
    """A study of two speeds with three seeds, or what the keys say."""
    return {"base": base(), "axes": {SPEED: [0.3, 0.6]}, "replicates": 3, **keys}


class CountingExecutor(SerialExecutor):
    """Runs up to a number of tasks in this process, and is then interrupted.

    Attributes:
        tasks: The tasks that it ran.
    """

    def __init__(self, most=1000):
        self.most = most
        self.tasks: list[Any] = []

    def submit(self, function, /, *args, **kwargs) -> Future[Any]:
        if len(self.tasks) == self.most:
            raise KeyboardInterrupt
        self.tasks.append(args[1][0])
        return super().submit(function, *args, **kwargs)

    @property
    def ran(self):
        """The numbers of the tasks that it ran."""
        return [task.number for task in self.tasks]


def run(
    study, folder: Path, executor: Executor | None = None, workers=1, **options
) -> tuple[Counts, Study]:
    """Run a study in this process, one variant at a time, and open it."""
    crew = Crew(executor or SerialExecutor(), workers, batch_s=0.0)
    with crew.executor:
        counts = run_study(check_study(study), folder, crew, **options)
    return counts, open_study(folder)


def digests(study: Study):
    """The digests of all variants, in order."""
    return study.variants["digest"].to_list()


def optional(name):
    """Return a module that only the extra `cluster` installs; skip what needs it elsewhere."""
    if os.environ.get("FLEET2D_REQUIRE_CLUSTER") == "1":
        return importlib.import_module(name)
    return pytest.importorskip(name, reason=f"{name} is not installed: see .ci/cluster")
