"""Ask policies: what they observe, which requests they may serve, and what the robot does then."""

import numpy as np
import pytest
from tests.entities.robots.test_interact import ana, home
from tests.scenes import run

from fleet2d import Simulation
from fleet2d.engine.access import run_until_asked, situation_of
from fleet2d.entities.robots.ask_policy import ASK_COLUMNS, AskPolicy
from fleet2d.errors import ComponentError, InputError

AT = {name: number for number, name in enumerate(ASK_COLUMNS)}
PILL = {"do": "remind", "to": "ana", "at": ["07:10"], "within": "1 h", "worth": 4, "takes": "30 s"}
TEA = {"do": "offer", "to": "ana", "at": ["07:20"], "within": "1 h", "worth": 1, "takes": "30 s"}


OBSERVED = []


class First(AskPolicy):
    """Serve the first request that may be served, and keep what was observed."""

    def act(self, observation, mask):
        OBSERVED.append(observation)
        return int(mask.argmax())


def asking(*behaviors, duration="2 h", **changes):
    own = {"type": "tests.entities.robots.test_ask_policy:First", "requests": 3}
    astro = {"behaviors": list(behaviors) or [own, {"type": "patrol"}]}
    changes = {"interactions": {"pill": PILL, "tea": TEA}, "robots": {"astro": astro}} | changes
    return home(duration, **changes)


def choices(content, choose):
    """Let a function of observation and mask choose; return times, observations and masks."""
    simulation = Simulation(content)
    rows = []
    while run_until_asked(simulation, "astro"):
        behavior = simulation.actors["astro"].behaviors[0]
        now = situation_of(simulation, "astro")
        rows.append((f"{now.time:%H:%M}", behavior.observe(now), behavior.mask(now)))
        behavior.given = choose(*rows[-1][1:])
    return simulation, rows


@pytest.mark.parametrize(
    "outcomes", [("accepted",), ("deferred", "ignored"), ("sent_away", "declined")]
)
def test_actions_from_outside_repeat_the_run_of_the_policy(outcomes):
    """Also where it is sent away, so that an order interrupts its question."""

    def life():
        people = {"ana": ana(outcomes=outcomes), "ben": ana("living_room")}
        interactions = {"pill": PILL, "tea": {**TEA, "to": "ben", "at": ["07:10"]}}
        return asking(users=people, interactions=interactions)

    OBSERVED.clear()
    stored = run(life())
    simulation, rows = choices(life(), lambda _, mask: int(mask.argmax()))

    assert stored.digest == simulation.finish().digest
    assert len(OBSERVED) > 1
    assert np.array_equal(np.stack(OBSERVED), np.stack([table for _, table, _ in rows]))


def test_who_waits_chooses_again_after_a_period_and_when_a_request_comes_up():
    own = {"type": "ask_policy", "requests": 3, "period": "25 min"}
    _, rows = choices(asking(own, {"type": "patrol"}), lambda _, mask: len(mask) - 1)

    assert ["07:10", "07:20", "07:45", "08:10"] == [time for time, *_ in rows]


def test_mask_has_what_is_open_and_the_wait():
    own = {"type": "ask_policy", "requests": 3}
    simulation, rows = choices(asking(own, {"type": "patrol"}), lambda _, mask: len(mask) - 1)

    assert [[True, False, False, True], [True, True, False, True]] == [
        m.tolist() for *_, m in rows[:2]
    ]
    assert simulation.step == simulation.clock.steps


def test_observation_is_of_the_queue_and_the_answers():
    content = asking(users={"ana": ana(outcomes=("declined", "accepted"))})
    _, rows = choices(content, lambda _, mask: int(mask.argmax()))
    first, last = rows[0][1], rows[-1][1]

    assert (3, len(ASK_COLUMNS)) == first.shape
    expected = {
        "interaction": [1, 1, 0],
        "open": [1, 0, 0],
        "do_remind": [1, 0, 0],
        "worth": [2 / 3, 1 / 3, 0],
    }
    for name, column in expected.items():
        assert column == pytest.approx(first[:, AT[name]]), name
    assert [0.5, 0.5] == first[:2, AT["yes"]].tolist()
    assert pytest.approx([1 / 3, 2 / 3]) == [last[0, AT["yes"]], last[1, AT["time_now"]]]
    assert last[0, AT["asked_1h"]] > 0.5
    assert max(np.abs(table).max() for _, table, _ in rows) <= 1


@pytest.mark.parametrize(
    ("action", "reason"),
    [(1, "tea, which isn't open"), (2, "interaction 2, which doesn't exist"), (4, "from 0 to 3")],
)
def test_impossible_action_is_an_error_with_the_reason(action, reason):
    simulation = Simulation(asking({"type": "ask_policy", "requests": 3}))
    run_until_asked(simulation, "astro")
    behavior = simulation.actors["astro"].behaviors[0]
    now = situation_of(simulation, "astro")
    with pytest.raises(InputError, match=reason):
        behavior.check(now, action, behavior.mask(now))


def test_more_interactions_than_rows_are_refused():
    with pytest.raises(ComponentError, match=r"2 interactions.*set requests: 2"):
        run(asking({"type": "ask_policy", "requests": 1}))
