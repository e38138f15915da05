"""The answer of a gate: what speaks against a build, what differs, and what can't be told."""

from pathlib import Path

import pytest
from tests.testing.test_gate import TEST, gate, reports

from fleet2d.testing.answer import answer, headline
from fleet2d.testing.gate import Gate, compare, tally
from fleet2d.testing.suite import TrialReport


def test_what_holds_by_less_is_told_although_no_verdict_differs():
    found = gate(set(), set(), margin=0.75)

    assert found.passes
    says = " ".join(answer(found).sentences)
    assert "finds (REQ-1) holds by less in 20 of 20 trials" in says
    assert "by 0.25 m in the median" in says


@pytest.mark.parametrize(
    ("new", "old", "passes", "words"),
    [
        (set(), None, True, "2.1 passes: 1 of 1 expectation held"),
        ({3}, None, False, "2.1 doesn't pass: 1 of 1 expectation fails"),
        ({3}, {3, 4}, True, "none of 1 expectation is shown to be worse than with 2.0"),
        ({3}, set(), False, "1 of 1 expectation is worse than with 2.0"),
        (set(range(8)), {0}, False, "1 of 1 expectation is worse than with 2.0"),
    ],
    ids=["all held", "one failed", "failed before, too", "only now", "more often"],
)
def test_what_speaks_against_a_release(new, old, passes, words):
    found = gate(new, old)

    assert passes == found.passes
    assert words in headline(found)


def test_equal_builds_say_what_may_have_gone_unseen():
    assert "All 20 verdicts are those of 2.0; what differs in less than 13.9 % of trials may" in (
        str(answer(gate(set(), set())))
    )


def test_builds_between_which_nothing_differs_at_all_are_asked_about():
    asked = "nothing holds by more or less: do both builds differ in what these tests use?"

    assert asked in str(answer(gate(set(), set())))
    assert asked not in str(answer(gate(set(), set(), margin=0.75)))


def test_a_difference_that_may_be_chance_says_how_many_trials_would_show_it():
    # 3 of 20 are worse: 2 / 2**3 is .25, and 2 / 2**6 is below .05.
    says = " ".join(answer(gate({1, 2, 3}, set())).sentences)

    assert "finds (REQ-1) is worse in 3 of 20 trials (p = 0.25, not shown for other trials)" in says
    assert "whether finds differs for others, 2 times as many trials would show" in says
    assert "times as many" not in str(answer(gate(set(range(9)), set())))


def test_a_build_without_common_trials_is_not_compared():
    tallies = tally([TEST], reports(set()))
    found = Gate("2.1", tallies, "2.0", [], compare(tallies, []))

    assert "No trial of 2.0 is the same: nothing is compared." in answer(found).sentences


def test_a_build_that_does_not_run_is_said_and_does_not_pass():
    broken = [TrialReport(r.key, error="robots.astro.speeed: unknown key") for r in reports(set())]
    tallies = tally([TEST], broken)
    found = Gate("2.1", tallies, "2.0", tally([TEST], reports(set())))

    says = answer(found).sentences
    assert "2.1 doesn't pass: 1 test can't be run." == says[0]
    assert "home.yaml can't be run in 20 of 20 trials: robots.astro.speeed: unknown key." == says[1]
    assert "can't be run in 20 of 20 trials, first in seed 0: robots.astro.speeed" in (
        next(found.details({}))
    )


def test_a_test_without_trials_is_not_run_and_what_it_covers_is_not_uncovered(fleet2d):
    head = "simulation: {start: 2026-01-05, duration: 2 min, seed: 1}\nfloorplan: bundled\n"
    robots = "robots: {astro: {type: patrol, dwell: 10 s}}\n"
    for name in ("a", "b"):
        expect = f"expect: {{{name}: {{that: eventually(moving(astro)), covers: [REQ-{name}]}}}}\n"
        Path(f"{name}.yaml").write_text(head + robots + expect)
    code, out, _ = fleet2d("test", ".", "--budget", "1", "--junit", "results.xml")

    assert code == 0
    assert "1 of 2 expectations held." in out
    assert "1 of 2 requirements held; not run: REQ-b." in out
    assert "b of b.yaml (REQ-b): not run" in Path("results.xml").read_text()
