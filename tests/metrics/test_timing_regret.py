"""Regret of requests: the best time of the same life, which lives under other policies confirm."""

from datetime import timedelta

import pytest
from tests.entities.robots.test_interact import PILL, home
from tests.scenes import table

import fleet2d
from fleet2d.algorithms.algorithm import Algorithm
from fleet2d.errors import ComponentError

# She accepts at rest, whoever asks; a busy person never has time. The request comes up at 07:10.
SURE = {"base": 50}
ITEMS = [
    {"at": "07:02", "place": "kitchen", "activity": "cook", "dwell": "30 min"},
    {"place": "kitchen", "activity": "rest"},
]
ANSWERS = {
    "notice": SURE,
    "activity": {"base": 50, "loads": {"cook": 100}},
    "importance": {"kinds": {"remind": 50}},
    "defers": 0,
}
FALLING = PILL | {"falls_to": 0.5, "tries": 1}


def life(*policy, **changes):
    person = {"type": "schedule", "days": [{"on": "daily", "items": ITEMS}], "answers": ANSWERS}
    behaviors = [{"type": "interact"}, {"type": "patrol"}]
    scenario = {
        "users": {"ana": person},
        "robots": {"astro": {"behaviors": behaviors}},
        "interactions": {"pill": FALLING},
        "metrics": {"timing_regret": {"period": "20 min"}, "interactions": {"period": "1 h"}},
    }
    return fleet2d.run(home("2 h", **(scenario | changes)), *policy)


def numbers_of(run):
    return run.metrics["timing_regret"]["astro"]["ana"]


def test_who_is_asked_at_a_bad_time_misses_the_best_one():
    run = life()
    row = table(run, "timing_regret")
    best_at, due_at = int(row["best_at"][0]), int(row["due_at"][0])

    assert [600] == row["due_at"].tolist()
    # From about 07:32 on she rests; the time is compared every five minutes.
    assert 32 * 60 <= best_at < 39 * 60
    best = 4 * (1 - 0.5 * (best_at - due_at) / 3600)
    assert best == pytest.approx(row["best"][0], abs=1e-6)
    assert {"requests": 1, "value": 0.0, "regret": pytest.approx(best)} == {
        name: numbers_of(run)[name] for name in ("requests", "value", "regret")
    }


def test_the_same_life_asked_at_the_best_time_has_no_regret():
    best_at = int(table(life(), "timing_regret")["best_at"][0])
    time = timedelta(hours=7, seconds=best_at)
    opens = f"{time.seconds // 3600:02}:{time.seconds // 60 % 60:02}"
    wait_for_it = [{"type": "interact", "when": f"{opens}-12:00"}, {"type": "patrol"}]
    numbers = numbers_of(life(robots={"astro": {"behaviors": wait_for_it}}))

    assert 0 == pytest.approx(numbers["regret"], abs=0.1)  # it has to drive to her
    assert numbers["value"] > 2.5


def test_prompts_for_other_requests_count_but_not_those_for_the_same():
    months = {"months": {"annoyed_by": 30}, "attitude": {"annoyance": -50}}
    patient = {"sends_away_at": 1e6}
    answers = {**ANSWERS, **months, **patient}
    person = {"type": "schedule", "days": [{"on": "daily", "items": ITEMS}], "answers": answers}
    alone = numbers_of(life(users={"ana": person}))
    # In the first half hour another request annoys her so much that nothing is accepted later.
    other = FALLING | {"do": "offer", "worth": 50, "at": ["07:05"], "within": "20 min"}
    both = life(users={"ana": person}, interactions={"pill": FALLING, "tune": other})
    rows = table(both, "timing_regret")

    assert alone["best_chance"] == pytest.approx(1.0)
    assert 0 == pytest.approx(rows["best_chance"][rows["request"] == "pill ana"][0], abs=1e-6)


def test_who_is_out_is_never_at_a_best_time():
    items = [{"at": "07:02", "away": True, "activity": "work"}]
    person = {"type": "schedule", "days": [{"on": "daily", "items": items}]}
    run = life(users={"ana": person})

    assert [-1] == table(run, "timing_regret")["best_at"].tolist()
    assert 0 == numbers_of(run)["regret"]


def test_times_are_compared_alike_whatever_the_period_and_the_spans():
    one, other, steps = (
        table(life(*changes), "timing_regret")
        for changes in (
            (),
            ("metrics.timing_regret.period=1 h",),
            ("simulation.max_span=1", "simulation.duration=1 h 30 min"),
        )
    )
    for name in ("best_at", "best", "best_chance", "value"):
        assert one[name].tolist() == other[name].tolist() == steps[name].tolist()


def test_algorithms_do_not_know_how_people_answer():
    class Curious(Algorithm):
        """Reads the truth."""

        def update(self, history, state):
            return {"n": len(history.answer_models)}

    with pytest.raises(ComponentError, match="'answer_models' is ground truth"):
        life(algorithms={"curious": Curious()})
