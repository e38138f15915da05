"""The gate: tallies, paired comparisons and coverage from the outcomes of trials."""

from pathlib import Path

import pytest

from fleet2d.errors import InputError
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


def reports(failing, homes=1, margin=1.0) -> list[TrialReport]:
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


def change(new, old, homes=1) -> PairedChange:
    (found,) = compare(tally([TEST], reports(new, homes)), tally([TEST], reports(old, homes)))
    return found


def gate(new, old: set[int] | None = None, margin=1.0) -> Gate:
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
def test_pairs_that_differ_give_an_exact_p_value(new, old, worse, better, p):
    found = change(new, old)

    assert (worse, better) == (len(found.worse), len(found.better))
    assert p == found.p


def test_the_sign_test_is_that_of_the_binomial_distribution():
    from scipy.stats import binomtest

    for fewer, more in ((0, 1), (2, 9), (7, 7), (13, 4)):
        expected = binomtest(fewer, fewer + more).pvalue
        assert expected == pytest.approx(sign_test(fewer, more), abs=1e-12)


def test_trials_of_one_home_count_once():
    # Ten trials got worse, in two of four homes: that is no evidence about homes.
    found = change({seed for seed in range(20) if seed % 4 < 2}, set(), homes=4)

    assert (2, 0, 0.5) == (found.worse_units, found.better_units, found.p)
    assert "worse in 10 of 20 trials, in 2 homes worse and in 0 better" in found.words()
    assert found.direction == 0


def test_p_values_are_corrected_for_the_number_of_expectations():
    names = ["one", "two", "three"]

    def of(failing) -> list[Tally]:
        found = reports(failing)
        return [Tally(TEST.name, name, {r.key: r.outcomes[0] for r in found}) for name in names]

    assert [3 * 2 / 2**6] * 3 == [c.p_holm for c in compare(of(set(range(6))), of(set()))]


def test_failures_are_grouped_and_the_worst_leads():
    (each,) = tally([TEST], reports({3, 5}))

    assert FAILED == each.verdict
    assert [5, 3] == [key.seed for key in each.failed]
    assert "finds of home.yaml (REQ-1): failed in 2 of 20 trials, worst in seed 5: said 5" == (
        each.sentence()
    )


def test_each_requirement_has_the_worst_verdict_and_none_covers_some():
    failing = Tally("night.yaml", "quiet", tally([TEST], reports({1}))[0].outcomes, (), False)
    rows = cover(
        [*tally([TEST], reports(set())), failing], {"REQ-1": "finds Ana", "REQ-2": "greets"}
    )

    assert [("REQ-1", FAILED), ("REQ-2", NOT_COVERED)] == [(r.requirement, r.verdict) for r in rows]
    assert {("home.yaml", "finds"): HELD, ("night.yaml", "quiet"): FAILED} == rows[0].verdicts
    with pytest.raises(InputError, match="covers REQ-1, which isn't among the requirements"):
        cover(tally([TEST], reports(set())), {"REQ-9": "flies"})


def test_a_python_test_with_a_rate_is_judged_by_it(fleet2d):
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
