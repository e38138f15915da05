"""What is done to cameras and perception, beside the same run in which nothing is done."""

from functools import cache

import pytest
from tests.scenes import digests, entries, scenario

import fleet2d
from fleet2d.errors import PlacementError, ScenarioError
from fleet2d.interventions import Mistake, Restore

FOR_A_WHILE = "at: 10 min, duration: 10 min"
"""From step 600 to step 1199."""
STILL = {"start": [2.5, 3.0], "behaviors": []}
ROBOT = {
    "start": [4.0, 3.0],
    "start_heading_deg": 180,
    "behaviors": [],
    "camera": {"detection": 0.6},
}


def home(script="", **astro):
    """A robot that looks at somebody who stands before it, and at somebody who walks about."""
    return scenario(
        "30 min",
        users={"ana": STILL, "ben": {"type": "meander"}},
        robots={"astro": ROBOT | astro},
        script=entries(script),
    )


def rows(content):
    seen = fleet2d.run(content).pandas("observations")
    users = seen["user"].astype(object).where(seen["user"].notna(), None)
    return list(zip(seen["step"], users, seen["x"], seen["y"], strict=True))


@cache
def plain():
    return rows(home())


def during(row):
    return 600 <= row[0] < 1200


def mistaken(row):
    return (row[0], "ben", *row[2:]) if during(row) and row[1] == "ana" else row


CASES = {
    "a camera is off": (
        f"{FOR_A_WHILE}, switch_off: astro, camera: true",
        lambda row: None if during(row) else row,
    ),
    "a camera is dark": (
        f"{FOR_A_WHILE}, fault: astro, dark: camera",
        lambda row: None if during(row) else row,
    ),
    "somebody is suppressed": (
        f"{FOR_A_WHILE}, suppress: astro, user: ana",
        lambda row: None if during(row) and row[1] == "ana" else row,
    ),
    "somebody is mistaken": (
        f"{FOR_A_WHILE}, mistake: astro, user: ana, taken_for: ben",
        mistaken,
    ),
    "somebody is mistaken for nobody known": (
        f"{FOR_A_WHILE}, mistake: astro, user: ana, taken_for: unknown",
        lambda row: (row[0], None, *row[2:]) if during(row) and row[1] == "ana" else row,
    ),
    "two disturbances end one by one": (
        """
        at: 10 min, switch_off: astro, camera: true, duration: 4 min
        at: 12 min, fault: astro, dark: true, duration: 4 min
        """,
        lambda row: None if 600 <= row[0] < 960 else row,
    ),
    "a camera is switched on, and all is restored": (
        """
        at: 600 s, suppress: astro, user: ana, duration: 1 h
        at: 600 s, switch_off: astro, camera: true
        at: 700 s, switch_on: astro, camera: true
        at: 800 s, restore: astro
        """,
        lambda row: None if 600 <= row[0] < (800 if row[1] == "ana" else 700) else row,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_every_look_is_as_if_nothing_were_done_but_for_what_is_done(name):
    script, changed = CASES[name]
    expected = [row for row in map(changed, plain()) if row is not None]

    assert expected != plain()
    assert sorted(expected, key=str) == sorted(rows(home(script)), key=str)


def test_who_is_injected_is_perceived_in_every_look_and_all_else_stays():
    result = rows(home(f"{FOR_A_WHILE}, inject: astro, user: ben, spot: [6.5, 1.5]"))
    false = [row for row in result if row[1:] == ("ben", 6.5, 1.5)]
    assert list(range(600, 1200)) == [row[0] for row in false]
    assert plain() == [row for row in result if row not in false]


def test_a_worse_camera_notices_a_part_of_what_it_noticed():
    result = set(rows(home(f"{FOR_A_WHILE}, fault: astro, detection: 50 %")))
    missed = set(plain()) - result
    assert result < set(plain())
    assert all(map(during, missed))
    of_ana = [row for row in plain() if during(row) and row[1] == "ana"]
    assert 0.4 < len(missed.intersection(of_ana)) / len(of_ana) < 0.6


def test_a_camera_that_errs_for_a_while_errs_as_one_that_always_does():
    errs = {"attributes": {"range_noise": 0.2}, "identity": {"mistaken": [[0, 0.3]]}}
    content = home(f"{FOR_A_WHILE}, fault: astro")
    content["script"][0]["errs"] = errs
    expected = {row for row in rows(home(perception=errs)) if during(row)}
    expected |= {row for row in plain() if not during(row)}
    assert expected == set(rows(content))


@pytest.mark.parametrize("latency", ["0 s", "7 s"])
def test_spans_are_invisible_while_cameras_are_disturbed(latency):
    script = """
        at: 10 min, inject: astro, user: ana, spot: [6.5, 1.5], duration: 10 min
        at: 12 min, mistake: astro, user: ana, taken_for: ben, duration: 10 min
        at: 13 min, switch_off: astro, camera: true, duration: 90 s
        at: 15 min, fault: astro, errs: {false_positives: {per_hour: 60}}, duration: 10 min
    """
    camera = {"detection": 0.6, "latency": latency, "period": "3 s", "lost_after": "6 s"}
    whole, *others = (
        digests(fleet2d.run(home(script, camera=camera), max_span=span)) for span in (None, 1, 7)
    )
    assert [whole, whole] == others


def test_what_a_dark_camera_would_have_had_in_view_is_not_explored():
    script = "at: 0 s, switch_off: astro, camera: true"
    run = fleet2d.Simulation(home(script, behaviors=[{"type": "explore"}]))
    run.advance(300)
    area = run._state.layers.areas[0]
    assert not area.explored().any()
    run.do(Restore("astro"))
    run.advance(60)
    assert area.explored().any()


def test_somebody_unknown_is_refused_where_a_run_has_no_column_for_the_truth():
    run = fleet2d.Simulation(home())
    with pytest.raises(ScenarioError, match="put this into the scenario's script"):
        run.do(Mistake("astro", "ana", "unknown"))
    run.do(Mistake("astro", "ana", "ben"))


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("suppress: astro, user: anna", "did you mean 'ana'"),
        ("suppress: ana, user: ben", "no robot 'ana'"),
        ("mistake: astro, user: ana, taken_for: benn", "did you mean 'ben'"),
        ("inject: astro, user: ana, spot: [-5, 0]", "outside the home"),
        ("inject: astro, user: ana, spot: [1, 1], camera: left", "no camera 'left'"),
        ("switch_off: astro, behavior: patrl", "has no behavior 'patrl'"),
        ("switch_off: astro", "exactly one of 'camera'"),
        ("fault: astro", "nothing fails"),
    ],
)
def test_what_can_not_be_is_refused(entry, words):
    with pytest.raises((ScenarioError, PlacementError), match=words):
        fleet2d.Simulation(home(f"{FOR_A_WHILE}, {entry}"))
