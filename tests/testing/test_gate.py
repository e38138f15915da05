"""The gate: tallies, paired comparisons and coverage from the outcomes of trials."""

from pathlib import Path

import pytest
from tests.scenes import Cli

from fleet2d.errors import InputError
from fleet2d.testing.answer import answer, headline
from fleet2d.testing.gate import (
    FAILED,
    HELD,
    NOT_COVERED,
    Gate,
    PairedChange,
    Tally,
    compare,
    cover,
    sign_test,
    tally,
)
from fleet2d.testing.suite import SuiteTest, TrialKey, TrialOutcome, TrialReport

TEST = SuiteTest(Path("home.yaml"), seeds=tuple(range(20)))


def reports(failing: set[int], homes: int = 1, margin: float = 1.0) -> list[TrialReport]:
    """Twenty trials of one expectation, of which some fail; their homes in turn."""
    return [
        TrialReport(
            TrialKey(TEST.name, f"{seed % homes}" if homes > 1 else "", seed),
            (
                TrialOutcome(
                    "finds", seed not in failing, seed in failing, f"said {seed}",
                    -1.0 - seed if seed in failing else margin, "m", 3, ("REQ-1",),
                ),
            ),
        )
        for seed in range(20)
    ]  # fmt: skip


def change(new: set[int], old: set[int], homes: int = 1) -> PairedChange:
    (found,) = compare(tally([TEST], reports(new, homes)), tally([TEST], reports(old, homes)))
    return found


def gate(new: set[int], old: set[int] | None = None, margin: float = 1.0) -> Gate:
    tallies = tally([TEST], reports(new, margin=margin))
    if old is None:
        return Gate("2.1", tallies, coverage=cover(tallies, None))
    before = tally([TEST], reports(old))
    return Gate("2.1", tallies, "2.0", before, compare(tallies, before))


@pytest.mark.parametrize(
    ("new", "old", "worse", "better", "p"),
    [
        (set(range(7)), {0}, 6, 0, 0.03125),  # McNemar: 2 / 2**6
        ({1, 2}, {3}, 2, 1, 1.0),
        ({1, 2}, {1, 2}, 0, 0, 1.0),
        (set(), set(range(10)), 0, 10, 2 / 2**10),
    ],
)
def test_pairs_that_differ_give_an_exact_p_value(
    new: set[int], old: set[int], worse: int, better: int, p: float
) -> None:
    found = change(new, old)

    assert (worse, better) == (len(found.worse), len(found.better))
    assert p == found.p


def test_the_sign_test_is_that_of_the_binomial_distribution() -> None:
    from scipy.stats import binomtest

    for fewer, more in ((0, 1), (2, 9), (7, 7), (13, 4)):
        expected = binomtest(fewer, fewer + more).pvalue
        assert expected == pytest.approx(sign_test(fewer, more), abs=1e-12)


def test_trials_of_one_home_count_once() -> None:
    # Ten trials got worse, in two of four homes: that is no evidence about homes.
    found = change({seed for seed in range(20) if seed % 4 < 2}, set(), homes=4)

    assert (2, 0, 0.5) == (found.worse_units, found.better_units, found.p)
    assert "worse in 10 of 20 trials, in 2 homes worse and in 0 better" in found.words()
    assert found.direction == 0


def test_p_values_are_corrected_for_the_number_of_expectations() -> None:
    names = ["one", "two", "three"]

    def of(failing: set[int]) -> list[Tally]:
        found = reports(failing)
        return [Tally(TEST.name, name, {r.key: r.outcomes[0] for r in found}) for name in names]

    assert [3 * 2 / 2**6] * 3 == [c.p_holm for c in compare(of(set(range(6))), of(set()))]


def test_what_holds_by_less_is_told_although_no_verdict_differs() -> None:
    found = gate(set(), set(), margin=0.75)

    assert found.passes
    says = " ".join(answer(found).sentences)
    assert "finds (REQ-1) holds by less in 20 of 20 trials" in says
    assert "by 0.25 m in the median" in says


def test_failures_are_grouped_and_the_worst_leads() -> None:
    (each,) = tally([TEST], reports({3, 5}))

    assert FAILED == each.verdict
    assert [5, 3] == [key.seed for key in each.failed]
    assert "finds of home.yaml (REQ-1): failed in 2 of 20 trials, worst in seed 5: said 5" == (
        each.sentence()
    )


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
def test_what_speaks_against_a_release(
    new: set[int], old: set[int] | None, passes: bool, words: str
) -> None:
    found = gate(new, old)

    assert passes == found.passes
    assert words in headline(found)


def test_equal_builds_say_what_may_have_gone_unseen() -> None:
    assert "All 20 verdicts are those of 2.0; what differs in less than 13.9 % of trials may" in (
        str(answer(gate(set(), set())))
    )


def test_a_difference_that_may_be_chance_says_how_many_trials_would_show_it() -> None:
    # 3 of 20 are worse: 2 / 2**3 is .25, and 2 / 2**6 is below .05.
    says = " ".join(answer(gate({1, 2, 3}, set())).sentences)

    assert "finds (REQ-1) is worse in 3 of 20 trials (p = 0.25, not shown for other trials)" in says
    assert "whether finds differs for others, 2 times as many trials would show" in says
    assert "times as many" not in str(answer(gate(set(range(9)), set())))


def test_a_build_without_common_trials_is_not_compared() -> None:
    tallies = tally([TEST], reports(set()))
    found = Gate("2.1", tallies, "2.0", [], compare(tallies, []))

    assert "No trial of 2.0 is the same: nothing is compared." in answer(found).sentences


def test_a_build_that_does_not_run_is_said_and_does_not_pass() -> None:
    broken = [TrialReport(r.key, error="robots.astro.speeed: unknown key") for r in reports(set())]
    tallies = tally([TEST], broken)
    found = Gate("2.1", tallies, "2.0", tally([TEST], reports(set())))

    says = answer(found).sentences
    assert "2.1 doesn't pass: 1 test can't be run." == says[0]
    assert "home.yaml can't be run in 20 of 20 trials: robots.astro.speeed: unknown key." == says[1]
    assert "can't be run in 20 of 20 trials, first in seed 0: robots.astro.speeed" in (
        next(found.details({}))
    )


def test_each_requirement_has_the_worst_verdict_and_none_covers_some() -> None:
    failing = Tally("night.yaml", "quiet", tally([TEST], reports({1}))[0].outcomes, (), False)
    rows = cover(
        [*tally([TEST], reports(set())), failing], {"REQ-1": "finds Ana", "REQ-2": "greets"}
    )

    assert [("REQ-1", FAILED), ("REQ-2", NOT_COVERED)] == [(r.requirement, r.verdict) for r in rows]
    assert {("home.yaml", "finds"): HELD, ("night.yaml", "quiet"): FAILED} == rows[0].verdicts
    with pytest.raises(InputError, match="covers REQ-1, which isn't among the requirements"):
        cover(tally([TEST], reports(set())), {"REQ-9": "flies"})


def test_a_test_without_trials_is_not_run_and_what_it_covers_is_not_uncovered(
    fleet2d: Cli,
) -> None:
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


def test_a_python_test_with_a_rate_is_judged_by_it(fleet2d: Cli) -> None:
    Path("home.yaml").write_text(
        "simulation: {start: 2026-01-05, duration: 2 min, seed: 1}\nfloorplan: bundled\n"
        "robots: {astro: {type: patrol, dwell: 10 s}}\n"
    )
    Path("test_robot.py").write_text(
        "from fleet2d.testing import trial\n\n\n"
        "@trial('home.yaml', seeds=20, holds=0.8)\n"
        "def test_moves(trial):\n"
        "    trial.expect('eventually(moving(astro))', 'moves', covers=['REQ-3'])\n"
        "    assert trial.seed != 4, 'not four'\n"
    )
    code, out, _ = fleet2d("test", ".", "--workers", "1")

    assert code == 0
    assert "test_moves can't tell 80 % from " in out
    assert "1 of 1 requirement held" in out
    assert "19 of 19" in out  # the trial with the failed assert ended before it
    code, out, _ = fleet2d("test", "test_robot.py", "--seed", "4")
    assert code == 1
    assert "assert of test_robot.py::test_moves: failed in 1 of 1 trial, in seed 4: not four" in out
