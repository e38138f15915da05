"""Answers on made-up variants, where the truth is known."""

import math
import re

import numpy as np
import polars as pl
import pytest

import fleet2d
from fleet2d.errors import InputError
from fleet2d.studies.answers import StudyAnswers, judged, variance_ratio
from fleet2d.studies.directory import Meta

COLUMNS = ("method", "robot", "home", "seed")


def variants(homes=8, seeds=4, effect=0.5, noise=0.1, chance=0) -> pl.DataFrame:
    """Two methods of a known difference, in homes and lives that differ much more."""
    generator = np.random.default_rng(chance)
    home, seed = generator.normal(0, 2, homes), generator.normal(0, 1, seeds)
    return pl.DataFrame(
        {
            "method": method, "robot": robot, "home": h, "seed": s, "variant": 0,
            "score": home[h] + seed[s] + effect * (method == "new") + generator.normal(0, noise),
        }
        for method in ("old", "new")
        for robot in ("patrol", "hangout")
        for h in range(homes)
        for s in range(seeds)
    )  # fmt: skip


class Answers(StudyAnswers):
    """The answers of a study with these variants, whose metric is `score`."""

    meta = Meta(name="", description="", code="", columns=(), populations=(), tables=())
    populations = ("home", "seed")

    def __init__(self, frame: pl.DataFrame, *more):
        self.frame, self.columns = frame, (*COLUMNS, *more)

    def with_metric(self, metric, variants=None) -> pl.DataFrame:
        return self.frame


def compare(frame: pl.DataFrame, **keys):
    keys = {"by": ("home", "seed"), **keys}
    return Answers(frame).paired("score", {"method": "old"}, **keys).to_dicts()


def test_a_known_difference_is_found_though_homes_differ_more():
    (row,) = compare(variants())
    assert row["low"] < 0.5 < row["high"]
    assert row["high"] - row["low"] < 0.2
    assert "above old" in row["verdict"]
    assert (64, 8, 4) == (row["pairs"], row["n_home"], row["n_seed"])
    assert row["variance_ratio"] > 100  # pairs take out what homes and lives have in common


def test_missing_variants_leave_out_their_pairs_only():
    frame = variants().filter(~((pl.col("home") == 0) & (pl.col("method") == "new")))
    (row,) = compare(frame)
    assert (56, 7) == (row["pairs"], row["n_home"])


def test_an_axis_that_applies_on_one_side_only_needs_no_partner():
    frame = variants().with_columns(
        explore=pl.when(pl.col("method") == "new").then(0.2).otherwise(None)
    )
    table = Answers(frame, "explore").paired("score", {"method": "old"})
    assert 64 == table["pairs"][0]


@pytest.mark.parametrize("keys", [{"by": ("home", "method")}, {"within": ("method",)}])
def test_what_is_compared_is_no_unit_and_no_group(keys):
    with pytest.raises(InputError, match="method is what is compared"):
        compare(variants(), **keys)


def test_without_pairs_there_is_no_answer():
    frame = variants().filter((pl.col("method") == "new") == (pl.col("home") < 4))
    with pytest.raises(InputError, match="no two variants differ by method alone"):
        compare(frame)


def test_the_ratio_of_variances_is_that_of_unpaired_to_paired():
    generator = np.random.default_rng(2)
    life = generator.normal(0, 1, 4000)
    method_a, method_b = (life + generator.normal(0, 0.5, 4000) for _ in range(2))
    assert 5.0 == pytest.approx(
        variance_ratio(method_b, method_a), rel=0.1
    )  # 2 × 1.25 / (2 × 0.25)


@pytest.mark.slow
def test_hanging_out_or_not_has_the_variance_in_pairs_that_is_promised(tmp_path):
    """The same lives in the same homes; compared with runs whose home and seed are another's."""
    patrol = {"type": "patrol", "cooldown": "1 h"}
    hangout = {"type": "hangout", "source": "ltp", "near": "view", "period": "30 min"}
    study = fleet2d.study(
        {
            "base": {
                "extends": "bundled:paper",
                "simulation": {"start": "2026-01-05T17:00", "duration": "5 h"},
            },
            "axes": {
                "robot": {
                    "options": {
                        "off": {"robots.astro.behaviors": [patrol]},
                        "on": {"robots.astro.behaviors": [hangout, patrol]},
                    }
                },
                "home": {"synthetic": 3, "settings": {"furnish": True}},
            },
            "replicates": 6,
            "keep": {"metrics": ["sightings.*", "distance.*"]},
        },
        tmp_path / "hangout",
        executor="serial",
    )
    (walked,) = study.paired("distance.ana", {"robot": "off"}).to_dicts()
    # Her life is the same, whatever the robot does.
    assert (0, math.inf) == (walked["difference"], walked["variance_ratio"])
    frame = study.variants.sort("home", "seed")
    for metric in ("sightings.ana", "distance.astro"):
        (row,) = study.paired(metric, {"robot": "off"}).to_dicts()
        on, off = (
            frame.filter(frame["robot"] == name)[metric].to_numpy() for name in ("on", "off")
        )
        unpaired = np.concatenate([on - np.roll(off, shift) for shift in range(1, len(on))])
        assert 18 == row["pairs"] == len(on)
        assert unpaired.var() / (on - off).var() == pytest.approx(row["variance_ratio"], rel=0.15)


def test_an_effect_is_told_in_deviations_and_relative_to_the_reference():
    frame = pl.DataFrame(
        {"method": method, "robot": "patrol", "home": home, "seed": 0, "score": score}
        for method, scores in (("old", [2.0, 4.0, 6.0]), ("new", [3.0, 6.0, 9.0]))
        for home, score in enumerate(scores)
    )
    (row,) = compare(frame)
    assert (4.0, 0.5) == (row["reference"], row["relative"])
    assert row["effect_size"] == pytest.approx(2.0)  # differences 1, 2, 3


def test_differences_of_each_home_have_the_mean_of_all_within_another_axis_too():
    frame = variants()
    rows = Answers(frame).differences("score", {"method": "old"}, "home", ["robot"])
    assert ["method", "robot", "home", "difference"] == rows.columns
    for within in compare(frame, within=("robot",)):
        some = rows.filter(pl.col("robot") == within["robot"])
        assert 8 == len(some)
        assert within["difference"] == pytest.approx(some["difference"].mean())


def test_shares_of_the_variance_name_what_matters_and_last_what_no_axis_explains():
    assert "home" == Answers(variants(effect=0)).shares("score")["source"][0]
    table = Answers(variants(noise=3.0)).shares("score")
    assert "residual" == table["source"][-1]
    assert table["share"][-1] > 0.1
    assert 1 == pytest.approx(table["share"].sum())


def test_shares_of_the_variance_of_a_metric_called_count_are_those_of_any_other():
    frame = variants(noise=3.0)
    counted = Answers(frame.rename({"score": "count"})).shares("count")
    assert counted.equals(Answers(frame).shares("score"))


def test_shares_of_nothing_are_zero_and_no_rounding_errors():
    table = Answers(variants(effect=0, noise=0)).shares("score")
    shares = dict(table.iter_rows())
    assert 0 == shares["robot"] == shares["residual"] == shares["method × robot"]


def power(frame: pl.DataFrame, effect: float | None) -> pl.DataFrame:
    return Answers(frame).power("score", {"method": "old"}, effect)


def test_the_power_of_one_pair_is_unknown():
    with pytest.raises(InputError, match="run a small study"):
        power(variants(homes=1, seeds=1).filter(pl.col("robot") == "patrol"), 0.5)


class Shares(Answers):
    """The answers of a study whose metric is a share, the higher the better."""

    def limits(self, metric) -> tuple[float, float]:
        return 0.0, 1.0

    def better(self, metric):
        return "higher"


def by_method(*values) -> pl.DataFrame:
    """Variants of methods `old`, `m1`, `m2` …, with a value for each home."""
    names = ["old", *(f"m{n}" for n in range(1, len(values)))]
    return pl.DataFrame(
        {"method": name, "robot": "patrol", "home": home, "seed": 0, "score": score}
        for name, scores in zip(names, values, strict=True)
        for home, score in enumerate(scores)
    )


def test_intervals_of_shares_and_of_their_differences_stay_within_what_is_possible():
    answers = Shares(by_method([0.0, 0.0, 0.9, 0.0], [1.0, 0.9, 1.0, 0.0]))
    table = answers.paired("score", {"method": "old"}, ["home"])
    assert 1 == table["high"][0]
    means = answers.summary("score", ["method"])
    assert ["old", "m1"] == means["method"].to_list()
    assert means["low"].min() == 0
    assert means["high"].max() == 1


def test_a_verdict_follows_the_corrected_p():
    generator = np.random.default_rng(4)
    old = generator.normal(0, 1, 30)
    noise = generator.normal(0, 1, 30)
    noise = (noise - noise.mean()) / noise.std()
    methods = [old + noise + effect for effect in np.linspace(0.1, 1, 16)]
    rows = compare(by_method(old.tolist(), *(scores.tolist() for scores in methods)))
    assert any(row["p"] < 0.05 <= row["p_holm"] for row in rows)
    assert any(row["p_holm"] < 0.05 for row in rows)
    for row in rows:
        assert row["clear"] == (row["p_holm"] < 0.05) == ("above old" in row["verdict"])
        assert row["clear"] != ("too few replicates to tell" in row["verdict"])


def test_tables_that_are_read_together_are_corrected_together():
    generator = np.random.default_rng(4)
    old = generator.normal(0, 1, 30)
    new = old + 0.5 + generator.normal(0, 1, 30)
    answers = Answers(by_method(old.tolist(), new.tolist()))
    (alone,) = judged(answers.compared("score", {"method": "old"}))
    assert alone.is_clear
    together = judged([alone] * 30)
    assert 30 == len(together)
    assert not any(each.is_clear for each in together)
    assert all("for so many comparisons" in each.verdict for each in together)
    assert all(each.interval[0] < 0 < each.interval[1] for each in together)


HOMES = np.random.default_rng(4).uniform(0.3, 0.5, 30)
VERDICTS = {
    "few homes": (variants(homes=3, effect=0.05, noise=0.4), False, r"would show with .*homes \(now 3\)"),
    "one pair": (by_method([1.0], [2.0]), False, "one pair only: no interval"),
    "equal values": (variants(effect=0, noise=0), False, "the same as old in every pair$"),
    "equal differences of three homes": (
        by_method([1.0, 2.0, 4.0], [1.5, 2.5, 4.5]), False, "too few replicates to tell: a differ",
    ),
    "equal differences of eight homes": (
        by_method([1.0] * 8, [1.5] * 8), True, "above old in 8 of 8 pairs; how much can't be told: all 8",
    ),
    "clear in few homes": (
        variants(), True, "above old in 64 of 64 pairs; how much can't be told: with 8 homes, 43 %",
    ),
    "clear in enough homes": (variants(homes=30), True, "above old in 240 of 240 pairs$"),
}  # fmt: skip


@pytest.mark.parametrize("case", VERDICTS)
def test_a_verdict_says_what_pairs_show(case):
    frame, is_clear, words = VERDICTS[case]
    (row,) = compare(frame)
    assert is_clear == row["clear"]
    assert re.match(f"(too few replicates to tell: .*)?{words}", row["verdict"])
    assert math.isnan(row["low"]) == (case in ("one pair", *(c for c in VERDICTS if "equal" in c)))


def test_a_verdict_says_what_is_better():
    worse = HOMES - np.random.default_rng(5).uniform(0.1, 0.2, 30)
    answers = Shares(by_method(HOMES.tolist(), worse.tolist()))
    (row,) = answers.paired("score", {"method": "old"}).to_dicts()
    assert "below old in 30 of 30 pairs, which is worse" == row["verdict"]


def test_a_mean_against_most_pairs_tells_nothing_from_few_homes():
    few = [-0.02, -0.01, -0.03, -0.02, 4.0, 4.2, 4.1]
    (row,) = compare(by_method([0.0] * 7, few))
    assert not row["clear"]
