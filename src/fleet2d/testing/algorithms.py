"""Checks that one's own components can be run through: do they keep what the engine relies on?"""

import copy
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.algorithms.algorithm import Algorithm
from fleet2d.algorithms.learned import load_learned, save_learned
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import ComponentError, Fleet2DError
from fleet2d.runs.run import Run
from fleet2d.scenario.model import Scenario, load_scenario

SCENARIO = {
    "simulation": {"start": "2026-01-05", "seed": 4},
    "floorplan": "bundled",
    "users": {"ana": "meander"},
    "robots": {"astro": {"type": "patrol", "dwell": "2 min"}},
    "artifacts": {"trajectories": "off"},
}
"""The life in which algorithms are tried: a user who wanders, and a robot on patrol."""
UPDATES = 6


def check_algorithm(cls: type[Algorithm], **settings: Any) -> None:
    """Check that an algorithm is one: run it in a small life, and see that it keeps its promises.

    * It puts out what can be stored, and always the same columns.
    * Two runs with one seed are the same, and so is a run cut into spans of seven steps.
    * A copy of the simulation goes on as the original does: it shares no state with it.
    * It leaves others' lives alone: with and without it, everybody does the same.
    * What it has learned can be kept and recalled, and comes out the same.

    Args:
        cls: The algorithm's class.
        settings: Its configuration, where its defaults don't do.

    Raises:
        AssertionError: It breaks one of these; says which, and how it showed.

    Example:
        >>> import numpy as np
        >>> from fleet2d import Algorithm
        >>> class Sightings(Algorithm):
        ...     '''How often anybody was seen.'''
        ...     def update(self, history, state):
        ...         return {"sightings": len(history.observations.step)}
        >>> check_algorithm(Sightings)
    """
    problems = list(_problems(cls, settings))
    if problems:
        raise AssertionError(
            f"{cls.__name__} is no algorithm that the engine can rely on:\n"
            + "\n".join(f"- {problem}" for problem in problems)
        )


def _problems(cls: type[Algorithm], settings: Mapping[str, Any]) -> Iterator[str]:
    try:
        algorithm = cls(**settings)
        stored = _lived(algorithm)
    except Fleet2DError as error:
        yield str(error)
        return
    with_it, without = stored.manifest["tables"], _unlearned(algorithm).manifest["tables"]
    if any(with_it[name] != without[name] for name in ("key_frames", "events", "observations")):
        yield "others live differently with it: it changes what it is handed"
    if stored.digest != _lived(cls(**settings)).digest:
        yield (
            "two runs with one seed differ: draw by state.random(purpose), and depend on no clock,"
            " no hash() and no global state"
        )
    elif stored.digest != _lived(cls(**settings), max_span=7).digest:
        yield "a run cut into spans of 7 steps differs: go by history and state only"
    yield from _copies(cls(**settings), stored)
    yield from _memory(algorithm, cls, settings)


def _document(algorithm: Algorithm, **simulation: Any) -> Scenario:
    duration = UPDATES * algorithm.period
    times: dict[str, Any] = {**SCENARIO["simulation"], "duration": duration, **simulation}  # type: ignore[dict-item]
    scenario = load_scenario({**SCENARIO, "simulation": times})
    return scenario.model_copy(update={"algorithms": {"checked": algorithm}})


def _lived(algorithm: Algorithm, **simulation: Any) -> Run:
    return Simulation(_document(algorithm, **simulation)).run()


def _unlearned(algorithm: Algorithm) -> Run:
    """Return the same life without the algorithm."""
    return Simulation(_document(algorithm).model_copy(update={"algorithms": {}})).run()


def _copies(algorithm: Algorithm, stored: Run) -> Iterator[str]:
    original = Simulation(_document(algorithm))
    try:
        original.run_until(UPDATES // 2 * algorithm.period)
        twin = copy.deepcopy(original)
    except (TypeError, AttributeError, NotImplementedError) as error:
        yield f"its state can't be copied: {error}"
        return
    original.run()
    if stored.digest != twin.run().digest:
        yield "a copy of the simulation goes on differently: the copies share state"


def _memory(
    algorithm: Algorithm, cls: type[Algorithm], settings: Mapping[str, Any]
) -> Iterator[str]:
    simulation = Simulation(_document(algorithm))
    simulation.run()
    learner = simulation.algorithms["checked"]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "checked.npz"
        try:
            save_learned(learner.remember(), path, cls.__name__)
            heir = cls(**{**settings, "learned": path})
            again = Simulation(_document(heir)).algorithms["checked"]
            second = Path(folder) / "again.npz"
            save_learned(again.remember(), second, cls.__name__)
        except ComponentError as error:
            yield str(error)
            return
        if not _equal(load_learned(path), load_learned(second)):
            yield "what it remembers changes when it is recalled"


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(_equal(one[key], other[key]) for key in one)
    return bool(np.array_equal(one, other, equal_nan=np.asarray(one).dtype.kind == "f"))
