"""Access of other packages to a simulation, beyond its public methods."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fleet2d.engine.simulation import Simulation
from fleet2d.engine.state import State
from fleet2d.entities.behavior import Situation
from fleet2d.interventions.intervention import parse_intervention

if TYPE_CHECKING:
    from fleet2d.expectations.verdict import VerdictEvidence


def may_run_code(simulation: Simulation) -> bool:
    """Return whether code and programs named by the scenario may run."""
    return simulation._loop.runs_code


def directory_of(simulation: Simulation) -> Path | None:
    """Return the run directory; None: the run is in memory."""
    return simulation._store.directory


def add_note(simulation: Simulation, text: str) -> None:
    """Add a line to the notes of the manifest."""
    simulation._store.manifest.notes.append(text)


def interventions_of(simulation: Simulation) -> list[dict[str, Any]]:
    """Return the interventions so far, of the script and from outside, as in a manifest."""
    return list(simulation._state.interventions.done)


def check_intervention(simulation: Simulation, act: Mapping[str, Any]) -> None:
    """Refuse an intervention that can't be applied at the present step, without applying any.

    Raises:
        ScenarioError: The intervention is not valid, or names something unknown.
        PlacementError: There is no such place, or it can't be reached.
    """
    from fleet2d.engine.world import EngineWorld  # few runs need it

    parse_intervention(act).check(EngineWorld(simulation._state, simulation.step))


def stop(simulation: Simulation) -> None:
    """Interrupt a simulation in another thread after its present span, as Ctrl-C does.

    Example:
        >>> import contextlib, threading
        >>> import fleet2d
        >>> simulation = fleet2d.Simulation(None, "simulation.speedup=1", seed=4)
        >>> threading.Timer(0.1, stop, [simulation]).start()
        >>> with contextlib.suppress(KeyboardInterrupt):
        ...     simulation.advance(1000)
        >>> simulation.step < 1000
        True
    """
    simulation._loop.stop()


def run_until_asked(simulation: Simulation, *names: str) -> list[str]:
    """Simulate until a robot's first behavior, a policy, has to choose; see `Policy`.

    These policies have no file. To continue, set `given` of each returned robot's policy.

    Returns:
        The names of the robots that have to choose at the present step; empty at the end.
    """
    rows = {name: simulation._body(name).row for name in names}
    asked: list[str] = []

    def asks(state: State, step: int) -> bool:
        asked[:] = [name for name, row in rows.items() if has_to_choose(state, row, step)]
        return bool(asked)

    simulation._check_not_over()
    simulation._loop.run_until_asked(simulation._state, simulation.clock.steps, asks)
    return asked


def situation_of(simulation: Simulation, name: str) -> Situation:
    """Return the situation in which the behaviors of a body decide at the present step.

    Raises:
        ScenarioError: There is no such body.
    """
    return simulation._state.situation(simulation._body(name).row, simulation.step)


def measured(simulation: Simulation, metric: str) -> dict[str, Any]:
    """Return the result of a metric up to the present step.

    The metric's next period begins here, so only metrics without rows to store should be measured.
    """
    state = simulation._state
    state.settle(simulation.step)
    assert state.log is not None, "a run with metrics has a log"
    state.count_looks()
    result = state.learners.measure(metric, simulation.step, state.log)
    state.forget(min(learner.oldest for learner in state.learners.all))
    return result


def results_so_far(simulation: Simulation) -> dict[str, Any]:
    """Return the results of all metrics up to the end of their last period, changing nothing."""
    return simulation._state.learners.results()


def evidence_of(simulation: Simulation, name: str) -> "VerdictEvidence":
    """Return the signals of an expectation so far, and its subjects, for pictures."""
    assert simulation._state.expectations is not None
    return simulation._state.expectations.evidence(name)


def has_to_choose(state: State, row: int, step: int) -> bool:
    """Return whether a robot's policy, its first behavior, has to choose at a step."""
    actor = state.actors[row]
    policy: Any = actor.behaviors[0]
    if policy.given is not None:
        return False
    if state.bodies.ask_at[row] > step and not any(
        watcher.looks(row, step) for watcher in state.steering
    ):
        return False
    now = state.situation(row, step)
    return actor.asks_first(now) and policy.asks(now)
