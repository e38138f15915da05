"""What came of interactions: counts, value, interruptions and attitudes, from known answers."""

import numpy as np
import pytest
from tests.entities.robots.test_interact import PILL, Scripted, ana, home
from tests.scenes import table

import fleet2d

METRICS = {"interactions": {"period": "1 h"}}


def measured(**changes):
    run = fleet2d.run(home("2 h", metrics=METRICS, **changes))
    return run.metrics["interactions"]["astro"]["ana"], run


def test_what_is_accepted_counts_with_its_value_then():
    pill = PILL | {"falls_to": 0.5}
    numbers, run = measured(interactions={"pill": pill})

    asked = int(table(run, "interactions")["asked_at"][0])
    value = 4 * (1 - 0.5 * (asked - 600) / 3600)
    assert (1, 1, 1.0, 1.0) == tuple(numbers[k] for k in ("wanted", "asked", "kept", "accepted"))
    assert value == pytest.approx(numbers["value"])
    assert 4 - value == pytest.approx(numbers["missed"])
    assert 5.0 == numbers["wait_s"]


def test_what_is_declined_is_answered_and_missed():
    numbers, _ = measured(users={"ana": ana(outcomes=("declined",))})

    assert {"answered": 1.0, "accepted": 0.0, "kept": 0.0, "value": 0.0, "missed": 4.0} == {
        name: numbers[name] for name in ("answered", "accepted", "kept", "value", "missed")
    }


@pytest.mark.parametrize("outcome", ["sent_away", "banned", "switched_off"])
def test_being_sent_away_is_no_answer(outcome):
    numbers, _ = measured(users={"ana": ana("bedroom", (outcome,))})

    assert (0.0, 1) == (numbers["answered"], numbers[outcome])


def test_who_is_not_reached_is_missed():
    numbers, _ = measured(robots={"astro": {"behaviors": [{"type": "interact", "seek": False}]}})

    assert (1, 0, 4.0) == (numbers["wanted"], numbers["asked"], numbers["missed"])


def test_bad_times_count_by_activity_and_annoy():
    person = ana(outcomes=("ignored",))
    numbers, run = measured(users={"ana": person})
    assert {"read": 0} == numbers["interrupted"]  # at even odds of being available

    cooks = {"at": "07:00", "place": "kitchen", "activity": "cook"}
    reads = {"at": "07:02", "place": "kitchen", "activity": "read"}
    days = [{"on": "daily", "items": [cooks, reads]}]
    person = ana() | {"days": days, "answers": {"activity": {"base": -3}}}
    numbers, run = measured(users={"ana": person})
    rows = table(run, "interactions")
    noticed = int((rows["outcome"] != "").sum())
    assert {"cook": 0, "read": noticed} == numbers["interrupted"]  # zeros, for means over runs
    assert 0 == numbers["sent_away"]
    assert numbers["annoyance"] > 0.2
    assert rows["willingness"].max() < 0.1


def test_annoyance_and_burden_fade_between_the_prompts_of_a_run():
    months = {"type": "fading", "annoyed_by": 1, "annoyance_lasts": "30 min"}
    person = ana() | {"answers": Scripted(outcomes=("accepted",), months=months)}
    pill = PILL | {"at": [], "every": "1 h", "within": "50 min"}
    _, run = measured(users={"ana": person}, interactions={"pill": pill})
    rows = table(run, "interactions")
    (hours,) = np.diff(rows["asked_at"]) / 3600

    # Each prompt adds 0.5 to annoyance, as she is available with even odds, and 1/7 to the burden.
    assert [0.5, 0.5 + 0.5 * 0.25**hours] == pytest.approx(rows["annoyance"].tolist())
    assert [1 / 7, (1 + np.exp(-hours / 168)) / 7] == pytest.approx(rows["burden"].tolist())


def test_waking_somebody_is_counted():
    days = [{"on": "daily", "items": [{"at": "07:02", "place": "bedroom", "activity": "sleep"}]}]
    person = ana() | {"days": days, "answers": {"notice": {"base": 20}}}
    numbers, _ = measured(users={"ana": person})

    assert 1 == numbers["woke"]
    assert {"sleep": 1} == numbers["interrupted"]


def test_algorithms_cannot_read_answers():
    from fleet2d import Algorithm
    from fleet2d.errors import ComponentError

    class Curious(Algorithm):
        """Reads the truth."""

        def update(self, history, state):
            return {"n": len(history.answers)}

    with pytest.raises(ComponentError, match="'answers' is ground truth"):
        fleet2d.run(home("2 h", algorithms={"curious": Curious()}))
