"""What a study ends in is true: in odd cases, and beside what a statistician computes."""

import json
import math
import re
from typing import Any

import numpy as np
import polars as pl
import pytest
from scipy import stats
from tests.studies.scenes import SPEED, base, run, small

from fleet2d.errors import RunDirectoryError
from fleet2d.studies.answers import StudyAnswers
from fleet2d.studies.directory import Meta, MetricFacts
from fleet2d.studies.intervals import ENOUGH_UNITS
from fleet2d.studies.sentences import Conclusion, StudyAnswer
from fleet2d.studies.specification import PairedComparison

METHOD, HOME, SEED = "method", "home", "seed"
COLUMNS = (METHOD, HOME, SEED)


class MadeUp(StudyAnswers):
    """A study whose variants are made up, with a metric `score`, of which more is better."""

    location = "made up"
    columns = COLUMNS
    populations = (HOME, SEED)
    meta = Meta(
        name="made up",
        description="Is the new one better?",
        code="",
        columns=COLUMNS,
        populations=(HOME, SEED),
        tables=(),
        metrics={"score": MetricFacts(better={"": "higher"})},
    )
    comparisons = (PairedComparison(metric="score", against={METHOD: "old"}),)

    def __init__(self, frame: pl.DataFrame):
        self.frame = frame

    @property
    def variants(self) -> pl.DataFrame:
        return self.frame

    @property
    def answer(self) -> Conclusion:
        return StudyAnswer(self).answer()


def made_up(scores, status="complete") -> MadeUp:
    """Return a study with scores (homes, seeds) of each method; None: it has no such number."""
    return MadeUp(
        pl.DataFrame(
            {
                "variant": 0, METHOD: method, HOME: home, SEED: seed, "status": status,
                "error": "no battery" if status == "failed" else None,
                "score": None if score is None else float(score),
                "wall_s": 1.0, "simulated_s": 60.0,
            }
            for method, homes in scores.items()
            for home, seeds in enumerate(homes)
            for seed, score in enumerate(seeds)
        )
    )  # fmt: skip


def of_homes(**scores) -> MadeUp:
    """Return a study with a score of each method for each home, and one seed."""
    return made_up({method: [[score] for score in homes] for method, homes in scores.items()})


def drawn(shape, homes, effect, chance=0) -> MadeUp:
    """Return a study of homes of a shape, with a method that is better by an effect."""
    generator = np.random.default_rng((chance, homes))
    draw = SHAPES[shape]
    old, new = draw(generator, homes), draw(generator, homes)
    return of_homes(old=old, new=new + effect * np.std(draw(generator, 10_000)))


SHAPES: dict[str, Any] = {
    "normal": lambda g, n: g.normal(3, 1, n),
    "lognormal": lambda g, n: np.exp(g.normal(0, 1, n)),
    "exponential": lambda g, n: g.exponential(1, n),
    "70 % are zero": lambda g, n: (g.random(n) < 0.3) * g.exponential(1, n),
    "one in ten": lambda g, n: np.where(g.random(n) < 0.1, 8.0, 1.0) * np.exp(g.normal(0, 0.3, n)),
    "outliers": lambda g, n: g.standard_t(3, n),
    "shares near 0": lambda g, n: g.beta(0.5, 9.5, n),
    "shares near 1": lambda g, n: g.beta(9.5, 0.5, n),
    "ties": lambda g, n: g.poisson(1, n).astype(float),
    "bimodal": lambda g, n: g.choice([1.0, 3.0], n) + g.normal(0, 0.2, n),
}
DIFFERENCES = [0.1 * n - 0.9 + (3.0 if n == 4 else 0) for n in range(19)]
NOISE = np.random.default_rng(4).normal(0, 1, 30)
NOISE = (NOISE - NOISE.mean()) / NOISE.std(ddof=1)
ODD: dict[str, tuple[MadeUp, str]] = {
    "all failed": (
        made_up({"old": [[1]], "new": [[2]]}, "failed"),
        "of 2 variants 2 failed, most often because: no battery",
    ),
    "one home": (
        made_up({"old": [range(8)], "new": [[s + 1 + s % 2 for s in range(8)]]}),
        "new against old, in 8 of 8 seeds; by how much can't be told",
    ),
    "one home, said": (made_up({"old": [[1, 2]], "new": [[2, 4]]}), "It holds for 1 home only"),
    "one seed": (of_homes(old=[1, 2, 3], new=[1, 3, 2]), "It holds for 1 seed only"),
    "one pair": (made_up({"old": [[1]], "new": [[2]]}), "new against old: there is only one pair"),
    "no variance": (
        of_homes(old=[0] * 8, new=[0.5] * 8),
        "in 8 of 8 homes; by how much can't be told, as all 8 values are equal",
    ),
    "no variance in few homes": (of_homes(old=[0] * 3, new=[0.5] * 3), "6 homes (now 3) would"),
    "constant": (of_homes(old=[7] * 5, new=[7] * 5), "The same in every pair: score with method"),
    "missing in some": (
        of_homes(old=[1, 2, 3, 4], new=[2, None, None, 4]),
        "2 complete variants lack score",
    ),
    "missing in a method": (
        of_homes(old=[1, 2], new=[None, None]),
        "Can't be told: score with method = new, as none of its variants has it.",
    ),
    "missing in one of three": (
        of_homes(old=[1, 2], new=[2, 3], newer=[None, None]),
        "score with method = newer, as none of its variants has it.",
    ),
    "missing in all": (of_homes(old=[None, None], new=[None, None]), "Can't be told: "),
    "no number": (of_homes(old=[1, 2, 3], new=[math.nan, math.inf, 3]), "2 complete variants lack"),
    "70 % are zero": (
        of_homes(old=[0.0] * 20, new=[0.0] * 14 + [1.0, 2.0, 3.0, 1.0, 2.0, 1.0]),
        "Can't be told: score",
    ),
    "one in ten eight times": (
        of_homes(old=[0.0] * 10, new=[-0.7, -0.6, -0.8, -0.7, -0.5, -0.7, -0.6, -0.9, -0.7, 7.2]),
        "where the mean is 0.1 higher, but only 1 of 10 pairs are",
    ),
    "none of one in ten among them": (
        of_homes(old=[0.0] * 10, new=[-0.7, -0.6, -0.8, -0.7, -0.5, -0.7, -0.6, -0.9, -0.7, -0.6]),
        "which is worse, with method = new against old, in 10 of 10 homes; by how much can't be",
    ),
    "ties": (of_homes(old=[0, 1] * 20, new=[0, 1] * 18 + [1, 2, 1, 1]), "Can't be told: score"),
    "an outlier": (of_homes(old=[0.0] * 19, new=DIFFERENCES), "Can't be told: score"),
    "Holm and no correction": (
        of_homes(old=[0.0] * 30, **{f"m{n}": NOISE + 0.4 for n in range(3)}),
        "No difference is clear, of 3 comparisons",
    ),
    "Holm and Bonferroni": (
        of_homes(old=[0.0] * 30, a=NOISE + 2, b=NOISE + 2, c=NOISE + 0.4),
        "is higher, which is better, with method = c against old, by 0.4 (0 to ",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", ODD)
def test_an_odd_case_ends_in_true_sentences(case):
    study, expected = ODD[case]
    answer = study.answer
    text = " ".join(answer.sentences)
    assert expected in text
    assert 2 <= len(answer.sentences) <= 6
    for sentence in answer.sentences:
        assert re.fullmatch(r"[A-Z0-9].{10,}\.", sentence)
    assert not re.search(r"\b(nan|inf|None|null)\b", f"{answer} {answer._repr_html_()}")
    assert json.loads(json.dumps(answer.content, allow_nan=False))
    for c in StudyAnswer(study).comparisons:
        low, high = c.interval
        assert c.is_clear == (c.outcome in ("better", "worse"))
        assert not c.is_clear or c.p_holm < 0.05
        assert math.isnan(low) or low <= c.difference <= high
        if not c.estimate.doubt:
            assert c.is_clear == (low >= 0 or high <= 0)


def test_a_study_that_names_no_comparison_compares_what_can_be_judged(tmp_path):
    _, study = run(small(), tmp_path / "speeds")
    assert {f"{SPEED} = 0.6 against 0.3"} == {row["compared"] for row in study.answer.table}
    assert all("sightings" in row["number"] for row in study.answer.table)
    _, alone = run(small(axes={}), tmp_path / "alone")
    assert "There is nothing to compare" in alone.answer.sentences[0]
    assert "sightings" in " ".join(row["number"] for row in alone.answer.table)


def test_a_value_that_failed_everywhere_is_named_without_being_asked_for(tmp_path):
    (tmp_path / "mine.py").write_text(
        "from fleet2d import Algorithm\n"
        "class Fails(Algorithm):\n"
        "    def update(self, history, state):\n        raise ValueError('no more')\n"
    )
    fails = {"algorithms.own": {"type": f"{tmp_path}/mine.py:Fails", "period": "1 min"}}
    axes = {METHOD: {"options": {"old": {SPEED: 0.3}, "new": fails}}}
    _, study = run(small(axes=axes), tmp_path / "study")
    text = " ".join(study.answer.sentences)
    assert "with method = new, as none of its variants is complete" in text
    assert "3 of 6 variants have no result, most often because: algorithms.own failed" in text
    assert "There is nothing to compare" not in text


def test_a_study_that_goes_on_with_another_fleet_answers_for_that_one(tmp_path):
    def fleet(*radii):
        options = {f"home {r}": {"users.ana.radius": r} for r in radii}
        axes = {SPEED: [0.3, 0.6], HOME: {"options": options, "population": True}}
        compare = [{"metric": "distance.astro", "against": {SPEED: 0.3}}]
        return small(base=base(), axes=axes, replicates=1, compare=compare)

    run(fleet(0.2, 0.25), tmp_path / "study")
    with pytest.raises(RunDirectoryError, match="2 of scenarios that the study no longer has"):
        run(fleet(0.25, 0.3, 0.35), tmp_path / "study")
    _, study = run(fleet(0.25, 0.3, 0.35), tmp_path / "study", changed="redo")
    alone = run(fleet(0.25, 0.3, 0.35), tmp_path / "alone")[1].answer
    assert alone.table == study.answer.table
    assert alone.sentences[:-1] == study.answer.sentences[:-1]
    assert "It took 6 runs" in study.answer.sentences[-1]


def claim_of(study: MadeUp) -> tuple[str, float]:
    """Return what a statistician says of the new method, and the p value, by other means.

    Of few homes he counts them; of many he exchanges the signs of their differences.
    """
    old, new = (study.frame.filter(method=name)["score"].to_numpy() for name in ("old", "new"))
    differences = new - old
    if len(differences) < ENOUGH_UNITS:
        above, below = int((differences > 0).sum()), int((differences < 0).sum())
        p = stats.binomtest(above, above + below).pvalue
    else:
        p = stats.permutation_test(
            (new, old), lambda x, y: (x - y).mean(), permutation_type="samples",
            n_resamples=4000, rng=1,
        ).pvalue  # fmt: skip
    outcome = "better" if differences.mean() > 0 else "worse"
    return (outcome if p < 0.05 else "can't tell"), float(p)


@pytest.mark.parametrize("homes", [10, 30, 40])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_statistician_says_the_same_of_the_same_table(shape, homes):
    study = drawn(shape, homes, effect={10: 1.5, 30: 0.7, 40: 0.0}[homes])
    (comparison,) = StudyAnswer(study).comparisons
    claim, p = claim_of(study)
    assert claim == comparison.outcome or 0.01 < p < 0.25
    assert {claim, comparison.outcome} != {"better", "worse"}
    text = study.answer.sentences[0 if comparison.is_clear else 1]
    assert ("which is better" in text) == (comparison.outcome == "better")


def test_a_long_table_says_how_many_rows_are_left_out():
    rows = tuple({"number": f"m{n}", "mean": 0.5} for n in range(14))
    assert str(Conclusion("", ("Done.",), rows)).endswith("m11     0.5\n… and 2 more rows")
    assert "<p>… and 2 more rows</p>" in Conclusion("", ("Done.",), rows)._repr_html_()
    assert "more row" not in str(Conclusion("", ("Done.",), rows[:12]))
