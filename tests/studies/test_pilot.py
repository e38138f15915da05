"""A pilot tells before a study what one of its size can tell."""

import polars as pl
import pytest
from tests.studies.scenes import SPEED, base, small

from fleet2d.studies.driver import check_study
from fleet2d.studies.executors import Crew, SerialExecutor
from fleet2d.studies.pilot import Pilot

ASKED = [{"metric": "distance.astro", "against": {SPEED: 0.6}}]


def pilot(**keys) -> Pilot:
    return Pilot(check_study(small(compare=ASKED, **keys)))


def test_it_has_all_that_is_compared_in_each_of_some_homes_and_seeds():
    homes = {f"home {n}": {"users.ana.radius": 0.2 + n / 100} for n in range(5)}
    axes = {
        SPEED: [0.2, 0.3, 0.4, 0.6],
        "dwell": {"key": "robots.astro.dwell", "values": [0, "1 min"]},
        "home": {"options": homes, "population": True},
    }
    chosen = pilot(base=base(), axes=axes, replicates=6).chosen()
    assert [0.2, 0.3, 0.6] == chosen[SPEED].unique().sort().to_list()
    assert 1 == chosen["dwell"].n_unique()
    units = chosen.group_by("home", "seed").agg(pl.len())
    assert (12, [3]) == (len(units), units["len"].unique().to_list())
    assert (4, 4) == (units["home"].n_unique(), units["seed"].n_unique())


@pytest.mark.parametrize(
    ("seeds", "words"),
    [
        (5, "From 5 seeds it can tell nothing, as even if all agree that may be chance."),
        (9, "From 9 seeds it tells no amounts, and which is better only if 8 agree."),
    ],
)
def test_few_units_tell_only_a_direction(seeds, words):
    tried = pilot(replicates=seeds)
    tried.run(Crew(SerialExecutor()))
    answer = tried.answer(workers=1)
    assert words in answer.sentences
    assert "in four of five studies 29 seeds show a difference of" in answer.sentences[-1]


def test_a_pilot_of_a_study_that_compares_nothing_says_so():
    tried = Pilot(check_study(small(axes={}, replicates=3)))
    tried.run(Crew(SerialExecutor()))
    sentences = tried.answer(workers=1).sentences
    assert "It compares nothing; from 29 seeds on it tells means with intervals." == sentences[-1]


def test_a_pilot_without_time_says_that_it_can_not_tell():
    tried = pilot(replicates=9)
    tried.run(Crew(SerialExecutor(), batch_s=0.0), seconds=0)
    assert 1 == len(tried.variants)
    sentences = tried.answer(workers=1).sentences
    assert sentences[0].startswith("By a pilot of 1 run, its 18 runs take")
    assert sentences[-1].startswith("For what differences show, two of its homes or seeds must")
