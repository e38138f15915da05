"""Expecting something of a simulation, and asking what has become of it."""

from collections.abc import Mapping
from typing import Any

from fleet2d.artifacts.manifest import Status
from fleet2d.engine.expecting import expect
from fleet2d.engine.steering import Steering
from fleet2d.errors import InputError
from fleet2d.expectations.expectation import Expectation
from fleet2d.expectations.parse import parse_expectation
from fleet2d.expectations.verdict import Verdict


class Judging(Steering):
    """What is expected of a simulation, and what became of it."""

    def expect(self, expectation: Expectation | str, name: str = "") -> str:
        """Expect something from the next step on; what became of it is in the run's manifest.

        Args:
            expectation: What; text is read as in a scenario.
            name: What it is called; left out: its text.

        Returns:
            The name.

        Raises:
            InputError: It can't be expected of this run: it names what isn't there, or what can
                never happen, or its time is beyond the run.

        Example:
            >>> import fleet2d
            >>> simulation = fleet2d.Simulation(None, "simulation.duration=4 h", seed=4)
            >>> simulation.expect("eventually(room(ana) == kitchen, within=2 h)", name="eats")
            'eats'
            >>> simulation.run_until("02:01")
            >>> simulation.verdicts()["eats"].decided
            True
        """
        if self._run is not None or self.done:
            raise InputError("the run is over: expect something of a new one, or judge(…) this run")
        whole = parse_expectation(expectation) if isinstance(expectation, str) else expectation
        self._state.settle(self.step)
        name = name or str(whole)
        expect(self._state, self.scenario, self.clock, name, whole, self.step)
        return name

    def verdicts(self) -> dict[str, Verdict]:
        """Return what has become of all that is expected, up to now, by name.

        What nothing can change any more is `decided`; a test may end there.
        """
        if self._state.expecting is None:
            return {}
        if self._run is None:
            self._state.settle(self.step)
        return self._state.expecting.verdicts(ended=self.done)

    def judge(self, expectation: Expectation | str, name: str = "") -> Verdict:
        """Return what has become of an expectation since it was first asked for.

        Raises:
            InputError: See `expect`; or no step has been simulated since.
        """
        whole = parse_expectation(expectation) if isinstance(expectation, str) else expectation
        name = name or str(whole)
        known = self._state.expecting
        if known is None or name not in known.entries:
            self.expect(whole, name)
        verdict = self.verdicts().get(name)
        if verdict is None:
            raise InputError(
                f"{name} is expected from now on, and no step has been simulated since: run the"
                " simulation, and ask again"
            )
        return verdict

    def _store_verdicts(self, results: Mapping[str, Any], status: Status) -> None:
        """Store what has become of all that was expected."""
        expecting = self._state.expecting
        if expecting is not None and status != "failed":
            store = self._state.store
            ended = status == "complete"
            store.manifest.expectations = expecting.finish(results, store, ended=ended)

    def _expect_again(self, expectations: Mapping[str, Mapping[str, Any]]) -> None:
        """Expect what was expected of a stored run besides what its scenario says."""
        for name, content in expectations.items():
            if name not in self.scenario.expect:
                whole, since = parse_expectation(content["expectation"]), content["first"]
                expect(self._state, self.scenario, self.clock, name, whole, since)
