"""What a household makes of its robots, compared with a slow twin that reads the tables."""

from itertools import groupby
from math import dist

import numpy as np
import pytest
from tests.entities.robots.robots import home_with
from tests.scenes import path, run, table

from fleet2d import Simulation
from fleet2d.engine.access import measured
from fleet2d.metrics.household import TERMS, has_time

PRIVATE = ("bedroom", "bathroom", "guest_room", "child_room", "toilet")
DAY = [
    {"at": "07:00", "place": "living_room", "activity": "read"},
    {"at": "07:40", "place": "kitchen", "activity": "work_at_home"},
    {"at": "08:10", "place": "living_room", "activity": "nap"},
    {"at": "08:40", "place": [7.0, 6.0], "activity": "wash"},
    {"at": "09:00", "away": True},
    {"at": "09:20", "place": "kitchen", "activity": "snack"},
]
HANGOUT = {"type": "hangout", "period": "7 min", "explore": 0.5}
FIND = {"type": "find", "every": "25 min", "deadline": "4 min"}
ASKS = {"type": "interact", "patience": "10 s"}
PILL = {"do": "remind", "to": "ana", "every": "40 min", "within": "30 min", "worth": 4, "tries": 2}


def home(behaviors, **sections):
    ana = {"type": "schedule", "days": [{"items": DAY}]}
    metrics = {"household": {}, "interactions": {}}
    return home_with(behaviors, "3 h", ana, metrics=metrics, **sections)


def twin(stored):
    """Count all terms of the robot from its tables; steps last a second."""
    robot, person = path(stored, "astro"), path(stored, "ana")
    rooms = stored.plan.rooms
    terms = dict.fromkeys(TERMS, 0.0)

    still = []  # for how many steps it hasn't left its place
    rests = []
    for place, steps in groupby(zip(robot.x, robot.y, strict=True)):
        still += [number for number, _ in enumerate(steps)]
        if still[-1] >= 60 and (not rests or dist(rests[-1], place) > 0.5):
            rests.append(place)
    terms["relocations"] = max(0, len(rests) - 1)

    begun = dict(table_of(stored, "ana", "step", "detail", event="activity"))
    activities = []
    for step in range(len(robot.step)):
        activities.append(begun.get(step, activities[-1] if step else ""))
    kinds = np.array([*(room.type for room in rooms), "away"])[person.room]
    is_alone = np.isin(activities, ["sleep", "nap"]) | np.isin(kinds, PRIVATE)
    welcome = ~person.away & ~is_alone
    together = (person.room == robot.room) & (person.room >= 0)
    near = together & welcome & (np.array(still) >= 60)
    terms["near_min"] = np.count_nonzero(near & [has_time(each) for each in activities]) / 60
    terms["disturbing_min"] = np.count_nonzero(together & ~person.away & is_alone) / 60

    for room in range(len(rooms)):
        for is_there, steps in groupby(robot.room == room):
            count = 0 if is_there else len(list(steps))
            terms["unvisited_h"] += count * (count + 1) / 2 / len(rooms) / 3600 / 86400

    begin = None
    for step, kind in [*table_of(stored, "astro", "step", "event"), (len(still), "gave_up")]:
        if kind == "find_begins":
            begin = step
        elif begin is not None and kind in ("found", "gave_up", "not_at_home"):
            terms["searching_min"] += (step - begin) / 60
            terms["finds"] += kind == "found" and welcome[step]
            begin = None

    if "interactions" in stored.tables:
        answers = table(stored, "interactions")
        terms["value"] = answers["value"][answers["outcome"] == "accepted"].sum()
        terms["bother"] = (1 - answers["willingness"])[answers["outcome"] != ""].sum()
        terms["woken"] = answers["woke"].sum()
    return terms


def table_of(stored, entity, *columns, **where):
    """Some columns of the events of a body, row by row."""
    rows = table(stored, "events", entity=entity, **where)
    return list(zip(*(rows[column].tolist() for column in columns), strict=True))


@pytest.mark.parametrize(
    ("behaviors", "interactions", "counted"),
    [
        ([HANGOUT], {}, ["near_min", "disturbing_min", "unvisited_h"]),
        ([FIND, HANGOUT], {}, ["finds", "searching_min", "relocations"]),
        ([ASKS, {"type": "patrol"}], {"pill": PILL}, ["value", "bother", "unvisited_h"]),
    ],
)
def test_terms_are_those_of_the_tables(behaviors, interactions, counted):
    stored = run(home(behaviors, interactions=interactions))
    terms = stored.metrics["household"]["astro"]

    assert twin(stored) == pytest.approx(terms)
    assert all(terms[name] > 0 for name in counted)


def test_terms_are_the_same_however_the_run_is_cut():
    content = home([FIND, HANGOUT])
    content["robots"]["rosie"] = {**content["robots"]["astro"], "start": "kitchen"}
    whole = run(content).metrics["household"]
    simulation = Simulation(content)
    for step in (1, 2, 59, 61, 1000, 1001, 4321, 9999):
        simulation.run_until(step)
        measured(simulation, "household")
    simulation.run_until(simulation.clock.steps)

    assert {"astro", "rosie"} == set(whole)
    assert whole == run(content, "metrics.household.period=7 min").metrics["household"]
    assert whole == simulation.finish().metrics["household"]


@pytest.mark.parametrize(
    ("activity", "expected"),
    [("tv", True), ("cook", True), ("care", True), ("study", False), ("shower", False)],
)
def test_who_is_busy_has_no_time(activity, expected):
    assert expected == has_time(activity)


@pytest.mark.parametrize(
    ("place", "activity", "near", "disturbing"),
    [
        ("living_room", "sleep", 0, 60),
        ("bathroom", "read", 0, 60),
        ("living_room", "read", 59, 0),  # resting begins a minute after the last move
    ],
)
def test_sleepers_and_people_in_bathrooms_are_disturbed(place, activity, near, disturbing):
    items = [{"at": "00:00", "place": place, "activity": activity}]
    ana = {"type": "schedule", "days": [{"items": items}], "start": place}
    astro = {"start": place, "behaviors": []}
    stored = run(home_with([], "1 h", ana, astro=astro, metrics={"household": {}}))
    terms = stored.metrics["household"]["astro"]

    assert [near, disturbing] == pytest.approx(
        [terms["near_min"], terms["disturbing_min"]], abs=0.3
    )
