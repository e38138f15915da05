"""Expectations of a simulation from outside, and their verdicts.

What reads and measures them is imported when a run has some.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from fleet2d.artifacts.manifest import Status
from fleet2d.engine.control.steering import Steering
from fleet2d.errors import InputError

if TYPE_CHECKING:
    from fleet2d.expectations.expectation import Expectation
    from fleet2d.expectations.verdict import Verdict


class Judging(Steering):
    """The part of a simulation that adds and judges expectations."""

    def expect(self, expectation: "Expectation | str", name: str = "") -> str:
        """Expect something from the next step on; the verdict is in the run's manifest.

        Args:
            expectation: The expectation, or its text as in a scenario.
            name: Its name; empty: its text.

        Returns:
            The name.

        Raises:
            InputError: It names something unknown or an impossible event, or its time is beyond
                the run.

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
            raise InputError(
                "the run is finished: add expectations before its end, or call judge(…) on the run"
            )
        from fleet2d.engine.expectations.expect import expect

        expectation = _parsed(expectation)
        self._state.settle(self.step)
        name = name or str(expectation)
        expect(self._state, self.scenario, self.clock, name, expectation, self.step)
        return name

    def verdicts(self) -> "dict[str, Verdict]":
        """Return the present verdicts on all expectations, by name.

        A verdict that can't change any more is `decided`; a test may end then.
        """
        if self._state.expectations is None:
            return {}
        if self._run is None:
            self._state.settle(self.step)
        return self._state.expectations.verdicts(ended=self.done)

    def judge(self, expectation: "Expectation | str", name: str = "") -> "Verdict":
        """Return the verdict on an expectation from the step on at which it was first requested.

        Raises:
            InputError: See `expect`; or no step has been simulated since.
        """
        expectation = _parsed(expectation)
        name = name or str(expectation)
        expectations = self._state.expectations
        if expectations is None or name not in expectations.entries:
            self.expect(expectation, name)
        verdict = self.verdicts().get(name)
        if verdict is None:
            raise InputError(
                f"{name} was added after the last step, so there is nothing to judge: simulate at"
                " least one step, and call judge() again"
            )
        return verdict

    def _store_verdicts(self, results: Mapping[str, Any], status: Status) -> None:
        """Store the verdicts on all expectations."""
        expectations = self._state.expectations
        if expectations is not None and status != "failed":
            store = self._state.store
            ended = status == "complete"
            store.manifest.expectations = expectations.finish(results, store, ended=ended)

    def _expect_again(self, expectations: Mapping[str, Mapping[str, Any]]) -> None:
        """Add the expectations of a stored run that are not in its scenario."""
        for name, content in expectations.items():
            if name not in self.scenario.expect:
                from fleet2d.engine.expectations.expect import expect

                expectation = _parsed(content["expectation"])
                first = content["first"]
                expect(self._state, self.scenario, self.clock, name, expectation, first)


def _parsed(expectation: "Expectation | str") -> "Expectation":
    from fleet2d.expectations.parse import parse_expectation

    return parse_expectation(expectation) if isinstance(expectation, str) else expectation
