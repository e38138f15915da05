"""Checks of your own components: whether they do what the engine relies on."""

import copy
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.algorithms.algorithm import Algorithm, load_learned, save_learned
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import ComponentError, Fleet2DError
from fleet2d.runs.run import Run
from fleet2d.scenario.load import load_scenario
from fleet2d.scenario.model import Scenario
from fleet2d.sight.perception_error import PerceptionError

SCENARIO: dict[str, Any] = {
    "simulation": {"start": "2026-01-05", "seed": 4},
    "floorplan": "bundled",
    "users": {"ana": "meander"},
    "robots": {"astro": {"type": "patrol", "dwell": "2 min"}},
    "artifacts": {"trajectories": "off"},
}
"""The scenario in which algorithms are checked: a user who wanders, and a robot on patrol."""
UPDATES = 6


def check_algorithm(cls: type[Algorithm], **settings: Any) -> None:
    """Check an algorithm in a small scenario for all that the engine relies on.

    * Its outputs can be stored, and always have the same columns.
    * Two runs with one seed are equal, and so is a run in spans of seven steps.
    * A copy of the simulation continues like the original: they share no state.
    * It doesn't change the run: with and without it, users and robots do the same.
    * Its learned state can be saved and restored, and is the same afterwards.

    Args:
        cls: The algorithm's class.
        settings: Its configuration, where it differs from the defaults.

    Raises:
        AssertionError: One of these doesn't hold; the message says which, and how it showed.

    Example:
        >>> import numpy as np
        >>> from fleet2d import Algorithm
        >>> class Sightings(Algorithm):
        ...     '''How often anybody was seen.'''
        ...     def update(self, history, state):
        ...         return {"sightings": len(history.observations.step)}
        >>> check_algorithm(Sightings)
    """
    _refuse(f"algorithm {cls.__name__}", list(_problems(cls, settings)))


def _refuse(what: str, problems: list[str]) -> None:
    if problems:
        listed = "\n".join(f"- {problem}" for problem in problems)
        raise AssertionError(f"the engine can't rely on the {what}:\n{listed}")


def _problems(cls: type[Algorithm], settings: Mapping[str, Any]) -> Iterator[str]:
    try:
        algorithm = cls(**settings)
        run = _run(algorithm)
    except Fleet2DError as error:
        yield str(error)
        return
    scenario = _scenario(algorithm).model_copy(update={"algorithms": {}})
    tables = run.manifest["tables"]
    expected = Simulation(scenario).run().manifest["tables"]
    if any(tables[name] != expected[name] for name in ("key_frames", "events", "observations")):
        yield "users and robots behave differently with it: it changes its arguments"
    draw = "state.random(purpose)"
    spans = "use nothing but history and state"
    yield from _repeat_problems(lambda **keys: _run(cls(**settings), **keys), run, draw, spans)
    yield from _copy_problems(cls(**settings), run)
    yield from _state_problems(algorithm, cls, settings)


def _repeat_problems(repeat: Callable[..., Run], run: Run, draw: str, spans: str) -> Iterator[str]:
    """Compare a run with its repetition, and with one in short spans."""
    if run.digest != repeat().digest:
        yield (
            f"two runs with one seed differ: draw by {draw}, and use no clock, no hash() and no"
            " global state"
        )
    elif run.digest != repeat(max_span=7).digest:
        yield f"a run in spans of 7 steps differs: {spans}"


def _scenario(algorithm: Algorithm, **simulation: Any) -> Scenario:
    duration = UPDATES * algorithm.period
    times = {**SCENARIO["simulation"], "duration": duration, **simulation}
    scenario = load_scenario({**SCENARIO, "simulation": times})
    return scenario.model_copy(update={"algorithms": {"checked": algorithm}})


def _run(algorithm: Algorithm, **simulation: Any) -> Run:
    return Simulation(_scenario(algorithm, **simulation)).run()


def _copy_problems(algorithm: Algorithm, run: Run) -> Iterator[str]:
    original = Simulation(_scenario(algorithm))
    try:
        original.run_until(UPDATES // 2 * algorithm.period)
        duplicate = copy.deepcopy(original)
    except (TypeError, AttributeError, NotImplementedError) as error:
        yield f"its state can't be copied: {error}"
        return
    original.run()
    if run.digest != duplicate.run().digest:
        yield "a copy of the simulation continues differently: the copies share state"


def _state_problems(
    algorithm: Algorithm, cls: type[Algorithm], settings: Mapping[str, Any]
) -> Iterator[str]:
    simulation = Simulation(_scenario(algorithm))
    simulation.run()
    learner = simulation.algorithms["checked"]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "checked.npz"
        try:
            save_learned(learner.remember(), path, cls.__name__)
            restored = cls(**{**settings, "learned": path})
            second_learner = Simulation(_scenario(restored)).algorithms["checked"]
            second = Path(folder) / "again.npz"
            save_learned(second_learner.remember(), second, cls.__name__)
        except ComponentError as error:
            yield str(error)
            return
        if not _equal(load_learned(path), load_learned(second)):
            yield "its learned state changes when it is saved and restored"


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(_equal(one[key], other[key]) for key in one)
    return bool(np.array_equal(one, other, equal_nan=np.asarray(one).dtype.kind == "f"))


def check_perception_error(cls: type[PerceptionError], **settings: Any) -> None:
    """Check an error of perception in a small scenario for all that the engine relies on.

    * What it returns can be stored.
    * Two runs with one seed are equal, and so is a run in spans of seven steps.

    Args:
        cls: The class of the error.
        settings: Its configuration, where it differs from the defaults.

    Raises:
        AssertionError: One of these doesn't hold; the message says which.

    Example:
        >>> from fleet2d import PerceptionError
        >>> class Lying(PerceptionError):
        ...     '''Everybody seems to lie.'''
        ...     def distort(self, sightings):
        ...         return sightings.replace(posture=2)
        >>> check_perception_error(Lying)
    """
    _refuse(f"error of perception {cls.__name__}", list(_error_problems(cls, settings)))


def _error_problems(cls: type[PerceptionError], settings: dict[str, Any]) -> Iterator[str]:
    try:
        draw = "sightings.uniform(purpose) or sightings.bell(purpose)"
        spans = "treat each sighting by itself"

        def repeat(**simulation: Any) -> Run:
            return _run_with_error(cls(**settings), **simulation)

        yield from _repeat_problems(repeat, repeat(), draw, spans)
    except Fleet2DError as error:
        yield str(error)


def _run_with_error(error: PerceptionError, **simulation: Any) -> Run:
    """Return a run in which two robots perceive two people with an error."""
    robot = {
        "type": "patrol",
        "dwell": "1 min",
        "camera": {"angle_deg": 200, "detection": 0.9, "latency": "2 s"},
        "perception": {"errors": {"checked": error}, "false_positives": {"per_hour": 60}},
    }
    times = {**SCENARIO["simulation"], "duration": "1 h", **simulation}
    users = {"ana": "meander", "ben": "meander"}
    robots = {"astro": robot, "bolt": robot}
    content = {**SCENARIO, "simulation": times, "users": users, "robots": robots}
    return Simulation(load_scenario(content)).run()
