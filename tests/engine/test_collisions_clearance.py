"""Giving way: robots stop before people, wait, go round; the same for every span."""

import numpy as np
import pytest
from tests.entities.robots.robots import (
    OUT,
    assert_same_for_every_max_span,
    home_with,
    names,
)
from tests.entities.robots.test_find import belief
from tests.scenes import expecting, path, run, unmet

import fleet2d
from fleet2d.errors import InputError

GIVES_WAY = {"distance": 0.4, "patience": "10 s"}
KEPT = 0.2 + 0.15 + 0.4
WALK = {"type": "tests.own_components:Scripted"}


def stands(x, y):
    return {"type": "schedule", "days": [{"items": [{"at": "00:00", "place": [x, y]}]}]}


def tours(*waypoints, dwell="20 s"):
    return {"type": "patrol", "waypoints": list(waypoints), "dwell": dwell, "look_around": False}


TO_AND_FRO = tours([1.0, 3.5], [4.5, 3.5])


def polite(ana, behaviors=(TO_AND_FRO,), duration="10 min", start=(1.0, 3.0), **fields):
    astro = {"gives_way": {**GIVES_WAY, **fields}, "start": list(start)}
    content = home_with(list(behaviors), duration, ana, astro=astro)
    content["users"]["ben"] = OUT
    return content


def in_the_door(seconds):
    """Somebody who stands in the doorway of the kitchen for a time."""
    script = [seconds, [7.0, 1.0], 1200.0]
    return {**WALK, "start": [5.05, 3.1], "speed": 1.0, "script": script}


def find(at, deadline):
    return {"type": "find", "user": "ben", "at": [at], "deadline": deadline}


THROUGH_THE_DOOR = [tours([2.0, 3.1], [7.0, 3.1], [1.0, 6.0])]
HANGOUT = {"type": "hangout", "source": "rtp", "explore": 0, "period": "30 min"}
CASES = {
    "it waits before somebody and then goes round": (
        polite(stands(3.0, 3.2)),
        """
        eventually(events(gives_way, astro))
        always(distance(astro, ana) > 0.35)
        eventually(distance(astro, [4.5, 3.5]) < 0.1)
        eventually(during(07:06-07:10) and distance(astro, [1.0, 3.5]) < 0.1)
        """,
    ),
    "it comes no nearer while it is patient": (
        polite(stands(2.8, 3.5), patience="1 h"),
        """
        always(distance(astro, ana) >= 0.74)
        eventually(events(gives_way, astro))
        at_most(1, events(gives_way, astro), per=day)
        """,
    ),
    "it waits at a door": (
        polite(in_the_door(60.0), THROUGH_THE_DOOR),
        """
        always(distance(astro, ana) >= 0.4)
        never(events(gives_up, astro))
        eventually(room(astro) == kitchen)
        eventually(room(astro) == bedroom)
        """,
    ),
    "it lets somebody through a door and goes on with its round": (
        polite(
            {**WALK, "start": [7.0, 3.1], "speed": 0.6, "script": [12.0, [1.0, 0.6], 600.0]},
            [tours([6.5, 3.1], [6.5, 1.0], dwell="30 s")],
            "4 min",
            start=(2.0, 3.1),
            patience="30 s",
        ),
        """
        eventually(events(gives_way, astro))
        after(events(gives_way, astro), room(astro) == kitchen, within=4 min)
        """,
    ),
    # It looks ever more seldom, and makes the stop behind the one that it leaves out.
    "it gives up where nobody moves": (
        polite(in_the_door(1200.0), THROUGH_THE_DOOR),
        """
        always(distance(astro, ana) >= 0.4)
        after(events(gives_way, astro), events(gives_up, astro), within=120..133 s)
        never(room(astro) == kitchen)
        eventually(room(astro) == bedroom)
        """,
    ),
    "a look that was held up counts as one": (
        polite(
            stands(3.0, 3.0),
            [find("07:01", "8 min"), tours([1.0, 3.0], dwell="1 d")],
            "12 min",
            patience="3 s",
        ),
        """
        eventually(events(gives_way, astro))
        eventually(room(astro) == kitchen)
        eventually(room(astro) == bedroom)
        eventually(room(astro) == bathroom)
        """,
    ),
    "events at the begin of a plan are told though it waits": (
        polite(
            stands(3.6, 3.5),
            [find("07:02", "2 min"), tours([3.0, 3.5], dwell="1 d")],
            start=(3.0, 3.5),
            patience="1 min",
        ),
        """
        at_most(1, events(find_begins, astro), per=day)
        after(events(find_begins, astro), events(gave_up, astro), within=3 min)
        """,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_how_a_robot_gives_way(name):
    content, expected = CASES[name]
    content = {**content, "expect": expecting(expected)}
    assert [] == unmet(assert_same_for_every_max_span(content, 61, 7, 1))


@pytest.mark.parametrize("step", ["250 ms", "2 s"])
def test_steps_of_any_length_give_the_same(step):
    find = {"type": "find", "every": "2 min", "deadline": "1 min"}
    content = polite("meander", [find, "patrol"])
    content["robots"]["astro"]["camera"] = {"lost_after": "6 s"}  # a multiple of each step
    content["simulation"]["step"] = step
    assert_same_for_every_max_span(content, 61, 1)


def test_a_place_that_is_taken_is_left_alone_until_it_thinks_again():
    content = polite(OUT, [HANGOUT], "2 h", gives_up="1 min") | belief(bathroom_1=1)
    free = path(run(content), "astro")
    taken = stands(float(free.x[-1]), float(free.y[-1]))
    content["users"]["ana"] = {"type": "schedule", **taken}
    content["expect"] = expecting("always(distance(astro, ana) > 0.4)")
    stored = assert_same_for_every_max_span(content, 61)
    assert 3 <= names(stored).count("gives_up") <= 4  # once in half an hour
    assert [] == unmet(stored)


def own_approaches(stored, user="ana"):
    """How near the robot's own moves bring it to where somebody was, of those that bring it nearer [m]."""
    one, other = path(stored, "astro"), path(stored, user)
    before = np.hypot(one.x[:-1] - other.x[:-1], one.y[:-1] - other.y[:-1])
    after = np.hypot(one.x[1:] - other.x[:-1], one.y[1:] - other.y[:-1])
    return after[(after < before - 1e-9) & ~other.away[:-1]]


@pytest.mark.parametrize(
    "behaviors",
    [["meander"], [TO_AND_FRO], ["opportunistic", "patrol"], ["follow", "patrol"]],
    ids=["meander", "patrol", "opportunistic", "follow"],
)
def test_it_never_drives_into_anybody_in_a_crowd(behaviors):
    stored = assert_same_for_every_max_span(polite("meander", behaviors, "40 min"), 61)
    assert "gives_way" in names(stored)
    assert own_approaches(stored).min() >= 0.35
    rude = run(home_with(behaviors, "40 min", "meander"))
    assert own_approaches(rude).min() < 0.35


def test_it_never_drives_into_anybody_for_days_in_a_furnished_home():
    member = {
        "type": "routine",
        "household": {"members": {"ana": "works_from_home", "ben": "retired"}},
    }
    content = {
        "simulation": {"start": "2026-01-05", "duration": "3 d", "seed": 4},
        "floorplan": {"type": "bundled", "furnish": True},
        "users": {"ana": member, "ben": member},
        "robots": {"astro": {"behaviors": [{"type": "patrol", "dwell": "1 min"}], "gives_way": {}}},
    }
    stored = run(content)
    nearest = [own_approaches(stored, user) for user in ("ana", "ben")]
    assert min(result.min() for result in nearest) >= 0.35
    # Nearer than it likes it comes only where it has waited, and there is no more room.
    assert sum(int((result < KEPT - 0.01).sum()) for result in nearest) < 60
    content["simulation"]["ghosts"] = True
    rude = run({**content, "robots": {"astro": {"type": "patrol", "dwell": "1 min"}}})
    assert sum(int((own_approaches(rude, user) < 0.35).sum()) for user in ("ana", "ben")) > 10


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"distance": -1}, "distance"),
        ({"patience": 0}, "longer than 0"),
        ({"gives_up": 0}, "longer than 0"),
        ({"politeness": 1}, "unknown key"),
    ],
)
def test_bad_settings_are_refused(fields, words):
    with pytest.raises(InputError, match=words):
        fleet2d.Simulation(polite("meander", **fields))
