"""Methods of sight in runs: the same run by each, whoever looks; and users who look themselves."""

import numpy as np
import pytest
from tests.scenes import TESTS, digests, everything, run, scenario, table
from tests.thorough import some

import fleet2d
from fleet2d import Behavior
from fleet2d.errors import ComponentError, Fleet2DError, InputError
from fleet2d.sight import cached_fov
from fleet2d.sight.fov import FieldOfView

HERE = f"{TESTS.as_posix()}/engine/test_cameras_points"
ODD = {
    "range": [0.3, 5], "angle_deg": 140, "offset": [0.1, -0.04], "heading_deg": 30, "body_points": 6,
    "pan": {"headings_deg": [-60, 0, 60], "dwell": "7 s"},
}  # fmt: skip
METHODS = [
    {"type": "visibility_polygon"},
    {"type": "visibility_polygon", "keep": 2},
    {"type": "visibility_polygon", "precompute": "all"},
]


class XRay(FieldOfView):
    """A user's own method, for which walls don't count."""

    def visible(self, home, x, y, points):
        return np.ones(len(points), np.bool_)


class Wrong(FieldOfView):
    """One that answers with numbers."""

    def visible(self, home, x, y, points):
        return np.ones(len(points), np.int64)

    def sees(self, home, x, y, heading, reach, points):
        return self.visible(home, x, y, points)


class Broken(FieldOfView):
    """One that fails."""

    def visible(self, home, x, y, points):
        raise KeyError("glass")


class Shy(Behavior):
    """Goes elsewhere when a robot comes into view."""

    records = frozenset({"shied"})

    def decide(self, now):
        for event in now.events:
            plan = now.plan().note("shied", f"{event.event} {event.user}").go_to("bedroom")
            return plan.stay().interrupt_on("robot_lost")
        return now.plan().stay().interrupt_on("robot_seen")


def stored_without_scenario(content, **changes):
    """Return the digests of a run's tables."""
    return {
        name: digest for name, digest in digests(run(content, **changes)).items() if name != "run"
    }


def with_odd_cameras():
    """The scenario with everything; two robots have odd cameras, one of them several."""
    content = everything("20 min")
    content["robots"]["curio"].pop("camera")
    content["robots"]["curio"]["cameras"] = {"odd": ODD, "plain": {"period": "3 s"}}
    content["robots"]["bolt"]["camera"] = ODD
    return content


@pytest.mark.parametrize("method", METHODS, ids=["visited", "few kept", "all"])
def test_run_is_the_same_by_every_exact_method(method):
    content = with_odd_cameras()
    expected = stored_without_scenario(content)

    assert expected == stored_without_scenario({**content, "sight": {"method": method}})
    assert len(table(run(content), "observations")["step"]) > 50


def test_run_by_flashlight_is_the_same_where_users_stand_at_centres_of_cells(monkeypatch):
    users = {name: {"start": room} for name, room in (("ana", "kitchen"), ("ben", "living_room"))}
    robots = {
        "astro": {"type": "patrol", "dwell": "5 s"},
        "drift": {"type": "meander", "camera": {"range": [0.2, 3], "angle_deg": 200}},
    }
    content = scenario("30 min", users=users, robots=robots)
    expected = stored_without_scenario(content)

    assert len(table(run(content), "observations")["step"]) > 50
    for memory_bytes in (64e6, 10e3):
        monkeypatch.setattr(cached_fov, "MEMORY_BYTES", memory_bytes)
        method = {"type": "flashlight"}
        assert expected == stored_without_scenario({**content, "sight": {"method": method}})


@pytest.mark.slow
@pytest.mark.parametrize("span", some([50, 1], 2))
def test_spans_do_not_show_in_a_run_by_another_method(span):
    content = {**with_odd_cameras(), "sight": {"method": {"type": "flashlight"}}}

    assert digests(run(content)) == digests(run(content, max_span=span))


def test_own_method_decides_who_is_in_view():
    users = {"ana": {"start": [7.5, 0.5]}}
    robot = {"start": [0.5, 3.5], "start_heading_deg": -20, "camera": {"range": [0, 20]}}
    content = scenario("1 min", users=users, robots={"astro": robot})

    assert 0 == len(table(run(content), "observations")["step"])
    own = {**content, "sight": {"method": {"type": f"{HERE}:XRay"}}}
    assert 60 == len(table(run(own), "observations")["step"])


@pytest.mark.parametrize(
    ("method", "why"),
    [
        (
            "Wrong",
            r"sight.method failed at step 0: Wrong returned array\(\[1\]\), expected a bool array",
        ),
        ("Broken", r"sight.method failed at step 0: KeyError: 'glass'"),
    ],
)
def test_own_method_that_fails_is_blamed(method, why):
    robot = {"start": [0.5, 3.5], "start_heading_deg": 0}
    content = scenario("1 min", users={"ana": {"start": [2, 3.5]}}, robots={"astro": robot})
    with pytest.raises(ComponentError, match=why):
        run({**content, "sight": {"method": {"type": f"{HERE}:{method}"}}})


# --- Users who look --------------------------------------------------------------------------


def facing(**camera):
    """A user who looks along the living room, through which a robot goes to and fro."""
    user = {"start": [0.5, 3.5], "start_heading_deg": 0, "camera": {"range": [0, 9], **camera}}
    robot = {"type": "patrol", "waypoints": [[4.0, 3.5], [7.5, 0.5]], "dwell": "20 s"}
    robot |= {"start": [4.0, 3.0], "start_heading_deg": 90}
    return scenario("10 min", users={"ana": user}, robots={"astro": {**robot, "camera": None}})


def sights(stored):
    rows = stored.pandas("events")
    rows = rows[rows["event"].str.startswith("robot_")]
    return list(zip(rows["step"], rows["entity"], rows["event"], rows["detail"], strict=True))


def test_user_sees_a_robot_just_when_a_robot_like_the_user_would_see_a_user_like_it():
    content = facing(lost_after="1 s")
    ana = dict(content["users"]["ana"])
    astro = {**content["robots"]["astro"], "radius": 0.2, "speed": 0.6, "turn_rate_deg": 90}
    astro.pop("camera")
    robot = {**content["robots"]["astro"], "radius": 0.2}
    swapped = {**content, "users": {"astro": astro}, "robots": {"ana": {**ana, "radius": 0.2}}}
    rows = run(swapped).pandas("events")
    rows = rows[rows["event"].str.startswith("user_")]
    expected = [
        (step, event.replace("user", "robot"))
        for step, event in zip(rows["step"], rows["event"], strict=True)
    ]
    result = sights(run({**content, "robots": {"astro": robot}}))

    assert expected == [(step, event) for step, _, event, _ in result]
    assert len(result) > 8
    assert {("ana", "astro")} == {(who, whom) for _, who, _, whom in result}


def test_user_is_interrupted_by_the_sight_of_a_robot_and_spans_do_not_show():
    content = facing()
    content["users"]["ana"]["behaviors"] = [{"type": f"{HERE}:Shy"}]
    stored = run(content)
    rows = stored.pandas("events")

    assert "robot_seen astro" == rows[rows["event"] == "shied"]["detail"].iloc[0]
    assert digests(stored) == digests(run(content, max_span=1))


def test_users_who_look_change_nothing_else():
    content = everything("20 min")
    looking = everything("20 min")
    looking["users"]["ben"]["camera"] = {"angle_deg": 180}
    before, after = stored_without_scenario(content), stored_without_scenario(looking)

    assert before.keys() == after.keys()
    assert ["events"] == [name for name in before if before[name] != after[name]]


def test_user_that_errs_is_refused():
    with pytest.raises(InputError, match=r"camera.perception: .*users see robots as they are"):
        fleet2d.load_scenario(facing(perception={"detection": {"distance": 0.5}}))
    content = facing()
    content["users"]["ana"].update(behaviors=[{"type": f"{HERE}:Shy"}], camera=None)
    with pytest.raises(Fleet2DError, match="need a camera"):
        run(content)
