"""What is done to cameras and perception, beside the same run in which nothing is done."""

from functools import cache

import pytest
from tests.scenes import digests, scenario

import fleet2d
from fleet2d.errors import PlacementError, ScenarioError
from fleet2d.interventions import Mistake, Restore, Suppress, SwitchOff, SwitchOn

# While it is done: steps 600 to 1199.
BEGIN, END = 600, 1200
STILL = {"start": [2.5, 3.0], "behaviors": []}
ROBOT = {
    "start": [4.0, 3.0],
    "start_heading_deg": 180,
    "behaviors": [],
    "camera": {"detection": 0.6},
}


def home(*script, camera=None, **more):
    """A robot that looks at somebody who stands before it, and at somebody who walks about."""
    astro = ROBOT | ({} if camera is None else {"camera": camera})
    return scenario(
        "30 min",
        users={"ana": STILL, "ben": {"type": "meander"}},
        robots={"astro": astro},
        script=[{"at": "10 min", "duration": "10 min", **entry} for entry in script],
        **more,
    )


def rows(run):
    seen = run.pandas("observations")
    users = seen["user"].astype(object).where(seen["user"].notna(), None)
    return list(zip(seen["step"], users, seen["x"], seen["y"], strict=True))


@cache
def plain():
    return rows(fleet2d.run(home()))


def during(step):
    return BEGIN <= step < END


def test_a_camera_that_is_off_sees_nobody_and_all_others_looks_stay():
    expected = [row for row in plain() if not during(row[0])]
    assert expected == rows(fleet2d.run(home({"switch_off": "astro", "camera": True})))
    assert expected == rows(fleet2d.run(home({"fault": "astro", "dark": "camera"})))


def test_who_is_suppressed_is_not_noticed_though_in_view():
    expected = [row for row in plain() if not (during(row[0]) and row[1] == "ana")]
    assert expected != plain()
    assert expected == rows(fleet2d.run(home({"suppress": "astro", "user": "ana"})))


def test_who_is_mistaken_is_perceived_as_the_other_at_the_same_places():
    expected = [
        (step, "ben" if during(step) and user == "ana" else user, x, y)
        for step, user, x, y in plain()
    ]
    result = rows(fleet2d.run(home({"mistake": "astro", "user": "ana", "taken_for": "ben"})))
    assert sorted(expected, key=str) == sorted(result, key=str)


def test_who_is_injected_is_perceived_in_every_look_and_all_else_stays():
    result = rows(fleet2d.run(home({"inject": "astro", "user": "ben", "spot": [6.5, 1.5]})))
    false = [row for row in result if row[1:] == ("ben", 6.5, 1.5)]
    assert list(range(BEGIN, END)) == [row[0] for row in false]
    assert plain() == [row for row in result if row not in false]


def test_a_worse_camera_notices_a_part_of_what_it_noticed():
    result = rows(fleet2d.run(home({"fault": "astro", "detection": "50 %"})))
    assert set(result) < set(plain())
    before = [row for row in plain() if during(row[0]) and row[1] == "ana"]
    now = [row for row in result if during(row[0]) and row[1] == "ana"]
    assert [row for row in result if not during(row[0])] == [r for r in plain() if not during(r[0])]
    assert 0.4 < len(now) / len(before) < 0.6


def test_a_camera_that_errs_for_a_while_errs_as_one_that_always_does():
    errs = {"attributes": {"range_noise": 0.2}, "identity": {"mistaken": [[0, 0.3]]}}
    always = home()
    always["robots"]["astro"]["perception"] = errs
    expected = {row for row in rows(fleet2d.run(always)) if during(row[0])}
    expected |= {row for row in plain() if not during(row[0])}
    assert expected == set(rows(fleet2d.run(home({"fault": "astro", "errs": errs}))))


@pytest.mark.parametrize("latency", ["0 s", "7 s"])
def test_spans_are_invisible_while_cameras_are_disturbed(latency):
    script = (
        {"inject": "astro", "user": "ana", "spot": [6.5, 1.5]},
        {"at": "12 min", "mistake": "astro", "user": "ana", "taken_for": "ben"},
        {"at": "13 min", "switch_off": "astro", "camera": True, "duration": "90 s"},
        {"at": "15 min", "fault": "astro", "errs": {"false_positives": {"per_hour": 60}}},
    )
    camera = {"detection": 0.6, "latency": latency, "period": "3 s", "lost_after": "6 s"}
    runs = [fleet2d.run(home(*script, camera=camera), max_span=span) for span in (None, 1, 7)]
    assert digests(runs[0]) == digests(runs[1]) == digests(runs[2])


def test_what_a_dark_camera_would_have_had_in_view_is_not_explored():
    content = home({"at": "0 s", "duration": "30 min", "switch_off": "astro", "camera": True})
    content["robots"]["astro"]["behaviors"] = [{"type": "explore"}]
    run = fleet2d.Simulation(content)
    run.advance(300)
    area = run._state.layers.areas[0]
    assert not area.explored().any()
    run.do(Restore("astro"))
    run.advance(60)
    assert area.explored().any()


def test_overlapping_disturbances_end_one_by_one():
    first = {"at": "10 min", "switch_off": "astro", "camera": True, "duration": "4 min"}
    second = {"at": "12 min", "fault": "astro", "dark": True, "duration": "4 min"}
    result = rows(fleet2d.run(home(first, second)))
    assert [row for row in plain() if not 600 <= row[0] < 960] == result


def test_what_is_restored_is_over():
    run = fleet2d.Simulation(home())
    run.advance(600)
    run.do(Suppress("astro", "ana", duration="1 h"))
    run.do(SwitchOff("astro", camera=True))
    run.advance(100)
    run.do(SwitchOn("astro", camera=True))
    run.advance(100)
    run.do(Restore("astro"))
    result = rows(run.run())
    dark = [r for r in plain() if 600 <= r[0] < 700]
    missed = [r for r in plain() if 700 <= r[0] < 800 and r[1] == "ana"]
    assert [row for row in plain() if row not in {*dark, *missed}] == result


def test_somebody_unknown_is_refused_where_a_run_has_no_column_for_the_truth():
    run = fleet2d.Simulation(home())
    with pytest.raises(ScenarioError, match="put this into the scenario's script"):
        run.do(Mistake("astro", "ana", "unknown"))
    run.do(Mistake("astro", "ana", "ben"))


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({"suppress": "astro", "user": "anna"}, "did you mean 'ana'"),
        ({"suppress": "ana", "user": "ben"}, "no robot 'ana'"),
        ({"mistake": "astro", "user": "ana", "taken_for": "benn"}, "did you mean 'ben'"),
        ({"inject": "astro", "user": "ana", "spot": [-5, 0]}, "outside the home"),
        ({"inject": "astro", "user": "ana", "spot": [1, 1], "camera": "left"}, "no camera 'left'"),
        ({"switch_off": "astro", "behavior": "patrl"}, "has no behavior 'patrl'"),
        ({"switch_off": "astro"}, "exactly one of 'camera'"),
        ({"fault": "astro"}, "nothing fails"),
    ],
)
def test_what_can_not_be_is_refused(entry, words):
    with pytest.raises((ScenarioError, PlacementError), match=words):
        fleet2d.Simulation(home(entry))
